"""Sensor models of the environment: measured signals, estimates, learner signals, true state."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..baselines.controller import PREVIEW, PREVIEW_S
from ..core.compiled import Record, compiled, generate_kernel
from ..observers.records import Measurement
from ..observers.registry import update
from ..plant.cavitation import effective_attack
from ..plant.drives.diesel import rack_torque
from ..plant.state import Outputs, State, get_state
from ..plant.waves import inflow_ahead
from .randomness import normal
from .records import MAX_ORDERS
from .rewards import MEAN_S


@compiled
def order_index(episode: Record, time: float) -> int:
    """Return the index of the order at a time since reset [s]."""
    return min(int(time / episode.order_interval), MAX_ORDERS - 1)


@compiled
def speed_order(episode: Record, time: float) -> float:
    """Return the ordered ship speed [m/s] at a time since reset [s]."""
    return float(episode.orders[order_index(episode, time)])


@compiled
def wrap_angle(angle: float) -> float:
    """Return an angle [rad] reduced to half a turn to either side.

    Examples:
        >>> round(wrap_angle(3.5), 4)
        -2.7832
    """
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@compiled
def measure(
    env: Record, noise: Record, acceleration: float, inflow: float, speed_log: float, order: float
) -> None:
    """Sample the noisy instruments, update the observer, and fill the measured signals."""
    memory, episode, seen = env.memory, env.episode, env.observation
    speed = memory.shaft_speed + noise.shaft_speed * normal(episode)
    torque = memory.shaft_torque + noise.shaft_torque * normal(episode)
    pitch = memory.pitch_ratio + noise.pitch_ratio * normal(episode)
    acceleration += noise.shaft_acceleration * normal(episode)
    measurement = Measurement(speed, torque, pitch, acceleration, inflow)
    episode.measured_shaft_speed = speed
    velocity = update(env.observer, env.estimate, measurement)
    seen.speed_order = order
    seen.shaft_speed = speed
    seen.measured_shaft_torque = torque
    seen.measured_pitch_ratio = pitch
    seen.fuel_rack = memory.rack
    seen.measured_ship_speed = speed_log + noise.ship_speed * normal(episode)
    seen.estimated_advance_velocity = velocity
    seen.estimate_valid = env.estimate.valid


_set_preview: Callable[[Any, Any], None] = generate_kernel(
    """
def _set_preview(seen, inflow):
    k = 0
    seen.{field} = inflow[k]; k += 1
""",
    PREVIEW,
    globals(),
)
"""Set the preview signals, in order."""


@compiled
def fill_preview(env: Record, noise: Record, time: float) -> None:
    """Fill the wave inflow ahead, from the sensor at the bow, at a time since reset [s]."""
    inflow = np.empty(len(PREVIEW_S))
    inflow_ahead(env.sea, time, get_state(env.state), PREVIEW_S[1] - PREVIEW_S[0], inflow)
    for k in range(len(inflow)):
        inflow[k] += noise.wave_inflow * normal(env.episode)
    _set_preview(env.observation, inflow)


@compiled
def fill_learner_signals(env: Record, interval_s: float, fresh: bool) -> None:
    """Fill the signals that an observation adds to the measured ones, at the end of an interval.

    The means over 20 s are those of measured or estimated quantities, with one sample for each control
    interval [s]. At the start of an episode (``fresh``) they equal the present values.
    """
    plant, episode, seen = env.plant, env.episode, env.observation
    torque = float(seen.measured_shaft_torque)
    speed, pitch = float(seen.shaft_speed), float(seen.measured_pitch_ratio)
    engine_torque = rack_torque(plant, plant.gear_ratio * speed, float(seen.fuel_rack))
    attack = effective_attack(plant, float(seen.estimated_advance_velocity), speed, pitch)
    if fresh:
        episode.measured_mean_torque = torque
        episode.estimated_mean_brake_torque = engine_torque
        episode.estimated_mean_attack = attack
    fading = min(interval_s / MEAN_S, 1.0)
    episode.measured_mean_torque += fading * (torque - episode.measured_mean_torque)
    away = engine_torque - episode.estimated_mean_brake_torque
    episode.estimated_mean_brake_torque += fading * away
    episode.estimated_mean_attack += fading * (attack - episode.estimated_mean_attack)
    seen.speed_error = seen.speed_order - seen.measured_ship_speed
    seen.pitch_command = episode.pitch_command
    seen.shaft_torque_deviation = torque - episode.measured_mean_torque
    seen.engine_torque_deviation = engine_torque - episode.estimated_mean_brake_torque
    seen.estimated_angle_of_attack = attack
    seen.angle_of_attack_deviation = attack - episode.estimated_mean_attack
    seen.heading_error = wrap_angle(float(seen.heading_order) - float(seen.heading))
    seen.track_error = seen.cross_track_order - seen.cross_track
    seen.shaft_speed_command = episode.shaft_speed_command
    seen.fuel_rack_command = episode.rack_command


@compiled
def measure_course(env: Record, noise: Record, now: State, laid: float, time: float) -> None:
    """Fill the measured course signals of a ship that turns, at a state with rudder angle ``laid``."""
    episode, seen = env.episode, env.observation
    index = order_index(episode, time)
    seen.heading_order = episode.heading_orders[index]
    seen.heading = now.heading + noise.heading * normal(episode)
    seen.yaw_rate = now.yaw_rate + noise.yaw_rate * normal(episode)
    seen.rudder_angle = laid + noise.rudder_angle * normal(episode)
    seen.cross_track_order = episode.track_orders[index]
    seen.cross_track = now.cross_track + noise.cross_track * normal(episode)


@compiled
def fill_truth(
    env: Record,
    before: State,
    outputs: Outputs,
    attack: float,
    outside: float,
    fuel: float,
    laid: float,
) -> None:
    """Fill the true state of a plant step: its state before and its outputs."""
    truth, state = env.truth, env.state
    truth.advance_velocity = outputs.advance_velocity
    truth.thrust = outputs.thrust
    truth.fuel_flow = fuel
    truth.ventilation = state.ventilation
    truth.ship_speed = before.ship_speed
    truth.shaft_speed = before.shaft_speed
    truth.shaft_torque = outputs.shaft_torque
    truth.brake_torque = outputs.brake_torque
    truth.position = state.position
    truth.blade_pitch = outputs.pitch_ratio
    truth.angle_of_attack = attack
    truth.outside_bucket = outside
    truth.heading = before.heading
    truth.cross_track = before.cross_track
    truth.rudder_angle = laid
