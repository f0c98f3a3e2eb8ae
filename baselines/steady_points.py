"""Steady states of a ship at a given shaft speed and pitch, as under a governor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import rack_of_torque, torque_limit
from ..plant.dynamics import Loads, loads
from ..plant.fuel import fuel_rate
from ..plant.shaft import brake_torque_of, drive_torque
from ..plant.ship import Ship, ShipError
from ..plant.state import Inputs, State, without_lags

_FASTEST = 40.0  # upper bound of the ship speed [m/s]


class SteadyPoint(NamedTuple):
    """Steady state of a ship; forces and torques are those of one of the equal shafts."""

    shaft_speed: float  # [rad/s]
    pitch_ratio: float  # [-]
    ship_speed: float  # [m/s]
    advance_velocity: float  # [m/s]
    thrust: float  # [N]
    brake_torque: float  # [N m]
    fuel_rack: float  # [mm]
    fuel_flow: float  # total of all engines [kg/s]
    torque_share: float  # brake torque / torque limit [-]
    burrill: float  # thrust loading / limit for 5 % back cavitation [-]


def require_diesel(ship: Ship) -> None:
    """Refuse a ship for which the classic controllers are not made.

    Raises:
        ShipError: the prime mover is no diesel, the hull is fixed, or there is no propeller.
    """
    kind = ship.prime_mover.type
    for fits, needs in (
        (ship.has_diesel, f"a governor needs a diesel, not prime_mover.type {kind!r}"),
        (ship.moves, "the controller needs a ship that moves, but hull.fixed is true"),
        (ship.has_propeller, "the controller needs a propeller, but propeller.model is 'none'"),
    ):
        if not fits:
            raise ShipError(f"{ship.name}: {needs}")


def steady_point(
    ship: Ship, shaft_speed: float, pitch_ratio: float, resistance_factor: float = 1.0
) -> SteadyPoint:
    """Return the steady state in calm water at a given shaft speed, with the engine torque it takes.

    The torque limit of the engine does not apply: ``torque_share`` may exceed 1, and ``fuel_rack`` the
    end stop.

    Args:
        ship: ship with a diesel.
        shaft_speed: omega [rad/s], ahead.
        pitch_ratio: commanded P/D [-]; the offset of the actuator applies.
        resistance_factor: factor on the resistance d_c1 [-].

    Raises:
        ShipError: the ship has no diesel or cannot move.
        ValueError: at this pitch the propeller does not drive the ship ahead.

    Example:
        >>> from shaftline.plant import load_ship
        >>> point = steady_point(load_ship("frigate"), shaft_speed=10.0, pitch_ratio=1.3)
        >>> round(point.ship_speed, 2), round(point.torque_share, 2)
        (7.79, 0.48)
    """
    require_diesel(ship)
    plant = without_lags(ship.record())
    inputs = Inputs(0.0, float(pitch_ratio), resistance_factor=float(resistance_factor))
    pitch = float(np.clip(pitch_ratio, plant["pitch_ratio_min"], plant["pitch_ratio_max"]))
    blade = pitch + float(plant["pitch_actuator_offset"])

    def at(speed: float) -> Loads:
        return loads(plant, State(blade, float(shaft_speed), speed), inputs, blade)

    def surge(speed: float) -> float:
        acting = at(speed)
        return float(acting.push - acting.resistance)

    slowest = float(plant["current"])
    if not surge(slowest) > 0.0:
        raise ValueError(
            f"{ship.name}: at pitch ratio {pitch_ratio:g} the propeller does not push the ship ahead"
        )
    speed = float(scipy.optimize.brentq(surge, slowest, slowest + _FASTEST, xtol=1e-12))
    acting = at(speed)
    # The engine torque is the load torque minus all other torques that drive the shaft.
    driving = acting.load_torque - acting.drive_torque
    driving += drive_torque(plant, acting.brake_torque, shaft_speed)
    brake = float(brake_torque_of(plant, driving, shaft_speed))
    engine_speed = float(plant["gear_ratio"]) * shaft_speed
    rack = rack_of_torque(plant, engine_speed, brake)
    fuel = float(plant["propellers"]) * fuel_rate(plant, engine_speed, brake)
    share = brake / torque_limit(plant, engine_speed)
    velocity, thrust = acting.advance_velocity, acting.thrust
    burrill = burrill_ratio(plant, thrust, velocity, shaft_speed, blade, acting.submergence)
    return SteadyPoint(
        shaft_speed, pitch, speed, velocity, thrust, brake, rack, fuel, share, burrill
    )
