"""One time step of the plant: classic Runge-Kutta with waves, memory and instruments.

Also the check of a simulation for divergence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Real, Record, compiled, compiled_apart, generate_tuple_kernel
from .dynamics import evaluate, evaluate_apart, evaluate_straight, evaluate_without_roll
from .expressions import NO_SIGNALS
from .hull import episode_factor
from .memory import begin_step, end_step, read_instruments, settle_memory
from .ship import Ship
from .signals import SAMPLE, SIGNALS
from .state import Inputs, Outputs, State, get_state, set_state, shift_state
from .waves import SYNC_STEPS, pass_half_step, synchronise, wave_motion

LIMITS = np.array(
    [math.inf if s.source == "demand" else 1e3 * max(abs(s.low), abs(s.high)) for s in SIGNALS]
)
"""Bounds of the samples, 1000 times the range of a signal in the registry.

Commands have none: the user gives them, in the unit of the drive."""


class DivergenceError(ValueError):
    """A simulation that diverges; the message names the signal, its value and the time."""


def refuse_divergence(ship: Ship, samples: NDArray[Any]) -> None:
    """Refuse samples with a value that is not finite or far beyond the range of its signal.

    The SAMPLE array has shape (n,) and is contiguous; the DivergenceError names the signal, its value
    and the time.
    """
    values = samples.view(np.float64).reshape(-1, len(SAMPLE.names or ()))
    good = np.abs(values) <= LIMITS  # also false for NaN
    good &= np.isfinite(values)
    if good.all():
        return
    row = int(np.argmin(good.all(axis=1)))
    signal = SIGNALS[int(np.argmin(good[row]))]
    value, time = float(samples[signal.name][row]), float(samples["time"][row])
    raise DivergenceError(
        f"{ship.name}: the simulation diverges: {signal.column} = {value:.3g} {signal.unit} at "
        f"{time:.4g} s. The initial state, an input or a parameter of the ship is many orders too "
        f"large, or too fast for the time step of {ship.time_step_s:g} s"
    )


class Disturbance(NamedTuple):
    """Disturbances of the ship at one instant, in addition to commands and sea."""

    inflow: float  # u_x [m/s]
    elevation: float  # of the surface above the propeller [m]
    resistance_factor: float  # d_c1 [-]
    outside: tuple[float, ...] = NO_SIGNALS  # external signals of terms


UNDISTURBED = Disturbance(0.0, 0.0, 1.0)


class StepInputs(NamedTuple):
    """What acts on a ship during a time step, in addition to the sea.

    The commands are constant over the step. A held shaft speed [rad/s] changes linearly and reaches its
    command at the end of the step.
    """

    drive: float  # command of the prime mover [mm | V | N m | rad/s]
    pitch_command: float  # P/D [-]
    rudder_command: float  # rudder angle [rad]
    start: Disturbance
    middle: Disturbance
    end: Disturbance


@compiled
def constant_inputs(
    drive: float, pitch_command: float, rudder_command: float, disturbance: Disturbance
) -> StepInputs:
    """Return the inputs of a step with a constant disturbance."""
    throughout = disturbance, disturbance, disturbance
    return StepInputs(drive, pitch_command, rudder_command, *throughout)


@compiled
def _inputs(
    drive: float,
    pitch_command: float,
    rudder_command: float,
    sea: Record,
    disturbance: Disturbance,
    episode: float,
    time: float,
    drive_rate: float,
) -> Inputs:
    wave = wave_motion(sea)
    return Inputs(
        drive,
        pitch_command,
        disturbance.inflow + wave.inflow,
        wave.inflow_slope,
        wave.place,
        sea.along,
        sea.across,
        disturbance.elevation + wave.elevation,
        disturbance.resistance_factor * episode,
        time,
        drive_rate,
        wave.head_sea,
        rudder_command,
        wave.elevation_slope,
        sea.wind,
        disturbance.outside,
    )


@compiled
def runge_kutta(
    plant: Record,
    state: State,
    k1: State,
    middle: Inputs,
    end: Inputs,
    blade_before: float,
    dt: float,
) -> State:
    """Return the state after a fourth-order Runge-Kutta step of ``dt`` [s], given its first slope."""
    if plant.rolls != 0:
        return _runge_kutta(plant, state, k1, middle, end, blade_before, dt, True)
    return _runge_kutta(plant, state, k1, middle, end, blade_before, dt, False)


@compiled
def _derivative(
    plant: Record, state: State, inputs: Inputs, blade_before: Real, rolls: bool
) -> tuple[State, Outputs]:
    """Return derivative and outputs; ``rolls`` is constant, so that the compiler keeps one branch."""
    if rolls:
        return evaluate_apart(plant, state, inputs, blade_before)
    return evaluate_without_roll(plant, state, inputs, blade_before)


@compiled
def _runge_kutta(
    plant: Record,
    state: State,
    k1: State,
    middle: Inputs,
    end: Inputs,
    blade_before: Real,
    dt: float,
    rolls: bool,
) -> State:
    k2, _ = _derivative(plant, shift_state(state, k1, 0.5 * dt), middle, blade_before, rolls)
    k3, _ = _derivative(plant, shift_state(state, k2, 0.5 * dt), middle, blade_before, rolls)
    k4, _ = _derivative(plant, shift_state(state, k3, dt), end, blade_before, rolls)
    following = shift_state(state, k1, dt / 6.0)
    following = shift_state(following, k2, dt / 3.0)
    following = shift_state(following, k3, dt / 3.0)
    return shift_state(following, k4, dt / 6.0)


_later: Callable[[Inputs, Inputs, bool], Inputs] = generate_tuple_kernel(
    "later(middle, end, ends)",
    "Inputs",
    "end.{field} if ends else middle.{field}",
    Inputs._fields,
    globals(),
)


class Begun(NamedTuple):
    """A step before the ship responds: its state, the inputs at three instants and the blades' pitch."""

    now: State
    first: Inputs  # at the start of the step
    second: Inputs  # at its middle
    third: Inputs  # at its end
    blade: Real  # pitch ratio of the blades after the previous step [-]


