"""Between propeller torque and advance velocity, by the open-water curve of the ship as believed."""

from __future__ import annotations

from ..core.compiled import Record, compiled
from ..plant.open_water import MIN_REVOLUTIONS, REVOLUTIONS_PER_RADIAN, advance_ratio
from ..plant.propeller_curves import (
    advance_ratio_of,
    torque_coefficient,
    torque_coefficient_slope,
)

AT_REST = 1e-3
"""Shaft speed up to which the shaft tells nothing about the inflow [rad/s]."""


@compiled
def model_torque(ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float) -> float:
    """Propeller torque M_p [N m] that the observer's model expects (thesis eq. 2-5).

    Args:
        ship: PLANT record of the ship as believed.
        velocity: v_a [m/s].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    j = max(advance_ratio(velocity, shaft_speed, ship.diameter), ship.advance_ratio_min)
    kq = torque_coefficient(ship, j, pitch_ratio)
    return float(ship.density * ship.diameter**5 * n * n * kq / ship.relative_rotative_efficiency)


@compiled
def torque_slopes(
    ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float
) -> tuple[float, float]:
    """Partial derivatives of M_p to omega [N m s/rad] and to v_a [N s] (thesis eqs. 2-26, 2-38)."""
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    j = max(advance_ratio(velocity, shaft_speed, ship.diameter), ship.advance_ratio_min)
    kq = torque_coefficient(ship, j, pitch_ratio)
    slope = torque_coefficient_slope(ship, j, pitch_ratio)
    factor = ship.density * ship.diameter**5 / ship.relative_rotative_efficiency
    by_velocity = factor * n * slope / ship.diameter
    by_speed = factor * n * (2.0 * kq - j * slope) * REVOLUTIONS_PER_RADIAN
    return by_speed, by_velocity


@compiled
def velocity_from_torque(
    ship: Record, torque: float, shaft_speed: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Advance velocity [m/s] at which the propeller takes a torque (thesis eqs. 3-7 and 3-8).

    KQ is inverted exactly. The second value tells whether the torque lies on the curve.
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    if not n > MIN_REVOLUTIONS:
        return guess, False
    kq = torque * ship.relative_rotative_efficiency / (ship.density * ship.diameter**5 * n * n)
    scale = n * ship.diameter
    j, valid = advance_ratio_of(ship, kq, pitch_ratio, guess / scale)
    return j * scale, valid


@compiled
def highest_velocity(ship: Record, shaft_speed: float) -> float:
    """Advance velocity [m/s] at which the torque curves end."""
    return float(ship.advance_ratio_max * ship.diameter * shaft_speed * REVOLUTIONS_PER_RADIAN)
