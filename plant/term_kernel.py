"""Evaluating terms inside the equations: operations on a stack, as :mod:`.terms` writes them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core.compiled import Real, Record, compiled_apart

MAX_TERMS, MAX_OPERATIONS, MAX_CONSTANTS, MAX_DEPTH = 6, 64, 24, 12

(CONSTANT, SIGNAL, ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, NEGATE, ABS, SIGN, STEP, SQRT, EXP, LOG,
 TANH, SIN, COS, ARCTAN, MIN, MAX) = range(20)  # fmt: skip
"""Operations."""


class Heard(NamedTuple):
    """Signals at one instant, in the order of :data:`shaftline.plant.terms.TERM_SIGNALS`."""

    shaft_speed: Real
    ship_speed: Real
    pitch_ratio: Real
    pitch_command: Real
    drive: Real
    advance_velocity: Real
    submergence: Real
    time: Real


class Added(NamedTuple):
    """What a ship's terms add at each place, in the order of :data:`shaftline.plant.terms.PLACES`."""

    drive: Real  # [mm | V | N m]
    inflow_velocity: Real  # [m/s]
    thrust: Real  # of one propeller [N]
    drive_torque: Real  # [N m]
    load_torque: Real  # [N m]
    resistance: Real  # [N]
    pitch_rate: Real  # [1/s]


@compiled_apart
def added(plant: Record, heard: Heard) -> Added:
    """Sums of a ship's terms, place by place; 0 where it has none.

    Args:
        plant: ship record.
        heard: the signals.
    """
    signals = np.array([
        heard.shaft_speed, heard.ship_speed, heard.pitch_ratio, heard.pitch_command, heard.drive,
        heard.advance_velocity, heard.submergence, heard.time,
    ])  # fmt: skip
    stack = np.empty(MAX_DEPTH, signals.dtype)
    sums = np.zeros(7, signals.dtype)
    for slot in range(plant.term_count):
        top = -1
        for k in range(plant.term_length[slot]):
            code, index = plant.term_code[slot, k], plant.term_index[slot, k]
            if code == CONSTANT:
                top += 1
                stack[top] = plant.term_constants[slot, index]
            elif code == SIGNAL:
                top += 1
                stack[top] = signals[index]
            elif code <= POWER or code >= MIN:
                top -= 1
                stack[top] = _of_two(code, stack[top], stack[top + 1])
            else:
                stack[top] = _of_one(code, stack[top])
        sums[plant.term_place[slot]] += stack[0]
    return Added(sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6])


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
