"""Classic controllers that learned policies must beat; nothing lives here yet."""
