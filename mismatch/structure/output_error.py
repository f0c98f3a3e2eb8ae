"""Fit a ship with effects to the measured channels by output error.

The free-running simulation is compared with each measured channel, row by row. Parameters of the ship
file, the first state, the skew between the channels' clocks and the values of the effects are all free
at once, each with its prior. The likelihood is

    2 log L = -sum over channels of N log(mean e^2) + 2 log of the priors,

``e`` the residual, whitened by the noise model of the richest model found so far (raw until there is
one), ``N`` its number of independent values. Gauss-Newton steps are taken over fixed finite differences
in scaled coordinates, inside bounds: relative differences vanish at neutral values. Between steps the
derivatives are updated from the simulations of the steps, and computed again where that gains no more.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.statistics import covariance_of
from ..identification.parameters import FAR_TOLERANCES
from ..search.catalogue import SizedEffect
from ..search.spectra import Segments
from ..search.trial_ship import TrialShip
from ..simulate.balances import Balances, first_state_deviations
from ..simulate.joint_replay import Floats, map_threaded
from .model import FIXED, Coordinates, JointPrior, Model, Prior, parameter_priors
from .noise_model import Likelihood, with_first_states

SKEW_ROWS = 0.29
"""Standard deviation of a channel's clock skew, in recorded rows: uniform up to half a row."""

START_PRECISION = 0.01
"""Precision of a first state's shift: ten deviations, as a lagging instrument does not measure it."""

MOST_STEPS, MOST_TRIALS = 20, 6
"""Largest number of Gauss-Newton steps of a fit, and of trials of a step with increasing damping."""

SETTLED, ABOUT = 0.1, 1.0
"""Gain of a step in 2 log L, predicted or simulated, below which a fit ends: with its own derivatives,
and with derivatives of another model, which only rank the models."""

DIVERGED = 1e6
"""Multiple of the largest measured value from which a simulated channel counts as diverged."""

LEAST_NOISE = 0.5
"""Least residual of a channel that counts, as a multiple of its white noise."""


def _secant(columns: Floats, step: Floats, change: Floats) -> Floats:
    """Return the least change of derivatives that gives the change along a step (Broyden 1965).

    Args:
        columns: derivatives by the coordinates, shape (coordinates, channels, values).
        step: step in the coordinates, shape (coordinates,).
        change: change of the simulated channels by the step, shape (channels, values).
    """
    error = change - np.tensordot(step, columns, axes=1)
    return np.asarray(step[:, None, None] * (error / float(step @ step)))


