"""Screening: the gain of effects, and of pairs of effects, that a linearisation at a model predicts.

Each effect is simulated at its probes on the refitted model. Its change of the channels is whitened, and
what the model's free values can take up is projected out (the score test, Rao 1948). The screen decides
the order in which effects are fitted; it rejects none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..search.effect import Effect
from ..search.placed import Placed
from ..simulate.at_once import at_once
from .model import Floats, Model
from .output_error import OutputError

PAIRED = 14
"""Effects of a screen, the best first, of which pairs are looked at."""

IDLE = 0.5
"""Gain in 2 log L foretold below which an effect is not tried."""


@dataclass(frozen=True)
class Screened:
    """An effect as a linearisation predicts it on a model.

    Args:
        starts: its best probes, with the predicted gain of each in 2 log L, the best first.
        moved: change of the whitened channels by the best one, orthogonal to everything that is free.
    """

    effect: Effect
    starts: tuple[tuple[float, Placed], ...]
    moved: Floats

    @property
    def gain(self) -> float:
        """Foretold, of the best start."""
        return self.starts[0][0]


class Base:
    """A fitted model with its derivatives, on which effects are screened.

    Args:
        problem: fits ships to the recordings.
        model: fitted.

    Attributes:
        tangent: derivatives by parameters and nuisance values, as :meth:`OutputError.fit` takes them.
    """

    def __init__(self, problem: OutputError, model: Model) -> None:
        self._problem, self.model = problem, model
        columns, search = problem.derivatives(model)
        self.tangent = columns[: search.edge]
        white = problem.likelihood.white(problem.residual(model))
        self._scale = problem.likelihood.scale(white)
        flat = (columns * self._scale).reshape(len(columns), -1)
        precision = search.precision(search.start, False)
        whole = np.hstack([flat, np.diag(np.sqrt(precision))])
        self._basis = np.linalg.qr(whole.T)[0]
        self._left = self._project(white)

    def screen(self, effects: Iterable[Effect]) -> list[Screened]:
        """Return the effects of a catalogue that the model lacks, those of the largest gain first.

        Args:
            effects: candidates; those of which the model has a form are left out.
        """
        problem, model = self._problem, self.model
        here, _ = problem.channels(model.effects, model.shifts, model.nuisance)
        taken = {placed.effect.kind for placed in model.effects}
        trials = [
            placed
            for effect in effects
            if effect.kind not in taken
            for placed in problem.trial_ship.trials(effect, [])
        ]

        def change(placed: Placed) -> Floats:
            there, _ = problem.channels((*model.effects, placed), model.shifts, model.nuisance)
            return self._project(problem.likelihood.white((there - here)[:, problem.rows]))

        starts: dict[str, list[tuple[float, Placed]]] = {}
        best: dict[str, tuple[float, Floats]] = {}
        for placed, moved in zip(trials, at_once(change, trials), strict=True):
            power = float(moved @ moved)
            if not math.isfinite(power) or power < 1e-12:
                continue
            along, label = float(self._left @ moved), placed.effect.label
            predicted = along**2 / power if along > 0.0 else 0.0
            gain = max(predicted, 2.0 * along - power)
            starts.setdefault(label, []).append((gain, placed))
            if label not in best or gain > best[label][0]:
                best[label] = (gain, moved)
        found = []
        for label, tried in starts.items():
            tried.sort(key=lambda start: -start[0])
            if tried[0][0] > IDLE:
                found.append(Screened(tried[0][1].effect, tuple(tried), best[label][1]))
        return sorted(found, key=lambda one: -one.gain)

    def pairs(self, screened: list[Screened]) -> list[tuple[Placed, Placed]]:
        """Return pairs of effects by the gain that is predicted for both, the largest first.

        Args:
            screened: effects, those of the largest gain first; the first :data:`PAIRED` are paired.
        """
        ranked = []
        for one, other in itertools.combinations(screened[:PAIRED], 2):
            if one.effect.kind == other.effect.kind:
                continue
            both = np.array([one.moved, other.moved])
            lhs, rhs = both @ both.T, both @ self._left
            size = np.linalg.lstsq(lhs, rhs, rcond=1e-9)[0]
            if np.all(size > 0.0):
                ranked.append((float(size @ rhs), one.starts[0][1], other.starts[0][1]))
        ranked.sort(key=lambda pair: -pair[0])
        return [(one, other) for _, one, other in ranked]

    def _project(self, white: Floats) -> Floats:
        """Return whitened channels, scaled to variance 1, without what the free values can take up.

        Args:
            white: shape (channels, values).

        Returns:
            Shape (channels x values + free values,).
        """
        flat = (white * self._scale).ravel()
        long = np.concatenate([flat, np.zeros(self._basis.shape[1])])
        return np.asarray(long - self._basis @ (self._basis.T @ long))
