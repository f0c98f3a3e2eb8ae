"""Read recordings, map them to canonical columns, clean them and check them against the ship."""

from .load import Recording, fetch, load_recording

__all__ = ["Recording", "fetch", "load_recording"]
