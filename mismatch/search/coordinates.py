"""Coordinates in which the values of effects are searched."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .placed import Placed
from .trial_ship import TrialShip

EDGE_S = 30.0
"""Unit of a window's edges in the search [s]."""


class JointSearch:
    """Coordinates of some effects of a model, the others held."""

    def __init__(
        self, trial_ship: TrialShip, effects: tuple[Placed, ...], which: list[int] | None = None
    ) -> None:
        self._effects = effects
        self._which = list(range(len(effects))) if which is None else which
        self._searches = [Search(trial_ship, effects[i]) for i in self._which]
        points = [search.point() for search in self._searches]
        self._cuts = np.cumsum([len(point) for point in points])[:-1]
        self.start = np.concatenate(points)

    def placed(self, point: Any) -> tuple[Placed, ...]:
        """All effects of the model, those that are searched at coordinates."""
        trial = list(self._effects)
        parts = np.split(np.atleast_1d(point), self._cuts)
        for i, search, part in zip(self._which, self._searches, parts, strict=True):
            trial[i] = search.placed(part)
        return tuple(trial)


class Search:
    """Coordinates in which an effect is searched: logarithms of its values' distances from neutral,
    and its window's edges in units of :data:`EDGE_S`.
    """

    def __init__(self, trial_ship: TrialShip, placed: Placed) -> None:
        self._placed = placed
        self._neutral, self._sign, self._least, self._ranges = [], [], [], []
        for parameter, value in placed.pairs:
            self._ranges.append(trial_ship.range_of(parameter))
            base = trial_ship.origin(parameter)
            self._neutral.append(base)
            self._sign.append(1.0 if value >= base else -1.0)
            self._least.append(trial_ship.least(parameter))

    def point(self) -> NDArray[np.float64]:
        """Coordinates of the effect as it was placed."""
        distance = [abs(v - n) for v, n in zip(self._placed.values, self._neutral, strict=True)]
        edges = [t / EDGE_S for t in self._placed.window or ()]
        return np.concatenate([np.log(np.maximum(distance, 1e-12)), edges])

    def placed(self, point: Any) -> Placed:
        """The effect at coordinates."""
        point = np.atleast_1d(point)
        count = len(self._neutral)
        values = [
            float(np.clip(n + s * max(math.exp(min(x, 60.0)), least), *ends))
            for n, s, least, ends, x in zip(
                self._neutral, self._sign, self._least, self._ranges, point[:count], strict=True
            )
        ]
        window = self._placed.window
        if window is not None:
            start, end = sorted(float(x) * EDGE_S for x in point[count:])
            window = (max(start, 0.0), max(end, 0.0))
        return Placed(self._placed.effect, tuple(values), window)
