"""Select effects of the catalogue: screen all, fit the best, add forward and drop backward.

The time windows of an effect that acts for a time are proposed by linear least squares.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...core.statistics import log_chance_above
from ..estimate import Tick
from ..simulate.joint_replay import map_threaded
from .catalogue import Effect, SizedEffect, Window
from .fitting import Fit, Fitter
from .spectra import SMALL_SAMPLE, Complex, Likelihood, chance_gain

MOST_EFFECTS, MORE_TURNING = 3, 2
"""Largest number of effects in a search; more for a ship that turns, which has two more balances."""

REFINED, FORMS = 5, 2
"""Number of the best effects of a screen that are refined by output error, and of forms of each."""

RISK = 0.01
"""Probability that one of the effects of the catalogue passes its threshold by chance."""

LEAST_PROMISE, AGAIN = 0.3, 0.1
"""Shares of its threshold and of the best gain that an effect must reach by linear prediction to be
tried in addition to other effects; LEAST_PROMISE times its threshold is also needed for a refinement."""

FREE = 10.0
"""Prior standard deviation of other effects' values, in their values, while a further one is tried."""

NEAR_GAIN = 0.25
"""Share of the best gain from which a candidate is refined."""

INDISTINGUISHABLE = 6.0
"""Difference of 2 log L below which two effects are indistinguishable (odds of about 20 to 1)."""

NEAR_SHARE = 0.01
"""Share of a gain by which the true effect may fit worse than another because its form is inexact."""

PIECES = 24
"""Number of equal pieces of a recording; windows begin and end at their edges."""

LEAST_POWER = 1e-3
"""Power of a piece, as a share of the largest, below which none of its rows is fitted."""

STRETCHES = PIECES * (PIECES + 1) // 2 - 1
"""Number of windows that are scanned: all except the whole recording."""

MOST_WINDOWS = 4

ALIKE = 0.6
"""Overlap of two windows, as a share of their union, from which only the better one is kept."""

LEAST_GAIN = 9.0
"""Smallest gain in 2 log L of a window that is tried; chance reaches smaller gains."""


@dataclass(frozen=True)
class Candidate:
    """Effect that was tried in addition to a model."""

    effect: Effect
    fit: Fit  # model with this effect as the last one; without difference unless it was refined
    gain: float  # gain in 2 log L

    @property
    def sized_effect(self) -> SizedEffect:
        """Effect with its fitted values."""
        return self.fit.effects[-1]


@dataclass(frozen=True)
class Selection:
    """Result of the search."""

    fit: Fit  # the model with the selected effects, in the order of their selection
    gains: tuple[float, ...]  # gain of each effect with all others present, in 2 log L
    thresholds: tuple[float, ...]  # threshold of each gain
    rivals: tuple[tuple[Candidate, ...], ...]  # alternatives of each effect, best first
    ranking: tuple[Candidate, ...]  # the first screen of the whole catalogue, best first


