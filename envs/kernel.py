"""One control interval of many environments in one compiled call.

Plant, sea, instruments with noise, observer, reward terms and termination: all of it for every
sub-environment. The single environment is a batch of one, so both are the same machine code.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.actions import decode
from ..baselines.governor import govern
from ..core.compiled import Record, compiled
from ..observers.records import Measurement
from ..observers.registry import update
from ..plant.cavitation import effective_attack, outside_bucket
from ..plant.rudder import rudder_angle
from ..plant.state import State, get_state
from ..plant.stepping import Disturbance, observe, step
from ..plant.waves import inflow_ahead
from .randomness import normal
from .records import MAX_ORDERS
from .rewards import Instant, add_terms, clear_terms, fuel_of_all, reward_of, running_cost

DRIFT_SWING = 0.5  # amplitude of the slow swing of the side force, over its mean

MEAN_S = 20.0  # over which a torque's mean is taken

OVERSPEED_TRIP = 1.15  # of the engine's highest speed
STALL = 0.3  # of its lowest

RUNNING, STALLED, TRIPPED = 0, 1, 2
"""Why an episode ended."""

ENDINGS = (None, "stalled", "overspeed trip")
"""The same in words."""


@compiled
def order_at(episode: Record, time: float) -> int:
    """Which of an episode's orders holds at a time since reset [s]."""
    return min(int(time / episode.order_interval), MAX_ORDERS - 1)


@compiled
def speed_order(episode: Record, time: float) -> float:
    """Ordered ship speed [m/s] at a time since reset [s]."""
    return float(episode.orders[order_at(episode, time)])


@compiled
def resistance_angle(episode: Any, time: Any) -> Any:
    """Angle [rad] of the slow swing of the resistance at a time since reset [s]; of one or of many."""
    return episode.resistance_frequency * time + episode.resistance_phase


