"""Evaluating terms inside the equations: operations on a stack, as :mod:`.terms` writes them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.compiled import Real, Record, compiled, compiled_apart

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
    rate_1: Real
    rate_2: Real
    rate_3: Real


_ALL = BEFORE + len(Added._fields)


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
    nothing = heard.shaft_speed * 0.0
    none = Loaded(nothing, nothing, nothing, nothing, nothing)
    sums = _sums(plant, heard, none, states, outside, 0, BEFORE)
    return AddedBefore(sums[0], sums[1])


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
    s = _sums(plant, heard, loaded, states, outside, BEFORE, _ALL)
    return Added(s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9])


@compiled
def _sums(
    plant: Record, heard: Heard, loaded: Loaded, states: tuple[Real, ...],
    outside: tuple[float, ...], first: int, end: int,
) -> Any:  # fmt: skip
    """Sums at the places from ``first`` up to ``end``."""
    signals = np.array([
        heard.shaft_speed, heard.ship_speed, heard.pitch_ratio, heard.pitch_command, heard.drive,
        heard.advance_velocity, heard.submergence, heard.time,
        loaded.thrust, loaded.propeller_torque, loaded.brake_torque, loaded.resistance,
        loaded.pitch_rate, states[0], states[1], states[2],
        outside[0], outside[1], outside[2], outside[3], outside[4], outside[5],
    ])  # fmt: skip
    stack = np.empty(MAX_DEPTH, signals.dtype)
    sums = np.zeros(_ALL, signals.dtype)
    for slot in range(plant.term_programs):
        place = plant.term_place[slot]
        if place < first or place >= end:
            continue
        term = plant.term_owner[slot]
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
                stack[top] = _tabled(stack, top, index // 2)
            elif code <= POWER or code >= MIN:
                top -= 1
                stack[top] = _of_two(code, stack[top], stack[top + 1])
            else:
                stack[top] = _of_one(code, stack[top])
        sums[place] += stack[0]
    return sums


@compiled_apart
def _tabled(stack: Any, at: int, count: int) -> Real:
    """Straight lines between ``count`` pairs of knot and value, held outside them.

    The signal stands in the stack's place ``at``, the pairs behind it.
    """
    x, first = stack[at], at + 1
    if x.real < stack[first].real:
        return stack[first + 1]
    for k in range(first, first + 2 * (count - 1), 2):
        if x.real < stack[k + 2].real:
            slope = (stack[k + 3] - stack[k + 1]) / (stack[k + 2] - stack[k])
            return stack[k + 1] + slope * (x - stack[k])
    return stack[first + 2 * count - 1]


@compiled_apart
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
    count = int(abs(right.real))
    if right.real != math.floor(right.real) or count > 8:
        return left**right
    product = left * 0.0 + 1.0
    for _ in range(count):
        product = product * left
    return product if right.real >= 0.0 else 1.0 / product


@compiled_apart
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
