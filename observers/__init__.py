"""Observers: estimators of the advance velocity from shaft measurements, one file each.

- :func:`get_observer` returns an observer by name; :func:`observer_names` lists the names.
- :func:`follow` runs an observer over a series of measurements, :func:`follow_table` over a table.
  :func:`simulated_measurements` takes the measurements from a simulation.
- :func:`follow_parameter` returns the ship parameter that an observer estimates as well.
- :func:`update` processes one sample, for a simulation of your own.
- :func:`variance_accounted_for` measures how well an estimate agrees with the truth.

:class:`AugmentedFilter` estimates the states and parameters of any model, :class:`ShipFilter` those of a
ship along a recording.
"""

from .augmented import AugmentedFilter
from .augmented_kalman import AugmentedKalman
from .base import Observer, ObserverError
from .following import (
    add_noise,
    add_noise_to_table,
    follow,
    follow_parameter,
    follow_record,
    follow_table,
    simulated_measurements,
    variance_accounted_for,
)
from .records import ESTIMATE, OBSERVER, TRACKED, Measurement
from .registry import get_observer, observer_names, update
from .ship_filter import ShipFilter

__all__ = [
    "ESTIMATE", "OBSERVER", "TRACKED", "AugmentedFilter", "AugmentedKalman", "Measurement",
    "Observer", "ObserverError", "ShipFilter", "add_noise", "add_noise_to_table", "follow",
    "follow_parameter", "follow_record", "follow_table", "get_observer", "observer_names",
    "simulated_measurements", "update", "variance_accounted_for",
]  # fmt: skip
