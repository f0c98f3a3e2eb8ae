"""Steady states of the plant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy

from .dynamics import evaluate, settled
from .ship import Ship
from .state import TERM_STATES, Inputs, Outputs, State, along, moved


class Equilibrium(NamedTuple):
    """A steady state: the state, the outputs there, and the inputs that hold it."""

    state: State
    outputs: Outputs
    inputs: Inputs


def equilibrium(
    ship: Ship,
    drive: float,
    pitch_ratio: float,
    *,
    inflow: float = 0.0,
    resistance_factor: float = 1.0,
    signals: Mapping[str, float] = MappingProxyType({}),
) -> Equilibrium:
    """Steady state at given commands.

    Args:
        ship: the ship.
        drive: fuel rack [mm], voltage [V], torque [N m] or held speed [rad/s].
        pitch_ratio: commanded P/D [-].
        inflow: steady advance-velocity disturbance u_x [m/s].
        resistance_factor: d_c1 [-].
        signals: from outside, by name, that the ship's terms hear.

    Raises:
        ShipError: a term hears a signal that is not given.
        ValueError: no steady state with a forward-turning shaft exists, for example because the
            engine's torque does not overcome its friction, or because the state of a term does not
            come to rest.
    """
    plant = ship.record()
    inputs = Inputs(
        float(drive), float(pitch_ratio), float(inflow),
        resistance_factor=float(resistance_factor), outside=ship.outside(signals),
    )  # fmt: skip
    moving = ship.moves
    blade = float(np.clip(pitch_ratio, plant["pitch_ratio_min"], plant["pitch_ratio_max"]))
    blade += float(plant["pitch_actuator_offset"])

    def complete(shaft_speed: float, ship_speed: float) -> State:
        bare = State(blade, shaft_speed, ship_speed, sway_speed=float(plant["cross_current"]))
        state = settled(plant, bare, inputs)
        if plant["term_count"] > 0:
            # what acts on the actuator keeps the blades away from the command
            rate, _ = evaluate(plant, state, inputs, blade)
            away = float(plant["pitch_time_constant"]) * rate.pitch_ratio
            state = settled(plant, state._replace(pitch_ratio=blade + away), inputs)
        return state

    def residual(unknown: Any) -> list[float]:
        shaft_speed = float(unknown[0])
        ship_speed = float(unknown[1]) if moving else 0.0
        rate, outputs = evaluate(plant, complete(shaft_speed, ship_speed), inputs, blade)
        scale = max(abs(outputs.shaft_torque), 1e-9)
        shaft = rate.shaft_speed * float(plant["inertia_engine_side"]) / scale
        if not ship.turns_freely:
            shaft = (shaft_speed - float(drive)) / max(abs(drive), 1e-9)
        if not moving:
            return [shaft]
        return [shaft, rate.ship_speed * float(plant["mass"]) / max(outputs.resistance, 1.0)]

    for start in _starts(ship, drive):
        found = scipy.optimize.root(
            residual, start if moving else start[:1], method="hybr", tol=1e-13
        )
        if np.max(np.abs(residual(found.x))) < 1e-9 and found.x[0] > 1e-3:
            turns = float(found.x[0]) if ship.turns_freely else float(drive)
            state = complete(turns, float(found.x[1]) if moving else 0.0)
            _, outputs = evaluate(plant, state, inputs, blade)
            _check_rest(ship, plant, state, inputs, blade)
            return Equilibrium(state, outputs, inputs)
    raise ValueError(
        f"{ship.name}: no steady state with the shaft turning ahead at drive {drive:g} and pitch "
        f"ratio {pitch_ratio:g}"
    )


def _check_rest(ship: Ship, plant: Any, state: State, inputs: Inputs, blade: float) -> None:
    """Refuse a state of a term whose rate neither vanishes nor changes its sign at the steady state."""
    with_state = [term for term in ship.term if term.state is not None]
    for term, direction in zip(with_state, TERM_STATES, strict=False):
        here = along(state, direction)
        rates = [
            along(evaluate(plant, moved(state, direction, by), inputs, blade)[0], direction)
            for by in (-1e-6 * max(1.0, abs(here)), 1e-6 * max(1.0, abs(here)))
        ]
        if rates[0] * rates[1] > 0.0:
            raise ValueError(
                f"{ship.name}: no steady state: at a shaft speed of {state.shaft_speed:.4g} rad/s and a "
                f"ship speed of {state.ship_speed:.4g} m/s the state {term.state} of term {term.id!r} "
                f"does not come to rest; at {here:.4g} it changes by {max(rates, key=abs):.4g} a second"
            )


def _starts(ship: Ship, drive: float) -> list[list[float]]:
    plant = ship.record()
    if plant["engine_speed_max"] > 0.0:
        top = float(plant["engine_speed_max"] / plant["gear_ratio"])
    elif plant["motor_constant"] > 0.0:
        top = abs(drive) / float(plant["motor_constant"] * plant["gear_ratio"])
    elif not ship.turns_freely:
        top = abs(drive)
    else:
        top = 20.0
    shares = (0.7, 0.4, 1.0, 0.2, 0.1)
    # the first row suits large slow propellers; the second is 70 % of what the blades screw out
    screwed = 0.7 * float(plant["diameter"]) / (2.0 * math.pi)
    return [[top * share, top * share * 0.8] for share in shares] + [
        [top * share, top * share * screwed] for share in shares
    ]
