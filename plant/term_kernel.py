"""Evaluating terms inside the equations: operations on a stack, as :mod:`.terms` writes them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.numeric import piecewise_linear

MAX_TERMS, MAX_PROGRAMS, MAX_OPERATIONS, MAX_CONSTANTS, MAX_DEPTH = 6, 12, 64, 24, 24
MAX_STATES = 3
MAX_SIGNALS = 6
"""From outside the ship that its terms may hear."""

(CONSTANT, SIGNAL, ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, NEGATE, ABS, SIGN, STEP, SQRT, EXP, LOG,
 TANH, SIN, COS, ARCTAN, MIN, MAX, TABLE) = range(21)  # fmt: skip
"""Operations."""

NO_SIGNALS = (0.0,) * MAX_SIGNALS
"""Where nothing from outside is heard."""


class Heard(NamedTuple):
    """Signals at one instant that are known before any term acts."""

    shaft_speed: Real
    ship_speed: Real
    pitch_ratio: Real
    pitch_command: Real
    drive: Real
    advance_velocity: Real
    submergence: Real
    time: Real
    sway_speed: Real
    yaw_rate: Real
    heading: Real
    rudder_angle: Real
    shaft_angle: Real


class Loaded(NamedTuple):
    """Signals that are known once demand and inflow are: what the plant's own parts give."""

    thrust: Real
    propeller_torque: Real
    brake_torque: Real
    resistance: Real
    pitch_rate: Real


BEFORE = 2
"""Places whose terms act before the parts do: the first of :data:`shaftline.plant.terms.PLACES`."""

FIRST_STATE = len(Heard._fields) + len(Loaded._fields)
FIRST_SIGNAL = FIRST_STATE + MAX_STATES
"""Where the states of terms, and what is heard from outside, begin among the signals."""


class AddedBefore(NamedTuple):
    """What a ship's terms add to what its parts are given."""

    drive: Real  # [mm | V | N m]
    inflow_velocity: Real  # [m/s]


class Added(NamedTuple):
    """What a ship's terms add to what its parts give, and the rates of the terms' own states."""

    thrust: Real  # of one propeller [N]
    drive_torque: Real  # [N m]
    load_torque: Real  # [N m]
    resistance: Real  # [N]
    pitch_rate: Real  # [1/s]
    side_force: Real  # [N]
    yaw_moment: Real  # [N m]
    rate_1: Real
    rate_2: Real
    rate_3: Real


@compiled
def outside_at(signals: Any, row: int) -> tuple[float, ...]:
    """What is heard from outside at a row of an array of shape (rows, MAX_SIGNALS), or its only one."""
    k = min(row, len(signals) - 1)
    return (
        signals[k, 0], signals[k, 1], signals[k, 2], signals[k, 3], signals[k, 4], signals[k, 5],
    )  # fmt: skip


@compiled_apart
def added_before(
    plant: Record, heard: Heard, states: tuple[Real, ...], outside: tuple[float, ...]
) -> AddedBefore:
    """Sums of a ship's terms on what its parts are given.

    Args:
        plant: ship record.
        heard: the signals.
        states: of its terms.
        outside: signals from outside the ship.
    """
    none = Loaded(0.0, 0.0, 0.0, 0.0, 0.0)
    signals = _signals(heard, none, states, outside)
    drive = inflow_velocity = signals[0] * 0.0
    for slot in range(plant.term_programs):
        if plant.term_place[slot] == 0:
            drive += _value(plant, signals, slot)
        elif plant.term_place[slot] == 1:
            inflow_velocity += _value(plant, signals, slot)
    return AddedBefore(drive, inflow_velocity)


@compiled_apart
def added(
    plant: Record, heard: Heard, loaded: Loaded, states: tuple[Real, ...],
    outside: tuple[float, ...],
) -> Added:  # fmt: skip
    """Sums of a ship's terms on what its parts give, place by place; 0 where it has none.

    Args:
        plant: ship record.
        heard: the signals.
        loaded: the signals that the parts give.
        states: of its terms.
        outside: signals from outside the ship.
    """
    signals = _signals(heard, loaded, states, outside)
    t = q = m = r = p = y = n = rate_1 = rate_2 = rate_3 = signals[0] * 0.0
    for slot in range(plant.term_programs):
        place = plant.term_place[slot]
        if place < BEFORE:
            continue
        value = _value(plant, signals, slot)
        if place == 2:
            t += value
        elif place == 3:
            q += value
        elif place == 4:
            m += value
        elif place == 5:
            r += value
        elif place == 6:
            p += value
        elif place == 7:
            y += value
        elif place == 8:
            n += value
        elif place == 9:
            rate_1 += value
        elif place == 10:
            rate_2 += value
        else:
            rate_3 += value
    return Added(t, q, m, r, p, y, n, rate_1, rate_2, rate_3)


