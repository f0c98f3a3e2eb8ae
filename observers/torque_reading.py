"""Where an observer's torque is read: at the gauge in the shaft, or at an electric drive without one.

A ship with inertia behind a torque gauge has the gauge read. An electric drive whose file puts no
inertia there has no gauge. What drives its shaft is then the torque of the drive, K_e i of a motor or
the torque that is told, less friction; and what that drives is the whole line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.drives.dc_motor import motor_torque
from ..plant.drives.prime_mover import with_offset
from ..plant.shaft import drive_torque, load_torque
from ..plant.ship import Ship

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
