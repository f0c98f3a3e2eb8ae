"""The catalogue of effects, and the search for those that a recording asks for."""
