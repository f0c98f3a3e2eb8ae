"""A model of the tanker KVLCC2 in a towing tank: its wake from the straight parts of zig-zag tests."""
