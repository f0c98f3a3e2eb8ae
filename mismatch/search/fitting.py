"""Fit effects by output error in the simulator, and test whether the residual is more than noise.

The model is always the simulation of the ship. Its difference from the recording, as residuals of the
balances, is whitened by :mod:`.spectra`. Nominal parameters are free within their tolerances as normal
variables, so that a small bias of a parameter is not reported as a missing effect.

The test compares the residual with the one that the noise of each channel, as estimated from the
recording, causes in the balances at each frequency. Above a certain frequency waves disturb every
balance of a ship that moves, which is no error of the model; there the residual is not tested.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ...core.statistics import chi_squared_limit, covariance_of
from ...plant.ship import Ship
from ...plant.simulation import alike_groups
from ..estimate import Estimate
from ..simulate.balances import (
    LARGEST_STEP,
    Balances,
    Channels,
    tolerance_perturbations,
)
from ..simulate.joint_replay import THREADS, Floats, map_threaded
from .catalogue import SizedEffect
from .spectra import Bands, Complex, Likelihood, Marginal, band_products, is_divergent
from .trial_ship import JointSearch, TrialShip

REMEMBERED, LEAST_REMEMBERED, REMEMBERED_BYTES = 64, 16, 32e6
"""Largest number of simulations in the cache of a fitter, smallest number, and their memory [B] between
the two. The simulations of a candidate effect are needed again while it is screened."""

MISTIMED = 2.0 / math.sqrt(12.0)
"""Standard deviation of the time of a command step between two rows, uniform over the interval, in units
of the half interval by which a held command differs from a line."""

MOST_STEPS, SETTLED = 6, 0.05
"""Largest number of Gauss-Newton steps, and the gain in 2 log L below which they end."""

LEAST_STEP, REACH = 1e-3, 0.5
"""Finite difference and prior standard deviation of a Gauss-Newton step, in search coordinates."""

LOUDER = 4.0
"""Largest ratio of the residual power of a balance with a model to that without effects."""

SLOWER_THAN_SEA_HZ = 0.03
"""Frequency [Hz] below which no waves excite a ship."""

MODEL_M, FULL_M = 12.0, 320.0
"""Length [m] below which a hull is a scale model in a basin, and length of the ship to which the limit
belongs. By Froude's law the frequency of waves scales with the inverse square root of the length."""

EXCESS = 2.0
"""Ratio of power to noise power from which a residual is significant; the rms noise has 10 % error."""

CHANCE = 1e-6
DRAWS = 6

Transformed: TypeAlias = Callable[[Channels], Complex]
"""Function that transforms simulated channels to the quantities that are compared."""


@dataclass(frozen=True)
class Fit:
    """Model fitted to the recording; its difference has the parameters of the ship file."""

    effects: tuple[SizedEffect, ...]  # effects with fitted values
    score: float  # 2 log L with the prior of the tolerances [-]; only differences have a meaning
    difference: Complex  # transformed recording minus simulation, shape (balances, frequencies)
    tolerances: Floats  # fitted deviation of each nominal parameter, in standard deviations
    weight: Complex  # inverse covariance of the residual by band, shape (bands, balances, balances)

    def without_difference(self) -> Fit:
        """Return the fit with an empty difference, which takes nearly all of its memory."""
        return replace(self, difference=np.empty((len(self.difference), 0), np.complex128))


