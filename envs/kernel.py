"""Simulation of one control interval of many environments in one compiled call.

The kernel simulates the plant, the sea and the noisy instruments, updates the observer, and computes the
reward terms and the termination of each environment. The single environment is a batch of one, so both
forms execute the same machine code.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.controller import decode
from ..baselines.governor import govern, limit_rack
from ..core.compiled import Record, compiled, generate_kernel
from ..core.lanes import LANES
from ..observers.records import Floats
from ..plant.cavitation import effective_attack, outside_bucket
from ..plant.rudder import rudder_angle
from ..plant.state import STATE, Outputs, State, get_state
from ..plant.stepping import Disturbance, StepInputs, observe
from ..plant.together import begin_lane, complete_lane, gather, respond
from . import sensing
from .records import LIMITED_RACK, SHAFT_SPEED
from .rewards import MEAN_S, Instant, add_terms, clear_terms, reward_of, total_fuel_flow

DRIFT_SWING = 0.5  # amplitude of the slow fluctuation of the side force, over its mean
TRAVERSE_S = 20.0  # time in which a command crosses its whole range at an increment of 1 [s]
OVERSPEED_TRIP = 1.15  # over the highest speed of the engine
STALL = 0.3  # over the lowest speed of the engine
RUNNING, STALLED, TRIPPED = 0, 1, 2
"""Codes of the state of an episode: running, engine stalled, engine tripped on overspeed."""

ENDINGS = (None, "stalled", "overspeed trip")
"""Names of the reasons by code; None while the episode runs."""


@compiled
def resistance_angle(episode: Any, time: Any) -> Any:
    """Return the phase [rad] of the slow resistance fluctuation at a time since reset [s]."""
    return episode.resistance_frequency * time + episode.resistance_phase


@compiled
def _unit_phasor(angle: float) -> complex:
    """Return the unit phasor exp(i angle) [-] of an angle [rad]."""
    return complex(math.cos(angle), math.sin(angle))


@compiled
def _disturbance_at(episode: Record, phasor: complex) -> Disturbance:
    """Return the disturbance where the slow fluctuation has a unit phasor [-]."""
    factor = episode.resistance_mean + episode.resistance_swing * phasor.imag
    drift = episode.drift_force * (1.0 + DRIFT_SWING * phasor.real)
    return Disturbance(0.0, 0.0, factor, (drift, 0.0, 0.0, 0.0, 0.0, 0.0))


@compiled
def _acting(episode: Record, cell: Record) -> StepInputs:
    """Return what acts on the ship of an environment during a plant step."""
    return StepInputs(
        cell.drive,
        episode.pitch_command,
        cell.rudder,
        _disturbance_at(episode, cell.start),
        _disturbance_at(episode, cell.middle),
        _disturbance_at(episode, cell.end),
    )


@compiled
def disturbance(episode: Record, time: float) -> Disturbance:
    """Return the disturbance of resistance and side force at a time since reset [s]."""
    return _disturbance_at(episode, _unit_phasor(resistance_angle(episode, time)))


@compiled
def first_observation(
    environments: Any, commons: Any, interval_s: float, dt: float, which: NDArray[np.int64]
) -> None:
    """Fill observations and true states of the environments ``which``, which were just reset."""
    common = commons[0]
    for i in which:
        env = environments[i]
        state, episode = env.state, env.episode
        outputs = observe(
            env.plant,
            state,
            env.memory,
            env.sea,
            episode.pitch_command,
            0.0,
            disturbance(episode, 0.0),
            dt,
        )
        attack = effective_attack(
            env.plant, outputs.advance_velocity, state.shaft_speed, outputs.pitch_ratio
        )
        outside = outside_bucket(env.plant, attack, state.shaft_speed, outputs.submergence)
        episode.mean_speed = state.ship_speed
        episode.mean_torque = outputs.shaft_torque
        episode.mean_brake_torque = outputs.brake_torque
        episode.mean_attack = attack
        fuel = total_fuel_flow(env.plant, state.shaft_speed, outputs.brake_torque)
        clear_terms(env.terms)
        sensing.fill_truth(env, get_state(state), outputs, attack, outside, fuel, 0.0)
        sensing.measure(
            env,
            common.noise,
            outputs.shaft_acceleration,
            outputs.advance_velocity,
            env.memory.speed_log,
            sensing.speed_order(episode, 0.0),
        )
        if env.plant.turns != 0:
            sensing.measure_course(env, common.noise, get_state(state), 0.0, 0.0)
        if common.preview != 0:
            sensing.fill_preview(env, common.noise, 0.0)
        sensing.fill_learner_signals(env, interval_s, True)


@compiled
def _gains_at(gains: Floats, speed: float) -> tuple[float, float]:
    """Return the governor gains k_p and k_i at a shaft speed, interpolated linearly and held outside."""
    last = gains.shape[1] - 1
    if speed <= gains[0, 0] or last == 0:
        return gains[1, 0], gains[2, 0]
    for k in range(last):
        if speed < gains[0, k + 1]:
            x = (speed - gains[0, k]) / (gains[0, k + 1] - gains[0, k])
            proportional = gains[1, k] + x * (gains[1, k + 1] - gains[1, k])
            return proportional, gains[2, k] + x * (gains[2, k + 1] - gains[2, k])
    return gains[1, last], gains[2, last]


@compiled
def _set_commands(
    env: Record, common: Record, action: NDArray[np.float32], interval_s: float
) -> float:
    """Set the commands of an environment from an action, and return the rudder command [rad]."""
    plant, episode = env.plant, env.episode
    slowest = plant.engine_speed_min / plant.gear_ratio
    fastest = plant.engine_speed_max / plant.gear_ratio
    low, high = plant.pitch_ratio_min, plant.pitch_ratio_max
    if common.increments != 0:
        pitch, second = interval_s / TRAVERSE_S * action[0], interval_s / TRAVERSE_S * action[1]
        episode.pitch_command = _shift_command(episode.pitch_command, pitch, low, high)
        if common.second == SHAFT_SPEED:
            episode.shaft_speed_command = _shift_command(
                episode.shaft_speed_command, second, slowest, fastest
            )
        else:
            episode.rack_command = _shift_command(
                episode.rack_command, second, plant.drive_min, plant.drive_max
            )
    else:
        episode.pitch_command = decode(action[0], low, high)
        episode.rack_command = decode(action[1], plant.drive_min, plant.drive_max)
        episode.shaft_speed_command = decode(action[1], slowest, fastest)
    return decode(action[2], -plant.rudder_max, plant.rudder_max) if len(action) > 2 else 0.0


@compiled
def _shift_command(command: float, share: float, low: float, high: float) -> float:
    """Return a command shifted by a share of its range and limited to the range."""
    return min(max(command + share * (high - low), low), high)


state_sum: Callable[[Any], float] = generate_kernel(
    """
