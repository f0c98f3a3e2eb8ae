"""A real ROV thruster, diagnosed."""
