"""Output error: the numbers at which the ship's own simulation comes nearest to the recording.

The measure is the diagnosis's: recording and open-loop simulation are compared balance by balance under
noise of unknown colour (:mod:`..search.spectra`), so no instrument needs a weight, and the numbers that
are not free move inside their tolerances. Minimised by Gauss-Newton steps, each a generalised least
squares problem (Vrijdag & Martelli 2021, eqs. 16-17, with the residual's own covariance as the weight).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..estimate import Tick, silent
from ..search.fitting import Fit, Fitter
from ..search.whiteness import Whiteness
from .free_parameters import Free, UntoldError, refuse_unidentifiable
from .results import Found

MOST_STEPS = 40
SETTLED = 0.02
"""Gain in 2 log L below which the search ends."""

ALIKE = 0.95
"""Correlation from which on a number that was not found is told with those that take its place."""

UNTOLD = 1.0
"""Standard error, as a share of a number, from which on it was not found."""

SHORT = 0.25
"""The same as a share of what the ship's file states: a number that has come out near 0 was found where
its error is shorter than that."""

REACH = 1.0
"""Standard deviation that a step is given beforehand, as a share of the number: it damps the step where
the recording says little, and draws to nothing, being about the last value."""

LEAST_REACH = 30.0
"""The same in standard errors, for a number at or near 0."""


class OutputError:
    """The search for some numbers on one fitter.

    Args:
        fitter: of the recordings, with these numbers free.
        free: the numbers.
        tick: told how far the search is.
    """

    def __init__(self, fitter: Fitter, free: Free, tick: Tick = silent) -> None:
        self.fitter = fitter
        self.free = free
        self.tick = tick
        self.steps: list[dict[str, float]] = []
        self._sizes = [abs(v) * 1e-3 for v in free.values]

    def scored(self, values: Sequence[float]) -> Fit:
        """What the recording says of some values."""
        return self.fitter.scored(self.free.record(values))

    def columns(self, values: Sequence[float], fit: Fit) -> Any:
        """Derivative of the simulation by each number, shape (numbers, balances, frequencies).

        Over steps of about one standard error, as the likelihood of ``fit`` has it, so that a bend or
        a corner inside the interval is felt.
        """
        here = self.fitter.predicted(self.free.record(values))
        found = []
        for i, size in enumerate(self._sizes):
            column, size = self._column(values, here, i, size, fit)
            found.append(column)
            self._sizes[i] = size
        return np.array(found)

    def slopes(self, values: Sequence[float], fit: Fit) -> Any:
        """The same over steps so small that nothing bends: what tells a ratio from two numbers."""
        here = self.fitter.predicted(self.free.record(values))
        found = []
        for i, value in enumerate(values):
            moved = [*values]
            moved[i] += 1e-5 * value
            column = self.fitter.predicted(self.free.record(moved)) - here
            if np.isfinite(column).all() and column.any():
                found.append(column / (1e-5 * value))
            else:  # it has a dead zone here, or is at 0
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
            column = (self.fitter.predicted(self.free.record(moved)) - here) / step
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
        """The numbers at which 2 log L is highest, and what is left there.

        Args:
            start: of the search; the ship's own by default.
        """
        values = list(self.free.values if start is None else start)
        fit = self.scored(values)
        self._note(values, fit)
        for count in range(MOST_STEPS):
            self.tick("searching the numbers", count, MOST_STEPS)
            columns = self.columns(values, fit)
            if count == 0:
                refuse_unidentifiable(
                    self.free.keys, self._information(fit, self.slopes(values, fit))
                )
            step = self._step(values, fit, columns)
            share, better = 1.0, None
            while share > 1e-3:
                trial = self.free.towards(values, list(np.asarray(values) + share * step))
                found = self.scored(trial)
                if found.score > fit.score:
                    better = (trial, found)
                    break
                share *= 0.3
            if better is None:
                break
            gain = better[1].score - fit.score
            values, fit = better
            self._note(values, fit)
            if gain < SETTLED:
                break
        self.tick("searching the numbers", MOST_STEPS, MOST_STEPS)
        return values, fit

    def _step(self, values: Sequence[float], fit: Fit, columns: Any) -> NDArray[np.float64]:
        """The Gauss-Newton step, the covariance of what is left after it being its weight."""
        reach = np.maximum(REACH * np.abs(values), LEAST_REACH * np.array(self._sizes))
        found = self.fitter.beside(fit, columns * reach[:, None, None])
        return np.asarray(found.shares[: len(reach)] * reach)

    def _information(self, fit: Fit, columns: Any) -> NDArray[np.float64]:
        """Of the numbers and the tolerances together."""
        return self.fitter.likelihood.information(self._weight(fit), columns)

    @functools.cached_property
    def _spare(self) -> NDArray[np.float64]:
        """Frequencies of each band beyond those that its covariance takes up, shape (bands,)."""
        balances = len(self.fitter.balances.names)
        return np.asarray(np.maximum(self._counts - balances, 1.0))

    @functools.cached_property
    def _counts(self) -> NDArray[np.float64]:
        bands = self.fitter.bands
        return np.asarray(np.add.reduceat(bands.weights, bands.edges[:-1]))

    def _weight(self, fit: Fit) -> Any:
        """The inverse covariances, made smaller by what estimating them costs.

        A band's covariance is estimated from what is left itself. From n frequencies and for m
        balances its inverse comes out too large by n / (n - m) on average (a complex Wishart
        variable; Brillinger 1981, section 4.2), and weighing with an estimate costs as much again.
        """
        return fit.weight * ((self._spare / self._counts) ** 2)[:, None, None]

    def covariance(
        self, values: Sequence[float], fit: Fit
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the covariance of the numbers' errors, and from how much data it is known.

        The tolerances of the other numbers are included.

        Returns:
            The covariance, shape (n, n), and the degrees of freedom of each variance, shape (n,): those
            of the bands by their shares in it (Satterthwaite 1946). What a tolerance adds is known.
        """
        columns = self.columns(values, fit)  # twice: the steps are then those of this place
        columns = self.columns(values, fit)
        count, weight = len(columns), self._weight(fit)
        by_band = self.fitter.likelihood.information_by_band(weight, columns)
        information = self.fitter.likelihood.information(weight, columns)
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        inverse = np.linalg.pinv(information / np.outer(scale, scale), hermitian=True)
        inverse = np.asarray(inverse / np.outer(scale, scale))[:count]
        told = np.einsum("ik,bkl,il->ib", inverse, by_band, inverse)
        shares = told / np.maximum(np.diag(inverse), 1e-300)[:, None]
        freedom = 1.0 / np.maximum(np.sum(shares**2 / (2.0 * self._spare), axis=1), 1e-12)
        return inverse[:, :count], freedom

    def _note(self, values: Sequence[float], fit: Fit) -> None:
        self.steps.append(
            {"2logL": fit.score} | dict(zip(self.free.keys, map(float, values), strict=True))
        )


