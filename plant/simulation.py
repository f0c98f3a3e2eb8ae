"""Simulation of a ship over time: commands and disturbances in, a sample for each time step out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.files import check_size
from ..core.lanes import LANES
from .emissions import co2_rate, nox_rate
from .expressions import external_at
from .memory import MEMORY
from .record import PLANT
from .rudder import rudder_angle
from .ship import Ship, refuse_sea
from .signals import SAMPLE
from .state import STATE, Outputs, State, get_state
from .stepping import Disturbance, StepInputs, observe, prepare, refuse_divergence, step
from .together import GROUP, begin_lane, complete_lane, gather, respond
from .validity import warn_of_departures
from .waves import calm_sea


@compiled
def write_sample(
    plant: Record,
    sample: Record,
    time: float,
    acting: StepInputs,
    state: State,
    memory: Record,
    speed_log: float,
    outputs: Outputs,
) -> None:
    """Fill a SAMPLE record: the commands over a step, and the state and outputs at its start."""
    sample.time = time
    sample.drive = acting.drive
    sample.pitch_command = acting.pitch_command
    sample.rudder_command = acting.rudder_command
    sample.pitch_ratio = outputs.pitch_ratio
    sample.shaft_speed = state.shaft_speed
    sample.shaft_torque = outputs.shaft_torque
    sample.ship_speed = state.ship_speed
    sample.measured_shaft_speed = memory.shaft_speed
    sample.measured_pitch_ratio = memory.pitch_ratio
    sample.measured_shaft_torque = memory.shaft_torque
    sample.measured_ship_speed = speed_log
    sample.measured_thrust = memory.thrust
    sample.measured_motor_current = memory.motor_current
    sample.shaft_acceleration = outputs.shaft_acceleration
    sample.advance_velocity = outputs.advance_velocity
    sample.thrust = outputs.thrust
    sample.propeller_torque = outputs.propeller_torque
    sample.brake_torque = outputs.brake_torque
    sample.resistance = outputs.resistance
    sample.motor_current = outputs.motor_current
    sample.shaft_power = memory.shaft_torque * memory.shaft_speed
    sample.electric_power = memory.electric_power
    sample.submergence = outputs.submergence
    sample.ventilation = state.ventilation
    sample.position = state.position
    sample.shaft_angle = state.shaft_angle
    sample.sway_speed = state.sway_speed
    sample.yaw_rate = state.yaw_rate
    sample.heading = state.heading
    sample.cross_track = state.cross_track
    sample.roll_angle = state.roll_angle
    sample.roll_rate = state.roll_rate
    sample.rudder_angle = rudder_angle(plant, state.rudder_angle, acting.rudder_command)
    engine_speed = plant.gear_ratio * state.shaft_speed
    sample.nox = plant.propellers * nox_rate(plant, engine_speed, outputs.brake_torque)
    sample.co2 = plant.propellers * co2_rate(plant, engine_speed, outputs.brake_torque)


Floats: TypeAlias = NDArray[np.float64]

Commands: TypeAlias = tuple[Floats, Floats, Floats]
"""Drive [mm | V | N m | rad/s], P/D [-] and rudder angle [rad] of each step, shape (n,)."""

Surroundings: TypeAlias = tuple[Floats, Floats, Floats, Floats]
"""u_x [m/s], elevation of the surface above the propeller [m] and d_c1 [-] at starts and middles of the
steps and at the last end, shape (2 n + 1,); then the external signals, shape (2 n + 1, MAX_SIGNALS), or
(1, MAX_SIGNALS) if they are constant."""


@compiled
def _disturbance(around: Surroundings, k: int) -> Disturbance:
    """Return the disturbance at a half step."""
    inflow, elevation, resistance_factor, signals = around
    return Disturbance(inflow[k], elevation[k], resistance_factor[k], external_at(signals, k))


@compiled
def _acting(commands: Commands, around: Surroundings, k: int) -> StepInputs:
    """Return what acts during a step."""
    drive, pitch_command, rudder_command = commands
    return StepInputs(
        drive[k],
        pitch_command[k],
        rudder_command[k],
        _disturbance(around, 2 * k),
        _disturbance(around, 2 * k + 1),
        _disturbance(around, 2 * k + 2),
    )


@compiled
def _sample_at_end(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    sample: Record,
    time: float,
    acting: StepInputs,
    dt: float,
) -> None:
    """Fill a SAMPLE record with the commands of the last step and the state and outputs at its end."""
    commands = acting.pitch_command, acting.rudder_command
    outputs = observe(plant, state, memory, sea, *commands, acting.end, dt)
    log = memory.speed_log
    write_sample(plant, sample, time, acting, get_state(state), memory, log, outputs)


@compiled
def trajectory(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    commands: Commands,
    around: Surroundings,
    dt: float,
    every: int,
    sample: Any,
    values: NDArray[np.float64],
    columns: NDArray[np.int64],
    kept: NDArray[np.float64],
) -> None:
    """Simulate one ship record: :func:`simulate_record` in memory of the caller.

    STATE, MEMORY and SEA records are changed in place; the state holds the initial and afterwards the
    final state. Steps have a length of ``dt`` [s].

    Each sample is written to ``sample``, a SAMPLE array of shape (1,). ``values``, shape (signals,), is
    the same memory, of which ``columns`` are kept every few steps: shape (n // every + 1, columns).
    """
    drive, steps = commands[0], len(commands[0])
    prepare(plant, state, memory, sea, drive[0], _disturbance(around, 0), dt)
    for k in range(steps):
        now, log = get_state(state), memory.speed_log
        acting = _acting(commands, around, k)
        outputs = step(plant, state, memory, sea, acting, dt)
        if k % every:
            continue
        write_sample(plant, sample[0], k * dt, acting, now, memory, log, outputs)
        for j, column in enumerate(columns):
            kept[k // every, j] = values[column]
    if steps % every:
        return
    last = _acting(commands, around, steps - 1)
    _sample_at_end(plant, state, memory, sea, sample[0], steps * dt, last, dt)
    for j, column in enumerate(columns):
        kept[steps // every, j] = values[column]


@compiled
def trajectories(
    plants: Any,
    states: Any,
    memories: Any,
    sea: Record,
    group: Record,
    commands: Commands,
    inflow: Floats,
    beside: tuple[Floats, Floats, Floats],
    dt: float,
    every: int,
    sample: Any,
    values: NDArray[np.float64],
    columns: NDArray[np.int64],
    kept: NDArray[np.float64],
) -> None:
    """Simulate a group of ship records in calm water: :func:`trajectory` for each of them.

    PLANT, STATE and MEMORY arrays have shape (ships,), and ``kept`` has shape (ships, columns,
    n // every + 1). u_x has shape (ships, 2 n + 1), or one row that is equal for all; ``beside`` are the
    other surroundings. ``group`` is a GROUP record, working memory.
    """
    drive, steps, ships = commands[0], len(commands[0]), len(plants)
    own = 1 if len(inflow) > 1 else 0  # step from the row of one ship to that of the next
    for i in range(ships):
        begin = _disturbance((inflow[own * i], *beside), 0)
        prepare(plants[i], states[i], memories[i], sea, drive[0], begin, dt)
    gather(group, plants, states, 0, ships)
    for k in range(steps):
        for i in range(ships):
            acting = _acting(commands, (inflow[own * i], *beside), k)
            begin_lane(group, i, plants[i], states[i], memories[i], sea, acting, dt)
        respond(group, plants, dt)
        for i in range(ships):
            now, log = get_state(states[i]), memories[i].speed_log
            acting = _acting(commands, (inflow[own * i], *beside), k)
            outputs = complete_lane(group, i, plants[i], states[i], memories[i], sea, acting, dt)
            if k % every:
                continue
            write_sample(plants[i], sample[0], k * dt, acting, now, memories[i], log, outputs)
            for j, column in enumerate(columns):
                kept[i, j, k // every] = values[column]
    if steps % every:
        return
    for i in range(ships):
        last = _acting(commands, (inflow[own * i], *beside), steps - 1)
        ship = plants[i], states[i], memories[i], sea
        _sample_at_end(*ship, sample[0], steps * dt, last, dt)
        for j, column in enumerate(columns):
            kept[i, j, steps // every] = values[column]


ALL_SIGNALS: tuple[str, ...] = SAMPLE.names or ()


def simulate_record(
    plant: Any,
    state: Any,
    sea: Any,
    commands: Commands,
    surroundings: Surroundings,
    dt: float,
    every: int = 1,
    signals: Sequence[str] = ALL_SIGNALS,
) -> NDArray[np.float64]:
    """Simulate one ship record and keep some signals: :func:`simulate` without its checks.

    Args:
        plant: ship record.
        state: STATE record; the initial state, and afterwards the final one.
        sea: SEA record, changed in place; None for calm water.
        commands: as in :data:`Commands`.
        surroundings: as in :data:`Surroundings`.
        dt: time step [s].
        every: number of steps from one kept sample to the next.
        signals: names of the kept signals.

    Returns:
        Shape (n // every + 1, signals).
    """
    memory, waves = np.zeros(1, MEMORY)[0], calm_sea() if sea is None else sea
    kept = np.empty((len(commands[0]) // every + 1, len(signals)))
    sample = _sample_for(signals)
    trajectory(plant, state, memory, waves, commands, surroundings, dt, every, *sample, kept)
    return kept


def simulate_records(
    ships: Sequence[tuple[Any, Any, Floats]],
    commands: Commands,
    surroundings: tuple[Floats, Floats, Floats],
    dt: float,
    every: int = 1,
    signals: Sequence[str] = ALL_SIGNALS,
) -> list[NDArray[np.float64]]:
    """Simulate several ship records with the same commands in calm water, and keep some signals.

    The records of a group of :func:`alike_groups` are simulated at once, others one after the other. The
    result for each ship is that of :func:`simulate_record`, equal to the bit.

    Args:
        ships: of each ship its record, the STATE record of its initial state, and u_x [m/s] as for one
            ship.
        commands: as for one ship.
        surroundings: as for one ship, but without u_x.
        dt: time step [s].
        every: number of steps from one kept sample to the next.
        signals: names of the kept signals.

    Returns:
        For each ship, shape (n // every + 1, signals).
    """
    results: dict[int, NDArray[np.float64]] = {}
    for group in alike_groups([plant for plant, _, _ in ships]):
        if len(group) == 1:
            (i,) = group
            plant, state, inflow = ships[i]
            around = inflow, *surroundings
            results[i] = simulate_record(
                plant, state.copy(), None, commands, around, dt, every, signals
            )
            continue
        plants, states, rows = np.empty(LANES, PLANT), np.empty(LANES, STATE), []
        for lane in range(LANES):
            plants[lane], states[lane], inflow = ships[group[min(lane, len(group) - 1)]]
            rows.append(inflow)
        kept = np.empty((LANES, len(signals), len(commands[0]) // every + 1))
        trajectories(
            plants,
            states,
            np.zeros(LANES, MEMORY),
            calm_sea(),
            np.zeros(1, GROUP)[0],
            commands,
            rows[0][None] if all(row is rows[0] for row in rows) else np.array(rows),
            surroundings,
            dt,
            every,
            *_sample_for(signals),
            kept,
        )
        results |= zip(group, kept.transpose(0, 2, 1), strict=False)
    return [results[i] for i in range(len(ships))]


def _sample_for(signals: Sequence[str]) -> tuple[Any, Floats, NDArray[np.int64]]:
    """Return a sample, the same memory as numbers, and the columns of some signals there."""
    sample = np.zeros(1, SAMPLE)
    columns = np.array([ALL_SIGNALS.index(name) for name in signals], dtype=np.int64)
    return sample, sample.view(np.float64), columns


_WORDS = {
    kind: [offset // 8 for of, offset, *_ in (PLANT.fields or {}).values() if of == kind]
    for kind in (np.float64, np.int64)
}
"""Places of the single parameters and of the switches in a ship record, in words."""

LEAST_TOGETHER = 3
"""Number of ships from which a group takes less time at once than one after the other."""


def alike_groups(plants: Sequence[Any]) -> list[list[int]]:
    """Divide ship records into groups that can be simulated at once, by their indices.

    The records of a group have equal switches, and parameters of equal signs, so that they seldom
    disagree on a branch. Groups of :data:`LEAST_TOGETHER` to ``LANES`` ships are in the order of their
    first ships. Any other ship is a group of its own.
    """
    if len(plants) == 1:
        return [[0]]
    kinds: dict[Any, list[int]] = {}
    for i, plant in enumerate(plants):
        words = np.frombuffer(plant.tobytes(), np.float64)
        alone = plant["turns"] or plant["rolls"] or plant["term_count"]
        signs = np.sign(words[_WORDS[np.float64]]).tobytes()
        switches = words.view(np.int64)[_WORDS[np.int64]].tobytes()
        kinds.setdefault(i if alone else (signs, switches), []).append(i)
    groups = []
    for alike in kinds.values():
        for first in range(0, len(alike), LANES):
            group = alike[first : first + LANES]
            groups += [group] if len(group) >= LEAST_TOGETHER else [[i] for i in group]
    return sorted(groups)


@dataclass(frozen=True)
class Schedule:
    """Commands and disturbances over time: constants, arrays or functions of time.

    Commands are constant over each step; disturbances are continuous.

    Args:
        drive: fuel rack [mm], voltage [V], torque [N m] or held speed [rad/s].
        pitch_command: P/D [-].
        inflow: disturbance u_x of the advance velocity, in addition to the sea [m/s].
        resistance_factor: d_c1 [-].
        elevation: elevation of the surface above the propeller, in addition to the sea [m].
        signals: external signals of the ship's terms by name, in the units of the ship file.
        rudder_command: angle [rad]; a positive angle turns to starboard.

    >>> import numpy as np
    >>> from shaftline.plant import Schedule
    >>> schedule = Schedule(drive=lambda t: np.where(t < 60.0, 20.0, 24.0), pitch_command=1.2)
    >>> schedule.drive(np.array([0.0, 90.0])).tolist()  # fuel rack [mm]
    [20.0, 24.0]
    """

    drive: Any
    pitch_command: Any
    inflow: Any = 0.0
    resistance_factor: Any = 1.0
    elevation: Any = 0.0
    signals: Mapping[str, Any] = field(default_factory=dict)
    rudder_command: Any = 0.0


def _values_at(value: Any, times: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    try:
        array = np.asarray(value(times) if callable(value) else value, dtype=np.float64)
        array = np.broadcast_to(array, times.shape)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name}: must be a number, an array of shape {times.shape}, or a function that takes an "
            f"array of times and returns as many values ({error}). In a function, write "
            "np.where(t < 60.0, a, b) instead of 'a if t < 60.0 else b'"
        ) from None
    if not np.all(np.isfinite(array)):
        check = "check it for NaN or infinity"
        raise ValueError(f"{name} contains a value that is not finite; {check}")
    # Copy the array: Numba would compile the kernel again for read-only arrays.
    return np.array(array, order="C")


def simulate(
    ship: Ship,
    schedule: Schedule,
    duration_s: float,
    *,
    initial: State,
    sea: Any = None,
    dt: float | None = None,
) -> NDArray[Any]:
    """Simulate one ship and keep all samples.

    Args:
        ship: the ship.
        schedule: commands and disturbances. The drive has been at its first command for ever, so a rate
            limit or dead time acts only on changes after time 0.
        duration_s: duration [s].
        initial: initial state, for example from :func:`shaftline.plant.equilibrium`.
        sea: SEA record from :func:`shaftline.plant.waves.realise`, or None for calm water.
        dt: time step [s]; by default that of the ship.

    Returns:
        SAMPLE array of shape (steps + 1,): one sample at the start of each step, with the commands of
        that step, and one at the end.

    Warns:
        ValidityWarning: the simulation has left the range of validity of a model; one line for each.

    Raises:
        ShipError: a delay or the motor of the ship does not suit the time step, or a term uses a signal
            that the schedule does not have.
        ValueError: an input is not finite, the duration is not positive, there are waves in a gas, or
            the simulation diverges.

    >>> from shaftline.plant import Schedule, equilibrium, load_ship, simulate
    >>> ship = load_ship("frigate")
    >>> start = equilibrium(ship, drive=20.0, pitch_ratio=1.2)
    >>> samples = simulate(ship, Schedule(drive=24.0, pitch_command=1.2), 5.0, initial=start.state)
    >>> samples["shaft_speed"][[0, -1]].round(2).tolist()  # [rad/s]
    [11.49, 12.18]
    """
    refuse_sea(ship, sea)
    if dt is not None and dt != ship.time_step_s:
        ship = ship.with_values({"integration.time_step_s": dt})
    dt = ship.time_step_s
    if not duration_s > 0.0:
        raise ValueError(f"duration_s = {duration_s} must be above 0 s")
    steps = max(1, math.ceil(duration_s / dt - 1e-9))
    check_size(steps, SAMPLE.itemsize + 40.0, f"time steps of {dt:g} s in {duration_s:g} s")
    grid = np.arange(steps, dtype=np.float64) * dt
    half_grid = np.arange(2 * steps + 1, dtype=np.float64) * (0.5 * dt)
    signals = {
        name: _values_at(value, half_grid, name)
        for name, value in schedule.signals.items()
        if name in ship.external_signals
    }
    state = np.zeros(1, STATE)
    state[0] = tuple(float(value) for value in initial)
    if not np.isfinite(state.tolist()).all():
        raise ValueError(f"the initial state contains a value that is not finite: {initial}")

    def over(times: Floats, *names: str) -> Any:
        return tuple(_values_at(getattr(schedule, name), times, name) for name in names)

    kept = simulate_record(
        ship.record(),
        state[0],
        None if sea is None else sea.copy(),
        over(grid, "drive", "pitch_command", "rudder_command"),
        (
            *over(half_grid, "inflow", "elevation", "resistance_factor"),
            ship.external_rows(signals),
        ),
        dt,
    )
    samples = kept.view(SAMPLE).ravel()
    refuse_divergence(ship, samples)
    warn_of_departures(ship, samples)
    return samples
