"""Steady states of the plant at constant commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..core.compiled import Record, compiled_apart, generate_tuple_kernel
from .dynamics import evaluate, evaluate_apart, settle_lags
from .ship import Ship
from .state import (
    TERM_STATES,
    Inputs,
    Outputs,
    State,
    directional_rate,
    inputs_without_sea,
    shift_state,
    with_motion,
)

_MOTION = ("pitch_ratio", "shaft_speed", "ship_speed", "sway_speed")

_motion_state: Callable[[float, float, float, float], State] = generate_tuple_kernel(
    f"motion_state({', '.join(_MOTION)})",
    "State",
    "{field}",
    [name if name in _MOTION else "0.0" for name in State._fields],
    globals(),
)


@compiled_apart
def _at_rest(
    plant: Record, inputs: Inputs, blade: float, shaft_speed: float, ship_speed: float
) -> State:
    """Return the state at a shaft speed and a ship speed with all lag states at rest.

    ``blade`` is the pitch ratio of the blades [-] at the command.
    """
    bare = _motion_state(blade, shaft_speed, ship_speed, plant.cross_current)
    state = settle_lags(plant, bare, inputs)
    if plant.term_count > 0:
        # A term on the actuator shifts the blades from the command.
        rate, _ = evaluate_apart(plant, state, inputs, blade)
        pitch = blade + plant.pitch_time_constant * rate.pitch_ratio
        shifted = with_motion(state, pitch, state.shaft_speed, state.ship_speed)
        state = settle_lags(plant, shifted, inputs)
    return state


@compiled_apart
def _balances(
    plant: Record,
    blade: float,
    shaft_speed: float,
    ship_speed: float,
    drive: float,
    pitch_ratio: float,
    inflow: float,
    resistance_factor: float,
    outside: tuple[float, ...],
) -> tuple[float, float, float, float]:
    """Return the rates of shaft and ship speed, the shaft torque and the resistance of :func:`_at_rest`.

    A solver calls this kernel often. Its arguments are numbers, because the conversion of a state and of
    inputs takes far longer than the equations.
    """
    inputs = inputs_without_sea(
        drive, pitch_ratio, inflow, 0.0, resistance_factor, 0.0, 0.0, 0.0, outside
    )
    state = _at_rest(plant, inputs, blade, shaft_speed, ship_speed)
    rate, outputs = evaluate_apart(plant, state, inputs, blade)
    return rate.shaft_speed, rate.ship_speed, outputs.shaft_torque, outputs.resistance


class Equilibrium(NamedTuple):
    """A steady state: the state, its outputs, and the inputs that hold it."""

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
    """Return the steady state at constant commands.

    The torque limit of a diesel engine may hold it far below its idle speed as well. The steady state
    above the idle speed is returned if there is one.

    Args:
        ship: the ship.
        drive: fuel rack [mm], voltage [V], torque [N m] or held speed [rad/s].
        pitch_ratio: commanded P/D [-].
        inflow: constant disturbance u_x of the advance velocity [m/s].
        resistance_factor: d_c1 [-].
        signals: external signals of the ship's terms, by name.

    Raises:
        ShipError: a term uses a signal that is not given.
        ValueError: there is no steady state with the shaft turning ahead, for example because the engine
            torque does not overcome friction, or because the state of a term does not come to rest.

    >>> from shaftline.plant import equilibrium, load_ship
    >>> point = equilibrium(load_ship("frigate"), drive=22.0, pitch_ratio=1.2)
    >>> round(point.state.ship_speed, 2), round(point.state.shaft_speed, 2)  # [m/s], [rad/s]
    (8.97, 12.31)
    """
    plant = ship.record()
    inputs = Inputs(
        float(drive),
        float(pitch_ratio),
        float(inflow),
        resistance_factor=float(resistance_factor),
        outside=ship.external_values(signals),
    )
    moving = ship.moves
    blade = float(np.clip(pitch_ratio, plant["pitch_ratio_min"], plant["pitch_ratio_max"]))
    blade += float(plant["pitch_actuator_offset"])

    acting = (*inputs[:3], inputs.resistance_factor, inputs.outside)
    inertia, mass = float(plant["inertia_engine_side"]), float(plant["mass"])

    def residual(unknown: Any) -> list[float]:
        shaft_speed = float(unknown[0])
        ship_speed = float(unknown[1]) if moving else 0.0
        shaft_rate, ship_rate, torque, drag = _balances(
            plant, blade, shaft_speed, ship_speed, *acting
        )
        shaft = shaft_rate * inertia / max(abs(torque), 1e-9)
        if not ship.turns_freely:
            shaft = (shaft_speed - float(drive)) / max(abs(drive), 1e-9)
        return [shaft, ship_rate * mass / max(drag, 1.0)] if moving else [shaft]

    def is_steady(unknown: Any) -> bool:
        """Return whether each balance holds to 1e-9.

        The torque of a drive may be far larger than that at the meter of a shaft with little load: the
        balance of the shaft holds to 1e-9 of the larger one.
        """
        errors = np.abs(residual(unknown))
        if errors.max() >= 1e-9 and ship.turns_freely:
            ship_speed = float(unknown[1]) if moving else 0.0
            state = _at_rest(plant, inputs, blade, float(unknown[0]), ship_speed)
            _, outputs = evaluate(plant, state, inputs, blade)
            drive_torque = abs(outputs.brake_torque) * float(plant["gear_ratio"])
            errors[0] /= max(1.0, drive_torque / max(abs(outputs.shaft_torque), 1e-9))
        return bool(errors.max() < 1e-9)

    idle = float(plant["engine_speed_min"] / plant["gear_ratio"])
    shaft_speed, ship_speed = 0.0, 0.0  # the fastest steady state so far
    for start in _starts(ship, drive):
        unknown = start if moving else start[:1]
        solution = scipy.optimize.root(residual, unknown, method="hybr", tol=1e-13)
        if is_steady(solution.x) and solution.x[0] > max(shaft_speed, 1e-3):
            shaft_speed, ship_speed = float(solution.x[0]), float(solution.x[-1])
            if shaft_speed >= idle:
                break
    if shaft_speed == 0.0:
        raise ValueError(
            f"{ship.name}: no steady state with the shaft turning ahead at drive {drive:g} "
            f"{ship.prime_mover.demand.unit} and pitch ratio {pitch_ratio:g}"
        )
    if not ship.turns_freely:
        shaft_speed = float(drive)
    state = _at_rest(plant, inputs, blade, shaft_speed, ship_speed if moving else 0.0)
    _, outputs = evaluate(plant, state, inputs, blade)
    _check_rest(ship, plant, state, inputs, blade)
    return Equilibrium(state, outputs, inputs)


def _check_rest(ship: Ship, plant: Any, state: State, inputs: Inputs, blade: float) -> None:
    """Refuse a term whose state does not come to rest at the steady state."""
    with_state = [term for term in ship.term if term.state is not None]
    for term, direction in zip(with_state, TERM_STATES, strict=False):
        here = directional_rate(state, direction)
        near = 1e-6 * max(1.0, abs(here))
        beside = (shift_state(state, direction, by) for by in (-near, near))
        both = (evaluate(plant, one, inputs, blade)[0] for one in beside)
        rates = [directional_rate(rate, direction) for rate in both]
        if rates[0] * rates[1] > 0.0:
            raise ValueError(
                f"{ship.name}: no steady state: at a shaft speed of {state.shaft_speed:.4g} rad/s and a "
                f"ship speed of {state.ship_speed:.4g} m/s the state {term.state} of term {term.id!r} "
                f"does not come to rest; at {here:.4g} its rate is {max(rates, key=abs):.4g} per second"
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
    # The first list suits large slow propellers; the second is 70 % of the pitch speed of P/D 1.
    pitch_speed = 0.7 * float(plant["diameter"]) / (2.0 * math.pi)
    return [[top * s, top * s * speed] for speed in (0.8, pitch_speed) for s in shares]
