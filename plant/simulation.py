"""Time stepping: one ship with its whole history, or a batch of ships in one call.

Both go through ``step``, the plant's only step in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from .dynamics import (
    MEMORY,
    STATE,
    Inputs,
    Outputs,
    State,
    begin_step,
    end_step,
    evaluate,
    get_state,
    read_instruments,
    runge_kutta,
    set_state,
    settle,
)
from .hull import episode_factor
from .ship import Ship
from .signals import SAMPLE
from .waves import SYNC_STEPS, WaveMotion, calm, motion, synchronise, turn


class Disturbance(NamedTuple):
    """What acts on the ship at one instant besides its commands and its sea."""

    inflow: float  # u_x [m/s]
    elevation: float  # of the surface above the propeller [m]
    resistance_factor: float  # d_c1 [-]


UNDISTURBED = Disturbance(0.0, 0.0, 1.0)


@compiled
def _inputs(
    drive: float,
    pitch_command: float,
    disturbance: Disturbance,
    wave: WaveMotion,
    episode: float,
    time: float,
) -> Inputs:
    return Inputs(
        drive,
        pitch_command,
        disturbance.inflow + wave.inflow,
        wave.inflow_slope,
        wave.position,
        disturbance.elevation + wave.elevation,
        disturbance.resistance_factor * episode,
        time,
    )


@compiled
def step(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    drive: float,
    pitch_command: float,
    start: Disturbance,
    middle: Disturbance,
    end: Disturbance,
    dt: float,
) -> Outputs:
    """Carry one ship over one time step; state, memory and sea are changed in place.

    Args:
        plant: PLANT record.
        state: STATE record.
        memory: MEMORY record.
        sea: SEA record; its phasors are set anew every ``SYNC_STEPS`` steps.
        drive: demand on the prime mover [mm | V | N m], held over the step.
        pitch_command: commanded P/D [-], held over the step.
        start: disturbance at the step's start, added to the sea's.
        middle: at its middle.
        end: at its end.
        dt: [s].

    Returns:
        The outputs at the step's start, with the new commands acting; the memory holds the
        instruments' readings of that instant.
    """
    now = get_state(state)
    delivered = begin_step(plant, memory, drive, dt)
    time = memory.cursor * dt
    episode = episode_factor(plant, time, dt)
    if sea.present != 0 and memory.cursor % SYNC_STEPS == 0:
        synchronise(sea, time, now.position, now.ship_speed, 0.5 * dt)
    wave = motion(sea, now.position)
    first = _inputs(delivered, pitch_command, start, wave, episode, time)
    if sea.present != 0:
        turn(sea, 0.5 * dt)
        wave = motion(sea, now.position)
    second = _inputs(delivered, pitch_command, middle, wave, episode, time + 0.5 * dt)
    if sea.present != 0:
        turn(sea, 0.5 * dt)
        wave = motion(sea, now.position)
    third = _inputs(delivered, pitch_command, end, wave, episode, time + dt)
    blade = memory.blade_pitch
    ventilated = memory.ventilated != 0
    rate, outputs = evaluate(plant, now, first, blade, ventilated)
    read_instruments(plant, memory, outputs, dt)
    following = runge_kutta(plant, now, rate, second, third, blade, ventilated, dt)
    set_state(state, following)
    end_step(plant, memory, following.ship_speed, dt)
    return outputs


@compiled
def observe(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    pitch_command: float,
    disturbance: Disturbance,
    dt: float,
) -> Outputs:
    """Outputs at the present instant under the last drive input; the instruments read them."""
    now = get_state(state)
    wave = motion(sea, now.position)
    time = memory.cursor * dt
    episode = episode_factor(plant, time, dt)
    inputs = _inputs(memory.rack, pitch_command, disturbance, wave, episode, time)
    _, outputs = evaluate(plant, now, inputs, memory.blade_pitch, memory.ventilated != 0)
    read_instruments(plant, memory, outputs, dt)
    return outputs


@compiled
def prepare(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    drive: float,
    disturbance: Disturbance,
    dt: float,
) -> None:
    """Start at time 0: the sea synchronised, the memories settled on the initial state."""
    now = get_state(state)
    if sea.present != 0:
        synchronise(sea, 0.0, now.position, now.ship_speed, 0.5 * dt)
    wave = motion(sea, now.position)
    episode = episode_factor(plant, 0.0, dt)
    inputs = _inputs(drive, now.pitch_ratio, disturbance, wave, episode, 0.0)
    _, outputs = evaluate(plant, now, inputs, now.pitch_ratio, False)
    settle(plant, memory, now, outputs, drive, dt)


@compiled
def _write(
    sample: Record,
    time: float,
    drive: float,
    pitch_command: float,
    state: State,
    memory: Record,
    speed_log: float,
    outputs: Outputs,
) -> None:
    sample.time = time
    sample.drive = drive
    sample.pitch_command = pitch_command
    sample.pitch_ratio = outputs.pitch_ratio
    sample.shaft_speed = state.shaft_speed
    sample.shaft_torque = outputs.shaft_torque
    sample.ship_speed = state.ship_speed
    sample.measured_pitch_ratio = memory.pitch_ratio
    sample.measured_shaft_torque = memory.shaft_torque
    sample.measured_ship_speed = speed_log
    sample.shaft_acceleration = outputs.shaft_acceleration
    sample.advance_velocity = outputs.advance_velocity
    sample.thrust = outputs.thrust
    sample.propeller_torque = outputs.propeller_torque
    sample.brake_torque = outputs.brake_torque
    sample.resistance = outputs.resistance
    sample.motor_current = outputs.motor_current
    sample.submergence = outputs.submergence
    sample.ventilation = state.ventilation
    sample.position = state.position


@compiled
def trajectory(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    drive: NDArray[np.float64],
    pitch_command: NDArray[np.float64],
    inflow: NDArray[np.float64],
    elevation: NDArray[np.float64],
    resistance_factor: NDArray[np.float64],
    dt: float,
    samples: Any,
) -> None:
    """Simulate one ship's record and keep every sample: :func:`simulate` without its checks.

    Args:
        plant: PLANT record; :func:`shaftline.plant.ship.record_name` tells which field a key sets.
        state: STATE record, the initial state; the final one afterwards.
        memory: MEMORY record, filled from the initial state whatever it held.
        sea: SEA record, changed in place.
        drive: demand of each step [mm | V | N m], shape (n,).
        pitch_command: commanded P/D of each step [-], shape (n,).
        inflow: u_x [m/s] at the steps' starts and middles and the last one's end, shape (2 n + 1,).
        elevation: of the surface above the propeller [m], likewise.
        resistance_factor: d_c1 [-], likewise.
        dt: [s].
        samples: SAMPLE array of shape (n + 1,), filled.
    """
    begin = Disturbance(inflow[0], elevation[0], resistance_factor[0])
    prepare(plant, state, memory, sea, drive[0], begin, dt)
    steps = len(drive)
    for k in range(steps):
        a, b, c = 2 * k, 2 * k + 1, 2 * k + 2
        now = get_state(state)
        log = memory.speed_log
        outputs = step(
            plant,
            state,
            memory,
            sea,
            drive[k],
            pitch_command[k],
            Disturbance(inflow[a], elevation[a], resistance_factor[a]),
            Disturbance(inflow[b], elevation[b], resistance_factor[b]),
            Disturbance(inflow[c], elevation[c], resistance_factor[c]),
            dt,
        )
        _write(samples[k], k * dt, drive[k], pitch_command[k], now, memory, log, outputs)
    last = steps - 1
    finish = Disturbance(inflow[-1], elevation[-1], resistance_factor[-1])
    outputs = observe(plant, state, memory, sea, pitch_command[last], finish, dt)
    _write(
        samples[steps],
        steps * dt,
        drive[last],
        pitch_command[last],
        get_state(state),
        memory,
        memory.speed_log,
        outputs,
    )


@compiled
def advance(
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    drive: NDArray[np.float64],
    pitch_command: NDArray[np.float64],
    steps: int,
    dt: float,
) -> None:
    """Carry a batch of ships over some steps with held commands; everything changes in place.

    Args:
        plants: PLANT array of shape (n,).
        states: STATE array of shape (n,).
        memories: MEMORY array of shape (n,), settled by ``prepare``.
        seas: SEA array of shape (n,).
        drive: demand on each prime mover [mm | V | N m], shape (n,).
        pitch_command: commanded P/D [-], shape (n,).
        steps: how many to take.
        dt: [s].
    """
    for i in range(len(plants)):
        for _ in range(steps):
            step(
                plants[i],
                states[i],
                memories[i],
                seas[i],
                drive[i],
                pitch_command[i],
                UNDISTURBED,
                UNDISTURBED,
                UNDISTURBED,
                dt,
            )


@dataclass(frozen=True)
class Schedule:
    """What is done to a ship over time, as functions of time or constants.

    ``drive`` is the fuel rack [mm], voltage [V] or torque [N m]; ``inflow`` is u_x [m/s],
    ``resistance_factor`` d_c1 [-] and ``elevation`` that of the surface above the propeller [m], the
    sea's apart. Commands are held over each step; disturbances are continuous.
    """

    drive: Any
    pitch_command: Any
    inflow: Any = 0.0
    resistance_factor: Any = 1.0
    elevation: Any = 0.0


def _sampled(value: Any, times: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    array = np.asarray(value(times) if callable(value) else value, dtype=np.float64)
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} holds a value that is not finite")
    return np.ascontiguousarray(np.broadcast_to(array, times.shape))


def simulate(
    ship: Ship,
    schedule: Schedule,
    duration_s: float,
    *,
    initial: State,
    sea: Any = None,
    dt: float | None = None,
) -> NDArray[Any]:
    """Simulate one ship and keep every sample.

    Args:
        ship: the ship.
        schedule: commands and disturbances. The drive is taken to have stood at its first demand
            for ever, so a rate limit or dead time acts on changes after time 0 only.
        duration_s: length [s].
        initial: initial state, for example from :func:`shaftline.plant.equilibrium`.
        sea: SEA record from :func:`shaftline.plant.waves.realise`, or None for calm water.
        dt: time step [s]; the ship's own by default.

    Returns:
        SAMPLE array of shape (steps + 1,): one sample at every step's start,
        with that step's commands acting, and one at the end.

    Raises:
        ShipError: the ship's delays or its motor do not fit the time step.
        ValueError: an input is not finite.
    """
    if dt is not None and dt != ship.time_step_s:
        ship = ship.with_values({"integration.time_step_s": dt})
    dt = ship.time_step_s
    steps = max(1, math.ceil(duration_s / dt - 1e-9))
    grid = np.arange(steps, dtype=np.float64) * dt
    half_grid = np.arange(2 * steps + 1, dtype=np.float64) * (0.5 * dt)
    state = np.zeros(1, STATE)
    state[0] = tuple(float(value) for value in initial)
    samples = np.zeros(steps + 1, SAMPLE)
    trajectory(
        ship.record(),
        state[0],
        np.zeros(1, MEMORY)[0],
        calm() if sea is None else sea.copy(),
        _sampled(schedule.drive, grid, "drive"),
        _sampled(schedule.pitch_command, grid, "pitch_command"),
        _sampled(schedule.inflow, half_grid, "inflow"),
        _sampled(schedule.elevation, half_grid, "elevation"),
        _sampled(schedule.resistance_factor, half_grid, "resistance_factor"),
        dt,
        samples,
    )
    return samples