class Selector:
    """Forward and backward selection of effects.

    Args:
        fitter: fitter of the recording.
        effects: candidate effects.
        tick: progress callback with stage, completed and total number of steps.
        most: largest number of effects; by default :data:`MOST_EFFECTS`, and :data:`MORE_TURNING` more
            for a ship that turns.
    """

    def __init__(
        self, fitter: Fitter, effects: list[Effect], tick: Tick, most: int | None = None
    ) -> None:
        self.fitter = fitter
        self.effects = effects
        self.windows: list[Window] = []  # time windows [s] that are tried for windowed effects
        self.tick = tick
        usual = MOST_EFFECTS + MORE_TURNING * fitter.trial_ship.ship.turns
        self.most = usual if most is None else most
        self._changes: dict[str, list[Complex]] = {}  # by each effect alone, by label

    def threshold(self, effect: Effect) -> float:
        """Return the gain that an effect must exceed."""
        return threshold(effect, len(self.effects))

    def screen(self, base: Fit, stage: str) -> list[Candidate]:
        """Return the effects at their best probes in addition to a model, best first.

        Without effects in the model all candidates are simulated; else those with a sufficient linear
        prediction of their gain. They are tried on several threads; their fits have no difference.
        """
        if any(effect.windowed for effect in self.effects):
            self.windows = find_episodes(self.fitter, base)
        predicted = self._predicted_gains(base) if base.effects else {}
        pending = [e for e in self.effects if not base.effects or e.label in predicted]

        def best_trial(effect: Effect) -> Candidate | None:
            # The scaled trials are computed from the simulations of the probes.
            parts = self.fitter.trial_ship.trials(effect, self.windows), self._scaled(base, effect)
            models = (((*base.effects, trial) for trial in trials) for trials in parts)
            fits = itertools.chain.from_iterable(map(self.fitter.evaluate_models, models))
            best = max(fits, key=_score, default=None)
            if not base.effects:
                self._alone(effect)  # The simulations that it needs are still in the cache.
            if best is None or not math.isfinite(best.score):
                return None
            least = predicted.get(effect.label, 0.0) - INDISTINGUISHABLE
            if base.effects and best.score - base.score < least:
                best = self.fitter.polish(best)  # The other effects must be refitted first.
            return Candidate(effect, best.without_difference(), best.score - base.score)

        self.tick(stage, 0, len(pending))
        candidates = []
        for done, candidate in enumerate(map_threaded(best_trial, pending), 1):
            self.tick(stage, done, len(pending))
            candidates += [] if candidate is None else [candidate]
        return sorted(candidates, key=self._merit, reverse=True)

    def _alone(self, effect: Effect) -> list[Complex]:
        """Return the changes by the smallest probes of an effect without other effects, transformed."""
        if effect.label not in self._changes or effect.windowed:
            trial_ship = self.fitter.trial_ship
            trials = trial_ship.smallest_trials(effect, self.windows)
            records = [trial_ship.record((trial,)) for trial in trials]
            predictions = self.fitter.predictions([trial_ship.nominal, *records])
            nothing = next(predictions)
            changes = [prediction - nothing for prediction in predictions]
            self._changes[effect.label] = [
                c.astype(np.complex64) for c in changes if np.isfinite(c).all()
            ]
        return self._changes[effect.label]

    def _predicted_gains(self, base: Fit) -> dict[str, float]:
        """Return the predicted gains of effects that the model does not have, by label, if sufficient.

        The change by an effect is assumed to be linear in its size and independent of the effects of the
        model, whose values are free.
        """
        beside = likelihood_with_free_effects(self.fitter, base)
        kinds = {sized.effect.kind for sized in base.effects}
        gains: dict[str, float] = {}
        limits = {}
        for effect in (e for e in self.effects if e.kind not in kinds):
            amounts = [beside.amount(base.weight, base.difference, c) for c in self._alone(effect)]
            gains[effect.label] = max((gain for _, gain in amounts), default=0.0)
            limits[effect.label] = LEAST_PROMISE * self.threshold(effect)
        least = AGAIN * max(gains.values(), default=0.0)
        return {label: gain for label, gain in gains.items() if gain > max(least, limits[label])}

    def _to_refine(self, screened: list[Candidate]) -> list[Candidate]:
        """Return the best candidates of a screen and those confusable with the best one."""
        forms: dict[tuple[str, str], list[Candidate]] = {}
        for candidate in screened:
            best = screened[0]
            near = candidate.gain > NEAR_GAIN * best.gain
            if candidate.gain > 1.0 and (near or are_confusable(candidate.effect, best.effect)):
                forms.setdefault(candidate.effect.kind, []).append(candidate)
        return [c for own in [*forms.values()][:REFINED] for c in own[:FORMS]]

    def _scaled(self, base: Fit, effect: Effect) -> Iterator[SizedEffect]:
        """Yield an effect at the sizes that a linear extrapolation from its probes gives."""
        for small in self.fitter.trial_ship.smallest_trials(effect, self.windows):
            if (scaled := self.fitter.scale_effect(base, small)) is not None:
                yield scaled

    def _merit(self, candidate: Candidate) -> float:
        return candidate.gain - self.threshold(candidate.effect)

    def refine(self, base: Fit, candidates: list[Candidate]) -> list[Candidate]:
        """Return the best candidates of a screen with fitted values, best first."""
        if base.effects:
            limits = [LEAST_PROMISE * self.threshold(c.effect) for c in candidates]
            candidates = [c for c, least in zip(candidates, limits, strict=True) if c.gain > least]

        def refined(candidate: Candidate) -> Candidate | None:
            fit = self.fitter.evaluate(candidate.fit.effects)
            fit = self.fitter.refine_effect(fit, len(fit.effects) - 1)
            if len(candidate.effect.parameters) > 1:
                fit = self.fitter.polish(fit)
            if self.fitter.increases_residual(fit):
                return None
            return Candidate(candidate.effect, fit, fit.score - base.score)

        found = map_threaded(refined, self._to_refine(candidates))
        return sorted((c for c in found if c is not None), key=self._merit, reverse=True)

    def search(self) -> Selection:
        """Add effects up to the largest number, and drop superfluous effects after each step."""
        base = self.fitter.null
        ranking: tuple[Candidate, ...] = ()
        rivals: dict[str, tuple[Candidate, ...]] = {}
        for round_ in range(self.most):
            screened = self.screen(base, f"screening the catalogue, round {round_ + 1}")
            refined = self.refine(base, screened)
            if round_ == 0:
                names = {c.effect.label for c in refined}
                rest = [c for c in screened if c.effect.label not in names]
                ranked = sorted([*refined, *rest], key=lambda c: -c.gain)
                ranking = tuple(replace(c, fit=c.fit.without_difference()) for c in ranked)
            if not refined or self._merit(refined[0]) <= 0.0:
                break
            rivals[refined[0].effect.label] = tuple(refined[1:])
            base = self._drop_superfluous(self.fitter.refine_effects(refined[0].fit))
        self._changes.clear()  # They are needed by screens only.
        effects = [sized.effect for sized in base.effects]
        gains = tuple(base.score - self._without(base, i).score for i in range(len(effects)))
        thresholds = tuple(map(self.threshold, effects))
        own_rivals = tuple(rivals.get(effect.label, ()) for effect in effects)
        return Selection(base, gains, thresholds, own_rivals, ranking)

    def _without(self, fit: Fit, index: int) -> Fit:
        """Return the model without one effect, with the others refitted."""
        rest = fit.effects[:index] + fit.effects[index + 1 :]
        reduced = self.fitter.evaluate(rest)
        if not rest:
            return reduced
        if len(rest) == 1:
            return self.fitter.refine_effect(reduced, 0)
        return self.fitter.refine_effects(reduced, 60)

    def _drop_superfluous(self, fit: Fit) -> Fit:
        """Drop effects that a later one has made superfluous."""
        index = 0
        while index < len(fit.effects) - 1:
            reduced = self._without(fit, index)
            if fit.score - reduced.score < self.threshold(fit.effects[index].effect):
                fit, index = reduced, 0
            else:
                index += 1
        return fit