@compiled
def _advance(plant: Record, begun: Begun, dt: float, rolls: bool) -> tuple[Outputs, State]:
    rate, outputs = _derivative(plant, begun.now, begun.first, begun.blade, rolls)
    return outputs, _runge_kutta(
        plant, begun.now, rate, begun.second, begun.third, begun.blade, dt, rolls
    )


@compiled_apart
def _advance_with_roll(plant: Record, begun: Begun, dt: float) -> tuple[Outputs, State]:
    """Return what :func:`_advance` returns, for a ship with roll."""
    return _advance(plant, begun, dt, True)


@compiled
def advance(plant: Record, begun: Begun, dt: float) -> tuple[Outputs, State]:
    """Return the outputs at the start of a step, and the state at its end."""
    if plant.rolls != 0:
        return _advance_with_roll(plant, begun, dt)
    return _advance(plant, begun, dt, False)


@compiled_apart
def advance_apart(plant: Record, begun: Begun, dt: float) -> tuple[Outputs, State]:
    """Return what :func:`advance` returns; compiled faster, for what seldom happens."""
    return advance(plant, begun, dt)


@compiled
def advance_together(ships: Any, begun: Begun, dt: float) -> tuple[Outputs, State]:
    """Return what :func:`advance` returns, for several ships at once on a straight course.

    The last three stages are a loop, because the processor keeps no more machine code at hand.
    """
    now = begun.now
    rate, outputs = evaluate_straight(ships, now, begun.first, begun.blade)
    following = shift_state(now, rate, dt / 6.0)
    for stage in range(1, 4):
        moved = shift_state(now, rate, dt if stage == 3 else 0.5 * dt)
        inputs = _later(begun.second, begun.third, stage == 3)
        rate, _ = evaluate_straight(ships, moved, inputs, begun.blade)
        following = shift_state(following, rate, dt / 6.0 if stage == 3 else dt / 3.0)
    return outputs, following


