"""Kernels of the augmented filter with the plant as its model.

An estimate is stored in three places: as the vector z = (states, disturbance, parameters), in the STATE
record, and in two records of the ship, one real for the prediction and one complex for the derivatives.
Records are written word by word, because a kernel cannot select a field by name at run time.

The disturbance u of the inflow, du/dt = -u / T + w, describes the effect of waves on the propeller.
With a standard deviation and a density of 0 it is absent.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..plant.columns import MEASURED
from ..plant.derivatives import STEP, derivatives
from ..plant.dynamics import evaluate_apart
from ..plant.expressions import external_at
from ..plant.hull import episode_factor
from ..plant.memory import (
    begin_step,
    measured_current_of,
    measured_pitch_of,
    measured_ship_speed_of,
    measured_speed_of,
    measured_thrust_of,
    measured_torque_of,
)
from ..plant.rudder import rudder_angle
from ..plant.state import (
    Inputs,
    Outputs,
    State,
    get_state,
    inputs_without_sea,
    set_state,
    shift_state,
)
from ..plant.stepping import complete, runge_kutta
from .adaptive_noise import AdaptiveNoise, adapt, correct_slopes, propagate_slopes
from .augmented import correct, propagate
from .records import Floats

Ints = NDArray[np.int64]
CHANNELS = tuple(MEASURED)  # measured columns; a channel is an index in this tuple

(_PITCH, _SPEED, _TORQUE, _LOG, _THRUST, _CURRENT, _SHAFT_POWER, _ELECTRIC_POWER, _ANGLE, _SWAY, _YAW,
 _HEADING, _RUDDER) = range(len(CHANNELS))  # fmt: skip


class Model(NamedTuple):
    """Records of a ship and its estimate, with the words that the states and parameters change."""

    plant: Any  # PLANT, shape (1,)
    plant_words: Floats
    twin: Any  # COMPLEX_PLANT, shape (1,)
    twin_words: Floats
    state: Any  # STATE, shape (1,)
    state_words: Floats
    rate: Any  # STATE, shape (1,); last result of a kernel
    rate_words: Floats
    slots: Ints  # word of each estimated state in a STATE record
    units: Any  # STATE, shape (n,): change of the state per unit of each element of z
    owner: Ints  # index of the parameter that changes each word
    word: Ints  # index of the word in the record of the ship
    twin_word: Ints  # index of the word in the complex record
    slope: Floats  # change of the word per unit of the parameter
    base: Floats  # word in the record of the ship file
    start: Floats  # value of each parameter in the ship file
    low: Floats
    high: Floats
    channels: Ints  # measured channels
    noise: Floats  # variance of each channel
    process: Floats  # densities of z
    forgetting: float  # 1 / T of the disturbance [1/s]


class RecordedInputs(NamedTuple):
    """Inputs of the ship along a recording: shape (steps,), continuous inputs (2 steps + 1,)."""

    drive: Floats
    pitch: Floats
    rudder: Floats
    inflow: Floats
    elevation: Floats
    signals: Floats  # external signals, shape (2 steps + 1 or 1, MAX_SIGNALS)
    per_row: int  # steps from one row to the next
    dt: float  # step [s]


@compiled
def _measure(plant: Record, state: State, outputs: Outputs, helm: float, channel: int) -> Real:
    """Return the measurement of a channel without noise, with a rudder command ``helm`` [rad]."""
    if channel == _PITCH:
        return measured_pitch_of(plant, outputs.pitch_ratio)
    if channel == _SPEED:
        return measured_speed_of(plant, state.shaft_speed)
    if channel == _TORQUE:
        return measured_torque_of(plant, outputs.shaft_torque)
    if channel == _LOG:
        return measured_ship_speed_of(plant, state.ship_speed)
    if channel == _THRUST:
        return measured_thrust_of(plant, outputs.thrust)
    if channel == _CURRENT:
        return measured_current_of(plant, outputs.motor_current)
    if channel == _SHAFT_POWER:
        return measured_torque_of(plant, outputs.shaft_torque) * state.shaft_speed
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
def _write_estimate(model: Model, z: Floats) -> None:
    """Write an estimate to the records."""
    states = len(model.slots)
    first = states + 1
    for i in range(states):
        model.state_words[model.slots[i]] = z[i]
    for k in range(len(model.word)):
        model.plant_words[model.word[k]] = model.base[k]
    for k in range(len(model.word)):
        parameter = model.owner[k]
        value = model.plant_words[model.word[k]]
        value += model.slope[k] * (z[first + parameter] - model.start[parameter])
        model.plant_words[model.word[k]] = value
        model.twin_words[model.twin_word[k]] = value


@compiled
def _perturb_parameter(model: Model, i: int, step: float) -> None:
    """Set the imaginary part of the words of the parameter with index ``i`` in z."""
    for k in range(len(model.word)):
        if len(model.slots) + 1 + model.owner[k] == i:
            model.twin_words[model.twin_word[k] + 1] = step * model.slope[k]


@compiled
def _add_inflow(inputs: Inputs, more: Real) -> Inputs:
    """Return the inputs with an additional inflow [m/s]."""
    return Inputs(
        inputs.drive,
        inputs.pitch_command,
        inputs.inflow + more,
        inputs.inflow_slope,
        inputs.inflow_place,
        inputs.wave_along,
        inputs.wave_across,
        inputs.elevation,
        inputs.resistance_factor,
        inputs.time,
        inputs.drive_rate,
        inputs.head_sea,
        inputs.rudder_command,
        inputs.elevation_slope,
        inputs.wind,
        inputs.outside,
    )


@compiled_apart
def _slopes_of_rates(model: Model, now: State, inputs: Inputs, memory: Record, f: Floats) -> None:
    """Fill F, the derivative of the rates of the states by z."""
    disturbance = len(model.slots)
    for i in range(len(f)):
        _perturb_parameter(model, i, STEP)
        along = _add_inflow(inputs, 1j * (STEP if i == disturbance else 0.0))
        unit = get_state(model.units[i])
        slope, _ = derivatives(model.twin[0], now, along, memory.blade_pitch, unit)
        _perturb_parameter(model, i, 0.0)
        set_state(model.rate[0], slope)
        for j in range(len(model.slots)):
            f[j, i] = model.rate_words[model.slots[j]]
    f[disturbance, disturbance] = -model.forgetting


@compiled_apart
def _slopes_of_measurements(model: Model, inputs: Inputs, memory: Record, h: Floats) -> None:
    """Fill H, the derivative of the measurements by z."""
    now = get_state(model.state[0])
    for i in range(h.shape[1]):
        _perturb_parameter(model, i, STEP)
        along = _add_inflow(inputs, 1j * (STEP if i == len(model.slots) else 0.0))
        shifted = shift_state(now, get_state(model.units[i]), STEP * 1j)
        _, outputs = evaluate_apart(model.twin[0], shifted, along, memory.blade_pitch)
        for c in range(len(model.channels)):
            channel, helm = model.channels[c], inputs.rudder_command
            h[c, i] = _measure(model.twin[0], shifted, outputs, helm, channel).imag / STEP
        _perturb_parameter(model, i, 0.0)


@compiled
def _limit_parameters(model: Model, z: Floats, p: Floats) -> None:
    """Set parameters outside their range to its end, and correct all other estimates accordingly.

    The correction by the covariance gives the likeliest estimate at that end (Simon & Chia 2002, IEEE
    Trans. Aerospace and Electronic Systems 38(1)). A parameter set to the end alone would contradict the
    measurements.
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
def _correct_by_measurements(
    model: Model,
    z: Floats,
    p: Floats,
    inputs: Inputs,
    memory: Record,
    h: Floats,
    row: Floats,
    measurements: Floats,
    innovations: Floats,
    adaptive: AdaptiveNoise,
) -> float:
    """Correct an estimate by the measurements of one instant; return their 2 log L."""
    _write_estimate(model, z)
    now, blade = get_state(model.state[0]), memory.blade_pitch
    met = _add_inflow(inputs, z[len(model.slots)])
    _slopes_of_measurements(model, met, memory, h)
    _, outputs = evaluate_apart(model.plant[0], now, met, blade)
    before = z.copy()
    likelihood = 0.0
    for c in range(len(model.channels)):
        expected = _measure(model.plant[0], now, outputs, met.rudder_command, model.channels[c])
        innovation = measurements[c] - expected
        innovations[c] = np.nan
        if np.isfinite(innovation):
            for i in range(len(z)):
                innovation -= h[c, i] * (z[i] - before[i])
            total = correct(z, p, h[c], innovation, model.noise[c], row)
            if adaptive.gain > 0.0:
                correct_slopes(adaptive, c, h[c], row[1], innovation, model.noise[c], total)
            innovations[c] = innovation / np.sqrt(total)
            likelihood -= np.log(2.0 * np.pi * total) + innovation * innovation / total
    if adaptive.gain > 0.0:
        adapt(adaptive, model.noise, model.process)
    _limit_parameters(model, z, p)
    _write_estimate(model, z)
    return likelihood


