"""One control interval of many environments in one compiled call.

Plant, sea, instruments with noise, observer, reward terms and termination: all of it for every
sub-environment. The single environment is a batch of one, so both are the same machine code.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..baselines.actions import decode
from ..baselines.governor import govern
from ..core.compiled import Record, compiled
from ..observers.base import Measurement
from ..observers.registry import update
from ..plant.stepping import Disturbance, observe, step
from .randomness import normal
from .records import MAX_ORDERS
from .rewards import Instant, add_terms, clear_terms, fuel_of_all, reward_of


class Arrays(NamedTuple):
    """A batch of n environments: a record of each kind for every one."""

    plants: Any  # PLANT
    states: Any  # STATE
    memories: Any  # MEMORY
    seas: Any  # SEA
    observers: Any  # OBSERVER
    estimates: Any  # ESTIMATE
    episodes: Any  # EPISODE
    observations: Any  # OBSERVATION, filled
    terms: Any  # REWARD_TERMS, means over the interval in physical units, filled
    truths: Any  # TRUTH, at the interval's last step, filled
    rewards: Any  # minus the weighted sum of the terms, filled
    ended: Any  # RUNNING, STALLED or TRIPPED, filled


MEAN_S = 20.0  # over which a torque's mean is taken

OVERSPEED_TRIP = 1.15  # of the engine's highest speed
STALL = 0.3  # of its lowest

RUNNING, STALLED, TRIPPED = 0, 1, 2
"""Why an episode ended."""

ENDINGS = (None, "stalled", "overspeed trip")
"""The same in words."""


@compiled
def speed_order(episode: Record, time: float) -> float:
    """Ordered ship speed [m/s] at a time since reset [s]."""
    index = min(int(time / episode.order_interval), MAX_ORDERS - 1)
    return float(episode.orders[index])


@compiled
def resistance_angle(episode: Any, time: Any) -> Any:
    """Angle [rad] of the slow swing of the resistance at a time since reset [s]; of one or of many."""
    return episode.resistance_frequency * time + episode.resistance_phase


@compiled
def disturbance(episode: Record, time: float) -> Disturbance:
    """Disturbance at a time since reset [s]: resistance with the episode's mean and a slow swing."""
    angle = resistance_angle(episode, time)
    factor = episode.resistance_mean + episode.resistance_swing * math.sin(angle)
    return Disturbance(0.0, 0.0, factor)


@compiled
def _measure(
    all: Arrays,
    i: int,
    noise: Record,
    shaft_speed: float,
    acceleration: float,
    advance_velocity: float,
    speed_log: float,
    order: float,
) -> None:
    """Read the noisy instruments, let the observer follow, and fill an observation."""
    memory, episode, row = all.memories[i], all.episodes[i], all.observations[i]
    speed = shaft_speed + noise.shaft_speed * normal(episode)
    torque = memory.shaft_torque + noise.shaft_torque * normal(episode)
    pitch = memory.pitch_ratio + noise.pitch_ratio * normal(episode)
    acceleration += noise.shaft_acceleration * normal(episode)
    reading = Measurement(speed, torque, pitch, acceleration, advance_velocity)
    episode.measured_shaft_speed = speed
    velocity = update(all.observers[i], all.estimates[i], reading)
    row.speed_order = order
    row.shaft_speed = speed
    row.measured_shaft_torque = torque
    row.measured_pitch_ratio = pitch
    row.fuel_rack = memory.rack
    row.measured_ship_speed = speed_log + noise.ship_speed * normal(episode)
    row.estimated_advance_velocity = velocity
    row.estimate_valid = all.estimates[i].valid


@compiled
def first_observation(all: Arrays, noise: Record, dt: float, which: NDArray[np.int64]) -> None:
    """Fill the observations of environments ``which`` that were just reset."""
    for i in which:
        state, episode = all.states[i], all.episodes[i]
        outputs = observe(
            all.plants[i], state, all.memories[i], all.seas[i], episode.pitch_command,
            disturbance(episode, 0.0), dt,
        )  # fmt: skip
        episode.gauge_torque = episode.mean_torque = outputs.shaft_torque
        _measure(
            all, i, noise, state.shaft_speed, outputs.shaft_acceleration, outputs.advance_velocity,
            all.memories[i].speed_log, speed_order(episode, 0.0),
        )  # fmt: skip


