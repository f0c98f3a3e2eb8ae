"""The plant as the model of the augmented filter: kernels.

An estimate stands in three places: as z = (states, disturbance, numbers), in the record of the state,
and in the two records of the ship, one real for the prediction and one complex for the slopes. A record
is written word by word, for a kernel cannot choose a field by name at run time.

The disturbance u of the inflow, du/dt = -u / T + w, is what a sea does to the propeller; with a spread
and a density of 0 it is not there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..plant.columns import MEASURED
from ..plant.derivatives import STEP, derivatives
from ..plant.dynamics import evaluate
from ..plant.expressions import outside_at
from ..plant.hull import episode_factor
from ..plant.memory import (
    begin_step,
    current_read,
    end_step,
    pitch_read,
    read_instruments,
    speed_read,
    thrust_read,
    torque_read,
)
from ..plant.rudder import rudder_angle
from ..plant.state import Inputs, Outputs, State, get_state, moved, set_state
from ..plant.stepping import runge_kutta
from .augmented import correct, propagate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHANNELS = tuple(MEASURED)
"""Columns that readings are compared with; a channel is a place here."""

(_PITCH, _SPEED, _TORQUE, _LOG, _THRUST, _CURRENT, _SHAFT_POWER, _ELECTRIC_POWER, _ANGLE, _SWAY, _YAW,
 _HEADING, _RUDDER) = range(len(CHANNELS))  # fmt: skip


class Model(NamedTuple):
    """A ship, its estimate, and where each part of it stands; arrays of one record are seen by words."""

    plant: Any  # PLANT, shape (1,)
    plant_words: Floats
    twin: Any  # COMPLEX_PLANT, shape (1,)
    twin_words: Floats
    state: Any  # STATE, shape (1,)
    state_words: Floats
    rate: Any  # STATE, shape (1,); what a kernel has just worked out
    rate_words: Floats
    slots: Ints  # of each estimated state, its word in a STATE record; the disturbance follows in z
    units: Any  # STATE, shape (n,): which way a state moves along each part of z
    owner: Ints  # of each word that a number moves, which number
    word: Ints  # its place in the ship's record
    twin_word: Ints  # and in the complex one
    slope: Floats  # change of the word per unit of the number
    base: Floats  # the word in the ship's file
    start: Floats  # each number in the ship's file
    low: Floats
    high: Floats
    channels: Ints  # what is measured
    noise: Floats  # variance of each channel
    process: Floats  # densities of z
    forgetting: float  # 1 / T of the disturbance [1/s]


class Course(NamedTuple):
    """What acts on the ship along a recording; of shape (steps,) or, continuous, (2 steps + 1,)."""

    drive: Floats
    pitch: Floats
    rudder: Floats
    inflow: Floats
    elevation: Floats
    signals: Floats  # from outside, shape (2 steps + 1 or 1, MAX_SIGNALS)
    per_row: int  # steps from one row to the next
    dt: float  # of a step [s]


@compiled
def _reading(plant: Record, state: State, outputs: Outputs, helm: float, channel: int) -> Real:
    """What an instrument reads at one instant, with a rudder command [rad]."""
    if channel == _PITCH:
        return pitch_read(plant, outputs.pitch_ratio)
    if channel == _SPEED:
        return speed_read(plant, state.shaft_speed)
    if channel == _TORQUE:
        return torque_read(plant, outputs.shaft_torque)
    if channel == _LOG:
        return state.ship_speed
    if channel == _THRUST:
        return thrust_read(plant, outputs.thrust)
    if channel == _CURRENT:
        return current_read(plant, outputs.motor_current)
    if channel == _SHAFT_POWER:
        return torque_read(plant, outputs.shaft_torque) * state.shaft_speed
    if channel == _ELECTRIC_POWER:
        return outputs.electric_power
    if channel == _ANGLE:
        return state.shaft_angle
    if channel == _SWAY:
        return state.sway_speed
    if channel == _YAW:
        return state.yaw_rate
    if channel == _HEADING:
        return state.heading
    return rudder_angle(plant, state.rudder_angle, helm)


@compiled
def _put(model: Model, z: Floats) -> None:
    """Write an estimate into the records."""
    states = len(model.slots)
    first = states + 1
    for i in range(states):
        model.state_words[model.slots[i]] = z[i]
    for k in range(len(model.word)):
        model.plant_words[model.word[k]] = model.base[k]
    for k in range(len(model.word)):
        number = model.owner[k]
        value = model.plant_words[model.word[k]]
        value += model.slope[k] * (z[first + number] - model.start[number])
        model.plant_words[model.word[k]] = value
        model.twin_words[model.twin_word[k]] = value


@compiled
def _move_along(model: Model, i: int, step: float) -> None:
    """Give the words of number ``i``, counted in z, an imaginary part."""
    for k in range(len(model.word)):
        if len(model.slots) + 1 + model.owner[k] == i:
            model.twin_words[model.twin_word[k] + 1] = step * model.slope[k]


@compiled
def _disturbed(inputs: Inputs, more: Real) -> Inputs:
    """The same with more inflow [m/s]."""
    return Inputs(
        inputs.drive, inputs.pitch_command, inputs.inflow + more, inputs.inflow_slope,
        inputs.inflow_place, inputs.wave_along, inputs.wave_across, inputs.elevation,
        inputs.resistance_factor, inputs.time, inputs.drive_rate, inputs.head_sea,
        inputs.rudder_command, inputs.elevation_slope, inputs.outside,
    )  # fmt: skip


@compiled_apart
def _slopes_of_rates(model: Model, now: State, inputs: Inputs, memory: Record, f: Floats) -> None:
    """F, derivative of the states' rates to all of z; filled."""
    disturbance = len(model.slots)
    for i in range(len(f)):
        _move_along(model, i, STEP)
        along = _disturbed(inputs, 1j * (STEP if i == disturbance else 0.0))
        slope, _ = derivatives(
            model.twin[0], now, along, memory.blade_pitch,
            get_state(model.units[i]),
        )  # fmt: skip
        _move_along(model, i, 0.0)
        set_state(model.rate[0], slope)
        for j in range(len(model.slots)):
            f[j, i] = model.rate_words[model.slots[j]]
    f[disturbance, disturbance] = -model.forgetting


