"""Simulations that diverge: the first sample in which a signal leaves every bound.

The plant's only step in time: classic Runge-Kutta with waves, memories and instruments.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from .dynamics import evaluate
from .expressions import NO_SIGNALS
from .hull import episode_factor
from .memory import begin_step, end_step, read_instruments, settle
from .ship import Ship
from .signals import SAMPLE, SIGNALS
from .state import Inputs, Outputs, State, get_state, moved, set_state
from .waves import SYNC_STEPS, WaveMotion, motion, pass_half_step, synchronise

_BEYOND = 1e3
"""Times the registry's range of a signal, beyond which its simulation has diverged."""

_LIMITS = np.array(
    [
        math.inf if signal.source == "demand" else _BEYOND * max(abs(signal.low), abs(signal.high))
        for signal in SIGNALS
    ]
)
"""Demands are the user's, and of a drive in whatever unit it takes; each of them is finite."""


class DivergenceError(ValueError):
    """A simulation that diverges; the message names the signal, its value and the time."""


def refuse_divergence(ship: Ship, samples: NDArray[Any]) -> None:
    """Refuse samples that hold a number that is not finite, or one far beyond its signal's range.

    Args:
        ship: that was simulated, for the message.
        samples: SAMPLE array of shape (n,), contiguous.

    Raises:
        DivergenceError: names the signal, its value and the time.
    """
    values = samples.view(np.float64).reshape(-1, len(SAMPLE.names or ()))
    good = np.abs(values) <= _LIMITS  # false for nan as well
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
    """What acts on the ship at one instant besides its commands and its sea."""

    inflow: float  # u_x [m/s]
    elevation: float  # of the surface above the propeller [m]
    resistance_factor: float  # d_c1 [-]
    outside: tuple[float, ...] = NO_SIGNALS  # that terms hear


UNDISTURBED = Disturbance(0.0, 0.0, 1.0)


@compiled
def _inputs(
    drive: float,
    pitch_command: float,
    rudder_command: float,
    sea: Record,
    disturbance: Disturbance,
    wave: WaveMotion,
    episode: float,
    time: float,
    drive_rate: float,
) -> Inputs:
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
    """One classic fourth-order Runge-Kutta step of length ``dt`` [s] from the derivative ``k1``."""
    k2, _ = evaluate(plant, moved(state, k1, 0.5 * dt), middle, blade_before)
    k3, _ = evaluate(plant, moved(state, k2, 0.5 * dt), middle, blade_before)
    k4, _ = evaluate(plant, moved(state, k3, dt), end, blade_before)
    following = moved(state, k1, dt / 6.0)
    following = moved(following, k2, dt / 3.0)
    following = moved(following, k3, dt / 3.0)
    return moved(following, k4, dt / 6.0)


@compiled
def step(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    drive: float,
    pitch_command: float,
    rudder_command: float,
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
        sea: SEA record; its field is worked out anew every ``SYNC_STEPS`` steps.
        drive: demand on the prime mover [mm | V | N m], held over the step; a speed [rad/s] that is held
            is led to in a straight line, to be reached at the step's end.
        pitch_command: commanded P/D [-], held over the step.
        rudder_command: commanded rudder angle [rad], held over the step.
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
        synchronise(sea, time, now, 0.5 * dt)
    wave = motion(sea)
    begins, middles = memory.rack_start, memory.rack_middle
    speed_rate = 0.0
    if plant.speed_held != 0:
        begins = now.shaft_speed
        middles = 0.5 * (begins + delivered)
        speed_rate = (delivered - begins) / dt
    first = _inputs(
        begins, pitch_command, rudder_command, sea, start, wave, episode, time, speed_rate
    )
    if sea.present != 0:
        pass_half_step(sea)
        wave = motion(sea)
    second = _inputs(
        middles, pitch_command, rudder_command, sea, middle, wave, episode, time + 0.5 * dt,
        speed_rate,
    )  # fmt: skip
    if sea.present != 0:
        pass_half_step(sea)
        wave = motion(sea)
    third = _inputs(
        delivered, pitch_command, rudder_command, sea, end, wave, episode, time + dt, speed_rate
    )
    blade = memory.blade_pitch
    rate, outputs = evaluate(plant, now, first, blade)
    read_instruments(plant, memory, now.shaft_speed, outputs, dt)
    following = runge_kutta(plant, now, rate, second, third, blade, dt)
    set_state(state, following)
    if plant.speed_held != 0:
        state.shaft_speed = delivered
    end_step(plant, memory, following.ship_speed, dt)
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
    """Outputs at the present instant under the last drive input; the instruments read them."""
    now = get_state(state)
    wave = motion(sea)
    time = memory.cursor * dt
    episode = episode_factor(plant, time, dt)
    inputs = _inputs(
        memory.rack, pitch_command, rudder_command, sea, disturbance, wave, episode, time, 0.0
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
    """Start at time 0: the sea synchronised, the memories settled on the initial state."""
    now = get_state(state)
    if sea.present != 0:
        synchronise(sea, 0.0, now, 0.5 * dt)
    wave = motion(sea)
    episode = episode_factor(plant, 0.0, dt)
    stands = drive
    if plant.speed_held != 0:
        stands = now.shaft_speed
    inputs = _inputs(
        stands, now.pitch_ratio, now.rudder_angle, sea, disturbance, wave, episode, 0.0, 0.0
    )
    _, outputs = evaluate(plant, now, inputs, now.pitch_ratio)
    settle(plant, memory, now, outputs, stands, dt)
