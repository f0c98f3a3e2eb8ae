"""A real ROV thruster: diagnosed, and its numbers found."""
