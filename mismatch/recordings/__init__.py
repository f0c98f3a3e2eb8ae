"""Recordings for the diagnosis: read, carried onto canonical columns, checked, described."""

from .load import Recording, fetch, load_recording

__all__ = ["Recording", "fetch", "load_recording"]
