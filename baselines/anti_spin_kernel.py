"""The anti-spin controller of a diesel, compiled: from the law's torque to a fuel rack."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..plant.drives.diesel import diesel_torque, rack_of_torque, torque_limit
from ..plant.shaft import brake_torque_of, drive_torque, inertia_behind_gauge, shaft_inertia
from .thrust_law_kernel import THRUST_LAW, THRUST_LAW_MEMORY, integrate_error, torque_demand

ANTI_SPIN = np.dtype(
    [
        ("law", THRUST_LAW),
        ("ventilated_speed", np.float64),  # omega_v,opt over the calm-water speed [-]
    ],
    align=True,
)

ANTI_SPIN_MEMORY = np.dtype(
    [*THRUST_LAW_MEMORY, ("reading", np.float64, (8,))],  # the last good observation
    align=True,
)


@compiled
def gauge_jump(ship: Record, engine_speed: float, rack_before: float, rack: float) -> float:
    """Step of the gauge's torque [N m] as the fuel changes between two racks [mm].

    The inertia behind the gauge takes its share of the drive torque's step. An engine with a lag or a
    dead time, or a slow rack, makes no step.
    """
    if ship.engine_lag > 0.0 or ship.command_dead_time > 0.0 or math.isfinite(ship.rack_rate_limit):
        return 0.0
    before = diesel_torque(ship, engine_speed, rack_before)
    after = diesel_torque(ship, engine_speed, rack)
    shaft_speed = engine_speed / ship.gear_ratio
    rise = drive_torque(ship, after, shaft_speed) - drive_torque(ship, before, shaft_speed)
    return float(rise * inertia_behind_gauge(ship) / shaft_inertia(ship))


@compiled
def control(
    controller: Record,
    memory: Record,
    calm_speed: float,
    thrust: float,
    shaft_speed: float,
    shaft_torque: float,
    pitch: float,
    ship_speed: float,
    rack_before: float,
) -> float:
    """Fuel rack [mm] for one ship at one instant; the memory changes in place.

    Args:
        controller: ANTI_SPIN record.
        memory: ANTI_SPIN_MEMORY record, all zeros but the reading at the first instant.
        calm_speed: shaft speed of the order in calm water [rad/s].
        thrust: T_pd, of one propeller in calm water [N].
        shaft_speed: omega, measured [rad/s].
        shaft_torque: M_m at the gauge, measured [N m].
        pitch: P/D, measured [-].
        ship_speed: v_s, measured [m/s].
        rack_before: fuel rack in force until now [mm].
    """
    ship = controller.law.observer.ship
    pitch = min(max(pitch, ship.pitch_ratio_min), ship.pitch_ratio_max)
    # an engine turns ahead: a shaft in air is held at the least it can do
    in_air = max(controller.ventilated_speed * calm_speed, controller.law.speed_min)
    demand = torque_demand(
        controller.law, memory, thrust, in_air, in_air, shaft_speed, shaft_torque, pitch, ship_speed
    )

    # through the gearbox to the engine, inside its envelope
    brake = brake_torque_of(ship, demand, shaft_speed)
    engine_speed = ship.gear_ratio * shaft_speed
    limit = torque_limit(ship, engine_speed)
    rack = rack_of_torque(ship, engine_speed, min(brake, limit))
    rack = float(clip(rack, ship.drive_min, ship.drive_max))
    starved = brake > limit or rack >= ship.drive_max
    closed = rack <= ship.drive_min
    integrate_error(controller.law, memory, shaft_speed, starved, closed)
    # the gauge was read before this fuel; what the observer integrates from here on begins after it
    memory.estimate.torque_reading += gauge_jump(ship, engine_speed, rack_before, rack)
    return rack


@compiled
def control_all(
    controller: Record,
    memories: Any,
    calm_speed: Any,
    thrust: Any,
    shaft_speed: Any,
    shaft_torque: Any,
    pitch: Any,
    ship_speed: Any,
    rack_before: Any,
    rack: Any,
) -> None:
    """The same for n ships: memories and every reading of shape (n,); racks go into ``rack`` [mm]."""
    for i in range(len(memories)):
        rack[i] = control(
            controller,
            memories[i],
            calm_speed[i],
            thrust[i],
            shaft_speed[i],
            shaft_torque[i],
            pitch[i],
            ship_speed[i],
            rack_before[i],
        )