@compiled
def shorter_way(angle: float) -> float:
    """The same angle [rad] within half a turn to either side."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@compiled
def _unit_phasor(angle: float) -> complex:
    """Unit phasor exp(i angle) [-] of an angle [rad]."""
    return complex(math.cos(angle), math.sin(angle))


@compiled
def _swung(episode: Record, swing: complex) -> Disturbance:
    """Disturbance where the slow swing of resistance and side force has a unit phasor [-]."""
    factor = episode.resistance_mean + episode.resistance_swing * swing.imag
    drift = episode.drift_force * (1.0 + DRIFT_SWING * swing.real)
    return Disturbance(0.0, 0.0, factor, (drift, 0.0, 0.0, 0.0, 0.0, 0.0))


@compiled
def disturbance(episode: Record, time: float) -> Disturbance:
    """Disturbance at a time since reset [s]: resistance and side force, means and a slow swing."""
    return _swung(episode, _unit_phasor(resistance_angle(episode, time)))


@compiled
def waves_ahead(
    environments: Any, time: NDArray[np.float64], every_s: float, found: NDArray[np.float64]
) -> None:
    """Waves' inflow at the propellers [m/s] where the ships will be if they keep their speed.

    Args:
        environments: ENVIRONMENT array of shape (n,).
        time: since reset [s], shape (n,).
        every_s: between two entries of what is found.
        found: filled, shape (n, k), the first entry with the present inflow.
    """
    for i in range(len(environments)):
        now = get_state(environments[i].state)
        inflow_ahead(environments[i].sea, time[i], now, every_s, found[i])


@compiled
def _measure(
    env: Record,
    noise: Record,
    acceleration: float,
    advance_velocity: float,
    speed_log: float,
    order: float,
) -> None:
    """Read the noisy instruments, let the observer follow, and fill the observation."""
    memory, episode, seen = env.memory, env.episode, env.observation
    speed = memory.shaft_speed + noise.shaft_speed * normal(episode)
    torque = memory.shaft_torque + noise.shaft_torque * normal(episode)
    pitch = memory.pitch_ratio + noise.pitch_ratio * normal(episode)
    acceleration += noise.shaft_acceleration * normal(episode)
    reading = Measurement(speed, torque, pitch, acceleration, advance_velocity)
    episode.measured_shaft_speed = speed
    velocity = update(env.observer, env.estimate, reading)
    seen.speed_order = order
    seen.shaft_speed = speed
    seen.measured_shaft_torque = torque
    seen.measured_pitch_ratio = pitch
    seen.fuel_rack = memory.rack
    seen.measured_ship_speed = speed_log + noise.ship_speed * normal(episode)
    seen.estimated_advance_velocity = velocity
    seen.estimate_valid = env.estimate.valid


@compiled
def _see_course(env: Record, noise: Record, now: State, laid: float, time: float) -> None:
    """Fill what a helmsman sees of a ship that turns, at a state with the rudder laid to an angle."""
    episode, seen = env.episode, env.observation
    index = order_at(episode, time)
    seen.heading_order = episode.heading_orders[index]
    seen.heading = now.heading + noise.heading * normal(episode)
    seen.yaw_rate = now.yaw_rate + noise.yaw_rate * normal(episode)
    seen.rudder_angle = laid + noise.rudder_angle * normal(episode)
    seen.cross_track_order = episode.track_orders[index]
    seen.cross_track = now.cross_track + noise.cross_track * normal(episode)


@compiled
def first_observation(
    environments: Any, common: Record, dt: float, which: NDArray[np.int64]
) -> None:
    """Fill the observations of environments ``which`` that were just reset."""
    for i in which:
        env = environments[i]
        state, episode = env.state, env.episode
        outputs = observe(
            env.plant, state, env.memory, env.sea, episode.pitch_command, 0.0,
            disturbance(episode, 0.0), dt,
        )  # fmt: skip
        episode.gauge_torque = episode.mean_torque = outputs.shaft_torque
        episode.mean_brake_torque = outputs.brake_torque
        episode.mean_attack = effective_attack(
            env.plant, outputs.advance_velocity, state.shaft_speed, outputs.pitch_ratio
        )
        _measure(
            env, common.noise, outputs.shaft_acceleration,
            outputs.advance_velocity, env.memory.speed_log, speed_order(episode, 0.0),
        )  # fmt: skip
        if env.plant.turns != 0:
            _see_course(env, common.noise, get_state(state), 0.0, 0.0)


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
    environments: Any,
    common: Record,
    gains: NDArray[np.float64],
    action: NDArray[np.float32],
    steps: int,
    dt: float,
    first: int,
    last: int,
) -> None:
    """Carry environments ``first`` to ``last`` over one control interval; all changes in place.

    Args:
        environments: ENVIRONMENT array of shape (n,).
        common: COMMON record.
        gains: of the governor: shaft speed, k_p, k_i by row, shape (3, m); shape (3, 0) leaves the
            rack to the action.
        action: in [-1, 1], shape (n, 2) or (n, 3), over the ship's ranges: pitch command, fuel rack
            command or, where there is a governor, shaft speed set-point, and rudder command; amidships
            where it is not given.
        steps: plant steps in the interval.
        dt: plant step [s].
        first: first environment.
        last: one past the last.
    """
    governed = gains.shape[1] > 0
    share = 1.0 / steps
    for i in range(first, last):
        env = environments[i]
        plant, state, memory, episode = env.plant, env.state, env.memory, env.episode
        terms, truth = env.terms, env.truth
        pitch = decode(action[i, 0], plant.pitch_ratio_min, plant.pitch_ratio_max)
        drive = decode(action[i, 1], plant.drive_min, plant.drive_max)
        set_point = decode(
            action[i, 1],
            plant.engine_speed_min / plant.gear_ratio,
            plant.engine_speed_max / plant.gear_ratio,
        )
        rudder = 0.0
        if action.shape[1] > 2:
            rudder = decode(action[i, 2], -plant.rudder_max, plant.rudder_max)
        laid = rudder_angle(plant, state.rudder_angle, episode.rudder_command)
        clear_terms(terms)
        episode.pitch_command, episode.rudder_command = pitch, rudder
        # the swing turns on by half steps: n of them leave its phasor wrong by less than n times 1e-15
        swing = _unit_phasor(resistance_angle(episode, episode.elapsed * steps * dt))
        half_step = _unit_phasor(0.5 * dt * episode.resistance_frequency)
        end = _swung(episode, swing)
        for k in range(steps):
            time = (episode.elapsed * steps + k) * dt
            order = speed_order(episode, time)
            if governed:
                proportional, integral_gain = _gains_at(gains, episode.measured_shaft_speed)
                drive, episode.integral = govern(
                    plant, set_point, episode.measured_shaft_speed, episode.integral, proportional,
                    integral_gain,
                )  # fmt: skip
            before, log = get_state(state), memory.speed_log
            shaft_speed, ship_speed = before.shaft_speed, before.ship_speed
            start, middle = end, _swung(episode, swing * half_step)
            swing = swing * half_step * half_step
            end = _swung(episode, swing)
            outputs = step(
                plant, state, memory, env.sea, drive, pitch, rudder, start, middle, end, dt,
            )  # fmt: skip
            laid_before, laid = laid, rudder_angle(plant, state.rudder_angle, rudder)
            torque_before = episode.gauge_torque
            episode.gauge_torque = outputs.shaft_torque
            attack = effective_attack(
                plant, outputs.advance_velocity, shaft_speed, outputs.pitch_ratio
            )
            outside = outside_bucket(plant, attack, shaft_speed, outputs.submergence)
            fading = dt / MEAN_S
            episode.mean_torque += fading * (outputs.shaft_torque - episode.mean_torque)
            episode.mean_brake_torque += fading * (outputs.brake_torque - episode.mean_brake_torque)
            episode.mean_attack += fading * (attack - episode.mean_attack)
            fuel = fuel_of_all(plant, shaft_speed, outputs.brake_torque)
            now = Instant(
                order, ship_speed, shaft_speed, memory.rack, drive, episode.drive, torque_before,
                episode.mean_torque, episode.mean_brake_torque, attack, episode.mean_attack, outside,
                shorter_way(before.heading - episode.heading_orders[order_at(episode, time)]),
                before.cross_track - episode.track_orders[order_at(episode, time)],
                laid - laid_before, dt,
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
            truth.blade_pitch = outputs.pitch_ratio
            truth.angle_of_attack = attack
            truth.outside_bucket = outside
            truth.heading = before.heading
            truth.cross_track = before.cross_track
            truth.rudder_angle = laid_before
            _measure(
                env, common.noise, outputs.shaft_acceleration, outputs.advance_velocity,
                log, order,
            )  # fmt: skip
            if plant.turns != 0:
                _see_course(env, common.noise, before, laid_before, time)
        env.ended = _why_ended(plant, state.shaft_speed)
        env.reward = reward_of(
            running_cost(common.weights, terms), env.ended != RUNNING, common.worst_cost,
            common.intervals, episode.elapsed,
        )  # fmt: skip
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
