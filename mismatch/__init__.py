"""Locate, name, fit and prove what a simulation leaves out of a recording."""
