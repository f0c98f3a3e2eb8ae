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

STEP_RATIO, STEP_SIZE = 0.01, 0.02
"""Finite differences of a parameter's logarithm, and of an effect's value as a share of its start."""

STEP_NEAR = 0.3
"""Finite difference of a first state, and of a parameter that moves by a difference, in deviations."""

MOST_SKEW = 0.5
"""Recorded rows by which a channel's clock may be off."""

FIXED = 1e12
"""Precision of a coordinate that does not move."""


class Coordinates:
    """Free values of a model: shifts of parameters, nuisance values, values of effects.

    Args:
        owner: the fit; its priors, first states and channels come first in every point.
        effects: at the values from which they start; their scale is their distance from absence.
        begin: model whose shifts and nuisance values are the start.

    Attributes:
        start: the first point, shape (free values,).
        units: size of 1 in each coordinate in its own unit, likewise.
        steps: finite differences, 0 where a coordinate does not move; likewise.
        edge: index of the first value of an effect.
        clocks: index of the first channel's clock.
    """

    def __init__(self, owner: OutputError, effects: tuple[Placed, ...], begin: Model) -> None:
        self._owner, self._effects = owner, effects
        self._count = len(owner.priors)
        self.clocks = self._count + len(owner.starts)
        self.edge = self.clocks + len(owner.names)
        trial_ship = owner.trial_ship
        set_by = {key for placed in effects for key in trial_ship.settings(placed)}
        self._origins, self._scales, self._low, self._high = [], [], [], []
        start = [*begin.shifts, *begin.nuisance]
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
        self.units = np.concatenate([np.ones(self.edge), self._scales])
        steps = np.zeros(len(start))
        for k, prior in enumerate(owner.priors):
            if prior.key not in set_by:
                steps[k] = STEP_RATIO if prior.ratio else STEP_NEAR * prior.near
        for run, (a, b) in enumerate(owner.replay.segments):
            fitted = bool(np.any((owner.rows >= a) & (owner.rows < b)))
            own = np.arange(owner.states * run, owner.states * (run + 1))
            free = (owner.starts[own] > 0.0) & fitted
            steps[self._count + own] = np.where(free, STEP_NEAR, 0.0)
        steps[self.edge :] = STEP_SIZE
        self.steps = steps

    def run_of(self, k: int) -> int | None:
        """Return the recording whose first state a coordinate shifts; None for any other coordinate."""
        return (k - self._count) // self._owner.states if self._count <= k < self.clocks else None

    def precision(self, point: Floats, guessed: bool) -> Floats:
        """Return the precision of each coordinate's prior; an effect's value has none."""
        found = np.zeros(len(point))
        for k, prior in enumerate(self._owner.priors):
            found[k] = prior.precision(float(point[k]), guessed) if self.steps[k] > 0.0 else FIXED
        found[self._count : self.edge] = self._owner.nuisance_precision()
        return found

    def inside(self, point: Floats) -> Floats:
        """Return the nearest point within the bounds."""
        found = point.copy()
        for k, prior in enumerate(self._owner.priors):
            found[k] = min(max(found[k], prior.range[0]), prior.range[1])
        most = MOST_SKEW / self._owner.replay.every
        found[self.clocks : self.edge] = np.clip(found[self.clocks : self.edge], -most, most)
        found[self.edge :] = np.clip(found[self.edge :], self._low, self._high)
        return found

    def stepped(self, point: Floats, lhs: Floats, rhs: Floats) -> Floats:
        """Return the point after the step that solves ``lhs x = rhs``, stopped at the bounds."""
        step, free = np.zeros(len(point)), self.steps > 0.0
        free[self.clocks : self.edge] = True
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
        """Return effects with their values, shifts of parameters, and nuisance values."""
        values = np.array(self._origins) + np.array(self._scales) * point[self.edge :]
        placed, begin = [], 0
        for one in self._effects:
            end = begin + len(one.values)
            placed.append(one.with_values(values[begin:end]))
            begin = end
        return tuple(placed), point[: self._count], point[self._count : self.edge]
