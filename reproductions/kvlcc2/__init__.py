"""A free-running model of the tanker KVLCC2 in a towing tank."""