def state_sum(state):
    total = 0.0
    total += state.{field}
    return total
""",
    STATE.names or (),
    globals(),
)
"""Return the sum of all states, which is finite only if every state is finite."""


CELL = np.dtype(
    [
        ("rudder", np.float64),  # command [rad]
        ("laid", np.float64),  # rudder angle at the start of the step [rad]
        ("drive", np.float64),  # command to the engine [mm]
        (
            "half_step",
            np.complex128,
        ),  # phasor by which the slow fluctuation turns in half a step [-]
        ("start", np.complex128),  # phasor of the slow fluctuation at the start of the step [-]
        ("middle", np.complex128),  # in its middle
        ("end", np.complex128),  # at its end
    ]
)
"""Numbers of an environment within a control interval."""


@compiled
def _begin_interval(
    env: Record,
    cell: Record,
    common: Record,
    action: NDArray[np.float32],
    steps: int,
    dt: float,
) -> None:
    """Begin a control interval of one environment."""
    episode = env.episode
    cell.laid = rudder_angle(env.plant, env.state.rudder_angle, episode.rudder_command)
    clear_terms(env.terms)
    cell.rudder = episode.rudder_command = _set_commands(env, common, action, steps * dt)
    cell.drive = episode.rack_command
    # The phasor is advanced by half steps; after n steps its error is below n times 1e-15.
    cell.end = _unit_phasor(resistance_angle(episode, episode.elapsed * steps * dt))
    cell.half_step = _unit_phasor(0.5 * dt * episode.resistance_frequency)


@compiled
def _before_step(env: Record, cell: Record, common: Record, gains: Floats) -> None:
    """Set the engine command of a plant step, and advance the slow fluctuation."""
    plant, episode = env.plant, env.episode
    if common.second == SHAFT_SPEED:
        proportional, integral_gain = _gains_at(gains, episode.measured_shaft_speed)
        cell.drive, episode.integral = govern(
            plant,
            episode.shaft_speed_command,
            episode.measured_shaft_speed,
            episode.integral,
            proportional,
            integral_gain,
        )
    elif common.second == LIMITED_RACK:
        cell.drive = limit_rack(
            plant, episode.rack_command, episode.measured_shaft_speed, common.limiter_slope
        )
    cell.start = cell.end
    cell.middle = cell.start * cell.half_step
    cell.end = cell.start * cell.half_step * cell.half_step


@compiled
def _after_step(
    env: Record,
    cell: Record,
    common: Record,
    before: State,
    pitch_before: float,
    log: float,
    outputs: Outputs,
    time: float,
    share: float,
    dt: float,
) -> None:
    """Add the reward terms of a plant step, and measure.

    Args:
        env: ENVIRONMENT record after the step.
        cell: CELL record.
        common: COMMON record.
        before: state at the start of the step.
        pitch_before: P/D of the blades in the step before [-].
        log: measurement of the speed log at the start of the step [m/s].
        outputs: outputs at the start of the step.
        time: start of the step, since reset [s].
        share: share of the step in the interval [-].
        dt: time step [s].
    """
    plant, memory, episode = env.plant, env.memory, env.episode
    shaft_speed = before.shaft_speed
    which = sensing.order_index(episode, time)
    order = float(episode.orders[which])
    laid_before = cell.laid
    cell.laid = rudder_angle(plant, env.state.rudder_angle, cell.rudder)
    attack = effective_attack(plant, outputs.advance_velocity, shaft_speed, outputs.pitch_ratio)
    outside = outside_bucket(plant, attack, shaft_speed, outputs.submergence)
    fading = dt / MEAN_S
    episode.mean_speed += fading * (before.ship_speed - episode.mean_speed)
    episode.mean_torque += fading * (outputs.shaft_torque - episode.mean_torque)
    episode.mean_brake_torque += fading * (outputs.brake_torque - episode.mean_brake_torque)
    episode.mean_attack += fading * (attack - episode.mean_attack)
    fuel = total_fuel_flow(plant, shaft_speed, outputs.brake_torque)
    now = Instant(
        order=order,
        ship_speed=before.ship_speed,
        shaft_speed=shaft_speed,
        rack=memory.rack,
        drive=cell.drive,
        drive_before=episode.drive,
        mean_torque=episode.mean_torque,
        mean_brake_torque=episode.mean_brake_torque,
        attack=attack,
        mean_attack=episode.mean_attack,
        outside_bucket=outside,
        pitch_before=pitch_before,
        mean_speed=episode.mean_speed,
        reference_fuel=episode.reference_fuel[which],
        reference_power=episode.reference_power[which],
        heading_error=sensing.wrap_angle(before.heading - episode.heading_orders[which]),
        track_error=before.cross_track - episode.track_orders[which],
        rudder_turn=cell.laid - laid_before,
        dt=dt,
    )
    add_terms(env.terms, plant, outputs, now, share, fuel)
    episode.drive = cell.drive
    sensing.fill_truth(env, before, outputs, attack, outside, fuel, laid_before)
    sensing.measure(
        env, common.noise, outputs.shaft_acceleration, outputs.advance_velocity, log, order
    )
    if plant.turns != 0:
        sensing.measure_course(env, common.noise, before, laid_before, time)


@compiled
def _end_interval(env: Record, common: Record, interval_s: float) -> None:
    """Compute the reward of a control interval, and whether the episode ends."""
    episode = env.episode
    if common.preview != 0:
        sensing.fill_preview(env, common.noise, (episode.elapsed + 1) * interval_s)
    sensing.fill_learner_signals(env, interval_s, False)
    env.ended = _why_ended(env.plant, env.state.shaft_speed)
    env.reward = reward_of(common.goals, env.terms) if env.ended == RUNNING else 0.0
    episode.elapsed += 1


@compiled
def control_interval(
    environments: Any,
    plants: Any,
    states: Any,
    commons: Any,
    group: Record,
    gains: Floats,
    action: NDArray[np.float32],
    steps: int,
    dt: float,
    first: int,
    last: int,
) -> int:
    """Simulate environments ``first`` to ``last`` over one control interval; all changes in place.

    Returns the index of the first environment whose state is not finite at the end, or -1.

    Args:
        environments: ENVIRONMENT array of shape (n,).
        plants: their PLANT records, in the same memory.
        states: their STATE records, in the same memory.
        commons: COMMON array of shape (1,).
        group: GROUP record, working memory that no other thread uses.
        gains: governor gains with the rows shaft speed, k_p and k_i, shape (3, m).
        action: actions in [-1, 1], shape (n, 2) or (n, 3): pitch, drive (fuel rack or shaft speed
            set-point, see COMMON) and rudder, each over its range on the ship. Where actions are
            increments, the first two are rates of change: at 1 a command crosses its range in
            :data:`TRAVERSE_S`. Without a third value the rudder command is zero.
        steps: number of plant steps in the interval.
        dt: plant step [s].
        first: first environment.
        last: one past the last environment.
    """
    common, cells = commons[0], np.zeros(LANES, CELL)
    diverged = -1
    for begin in range(first, last, LANES):
        count = gather(group, plants, states, begin, last)
        for lane in range(count):
            i = begin + lane
            _begin_interval(environments[i], cells[lane], common, action[i], steps, dt)
        for k in range(steps):
            for lane in range(count):
                env, cell = environments[begin + lane], cells[lane]
                _before_step(env, cell, common, gains)
                acting = _acting(env.episode, cell)
                begin_lane(group, lane, env.plant, env.state, env.memory, env.sea, acting, dt)
            respond(group, plants, dt)
            for lane in range(count):
                env, cell = environments[begin + lane], cells[lane]
                before, log = get_state(env.state), env.memory.speed_log
                pitch_before = env.memory.blade_pitch
                acting = _acting(env.episode, cell)
                outputs = complete_lane(
                    group, lane, env.plant, env.state, env.memory, env.sea, acting, dt
                )
                time = (env.episode.elapsed * steps + k) * dt
                _after_step(
                    env, cell, common, before, pitch_before, log, outputs, time, 1.0 / steps, dt
                )
        for lane in range(count):
            env = environments[begin + lane]
            _end_interval(env, common, steps * dt)
            if diverged < 0 and not math.isfinite(state_sum(env.state)):
                diverged = begin + lane
    return diverged


@compiled
def _why_ended(plant: Record, shaft_speed: float) -> int:
    """Return RUNNING, or the code of the reason why the episode ends."""
    engine_speed = plant.gear_ratio * shaft_speed
    if engine_speed > OVERSPEED_TRIP * plant.engine_speed_max:
        return TRIPPED
    if not engine_speed > STALL * plant.engine_speed_min:
        return STALLED
    return RUNNING