class OutputError:
    """Fits ships to some rows of recordings.

    Args:
        balances: balances of the ship and the recordings.
        fitted: fitted rows, as segments (first row, one past the last).
        held: held-out rows, likewise.
        tolerance: factor on the tolerances of the ship's parameters; 0 holds them all.
        highest_Hz: highest frequency that counts once there is a noise model.

    Attributes:
        rows: indices of the fitted rows.
        held_rows: indices of the held-out rows.
        states: states of a recording's first row that are free.
        starts: deviation of each of them, recording by recording, in its unit; 0 where it is held.
    """

    def __init__(
        self,
        balances: Balances,
        fitted: Segments,
        held: Segments,
        tolerance: float = 1.0,
        highest_Hz: float = math.inf,
    ) -> None:
        self.replay = replay = balances.replay
        self.tolerance, self.highest_Hz = tolerance, highest_Hz
        self.trial_ship = TrialShip(balances)
        self.priors: list[Prior] = parameter_priors(replay, tolerance)
        self._prior: tuple[list[Prior], JointPrior] | None = None
        self.names = list(replay.channels)
        self.rows = np.concatenate([np.arange(a, b) for a, b in fitted])
        self.held_rows = np.concatenate([np.arange(a, b) for a, b in held])
        self.simulations = 0
        start = first_state_deviations(replay)
        self.states = len(start)
        self.starts = np.tile(start, len(replay.runs))
        self.measured = np.array([replay.recorded[c] for c in self.names])
        largest = np.abs(self.measured).max(axis=1)
        self._largest = DIVERGED * largest + 1.0
        floor = np.array([LEAST_NOISE * replay.noise_rms[c] for c in self.names])
        floor += 1e-9 * largest + 1e-30
        lengths = [b - a for a, b in fitted], [b - a for a, b in held]
        self.likelihood = Likelihood(floor, *lengths, replay.interval_s, highest_Hz)

    def record(self, effects: tuple[SizedEffect, ...], shifts: Floats) -> Any:
        """Return the ship's record with shifted parameters and effects; effects take precedence."""
        plant = self.trial_ship.with_terms(effects).record()
        for prior, shift in zip(self.priors, shifts, strict=True):
            prior.write(plant, prior.value_at(float(shift)))
        self.trial_ship.write(plant, effects)
        return plant

    def channels(
        self, effects: tuple[SizedEffect, ...], shifts: Floats, nuisance: Floats
    ) -> tuple[Floats, Floats]:
        """Return simulated channels on all rows and their rate by row, each shape (channels, rows)."""
        self.simulations += 1
        record, first = self.record(effects, shifts), self._first(nuisance)
        values = self._bounded(self.replay.simulate_channels(record, each=first))
        slopes = np.zeros_like(values)
        for a, b in self.replay.segments:
            if b - a > 1 and not self.replay.steady:
                slopes[:, a:b] = np.gradient(values[:, a:b], axis=1)
        return values + nuisance[len(self.starts) :, None] * slopes, slopes

    def _first(self, nuisance: Floats) -> list[tuple[float, ...]]:
        """Return the shift of each recording's first state, in the states' units."""
        shifts = nuisance[: len(self.starts)] * self.starts
        return [tuple(map(float, one)) for one in shifts.reshape(-1, self.states)]

    def simulate_run_channels(
        self, run: int, effects: tuple[SizedEffect, ...], shifts: Floats, nuisance: Floats
    ) -> Floats:
        """Return one recording's simulated channels without clock skew, shape (channels, rows)."""
        record, first = self.record(effects, shifts), self._first(nuisance)[run]
        return self._bounded(self.replay.simulate_run_channels(run, record, first))

    def _bounded(self, channels: dict[str, Floats]) -> Floats:
        """Return simulated channels as an array, all NaN where the ship diverges."""
        values = np.array([channels[c] for c in self.names])
        with np.errstate(invalid="ignore"):
            sound = np.all(np.abs(values) <= self._largest[:, None])
        return values if sound else np.full_like(values, math.nan)

    def simulate(self, model: Model) -> Floats:
        """Return a model's simulated channels on all rows, each recording from its own first state."""
        return self.channels(model.effects, model.shifts, with_first_states(self, model))[0]

    def residual(self, model: Model) -> Floats:
        """Return measured minus simulated on the fitted rows, shape (channels, rows)."""
        values, _ = self.channels(model.effects, model.shifts, model.nuisance)
        return np.asarray((self.measured - values)[:, self.rows])

    def held_residual(self, model: Model) -> Floats:
        """Return measured minus simulated on the held-out rows, shape (channels, rows)."""
        return np.asarray((self.measured - self.simulate(model))[:, self.held_rows])

    def held_error(self, model: Model) -> Floats:
        """Return the rms residual of a model on the held-out rows by channel."""
        return self.likelihood.rms(self.held_residual(model))

    def file_model(self) -> Model:
        """Return the model of the ship file, without a fit."""
        nuisance = np.zeros(len(self.starts) + len(self.names))
        return Model((), np.zeros(len(self.priors)), nuisance, -math.inf)

    def score(
        self, white: Floats, shifts: Floats, nuisance: Floats, guessed: bool = False
    ) -> float:
        """Return 2 log L of whitened residuals on the fitted rows, with the priors."""
        cost = self.prior.penalty(shifts, guessed)
        cost += float(np.sum(self.nuisance_precision() * nuisance**2))
        return self.likelihood.fitted(white) - cost

    @property
    def prior(self) -> JointPrior:
        """Prior of all parameters."""
        if self._prior is None or self._prior[0] != self.priors:
            joint = JointPrior(self.priors, self.replay.ship.tolerances)
            self._prior = list(self.priors), joint
        return self._prior[1]

    def nuisance_precision(self) -> Floats:
        """Return the precision of each nuisance value's prior; :data:`FIXED` of one that cannot move."""
        starts = np.where(self.starts > 0.0, START_PRECISION, FIXED)
        skew = (SKEW_ROWS / self.replay.every) ** -2.0
        if self.replay.steady:  # rows that are equilibria have no clock
            skew = FIXED
        return np.concatenate([starts, np.full(len(self.names), skew)])

    def fit_near_file(self, model: Model, which: Collection[int] | None = None) -> Model:
        """Fit a model from a start with parameters, all by default, held within the file's tolerances.

        Its score has no probability that the file is wrong in these parameters.
        """
        before, shifts = list(self.priors), model.shifts.copy()
        which = range(len(before)) if which is None else which
        shifts[[*which]] = 0.0
        self.hold(which)
        try:
            return self.fit(model.effects, replace(model, shifts=shifts))
        finally:
            self.priors[:] = before

    def hold(self, which: Iterable[int]) -> None:
        """Hold parameters of the ship file, by index, within their tolerances from now on."""
        for k in which:
            self.priors[k] = replace(self.priors[k], wrong=0.0)

    def far_parameters(self, model: Model) -> list[int]:
        """Return the indices of parameters beyond :data:`FAR_TOLERANCES`, the largest shift first."""
        sizes = self.prior.distances(model.shifts)
        return [k for k in np.argsort(-sizes, kind="stable").tolist() if sizes[k] > FAR_TOLERANCES]

    def fit_from_far(self, model: Model) -> Model:
        """Fit a model again from its fit without the file's tolerances; return the better model.

        The file's tolerances may keep a parameter near the file although a far value fits better.
        """
        wide = self.fit(model.effects, model, guessed=True)
        return max(model, self.fit(wide.effects, wide), key=lambda one: one.score)

    def fit(
        self,
        effects: tuple[SizedEffect, ...],
        begin: Model,
        guessed: bool = False,
        tangent: Floats | None = None,
    ) -> Model:
        """Fit all free values together.

        Args:
            effects: effects at their starting values.
            begin: model whose shifts and nuisance values are the start.
            guessed: whether the file's tolerances are ignored.
            tangent: derivatives by parameters and nuisance values from :meth:`derivatives` of a similar
                model, which save most simulations; by default those of the start are computed.
        """
        search = Coordinates(self, effects, begin)

        def evaluate(point: Floats) -> tuple[tuple[Floats, Floats], Floats, float]:
            """Return channels with their rates, the whitened residual and the score."""
            parts = search.split(point)
            channels = self.channels(*parts)
            white = self.likelihood.white((self.measured - channels[0])[:, self.rows])
            return channels, white, self.score(white, *parts[1:], guessed)

        def derivatives(point: Floats, channels: tuple[Floats, Floats]) -> Floats:
            """Return whitened derivatives by all coordinates, those of the tangent where it is given."""
            if tangent is None:
                return self._derivatives(search, point, *channels, 0)
            own = self._derivatives(search, point, *channels, search.edge)
            kept = tangent * (search.steps[: search.edge] != 0.0)[:, None, None]
            kept[search.clocks :] = tangent[search.clocks :]
            return np.concatenate([kept, own])

        point = search.start
        channels, white, score = evaluate(point)
        if not math.isfinite(score):
            return Model(*search.split(point), score)
        damping, settled = 0.0, SETTLED if tangent is None else ABOUT
        columns, updated = derivatives(point, channels), False
        for _ in range(MOST_STEPS):
            precision, scale = search.precision(point, guessed), self.likelihood.scale(white)
            flat = (columns * scale).reshape(len(columns), -1)
            lhs = flat @ flat.T + precision
            rhs = flat @ (white * scale).ravel() - precision @ point
            gained, failed = -math.inf, False
            for _ in range(MOST_TRIALS):
                trial = search.step(point, lhs + damping * np.diag(np.diag(lhs)), rhs)
                step = trial - point
                if 2.0 * float(rhs @ step) - float(step @ lhs @ step) < settled:
                    break
                trial_channels, trial_white, trial_score = evaluate(trial)
                gained = trial_score - score
                if gained > 0.0:
                    columns += _secant(columns, step, white - trial_white)
                    point, channels, white, score = trial, trial_channels, trial_white, trial_score
                    damping *= 1.0 if failed else 0.1
                    break
                failed = True
                if updated:
                    break
                damping = max(10.0 * damping, 1e-2)
            if gained >= settled:
                updated = True
            elif updated:
                columns, updated = derivatives(point, channels), False
            else:
                break
        return Model(*search.split(point), score)

    def derivatives(self, model: Model) -> tuple[Floats, Coordinates]:
        """Return whitened derivatives by all coordinates, (coordinates, channels, values), and these."""
        search = Coordinates(self, model.effects, model)
        values, slopes = self.channels(model.effects, model.shifts, model.nuisance)
        return self._derivatives(search, search.start, values, slopes, 0), search

    def _derivatives(
        self, search: Coordinates, point: Floats, values: Floats, slopes: Floats, first: int
    ) -> Floats:
        """Return whitened derivatives by the coordinates from an index on."""
        skew = point[search.clocks : search.edge, None]

        def derivative(k: int) -> Floats:
            trial = point.copy()
            trial[k] += search.steps[k]
            inside = search.inside(trial)
            if inside[k] - point[k] < 0.5 * search.steps[k]:  # at its bound: step down
                trial[k] = point[k] - search.steps[k]
                inside = search.inside(trial)
            change = inside[k] - point[k]
            column = np.zeros_like(values)
            if change != 0.0:
                if (run := search.run_of(k)) is None:
                    column = (self.channels(*search.split(inside))[0] - values) / change
                else:
                    own = slice(*self.replay.segments[run])
                    here = (values - skew * slopes)[:, own]
                    there = self.simulate_run_channels(run, *search.split(inside))
                    column[:, own] = (there - here) / change
            fitted = column[:, self.rows]
            finite = np.isfinite(fitted).all()
            return self.likelihood.white(fitted if finite else np.zeros_like(fitted))

        moving = [k for k in range(first, len(point)) if search.steps[k] > 0.0]
        columns = np.zeros((len(point) - first, *self.likelihood.shape))
        for k, column in zip(moving, map_threaded(derivative, moving), strict=True):
            columns[k - first] = column
        if first <= search.clocks:
            # A clock skew changes its own channel in proportion to its rate.
            for c in range(len(self.names)):
                alone = np.zeros((len(self.names), len(self.rows)))
                alone[c] = slopes[c, self.rows]
                columns[search.clocks + c - first] = self.likelihood.white(alone)
        return columns

    def standard_errors(self, model: Model, guessed: bool = False) -> Floats:
        """Return the standard error of each free value; see :meth:`covariance`."""
        return np.sqrt(np.maximum(np.diag(self.covariance(model, guessed)), 0.0))

    def covariance(self, model: Model, guessed: bool = False, share: float = 1.0) -> Floats:
        """Return the covariance of all shifts, nuisance values and values of effects, in their units.

        It follows from the curvature at the maximum with all values free; with ``guessed`` without the
        file's tolerances. A ``share`` below 1 reduces the information of the recordings, not that of the
        tolerances. Shape (free values, free values).
        """
        columns, search = self.derivatives(model)
        scale = self.likelihood.scale(self.likelihood.white(self.residual(model)))
        flat = (columns * scale).reshape(len(columns), -1)
        information = share * (flat @ flat.T) + search.precision(search.start, guessed)
        return covariance_of(information) * np.outer(search.units, search.units)
