"""The model tug Tito Neri: a measured drive train."""
