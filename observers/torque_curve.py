"""Conversion between propeller torque and advance velocity by the open-water curve of the ship model.

The measured torque is that of the shaft torque meter if there is inertia behind it. An electric drive
without inertia behind a torque meter has no torque meter. The torque is then that of the drive, K_e i of
a motor or the commanded torque, less friction, and it accelerates the whole shaft line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled, compiled_apart
from ..plant.drives.dc_motor import motor_torque
from ..plant.drives.prime_mover import add_torque_offset
from ..plant.open_water import MIN_REVOLUTIONS, REVOLUTIONS_PER_RADIAN, advance_ratio
from ..plant.propeller import (
    FOUR_QUADRANT,
    advance_ratio_of,
    outside_ring_vortex,
    torque_coefficient,
    torque_coefficient_slope,
    torque_in_any_quadrant,
)
from ..plant.shaft import drive_torque, load_torque
from ..plant.ship import Ship
from .augmented import STEP
from .records import Floats

AT_REST = (
    1e-3  # shaft speed up to which the torque does not depend on the inflow noticeably [rad/s]
)
_FASTEST = 40.0  # highest inflow of a ship [m/s]


@compiled
def model_torque(ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float) -> float:
    """Return the propeller torque M_p [N m] at v_a [m/s] and omega [rad/s] (thesis eq. 2-5).

    Example:
        >>> from shaftline.plant import load_ship
        >>> frigate = load_ship("frigate").record()
        >>> round(model_torque(frigate, 7.0, 10.0, 1.3))
        130110
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    if ship.propeller_model == FOUR_QUADRANT:
        turned = torque_in_any_quadrant(ship, velocity / ship.diameter, n, pitch_ratio)
        return float(ship.density * ship.diameter**5 * turned / ship.relative_rotative_efficiency)
    j = max(advance_ratio(velocity, shaft_speed, ship.diameter), ship.advance_ratio_min)
    kq = torque_coefficient(ship, j, pitch_ratio)
    return float(ship.density * ship.diameter**5 * n * n * kq / ship.relative_rotative_efficiency)


@compiled
def torque_slopes(
    ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float
) -> tuple[float, float]:
    """Return the derivatives of M_p by omega [N m s/rad] and by v_a [N s] (thesis eqs. 2-26, 2-38)."""
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    if ship.propeller_model == FOUR_QUADRANT:
        return _slopes_in_any_quadrant(ship, velocity, n, pitch_ratio)
    j = max(advance_ratio(velocity, shaft_speed, ship.diameter), ship.advance_ratio_min)
    kq = torque_coefficient(ship, j, pitch_ratio)
    slope = torque_coefficient_slope(ship, j, pitch_ratio)
    factor = ship.density * ship.diameter**5 / ship.relative_rotative_efficiency
    by_velocity = factor * n * slope / ship.diameter
    by_speed = factor * n * (2.0 * kq - j * slope) * REVOLUTIONS_PER_RADIAN
    return by_speed, by_velocity


@compiled_apart
def _slopes_in_any_quadrant(
    ship: Record, velocity: float, revolutions: float, pitch_ratio: float
) -> tuple[float, float]:
    """Return the derivatives of M_p of a four-quadrant propeller, by complex steps."""
    factor = ship.density * ship.diameter**5 / ship.relative_rotative_efficiency
    v, along = velocity / ship.diameter, 1j * STEP
    by_revolutions = torque_in_any_quadrant(ship, v, revolutions + along, pitch_ratio).imag / STEP
    by_velocity = torque_in_any_quadrant(ship, v + along, revolutions, pitch_ratio).imag / STEP
    return factor * by_revolutions * REVOLUTIONS_PER_RADIAN, factor * by_velocity / ship.diameter


