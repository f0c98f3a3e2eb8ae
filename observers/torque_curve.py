"""Between propeller torque and advance velocity, by the open-water curve of the ship as believed.

Where an observer's torque is read: at the gauge in the shaft, or at an electric drive without one.

A ship with inertia behind a torque gauge has the gauge read. An electric drive whose file puts no
inertia there has no gauge. What drives its shaft is then the torque of the drive, K_e i of a motor or
the torque that is told, less friction; and what that drives is the whole line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled, compiled_apart
from ..plant.drives.dc_motor import motor_torque
from ..plant.drives.prime_mover import with_offset
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

AT_REST = 1e-3
"""Shaft speed up to which the shaft tells nothing about the inflow [rad/s]."""

_FASTEST = 40.0  # m/s; no inflow of a ship is faster


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
    """Partial derivatives of M_p to omega [N m s/rad] and to v_a [N s] (thesis eqs. 2-26, 2-38)."""
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
    """The same for a four-quadrant propeller, by complex steps."""
    factor = ship.density * ship.diameter**5 / ship.relative_rotative_efficiency
    v, along = velocity / ship.diameter, 1j * STEP
    by_revolutions = torque_in_any_quadrant(ship, v, revolutions + along, pitch_ratio).imag / STEP
    by_velocity = torque_in_any_quadrant(ship, v + along, revolutions, pitch_ratio).imag / STEP
    return factor * by_revolutions * REVOLUTIONS_PER_RADIAN, factor * by_velocity / ship.diameter


@compiled
def velocity_from_torque(
    ship: Record, torque: float, shaft_speed: float, pitch_ratio: float, guess: float
) -> tuple[float, bool]:
    """Advance velocity [m/s] at which the propeller takes a torque (thesis eqs. 3-7 and 3-8).

    KQ is inverted exactly. The second value tells whether the torque lies on the curve. In four
    quadrants the shaft may turn astern, and the velocity is the one on the branch nearest to the guess.
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
    """Advance velocity [m/s] at which the torque curves end."""
    return float(ship.advance_ratio_max * ship.diameter * shaft_speed * REVOLUTIONS_PER_RADIAN)


@compiled
def turns(ship: Record, shaft_speed: float) -> bool:
    """Whether the shaft turns in a direction that the ship's torque curves know."""
    return bool(
        shaft_speed > AT_REST or (shaft_speed < -AT_REST and ship.propeller_model == FOUR_QUADRANT)
    )


@compiled
def held_on_curve(
    ship: Record, velocity: float, shaft_speed: float, lowest_share: float = 0.0
) -> tuple[float, bool]:
    """An estimate [m/s] held where the torque curves are known, and whether it is trusted.

    Args:
        ship: PLANT record of the ship as believed.
        velocity: as estimated [m/s].
        shaft_speed: omega [rad/s].
        lowest_share: how far against the inflow it may go, as a share of the highest velocity. Four
            quadrants have no such ends.
    """
    if ship.propeller_model == FOUR_QUADRANT:
        held = min(max(velocity, -_FASTEST), _FASTEST)
        return held, turns(ship, shaft_speed) and held == velocity
    limit = highest_velocity(ship, shaft_speed)
    lowest = 0.0 if lowest_share == 0.0 else -lowest_share * limit
    held = min(max(velocity, lowest), limit)
    return held, turns(ship, shaft_speed) and held == velocity and velocity >= 0.0


@compiled
def told_by_torque(
    ship: Record, velocity: float, shaft_speed: float, pitch_ratio: float, known: bool
) -> bool:
    """Whether the torque of a four-quadrant propeller tells an estimate; of any other always.

    Not where the shaft hardly turns, nor in the ring vortex of one that turns against the inflow
    (:func:`shaftline.plant.propeller.outside_ring_vortex`).

    Args:
        ship: PLANT record of the ship as believed.
        velocity: the estimate [m/s].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        known: whether it was told at the last sample, the shaft turning in the same direction.
    """
    if ship.propeller_model != FOUR_QUADRANT:
        return True
    n = shaft_speed * REVOLUTIONS_PER_RADIAN
    if not abs(n) > MIN_REVOLUTIONS:
        return False
    direction = 1.0 if n > 0.0 else -1.0
    j = velocity / (n * ship.diameter)
    return outside_ring_vortex(ship, j, pitch_ratio, direction, known)


Floats = NDArray[np.float64]


def read_at_drive(ship: Ship) -> bool:
    """Whether the torque is that of an electric drive, for want of a gauge."""
    electric = ship.turns_freely and not ship.has_diesel
    return electric and ship.transmission.inertia_propeller_side_kg_m2 == 0.0


def believed(ship: Ship) -> Any:
    """PLANT record of a ship as an observer sees it, with all inertia behind the place of its torque."""
    record = ship.record()
    if read_at_drive(ship):
        record["inertia_propeller_side"] = record["inertia_engine_side"]
        record["inertia_engine_side"] = 0.0
    return record


@compiled
def _less_friction(plant: Record, brake: Floats, shaft_speed: Floats, found: Floats) -> None:
    for k in range(len(brake)):
        lost = load_torque(plant, 0.0, shaft_speed[k])
        found[k] = drive_torque(plant, brake[k], shaft_speed[k]) - lost
        # what grows with the load is part of it: of a steady shaft, exactly
        carried = math.copysign(plant.load_friction, found[k] * shaft_speed[k])
        found[k] /= 1.0 + carried


def torque_of_drive(ship: Ship, brake_torque: Floats, shaft_speed: Floats) -> Floats:
    """Torque [N m] that a drive leaves for propeller and inertia.

    Args:
        ship: with an electric drive.
        brake_torque: of the drive [N m], shape (n,).
        shaft_speed: omega [rad/s], likewise; the friction goes by it.
    """
    found = np.empty(len(brake_torque))
    brake, speed = (np.ascontiguousarray(x, np.float64) for x in (brake_torque, shaft_speed))
    _less_friction(ship.record(), brake, speed, found)
    return found


@compiled
def _of_currents(plant: Record, current: Floats, shaft_speed: Floats, found: Floats) -> None:
    for k in range(len(current)):
        turning = plant.gear_ratio * shaft_speed[k]
        found[k] = with_offset(plant, motor_torque(plant, current[k], turning))


def torque_of_current(ship: Ship, current: Floats, shaft_speed: Floats) -> Floats:
    """Torque [N m] of a motor by its current [A] and the shaft's speed [rad/s], each of shape (n,)."""
    found = np.empty(len(current))
    current, speed = (np.ascontiguousarray(x, np.float64) for x in (current, shaft_speed))
    _of_currents(ship.record(), current, speed, found)
    return found