class Fitter:
    """Evaluation and fit of effects on one set of recordings.

    Args:
        balances: balances of ship and recordings.
        bands: frequencies of the part that may be fitted.
        scale: factor on all tolerances of the nominal parameters.
        free: dotted keys of parameters that are fitted and have no tolerance here.
        doubt: whether the times of command steps between two rows are uncertain too.

    Attributes:
        moves: perturbation of the parameters for each of the first tolerances of a fit.
        null: fit without effects.
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
        fitting = REMEMBERED_BYTES / self.measured.nbytes
        self._capacity = int(np.clip(fitting, LEAST_REMEMBERED, REMEMBERED))
        self._lock = threading.Lock()
        self.moves = tuple(tolerance_perturbations(replay, scale, free, LARGEST_STEP))
        self._doubt = doubt
        self.nuisance = np.array(self.regressors(self._transformed))
        self.likelihood = Likelihood(bands, self.nuisance)
        self._shares = np.zeros(len(self.nuisance))
        self.null = self.evaluate(())
        self._shares = self.null.tolerances

    def _transformed(self, channels: Channels) -> Complex:
        # A trial may diverge; its score is then -inf.
        with np.errstate(invalid="ignore", over="ignore"):
            return self.bands.transform(self.balances.residuals(channels))

    def regressors(self, transformed: Transformed) -> list[Complex]:
        """Return the changes of transformed channels by each parameter and each command time."""
        replay, plain = self.balances.replay, self.trial_ship.nominal
        nominal = transformed(replay.simulate_channels(plain))

        def changes_of(group: Sequence[int]) -> list[Complex]:
            moves = [self.moves[i] for i in group]
            ships = replay.simulate_ships([m.record for m in moves], [m.start for m in moves])
            pairs = zip(moves, ships, strict=True)
            return [(transformed(channels) - nominal) / move.share for move, channels in pairs]

        groups = alike_groups([move.record for move in self.moves])
        found: dict[int, Complex] = {}
        for group, own in zip(groups, map_threaded(changes_of, groups, THREADS), strict=True):
            found |= dict(zip(group, own, strict=True))
        changes = [found[i] for i in range(len(self.moves))]
        for other in replay.with_held_commands() if self._doubt else ():
            changes.append(MISTIMED * (transformed(other.simulate_channels(plain)) - nominal))
        return changes

    def sensitivities(
        self, fit: Fit, transformed: Transformed | None = None, steps: Floats | None = None
    ) -> tuple[Complex, NDArray[np.complex128]]:
        """Return the prediction of a model and its derivative by each value of its effects.

        Args:
            fit: the model.
            transformed: function that transforms simulated channels; by default to the fitted balances.
            steps: steps of the finite differences, shape (values,); a hundredth of each value by
                default.

        Returns:
            Shapes (balances, frequencies) and (values, balances, frequencies).
        """
        own_steps: list[float] = []
        models = [fit.effects]
        for i, sized in enumerate(fit.effects):
            for j, value in enumerate(sized.values):
                step = 1e-2 * abs(value) + 1e-9 if steps is None else steps[len(own_steps)]
                values = [*sized.values]
                values[j] += step
                own_steps.append(step)
                models.append(sized.with_values(values).replace_in(fit.effects, i))
        records = list(map(self.trial_ship.record, models))
        if transformed is None:
            predictions = self.predictions(records)
        else:
            predictions = map(transformed, self.balances.replay.simulate_ships(records))
        here = next(predictions)
        columns: list[Complex] = []
        for step, prediction in zip(own_steps, predictions, strict=True):
            change = prediction - here
            columns.append(change / step if np.isfinite(change).all() else np.zeros_like(here))
        return here, np.array(columns, np.complex128).reshape(-1, *here.shape)

    def predict(self, record: Any) -> Complex:
        """Return the transformed balance residuals of a simulation, from a cache if possible."""
        found = self._recall(key := record.tobytes())
        return self._predict([record])[key] if found is None else found

    def predictions(self, records: Sequence[Any]) -> Iterator[Complex]:
        """Yield the prediction of each record, as :meth:`predict`; records that are alike at once.

        Groups of records are simulated on several threads.
        """
        keys = [record.tobytes() for record in records]
        ready = {key: found for key in keys if (found := self._recall(key)) is not None}
        pending = {k: r for k, r in zip(keys, records, strict=True) if k not in ready}
        new, uses = list(pending), Counter(keys)
        groups = [[new[i] for i in group] for group in alike_groups(list(pending.values()))]
        simulated = map_threaded(
            lambda group: self._predict([pending[k] for k in group]), groups, THREADS
        )
        for key in keys:
            while key not in ready:
                ready |= next(simulated)
            prediction = ready[key]
            uses[key] -= 1
            if uses[key] == 0:  # The predictions of a long recording take much memory.
                del ready[key]
            yield prediction

    def _recall(self, key: bytes) -> Complex | None:
        """Return a prediction from the cache, or None; the last used one is the last to be dropped."""
        with self._lock:
            if key not in self._cache:
                return None
            self._cache[key] = self._cache.pop(key)
            return self._cache[key]

    def predict_effects(self, effects: tuple[SizedEffect, ...]) -> Complex:
        """Return the prediction of effects, as :meth:`predict`."""
        return self.predict(self.trial_ship.record(effects))

    def simulate_ahead(self, models: Iterable[tuple[SizedEffect, ...]]) -> None:
        """Simulate models that will be evaluated next on several threads.

        There are at most half as many as the cache holds.
        """
        records = map(self.trial_ship.record, models)
        pending = (record for record in records if record.tobytes() not in self._cache)
        for _ in self.predictions(list(itertools.islice(pending, self._capacity // 2))):
            pass

    def _predict(self, records: Sequence[Any]) -> dict[bytes, Complex]:
        """Simulate different records, and return and remember the prediction of each by its bytes."""
        with self._lock:
            self.simulations += len(records)
        found = {}
        ships = self.balances.replay.simulate_ships(records)
        for record, channels in zip(records, ships, strict=True):
            key, prediction = record.tobytes(), self._transformed(channels)
            found[key] = prediction
            self._remember(key, prediction)
        return found

    def _remember(self, key: bytes, prediction: Complex) -> None:
        with self._lock:
            if key not in self._cache and len(self._cache) >= self._capacity:
                self._cache.pop(next(iter(self._cache)))
            self._cache[key] = prediction

    def evaluate(self, effects: tuple[SizedEffect, ...]) -> Fit:
        """Return the fit of effects at their values, with free nominal parameters."""
        return self.evaluate_record(self.trial_ship.record(effects), effects)

    def evaluate_models(self, models: Iterable[tuple[SizedEffect, ...]]) -> Iterator[Fit]:
        """Yield the fit of each of several models, as :meth:`evaluate`; alike ones at once."""
        models = list(models)
        predictions = self.predictions(list(map(self.trial_ship.record, models)))
        for effects, prediction in zip(models, predictions, strict=True):
            yield self._fit(prediction, effects)

    def evaluate_record(self, record: Any, effects: tuple[SizedEffect, ...] = ()) -> Fit:
        """Return the fit of a ship record, which may have effects, with free nominal parameters."""
        return self._fit(self.predict(record), effects)

    def _fit(self, prediction: Complex, effects: tuple[SizedEffect, ...]) -> Fit:
        """Return the fit of effects with a prediction."""
        difference = self.measured - prediction
        if is_divergent(difference):
            empty = np.zeros(len(self.nuisance))
            return Fit(effects, -math.inf, difference, empty, self.null.weight)
        best = self.likelihood(difference, self._shares)
        return Fit(effects, best.score, difference, best.shares, best.weight)

    def scale_effect(self, base: Fit, small: SizedEffect) -> SizedEffect | None:
        """Return an effect at the size that a linear extrapolation gives in addition to a model.

        Probes are widely spaced, and the size in a recording may be far smaller than the smallest probe,
        at which the effect is given. None if no size in the range of the parameter helps.
        """
        parameter, ship = small.effect.parameters[0], self.trial_ship
        neutral = ship.neutral(parameter)
        if math.isinf(neutral):
            return None
        column = self.predict_effects((*base.effects, small)) - self.predict_effects(base.effects)
        if not np.isfinite(column).all():
            return None
        share, _ = self.likelihood.amount(base.weight, base.difference, column)
        size = neutral + share * (small.values[0] - neutral)
        value = float(np.clip(size, *ship.range_of(parameter)))
        identifiable = abs(value - neutral) > ship.smallest_size(parameter)
        if not identifiable or (value < neutral and not parameter.signed):
            return None
        return small.with_values((value, *small.values[1:]))

    def refine_effect(self, fit: Fit, which: int) -> Fit:
        """Refit one effect with the others fixed."""
        return self._search(fit, [which], evaluations=40, spread=0.35)

    def refine_effects(self, fit: Fit, evaluations: int = 90) -> Fit:
        """Refit all effects together."""
        return self.polish(self._search(fit, None, evaluations, spread=0.1))

    def polish(self, fit: Fit) -> Fit:
        """Refit all effects together by Gauss-Newton steps from nearby values."""
        search = JointSearch(self.trial_ship, fit.effects)
        point = search.start
        for _ in range(MOST_STEPS):
            here = self.predict_effects(fit.effects)
            near = [search.effects_at(point + row) for row in LEAST_STEP * np.eye(len(point))]
            self.simulate_ahead(near)
            columns = np.array([self.predict_effects(e) - here for e in near])
            columns *= REACH / LEAST_STEP
            if not np.isfinite(columns).all():
                break
            step = REACH * self.project_residual(fit, columns).shares[: len(point)]
            for share in (1.0, 0.3, 0.1):
                better = self.evaluate(search.effects_at(point + share * step))
                if better.score > fit.score:
                    break
            else:
                break
            gain = better.score - fit.score
            point, fit = point + share * step, better
            if gain < SETTLED:
                break
        return fit

    def project_residual(self, fit: Fit, columns: Any) -> Marginal:
        """Fit columns, shape (c, balances, frequencies), to the residual of a model.

        Their shares have a standard normal prior, and the nominal parameters are free too.
        """
        start = np.concatenate([np.zeros(len(columns)), fit.tolerances])
        return self.likelihood.with_columns(columns)(fit.difference, start)

    def residual(self, fit: Fit) -> Complex:
        """Return the residual of a model with fitted nominal parameters, (balances, frequencies)."""
        return np.asarray(fit.difference - np.einsum("k,kmf->mf", fit.tolerances, self.nuisance))

    def increases_residual(self, fit: Fit) -> bool:
        """Return whether a model increases the residual of a balance far above that without effects.

        Residuals that are nearly proportional have a covariance with a small determinant, and so a high
        likelihood although they are large.
        """
        fits, weights = (self.null, fit), self.bands.weights
        before, after = (np.abs(self.residual(f)) ** 2 @ weights for f in fits)
        return bool(np.any(after > LOUDER * before))

    def _search(self, fit: Fit, which: list[int] | None, evaluations: int, spread: float) -> Fit:
        search, best = JointSearch(self.trial_ship, fit.effects, which), [fit]

        def loss(point: Any) -> float:
            trial = self.evaluate(search.effects_at(point))
            if trial.score > best[0].score:
                best[0] = trial
            return -trial.score if math.isfinite(trial.score) else 1e12

        start = search.start
        if len(start) == 1:
            scipy.optimize.minimize_scalar(
                loss,
                bounds=(start[0] - 1.5, start[0] + 1.5),
                method="bounded",
                options={"xatol": 0.005, "maxiter": 16},
            )
        else:
            simplex = np.vstack([start, start + spread * np.eye(len(start))])
            self.simulate_ahead(map(search.effects_at, simplex))
            scipy.optimize.minimize(
                loss,
                start,
                method="Nelder-Mead",
                options={
                    "maxfev": evaluations,
                    "xatol": 3e-3,
                    "fatol": 0.05,
                    "initial_simplex": simplex,
                },
            )
        return best[0]

    def estimates(self, fit: Fit, form: float = 0.0) -> list[tuple[Estimate, ...]]:
        """Return the values of every effect with standard errors, with free nominal parameters.

        The errors come from the curvature of the whitened likelihood over steps of one standard error,
        so that nonlinearity within the interval is included. The error of an inexact form, as a share of
        the size of an effect, is added.
        """
        if not fit.effects:
            return []
        sizes = np.abs([value for sized in fit.effects for value in sized.values])
        steps = errors = 1e-2 * sizes + 1e-9
        for _ in range(3):
            columns = self.sensitivities(fit, steps=steps)[1]
            covariance = covariance_of(self.likelihood.information(fit.weight, columns))
            errors = np.sqrt(np.maximum(np.diag(covariance)[: len(sizes)], 1e-300))
            steps = np.clip(errors, 1e-4 * sizes + 1e-12, 0.5 * sizes + 1e-9)
        ship = self.trial_ship
        return estimates_of(ship.with_terms(fit.effects), ship, fit.effects, errors, form)


def estimates_of(
    host: Ship, trial_ship: TrialShip, effects: tuple[SizedEffect, ...], errors: Floats, form: float
) -> list[tuple[Estimate, ...]]:
    """Return estimates of the values of effects.

    Args:
        host: ship with the terms of the effects, to which the estimates belong.
        trial_ship: ship without the effects, from which their sizes count.
        effects: effects with fitted values.
        errors: standard error of each value, in its unit, shape (values,).
        form: additional error of an inexact form, as a share of the size of an effect.
    """
    rest, estimates = iter(errors.tolist()), []
    for effect in effects:
        own = []
        for parameter, value in effect.pairs:
            more = form * abs(value - trial_ship.origin(parameter))
            neutral, given = trial_ship.neutral(parameter), (parameter.key, value, next(rest))
            own.append(Estimate.of(host, *given, form_error=more, neutral=neutral))
        estimates.append(tuple(own))
    return estimates


@dataclass(frozen=True)
class Colour:
    """Residual that exceeds the noise of the instruments."""

    band: int  # index of the band with the largest excess
    balance: int  # index of the balance
    low_Hz: float  # lower edge of the band
    high_Hz: float  # upper edge of the band
    ratio: float  # power of the residual over that of the noise


class Whiteness:
    """Comparison of residuals with the noise of the instruments.

    Args:
        fitter: fitter of the recording.
        noise_rms: white noise of each measured column, in its unit.
        quantisation: quantisation steps that are larger than the noise; their error is no white noise,
            but as slow as the channel itself.
    """

    def __init__(
        self,
        fitter: Fitter,
        noise_rms: Mapping[str, float],
        quantisation: Mapping[str, float] | None = None,
    ) -> None:
        self.fitter = fitter
        bands, balances = fitter.bands, fitter.balances
        base = balances.residuals(balances.nominal)
        rng, steps = np.random.default_rng(0), quantisation or {}
        power = []
        for _ in range(DRAWS):
            noisy = {}
            for c, x in balances.nominal.items():
                noise = noise_rms.get(c, 0.0) * rng.standard_normal(len(x))
                noisy[c] = _measure(x, noise, rng.random(), steps.get(c, 0.0))
            change = bands.transform(balances.residuals(noisy) - base)
            power.append(band_products(bands, change, change).real)
        self._expected = np.mean(power, axis=0)

    def ratios(self, fit: Fit) -> Floats:
        """Return residual power over noise power, (bands, balances); 0 for bands without a test."""
        bands, balances = self.fitter.bands, self.fitter.balances
        residual = self.fitter.residual(fit)
        powers = band_products(bands, residual, residual).real, self._expected
        power, noise = (np.diagonal(p, axis1=1, axis2=2) for p in powers)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.nan_to_num(power / noise, posinf=0.0)
        if balances.moving:
            slower = slower_than_waves_hertz(balances.replay.ship)
            ratio[bands.frequency_Hz[bands.edges[1:] - 1] > slower] = 0.0
        return np.asarray(ratio)

    @property
    def _limit(self) -> Floats:
        """Power ratio from which a band is significant, shape (bands,)."""
        bands = self.fitter.bands
        freedom = 2.0 * np.add.reduceat(bands.weights, bands.edges[:-1])
        return np.asarray(EXCESS * chi_squared_limit(CHANCE, freedom) / freedom)

    def coloured_balances(self, fit: Fit) -> list[str]:
        """Return the names of the balances whose residual exceeds the noise."""
        excess = (self.ratios(fit) / self._limit[:, None]).max(axis=0)
        names = self.fitter.balances.names
        return [name for name, most in zip(names, excess, strict=True) if most > 1.0]

    def colour(self, fit: Fit, balance: int | None = None) -> Colour | None:
        """Return the band and balance with the largest excess over the noise; None without an excess.

        All balances are tested by default, or else the one of an index.
        """
        bands, ratios = self.fitter.bands, self.ratios(fit)
        excess = ratios / self._limit[:, None]
        if balance is not None:
            excess[:, np.arange(excess.shape[1]) != balance] = 0.0
        band, row = map(int, np.unravel_index(int(np.argmax(excess)), excess.shape))
        if excess[band, row] <= 1.0:
            return None
        first, last = bands.edges[band], bands.edges[band + 1] - 1
        low, high = (float(bands.frequency_Hz[k]) for k in (first, last))
        return Colour(band, row, low, high, float(ratios[band, row]))


def slower_than_waves_hertz(ship: Ship) -> float:
    """Return the frequency [Hz] below which no waves excite a ship, from its length if it is known."""
    length = ship.manoeuvring.length_m
    if not 0.0 < length < MODEL_M:
        return SLOWER_THAN_SEA_HZ
    return float(SLOWER_THAN_SEA_HZ * np.sqrt(FULL_M / length))


def _measure(values: Floats, noise: Floats, phase: float, step: float) -> Floats:
    """Return measured values: with noise, or with quantisation if the step is larger than 0.

    The phase, 0 to 1, is the position of the grid of steps.
    """
    if step <= 0.0:
        return values + noise
    return np.asarray((np.round(values / step + phase) - phase) * step)
