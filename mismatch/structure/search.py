"""Which effects, and with them which numbers: a beam of models, each refitted as a whole.

A quick pass comes first and looks for the richest model alone: how many independent rows a recording
has, and which of them are far off, cannot be told from a model that lacks something. The thorough pass
then begins anew. From each model of its beam it tries what a straight line through the refitted model
foretells to help most, and pairs that help together; each is fitted with everything else free. Of each
that is found, forms that are simpler are visited as well.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..progress import Tick, silent
from ..search.effect import Effect
from ..search.placed import Placed
from ..search.selection import threshold
from .choice import Ranked
from .model import Floats, Model
from .output_error import OutputError
from .rows import clipping_limit

Fitting = Callable[[tuple[Placed, ...], Model], Model]


class Effort(NamedTuple):
    """How much a pass tries from each model of its beam."""

    kinds: int  # pieces of physics
    starts: int  # values at which each is begun
    pairs: int  # of them together
    beam: int  # models that are kept
    most: int  # effects of a model


QUICK = Effort(kinds=4, starts=1, pairs=2, beam=1, most=3)
THOROUGH = Effort(kinds=8, starts=2, pairs=4, beam=3, most=3)
NEARBY = Effort(kinds=8, starts=1, pairs=0, beam=1, most=3)
"""From a model whose numbers are held near the file, where they have moved far."""

PAIRED = 14
"""Effects of a screen, the best first, of which pairs are looked at."""

IDLE = 0.5
"""Gain in 2 log L foretold below which an effect is not tried."""

POLISHED = 10
"""Models, the most worth first, that are fitted to the end before they are compared."""

FREED = 5
"""Models of a round, the most worth first, whose numbers are tried from far as well."""


@dataclass(frozen=True)
class Screened:
    """An effect as a straight line foretells it on a model.

    Args:
        starts: its best probes, with the foretold gain of each in 2 log L, the best first.
        moved: what the best one moves, beside all that gives way; shape (rows of the problem,).
    """

    effect: Effect
    starts: tuple[tuple[float, Placed], ...]
    moved: Floats

    @property
    def gain(self) -> float:
        """Foretold, of the best start."""
        return self.starts[0][0]


class StructureSearch:
    """Searches effects and numbers together.

    Args:
        problem: the recordings' fitted rows.
        effects: candidates; those that act for a time are left out.
        held: rows that are set aside.
        tick: told the stage, how much is done, and how much there is.
        most: effects of a model, at most.
    """

    def __init__(
        self,
        problem: OutputError,
        effects: list[Effect],
        held: NDArray[np.int64],
        tick: Tick = silent,
        most: int | None = None,
    ) -> None:
        self._most = THOROUGH.most if most is None else most
        self.problem = problem
        self.effects = [effect for effect in effects if not effect.windowed]
        self.held = held
        self.tick = tick
        self.pool: dict[frozenset[str], Model] = {}

    def search(self) -> list[Ranked]:
        """All models worth a look, fitted, best first."""
        quick = self._pass(QUICK._replace(most=self._most), "looking for the richest model")
        richest = max(quick.values(), key=lambda model: model.score)
        self.problem.heed(richest)
        limit = clipping_limit(richest)
        self.pool = self._pass(
            THOROUGH._replace(most=self._most), "searching physics and numbers together"
        )
        for model in sorted(self.pool.values(), key=self.merit, reverse=True)[:POLISHED]:
            self._polish(model)
        ranked = sorted(self.pool.values(), key=self.merit, reverse=True)
        order = {effect.label: k for k, effect in enumerate(self.effects)}
        found = []
        for model in ranked:
            error = self.problem.held_residual(model, self.held)
            held, compared = self.problem.rms(error), self.problem.rms(error, limit)
            place = sum(order[label] for label in model.labels)
            found.append(Ranked(model, self.merit(model), held, compared, place))
        return found

    def screen(self, base: Model) -> list[Screened]:
        """Effects that a model lacks, by what a straight line foretells of each, best first."""
        return self._screen(base)[0]

    def threshold(self, effect: Effect) -> float:
        """Gain in 2 log L that an effect must bring for itself."""
        return threshold(effect, len(self.effects))

    def price(self, effects: tuple[Placed, ...]) -> float:
        """Gain in 2 log L that effects must bring together, found among so many."""
        count = len({effect.kind for effect in self.effects})
        ways = math.log(math.comb(count, min(len(effects), count))) if effects else 0.0
        return 2.0 * ways + sum(self.threshold(p.effect) for p in effects)

    def merit(self, model: Model) -> float:
        """A model's 2 log L less its price."""
        return model.score - self.price(model.effects)

    def _pass(self, effort: Effort, stage: str) -> dict[frozenset[str], Model]:
        fit = functools.partial(self.problem.fit, guessed=effort.beam == 1)
        first = fit((), self.problem.nothing())
        if effort.beam > 1:
            first = self.problem.freed(first)
        found = {first.labels: first}
        beam = [first]
        freed: set[frozenset[str]] = {first.labels}
        for depth in range(effort.most):
            before = max(map(self._worth(effort), found.values()))
            trials = self._trials(beam, effort)
            for done, (base, effects) in enumerate(trials):
                self.tick(f"{stage}, round {depth + 1}", done, len(trials))
                self._visit(found, effects, base, fit)
            self.tick(f"{stage}, round {depth + 1}", len(trials), len(trials))
            if effort.beam > 1:
                self._free(found, freed)
                self._simplify(found)
            beam = sorted(found.values(), key=self._worth(effort), reverse=True)[: effort.beam]
            if self._worth(effort)(beam[0]) <= before:
                break
        return found

    def _worth(self, effort: Effort) -> Callable[[Model], float]:
        """What a pass orders models by: all of them cost alike until the rows have been counted."""
        return self.merit if effort.beam > 1 else lambda model: model.score

    def _visit(
        self,
        found: dict[frozenset[str], Model],
        effects: tuple[Placed, ...],
        base: Model,
        fit: Fitting,
    ) -> None:
        """Fit a model, and keep it if it is the best fit with its effects."""
        model = fit(effects, base)
        known = found.get(model.labels)
        if math.isfinite(model.score) and (known is None or model.score > known.score):
            found[model.labels] = model

    def _free(self, found: dict[frozenset[str], Model], freed: set[frozenset[str]]) -> None:
        """Let the best models' numbers come from far as well."""
        for labels, model in sorted(found.items(), key=lambda item: -self.merit(item[1]))[:FREED]:
            if labels not in freed:
                found[labels] = self.problem.freed(model)
                freed.add(labels)

    def _polish(self, model: Model) -> None:
        """Go on from a model's values until nothing is gained, with its numbers from far as well."""
        for _ in range(3):
            further = self.problem.freed(self.problem.fit(model.effects, model))
            gained, model = further.score - model.score, further
            if gained < 0.1:
                break
        self.pool[model.labels] = model

    def _simplify(self, found: dict[frozenset[str], Model]) -> None:
        """Visit the best models with one effect less, and with simpler forms of their effects."""
        tried = set(found)
        for model in sorted(found.values(), key=self.merit, reverse=True)[:2]:
            for which, placed in enumerate(model.effects):
                rest = model.effects[:which] + model.effects[which + 1 :]
                simpler = [rest] if rest else []
                for form in self.effects:
                    if form.kind == placed.effect.kind and len(form.parameters) < len(
                        placed.values
                    ):
                        probes = self.problem.trial_ship.trials(form, [])
                        simpler += [
                            other.in_place_of(model.effects, which)
                            for other in itertools.islice(probes, 0, None, 2)
                        ]
                for effects in simpler:
                    labels = frozenset(p.effect.label for p in effects)
                    if labels not in tried or len(effects) == len(model.effects):
                        self._visit(found, effects, model, self.problem.fit)

    def _trials(self, beam: list[Model], effort: Effort) -> list[tuple[Model, tuple[Placed, ...]]]:
        """Models to fit, from each of the beam.

        Where numbers have moved far, they may have taken up what an effect does: what the model lacks
        with its numbers near the file is tried as well.
        """
        trials: list[tuple[Model, tuple[Placed, ...]]] = []
        for base in beam:
            if len(base.effects) >= effort.most:
                continue
            trials += self._upon(base, effort)
            if effort.beam > 1 and self.problem.far(base):
                trials += self._upon(self.problem.near(base), NEARBY._replace(most=effort.most))
        return trials

    def _upon(self, base: Model, effort: Effort) -> list[tuple[Model, tuple[Placed, ...]]]:
        """What a straight line foretells to help a model, and pairs that help together."""
        trials: list[tuple[Model, tuple[Placed, ...]]] = []
        screened, left = self._screen(base)
        kinds: dict[tuple[str, str], int] = {}
        for one in screened:
            forms = kinds.get(one.effect.kind, 0)
            if forms >= effort.starts or (not forms and len(kinds) >= effort.kinds):
                continue
            kinds[one.effect.kind] = forms + 1
            for _, placed in one.starts[: effort.starts]:
                trials.append((base, (*base.effects, placed)))
        if len(base.effects) + 2 <= effort.most:
            for pair in _pairs(screened[:PAIRED], left)[: effort.pairs]:
                trials.append((base, (*base.effects, *pair)))
        return trials

    def _screen(self, base: Model) -> tuple[list[Screened], Floats]:
        """Effects that a model lacks, best first, and what it leaves beside all that gives way."""
        problem = self.problem
        scaled = problem.scaled(base.error)
        flat = (base.columns * scaled).reshape(len(base.columns), -1)
        whole = np.hstack([flat, np.diag(np.sqrt(base.precision))])
        basis = np.linalg.qr(whole.T)[0]
        zeros = np.zeros(len(base.columns))

        def beside(column: Floats) -> Floats:
            long = np.concatenate([(column * scaled).ravel(), zeros])
            return np.asarray(long - basis @ (basis.T @ long))

        left = beside(base.error)
        rows = problem.rows
        here, _ = problem.channels(base.effects, base.numbers, base.nuisance)
        taken = {placed.effect.kind for placed in base.effects}
        found = []
        for effect in self.effects:
            if effect.kind in taken:
                continue
            starts: list[tuple[float, Placed]] = []
            best: tuple[float, Floats] = (-math.inf, left)
            for placed in problem.trial_ship.trials(effect, []):
                there, _ = problem.channels((*base.effects, placed), base.numbers, base.nuisance)
                if not np.isfinite(there).all():
                    continue
                moved = beside((there - here)[:, rows])
                power = float(moved @ moved)
                if power < 1e-12:
                    continue
                along = float(left @ moved)
                foretold = along**2 / power if along > 0.0 else 0.0
                gain = max(foretold, 2.0 * along - power)
                starts.append((gain, placed))
                if gain > best[0]:
                    best = (gain, moved)
            starts.sort(key=lambda start: -start[0])
            if starts and starts[0][0] > IDLE:
                found.append(Screened(effect, tuple(starts), best[1]))
        return sorted(found, key=lambda one: -one.gain), left


def _pairs(screened: list[Screened], left: Floats) -> list[tuple[Placed, Placed]]:
    """Pairs of effects that are foretold to help most beyond the better of the two."""
    ranked = []
    for one, other in itertools.combinations(screened, 2):
        if one.effect.kind == other.effect.kind:
            continue
        both = np.array([one.moved, other.moved])
        lhs, rhs = both @ both.T, both @ left
        size = np.linalg.lstsq(lhs, rhs, rcond=1e-9)[0]
        if np.all(size > 0.0):
            ranked.append((float(size @ rhs), one.starts[0][1], other.starts[0][1]))
    ranked.sort(key=lambda pair: -pair[0])
    return [(one, other) for _, one, other in ranked]
