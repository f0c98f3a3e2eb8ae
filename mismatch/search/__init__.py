"""Catalogue of physical effects, and the search for the effects that explain a recording."""