@compiled_apart
def _slopes_of_readings(model: Model, inputs: Inputs, memory: Record, h: Floats) -> None:
    """H, derivative of the readings to all of z; filled."""
    now = get_state(model.state[0])
    for i in range(h.shape[1]):
        _move_along(model, i, STEP)
        along = _disturbed(inputs, 1j * (STEP if i == len(model.slots) else 0.0))
        shifted = moved(now, get_state(model.units[i]), STEP * 1j)
        _, outputs = evaluate(model.twin[0], shifted, along, memory.blade_pitch)
        for c in range(len(model.channels)):
            read = _reading(
                model.twin[0], shifted, outputs, inputs.rudder_command, model.channels[c]
            )
            h[c, i] = read.imag / STEP
        _move_along(model, i, 0.0)


@compiled
def _keep_within(model: Model, z: Floats, p: Floats) -> None:
    """Bring numbers that have left their range back to its end, and all else along with them.

    As far as the covariance says that it goes with them: the likeliest estimate at that end (Simon &
    Chia 2002, IEEE Trans. Aerospace and Electronic Systems 38(1)). Moved alone, a number would
    contradict the readings that the others were made to fit.
    """
    first = len(model.slots) + 1
    for i in range(len(model.low)):
        at = first + i
        short = min(max(z[at], model.low[i]), model.high[i]) - z[at]
        if short != 0.0 and p[at, at] > 0.0:
            share = short / p[at, at]
            for j in range(len(z)):
                z[j] += p[j, at] * share
    for i in range(len(model.low)):
        z[first + i] = min(max(z[first + i], model.low[i]), model.high[i])


@compiled_apart
def _take_in(
    model: Model, z: Floats, p: Floats, inputs: Inputs, memory: Record, h: Floats,
    row: Floats, readings: Floats, innovations: Floats,
) -> float:  # fmt: skip
    """Correct an estimate by the readings of one instant; gives their 2 log L."""
    _put(model, z)
    now, blade = get_state(model.state[0]), memory.blade_pitch
    met = _disturbed(inputs, z[len(model.slots)])
    _slopes_of_readings(model, met, memory, h)
    _, outputs = evaluate(model.plant[0], now, met, blade)
    before = z.copy()
    likelihood = 0.0
    for c in range(len(model.channels)):
        expected = _reading(model.plant[0], now, outputs, met.rudder_command, model.channels[c])
        innovation = readings[c] - expected
        innovations[c] = np.nan
        if np.isfinite(innovation):
            for i in range(len(z)):
                innovation -= h[c, i] * (z[i] - before[i])
            total = correct(z, p, h[c], innovation, model.noise[c], row)
            innovations[c] = innovation / np.sqrt(total)
            likelihood -= np.log(2.0 * np.pi * total) + innovation * innovation / total
    _keep_within(model, z, p)
    _put(model, z)
    return likelihood


