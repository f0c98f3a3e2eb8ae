"""When an episode of resistance may have been: stretches that a straight line gives a chance.

Which effects a recording asks for: screen the catalogue, fit the best, add forward, drop backward.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..estimate import Tick
from .catalogue import Effect, Placed, Window
from .fitting import Fit, Fitter
from .spectra import Complex, Likelihood, chance

PIECES = 24
"""Equal pieces of a recording; a stretch begins and ends between two of them."""

STRETCHES = PIECES * (PIECES + 1) // 2 - 1
"""That are scanned: all but the whole."""

MOST_WINDOWS = 4
ALIKE = 0.6
"""Share of two stretches together that they have in common, from which on the better stands for both."""

LEAST_GAIN = 9.0
"""In 2 log L, below which a stretch is not tried: chance reaches it."""


def episodes(fitter: Fitter, fit: Fit) -> list[Window]:
    """The stretches [s] in which the hull lacks a share of its resistance most clearly, best first.

    All stretches of :data:`PIECES`, by generalised least squares: a change of the resistance shows in
    the hull's balance alone, as much of it as there is.

    Args:
        fitter: of one recording; of several, or without a speed log, nothing is told.
        fit: what is known to be missing beside.
    """
    balances, bands = fitter.balances, fitter.bands
    replay, names = balances.replay, balances.names
    if "hull" not in names or len(replay.segments) > 1:
        return []
    edges = np.linspace(0, replay.rows, PIECES + 1).astype(int)
    columns = []
    for a, b in itertools.pairwise(edges):
        piece = np.zeros((len(names), replay.rows))
        piece[names.index("hull"), a:b] = balances.nominal_samples["resistance"][a:b]
        columns.append(bands.transform(piece))
    columns.append(fit.difference)
    information = fitter.likelihood.information(fit.weight, np.array(columns))
    count = len(columns)
    across, regressors = information[:count, count:], information[count:, count:]
    own = information[:count, :count] - across @ np.linalg.solve(regressors, across.T)
    times = replay.interval_s * edges
    gains: dict[Window, float] = {}
    for a, b in itertools.combinations(range(PIECES + 1), 2):
        told = float(own[a:b, a:b].sum())
        if told > 0.0 and b - a < PIECES:
            gain = float(own[a:b, -1].sum()) ** 2 / told
            if gain > LEAST_GAIN:
                gains[(float(times[a]), float(times[b]))] = gain
    found: list[Window] = []
    for window in sorted(gains, key=lambda w: -gains[w]):
        if len(found) < MOST_WINDOWS and all(_common(window, other) < ALIKE for other in found):
            found.append(window)
    return found


def _common(one: Window, other: Window) -> float:
    """Share of two stretches together that they have in common."""
    shared = max(0.0, min(one[1], other[1]) - max(one[0], other[0]))
    return shared / (one[1] - one[0] + other[1] - other[0] - shared)


MOST_EFFECTS, MORE_TURNING = 3, 2
"""How many effects a search finds at most; and how many more on a ship that turns, which has two
balances more in which something may be missing."""

REFINED, FORMS = 5, 2
"""How many of a screen's best pieces of physics are refined by output error, and forms of each."""

RISK = 0.01
"""Probability that chance alone makes one of the catalogue's effects pass."""

HOPE, AGAIN = 0.3, 0.1
"""Shares of its threshold, and of the best gain, that an effect must reach by a straight line through
what its probes moved alone, to be tried on top of others; and of its threshold there, to be refined."""

FREE = 10.0
"""Times its value by which a value of the others may give way beside one that is tried."""

NEAR_GAIN = 0.25
"""Share of the best gain that is worth refining."""

TELL_APART = 6.0
"""Difference of 2 log L below which two names cannot be told apart (odds of about 20 to 1)."""

NEAR_SHARE = 0.01
"""Share of a gain by which the form of a right name may be worse than that of a wrong one."""


@dataclass(frozen=True)
class Candidate:
    """An effect tried on top of a model."""

    effect: Effect
    fit: Fit  # with the effect in the last place
    gain: float  # in 2 log L

    @property
    def placed(self) -> Placed:
        """The effect with its values."""
        return self.fit.effects[-1]


