"""A real ROV thruster: diagnosis and identification."""
