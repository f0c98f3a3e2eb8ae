"""The thesis on advance-velocity observers: its tables and figures, ours beside."""
