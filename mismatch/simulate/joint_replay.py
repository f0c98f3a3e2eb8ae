"""Replay recordings of one ship together with the recorded commands, by its model or linearised.

The regressor of an effect is a change of the simulation with the recorded commands, which have no
instrument noise. Regressors from measured signals would share their noise with the residual and bias the
estimates, for example towards an added inertia (errors in variables).

The linear model (Vrijdag & Martelli 2021, eq. 9) is

    x' = f(x0, u0) + A (x - x0) + B (u - u0),    y = y0 + C (x - x0) + D (u - u0)

about the mean of the measured channels, which need not be a steady state. Its inputs are drive command,
pitch command and inflow. Delays and errors of instruments and the water surface are left out.
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeAlias, TypeVar

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...core.compiled import compiled
from ...plant.columns import HEADING, MEASURED, SHAFT_ANGLE
from ...plant.dynamics import settle_lags
from ...plant.equilibria import SteadyReplay
from ...plant.linear import tangent
from ...plant.replay import Replay
from ...plant.ship import Ship
from ...plant.signals import SAMPLE
from ...plant.state import Inputs, State, active_states
from ..recordings.excitation import load_varies, varies
from ..recordings.noise import estimate_noise, row_noise

Floats: TypeAlias = NDArray[np.float64]
T = TypeVar("T")
R = TypeVar("R")
THREADS = min(8, os.cpu_count() or 1)

START_STEPS = 40
"""Number of time steps of the ship over which the first state is averaged."""

SEPARATE_STEPS = 12
"""Number of the largest command steps whose unknown times between two rows are treated separately."""

NO_SHIFT = (0.0, 0.0, 0.0)
"""Zero shift of the first state."""

RESOLUTION = 1e-5
"""Finest resolution of a channel, as a share of its largest value, or of the largest step of an angle. A
simulated channel without noise would otherwise have unlimited weight."""


class JointReplay:
    """One or more recordings of a ship, each simulated from its own first row and concatenated.

    Args:
        ship: the nominal ship.
        tables: canonical columns at an even interval, all finite; equal columns and intervals.
        line: whether commands are interpolated linearly between rows; else they are held.
        every: number of rows that are averaged into one, of measured and simulated channels; the
            simulation still uses every row. Incomplete groups at the end of a recording are dropped.
        steady: whether each row is an equilibrium at the inputs of that row.
        start_over_s: duration over which the first state is averaged [s]; :data:`START_STEPS` time
            steps of the ship by default.

    Raises:
        ValueError: the recordings have different columns or intervals.
    """

    def __init__(
        self,
        ship: Ship,
        *tables: pd.DataFrame,
        line: bool = False,
        every: int = 1,
        steady: bool = False,
        start_over_s: float | None = None,
    ) -> None:
        self.ship = ship
        self.line, self.every, self.steady = line, every, steady
        self.start_over_s = START_STEPS * ship.time_step_s if start_over_s is None else start_over_s
        self.runs = [
            SteadyReplay(ship, table) if steady else Replay(ship, table, self.start_over_s, line)
            for table in tables
        ]
        first = self.runs[0]
        self.interval_s, self.channels = first.interval_s * every, first.channels
        self.controllable = ship.has_variable_pitch
        for number, run in enumerate(self.runs[1:], 2):
            if run.channels != self.channels or abs(run.interval_s / first.interval_s - 1.0) > 0.01:
                raise ValueError(
                    f"recording {number} has other columns or another interval than the first: "
                    f"{', '.join(run.channels)} every {run.interval_s:g} s, not "
                    f"{', '.join(self.channels)} every {first.interval_s:g} s"
                )
        ends = np.cumsum([run.rows // every for run in self.runs]).tolist()
        self.segments = list(itertools.pairwise([0, *ends]))
        self.rows: int = ends[-1]
        self.time_s = np.arange(self.rows, dtype=np.float64) * self.interval_s
        self.start = first.start
        self.drive_rows, self.command, self.rudder_rows, self.elevation_rows = (
            self._averaged([getattr(run, name) for run in self.runs])
            for name in ("drive_rows", "command", "rudder_rows", "elevation_rows")
        )
        self.inflow_rows = self._averaged([run.inflow_rows(ship.record()) for run in self.runs])
        self.excited = any(
            varies(run.drive_rows) or varies(run.command) or load_varies(ship, run.table)
            for run in self.runs
        )
        known = [n for n in sorted(ship.signals) if all(n in run.table for run in self.runs)]
        self.outside = {name: self._column(name) for name in known}

    def with_ship(self, ship: Ship, *tables: pd.DataFrame) -> JointReplay:
        """Return a replay by another ship, of the same recordings or of other tables."""
        own = tables or [run.table for run in self.runs]
        return JointReplay(
            ship,
            *own,
            line=self.line,
            every=self.every,
            steady=self.steady,
            start_over_s=self.start_over_s,
        )

    @property
    def rate_interval_s(self) -> float:
        """Interval for time derivatives [s]; infinite between equilibria."""
        return math.inf if self.steady else self.interval_s

    def _averaged(self, parts: list[Floats]) -> Floats:
        """Average a signal of each run, (rows,) or (rows, signals), and concatenate the results."""
        return _joined([blocks(part, self.every) for part in parts])

    def _column(self, name: str) -> Floats:
        """Return a column of all recordings, averaged."""
        return self._averaged([run.table[name].to_numpy(dtype=np.float64) for run in self.runs])

    def simulate(self, plant: Any, shift: tuple[float, ...] = NO_SHIFT) -> Any:
        """Simulate all recordings with a ship record; return a SAMPLE array of shape (rows,).

        Args:
            plant: ship record.
            shift: shift of the first pitch ratio [-], shaft speed [rad/s] and ship speed [m/s], and for
                a ship that turns of sway speed [m/s], yaw rate [rad/s] and heading [rad].
        """
        parts = [self.simulate_run(run, plant, _shifted(run, shift)) for run in self.runs]
        if self.every == 1:
            return parts[0] if len(parts) == 1 else np.concatenate(parts)
        width = len(SAMPLE.names or ())
        plain = self._averaged([part.view(np.float64).reshape(-1, width) for part in parts])
        return np.ascontiguousarray(plain).view(SAMPLE).ravel()

    def simulate_signals(self, plant: Any, signals: Sequence[str]) -> dict[str, Floats]:
        """Simulate all recordings and return some signals by name, each of shape (rows,).

        The values are those of :meth:`simulate`, without the memory for the other signals.
        """
        parts = [self.signals_of_run(run, plant, signals, run.start) for run in self.runs]
        return {name: self._averaged([part[name] for part in parts]) for name in signals}

    def simulate_channels(
        self,
        plant: Any,
        shift: tuple[float, ...] = NO_SHIFT,
        each: Sequence[tuple[float, ...]] = (),
    ) -> dict[str, Floats]:
        """Simulate all recordings and return the measured channels only, each of shape (rows,).

        The shift is as in :meth:`simulate`, or a separate one for each recording.
        """
        shifts = each or [shift] * len(self.runs)
        parts = [self.simulate_run_channels(k, plant, own) for k, own in enumerate(shifts)]
        return {c: _joined([part[c] for part in parts]) for c in self.channels}

    def simulate_ships(
        self, plants: Sequence[Any], shifts: Sequence[tuple[float, ...]] = ()
    ) -> list[dict[str, Floats]]:
        """Simulate all recordings with several ship records; return the measured channels of each.

        The shift of each is as in :meth:`simulate`. The result for a record is that of
        :meth:`simulate_channels`; records of one of :func:`.simulation.alike_groups` are simulated at
        once.
        """
        parts = []
        for run in self.runs:
            starts = [_shifted(run, shift) for shift in shifts or [NO_SHIFT] * len(plants)]
            parts.append(self.channels_of_ships(run, plants, starts))
        return [
            {c: _joined([blocks(run[c], self.every) for run in runs]) for c in self.channels}
            for runs in zip(*parts, strict=True)
        ]

    def simulate_run_channels(
        self, which: int, plant: Any, shift: tuple[float, ...] = NO_SHIFT
    ) -> dict[str, Floats]:
        """Simulate the recording of an index and return its channels, each of shape (its rows,)."""
        run = self.runs[which]
        (channels,) = self.channels_of_ships(run, [plant], [_shifted(run, shift)])
        return {c: blocks(values, self.every) for c, values in channels.items()}

    def with_held_commands(self) -> Iterator[JointReplay]:
        """Yield replays in which some command steps occur at the next row instead of along a line.

        The time of a command step between two rows is not recorded. Each of the :data:`SEPARATE_STEPS`
        largest steps gives one replay, and all smaller steps together give one more.
        """

        def relative_steps(rows: Floats) -> Floats:
            return np.asarray(np.abs(np.diff(rows)) / max(float(np.ptp(rows)), 1e-12))

        runs = self.runs
        sizes = [relative_steps(run.drive_rows) + relative_steps(run.command) for run in runs]
        every = np.concatenate(sizes)
        ranks = np.empty(len(every), np.int64)
        ranks[np.argsort(-every, kind="stable")] = np.arange(len(every))
        cuts = np.cumsum([len(size) for size in sizes])[:-1]
        for group in range(SEPARATE_STEPS + 1):
            chosen = np.minimum(ranks, SEPARATE_STEPS) == group
            if every[chosen].any():
                other = copy.copy(self)
                parts = np.split(chosen, cuts)
                other.runs = [run.with_holds(part) for run, part in zip(runs, parts, strict=True)]
                yield other

    def simulate_run(self, run: Replay, plant: Any, start: tuple[float, ...]) -> NDArray[Any]:
        """Simulate one of the recordings; return its samples.

        The start is pitch ratio [-], shaft speed [rad/s] and ship speed [m/s] at the first row; further
        entries shift :data:`shaftline.plant.replay.PLANAR_STATES`.
        """
        return run.simulate(plant, start)

    def channels_of_ships(
        self, run: Replay, plants: Sequence[Any], starts: Sequence[tuple[float, ...]]
    ) -> list[dict[str, Floats]]:
        """Return the measured channels of :meth:`simulate_run` for each ship, of shape (its rows,)."""
        return run.channels_of_ships(plants, starts)

    def signals_of_run(
        self, run: Replay, plant: Any, signals: Sequence[str], start: tuple[float, ...]
    ) -> dict[str, Floats]:
        """Return some signals of :meth:`simulate_run` by name, each of shape (its rows,)."""
        return run.simulate_signals(plant, signals, start)

    @functools.cached_property
    def recorded(self) -> dict[str, Floats]:
        """Measured channels by column, each of shape (rows,)."""
        return {c: self._column(c) for c in self.channels}

    @functools.cached_property
    def measured(self) -> dict[str, Floats]:
        """Measured channels with noise of :data:`RESOLUTION` added to those with less noise."""
        rng = np.random.default_rng(0)
        measured = dict(self.recorded)
        for column, values in self.recorded.items():
            least = _finest(column, values)
            if estimate_noise(values[slice(*self.segments[0])], self.interval_s).white_rms < least:
                measured[column] = values + least * rng.standard_normal(len(values))
        return measured

    @functools.cached_property
    def noise_rms(self) -> dict[str, float]:
        """White noise of the first recording by column, in the unit of the column."""
        first = slice(*self.segments[0])
        measured = {column: values[first] for column, values in self.measured.items()}
        if not self.steady:
            return {c: estimate_noise(x, self.interval_s).white_rms for c, x in measured.items()}
        signals = (self.drive_rows, self.command, *self.outside.values())
        inputs = [signal[first] for signal in signals]
        nominal = self.simulate_channels(self.ship.record())
        return {c: row_noise(x, [*inputs, nominal[c][first]]) for c, x in measured.items()}

    @functools.cached_property
    def quantisation(self) -> dict[str, float]:
        """Quantisation steps that are larger than the noise, by column, in the unit of the column."""
        steps, first = {}, self.runs[0]
        for column in self.channels:
            values = first.table[column].to_numpy()
            noise = estimate_noise(values, first.interval_s)
            # Steps below the resolution are rounding errors of a simulated channel.
            if max(noise.white_rms, _finest(column, values)) < 0.5 * noise.quantisation:
                steps[column] = noise.quantisation
        return steps

    def simulated(self, samples: Any) -> dict[str, Floats]:
        """Return the measured channels of simulated samples, by column."""
        return {c: np.ascontiguousarray(samples[MEASURED[c]]) for c in self.channels}


def _shifted(run: Replay, shift: tuple[float, ...]) -> tuple[float, ...]:
    """Return the shifted first state of a recording; entries after the first three are shifts."""
    return (*(a + b for a, b in zip(run.start, shift[:3], strict=True)), *shift[3:])


def _finest(column: str, values: Floats) -> float:
    """Return the finest resolution of a channel in its unit."""
    sized = np.diff(values) if column in (SHAFT_ANGLE, HEADING) else values
    return RESOLUTION * float(np.abs(sized).max())


def _joined(parts: list[Floats]) -> Floats:
    """Return the concatenated parts; the part itself, not copied, if there is one only."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def blocks(rows: Floats, every: int) -> Floats:
    """Return the means over groups of rows, shape (n, ...); incomplete groups at the end are dropped."""
    if every == 1:
        return rows
    count = len(rows) // every
    cut = rows[: count * every]
    return np.asarray(cut.reshape(count, every, *cut.shape[1:]).mean(axis=1))


