"""Records of an observer, and the measurement that it processes.

OBSERVER holds the constants: code of the observer, discrete coefficients and the ship model (a PLANT
record of its own, so that a model error can be assigned to it). ESTIMATE holds the variables.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.record import PLANT
from ..plant.signals import get_signal

Floats = NDArray[np.float64]

OBSERVER = np.dtype(
    [
        ("kind", np.int64),  # code of the update function, see base.code_of
        ("address", np.int64),  # of an external update function; 0 for those of this package
        ("uses_instruments", np.int64),
        ("dt", np.float64),
        # linear observers: x+ = transition x + now u(t+dt) + before u(t), u = (omega, M_m)
        ("transition", np.float64, (2, 2)),
        ("before", np.float64, (2, 2)),
        ("now", np.float64, (2, 2)),
        ("gain", np.float64),  # of immersion and invariance [m/rad]; 1 / T of the inflow [1/s]
        # Kalman filters: variances per step of shaft speed and advance velocity, or densities
        ("process", np.float64, (4,)),
        ("measurement", np.float64),  # variance of the shaft speed
        ("spread", np.float64, (4,)),  # initial standard deviations
        ("tracks", np.int64),  # code of the estimated ship parameter
        ("parameter", np.float64),  # its value in the ship file
        ("lowest", np.float64),  # range of the estimated parameter, or of the gain
        ("highest", np.float64),
        ("ship", PLANT),
    ],
    align=True,
)

ESTIMATE = np.dtype(
    [
        ("started", np.int64),
        ("x", np.float64, (4,)),  # states; an estimated ship parameter is the last
        ("covariance", np.float64, (4, 4)),
        ("shaft_speed", np.float64),  # measurements and estimate of the last sample
        ("shaft_torque", np.float64),
        ("pitch_ratio", np.float64),
        ("advance_velocity", np.float64),
        ("valid", np.int64),
        ("returned", np.float64, (2,)),  # by an external update: velocity, validity
    ],
    align=True,
)


TRACKED = 3
"""Index in ``x`` and ``covariance`` of the ship parameter that an observer estimates."""


class Measurement(NamedTuple):
    """Measurements of one instant.

    Only the oracle uses ``advance_velocity``, the true value. Only the observer ``shaft-acceleration``
    uses ``shaft_acceleration``.
    """

    shaft_speed: float  # [rad/s]
    shaft_torque: float  # [N m]
    pitch_ratio: float  # [-]
    shaft_acceleration: float  # [rad/s2]
    advance_velocity: float  # [m/s]


READINGS = ["shaft_speed_rad_s", "shaft_torque_N_m", "pitch_ratio", "shaft_acceleration_rad_s2"]
"""Columns of a recording that the observers use, in the order of a :class:`Measurement`."""

_INSTRUMENTS = ("shaft_speed", "measured_shaft_torque", "measured_pitch_ratio")
_MAX_SPEED, _MAX_TORQUE, _MAX_PITCH = (float(get_signal(name).high) for name in _INSTRUMENTS)
PITCH_MARGIN = 0.1  # tolerance on the range of the measured P/D [-], for noise and offsets


@compiled
def is_plausible(m: Measurement) -> bool:
    """Return whether speed, torque and pitch are finite and within the bounds of the signal registry.

    Example:
        >>> is_plausible(Measurement(10.0, 1.4e5, 1.3, 0.0, 8.0))
        True
    """
    inside = abs(m.shaft_speed) <= _MAX_SPEED and abs(m.shaft_torque) <= _MAX_TORQUE
    return inside and abs(m.pitch_ratio) <= _MAX_PITCH


@compiled
def pitch_is_known(ship: Record, pitch_ratio: float) -> bool:
    """Return whether a measured P/D lies in the range of the ship, with :data:`PITCH_MARGIN`."""
    lowest, highest = ship.pitch_ratio_min - PITCH_MARGIN, ship.pitch_ratio_max + PITCH_MARGIN
    return bool(lowest <= pitch_ratio <= highest)


@compiled
def store_sample(estimate: Record, m: Measurement, velocity: float, valid: bool) -> None:
    """Store the measurement and the estimate of this sample."""
    estimate.started = 1
    estimate.shaft_speed = m.shaft_speed
    estimate.shaft_torque = m.shaft_torque
    estimate.pitch_ratio = m.pitch_ratio
    estimate.advance_velocity = velocity
    estimate.valid = 1 if valid else 0