@compiled
def _acts(
    course: Course, plant: Record, memory: Record, shaft: float, step: int, edge: int
) -> Inputs:
    """What acts at an edge of a step: 0 its start, 1 its middle, 2 its end.

    Args:
        course: what was recorded.
        plant: ship record.
        memory: after the step's demand has come.
        shaft: speed at the step's start [rad/s]; one that is held is led on from there, as in
            :func:`shaftline.plant.stepping.step`.
        step: which one; after the last one that which stands.
        edge: of it.
    """
    at, dt = 2 * step + edge, course.dt
    command = course.pitch[min(step, len(course.pitch) - 1)]
    factor = episode_factor(plant, memory.cursor * dt, dt)
    helm = course.rudder[min(step, len(course.rudder) - 1)]
    inflow, elevation = course.inflow[at], course.elevation[at]
    drive, rate = memory.rack, 0.0
    if edge == 0:
        drive = memory.rack_start
    elif edge == 1:
        drive = memory.rack_middle
    if plant.speed_held != 0:
        rate = (memory.rack - shaft) / dt
        drive = shaft + 0.5 * edge * (memory.rack - shaft)
    return Inputs(
        drive, command, inflow, 0.0, 0.0, 0.0, 0.0, elevation, factor,
        (memory.cursor + 0.5 * edge) * dt, rate, 0.0, helm, 0.0, outside_at(course.signals, at),
    )  # fmt: skip


@compiled_apart
def _carry(
    model: Model, z: Floats, p: Floats, course: Course, step: int, memory: Record, f: Floats,
    room: Floats,
) -> None:  # fmt: skip
    """Predict over one step of the plant, as the plant itself takes it."""
    plant, dt = model.plant[0], course.dt
    fades = np.exp(-0.5 * dt * model.forgetting)
    u = z[len(model.slots)]
    now = get_state(model.state[0])
    shaft = now.shaft_speed
    start = _disturbed(_acts(course, plant, memory, shaft, step, 0), u)
    middle = _disturbed(_acts(course, plant, memory, shaft, step, 1), u * fades)
    end = _disturbed(_acts(course, plant, memory, shaft, step, 2), u * fades * fades)
    blade = memory.blade_pitch
    rate, outputs = evaluate(plant, now, start, blade)
    _slopes_of_rates(model, moved(now, rate, 0.5 * dt), middle, memory, f)
    propagate(p, f, len(model.slots) + 1, model.process, dt, room)
    read_instruments(plant, memory, now.shaft_speed, outputs, dt)
    following = runge_kutta(plant, now, rate, middle, end, blade, dt)
    set_state(model.state[0], following)
    if plant.speed_held != 0:
        model.state[0].shaft_speed = memory.rack
    end_step(plant, memory, following.ship_speed, dt)
    for i in range(len(model.slots)):
        z[i] = model.state_words[model.slots[i]]
    z[len(model.slots)] = u * fades * fades


@compiled
def follow_course(
    model: Model, z: Floats, p: Floats, course: Course, memory: Any, readings: Floats,
    estimates: Floats, variances: Floats, innovations: Floats,
) -> float:  # fmt: skip
    """The filter along one recording of n rows.

    Args:
        model: of the ship; its records are changed in place.
        z: estimate before the first row; changed in place.
        p: its covariance; likewise.
        course: what acts.
        memory: MEMORY array of shape (1,), settled on the first row; likewise.
        readings: shape (n, channels); NaN where an instrument gave nothing.
        estimates: shape (n, states + 1 + numbers); filled with what is believed after each row.
        variances: likewise.
        innovations: over their standard deviations, shape (n, channels); filled.

    Returns:
        2 log L of the readings.
    """
    n, rows = len(z), len(readings)
    f, h = np.zeros((n, n)), np.zeros((len(model.channels), n))
    room, row = np.zeros((2, n, n)), np.zeros((3, n))
    likelihood = 0.0
    for k in range(rows):
        first = k * course.per_row
        for step in range(first, first + course.per_row):
            if k < rows - 1:
                begin_step(model.plant[0], memory[0], course.drive[step], course.dt)
            if step == first:
                shaft = model.state[0].shaft_speed
                inputs = _acts(course, model.plant[0], memory[0], shaft, step, 0)
                likelihood += _take_in(
                    model, z, p, inputs, memory[0], h, row, readings[k], innovations[k]
                )
                for i in range(n):
                    estimates[k, i] = z[i]
                    variances[k, i] = p[i, i]
            if k == rows - 1:
                break
            _carry(model, z, p, course, step, memory[0], f, room)
    return likelihood