def likelihood_with_free_effects(fitter: Fitter, fit: Fit) -> Likelihood:
    """Return a likelihood in which the values of the effects of a model are free too, linearised."""
    values = [abs(v) for sized in fit.effects for v in sized.values]
    own = FREE * np.reshape(values, (-1, 1, 1)) * fitter.sensitivities(fit)[1]
    return fitter.likelihood.with_columns(own)


def find_episodes(fitter: Fitter, fit: Fit) -> list[Window]:
    """Return the windows [s] in which a changed resistance explains most of the hull residual.

    All windows of :data:`PIECES` pieces are compared by generalised least squares; a change of the
    resistance acts in the hull balance only. Where a window meets rows that are not fitted, it goes on
    to their end: nothing in the fitted rows says otherwise. For several recordings, or without ship
    speed, there are no windows.
    """
    balances, bands = fitter.balances, fitter.bands
    replay, names = balances.replay, balances.names
    if "hull" not in names or len(replay.segments) > 1:
        return []
    edges = np.linspace(0, replay.rows, PIECES + 1).astype(int)
    resistance = balances.nominal_samples["resistance"]
    columns = np.empty((PIECES, 1, fit.difference.shape[1]), np.complex128)
    for (column,), (a, b) in zip(columns, itertools.pairwise(edges), strict=True):
        piece = np.zeros(replay.rows)
        piece[a:b] = resistance[a:b]
        column[:] = bands.transform(piece)
    hull = slice(names.index("hull"), names.index("hull") + 1)
    own, along = fitter.likelihood.projections(fit.weight, fit.difference, columns, hull)
    times = (replay.interval_s * edges).tolist()
    powers = np.diag(own)
    fitted = powers > LEAST_POWER * powers.max()
    gains: dict[Window, float] = {}
    for a, b in itertools.combinations(range(PIECES + 1), 2):
        if (a > 0 and not fitted[a - 1]) or (b < PIECES and not fitted[b]):
            continue
        power = float(own[a:b, a:b].sum())
        if power > 0.0 and b - a < PIECES:
            gain = float(along[a:b].sum()) ** 2 / power
            if gain > LEAST_GAIN:
                gains[times[a], times[b]] = gain
    windows: list[Window] = []
    for window in sorted(gains, key=lambda w: -gains[w]):
        if all(_common(window, other) < ALIKE for other in windows):
            windows.append(window)
    return windows[:MOST_WINDOWS]


