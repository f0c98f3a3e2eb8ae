"""What all observers share: their records, the measurement, and the way from torque to velocity.

An observer is a pair of records. OBSERVER holds what is fixed: which observer, its discrete
coefficients, and the ship as the observer believes it to be (a PLANT record of its own, so that a
wrong belief is one assignment). ESTIMATE holds what changes.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.compiled import Record, compiled
from ..plant.open_water import (
    MIN_ADVANCE_RATIO,
    advance_ratio,
    invert_torque_coefficient,
    open_water,
    open_water_slope,
)
from ..plant.record import PLANT
from ..plant.signals import SIGNALS

NONE, ORACLE, LUENBERGER, SHAFT_KALMAN, POWER_BALANCE = 0, 1, 2, 3, 4
SHAFT_ACCELERATION, SHAFT_ACCELERATION_DERIVED, IMMERSION_INVARIANCE = 5, 6, 7
RANDOM_WALK_KALMAN, RANDOM_WALK_KALMAN_PRINTED = 8, 9
"""Codes of ``observer.kind``."""

OBSERVER = np.dtype(
    [
        ("kind", np.int64),
        ("dt", np.float64),
        # linear observers: x+ = transition x + now u(t+dt) + before u(t), u = (omega, M_m)
        ("transition", np.float64, (2, 2)),
        ("before", np.float64, (2, 2)),
        ("now", np.float64, (2, 2)),
        ("gain", np.float64),  # of the immersion-and-invariance observer
        ("process", np.float64, (2,)),  # variances per step: shaft speed, advance velocity
        ("measurement", np.float64),  # variance of the shaft speed
        ("ship", PLANT),
    ],
    align=True,
)

ESTIMATE = np.dtype(
    [
        ("started", np.int64),
        ("x", np.float64, (2,)),
        ("covariance", np.float64, (2, 2)),
        ("shaft_speed", np.float64),  # measured at the last sample
        ("shaft_torque", np.float64),
        ("pitch_ratio", np.float64),
        ("advance_velocity", np.float64),
        ("valid", np.int64),
    ],
    align=True,
)


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


_HIGHEST = {signal.name: float(signal.high) for signal in SIGNALS}
_MAX_SPEED = _HIGHEST["shaft_speed"]
_MAX_TORQUE = _HIGHEST["measured_shaft_torque"]
_MAX_PITCH = _HIGHEST["measured_pitch_ratio"]


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
    """Whether a pitch lies in the ship's range, with a margin for noise and offsets."""
    margin = 0.1
    return bool(ship.pitch_ratio_min - margin <= pitch_ratio <= ship.pitch_ratio_max + margin)


@compiled
def model_torque(ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float) -> float:
    """Propeller torque M_p [N m] that the observer's model expects (thesis eq. 2-5)."""
    n = shaft_speed * (0.5 / math.pi)
    j = max(advance_ratio(velocity, shaft_speed, ship.diameter), MIN_ADVANCE_RATIO)
    kq = open_water(ship.kq, j, pitch_ratio)
    return float(ship.density * ship.diameter**5 * n * n * kq / ship.relative_rotative_efficiency)


@compiled
def torque_slopes(
    ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float
) -> tuple[float, float]:
    """Partial derivatives of M_p to omega [N m s/rad] and to v_a [N s] (thesis eqs. 2-26, 2-38)."""
    n = shaft_speed * (0.5 / math.pi)
    j = max(advance_ratio(velocity, shaft_speed, ship.diameter), MIN_ADVANCE_RATIO)
    kq = open_water(ship.kq, j, pitch_ratio)
    slope = open_water_slope(ship.kq, j, pitch_ratio)
    factor = ship.density * ship.diameter**5 / ship.relative_rotative_efficiency
    by_velocity = factor * n * slope / ship.diameter
    by_speed = factor * n * (2.0 * kq - j * slope) * (0.5 / math.pi)
    return by_speed, by_velocity


@compiled
def velocity_from_torque(
    ship: Record, torque: float, shaft_speed: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Advance velocity [m/s] at which the propeller takes a torque (thesis eqs. 3-7 and 3-8).

    KQ is inverted exactly. The second value tells whether the torque lies on the curve.
    """
    n = shaft_speed * (0.5 / math.pi)
    if not n > 1e-3:
        return guess, False
    kq = torque * ship.relative_rotative_efficiency / (ship.density * ship.diameter**5 * n * n)
    scale = n * ship.diameter
    j, valid = invert_torque_coefficient(ship.kq, kq, pitch_ratio, guess / scale)
    return j * scale, valid


@compiled
def remember(estimate: Record, m: Measurement, velocity: float, valid: bool) -> None:
    """Store this sample's measurement and estimate."""
    estimate.started = 1
    estimate.shaft_speed = m.shaft_speed
    estimate.shaft_torque = m.shaft_torque
    estimate.pitch_ratio = m.pitch_ratio
    estimate.advance_velocity = velocity
    estimate.valid = 1 if valid else 0


def blank_observer(kind: int, ship: Any, dt: float) -> Any:
    """OBSERVER record with its kind, its ship's record and its time step [s]."""
    record = np.zeros(1, OBSERVER)[0]
    record["kind"] = kind
    record["dt"] = dt
    record["ship"] = ship
    return record
