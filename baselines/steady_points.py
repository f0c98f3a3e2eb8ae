"""Steady states of a ship at a held shaft speed and pitch: what a governor leads the plant to."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..plant.cavitation import burrill_ratio
from ..plant.dynamics import State, evaluate
from ..plant.fuel import fuel_rate
from ..plant.prime_mover import rack_of_torque, torque_limit
from ..plant.ship import Ship, ShipError
from ..plant.ship_sections import Diesel
from ..plant.steady_state import steady_inputs

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
        ShipError: its prime mover is no diesel, or it cannot move.
    """
    if not isinstance(ship.prime_mover, Diesel):
        raise ShipError(f"{ship.name}: a governor needs a diesel, not {ship.prime_mover.type!r}")
    if ship.hull.fixed:
        raise ShipError(f"{ship.name}: the hull is fixed; there is no ship speed to order")


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
    plant = ship.record()
    inputs = steady_inputs(0.0, pitch_ratio, 0.0, resistance_factor)
    pitch = float(np.clip(pitch_ratio, plant["pitch_ratio_min"], plant["pitch_ratio_max"]))
    blade = pitch + float(plant["pitch_actuator_offset"])
    inflow_lags = float(plant["inflow_lag"]) > 0.0

    def at(speed: float) -> State:
        state = State(blade, shaft_speed, speed, 0.0, 0.0, 0.0, 0.0, 0.0)
        if inflow_lags:
            rate, _ = evaluate(plant, state, inputs, blade, False)
            state = state._replace(inflow=float(plant["inflow_lag"]) * rate.inflow)
        return state

    def surge(speed: float) -> float:
        rate, _ = evaluate(plant, at(speed), inputs, blade, False)
        return float(rate.ship_speed)

    slowest = float(plant["current"])
    if not surge(slowest) > 0.0:
        raise ValueError(
            f"{ship.name}: at pitch ratio {pitch_ratio:g} the propeller does not push the ship ahead"
        )
    state = at(float(brentq(surge, slowest, slowest + _FASTEST, xtol=1e-12)))
    rate, outputs = evaluate(plant, state, inputs, blade, False)
    # the shaft's equation is linear in the torque that drives it
    inertia = plant["inertia_engine_side"] + plant["inertia_propeller_side"]
    lacking = -rate.shaft_speed
    lacking *= float(inertia + plant["entrained_inertia"])
    brake = outputs.brake_torque + lacking / float(
        plant["gear_ratio"] * plant["transmission_efficiency"]
    )
    engine_speed = float(plant["gear_ratio"]) * shaft_speed
    return SteadyPoint(
        shaft_speed,
        pitch,
        state.ship_speed,
        outputs.advance_velocity,
        outputs.thrust,
        brake,
        rack_of_torque(plant, engine_speed, brake),
        float(plant["propellers"]) * fuel_rate(plant, engine_speed, brake),
        brake / torque_limit(plant, engine_speed),
        burrill_ratio(
            plant,
            outputs.thrust,
            outputs.advance_velocity,
            shaft_speed,
            outputs.pitch_ratio,
            outputs.submergence,
        ),
    )


def speed_range(ship: Ship) -> tuple[float, float]:
    """Lowest and highest running speed of the propeller shaft [rad/s]."""
    mover = ship.prime_mover
    if not isinstance(mover, Diesel):
        raise ShipError(f"{ship.name}: only a diesel has a range of running speeds")
    scale = math.pi / 30.0 / ship.transmission.gear_ratio
    return mover.speed_min_rpm * scale, mover.speed_max_rpm * scale