@dataclass(frozen=True)
class Selection:
    """What the search found.

    Args:
        fit: the model, with the chosen effects in the order of their discovery.
        gains: in 2 log L that each chosen effect brings, the others present.
        thresholds: that each had to pass.
        rivals: of each chosen effect: others that came near it, best first.
        ranking: the first screen of the whole catalogue, best first.
    """

    fit: Fit
    gains: tuple[float, ...]
    thresholds: tuple[float, ...]
    rivals: tuple[tuple[Candidate, ...], ...]
    ranking: tuple[Candidate, ...]


def threshold(effect: Effect, tried: int) -> float:
    """Gain that an effect must pass; a window is two parameters more, of all that were scanned.

    Args:
        effect: the effect.
        tried: how many effects were.
    """
    count = len(effect.parameters) + 2 * effect.windowed
    return chance(count, tried + STRETCHES * effect.windowed, RISK)


def confusable(one: Effect, other: Effect) -> bool:
    """Whether one effect may be taken for the other, as the catalogue says of either."""
    return one.id in other.confused_with or other.id in one.confused_with


def giving_way(fitter: Fitter, fit: Fit) -> Likelihood:
    """A likelihood in which the values of a model's effects are free as well, by straight lines."""
    values = [abs(v) for placed in fit.effects for v in placed.values]
    own = FREE * np.reshape(values, (-1, 1, 1)) * fitter.sensitivities(fit)[1]
    return Likelihood(fitter.bands, np.concatenate([own, fitter.nuisance]))


