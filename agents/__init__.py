"""Training and evaluation of learned policies; nothing lives here yet."""
