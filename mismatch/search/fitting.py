"""Fitting effects by output error in the simulator, under noise of unknown colour.

Whatever is fitted, the model is the plant's own simulation; its difference from the recording, in the
coordinates of the balances, is whitened by :mod:`.spectra`. Nominal numbers are free inside their
tolerances throughout, as normal variables, so that a number that is a little wrong is not called missing
physics.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ..estimate import Estimate
from ..simulate.balances import Balances, Channels
from ..simulate.joint_replay import at_once
from ..simulate.tolerances import NEAR, Moved, tolerance_moves
from .catalogue import Placed
from .spectra import Bands, Complex, Likelihood, Marginal, runs_away
from .trial_ship import JointSearch, TrialShip

REMEMBERED, REMEMBERED_BYTES = 64, 64e6
"""Simulations that a fitter remembers: so many, of so much memory at most, but four in any case."""

MISTIMED = 2.0 / math.sqrt(12.0)
"""Standard deviation of the time at which a demand moves between two rows, in what holding it up to the
next row does beside a line: evenly likely over the interval, of which that is half."""

MOST_STEPS, SETTLED = 6, 0.05
"""Of Gauss and Newton; and the gain in 2 log L below which they end."""

LEAST_STEP, REACH = 1e-3, 0.5
"""Over which a derivative is taken, and what a step is given beforehand, in a search's coordinates."""

LOUDER = 4.0
"""Times the power in a balance without a model that no model may leave."""

Transformed: TypeAlias = Callable[[Channels], Complex]
"""Makes what is compared of simulated channels."""


@dataclass(frozen=True)
class Fit:
    """A model fitted to the recording.

    Args:
        effects: with their fitted values.
        score: 2 log L with the tolerances' prior [-]; only differences mean anything.
        difference: recording minus simulation in the balances, transformed, with the nominal numbers
            as the ship's file has them; shape (balances, frequencies).
        tolerances: fitted share of each nominal number's tolerance, in standard deviations.
        weight: inverse covariance of what is left, by band, shape (bands, balances, balances).
    """

    effects: tuple[Placed, ...]
    score: float
    difference: Complex
    tolerances: NDArray[np.float64]
    weight: Complex


