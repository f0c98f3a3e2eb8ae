"""Fit effects by output error in the simulator, with noise of unknown spectrum.

The model is always the simulation of the ship. Its difference from the recording, as residuals of the
balances, is whitened by :mod:`.spectra`. Nominal parameters are free within their tolerances as normal
variables, so that a small bias of a parameter is not reported as a missing effect.

Test whether a residual is larger than the noise of the instruments.

The noise of each channel is estimated from the recording. The balances give the residual that this noise
causes at each frequency. Above a certain frequency waves disturb every balance of a ship that moves,
which is no error of the model; there the residual is not tested.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ...plant.ship import Ship
from ..estimate import Estimate
from ..simulate.balances import (
    LARGEST_STEP,
    Balances,
    Channels,
    Perturbation,
    tolerance_perturbations,
)
from ..simulate.joint_replay import map_threaded
from .catalogue import SizedEffect
from .spectra import Bands, Complex, Likelihood, Marginal, band_products, is_divergent
from .trial_ship import JointSearch, TrialShip

REMEMBERED, REMEMBERED_BYTES = 64, 64e6
"""Largest number of simulations in the cache of a fitter and its memory [B]; at least four are kept."""

MISTIMED = 2.0 / math.sqrt(12.0)
"""Standard deviation of the time of a command step between two rows, uniform over the interval, in units
of the half interval by which a held command differs from a line."""

MOST_STEPS, SETTLED = 6, 0.05
"""Largest number of Gauss-Newton steps, and the gain in 2 log L below which they end."""

LEAST_STEP, REACH = 1e-3, 0.5
"""Finite difference and prior standard deviation of a Gauss-Newton step, in search coordinates."""

LOUDER = 4.0
"""Largest ratio of the residual power of a balance with a model to that without effects."""

Transformed: TypeAlias = Callable[[Channels], Complex]
"""Function that transforms simulated channels to the quantities that are compared."""


@dataclass(frozen=True)
class Fit:
    """Model fitted to the recording.

    Args:
        effects: effects with fitted values.
        score: 2 log L with the prior of the tolerances [-]; only differences have a meaning.
        difference: transformed residuals of the recording minus those of the simulation with the
            parameters of the ship file, shape (balances, frequencies).
        tolerances: fitted deviation of each nominal parameter, in standard deviations.
        weight: inverse covariance of the residual by band, shape (bands, balances, balances).
    """

    effects: tuple[SizedEffect, ...]
    score: float
    difference: Complex
    tolerances: NDArray[np.float64]
    weight: Complex


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
        self._capacity = int(np.clip(REMEMBERED_BYTES / self.measured.nbytes, 4, REMEMBERED))
        self.moves = tuple(tolerance_perturbations(replay, scale, free, LARGEST_STEP))
        self._doubt = doubt
        self.nuisance = np.array(self.regressors(self._transformed))
        self.likelihood = Likelihood(bands, self.nuisance)
        self._shares = np.zeros(len(self.nuisance))
        self.null = self.evaluate(())
        self._shares = self.null.tolerances

    def _transformed(self, channels: Channels) -> Complex:
        with np.errstate(
            invalid="ignore", over="ignore"
        ):  # A trial may diverge; its score is then -inf.
            return self.bands.transform(self.balances.residuals(channels))

    def regressors(self, transformed: Transformed) -> list[Complex]:
        """Return the changes by each perturbed parameter and by each change of the command times.

        Args:
            transformed: function that transforms simulated channels.
        """
        replay, plain = self.balances.replay, self.trial_ship.nominal
        nominal = transformed(replay.simulate_channels(plain))

        def moved(move: Perturbation) -> Complex:
            return (
                transformed(replay.simulate_channels(move.record, move.start)) - nominal
            ) / move.share

        found = list(map_threaded(moved, self.moves))
        if self._doubt:
            for other in replay.with_held_commands():
                found.append(MISTIMED * (transformed(other.simulate_channels(plain)) - nominal))
        return found

    def sensitivities(
        self,
        fit: Fit,
        transformed: Transformed | None = None,
        steps: NDArray[np.float64] | None = None,
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
        replay, record = self.balances.replay, self.trial_ship.record

        def predict(plant: Any) -> Complex:
            if transformed is None:
                return self.predict(plant)
            return transformed(replay.simulate_channels(plant))

        here = predict(record(fit.effects))
        columns: list[Complex] = []
        for i, placed in enumerate(fit.effects):
            for j, value in enumerate(placed.values):
                step = 1e-2 * abs(value) + 1e-9 if steps is None else steps[len(columns)]
                values = [*placed.values]
                values[j] += step
                trial = placed.with_values(values).replace_in(fit.effects, i)
                moved = predict(record(trial)) - here
                columns.append(moved / step if np.isfinite(moved).all() else np.zeros_like(here))
        return here, np.array(columns, np.complex128).reshape(-1, *here.shape)

    def _predict(self, record: Any) -> Complex:
        self.simulations += 1
        return self._transformed(self.balances.replay.simulate_channels(record))

    def predict(self, record: Any) -> Complex:
        """Return the transformed balance residuals of a simulation, from a cache if possible."""
        key = record.tobytes()
        if key not in self._cache:
            self._remember(key, self._predict(record))
        return self._cache[key]

    def simulate_ahead(self, models: Iterable[tuple[SizedEffect, ...]]) -> None:
        """Simulate models that will be evaluated next on several threads, as many as the cache holds."""
        records = map(self.trial_ship.record, models)
        pending = {key: r for r in records if (key := r.tobytes()) not in self._cache}
        chosen = dict(itertools.islice(pending.items(), self._capacity // 2))
        for key, found in zip(chosen, map_threaded(self._predict, chosen.values()), strict=True):
            self._remember(key, found)

    def _remember(self, key: bytes, found: Complex) -> None:
        if len(self._cache) >= self._capacity:
            self._cache.pop(next(iter(self._cache)))
        self._cache[key] = found

    def evaluate(self, effects: tuple[SizedEffect, ...]) -> Fit:
        """Return the fit of effects at their values, with free nominal parameters."""
        return self.evaluate_record(self.trial_ship.record(effects), effects)

    def evaluate_record(self, record: Any, effects: tuple[SizedEffect, ...] = ()) -> Fit:
        """Return the fit of a ship record, with free nominal parameters.

        Args:
            record: record of a ship with or without effects.
            effects: effects in the record.
        """
        difference = self.measured - self.predict(record)
        if is_divergent(difference):
            empty = np.zeros(len(self.nuisance))
            return Fit(effects, -math.inf, difference, empty, self.null.weight)
        found = self.likelihood(difference, self._shares)
        return Fit(effects, found.score, difference, found.shares, found.weight)

    def scale_effect(self, base: Fit, placed: SizedEffect) -> SizedEffect | None:
        """Return an effect at the size that a linear extrapolation gives in addition to a model.

        Probes are widely spaced, and the size in a recording may be far smaller than the smallest probe.

        Args:
            base: the model.
            placed: the effect at a small size.

        Returns:
            The effect; None if no size in the range of the parameter helps.
        """
        parameter = placed.effect.parameters[0]
        neutral = self.trial_ship.neutral(parameter)
        if math.isinf(neutral):
            return None
        moved = self.predict(self.trial_ship.record((*base.effects, placed)))
        column = moved - self.predict(self.trial_ship.record(base.effects))
        if not np.isfinite(column).all():
            return None
        share, _ = self.likelihood.amount(base.weight, base.difference, column)
        low, high = self.trial_ship.range_of(parameter)
        value = float(np.clip(neutral + share * (placed.values[0] - neutral), low, high))
        if abs(value - neutral) <= self.trial_ship.smallest_size(parameter) or (
            value < neutral and not parameter.signed
        ):
            return None
        return placed.with_values((value, *placed.values[1:]))

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
            here = self.predict(self.trial_ship.record(fit.effects))
            moved = [search.effects_at(point + row) for row in LEAST_STEP * np.eye(len(point))]
            self.simulate_ahead(moved)
            columns = np.array([self.predict(self.trial_ship.record(m)) - here for m in moved]) * (
                REACH / LEAST_STEP
            )
            if not np.isfinite(columns).all():
                break
            step, better = REACH * self.project_residual(fit, columns).shares[: len(point)], None
            for share in (1.0, 0.3, 0.1):
                found = self.evaluate(search.effects_at(point + share * step))
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

    def project_residual(self, fit: Fit, columns: Any) -> Marginal:
        """Fit columns, shape (c, balances, frequencies), to the residual of a model.

        Their shares have a standard normal prior, and the nominal parameters are free too.
        """
        start = np.concatenate([np.zeros(len(columns)), fit.tolerances])
        regressors = np.concatenate([columns, self.nuisance])
        return Likelihood(self.bands, regressors)(fit.difference, start)

    def residual(self, fit: Fit) -> Complex:
        """Return the residual of a model with fitted nominal parameters, (balances, frequencies)."""
        return np.asarray(fit.difference - np.einsum("k,kmf->mf", fit.tolerances, self.nuisance))

    def increases_residual(self, fit: Fit) -> bool:
        """Return whether a model increases the residual of a balance far above that without effects.

        Residuals that are nearly proportional have a covariance with a small determinant, and so a high
        likelihood although they are large.
        """
        before, after = (
            np.abs(self.residual(f)) ** 2 @ self.bands.weights for f in (self.null, fit)
        )
        return bool(np.any(after > LOUDER * before))

    def _search(self, fit: Fit, which: list[int] | None, evaluations: int, spread: float) -> Fit:
        search, best = JointSearch(self.trial_ship, fit.effects, which), [fit]

        def loss(point: Any) -> float:
            found = self.evaluate(search.effects_at(point))
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
        """Return the values of every effect with standard errors, with free nominal parameters.

        The errors come from the curvature of the whitened likelihood over steps of one standard error,
        so that nonlinearity within the interval is included.

        Args:
            fit: the model.
            form: additional error of an inexact form, as a share of the size of an effect.
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
        host = self.trial_ship.with_terms(fit.effects)
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