def map_threaded(
    work: Callable[[T], R], items: Iterable[T], most: int = 2 * THREADS
) -> Iterator[R]:
    """Yield the results of ``map(work, items)`` in order, computed on :data:`THREADS` threads.

    Compiled kernels release the interpreter lock. At most ``most`` items are in progress at a time. Work
    that is itself on such a thread is done there: it would wait for threads that all wait for their own
    work.

    Example:
        >>> list(map_threaded(abs, [-1, 2, -3]))
        [1, 2, 3]
    """
    if getattr(_thread, "is_of_pool", False):
        yield from map(work, items)
        return
    pool, waiting = _pool(os.getpid()), iter(items)
    running = [pool.submit(work, item) for item in itertools.islice(waiting, most)]
    while running:
        yield running.pop(0).result()
        running += [pool.submit(work, item) for item in itertools.islice(waiting, 1)]


@functools.cache
def _pool(_process: int) -> ThreadPoolExecutor:
    """Return the thread pool of a process; a forked process does not have the threads of its parent."""
    return ThreadPoolExecutor(THREADS, initializer=_mark_thread)


_thread = threading.local()


def _mark_thread() -> None:
    """Mark the present thread as one of the pool."""
    _thread.is_of_pool = True


class LinearReplay(JointReplay):
    """Replay as :class:`.joint_replay.JointReplay` with the linearised equations of the ship.

    Raises:
        ValueError: the recordings have different columns or intervals, their rows are equilibria, the
            ship turns, or its drive prescribes the shaft speed.
    """

    def __init__(self, ship: Any, *tables: Any, steady: bool = False, **settings: Any) -> None:
        reasons = {
            "rows that are equilibria have no linear dynamic model": steady,
            "the linear replay has no equations of turning": ship.turns,
            "the drive prescribes the shaft speed, which the linear replay does not model": (
                not ship.turns_freely
            ),
        }
        for reason, applies in reasons.items():
            if applies:
                raise ValueError(f"{ship.name}: {reason}; use the nonlinear replay")
        super().__init__(ship, *tables, **settings)

    def simulate_run(self, run: Replay, plant: Any, start: tuple[float, ...]) -> NDArray[Any]:
        """Simulate one recording by the linear model; the arguments are those of the nonlinear one."""
        inflow = run.inflow(plant)
        acting = np.column_stack([run.pitch, run.drive, np.ones(len(run.drive)), inflow[1::2]])
        mean = acting.mean(axis=0)
        pitch, drive, factor, water = mean  # in the order of INPUTS
        inputs = Inputs(drive, pitch, water, resistance_factor=factor)
        middle = settle_lags(plant, State(*_means(run)), inputs)
        first = settle_lags(plant, run.first_state(start), run.first_inputs(inflow))
        states = [*active_states(plant), "shaft_angle"]
        outputs = [name.removeprefix("measured_") for name in MEASURED.values()]
        model = tangent(plant, middle, inputs, middle.pitch_ratio, states, outputs)
        n = len(states)
        # The system x' = A x + B u + f is integrated exactly over a step by a matrix exponential.
        whole = np.zeros((n + 5, n + 5))
        whole[:n] = np.column_stack([model.a, model.b, model.rates])
        step = scipy.linalg.expm(whole * run.dt)
        moved = acting - mean
        deviations = np.zeros((len(acting) + 1, n))
        deviations[0] = [getattr(first, name) - getattr(middle, name) for name in states]
        _march(step[:n, :n].copy(), moved @ step[:n, n:-1].T + step[:n, -1], deviations)
        rows = slice(None, None, run.per_row)
        at_rows = np.vstack([moved, moved[-1:]])[rows]
        values = model.values + deviations[rows] @ model.c.T + at_rows @ model.d.T
        samples = np.zeros(len(values), SAMPLE)
        for own, signal, column in zip(outputs, MEASURED.values(), values.T, strict=True):
            samples[own] = samples[signal] = column
        return samples

    def channels_of_ships(
        self, run: Replay, plants: Sequence[Any], starts: Sequence[tuple[float, ...]]
    ) -> list[dict[str, Floats]]:
        """Return the measured channels of the linear model for each ship, of shape (its rows,)."""
        ships = zip(plants, starts, strict=True)
        return [self.simulated(self.simulate_run(run, *ship)) for ship in ships]

    def signals_of_run(
        self, run: Replay, plant: Any, signals: Sequence[str], start: tuple[float, ...]
    ) -> dict[str, Floats]:
        """Return some signals of the linear model by name, each of shape (its rows,)."""
        samples = self.simulate_run(run, plant, start)
        return {name: samples[name].copy() for name in signals}


def _means(run: Replay) -> tuple[float, float, float]:
    """Return the mean pitch ratio, shaft speed and ship speed; the first value of a missing channel."""
    columns = ("pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s")
    pitch, shaft, speed = (
        float(np.mean(run.table[c])) if c in run.table else start
        for c, start in zip(columns, run.start, strict=True)
    )
    return pitch, shaft, speed if run.ship.moves else 0.0


@compiled
def _march(carry: Floats, forced: Floats, states: Floats) -> None:
    """Write x[k + 1] = carry x[k] + forced[k] to ``states``, from its first row."""
    for k in range(len(forced)):
        for i in range(len(carry)):
            total = forced[k, i]
            for j in range(len(carry)):
                total += carry[i, j] * states[k, j]
            states[k + 1, i] = total
