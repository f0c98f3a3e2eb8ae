"""The Gymnasium environment around the plant; nothing lives here yet."""
