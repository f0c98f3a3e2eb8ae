"""One control interval of many environments in one compiled call.

Plant, sea, instruments with noise, observer, reward terms and termination: all of it for every
sub-environment. The single environment is a batch of one, so both are the same machine code.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED
from ..baselines.governor import govern
from ..core.compiled import Record, compiled
from ..observers.base import Measurement
from ..observers.registry import update
from ..plant.cavitation import burrill_ratio
from ..plant.drives.diesel import rack_torque, torque_limit
from ..plant.fuel import fuel_rate
from ..plant.stepping import Disturbance, observe, step
from .randomness import normal
from .tasks import TERMS

MAX_ORDERS = 64

EPISODE = np.dtype(
    [
        ("random", np.uint64),
        ("elapsed", np.int64),  # control intervals since reset
        ("orders", np.float64, (MAX_ORDERS,)),  # ordered ship speeds [m/s], one an order interval
        ("order_interval", np.float64),  # [s]
        ("resistance_mean", np.float64),  # d_c1 [-]
        ("resistance_swing", np.float64),
        ("resistance_frequency", np.float64),  # [rad/s]
        ("resistance_phase", np.float64),
        ("pitch_command", np.float64),
        ("drive", np.float64),
        ("gauge_torque", np.float64),  # last sample [N m]
        ("mean_torque", np.float64),  # over the last MEAN_S [N m]
        ("measured_shaft_speed", np.float64),  # last reading, for the governor [rad/s]
        ("integral", np.float64),  # of the governor [mm]
    ],
    align=True,
)
"""What an environment remembers besides the plant."""

NOISE = np.dtype(
    [("shaft_speed", np.float64), ("shaft_torque", np.float64), ("pitch_ratio", np.float64),
     ("shaft_acceleration", np.float64), ("ship_speed", np.float64)]
)  # fmt: skip
"""Rms noise of each instrument per sample [rad/s, N m, -, rad/s2, m/s]."""

TRUTH = (
    "advance_velocity",  # [m/s]
    "thrust",  # of one propeller [N]
    "fuel_flow",  # of all engines [kg/s]
    "ventilation",  # [-]
    "ship_speed",  # [m/s]
    "shaft_speed",  # [rad/s]
    "shaft_torque",  # at the gauge [N m]
    "brake_torque",  # of one engine [N m]
    "position",  # along the track [m]
)
"""What ``info`` tells of the truth."""

N_OBSERVED, N_TERMS, N_TRUTH = len(OBSERVED), len(TERMS), len(TRUTH)

MEAN_S = 20.0  # over which a torque's mean is taken

OVERSPEED_TRIP = 1.15  # of the engine's highest speed
STALL = 0.3  # of its lowest

RUNNING, STALLED, TRIPPED = 0, 1, 2
"""Why an episode ended."""


@compiled
def speed_order(episode: Record, time: float) -> float:
    """Ordered ship speed [m/s] at a time since reset [s]."""
    index = min(int(time / episode.order_interval), MAX_ORDERS - 1)
    return float(episode.orders[index])


@compiled
def disturbance(episode: Record, time: float) -> Disturbance:
    """Disturbance at a time since reset [s]: resistance with the episode's mean and a slow swing."""
    angle = episode.resistance_frequency * time + episode.resistance_phase
    factor = episode.resistance_mean + episode.resistance_swing * math.sin(angle)
    return Disturbance(0.0, 0.0, factor)


@compiled
def _measure(
    memory: Record,
    observer: Record,
    estimate: Record,
    episode: Record,
    noise: Record,
    shaft_speed: float,
    acceleration: float,
    advance_velocity: float,
    speed_log: float,
    row: NDArray[np.float32],
    order: float,
) -> None:
    """Read the noisy instruments, let the observer follow, and fill an observation."""
    speed = shaft_speed + noise.shaft_speed * normal(episode)
    torque = memory.shaft_torque + noise.shaft_torque * normal(episode)
    pitch = memory.pitch_ratio + noise.pitch_ratio * normal(episode)
    acceleration += noise.shaft_acceleration * normal(episode)
    reading = Measurement(speed, torque, pitch, acceleration, advance_velocity)
    episode.measured_shaft_speed = speed
    velocity = update(observer, estimate, reading)
    row[0] = order
    row[1] = speed
    row[2] = torque
    row[3] = pitch
    row[4] = memory.rack
    row[5] = speed_log + noise.ship_speed * normal(episode)
    row[6] = velocity
    row[7] = estimate.valid