@compiled
def _inputs_at(
    recorded: RecordedInputs, plant: Record, memory: Record, shaft: float, step: int, edge: int
) -> Inputs:
    """Return the inputs at the start (edge 0), middle (1) or end (2) of a step.

    After the last step its command remains. A held shaft speed is interpolated from the shaft speed at
    the start of the step [rad/s], as in :func:`shaftline.plant.stepping.step`.
    """
    at, dt = 2 * step + edge, recorded.dt
    command = recorded.pitch[min(step, len(recorded.pitch) - 1)]
    factor = episode_factor(plant, memory.cursor * dt, dt)
    helm = recorded.rudder[min(step, len(recorded.rudder) - 1)]
    inflow, elevation = recorded.inflow[at], recorded.elevation[at]
    drive, rate = memory.rack, 0.0
    if edge == 0:
        drive = memory.rack_start
    elif edge == 1:
        drive = memory.rack_middle
    if plant.speed_held != 0:
        rate = (memory.rack - shaft) / dt
        drive = shaft + 0.5 * edge * (memory.rack - shaft)
    return inputs_without_sea(
        drive,
        command,
        inflow,
        elevation,
        factor,
        (memory.cursor + 0.5 * edge) * dt,
        rate,
        helm,
        external_at(recorded.signals, at),
    )