@compiled
def begin(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    acting: StepInputs,
    dt: float,
) -> Begun:
    """Begin a step with the arguments of :func:`step`; memory and sea are changed in place."""
    now = get_state(state)
    delivered = begin_step(plant, memory, acting.drive, dt)
    time = memory.cursor * dt
    episode = episode_factor(plant, time, dt)
    if sea.present != 0 and memory.cursor % SYNC_STEPS == 0:
        synchronise(sea, time, now, 0.5 * dt)
    begins, middles, speed_rate = memory.rack_start, memory.rack_middle, 0.0
    if plant.speed_held != 0:
        begins = now.shaft_speed
        middles = 0.5 * (begins + delivered)
        speed_rate = (delivered - begins) / dt
    pitch, rudder, half = acting.pitch_command, acting.rudder_command, time + 0.5 * dt
    first = _inputs(begins, pitch, rudder, sea, acting.start, episode, time, speed_rate)
    if sea.present != 0:
        pass_half_step(sea)
    second = _inputs(middles, pitch, rudder, sea, acting.middle, episode, half, speed_rate)
    if sea.present != 0:
        pass_half_step(sea)
    third = _inputs(delivered, pitch, rudder, sea, acting.end, episode, time + dt, speed_rate)
    return Begun(now, first, second, third, memory.blade_pitch)


@compiled
def complete(
    plant: Record, state: Record, memory: Record, shaft_speed: float, outputs: Outputs, dt: float
) -> None:
    """Complete a step: read the instruments, and advance the memory.

    Args:
        plant: ship record.
        state: STATE record at the end of the step.
        memory: MEMORY record.
        shaft_speed: at the start of the step [rad/s].
        outputs: at the start of the step.
        dt: time step [s].
    """
    read_instruments(plant, memory, shaft_speed, outputs, dt)
    if plant.speed_held != 0:
        state.shaft_speed = memory.rack
    end_step(plant, memory, state.ship_speed, dt)


@compiled
def step(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    acting: StepInputs,
    dt: float,
) -> Outputs:
    """Advance one ship by one time step [s]; state, memory and sea are changed in place.

    The field of the sea is computed anew every ``SYNC_STEPS`` steps.

    Returns:
        The outputs at the start of the step under the new commands; the memory holds the measurements at
        that instant.
    """
    begun = begin(plant, state, memory, sea, acting, dt)
    outputs, following = advance(plant, begun, dt)
    set_state(state, following)
    complete(plant, state, memory, begun.now.shaft_speed, outputs, dt)
    return outputs


@compiled
def observe(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    pitch_command: float,
    rudder_command: float,
    disturbance: Disturbance,
    dt: float,
) -> Outputs:
    """Return the outputs at the present instant under the last drive input, and update measurements."""
    now, time = get_state(state), memory.cursor * dt
    episode = episode_factor(plant, time, dt)
    inputs = _inputs(
        memory.rack, pitch_command, rudder_command, sea, disturbance, episode, time, 0.0
    )
    _, outputs = evaluate(plant, now, inputs, memory.blade_pitch)
    read_instruments(plant, memory, now.shaft_speed, outputs, dt)
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
    """Prepare a simulation at time 0: synchronise the sea and settle the memory on the initial state."""
    now = get_state(state)
    if sea.present != 0:
        synchronise(sea, 0.0, now, 0.5 * dt)
    episode = episode_factor(plant, 0.0, dt)
    if plant.speed_held != 0:
        drive = now.shaft_speed
    pitch = now.pitch_ratio
    inputs = _inputs(drive, pitch, now.rudder_angle, sea, disturbance, episode, 0.0, 0.0)
    _, outputs = evaluate(plant, now, inputs, pitch)
    settle_memory(plant, memory, now, outputs, drive, dt)
