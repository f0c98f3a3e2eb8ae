"""The ``shaftline`` command."""