class Fitter:
    """Scores and fits effects on one recording.

    Args:
        balances: of ship and recording.
        bands: frequencies of the part that may be fitted.
        scale: factor on all tolerances of the nominal numbers.
        free: dotted keys of numbers that are fitted, whatever their tolerances.
        doubt: whether the times at which demands move between two rows are doubted too.

    Attributes:
        moves: what each of a fit's tolerances moves, the first of them.
    """

    def __init__(
        self,
        balances: Balances,
        bands: Bands,
        scale: float = 1.0,
        free: Collection[str] = (),
        doubt: bool = False,
    ) -> None:
        self.balances = balances
        self.bands = bands
        self.trial_ship = TrialShip(balances)
        self.simulations = 0
        replay = balances.replay
        self.measured = bands.transform(balances.residuals(replay.measured))
        self._cache: dict[bytes, Complex] = {}
        self._room = int(np.clip(REMEMBERED_BYTES / self.measured.nbytes, 4, REMEMBERED))
        self.moves = tuple(tolerance_moves(replay, scale, free, NEAR))
        self._doubt = doubt
        self.nuisance = np.array(self.regressors(self._transformed))
        self.likelihood = Likelihood(bands, self.nuisance)
        self._shares = np.zeros(len(self.nuisance))
        self.null = self.fitted(())
        self._shares = self.null.tolerances

    def _transformed(self, channels: Channels) -> Complex:
        with np.errstate(invalid="ignore", over="ignore"):  # a trial may run away; it is refused
            return self.bands.transform(self.balances.residuals(channels))

    def regressors(self, transformed: Transformed) -> list[Complex]:
        """What each number off by its tolerance moves, and each demand that moved at another time.

        Args:
            transformed: makes what is compared of simulated channels.
        """
        replay, plain = self.balances.replay, self.trial_ship.nominal
        nominal = transformed(replay.channels_of(plain))

        def moved(move: Moved) -> Complex:
            return (transformed(replay.channels_of(move.record, move.start)) - nominal) / move.share

        found = list(at_once(moved, self.moves))
        if self._doubt:
            for other in replay.mistimed():
                found.append(MISTIMED * (transformed(other.channels_of(plain)) - nominal))
        return found

    def sensitivities(
        self,
        fit: Fit,
        transformed: Transformed | None = None,
        steps: NDArray[np.float64] | None = None,
    ) -> tuple[Complex, NDArray[np.complex128]]:
        """What a model predicts, and its derivative by each value of its effects.

        Args:
            fit: the model.
            transformed: makes what is compared of simulated channels; the fitted part's by default.
            steps: over which the derivatives are taken, shape (values,); a hundredth of each by default.

        Returns:
            Shapes (balances, frequencies) and (values, balances, frequencies).
        """
        replay, record = self.balances.replay, self.trial_ship.record

        def predicted(plant: Any) -> Complex:
            if transformed is None:
                return self.predicted(plant)
            return transformed(replay.channels_of(plant))

        here = predicted(record(fit.effects))
        columns: list[Complex] = []
        for i, placed in enumerate(fit.effects):
            for j, value in enumerate(placed.values):
                step = 1e-2 * abs(value) + 1e-9 if steps is None else steps[len(columns)]
                values = [*placed.values]
                values[j] += step
                trial = placed.with_values(values).in_place_of(fit.effects, i)
                moved = predicted(record(trial)) - here
                columns.append(moved / step if np.isfinite(moved).all() else np.zeros_like(here))
        return here, np.array(columns, np.complex128).reshape(-1, *here.shape)

    def _predict(self, record: Any) -> Complex:
        self.simulations += 1
        return self._transformed(self.balances.replay.channels_of(record))

    def predicted(self, record: Any) -> Complex:
        """Transformed balance residuals of a simulation; remembers the last ones."""
        key = record.tobytes()
        if key not in self._cache:
            self._remember(key, self._predict(record))
        return self._cache[key]

    def ahead(self, models: Iterable[tuple[Placed, ...]]) -> None:
        """Simulate effects that are asked for next, several at once; no more than are remembered."""
        records = map(self.trial_ship.record, models)
        pending = {key: r for r in records if (key := r.tobytes()) not in self._cache}
        chosen = dict(itertools.islice(pending.items(), self._room // 2))
        for key, found in zip(chosen, at_once(self._predict, chosen.values()), strict=True):
            self._remember(key, found)

    def _remember(self, key: bytes, found: Complex) -> None:
        if len(self._cache) >= self._room:
            self._cache.pop(next(iter(self._cache)))
        self._cache[key] = found

    def fitted(self, effects: tuple[Placed, ...]) -> Fit:
        """Score of effects at their values, the nominal numbers adjusted inside their tolerances."""
        return self.scored(self.trial_ship.record(effects), effects)

    def scored(self, record: Any, effects: tuple[Placed, ...] = ()) -> Fit:
        """Score of a ship's record, the nominal numbers adjusted inside their tolerances.

        Args:
            record: of a ship, with or without effects.
            effects: that stand in it.
        """
        difference = self.measured - self.predicted(record)
        if runs_away(difference):
            empty = np.zeros(len(self.nuisance))
            return Fit(effects, -math.inf, difference, empty, self.null.weight)
        found = self.likelihood(difference, self._shares)
        return Fit(effects, found.score, difference, found.shares, found.weight)

    def scaled(self, base: Fit, placed: Placed) -> Placed | None:
        """An effect at the size that a straight line through a small one asks for, on top of a model.

        Probes are spaced widely; what a recording shows may be far smaller than the smallest of them.

        Returns:
            None where no size in the parameter's range helps.
        """
        parameter = placed.effect.parameters[0]
        neutral = self.trial_ship.neutral(parameter)
        if math.isinf(neutral):
            return None
        moved = self.predicted(self.trial_ship.record((*base.effects, placed)))
        column = moved - self.predicted(self.trial_ship.record(base.effects))
        if not np.isfinite(column).all():
            return None
        share, _ = self.likelihood.amount(base.weight, base.difference, column)
        low, high = self.trial_ship.range_of(parameter)
        value = float(np.clip(neutral + share * (placed.values[0] - neutral), low, high))
        if abs(value - neutral) <= self.trial_ship.least(parameter) or (
            value < neutral and not parameter.signed
        ):
            return None
        return placed.with_values((value, *placed.values[1:]))

    def refined(self, fit: Fit, which: int) -> Fit:
        """Refit one of the effects, the others held."""
        return self._searched(fit, [which], evaluations=40, spread=0.35)

    def joint(self, fit: Fit, evaluations: int = 90) -> Fit:
        """Refit all effects together."""
        return self.polished(self._searched(fit, None, evaluations, spread=0.1))

    def polished(self, fit: Fit) -> Fit:
        """Refit all effects together by Gauss-Newton steps, from values that are near."""
        search = JointSearch(self.trial_ship, fit.effects)
        point = search.start
        for _ in range(MOST_STEPS):
            here = self.predicted(self.trial_ship.record(fit.effects))
            moved = [search.placed(point + row) for row in LEAST_STEP * np.eye(len(point))]
            self.ahead(moved)
            columns = np.array(
                [self.predicted(self.trial_ship.record(m)) - here for m in moved]
            ) * (REACH / LEAST_STEP)
            if not np.isfinite(columns).all():
                break
            step, better = REACH * self.beside(fit, columns).shares[: len(point)], None
            for share in (1.0, 0.3, 0.1):
                found = self.fitted(search.placed(point + share * step))
                if found.score > fit.score:
                    better = found
                    break
            if better is None:
                break
            gain = better.score - fit.score
            point, fit = point + share * step, better
            if gain < SETTLED:
                break
        return fit

    def beside(self, fit: Fit, columns: Any) -> Marginal:
        """How much of some columns, shape (c, balances, frequencies), is in what a model lacks.

        Their shares are standard normal beforehand, and the nominal numbers are free beside them.
        """
        start = np.concatenate([np.zeros(len(columns)), fit.tolerances])
        regressors = np.concatenate([columns, self.nuisance])
        return Likelihood(self.bands, regressors)(fit.difference, start)

    def left(self, fit: Fit) -> Complex:
        """What a model leaves, the nominal numbers where it has them; shape (balances, frequencies)."""
        return np.asarray(fit.difference - np.einsum("k,kmf->mf", fit.tolerances, self.nuisance))

    def louder(self, fit: Fit) -> bool:
        """Whether a model leaves far more in a balance than there was without it.

        Balances that err together have a covariance of small determinant, which looks as good as little
        error where the covariance is free.
        """
        before, after = (np.abs(self.left(f)) ** 2 @ self.bands.weights for f in (self.null, fit))
        return bool(np.any(after > LOUDER * before))

    def _searched(self, fit: Fit, which: list[int] | None, evaluations: int, spread: float) -> Fit:
        search, best = JointSearch(self.trial_ship, fit.effects, which), [fit]

        def loss(point: Any) -> float:
            found = self.fitted(search.placed(point))
            if found.score > best[0].score:
                best[0] = found
            return -found.score if math.isfinite(found.score) else 1e12

        start = search.start
        if len(start) == 1:
            scipy.optimize.minimize_scalar(
                loss, bounds=(start[0] - 1.5, start[0] + 1.5), method="bounded",
                options={"xatol": 0.005, "maxiter": 16},
            )  # fmt: skip
        else:
            simplex = np.vstack([start, start + spread * np.eye(len(start))])
            scipy.optimize.minimize(
                loss, start, method="Nelder-Mead",
                options={"maxfev": evaluations, "xatol": 3e-3, "fatol": 0.05,
                         "initial_simplex": simplex},
            )  # fmt: skip
        return best[0]

    def estimates(self, fit: Fit, form: float = 0.0) -> list[tuple[Estimate, ...]]:
        """Every effect's values with their errors, the nominal numbers free in their tolerances.

        From the curvature of the whitened likelihood over steps of one standard error, so that bends
        inside the interval are felt.

        Args:
            fit: the model.
            form: share of an effect's size by which a form that is not the truth's widens its interval.
        """
        flat = [(i, j) for i, placed in enumerate(fit.effects) for j in range(len(placed.values))]
        if not flat:
            return []
        sizes = np.array([abs(fit.effects[i].values[j]) for i, j in flat])
        steps = errors = 1e-2 * sizes + 1e-9
        for _ in range(3):
            columns = self.sensitivities(fit, steps=steps)[1]
            covariance = np.linalg.pinv(self.likelihood.information(fit.weight, columns))
            errors = np.sqrt(np.maximum(np.diag(covariance)[: len(flat)], 1e-300))
            steps = np.clip(errors, 1e-4 * sizes + 1e-12, 0.5 * sizes + 1e-9)
        host = self.trial_ship.host(fit.effects)
        found: list[list[Estimate]] = [[] for _ in fit.effects]
        for (i, j), error in zip(flat, errors, strict=True):
            parameter, value = fit.effects[i].pairs[j]
            size = abs(value - self.trial_ship.origin(parameter))
            found[i].append(
                Estimate.of(
                    host, parameter.key, value, float(error),
                    form_error=form * size,
                    neutral=self.trial_ship.neutral(parameter),
                )
            )  # fmt: skip
        return [tuple(estimates) for estimates in found]
