"""Electro-mechanical positioning system: a real drive with friction, its numbers found."""
