"""The numbers of a ship's file from recordings, with their uncertainty."""
