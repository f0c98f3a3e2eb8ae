"""Expected evidence of a manoeuvre between models, and the intervals of their parameters after it.

Each model predicts the measurements of a manoeuvre. The expected evidence against model j if model i is
true is

    lambda_ij = min over x of |W (y_i - y_j(x))|^2 + |x|^2,

with W the whitening by the noise of the instruments and x the changes of what model j may fit to the new
recording, in prior standard deviations: the parameters within the tolerances of the ship file, the first
state, and the parameters of its own effects. It is the expected difference in 2 log L (T-optimality,
Atkinson and Fedorov 1975, Biometrika 62(1); Box and Hill 1967, Technometrics 9(1)). The predictions are
linear in x here, so that

    lambda_ij = a - b' (C + I)^-1 b,   a = |W d|^2,  b = (W J)' W d,  C = (W J)' W J,

where d = y_i - y_j and J the derivatives by x. The models are small changes of one ship, so that their
derivatives by tolerances and first state are those of the first model. All sums are entries of one
matrix of inner products, which is a sum over manoeuvres.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import MEASURED
from ...plant.ship import Ship, ShipError
from ..simulate.balances import tolerance_perturbations
from ..simulate.joint_replay import NO_SHIFT, JointReplay
from .manoeuvres import INTERVAL_S, Floats

STEP = 0.02
"""Step of the derivatives, in prior standard deviations."""


class Noise(NamedTuple):
    """Difference between measurement and simulation of a channel that no model explains."""

    sd: float
    """Standard deviation, in the unit of the channel."""
    time_s: float = 0.0
    """Correlation time [s]; 0 for white noise."""


@dataclass(frozen=True)
class Predictions:
    """Predictions of models for a table of commands, with their derivatives by unknowns.

    The derivatives are by unknowns of unit prior variance.

    Args:
        own: predictions, shape (models, channels, rows).
        shared: derivatives by tolerances and first state, shape (unknowns, channels, rows).
        starts: whether each shared unknown is a shift of the first state, which a later manoeuvre has
            anew, shape (unknowns,).
        effects: derivatives by the parameters of the models' own effects, shape (effects, channels,
            rows).
        owners: index of the model of each effect, shape (effects,).
    """

    own: Floats
    shared: Floats
    starts: NDArray[np.bool_]
    effects: Floats
    owners: NDArray[np.int64]

    def of_channels(self, which: Sequence[int]) -> Predictions:
        """Return the predictions of some channels."""
        chosen = [*which]
        parts = (values[:, chosen] for values in (self.own, self.shared, self.effects))
        own, shared, effects = parts
        return Predictions(own, shared, self.starts, effects, self.owners)


class Predictor:
    """Simulations of models for tables of commands, and their derivatives.

    Args:
        models: ships by the names of the models.
        sizes: parameters of each model's own effects by dotted key, with prior standard deviations.
        channels: predicted channels.
    """

    def __init__(
        self,
        models: Mapping[str, Ship],
        sizes: Mapping[str, Mapping[str, float]],
        channels: Sequence[str],
    ) -> None:
        self.models = models
        self.channels = tuple(channels)
        self._records = [ship.record() for ship in models.values()]
        self._effects = [
            (k, *changed)
            for k, (name, ship) in enumerate(models.items())
            for changed in changed_effects(ship, sizes[name])
        ]
        self._owners = np.array([k for k, *_ in self._effects], dtype=np.int64)
        self._tolerances: list[tuple[Any, tuple[float, ...], float]] | None = None

    def keys_of(self, model: int) -> list[str]:
        """Return the keys of a model's own effects, in the order of :meth:`Evidence.covariance`."""
        return [key for k, key, *_ in self._effects if k == model]

    def simulate(self, table: pd.DataFrame) -> Iterator[tuple[JointReplay, Any]]:
        """Yield the replay of a table of commands by each model, and its samples."""
        for ship, record in zip(self.models.values(), self._records, strict=True):
            replay = JointReplay(ship, table)
            yield replay, replay.simulate(record)

    def differentiate(self, simulated: Sequence[tuple[JointReplay, Any]]) -> Predictions:
        """Return the predictions of which ``simulated`` are the simulations, with derivatives."""
        own = np.array([self._measured(samples) for _, samples in simulated])

        def slope(k: int, record: Any, shift: tuple[float, ...], share: float) -> Floats:
            changed = self._measured(simulated[k][0].simulate(record, shift))
            return np.asarray((changed - own[k]) / share)

        tolerances = self._tolerance_changes(simulated[0][0])
        shared = [slope(0, *change) for change in tolerances]
        effects = [slope(k, record, NO_SHIFT, share) for k, _, record, share in self._effects]
        shape = (-1, *own.shape[1:])
        starts = np.array([any(shift) for _, shift, _ in tolerances], dtype=bool)
        return Predictions(
            own, np.reshape(shared, shape), starts, np.reshape(effects, shape), self._owners
        )

    def __call__(self, table: pd.DataFrame) -> Predictions:
        """Return what all models predict for a table of commands."""
        return self.differentiate([*self.simulate(table)])

    def _measured(self, samples: Any) -> Floats:
        return np.array([samples[MEASURED[c]] for c in self.channels])

    def _tolerance_changes(self, replay: JointReplay) -> list[tuple[Any, tuple[float, ...], float]]:
        if self._tolerances is None:
            self._tolerances = [
                (one.record, one.start, one.share) for one in tolerance_perturbations(replay)
            ]
        return self._tolerances


