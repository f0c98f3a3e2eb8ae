"""Output error: a ship with some effects on it, fitted to the channels that were measured.

What is compared is the free-running simulation and each measured channel, row by row. Numbers of the
ship's file, the first state, the skew between the channels' clocks and the values of the effects are all
free at once, each with its prior. The likelihood is

    2 log L = -sum over channels of N_c log(mean w e^2) - what the priors say,

``N_c`` the rows' number less what their neighbours repeat, ``w`` small where a row lies far from what
the richest model says (Huber 1964). Gauss and Newton's steps are taken over fixed differences in scaled
coordinates, inside bounds: relative steps vanish at neutral values.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..search.placed import Placed
from ..search.trial_ship import TrialShip
from ..simulate.at_once import at_once
from ..simulate.balances import Balances
from ..simulate.tolerances import START
from .coordinates import FIXED, Coordinates
from .doubts import Doubt, doubts_of
from .model import Floats, Model
from .rows import telling

Segments = Sequence[tuple[int, int]]

SKEW_ROWS = 0.29
"""Standard deviation of the shift of a channel's clock, in recorded rows: evenly likely up to half."""

START_LOOSE = 0.01
"""Precision of a first state's shift in the deviations of :data:`START`: ten of them, for what is read
behind a lag is another thing than the state."""

FIRST_ROWS = 100
"""From which the first state of a recording is told that was not fitted, at most."""

HUBER = 3.0
"""Deviations beyond which a row counts less, in 1.48 times the median of all."""

FAR_TOLERANCES = 3.0
"""Tolerances beyond which a parameter has moved far from the ship file."""

MOST_STEPS = 14
"""Of Gauss and Newton."""

SETTLED = 0.02
"""Gain in 2 log L of a step below which no other is taken."""

LEAST_NOISE = 0.5
"""Times a channel's white noise that a model's error counts at least."""


