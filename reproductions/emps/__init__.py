"""Electro-mechanical positioning system: a real drive with friction."""