SLOWER_THAN_SEA_HZ = 0.03
"""Frequency [Hz] below which no waves excite a ship."""

MODEL_M, FULL_M = 12.0, 320.0
"""Length [m] below which a hull is a scale model in a basin, and length of the ship to which the limit
belongs. By Froude's law the frequency of waves scales with the inverse square root of the length."""

EXCESS = 2.0
"""Ratio of power to noise power from which a residual is significant; the rms noise has 10 % error."""

CHANCE = 1e-6
DRAWS = 6


@dataclass(frozen=True)
class Colour:
    """Residual that exceeds the noise of the instruments.

    Args:
        band: index of the band with the largest excess.
        balance: index of the balance.
        low_Hz: lower edge of the band.
        high_Hz: upper edge of the band.
        ratio: power of the residual over that of the noise.
    """

    band: int
    balance: int
    low_Hz: float
    high_Hz: float
    ratio: float


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
        channels = balances.nominal
        base = balances.residuals(channels)
        rng = np.random.default_rng(0)
        power = []
        for _ in range(DRAWS):
            noisy = {
                c: _measure(
                    x, noise_rms.get(c, 0.0) * rng.standard_normal(len(x)), rng.random(),
                    (quantisation or {}).get(c, 0.0),
                )
                for c, x in channels.items()
            }  # fmt: skip
            drawn = bands.transform(balances.residuals(noisy) - base)
            power.append(band_products(bands, drawn, drawn).real)
        self._expected = np.mean(power, axis=0)

    def ratios(self, fit: Fit) -> NDArray[np.float64]:
        """Return residual power over noise power, (bands, balances); 0 for bands without a test."""
        bands, balances = self.fitter.bands, self.fitter.balances
        residual = self.fitter.residual(fit)
        found = band_products(bands, residual, residual).real
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.nan_to_num(
                np.diagonal(found, axis1=1, axis2=2)
                / np.diagonal(self._expected, axis1=1, axis2=2),
                posinf=0.0,
            )
        if balances.moving:
            slower = slower_than_waves_hertz(balances.replay.ship)
            ratio[bands.frequency_Hz[bands.edges[1:] - 1] > slower] = 0.0
        return np.asarray(ratio)

    @property
    def _limit(self) -> NDArray[np.float64]:
        """Power ratio from which a band is significant, shape (bands,)."""
        bands = self.fitter.bands
        freedom = 2.0 * np.add.reduceat(bands.weights, bands.edges[:-1])
        return np.asarray(EXCESS * scipy.stats.chi2.isf(CHANCE, freedom) / freedom)

    def coloured_balances(self, fit: Fit) -> list[str]:
        """Return the names of the balances whose residual exceeds the noise."""
        excess = (self.ratios(fit) / self._limit[:, None]).max(axis=0)
        names = self.fitter.balances.names
        return [name for name, most in zip(names, excess, strict=True) if most > 1.0]

    def colour(self, fit: Fit, balance: int | None = None) -> Colour | None:
        """Return the band and balance with the largest excess over the noise; None without an excess.

        Args:
            fit: the model.
            balance: index of the balance to be tested; all balances by default.
        """
        bands = self.fitter.bands
        ratios = self.ratios(fit)
        excess = ratios / self._limit[:, None]
        if balance is not None:
            excess[:, [row for row in range(excess.shape[1]) if row != balance]] = 0.0
        band, row = np.unravel_index(int(np.argmax(excess)), excess.shape)
        if excess[band, row] <= 1.0:
            return None
        edges = bands.edges
        low, high = bands.frequency_Hz[edges[band]], bands.frequency_Hz[edges[band + 1] - 1]
        return Colour(int(band), int(row), float(low), float(high), float(ratios[band, row]))


def slower_than_waves_hertz(ship: Ship) -> float:
    """Return the frequency [Hz] below which no waves excite a ship, from its length if it is known."""
    length = ship.manoeuvring.length_m
    if not 0.0 < length < MODEL_M:
        return SLOWER_THAN_SEA_HZ
    return float(SLOWER_THAN_SEA_HZ * np.sqrt(FULL_M / length))


def _measure(
    values: NDArray[np.float64], noise: NDArray[np.float64], phase: float, step: float
) -> NDArray[np.float64]:
    """Return measured values: with noise, or with quantisation if the step is larger than 0.

    Args:
        values: true values, shape (n,).
        noise: noise, shape (n,).
        phase: position of the grid of steps, 0 to 1; it is random, as a simulation is not exact.
        step: quantisation step; 0 for an instrument without one.
    """
    if step <= 0.0:
        return values + noise
    return np.asarray((np.round(values / step + phase) - phase) * step)