class OutputError:
    """Fits ships to some rows of recordings.

    Args:
        balances: of ship and recordings.
        fitted: rows that may be fitted.
        tolerance: factor on the tolerances of the ship's numbers; 0 holds them all.
    """

    def __init__(self, balances: Balances, fitted: Segments, tolerance: float = 1.0) -> None:
        self.replay = balances.replay
        self.trial_ship = TrialShip(balances)
        self.doubts: list[Doubt] = doubts_of(self.replay, tolerance)
        self.names = list(self.replay.channels)
        self.rows = np.concatenate([np.arange(a, b) for a, b in fitted])
        self.simulations = 0
        ship = self.replay.ship
        shaft = max(abs(self.replay.start[1]), 1.0)
        start = [
            START["pitch_ratio"] if self.replay.controllable else 0.0,
            START["shaft_speed"] * shaft if ship.turns_freely else 0.0,
            START["ship_speed"] if ship.moves else 0.0,
        ]
        self.starts = np.tile(start, len(self.replay.runs))
        self._measured = np.array([self.replay.recorded[c] for c in self.names])
        self._floor = np.array([LEAST_NOISE * self.replay.noise_rms[c] for c in self.names])
        self._floor += 1e-9 * np.abs(self._measured).max(axis=1) + 1e-300
        self.weights = np.ones((len(self.names), len(self.rows)))
        self.counts = np.full(len(self.names), float(len(self.rows)))

    def record(self, effects: tuple[Placed, ...], numbers: Floats) -> Any:
        """Ship record with the doubtful numbers moved and effects on it, which have the last word."""
        plant = self.trial_ship.host(effects).record()
        for doubt, moved in zip(self.doubts, numbers, strict=True):
            doubt.write(plant, doubt.at(float(moved)))
        self.trial_ship.write(plant, effects)
        return plant

    def channels(
        self, effects: tuple[Placed, ...], numbers: Floats, nuisance: Floats
    ) -> tuple[Floats, Floats]:
        """Simulated channels on all rows and their rate by row, each of shape (channels, rows)."""
        self.simulations += 1
        count = len(self.starts)
        found = self.replay.channels_of(self.record(effects, numbers), each=self._shifts(nuisance))
        values = np.array([found[c] for c in self.names])
        slopes = np.zeros_like(values)
        for a, b in self.replay.segments:
            if b - a > 1:
                slopes[:, a:b] = np.gradient(values[:, a:b], axis=1)
        return values + nuisance[count:, None] * slopes, slopes

    def _shifts(self, nuisance: Floats) -> list[tuple[float, ...]]:
        """Shift of each recording's first state, in the states' units."""
        shifts = nuisance[: len(self.starts)] * self.starts
        return [tuple(map(float, one)) for one in shifts.reshape(-1, 3)]

    def of_run(
        self, run: int, effects: tuple[Placed, ...], numbers: Floats, nuisance: Floats
    ) -> Floats:
        """Simulated channels of one recording, its clock's skew left out; shape (channels, rows)."""
        shift = self._shifts(nuisance)[run]
        found = self.replay.channels_of_run(run, self.record(effects, numbers), shift)
        return np.array([found[c] for c in self.names])

    def followed(self, model: Model) -> Floats:
        """Simulated channels of a model on all rows, each recording from its own first state."""
        return self.channels(model.effects, model.numbers, self._started(model))[0]

    def errors(self, model: Model) -> Floats:
        """Standard error of each number as it moved, of the nuisance, and of each effect's value.

        By the curvature at the maximum, all beside it unsure as well; shape (free values,).
        """
        information = self._information(model.columns, self.scaled(model.error), model.precision)[0]
        variances = np.maximum(np.diag(np.linalg.pinv(information)), 0.0)
        return np.asarray(np.sqrt(variances) * model.units)

    def held_error(self, model: Model, rows: NDArray[np.int64]) -> Floats:
        """Return the rms residual of a model on held-out rows, as :meth:`rms`."""
        return self.rms(self.held_residual(model, rows))

    def held_residual(self, model: Model, rows: NDArray[np.int64]) -> Floats:
        """Return measured minus simulated on held-out rows, shape (channels, rows)."""
        return np.asarray((self._measured - self.followed(model))[:, rows])

    def rms(self, error: Floats, limit: Floats | None = None) -> Floats:
        """Return the rms of a residual by channel, no less than half the channel's noise.

        Args:
            error: residual, shape (channels, rows).
            limit: size by channel at which each row's residual is clipped; no clipping by default.
        """
        if not np.isfinite(error).all():
            return np.full(len(self.names), math.inf)
        if limit is not None:
            error = np.minimum(np.abs(error), limit[:, None])
        return np.asarray(np.hypot(np.sqrt(np.mean(error**2, axis=1)), self._floor))

    def _started(self, model: Model) -> Floats:
        """A model's nuisance with the first states of recordings that were not fitted.

        They are told by those recordings' first rows: where an instrument lags, what it reads first is
        not what the ship does.
        """
        nuisance, scale = model.nuisance.copy(), 0.3
        for run, (a, b) in enumerate(self.replay.segments):
            if np.any((self.rows >= a) & (self.rows < b)):
                continue
            first = slice(0, max(2, min(FIRST_ROWS, (b - a) // 4)))
            own = [3 * run + k for k in range(3) if self.starts[3 * run + k] > 0.0]
            for _ in range(3):
                here = self.of_run(run, model.effects, model.numbers, nuisance)
                columns = []
                for k in own:
                    moved = nuisance.copy()
                    moved[k] += scale
                    there = self.of_run(run, model.effects, model.numbers, moved)
                    columns.append(((there - here)[:, : first.stop] / scale).ravel())
                lacking = (self._measured[:, a : a + first.stop] - here[:, : first.stop]).ravel()
                if not np.isfinite(columns).all() or not np.isfinite(lacking).all():
                    break
                nuisance[own] += np.linalg.lstsq(np.transpose(columns), lacking, rcond=1e-9)[0]
        return nuisance

    def nothing(self) -> Model:
        """The ship as its file has it, not yet fitted."""
        none = np.zeros(0)
        return Model(
            (), np.zeros(len(self.doubts)), np.zeros(len(self.starts) + len(self.names)), -math.inf,
            none, none, none, none,
        )  # fmt: skip

    def score(
        self, error: Floats, numbers: Floats, nuisance: Floats, guessed: bool = False
    ) -> float:
        """2 log L of errors on the fitted rows, with what the priors say."""
        if not np.isfinite(error).all():
            return -math.inf
        said = -float(np.sum(self.counts * np.log(self._power(error))))
        said -= sum(d.penalty(float(x), guessed) for d, x in zip(self.doubts, numbers, strict=True))
        return said - float(np.sum(self.loose() * nuisance**2))

    def _power(self, error: Floats) -> Floats:
        """Weighted mean square of errors by channel."""
        mean = np.sum(self.weights * error**2, axis=1) / np.sum(self.weights, axis=1)
        return np.asarray(mean + self._floor**2)

    def loose(self) -> Floats:
        """Precision of the nuisance's priors; of what cannot move as good as infinite."""
        starts = np.where(self.starts > 0.0, START_LOOSE, FIXED)
        skew = SKEW_ROWS / self.replay.every
        return np.concatenate([starts, np.full(len(self.names), skew**-2.0)])

    def near(self, model: Model, which: Collection[int] | None = None) -> Model:
        """A model with some numbers held near the file, all by default, and everything else fitted.

        Its score has no chance that the file is wrong in these.

        Args:
            model: where the rest starts.
            which: numbers by index.
        """
        before, numbers = list(self.doubts), model.numbers.copy()
        which = range(len(before)) if which is None else which
        numbers[[*which]] = 0.0
        self.hold(which)
        try:
            return self.fit(model.effects, replace(model, numbers=numbers))
        finally:
            self.doubts[:] = before

    def hold(self, which: Iterable[int]) -> None:
        """Hold parameters of the ship file, by index, within their tolerances from now on."""
        for k in which:
            self.doubts[k] = replace(self.doubts[k], wrong=0.0)

    def far(self, model: Model) -> list[int]:
        """Return the indices of parameters beyond :data:`FAR_TOLERANCES`, the farthest first."""
        shifts = np.abs(model.numbers) / np.array([doubt.near for doubt in self.doubts])
        return [
            k for k in np.argsort(-shifts, kind="stable").tolist() if shifts[k] > FAR_TOLERANCES
        ]

    def freed(self, model: Model) -> Model:
        """A model fitted anew from where it comes to if all numbers were guessed, if that is better.

        A number that is a little off is held by its tolerance; far off it may be right.
        """
        wide = self.fit(model.effects, model, guessed=True)
        return max(model, self.fit(wide.effects, wide), key=lambda one: one.score)

    def fit(self, effects: tuple[Placed, ...], begin: Model, guessed: bool = False) -> Model:
        """Fit all free values together.

        Args:
            effects: at the values from which they start.
            begin: a model whose numbers and nuisance are the start.
            guessed: whether the file's tolerances are left aside.
        """
        search = Coordinates(self, effects, begin)
        point = search.start
        values, slopes = self.channels(effects, begin.numbers, begin.nuisance)
        error = (self._measured - values)[:, self.rows]
        score = self.score(error, begin.numbers, begin.nuisance, guessed)
        columns, precision = np.zeros((len(point), *error.shape)), search.precision(point, guessed)
        damping = 0.0
        for _ in range(MOST_STEPS):
            if not math.isfinite(score):
                break
            columns = self._columns(search, point, values, slopes)
            precision = search.precision(point, guessed)
            scaled = self.scaled(error)
            lhs, flat = self._information(columns, scaled, precision)
            rhs = flat @ (error * scaled).ravel() - precision * point
            better = None
            for _ in range(6):
                trial = search.stepped(point, lhs + damping * np.diag(np.diag(lhs)), rhs)
                moved = search.split(trial)
                found = self.channels(*moved)
                wrong = (self._measured - found[0])[:, self.rows]
                gained = self.score(wrong, moved[1], moved[2], guessed) - score
                if gained > 0.0:
                    better = (trial, found, wrong)
                    break
                damping = max(10.0 * damping, 1e-2)
            if better is None:
                break
            point, (values, slopes), error = better
            score += gained
            damping *= 0.1
            if gained < SETTLED:
                break
        placed, numbers, nuisance = search.split(point)
        return Model(placed, numbers, nuisance, score, error, columns, precision, search.units)

    def scaled(self, error: Floats) -> Floats:
        """Square roots of the weights with which rows enter a least-squares problem at some errors."""
        share = self.counts / np.sum(self.weights, axis=1) / self._power(error)
        return np.asarray(np.sqrt(self.weights * share[:, None]))

    @staticmethod
    def _information(columns: Floats, scaled: Floats, precision: Floats) -> tuple[Floats, Floats]:
        """Return the information matrix, and the weighted columns flattened."""
        flat = (columns * scaled).reshape(len(columns), -1)
        return flat @ flat.T + np.diag(precision), flat

    def _columns(
        self, search: Coordinates, point: Floats, values: Floats, slopes: Floats
    ) -> Floats:
        """What each coordinate moves of the simulated channels on the fitted rows."""
        steps = search.steps
        felt = np.flatnonzero(steps > 0.0).tolist()

        def moved(k: int) -> Floats:
            trial = point.copy()
            trial[k] += steps[k]
            inside = search.inside(trial)
            if inside[k] == point[k]:  # at its bound: felt the other way
                trial[k] = point[k] - steps[k]
                inside = search.inside(trial)
            change = inside[k] - point[k]
            if change == 0.0:
                return np.zeros((len(self.names), len(self.rows)))
            if (run := search.run_of(k)) is None:
                found, _ = self.channels(*search.split(inside))
                column = ((found - values) / change)[:, self.rows]
            else:
                here, there = (self.of_run(run, *search.split(x)) for x in (point, inside))
                whole = np.zeros_like(values)
                whole[:, slice(*self.replay.segments[run])] = (there - here) / change
                column = whole[:, self.rows]
            return column if np.isfinite(column).all() else np.zeros_like(column)

        columns = np.zeros((len(point), len(self.names), len(self.rows)))
        for k, column in zip(felt, at_once(moved, felt), strict=True):
            columns[k] = column
        for c in range(len(self.names)):  # a clock's shift moves its own channel by its rate
            columns[search.skew + c, c] = slopes[c, self.rows]
        return columns

    def heed(self, model: Model) -> None:
        """Take from a model what its errors are: which rows are far off, and how many tell something."""
        deviation = np.median(np.abs(model.error), axis=1, keepdims=True) / 0.6745
        limit = HUBER * np.hypot(deviation, self._floor[:, None])
        with np.errstate(divide="ignore"):
            self.weights = np.minimum(1.0, limit / np.abs(model.error))
        free = model.columns[model.precision < FIXED]
        self.counts = np.array([telling(error, free[:, c]) for c, error in enumerate(model.error)])
