"""A learned policy as one file, and what stands between it and a ship."""
