"""Observers that estimate the advance velocity from shaft measurements, one file each."""

from .registry import (
    Observer,
    ObserverError,
    follow,
    follow_table,
    get_observer,
    observer_names,
    readings_of,
    update,
)

__all__ = [
    "Observer",
    "ObserverError",
    "follow",
    "follow_table",
    "get_observer",
    "observer_names",
    "readings_of",
    "update",
]
