"""Estimate parameters by output error: the open-loop simulation that fits the recording best.

Recording and simulation are compared by balance under coloured noise, as in a diagnosis
(:mod:`..search.spectra`), so that no channel needs a weight. Parameters that are not free move within
their tolerances. Each Gauss-Newton step is a generalised least-squares problem (Vrijdag & Martelli 2021,
eqs. 16-17, weighted by the covariance of the residual).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...core.statistics import covariance_of
from ..estimate import Tick, ignore_progress
from ..search.fitting import Fit, Fitter, Whiteness
from .free_parameters import Free, UnidentifiableError, refuse_unidentifiable
from .parameters import MethodResult

Array = NDArray[np.float64]

MOST_STEPS = 40
SHARES = (1.0, 0.3, 0.09, 0.027, 0.0081, 0.00243)  # of a Gauss-Newton step, tried in this order
SETTLED = 0.02  # gain in 2 log L below which the search ends
ALIKE = 0.95  # correlation from which the message on a parameter names another one
UNCERTAIN = 1.0  # relative standard error from which a parameter counts as not identifiable
SHORT = 0.25  # standard error by the ship file's value up to which an estimate near 0 is accepted
REACH = 1.0
"""Prior standard deviation of a step as a share of the parameter. The prior is centred on the last
value, so that it damps steps along uncertain directions without bias."""
LEAST_REACH = 30.0  # the same in standard errors, for a parameter near 0


class OutputError:
    """Search for parameters with one fitter of the recordings, in which these parameters are free."""

    def __init__(self, fitter: Fitter, free: Free, tick: Tick = ignore_progress) -> None:
        self.fitter, self.free, self.tick = fitter, free, tick
        self.steps: list[dict[str, float]] = []
        self._sizes = [abs(v) * 1e-3 for v in free.values]
        bands = fitter.bands
        self._counts = np.add.reduceat(bands.weights, bands.edges[:-1])
        # Frequencies of each band less the degrees of freedom of its covariance, shape (bands,).
        self._spare = np.maximum(self._counts - len(fitter.balances.names), 1.0)

    def columns(self, values: Sequence[float], fit: Fit) -> Any:
        """Return derivatives of the simulation, shape (parameters, balances, frequencies).

        The steps are about one standard error with the likelihood of ``fit``, so that they include
        nonlinearity inside the interval.
        """
        here = self.fitter.predict(self.free.record(values))
        found = []
        for i, size in enumerate(self._sizes):
            column, self._sizes[i] = self._column(values, here, i, size, fit)
            found.append(column)
        return np.array(found)

    def slopes(self, values: Sequence[float], fit: Fit) -> Any:
        """Return derivatives over steps so small that the simulation is linear, likewise.

        They show whether only a ratio of two parameters is identifiable.
        """
        moved = (np.asarray(values) + step for step in np.diag(1e-5 * np.asarray(values)))
        records = [self.free.record(list(there)) for there in (values, *moved)]
        predictions = self.fitter.predictions(records)
        here, found = next(predictions), []
        for i, (value, prediction) in enumerate(zip(values, predictions, strict=True)):
            column = prediction - here
            if np.isfinite(column).all() and column.any():
                found.append(column / (1e-5 * value))
            else:  # the parameter is 0 or has no influence over so small a step
                found.append(self._column(values, here, i, self._sizes[i], fit)[0])
        return np.array(found)

    def _column(
        self, values: Sequence[float], here: Any, i: int, size: float, fit: Fit
    ) -> tuple[Any, float]:
        number = self.free.numbers[i]
        size = size or 1e-9
        for _ in range(40):
            step = size if values[i] + size < number.info.high else -size
            moved = [*values]
            moved[i] += step
            column = (self.fitter.predict(self.free.record(moved)) - here) / step
            if not np.isfinite(column).all():
                size *= 0.1
                continue
            told = float(self.fitter.likelihood.information(fit.weight, column[None])[0, 0])
            error = told**-0.5 if told > 0.0 else math.inf
            most = 0.1 * abs(values[i]) or math.inf
            if size >= 0.01 * min(error, most):
                return column, float(np.clip(error, 1e-5 * abs(values[i]), most))
            size = min(max(10.0 * size, 0.1 * min(error, 1e3 * size)), most)
        return column, size

    def search(self, start: Sequence[float] | None = None) -> tuple[list[float], Fit]:
        """Return the values with the largest 2 log L, and the fit there.

        Args:
            start: start of the search; the values of the ship by default.
        """
        values = list(self.free.values if start is None else start)
        fit = self._fit(values)
        self._note(values, fit)
        for count in range(MOST_STEPS):
            self.tick("estimating the parameters", count, MOST_STEPS)
            columns = self.columns(values, fit)
            if count == 0:
                # The tolerances of the other parameters are included.
                likelihood, slopes = self.fitter.likelihood, self.slopes(values, fit)
                information = likelihood.information(self._weight(fit), slopes)
                refuse_unidentifiable(self.free.keys, information)
            step, score = self._step(values, fit, columns), fit.score
            for share in SHARES:
                trial = self.free.towards(values, list(np.asarray(values) + share * step))
                found = self._fit(trial)
                if found.score > score:
                    values, fit = trial, found
                    self._note(values, fit)
                    break
            if fit.score - score < SETTLED:
                break
        self.tick("estimating the parameters", MOST_STEPS, MOST_STEPS)
        return values, fit

    def _fit(self, values: Sequence[float]) -> Fit:
        return self.fitter.evaluate_record(self.free.record(values))

    def _step(self, values: Sequence[float], fit: Fit, columns: Any) -> Array:
        """Return the Gauss-Newton step, weighted by the covariance of the residual after it."""
        reach = np.maximum(REACH * np.abs(values), LEAST_REACH * np.array(self._sizes))
        found = self.fitter.project_residual(fit, columns * reach[:, None, None])
        return np.asarray(found.shares[: len(reach)] * reach)

    def _weight(self, fit: Fit) -> Any:
        """Return the inverse covariances, reduced for their estimation from the residual.

        The inverse of a band's covariance, estimated from n frequencies for m balances, is too large by
        n / (n - m) on average (complex Wishart distribution; Brillinger 1981, section 4.2). The use of
        an estimated weight has the same cost again.
        """
        return fit.weight * ((self._spare / self._counts) ** 2)[:, None, None]

    def estimates(self, values: Sequence[float], fit: Fit) -> MethodResult:
        """Return the estimates with their covariance, and jointly with the parameters with tolerances.

        The degrees of freedom of each variance are those of the bands by their shares in it
        (Satterthwaite 1946). Tolerances count as known exactly.
        """
        columns = self.columns(values, fit)  # the first call adapts the steps to these values
        columns = self.columns(values, fit)
        count, weight = len(columns), self._weight(fit)
        by_band = self.fitter.likelihood.information_by_band(weight, columns)
        information = self.fitter.likelihood.information(weight, columns)
        covariance = covariance_of(information)
        own = covariance[:count]
        told = np.einsum("ik,bkl,il->ib", own, by_band, own)
        shares = told / np.maximum(np.diag(own), 1e-300)[:, None]
        freedom = 1.0 / np.maximum(np.sum(shares**2 / (2.0 * self._spare), axis=1), 1e-12)
        table = {"search": pd.DataFrame(self.steps)}
        return MethodResult(
            self.free.keys,
            tuple(values),
            own[:, :count],
            table,
            score=fit.score,
            freedom=freedom,
            joint=self._joint(values, fit, covariance),
        )

    def _joint(self, values: Sequence[float], fit: Fit, covariance: Array) -> MethodResult:
        """Return the estimates of the free parameters and of those that moved within tolerances."""
        count, moves = len(values), self.fitter.moves
        keys = [*dict.fromkeys(key for move in moves for key, one in move.numbers.items() if one)]
        # Some regressors change the first state and no parameter.
        change = np.zeros((count + len(keys), len(covariance)))
        change[:count, :count] = np.eye(count)
        for k, move in enumerate(moves):
            change[count:, count + k] = [move.numbers.get(key, 0.0) for key in keys]
        shares = np.concatenate([np.zeros(count), fit.tolerances])
        found = [*values]
        for key, shift in zip(keys, (change @ shares)[count:], strict=True):
            number = self.free.ship.parameter(key)
            found.append(number.clipped(number.value + float(shift)))
        return MethodResult((*self.free.keys, *keys), tuple(found), change @ covariance @ change.T)

    def _note(self, values: Sequence[float], fit: Fit) -> None:
        self.steps.append(
            {"2logL": fit.score} | dict(zip(self.free.keys, map(float, values), strict=True))
        )


def output_error(
    fitter: Fitter, free: Free, tick: Tick = ignore_progress, start: Sequence[float] | None = None
) -> MethodResult:
    """Estimate parameters by output error, by default from the values of the ship.

    Raises:
        UnidentifiableError: parameters of which only a ratio or a product is identifiable; names them.
    """
    search = OutputError(fitter, free, tick)
    values, fit = search.search(start)
    found = search.estimates(values, fit)
    colour = Whiteness(fitter, fitter.balances.replay.noise_rms).colour(fit)
    remarks: tuple[str, ...] = ()
    if colour is not None:
        name = fitter.balances.names[colour.balance]
        times = f"{colour.ratio:.3g}" if colour.ratio < 1e4 else "more than 10 000"
        remarks = (
            f"the residual of the {name} balance is not noise: its power is {times} times that of the "
            f"instruments' noise at {colour.low_Hz:.3g} to {colour.high_Hz:.3g} Hz; physics is missing, "
            "and the parameters may have absorbed it",
        )
    return replace(found, remarks=remarks)


def refuse_uncertain(found: MethodResult, free: Free) -> None:
    """Refuse a parameter about which the recording contains almost no information.

    An interval about 0 is accepted for a parameter that is absent at 0, such as an offset or a friction,
    and so is an interval that is short compared with the ship file's value in ``free``.

    Raises:
        UnidentifiableError: names the parameter.
    """
    rows = zip(free.numbers, found.values, found.standard_errors, found.correlation, strict=True)
    for number, value, error, correlation in rows:
        size = max(abs(value) * UNCERTAIN, abs(number.value) * SHORT)
        if number.info.neutral is None and error > size:
            pairs = zip(free.keys, correlation, strict=True)
            alike = [key for key, one in pairs if abs(one) > ALIKE and key != number.key]
            why = f"distinguish it from {' and '.join(alike)}" if alike else "excite it"
            message = (
                f"{number.key} is not identifiable: the recording does not {why} (estimate {value:.4g}, "
                f"standard error {error:.2g})"
            )
            raise UnidentifiableError(message, [number.key], free.keys)
