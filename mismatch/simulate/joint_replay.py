"""Simulations that do not wait for each other, on two threads: kernels let other threads run.

Recordings of one ship replayed together, again and again.

An effect leaves its trace in what the *simulation* does under the recorded demands, which are free of
instrument noise. Regressors made from measured signals would share their noise with the residual and
make inertia look added where none is (errors in variables).
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import HEADING, MEASURED, SHAFT_ANGLE
from ...plant.equilibria import SteadyReplay
from ...plant.replay import Replay
from ...plant.ship import Ship
from ...plant.signals import SAMPLE
from ..recordings.excitation import loaded, moves
from ..recordings.noise import describe, row_noise

T = TypeVar("T")
R = TypeVar("R")

THREADS = min(2, os.cpu_count() or 1)


@functools.cache
def _pool(_process: int) -> ThreadPoolExecutor:
    """A process's own: the threads of the one that it was forked from are not there."""
    return ThreadPoolExecutor(THREADS)


def at_once(work: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """``map(work, items)``, in its order.

    Args:
        work: whose inner loops let other threads run.
        items: of which twice as many as there are threads are under way at a time.
    """
    pool, waiting = _pool(os.getpid()), iter(items)
    running = [pool.submit(work, item) for item in itertools.islice(waiting, 2 * THREADS)]
    while running:
        yield running.pop(0).result()
        running += [pool.submit(work, item) for item in itertools.islice(waiting, 1)]


START_STEPS = 40
"""Time steps of the ship over which the first state is averaged."""

MOVES_APART = 12
"""Moves of the demands whose times between two rows are doubted one by one."""


UNMOVED = (0.0, 0.0, 0.0)
"""Shift of the first state by nothing."""

RESOLUTION = 1e-5
"""Share of its largest value that a channel is read to at best: one that was simulated, not measured,
would be infinitely sure of itself. Of an angle, which has no largest value, the largest step counts.
"""


def blocks(rows: NDArray[np.float64], every: int) -> NDArray[np.float64]:
    """Means over so many rows each; what is left over at the end is dropped.

    Args:
        rows: shape (n, ...).
        every: at least 1.
    """
    if every == 1:
        return rows
    count = len(rows) // every
    cut = rows[: count * every]
    return np.asarray(cut.reshape(count, every, *cut.shape[1:]).mean(axis=1))


def _shifted(run: Replay, shift: tuple[float, ...]) -> tuple[float, ...]:
    """A recording's first state, shifted; what follows the first three is a shift itself."""
    return (*(a + b for a, b in zip(run.start, shift[:3], strict=True)), *shift[3:])


def _finest(column: str, values: NDArray[np.float64]) -> float:
    """What a channel is read to at best, in its unit."""
    sized = np.diff(values) if column in (SHAFT_ANGLE, HEADING) else values
    return RESOLUTION * float(np.abs(sized).max())


class JointReplay:
    """One or more recordings of a ship, each simulated from its own start, end to end in the arrays.

    Args:
        ship: the nominal ship.
        tables: canonical columns at an even interval, all finite; equal columns and intervals.
        line: whether demands are straight lines between rows instead of held.
        every: rows that are averaged into one, of what was recorded and simulated alike; the simulation
            goes from row to row all the same. Rows left over at a recording's end are dropped.
        steady: whether each row is an equilibrium at the inputs of that row.

    Raises:
        ValueError: recordings that do not go together.
    """

    def __init__(
        self,
        ship: Ship,
        *tables: pd.DataFrame,
        line: bool = False,
        every: int = 1,
        steady: bool = False,
    ) -> None:
        self.ship = ship
        self.line, self.every, self.steady = line, every, steady
        over = START_STEPS * ship.time_step_s
        self.runs = [
            SteadyReplay(ship, table) if steady else Replay(ship, table, over, line)
            for table in tables
        ]
        first = self.runs[0]
        self.interval_s = first.interval_s * every
        self.controllable = ship.has_variable_pitch
        self.channels = first.channels
        for number, run in enumerate(self.runs[1:], 2):
            if run.channels != self.channels or abs(run.interval_s / first.interval_s - 1.0) > 0.01:
                raise ValueError(
                    f"recording {number} has other columns or another interval than the first: "
                    f"{', '.join(run.channels)} every {run.interval_s:g} s, not "
                    f"{', '.join(self.channels)} every {first.interval_s:g} s"
                )
        sizes = [run.rows // every for run in self.runs]
        ends = np.cumsum(sizes)
        self.segments = [(int(e) - size, int(e)) for e, size in zip(ends, sizes, strict=True)]
        self.rows = int(ends[-1])
        self.time_s = np.arange(self.rows, dtype=np.float64) * self.interval_s
        self.start = first.start

        def joined(name: str) -> NDArray[np.float64]:
            return self._averaged([getattr(run, name) for run in self.runs])

        self.drive_rows, self.command = joined("drive_rows"), joined("command")
        self.rudder_rows = joined("rudder_rows")
        self.excited = any(
            moves(run.drive_rows) or moves(run.command) or loaded(ship, run.table)
            for run in self.runs
        )
        self.elevation_rows = joined("elevation_rows")
        self.outside = {
            name: self._averaged([run.table[name].to_numpy(dtype=np.float64) for run in self.runs])
            for name in sorted(ship.signals)
            if all(name in run.table for run in self.runs)
        }
        self.inflow_rows = self._averaged([run.inflow_rows(ship.record()) for run in self.runs])

    def with_ship(self, ship: Ship, *tables: pd.DataFrame) -> JointReplay:
        """Return a replay of the same recordings, or of others alike, by another ship."""
        own = tables or [run.table for run in self.runs]
        return JointReplay(ship, *own, line=self.line, every=self.every, steady=self.steady)

    @property
    def rate_interval_s(self) -> float:
        """Interval over which rates of change are formed [s]; infinite between equilibria."""
        return math.inf if self.steady else self.interval_s

    def _averaged(self, parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """A signal of every run, shape (rows of the run,) or (rows, signals), end to end."""
        return np.concatenate([blocks(part, self.every) for part in parts])

    def simulate(self, plant: Any, shift: tuple[float, ...] = UNMOVED) -> Any:
        """Samples at the recordings' rows under a ship record; SAMPLE array of shape (rows,).

        Args:
            plant: ship record.
            shift: of the first pitch ratio [-], shaft speed [rad/s] and ship speed [m/s], and of a
                ship that turns sway speed [m/s], yaw rate [rad/s] and heading [rad].
        """
        found = list(self._sailed(plant, shift, self.simulate_run))
        if self.every == 1:
            return found[0] if len(found) == 1 else np.concatenate(found)
        width = len(SAMPLE.names or ())
        plain = self._averaged([part.view(np.float64).reshape(-1, width) for part in found])
        return np.ascontiguousarray(plain).view(SAMPLE).ravel()

    def channels_of(
        self,
        plant: Any,
        shift: tuple[float, ...] = UNMOVED,
        each: Sequence[tuple[float, ...]] = (),
    ) -> dict[str, NDArray[np.float64]]:
        """The measured channels of a simulation alone, as :meth:`simulated` gives them.

        Args:
            plant: ship record.
            shift: as of :meth:`simulate`.
            each: the shift of each recording instead.
        """
        shifts = each or [shift] * len(self.runs)
        parts = [self.channels_of_run(k, plant, own) for k, own in enumerate(shifts)]
        return {c: np.concatenate([part[c] for part in parts]) for c in self.channels}

    def channels_of_run(
        self, which: int, plant: Any, shift: tuple[float, ...] = UNMOVED
    ) -> dict[str, NDArray[np.float64]]:
        """The same of one recording, its rows alone.

        Args:
            which: recording.
            plant: ship record.
            shift: as of :meth:`simulate`.
        """
        run = self.runs[which]
        samples = self.simulate_into(run, plant, _shifted(run, shift))
        return {c: blocks(samples[MEASURED[c]].copy(), self.every) for c in self.channels}

    def mistimed(self) -> Iterator[JointReplay]:
        """The same with some moves of the demands held up to the next row instead of drawn as a line.

        When between two rows a demand moved is not recorded. The :data:`MOVES_APART` largest moves may
        each have come at a time of its own, all others at one.
        """
        sizes = []
        for run in self.runs:
            size = np.zeros(run.rows - 1)
            for rows in (run.drive_rows, run.command):
                size += np.abs(np.diff(rows)) / max(float(np.ptp(rows)), 1e-12)
            sizes.append(size)
        every = np.concatenate(sizes)
        ranks = np.empty(len(every), np.int64)
        ranks[np.argsort(-every, kind="stable")] = np.arange(len(every))
        cuts = np.cumsum([len(size) for size in sizes])[:-1]
        for group in range(MOVES_APART + 1):
            chosen = ranks == group if group < MOVES_APART else ranks >= MOVES_APART
            if every[chosen].any():
                other = copy.copy(self)
                parts = np.split(chosen, cuts)
                other.runs = [
                    run.with_holds(part) for run, part in zip(self.runs, parts, strict=True)
                ]
                yield other

    def _sailed(
        self, plant: Any, shift: tuple[float, ...], simulate: Callable[..., NDArray[Any]]
    ) -> Iterator[NDArray[Any]]:
        for run in self.runs:
            yield simulate(run, plant, _shifted(run, shift))

    def simulate_run(self, run: Replay, plant: Any, start: tuple[float, ...]) -> NDArray[Any]:
        """Samples at one recording's rows.

        Args:
            run: one of ``runs``.
            plant: ship record.
            start: pitch ratio [-], shaft speed [rad/s] and ship speed [m/s] at its first row; what
                follows them shifts :data:`shaftline.plant.replay.IN_THE_PLANE`.
        """
        return run.simulate(plant, start)

    def simulate_into(self, run: Replay, plant: Any, start: tuple[float, ...]) -> NDArray[Any]:
        """The same, in memory that the thread's next simulation fills anew."""
        return run.simulate_into(plant, start)

    @functools.cached_property
    def recorded(self) -> dict[str, NDArray[np.float64]]:
        """Measured channels by column as they were recorded, each of shape (rows,)."""
        return {
            c: self._averaged([run.table[c].to_numpy(dtype=np.float64) for run in self.runs])
            for c in self.channels
        }

    @functools.cached_property
    def measured(self) -> dict[str, NDArray[np.float64]]:
        """The same with the noise of :data:`RESOLUTION` on those that have next to none."""
        rng = np.random.default_rng(0)
        found = dict(self.recorded)
        for column, values in self.recorded.items():
            least = _finest(column, values)
            if describe(values[slice(*self.segments[0])], self.interval_s).white_rms < least:
                found[column] = values + least * rng.standard_normal(len(values))
        return found

    @functools.cached_property
    def noise_rms(self) -> dict[str, float]:
        """White noise of the measured channels, by column, in their units; told from the first run."""
        first = slice(*self.segments[0])
        noise = {
            column: describe(values[first], self.interval_s).white_rms
            for column, values in self.measured.items()
        }
        if not self.steady:
            return noise
        inputs = [self.drive_rows, self.command, *self.outside.values()]
        nominal = self.channels_of(self.ship.record())
        return {
            column: row_noise(values[first], [one[first] for one in (*inputs, nominal[column])])
            for column, values in self.measured.items()
        }

    @functools.cached_property
    def quantisation(self) -> dict[str, float]:
        """Steps of the channels in which they are coarser than the noise, by column, in their units."""
        found = {}
        for column in self.channels:
            values = self.runs[0].table[column].to_numpy()
            own = describe(values, self.runs[0].interval_s)
            # steps below the resolution are a simulation's last digits
            if max(own.white_rms, _finest(column, values)) < 0.5 * own.quantisation:
                found[column] = own.quantisation
        return found

    def simulated(self, samples: Any) -> dict[str, NDArray[np.float64]]:
        """The same channels of a simulation."""
        return {c: np.ascontiguousarray(samples[MEASURED[c]]) for c in self.channels}