def changed_effects(ship: Ship, sizes: Mapping[str, float]) -> Iterator[tuple[str, Any, float]]:
    """Yield keys, records with this parameter changed, and the change in standard deviations."""
    for key, sd in sizes.items():
        with contextlib.suppress(ShipError):  # a key without influence on this ship
            number = ship.parameter(key)
            low, high = number.search_range
            for step in (STEP, -STEP):
                if low <= number.value + step * sd <= high:
                    record = ship.record()
                    number.write(record, number.value + step * sd)
                    yield key, record, step
                    break


def whiten(values: Floats, noise: Sequence[Noise]) -> Floats:
    """Return values (..., channels, rows) whitened by the noise of each channel, one row less."""
    parts = []
    for k, one in enumerate(noise):
        channel = values[..., k, :]
        keeps = math.exp(-INTERVAL_S / one.time_s) if one.time_s > 0.0 else 0.0
        white = (channel[..., 1:] - keeps * channel[..., :-1]) / (
            one.sd * math.sqrt(1.0 - keeps**2)
        )
        parts.append(white)
    return np.stack(parts, axis=-2)


@dataclass(frozen=True)
class Evidence:
    """Inner products of whitened predictions and derivatives, after the first state was fitted.

    Args:
        products: inner products of tolerances, effects and models (these minus the first model), in
            this order, shape (n, n).
        owners: index of the model of each effect, shape (effects,).
        models: number of models.
    """

    products: Floats
    owners: NDArray[np.int64]
    models: int

    def plus(self, other: Evidence) -> Evidence:
        """Return the evidence of two manoeuvres."""
        return Evidence(self.products + other.products, self.owners, self.models)

    @property
    def _tolerances(self) -> int:
        return len(self.products) - self.models - len(self.owners)

    def _unknowns_of(self, model: int) -> NDArray[np.int64]:
        own = self._tolerances + np.flatnonzero(self.owners == model)
        return np.concatenate([np.arange(self._tolerances), own])

    def against(self) -> Floats:
        """Return lambda of each true model (row) against each rival (column), shape (models, models)."""
        found = np.zeros((self.models, self.models))
        first = len(self.products) - self.models
        between = self.products[first:, first:]
        squares = np.diag(between)
        for rival in range(self.models):
            own = self._unknowns_of(rival)
            across = self.products[np.ix_(own, np.arange(first, first + self.models))]
            across = across - across[:, [rival]]
            inner = self.products[np.ix_(own, own)] + np.eye(len(own))
            apart = squares - 2.0 * between[:, rival] + squares[rival]
            found[:, rival] = apart - np.sum(across * np.linalg.solve(inner, across), axis=0)
        return np.maximum(found, 0.0)

    def pairs(self) -> Floats:
        """Return lambda of each pair, the smaller one of the two that may be true, shape (pairs,).

        The pairs are in the order of :func:`itertools.combinations`.
        """
        against = self.against()
        either = np.minimum(against, against.T)
        return np.asarray(either[np.triu_indices(self.models, 1)])

    def covariance(self, model: int = 0) -> Floats:
        """Return the covariance of a model's own parameters after the trial, in prior variances."""
        unknowns = self._unknowns_of(model)
        inner = self.products[np.ix_(unknowns, unknowns)] + np.eye(len(unknowns))
        own = slice(self._tolerances, None)
        return np.asarray(np.linalg.inv(inner)[own, own])

    def merit(self) -> float:
        """Return the figure that a programme should make as large as possible.

        Of one model it is the D-criterion, the logarithm of the determinant of the information on its
        own parameters. Of several it is minus the logarithm of the sum over all pairs of the
        probability that noise makes the wrong model of a pair likelier, Phi(-sqrt(lambda) / 2): an upper
        bound of the probability of a wrong choice. The pair that is hardest to decide has the largest
        probability, and a pair that no manoeuvre decides does not hide the others.
        """
        if self.models == 1:
            return float(-np.linalg.slogdet(self.covariance())[1])
        wrong = scipy.special.log_ndtr(-0.5 * np.sqrt(self.pairs()))
        return float(-scipy.special.logsumexp(wrong))


def evidence_over_time(
    predictions: Predictions, noise: Sequence[Noise], rows: int
) -> Iterator[Evidence]:
    """Yield the evidence after each further block of rows, the last one after all rows.

    Args:
        predictions: predictions of a manoeuvre or of a programme.
        noise: noise of each channel.
        rows: rows of a block.
    """
    starts = predictions.starts
    stacked = (
        predictions.shared[starts],
        predictions.shared[~starts],
        predictions.effects,
        predictions.own - predictions.own[0],
    )
    white = whiten(np.concatenate(stacked), noise)
    total, count = np.zeros((len(white), len(white))), int(starts.sum())
    for begin in range(0, white.shape[-1], rows):
        block = white[..., begin : begin + rows].reshape(len(white), -1)
        total = total + block @ block.T
        rest, first = total[count:, count:], total[:count, :count] + np.eye(count)
        across = total[:count, count:]
        products = rest - across.T @ np.linalg.solve(first, across)
        yield Evidence(products, predictions.owners, len(predictions.own))


def evidence_of(predictions: Predictions, noise: Sequence[Noise]) -> Evidence:
    """Return the evidence of a whole manoeuvre."""
    rows = predictions.own.shape[-1]
    (found,) = evidence_over_time(predictions, noise, rows)
    return found


def pair_names(models: Sequence[str]) -> list[tuple[str, str]]:
    """Return the names of all pairs of models, in the order of :meth:`Evidence.pairs`."""
    return list(itertools.combinations(models, 2))
