"""Inputs that slip, or that nobody means well with: refused with a message, nothing left or run."""