@compiled
def _signals(
    heard: Heard, loaded: Loaded, states: tuple[Real, ...], outside: tuple[float, ...]
) -> tuple[Real, ...]:
    """All signals in their order, of one type: complex where any of them is."""
    of_type = 0.0 * (
        heard.shaft_speed + heard.ship_speed + heard.pitch_ratio + heard.pitch_command + heard.drive
        + heard.advance_velocity + heard.submergence + heard.time + heard.sway_speed
        + heard.yaw_rate + heard.heading + heard.rudder_angle + heard.shaft_angle + loaded.thrust
        + states[0] + states[1] + states[2] + outside[0]
    )  # fmt: skip
    return (
        of_type + heard.shaft_speed, of_type + heard.ship_speed, of_type + heard.pitch_ratio,
        of_type + heard.pitch_command, of_type + heard.drive, of_type + heard.advance_velocity,
        of_type + heard.submergence, of_type + heard.time, of_type + heard.sway_speed,
        of_type + heard.yaw_rate, of_type + heard.heading, of_type + heard.rudder_angle,
        of_type + heard.shaft_angle,
        of_type + loaded.thrust,
        of_type + loaded.propeller_torque, of_type + loaded.brake_torque,
        of_type + loaded.resistance, of_type + loaded.pitch_rate,
        of_type + states[0], of_type + states[1], of_type + states[2],
        of_type + outside[0], of_type + outside[1], of_type + outside[2],
        of_type + outside[3], of_type + outside[4], of_type + outside[5],
    )  # fmt: skip


@compiled
def _value(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """Value of a program."""
    if plant.term_depth[slot] <= REGISTERS:
        return _in_registers(plant, signals, slot)
    return _on_a_stack(plant, signals, slot)


REGISTERS = 4
"""Depth up to which a program needs no stack in memory."""


@compiled
def _in_registers(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """Value of a program that is not deep; ``a`` is the top of its stack."""
    term = plant.term_owner[slot]
    a = b = c = d = signals[0] * 0.0
    for k in range(plant.term_length[slot]):
        code, index = plant.term_code[slot, k], plant.term_index[slot, k]
        if code == CONSTANT:
            a, b, c, d = a * 0.0 + plant.term_constants[term, index], a, b, c
        elif code == SIGNAL:
            a, b, c, d = signals[index], a, b, c
        elif code <= POWER or code >= MIN:
            a, b, c = _of_two(code, b, a), c, d
        else:
            a = _of_one(code, a)
    return a


@compiled_apart
def _on_a_stack(plant: Record, signals: tuple[Real, ...], slot: int) -> Real:
    """The same of any program."""
    term = plant.term_owner[slot]
    stack = np.zeros(MAX_DEPTH, np.array(signals[:1]).dtype)
    top = -1
    for k in range(plant.term_length[slot]):
        code, index = plant.term_code[slot, k], plant.term_index[slot, k]
        if code == CONSTANT:
            top += 1
            stack[top] = plant.term_constants[term, index]
        elif code == SIGNAL:
            top += 1
            stack[top] = signals[index]
        elif code == TABLE:
            top -= index
            points = stack[top + 1 : top + 1 + index]
            stack[top] = piecewise_linear(points[::2], points[1::2], index // 2, stack[top])
        elif code <= POWER or code >= MIN:
            top -= 1
            stack[top] = _of_two(code, stack[top], stack[top + 1])
        else:
            stack[top] = _of_one(code, stack[top])
    return stack[0]


@compiled_apart
def rows_of(program: Any, constants: Any, signals: Any, found: Any) -> None:
    """Values of a program that belongs to no term, a row each.

    Args:
        program: operations, each with its index, shape (n, 2).
        constants: that it uses, shape (m,).
        signals: that it uses, shape (rows, k).
        found: shape (rows,), filled; not finite where the program has no value.
    """
    stack = np.zeros(MAX_DEPTH)
    for row in range(len(signals)):
        top = -1
        for k in range(len(program)):
            code, index = program[k, 0], program[k, 1]
            if code == CONSTANT:
                top += 1
                stack[top] = constants[index]
            elif code == SIGNAL:
                top += 1
                stack[top] = signals[row, index]
            elif code == TABLE:
                top -= index
                points = stack[top + 1 : top + 1 + index]
                stack[top] = piecewise_linear(points[::2], points[1::2], index // 2, stack[top])
            elif code <= POWER or code >= MIN:
                top -= 1
                stack[top] = _of_two(code, stack[top], stack[top + 1])
            else:
                stack[top] = _of_one(code, stack[top])
        found[row] = stack[0]


@compiled
def _of_two(code: int, left: Real, right: Real) -> Real:
    if code == ADD:
        return left + right
    if code == SUBTRACT:
        return left - right
    if code == MULTIPLY:
        return left * right
    if code == DIVIDE:
        return left / right
    if code == MIN:
        return left if left.real <= right.real else right
    if code == MAX:
        return left if left.real >= right.real else right
    # whole powers by multiplication, so that a negative base is no complex number
    if right.real != math.floor(right.real) or abs(right.real) > 8.0:
        return left**right
    product = left * 0.0 + 1.0
    for _ in range(int(abs(right.real))):
        product = product * left
    return product if right.real >= 0.0 else 1.0 / product


@compiled
def _of_one(code: int, x: Real) -> Real:
    if code == NEGATE:
        return -x
    if code == ABS:
        return x if x.real >= 0.0 else -x
    if code == SIGN:
        return x * 0.0 + (1.0 if x.real > 0.0 else (-1.0 if x.real < 0.0 else 0.0))
    if code == STEP:
        return x * 0.0 + (1.0 if x.real > 0.0 else 0.0)
    if code == SQRT:
        return np.sqrt(x)
    if code == EXP:
        return np.exp(x)
    if code == LOG:
        return np.log(x)
    if code == TANH:
        return np.tanh(x)
    if code == SIN:
        return np.sin(x)
    if code == COS:
        return np.cos(x)
    return np.arctan(x)
