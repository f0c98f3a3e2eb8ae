"""Observers that estimate the advance velocity from shaft measurements, one file each.

:func:`get_observer` gives one by name, :func:`follow` lets it follow a series of readings (of a
simulation: :func:`readings_of`), :func:`follow_table` a table's, and :func:`follow_number` gives the
number of the ship that an observer tracks; how well it does is told by
:func:`variance_accounted_for`. In a simulation of one's own :func:`update` takes a sample at a time.

:class:`AugmentedFilter` estimates states and numbers of any model, :class:`ShipFilter` those of a whole
ship along a recording.
"""

from .augmented import AugmentedFilter
from .augmented_kalman import AugmentedKalman
from .base import Observer, ObserverError
from .following import (
    follow,
    follow_number,
    follow_record,
    follow_table,
    readings_of,
    variance_accounted_for,
    with_noise,
    with_noisy_readings,
)
from .records import ESTIMATE, OBSERVER, TRACKED, Measurement
from .registry import get_observer, observer_names, update
from .ship_filter import ShipFilter

__all__ = [
    "ESTIMATE",
    "OBSERVER",
    "TRACKED",
    "AugmentedFilter",
    "AugmentedKalman",
    "Measurement",
    "Observer",
    "ObserverError",
    "ShipFilter",
    "follow",
    "follow_number",
    "follow_record",
    "follow_table",
    "get_observer",
    "observer_names",
    "readings_of",
    "update",
    "variance_accounted_for",
    "with_noise",
    "with_noisy_readings",
]
