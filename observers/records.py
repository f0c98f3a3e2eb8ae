"""An observer in use: two records, and what is measured.

OBSERVER holds what is fixed: which observer, its discrete coefficients, and the ship as the observer
believes it to be (a PLANT record of its own, so that a wrong belief is one assignment). ESTIMATE holds
what changes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.compiled import Record, compiled
from ..plant.record import PLANT
from ..plant.signals import SIGNALS

OBSERVER = np.dtype(
    [
        ("kind", np.int64),  # whose update, see code_of
        ("address", np.int64),  # of another's update in this process; 0 for ours
        ("reads_instruments", np.int64),
        ("dt", np.float64),
        # linear observers: x+ = transition x + now u(t+dt) + before u(t), u = (omega, M_m)
        ("transition", np.float64, (2, 2)),
        ("before", np.float64, (2, 2)),
        ("now", np.float64, (2, 2)),
        ("gain", np.float64),  # of the immersion-and-invariance observer; 1 / T of an inflow [1/s]
        # of Kalman filters: variances per step of shaft speed and advance velocity, or densities
        ("process", np.float64, (4,)),
        ("measurement", np.float64),  # variance of the shaft speed
        ("spread", np.float64, (4,)),  # standard deviations at the start
        ("tracks", np.int64),  # which number of the ship
        ("number", np.float64),  # as the ship's file has it
        ("lowest", np.float64),  # that it may be
        ("highest", np.float64),
        ("ship", PLANT),
    ],
    align=True,
)

ESTIMATE = np.dtype(
    [
        ("started", np.int64),
        ("x", np.float64, (4,)),  # states; the number of the ship that is tracked stands last
        ("covariance", np.float64, (4, 4)),
        ("shaft_speed", np.float64),  # measured at the last sample
        ("shaft_torque", np.float64),
        ("pitch_ratio", np.float64),
        ("advance_velocity", np.float64),
        ("valid", np.int64),
        (
            "answer",
            np.float64,
            (2,),
        ),  # of an update that is not ours: velocity, whether to trust it
    ],
    align=True,
)


TRACKED = 3
"""Place in ``x`` and ``covariance`` of a number of the ship that an observer tracks."""


class Measurement(NamedTuple):
    """What the instruments say at one instant.

    ``advance_velocity`` is the truth, for the oracle alone; ``shaft_acceleration`` is for the one
    observer that asks for an accelerometer.
    """

    shaft_speed: float  # [rad/s]
    shaft_torque: float  # [N m]
    pitch_ratio: float  # [-]
    shaft_acceleration: float  # [rad/s2]
    advance_velocity: float  # [m/s]


READINGS = ["shaft_speed_rad_s", "shaft_torque_N_m", "pitch_ratio", "shaft_acceleration_rad_s2"]
"""Columns of a recording that the observers read, in the order of a :class:`Measurement`."""


_HIGHEST = {signal.name: float(signal.high) for signal in SIGNALS}
_MAX_SPEED = _HIGHEST["shaft_speed"]
_MAX_TORQUE = _HIGHEST["measured_shaft_torque"]
_MAX_PITCH = _HIGHEST["measured_pitch_ratio"]

PITCH_MARGIN = 0.1
"""How far a measured P/D may lie beyond the ship's range [-], for noise and offsets."""


@compiled
def is_plausible(m: Measurement) -> bool:
    """Whether speed, torque and pitch are numbers within the bounds of the signal registry."""
    return (
        abs(m.shaft_speed) <= _MAX_SPEED
        and abs(m.shaft_torque) <= _MAX_TORQUE
        and abs(m.pitch_ratio) <= _MAX_PITCH
    )


@compiled
def pitch_is_known(ship: Record, pitch_ratio: float) -> bool:
    """Whether a pitch lies in the ship's range, with :data:`PITCH_MARGIN`."""
    lowest, highest = ship.pitch_ratio_min - PITCH_MARGIN, ship.pitch_ratio_max + PITCH_MARGIN
    return bool(lowest <= pitch_ratio <= highest)


@compiled
def remember(estimate: Record, m: Measurement, velocity: float, valid: bool) -> None:
    """Store this sample's measurement and estimate."""
    estimate.started = 1
    estimate.shaft_speed = m.shaft_speed
    estimate.shaft_torque = m.shaft_torque
    estimate.pitch_ratio = m.pitch_ratio
    estimate.advance_velocity = velocity
    estimate.valid = 1 if valid else 0