def output_error(
    fitter: Fitter, free: Free, tick: Tick = silent, start: Sequence[float] | None = None
) -> Found:
    """Numbers by output error.

    Args:
        fitter: of the recordings, with these numbers free.
        free: the numbers.
        tick: told how far the search is.
        start: of the search; the ship's own by default.

    Raises:
        UntoldError: numbers of which the recording only tells a ratio or a product; names them.
    """
    search = OutputError(fitter, free, tick)
    values, fit = search.search(start)
    covariance, freedom = search.covariance(values, fit)
    colour = Whiteness(fitter, fitter.balances.replay.noise_rms).colour(fit)
    remarks: tuple[str, ...] = ()
    if colour is not None:
        name = fitter.balances.names[colour.balance]
        told = f"{colour.ratio:.3g}" if colour.ratio < 1e4 else "more than 10 000"
        remarks = (
            f"what is left in the {name} balance is not noise: {told} times the "
            f"instruments' power at {colour.low_Hz:.3g} to {colour.high_Hz:.3g} Hz; some physics is "
            "missing, and the numbers may have taken its place",
        )
    return Found(
        free.keys,
        tuple(values),
        covariance,
        {"search": pd.DataFrame(search.steps)},
        remarks,
        fit.score,
        freedom=freedom,
    )


def refuse_untold(found: Found, free: Free) -> None:
    """Refuse a number of which the recording says next to nothing.

    Of one whose absence is 0, as an offset's or a friction's, an interval about 0 says something; and so
    does one that is short against what the ship's file states.

    Args:
        found: the numbers.
        free: the same as the ship's file has them.

    Raises:
        UntoldError: names it.
    """
    told = zip(free.numbers, found.values, found.standard_errors, found.correlation, strict=True)
    for number, value, error, correlation in told:
        size = max(abs(value) * UNTOLD, abs(number.value) * SHORT)
        if number.info.neutral is None and error > size:
            alike = [
                key
                for key, one in zip(free.keys, correlation, strict=True)
                if abs(one) > ALIKE and key != number.key
            ]
            why = f"tell it from {' and '.join(alike)}" if alike else "excite it"
            raise UntoldError(
                f"{number.key} cannot be found: the recording does not {why} (found {value:.4g}, "
                f"standard error {error:.2g})",
                [number.key], free.keys,
            )  # fmt: skip
