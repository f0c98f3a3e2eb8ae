"""All free values of a model on one scale, inside their bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..search.placed import Placed
from .model import Model

if TYPE_CHECKING:
    from .output_error import OutputError

Floats = NDArray[np.float64]

STEP_SHARE, STEP_SIZE = 0.01, 0.02
"""Differences over which a number of the file, by its logarithm, and a value of an effect, as a share of
where it is first tried, are felt."""

STEP_NEAR = 0.3
"""The same of a first state, and of a number that moves by a shift, in deviations."""

FIXED = 1e12
"""Precision of what does not move."""


class Coordinates:
    """All free values of a model on one scale: numbers, nuisance, values of effects."""

    def __init__(self, owner: OutputError, effects: tuple[Placed, ...], begin: Model) -> None:
        self._owner, self._effects = owner, effects
        self._count = len(owner.doubts)
        self.skew = self._count + len(owner.starts)
        self._edge = self.skew + len(owner.names)
        trial_ship = owner.trial_ship
        set_by = {key for placed in effects for key in trial_ship.settings(placed)}
        self._origins, self._scales, self._low, self._high = [], [], [], []
        start = [*begin.numbers, *begin.nuisance]
        for placed in effects:
            for parameter, value in placed.pairs:
                origin = trial_ship.origin(parameter)
                low, high = trial_ship.range_of(parameter)
                size = abs(value - origin) or abs(value) or 1.0
                self._origins.append(origin)
                self._scales.append(size)
                self._low.append((low - origin) / size)
                self._high.append((high - origin) / size)
                start.append((value - origin) / size)
        self.start = np.array(start, np.float64)
        self.units = np.concatenate([np.ones(self._edge), self._scales])
        steps = np.zeros(len(start))
        for k, doubt in enumerate(owner.doubts):
            if doubt.key not in set_by:
                steps[k] = STEP_SHARE if doubt.share else STEP_NEAR * doubt.near
        for run, (a, b) in enumerate(owner.replay.segments):
            fitted = bool(np.any((owner.rows >= a) & (owner.rows < b)))
            own = slice(self._count + 3 * run, self._count + 3 * run + 3)
            steps[own] = np.where(
                (owner.starts[3 * run : 3 * run + 3] > 0.0) & fitted, STEP_NEAR, 0.0
            )
        steps[self._edge :] = STEP_SIZE
        self.steps = steps

    def run_of(self, k: int) -> int | None:
        """Recording whose first state a coordinate shifts; None of any other."""
        return (k - self._count) // 3 if self._count <= k < self.skew else None

    def precision(self, point: Floats, guessed: bool) -> Floats:
        """Of the priors; what an effect sets in a number's stead does not move."""
        found = np.zeros(len(point))
        for k, doubt in enumerate(self._owner.doubts):
            found[k] = doubt.precision(float(point[k]), guessed) if self.steps[k] > 0.0 else FIXED
        found[self._count : self._edge] = self._owner.loose()
        return found

    def inside(self, point: Floats) -> Floats:
        """The nearest point within the bounds."""
        found = point.copy()
        for k, doubt in enumerate(self._owner.doubts):
            found[k] = min(max(found[k], doubt.range[0]), doubt.range[1])
        most = 0.5 / self._owner.replay.every  # of a recorded row
        found[self.skew : self._edge] = np.clip(found[self.skew : self._edge], -most, most)
        found[self._edge :] = np.clip(found[self._edge :], self._low, self._high)
        return found

    def stepped(self, point: Floats, lhs: Floats, rhs: Floats) -> Floats:
        """Where a step leads that ``lhs x = rhs`` asks for; what meets its bound stays there."""
        step, free = np.zeros(len(point)), self.steps > 0.0
        free[self.skew : self._edge] = True
        size = np.sqrt(np.maximum(np.diag(lhs), 1e-300))
        for _ in range(4):
            wanted = (rhs[free] - lhs[np.ix_(free, ~free)] @ step[~free]) / size[free]
            whole = lhs[np.ix_(free, free)] / np.outer(size[free], size[free])
            step[free] = np.linalg.lstsq(whole, wanted, rcond=1e-12)[0] / size[free]
            found = self.inside(point + step)
            over = free & (np.abs(found - point - step) > 1e-12)
            if not over.any():
                break
            step[over] = (found - point)[over]
            free &= ~over
        return self.inside(point + step)

    def split(self, point: Floats) -> tuple[tuple[Placed, ...], Floats, Floats]:
        """Effects with their values, numbers, nuisance."""
        values = np.array(self._origins) + np.array(self._scales) * point[self._edge :]
        placed, begin = [], 0
        for one in self._effects:
            end = begin + len(one.values)
            placed.append(one.with_values(values[begin:end]))
            begin = end
        return tuple(placed), point[: self._count], point[self._count : self._edge]
