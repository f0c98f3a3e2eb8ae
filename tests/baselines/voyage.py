"""Simulation of a controller on the plant in calm water, without measurement noise."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from shaftline.plant import Ship, equilibrium
from shaftline.plant.fuel import fuel_rate
from shaftline.plant.memory import MEMORY
from shaftline.plant.propeller import thrust_coefficient, torque_coefficient
from shaftline.plant.state import STATE
from shaftline.plant.stepping import UNDISTURBED, Disturbance, constant_inputs, prepare, step
from shaftline.plant.waves import calm_sea

INTERVAL_S = 0.5


class End(NamedTuple):
    """Signals at the end of an interval; the fuel flow is that of all engines."""

    ship_speed: float
    shaft_speed: float
    pitch_ratio: float
    fuel_flow: float
    brake_torque: float
    action: Any


def with_blades_from(ship: Ship, lowest: float) -> Ship:
    """Return a ship with a larger pitch range: its curves as a table, and 0 at P/D 0."""
    plant, least = ship.record(), ship.propeller.pitch_ratio_min
    ratios = np.linspace(-0.1, 1.4, 31).tolist()
    pitches = [lowest, 0.0, *np.linspace(least, ship.propeller.pitch_ratio_max, 4).tolist()]

    def rows(curve: Any, power: int) -> list[list[float]]:
        """Return coefficients odd in the pitch (thrust, power 1) or even (torque, power 2)."""
        return [
            [float(curve(plant, j, max(p, least))) * min(p / least, 1.0) ** power for j in ratios]
            for p in pitches
        ]

    table = {
        "advance_ratio": ratios,
        "pitch_ratio": pitches,
        "thrust_coefficient": rows(thrust_coefficient, 1),
        "torque_coefficient": rows(torque_coefficient, 2),
    }
    tree = ship.model_dump(exclude_unset=True)
    change = {"model": "table", "open_water": table, "pitch_ratio_min": lowest}
    tree["propeller"] = tree["propeller"] | change
    return Ship.model_validate(tree)


def run_voyage(
    controller: Any,
    ship: Ship,
    order: Any,
    seconds: float,
    *,
    resistance: Any = 1.0,
    valid: bool = True,
    start: tuple[float, float] | None = None,
) -> list[End]:
    """Simulate one ship with ``predict``; order and resistance are numbers or functions of time."""
    plant, dt = ship.record(), ship.time_step_s
    mover = ship.prime_mover
    rack = 0.5 * mover.rack_max_mm  # type: ignore[union-attr]
    begin = equilibrium(ship, *(start or (rack, 0.5 * ship.propeller.pitch_ratio_max + 0.2)))
    state, memory, sea = np.zeros(1, STATE)[0], np.zeros(1, MEMORY)[0], calm_sea()
    for name, value in begin.state._asdict().items():
        state[name] = value
    prepare(plant, state, memory, sea, begin.inputs.drive, UNDISTURBED, dt)
    factor = resistance if callable(resistance) else (lambda t: resistance)
    wanted = order if callable(order) else (lambda t: order)
    advance = begin.outputs.advance_velocity
    remembered, log = None, []
    for k in range(round(seconds / INTERVAL_S)):
        time = k * INTERVAL_S
        observation = np.array(
            [
                wanted(time),
                state["shaft_speed"],
                memory["shaft_torque"],
                memory["pitch_ratio"],
                memory["rack"],
                memory["speed_log"],
                advance,
                float(valid),
            ]
        )
        action, remembered = controller.predict(observation, remembered, np.array([k == 0]))
        pitch = plant["pitch_ratio_min"] + 0.5 * (action[0] + 1.0) * (
            plant["pitch_ratio_max"] - plant["pitch_ratio_min"]
        )
        drive = 0.5 * (action[1] + 1.0) * plant["drive_max"]
        held = Disturbance(0.0, 0.0, float(factor(time)))
        acting = constant_inputs(float(drive), float(pitch), 0.0, held)
        for _ in range(round(INTERVAL_S / dt)):
            out = step(plant, state, memory, sea, acting, dt)
        advance = out.advance_velocity
        engine_speed = float(plant["gear_ratio"] * state["shaft_speed"])
        fuel = float(plant["propellers"]) * fuel_rate(plant, engine_speed, out.brake_torque)
        log.append(
            End(
                float(state["ship_speed"]),
                float(state["shaft_speed"]),
                out.pitch_ratio,
                fuel,
                out.brake_torque,
                action,
            )
        )
    return log
