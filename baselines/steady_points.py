"""Steady states of a ship at a held shaft speed and pitch: what a governor leads the plant to."""

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

_FASTEST = 40.0  # m/s


class SteadyPoint(NamedTuple):
    """One steady state; forces and torques are those of one of the equal shafts."""

    shaft_speed: float  # [rad/s]
    pitch_ratio: float  # [-]
    ship_speed: float  # [m/s]
    advance_velocity: float  # [m/s]
    thrust: float  # [N]
    brake_torque: float  # [N m]
    fuel_rack: float  # [mm]
    fuel_flow: float  # of all engines [kg/s]
    torque_share: float  # brake torque / torque limit [-]
    burrill: float  # thrust loading / 5 % limit [-]


def require_diesel(ship: Ship) -> None:
    """Refuse a ship that the classic controllers cannot drive.

    Raises:
        ShipError: its prime mover is no diesel, it cannot move, or it has no propeller.
    """
    if not ship.has_diesel:
        raise ShipError(f"{ship.name}: a governor needs a diesel, not {ship.prime_mover.type!r}")
    if not ship.moves:
        raise ShipError(f"{ship.name}: the hull is fixed; there is no ship speed to order")
    if not ship.has_propeller:
        raise ShipError(f"{ship.name}: no propeller drives it; propeller.model is 'none'")


def steady_point(
    ship: Ship, shaft_speed: float, pitch_ratio: float, resistance_factor: float = 1.0
) -> SteadyPoint:
    """Steady state in calm water at a held shaft speed, the engine giving what that takes.

    Args:
        ship: a ship with a diesel.
        shaft_speed: omega [rad/s], ahead.
        pitch_ratio: commanded P/D [-]; the actuator's offset acts.
        resistance_factor: d_c1 [-].

    The engine's envelope is not enforced: ``torque_share`` above 1 tells that it is left, and
    ``fuel_rack`` may lie beyond the end stop.

    Raises:
        ShipError: the ship has no diesel or cannot move.
        ValueError: at this pitch the propeller does not drive the ship ahead.
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
    # whatever else drives the shaft, the engine's torque brings what the load lacks
    driving = acting.load_torque - acting.drive_torque
    driving += drive_torque(plant, acting.brake_torque, shaft_speed)
    brake = float(brake_torque_of(plant, driving, shaft_speed))
    engine_speed = float(plant["gear_ratio"]) * shaft_speed
    return SteadyPoint(
        shaft_speed,
        pitch,
        speed,
        acting.advance_velocity,
        acting.thrust,
        brake,
        rack_of_torque(plant, engine_speed, brake),
        float(plant["propellers"]) * fuel_rate(plant, engine_speed, brake),
        brake / torque_limit(plant, engine_speed),
        burrill_ratio(
            plant,
            acting.thrust,
            acting.advance_velocity,
            shaft_speed,
            blade,
            acting.submergence,
        ),
    )
