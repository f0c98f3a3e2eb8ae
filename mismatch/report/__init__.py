"""A diagnosis for its readers: as data, as sentences, as a page with figures; an index of many."""

from .data import as_json
from .sentences import sentence

__all__ = ["as_json", "sentence"]