@compiled
def first_observation(
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    observers: Any,
    estimates: Any,
    episodes: Any,
    noise: Record,
    dt: float,
    which: NDArray[np.int64],
    observation: NDArray[np.float32],
) -> None:
    """Observations of environments that were just reset; rows of ``observation`` by ``which``."""
    for i in which:
        outputs = observe(
            plants[i], states[i], memories[i], seas[i], episodes[i].pitch_command,
            disturbance(episodes[i], 0.0), dt,
        )  # fmt: skip
        episodes[i].gauge_torque = episodes[i].mean_torque = outputs.shaft_torque
        _measure(
            memories[i], observers[i], estimates[i], episodes[i], noise,
            states[i].shaft_speed, outputs.shaft_acceleration, outputs.advance_velocity,
            memories[i].speed_log, observation[i], speed_order(episodes[i], 0.0),
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
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    observers: Any,
    estimates: Any,
    episodes: Any,
    noise: Record,
    weights: NDArray[np.float64],
    gains: NDArray[np.float64],
    action: NDArray[np.float32],
    steps: int,
    dt: float,
    first: int,
    last: int,
    observation: NDArray[np.float32],
    terms: NDArray[np.float64],
    reward: NDArray[np.float64],
    truth: NDArray[np.float64],
    ended: NDArray[np.int64],
) -> None:
    """Carry environments ``first`` to ``last`` over one control interval; all changes in place.

    Args:
        plants: PLANT array of shape (n,); likewise the next six of their dtypes.
        states: STATE.
        memories: MEMORY.
        seas: SEA.
        observers: OBSERVER.
        estimates: ESTIMATE.
        episodes: EPISODE.
        noise: NOISE record.
        weights: of the reward terms, shape (10,).
        gains: of the governor: shaft speed, k_p, k_i by row, shape (3, m); shape (3, 0) leaves the
            rack to the action.
        action: in [-1, 1], shape (n, 2), over the ship's ranges: pitch command, and fuel rack command
            or, where there is a governor, shaft speed set-point.
        steps: plant steps in the interval.
        dt: plant step [s].
        first: first environment.
        last: one past the last.
        observation: shape (n, 8), filled.
        terms: reward terms in physical units, mean over the interval, shape (n, 10), filled.
        reward: minus the weighted sum of the terms, shape (n,), filled.
        truth: the quantities of :data:`TRUTH` at the interval's last step, shape (n, 9), filled.
        ended: RUNNING, STALLED or TRIPPED, shape (n,), filled.
    """
    for i in range(first, last):
        plant, state, memory, episode = plants[i], states[i], memories[i], episodes[i]
        pitch = plant.pitch_ratio_min + 0.5 * (action[i, 0] + 1.0) * (
            plant.pitch_ratio_max - plant.pitch_ratio_min
        )
        governed = gains.shape[1] > 0
        share = 0.5 * (action[i, 1] + 1.0)
        drive = plant.drive_min + share * (plant.drive_max - plant.drive_min)
        lowest = plant.engine_speed_min / plant.gear_ratio
        set_point = lowest + share * (plant.engine_speed_max / plant.gear_ratio - lowest)
        total = terms[i]
        total[:] = 0.0
        episode.pitch_command = pitch
        ended[i] = RUNNING
        for k in range(steps):
            time = (episode.elapsed * steps + k) * dt
            order = speed_order(episode, time)
            if governed:
                proportional, integral_gain = _gains_at(gains, episode.measured_shaft_speed)
                drive, episode.integral = govern(
                    plant, set_point, episode.measured_shaft_speed, episode.integral, proportional,
                    integral_gain,
                )  # fmt: skip
            total[4] += abs(drive - episode.drive)
            episode.drive = drive
            shaft_speed, log = state.shaft_speed, memory.speed_log
            ship_speed = state.ship_speed
            outputs = step(
                plant, state, memory, seas[i], drive, pitch, disturbance(episode, time),
                disturbance(episode, time + 0.5 * dt), disturbance(episode, time + dt), dt,
            )  # fmt: skip
            engine_speed = plant.gear_ratio * shaft_speed
            fuel = plant.propellers * fuel_rate(plant, engine_speed, outputs.brake_torque)
            limit = torque_limit(plant, engine_speed)
            asked = rack_torque(plant, engine_speed, memory.rack)
            burrill = burrill_ratio(
                plant, outputs.thrust, outputs.advance_velocity, shaft_speed, outputs.pitch_ratio,
                outputs.submergence,
            )  # fmt: skip
            part = 1.0 / steps
            total[0] += part * abs(ship_speed - order)
            total[1] += part * fuel
            total[2] += part * max(asked / limit - 1.0, 0.0)
            rate = abs(outputs.shaft_torque - episode.gauge_torque) / dt
            total[3] += part * rate * 1e-3
            total[5] += part * max(burrill - 1.0, 0.0)
            total[6] += part * max(engine_speed / plant.engine_speed_max - 1.0, 0.0)
            total[7] += part * (ship_speed - order) ** 2
            episode.gauge_torque = outputs.shaft_torque
            episode.mean_torque += dt / MEAN_S * (outputs.shaft_torque - episode.mean_torque)
            total[8] += part * 1e-3 * abs(outputs.shaft_torque - episode.mean_torque)
            truth[i, 0] = outputs.advance_velocity
            truth[i, 1] = outputs.thrust
            truth[i, 2] = fuel
            truth[i, 3] = state.ventilation
            truth[i, 4] = ship_speed
            truth[i, 5] = shaft_speed
            truth[i, 6] = outputs.shaft_torque
            truth[i, 7] = outputs.brake_torque
            truth[i, 8] = state.position
            _measure(
                memory, observers[i], estimates[i], episode, noise, shaft_speed,
                outputs.shaft_acceleration, outputs.advance_velocity, log, observation[i], order,
            )  # fmt: skip
        engine_speed = plant.gear_ratio * state.shaft_speed
        if not engine_speed > STALL * plant.engine_speed_min:
            ended[i] = STALLED
        if engine_speed > OVERSPEED_TRIP * plant.engine_speed_max:
            ended[i] = TRIPPED
        total[9] = 0.0 if ended[i] == RUNNING else 1.0
        reward[i] = 0.0
        for k in range(len(weights)):
            reward[i] -= weights[k] * total[k]
        episode.elapsed += 1