@compiled
def velocity_from_torque(
    ship: Record, torque: float, shaft_speed: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Return the advance velocity [m/s] at a torque [N m], and its validity (thesis eqs. 3-7, 3-8).

    KQ is inverted exactly. The velocity is valid if the torque lies on the curve. In four quadrants the
    shaft may turn astern, and the result is on the branch nearest to the guess [m/s], which is returned
    if the shaft does not turn.

    Example:
        >>> from shaftline.plant import load_ship
        >>> frigate = load_ship("frigate").record()
        >>> torque = model_torque(frigate, 7.0, 10.0, 1.3)
        >>> velocity, valid = velocity_from_torque(frigate, torque, 10.0, 1.3, 0.0)
        >>> round(velocity, 6), valid
        (7.0, True)
    """
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    direction = 1.0
    if ship.propeller_model == FOUR_QUADRANT and n < 0.0:
        direction = -1.0
    if not direction * n > MIN_REVOLUTIONS:
        return guess, False
    torque = direction * torque
    kq = torque * ship.relative_rotative_efficiency / (ship.density * ship.diameter**5 * n * n)
    scale = n * ship.diameter
    j, valid = advance_ratio_of(ship, kq, pitch_ratio, guess / scale, direction)
    return j * scale, valid


@compiled
def highest_velocity(ship: Record, shaft_speed: float) -> float:
    """Return the advance velocity [m/s] at which the torque curves end."""
    return float(ship.advance_ratio_max * ship.diameter * shaft_speed * REVOLUTIONS_PER_RADIAN)


@compiled
def shaft_turns(ship: Record, shaft_speed: float) -> bool:
    """Return whether the shaft turns in a direction for which the ship has torque curves."""
    return bool(
        shaft_speed > AT_REST or (shaft_speed < -AT_REST and ship.propeller_model == FOUR_QUADRANT)
    )


@compiled
def limit_to_curve(
    ship: Record, velocity: float, shaft_speed: float, lowest_share: float = 0.0
) -> tuple[float, bool]:
    """Limit an estimate [m/s] to the range of the torque curves, and return whether it is valid.

    Four-quadrant curves have no lowest velocity. With others the largest velocity astern is
    ``lowest_share`` times the highest velocity ahead.
    """
    if ship.propeller_model == FOUR_QUADRANT:
        held = min(max(velocity, -_FASTEST), _FASTEST)
        return held, shaft_turns(ship, shaft_speed) and held == velocity
    limit = highest_velocity(ship, shaft_speed)
    lowest = 0.0 if lowest_share == 0.0 else -lowest_share * limit
    held = min(max(velocity, lowest), limit)
    return held, shaft_turns(ship, shaft_speed) and held == velocity and velocity >= 0.0


@compiled
def torque_determines_inflow(
    ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float, known: bool
) -> bool:
    """Return whether the propeller torque determines the inflow; true for all but four-quadrant curves.

    With four-quadrant curves it does not near standstill, nor in the ring vortex of a shaft that turns
    against the inflow (:func:`shaftline.plant.propeller.outside_ring_vortex`). ``known`` says whether
    the last estimate was valid, with the same direction of rotation.
    """
    if ship.propeller_model != FOUR_QUADRANT:
        return True
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    if not abs(n) > MIN_REVOLUTIONS:
        return False
    direction = 1.0 if n > 0.0 else -1.0
    j = velocity / (n * ship.diameter)
    return outside_ring_vortex(ship, j, pitch_ratio, direction, known)


def uses_drive_torque(ship: Ship) -> bool:
    """Return whether the torque is that of an electric drive, because there is no torque meter.

    Example:
        >>> from shaftline.plant import load_ship
        >>> uses_drive_torque(load_ship("frigate")), uses_drive_torque(load_ship("towing-tank"))
        (False, True)
    """
    electric = ship.turns_freely and not ship.has_diesel
    return electric and ship.transmission.inertia_propeller_side_kg_m2 == 0.0


def observer_plant(ship: Ship) -> Any:
    """Return the PLANT record of the ship model of an observer, with the inertia behind its torque."""
    record = ship.record()
    if uses_drive_torque(ship):
        record["inertia_propeller_side"] = record["inertia_engine_side"]
        record["inertia_engine_side"] = 0.0
    return record


@compiled
def _subtract_friction(plant: Record, brake: Floats, shaft_speed: Floats, found: Floats) -> None:
    for k in range(len(brake)):
        lost = load_torque(plant, 0.0, shaft_speed[k])
        found[k] = drive_torque(plant, brake[k], shaft_speed[k]) - lost
        # The friction that grows with the load is part of the torque. This is exact in steady motion.
        carried = math.copysign(plant.load_friction, found[k] * shaft_speed[k])
        found[k] /= 1.0 + carried


def torque_of_drive(ship: Ship, brake_torque: Floats, shaft_speed: Floats) -> Floats:
    """Return torques [N m] of an electric drive less friction, at shaft speeds [rad/s], shape (n,)."""
    found = np.empty(len(brake_torque))
    brake, speed = (np.ascontiguousarray(x, np.float64) for x in (brake_torque, shaft_speed))
    _subtract_friction(ship.record(), brake, speed, found)
    return found


@compiled
def _motor_torques(plant: Record, current: Floats, shaft_speed: Floats, found: Floats) -> None:
    for k in range(len(current)):
        turning = plant.gear_ratio * shaft_speed[k]
        found[k] = add_torque_offset(plant, motor_torque(plant, current[k], turning))


def torque_of_current(ship: Ship, current: Floats, shaft_speed: Floats) -> Floats:
    """Return the torque [N m] of a motor at currents [A] and shaft speeds [rad/s], all of shape (n,)."""
    found = np.empty(len(current))
    current, speed = (np.ascontiguousarray(x, np.float64) for x in (current, shaft_speed))
    _motor_torques(ship.record(), current, speed, found)
    return found