@compiled
def _gains_at(gains: NDArray[np.float64], speed: float) -> tuple[float, float]:
    """Governor's k_p and k_i at a shaft speed: linear between rows' entries, held outside."""
    last = gains.shape[1] - 1
    if speed <= gains[0, 0] or last == 0:
        return gains[1, 0], gains[2, 0]
    for k in range(last):
        if speed < gains[0, k + 1]:
            x = (speed - gains[0, k]) / (gains[0, k + 1] - gains[0, k])
            return (
                gains[1, k] + x * (gains[1, k + 1] - gains[1, k]),
                gains[2, k] + x * (gains[2, k + 1] - gains[2, k]),
            )
    return gains[1, last], gains[2, last]


@compiled
def control_interval(
    all: Arrays,
    noise: Record,
    weights: Record,
    gains: NDArray[np.float64],
    action: NDArray[np.float32],
    steps: int,
    dt: float,
    first: int,
    last: int,
) -> None:
    """Carry environments ``first`` to ``last`` over one control interval; all changes in place.

    Args:
        all: the batch.
        noise: NOISE record.
        weights: of the reward terms, REWARD_TERMS record.
        gains: of the governor: shaft speed, k_p, k_i by row, shape (3, m); shape (3, 0) leaves the
            rack to the action.
        action: in [-1, 1], shape (n, 2), over the ship's ranges: pitch command, and fuel rack command
            or, where there is a governor, shaft speed set-point.
        steps: plant steps in the interval.
        dt: plant step [s].
        first: first environment.
        last: one past the last.
    """
    governed = gains.shape[1] > 0
    share = 1.0 / steps
    for i in range(first, last):
        plant, state, memory, episode = (
            all.plants[i],
            all.states[i],
            all.memories[i],
            all.episodes[i],
        )
        terms, truth = all.terms[i], all.truths[i]
        pitch = decode(action[i, 0], plant.pitch_ratio_min, plant.pitch_ratio_max)
        drive = decode(action[i, 1], plant.drive_min, plant.drive_max)
        set_point = decode(
            action[i, 1],
            plant.engine_speed_min / plant.gear_ratio,
            plant.engine_speed_max / plant.gear_ratio,
        )
        clear_terms(terms)
        episode.pitch_command = pitch
        for k in range(steps):
            time = (episode.elapsed * steps + k) * dt
            order = speed_order(episode, time)
            if governed:
                proportional, integral_gain = _gains_at(gains, episode.measured_shaft_speed)
                drive, episode.integral = govern(
                    plant, set_point, episode.measured_shaft_speed, episode.integral, proportional,
                    integral_gain,
                )  # fmt: skip
            shaft_speed, ship_speed, log = state.shaft_speed, state.ship_speed, memory.speed_log
            outputs = step(
                plant, state, memory, all.seas[i], drive, pitch, disturbance(episode, time),
                disturbance(episode, time + 0.5 * dt), disturbance(episode, time + dt), dt,
            )  # fmt: skip
            torque_before = episode.gauge_torque
            episode.gauge_torque = outputs.shaft_torque
            episode.mean_torque += dt / MEAN_S * (outputs.shaft_torque - episode.mean_torque)
            fuel = fuel_of_all(plant, shaft_speed, outputs.brake_torque)
            now = Instant(
                order, ship_speed, shaft_speed, memory.rack, drive, episode.drive, torque_before,
                episode.mean_torque, dt,
            )  # fmt: skip
            add_terms(terms, plant, outputs, now, share, fuel)
            episode.drive = drive
            truth.advance_velocity = outputs.advance_velocity
            truth.thrust = outputs.thrust
            truth.fuel_flow = fuel
            truth.ventilation = state.ventilation
            truth.ship_speed = ship_speed
            truth.shaft_speed = shaft_speed
            truth.shaft_torque = outputs.shaft_torque
            truth.brake_torque = outputs.brake_torque
            truth.position = state.position
            _measure(
                all, i, noise, shaft_speed, outputs.shaft_acceleration, outputs.advance_velocity,
                log, order,
            )  # fmt: skip
        all.ended[i] = _why_ended(plant, state.shaft_speed)
        terms.failure = 0.0 if all.ended[i] == RUNNING else 1.0
        all.rewards[i] = reward_of(weights, terms)
        episode.elapsed += 1


@compiled
def _why_ended(plant: Record, shaft_speed: float) -> int:
    """RUNNING, or why the episode ends."""
    engine_speed = plant.gear_ratio * shaft_speed
    if engine_speed > OVERSPEED_TRIP * plant.engine_speed_max:
        return TRIPPED
    if not engine_speed > STALL * plant.engine_speed_min:
        return STALLED
    return RUNNING