def _common(one: Window, other: Window) -> float:
    """Return the overlap of two windows as a share of their union."""
    shared = max(0.0, min(one[1], other[1]) - max(one[0], other[0]))
    return shared / (one[1] - one[0] + other[1] - other[0] - shared)


def threshold(effect: Effect, tried: int) -> float:
    """Return the gain that an effect, one of several that were tried, must exceed.

    A window counts as two more parameters.
    """
    count = len(effect.parameters) + 2 * effect.windowed
    return chance_gain(count, tried + STRETCHES * effect.windowed, RISK)


def chance_bound(effect: Effect, gain: float, threshold: float) -> float:
    """Return the union bound of the probability that any candidate gains as much by chance.

    It is :data:`RISK` at the threshold, which includes the number of candidates, and falls beyond with
    the tail of the chi-squared distribution of the number of fitted values.

    Args:
        effect: effect.
        gain: its gain in 2 log L.
        threshold: threshold of this gain.
    """
    values = len(effect.parameters) + 2 * effect.windowed
    reached, limit = (
        log_chance_above(max(g, 0.0) / SMALL_SAMPLE, values) for g in (gain, threshold)
    )
    return float(min(1.0, RISK * math.exp(min(reached - limit, 100.0))))


class Calibration(NamedTuple):
    """Distribution of the smallest bound of a diagnosis where nothing is missing.

    Its share of null cases below x is ``share`` (x / ``edge``)^``power`` up to the edge, and linear from
    there to 1. Exact bounds would have the power 1; in simulated null cases small bounds are more
    frequent.
    """

    edge: float
    share: float
    power: float

    @classmethod
    def of(cls, bounds: Sequence[float], edge: float = 0.2) -> Calibration:
        """Return the calibration by the bounds of null cases (maximum likelihood; Hill 1975)."""
        small = [max(bound, 1e-300) for bound in bounds if bound < edge]
        power = len(small) / sum(math.log(edge / bound) for bound in small)
        return cls(edge, len(small) / len(bounds), power)

    def __call__(self, bound: float) -> float:
        """Return the probability of so small a bound where nothing is missing."""
        if bound < self.edge:
            return self.share * math.pow(bound / self.edge, self.power)
        return self.share + (1.0 - self.share) * (bound - self.edge) / (1.0 - self.edge)


CALIBRATION = Calibration(0.2, 0.172, 0.504)
"""Calibration by 500 null cases of the validation, from ``python -m reproductions p_values``."""


def p_value(effect: Effect, gain: float, threshold: float) -> float:
    """Return the probability that any candidate gains as much by chance where nothing is missing.

    It is :func:`chance_bound`, calibrated by simulated null cases; the arguments are the same.
    """
    return CALIBRATION(chance_bound(effect, gain, threshold))


def are_confusable(one: Effect, other: Effect) -> bool:
    """Return whether the catalogue lists one of two effects as confusable with the other."""
    return one.id in other.confused_with or other.id in one.confused_with


def _score(fit: Fit) -> float:
    return fit.score