class Selector:
    """Searches the catalogue.

    Args:
        fitter: of the recording.
        effects: candidates.
        tick: told the stage, how much is done, and how much there is.
        most: how many effects are found at most; by default :data:`MOST_EFFECTS`, and
            :data:`MORE_TURNING` more on a ship that turns.
    """

    def __init__(
        self, fitter: Fitter, effects: list[Effect], tick: Tick, most: int | None = None
    ) -> None:
        self.fitter = fitter
        self.effects = effects
        self.windows: list[Window] = []  # in which an effect that acts for a time may do so [s]
        self.tick = tick
        usual = MOST_EFFECTS + MORE_TURNING * fitter.trial_ship.ship.turns
        self.most = usual if most is None else most
        self._moved: dict[str, list[Complex]] = {}

    def threshold(self, effect: Effect) -> float:
        """Gain that an effect must pass."""
        return threshold(effect, len(self.effects))

    def screen(self, base: Fit, stage: str) -> list[Candidate]:
        """Effects at the best of their probes on top of a model, best first.

        All of them on top of none; then those that what their probes moved there gives a chance.
        """
        if any(effect.windowed for effect in self.effects):
            self.windows = episodes(self.fitter, base)
        foretold = self._foretold(base) if base.effects else {}
        pending = [e for e in self.effects if not base.effects or e.label in foretold]
        found = []
        for done, effect in enumerate(pending):
            self.tick(stage, done, len(pending))
            best: Fit | None = None
            trials = self.fitter.trial_ship.trials(effect, self.windows)
            self.fitter.ahead((*base.effects, placed) for placed in trials)
            for placed in self._trials(base, effect):
                fit = self.fitter.fitted((*base.effects, placed))
                if best is None or fit.score > best.score:
                    best = fit
            if not base.effects:
                self._alone(effect)  # while what it asks for is remembered
            if best is None or not math.isfinite(best.score):
                continue
            if base.effects and best.score - base.score < foretold[effect.label] - TELL_APART:
                best = self.fitter.polished(best)  # the others must give way first
            found.append(Candidate(effect, best, best.score - base.score))
        self.tick(stage, len(pending), len(pending))
        return sorted(found, key=self._merit, reverse=True)

    def _alone(self, effect: Effect) -> list[Complex]:
        """What an effect's smallest probes move where nothing else is missing."""
        if effect.label not in self._moved or effect.windowed:
            trial_ship, predicted = self.fitter.trial_ship, self.fitter.predicted
            nothing = predicted(trial_ship.nominal)
            trials = trial_ship.smallest(effect, self.windows)
            moved = [predicted(trial_ship.record((placed,))) - nothing for placed in trials]
            self._moved[effect.label] = [
                m.astype(np.complex64) for m in moved if np.isfinite(m).all()
            ]
        return self._moved[effect.label]

    def _foretold(self, base: Fit) -> dict[str, float]:
        """Gains of effects of other kinds than a model has, by label, of those that have a chance on it.

        What an effect moved alone is taken to be what it moves there, at any size, and the values of the
        model's own effects may give way.
        """
        beside = giving_way(self.fitter, base)
        taken = {placed.effect.kind for placed in base.effects}
        found: dict[str, float] = {}
        limits = {}
        for effect in (e for e in self.effects if e.kind not in taken):
            moved = self._alone(effect)
            gains = [beside.amount(base.weight, base.difference, m)[1] for m in moved]
            found[effect.label] = max(gains, default=0.0)
            limits[effect.label] = HOPE * self.threshold(effect)
        least = AGAIN * max(found.values(), default=0.0)
        return {label: gain for label, gain in found.items() if gain > max(least, limits[label])}

    def _worth(self, screened: list[Candidate]) -> list[Candidate]:
        """The best of a screen, and what may be taken for it: the best forms of each."""
        if not screened:
            return []
        best = screened[0]
        found: dict[tuple[str, str], list[Candidate]] = {}
        for candidate in screened:
            near = candidate.gain > NEAR_GAIN * best.gain
            if candidate.gain > 1.0 and (near or confusable(candidate.effect, best.effect)):
                found.setdefault(candidate.effect.kind, []).append(candidate)
        return [c for forms in list(found.values())[:REFINED] for c in forms[:FORMS]]

    def _trials(self, base: Fit, effect: Effect) -> Iterator[Placed]:
        """An effect at its probes, and at the sizes to which the smallest of them point."""
        trial_ship = self.fitter.trial_ship
        yield from trial_ship.trials(effect, self.windows)
        for small in trial_ship.smallest(effect, self.windows):
            placed = self.fitter.scaled(base, small)
            if placed is not None:
                yield placed

    def _merit(self, candidate: Candidate) -> float:
        return candidate.gain - self.threshold(candidate.effect)

    def refine(self, base: Fit, candidates: list[Candidate]) -> list[Candidate]:
        """The best of a screen, their values fitted; best first."""
        found = []
        if base.effects:
            candidates = [c for c in candidates if c.gain > HOPE * self.threshold(c.effect)]
        for candidate in self._worth(candidates):
            fit = self.fitter.refined(candidate.fit, len(candidate.fit.effects) - 1)
            if len(candidate.effect.parameters) > 1:
                fit = self.fitter.polished(fit)
            if not self.fitter.louder(fit):
                found.append(Candidate(candidate.effect, fit, fit.score - base.score))
        return sorted(found, key=self._merit, reverse=True)

    def search(self) -> Selection:
        """Forward selection of effects, up to so many, each checked backward."""
        base = self.fitter.null
        ranking: tuple[Candidate, ...] = ()
        rivals: dict[str, tuple[Candidate, ...]] = {}
        for round_ in range(self.most):
            screened = self.screen(base, f"screening the catalogue, round {round_ + 1}")
            refined = self.refine(base, screened)
            if round_ == 0:
                names = {c.effect.label for c in refined}
                rest = [c for c in screened if c.effect.label not in names]
                ranking = tuple(sorted([*refined, *rest], key=lambda c: -c.gain))
            if not refined or self._merit(refined[0]) <= 0.0:
                break
            best = refined[0]
            fit = self.fitter.joint(best.fit)
            rivals[best.effect.label] = tuple(refined[1:])
            base = self._without_the_idle(fit)
        gains = tuple(base.score - self._without(base, i).score for i in range(len(base.effects)))
        return Selection(
            base,
            gains,
            tuple(self.threshold(p.effect) for p in base.effects),
            tuple(rivals.get(p.effect.label, ()) for p in base.effects),
            ranking,
        )

    def _without(self, fit: Fit, index: int) -> Fit:
        """The model without one effect, the others fitted again."""
        rest = fit.effects[:index] + fit.effects[index + 1 :]
        reduced = self.fitter.fitted(rest)
        if not rest:
            return reduced
        if len(rest) == 1:
            return self.fitter.refined(reduced, 0)
        return self.fitter.joint(reduced, 60)

    def _without_the_idle(self, fit: Fit) -> Fit:
        """Drop effects that a later one has made superfluous."""
        index = 0
        while len(fit.effects) > 1 and index < len(fit.effects) - 1:
            reduced = self._without(fit, index)
            if fit.score - reduced.score < self.threshold(fit.effects[index].effect):
                fit, index = reduced, 0
            else:
                index += 1
        return fit