@compiled_apart
def _predict(
    model: Model,
    z: Floats,
    p: Floats,
    recorded: RecordedInputs,
    step: int,
    memory: Record,
    f: Floats,
    work: Floats,
    adaptive: AdaptiveNoise,
) -> None:
    """Predict the estimate and its covariance over one step of the plant."""
    plant, dt = model.plant[0], recorded.dt
    fades = np.exp(-0.5 * dt * model.forgetting)
    u = z[len(model.slots)]
    now = get_state(model.state[0])
    shaft = now.shaft_speed
    start = _add_inflow(_inputs_at(recorded, plant, memory, shaft, step, 0), u)
    middle = _add_inflow(_inputs_at(recorded, plant, memory, shaft, step, 1), u * fades)
    end = _add_inflow(_inputs_at(recorded, plant, memory, shaft, step, 2), u * fades * fades)
    blade = memory.blade_pitch
    rate, outputs = evaluate_apart(plant, now, start, blade)
    _slopes_of_rates(model, shift_state(now, rate, 0.5 * dt), middle, memory, f)
    propagate(p, f, len(model.slots) + 1, model.process, dt, work)
    if adaptive.gain > 0.0:
        propagate_slopes(adaptive, f, len(model.slots) + 1, model.process, dt, work)
    set_state(model.state[0], runge_kutta(plant, now, rate, middle, end, blade, dt))
    complete(plant, model.state[0], memory, now.shaft_speed, outputs, dt)
    for i in range(len(model.slots)):
        z[i] = model.state_words[model.slots[i]]
    z[len(model.slots)] = u * fades * fades


@compiled
def follow_course(
    model: Model,
    z: Floats,
    p: Floats,
    recorded: RecordedInputs,
    memory: Any,
    measurements: Floats,
    estimates: Floats,
    variances: Floats,
    innovations: Floats,
    adaptive: AdaptiveNoise,
    noises: Floats,
) -> float:
    """Run the filter along one recording of n rows, and return 2 log L of the measurements.

    The records of the model, the estimate ``z`` before the first row and its covariance ``p`` are
    changed in place. So is ``memory``, a MEMORY array of shape (1,) in steady state at the first row.
    Measurements of shape (n, channels) are NaN where they are missing. Filled are estimates and
    variances after each row, shape (n, states + 1 + parameters), and innovations over their standard
    deviations, shape (n, channels). With adaptive noise the noises of the model are changed, and
    ``noises`` is filled with them after each row: variances of the channels and densities of states and
    disturbance, shape (n, channels + states + 1).
    """
    n, rows = len(z), len(measurements)
    f, h = np.zeros((n, n)), np.zeros((len(model.channels), n))
    work, row = np.zeros((2, n, n)), np.zeros((3, n))
    likelihood = 0.0
    for k in range(rows):
        first = k * recorded.per_row
        for step in range(first, first + recorded.per_row):
            if k < rows - 1:
                begin_step(model.plant[0], memory[0], recorded.drive[step], recorded.dt)
            if step == first:
                shaft = model.state[0].shaft_speed
                inputs = _inputs_at(recorded, model.plant[0], memory[0], shaft, step, 0)
                likelihood += _correct_by_measurements(
                    model,
                    z,
                    p,
                    inputs,
                    memory[0],
                    h,
                    row,
                    measurements[k],
                    innovations[k],
                    adaptive,
                )
                estimates[k], variances[k] = z, np.diag(p)
                if adaptive.gain > 0.0:
                    noises[k, : len(model.channels)] = model.noise
                    noises[k, len(model.channels) :] = model.process[: len(model.slots) + 1]
            if k == rows - 1:
                break
            _predict(model, z, p, recorded, step, memory[0], f, work, adaptive)
    return likelihood
