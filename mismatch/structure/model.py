"""Models of the structure search: effects, parameter shifts and nuisance values, with their priors.

The prior of a parameter is a mixture of two normal distributions: the parameter lies within the
tolerance of the ship file, or, with a small probability, the file is wrong (a guess, or the value of
another machine). Near the file the cost is that of a normal variable. Far from the file it is limited,
so that recordings with clear evidence of another value overrule the file, and noise does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...plant.keys import ShipParameter
from ...plant.ship import Ship
from ..search.catalogue import SizedEffect
from ..simulate.balances import tolerance_perturbations
from ..simulate.joint_replay import JointReplay

if TYPE_CHECKING:
    from .output_error import OutputError


Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """Ship with effects and shifted parameters, fitted to recordings.

    Args:
        effects: effects with their values.
        shifts: distance of each parameter from the ship file, in the scale of its prior, shape
            (priors,).
        nuisance: shift of the first pitch ratio, shaft speed and ship speed of each recording, in
            deviations, and then of each channel's clock, in rows; shape (3 recordings + channels,).
        score: 2 log L with the priors [-]; only differences mean anything.
    """

    effects: tuple[SizedEffect, ...]
    shifts: Floats
    nuisance: Floats
    score: float

    @property
    def labels(self) -> frozenset[str]:
        """Labels of the effects."""
        return frozenset(placed.effect.label for placed in self.effects)

    @property
    def kinds(self) -> frozenset[tuple[str, str]]:
        """Kinds of the effects, without their forms."""
        return frozenset(placed.effect.kind for placed in self.effects)

    @property
    def size(self) -> int:
        """Number of values that the effects have."""
        return sum(len(placed.values) for placed in self.effects)


STEP_RATIO, STEP_SIZE = 0.01, 0.02
"""Finite differences of a parameter's logarithm, and of an effect's value as a share of its start."""

STEP_NEAR = 0.3
"""Finite difference of a first state, and of a parameter that moves by a difference, in deviations."""

MOST_SKEW = 0.5
"""Largest clock skew of a channel, in recorded rows."""

FIXED = 1e12
"""Precision of a coordinate that does not move."""


class Coordinates:
    """Free values of a model: shifts of parameters, nuisance values, values of effects.

    Args:
        owner: output-error problem; its priors, first states and channels are the first coordinates.
        effects: effects at their starting values; their scale is the distance from absence.
        begin: model whose shifts and nuisance values are the start.

    Attributes:
        start: first point, shape (free values,).
        units: size of 1 in each coordinate in its own unit, likewise.
        steps: finite differences, 0 where a coordinate is fixed; likewise.
        edge: index of the first value of an effect.
        clocks: index of the first channel's clock.
    """

    def __init__(self, owner: OutputError, effects: tuple[SizedEffect, ...], begin: Model) -> None:
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

    def step(self, point: Floats, lhs: Floats, rhs: Floats) -> Floats:
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

    def split(self, point: Floats) -> tuple[tuple[SizedEffect, ...], Floats, Floats]:
        """Return effects with their values, shifts of parameters, and nuisance values."""
        values = np.array(self._origins) + np.array(self._scales) * point[self.edge :]
        placed, begin = [], 0
        for one in self._effects:
            end = begin + len(one.values)
            placed.append(one.with_values(values[begin:end]))
            begin = end
        return tuple(placed), point[: self._count], point[self._count : self.edge]


WRONG = 0.01
"""Probability that a parameter lies outside what its tolerance says."""

WIDE = 0.7
"""Standard deviation of the logarithm of a parameter in a wrong file: one in three is off by a factor of
2 or more."""

WIDE_SHIFT = 30.0
"""Standard deviation of a parameter in a wrong file, in tolerances, if its tolerance is a difference."""

LARGEST_LOG_FACTOR = 5.0
"""Largest logarithm of a factor by which a parameter may move."""


@dataclass(frozen=True)
class Prior:
    """Prior distribution of a parameter that is estimated while physics is searched.

    Args:
        key: dotted key of the ship file.
        value: value in the ship file, in the key's unit.
        near: standard deviation by the file's tolerance, of the logarithm or in the key's unit.
        far: standard deviation where the file is wrong, likewise.
        wrong: probability that the file is wrong.
        ratio: whether the parameter moves by a factor ``exp(x)``; otherwise by the difference ``x``.
        write: writes a value into a ship's record.
        range: lowest and highest ``x`` that the key allows.
    """

    key: str
    value: float
    near: float
    far: float
    wrong: float
    ratio: bool
    write: Callable[[Any, float], None]
    range: tuple[float, float] = (-LARGEST_LOG_FACTOR, LARGEST_LOG_FACTOR)

    def value_at(self, shift: float) -> float:
        """Return the parameter, shifted from the file's value."""
        return self.value * math.exp(shift) if self.ratio else self.value + shift

    def penalty(self, shift: float, guessed: bool = False) -> float:
        """Return 2 log p of the file's own value less that of a shifted one.

        Args:
            shift: distance from the file's value.
            guessed: whether to ignore the file's tolerance and use the wide prior alone.
        """
        if guessed:
            return (shift / self.far) ** 2
        near, far = self._densities(shift)
        first, second = self._densities(0.0)
        return 2.0 * math.log((first + second) / max(near + far, 1e-300))

    def precision(self, shift: float, guessed: bool = False) -> float:
        """Return the inverse variance of the normal distribution with the same slope at a shift.

        Args:
            shift: distance from the file's value.
            guessed: as in :meth:`penalty`.
        """
        if guessed:
            return 1.0 / self.far**2
        near, far = self._densities(shift)
        if near + far < 1e-300:
            return 1.0 / self.far**2
        return (near / self.near**2 + far / self.far**2) / (near + far)

    def _densities(self, shift: float) -> tuple[float, float]:
        near = math.exp(-0.5 * (shift / self.near) ** 2) / self.near
        far = math.exp(-0.5 * (shift / self.far) ** 2) / self.far
        return (1.0 - self.wrong) * near, self.wrong * far


def parameter_priors(replay: JointReplay, tolerance: float = 1.0) -> list[Prior]:
    """Return priors of the parameters with tolerances, and of the parameters of the ship's own terms.

    Args:
        replay: replay of the recordings; parameters without influence on it are left out.
        tolerance: factor on the tolerances; 0 leaves all parameters out.
    """
    if tolerance == 0.0:
        return []
    return [*_of_tolerances(replay, tolerance), *_of_terms(replay.ship)]


def guessed_prior(number: ShipParameter) -> Prior:
    """Return the prior of a parameter without a tolerance in the ship file.

    Args:
        number: parameter of a ship; not 0.
    """
    return Prior(
        number.key, number.value, WIDE, WIDE, 1.0, True, number.write, _log_factors(number)
    )


def _of_tolerances(replay: JointReplay, tolerance: float) -> Iterator[Prior]:
    """Yield the prior of each parameter that a tolerance moves, one by one."""
    ship = replay.ship
    spread: dict[str, float] = {}
    for moved in tolerance_perturbations(replay, tolerance):
        for key, change in moved.numbers.items():
            if change != 0.0:
                spread[key] = math.hypot(spread.get(key, 0.0), change)
    for key, near in spread.items():
        number = ship.parameter(key)
        if number.value > 0.0 and key != "hull.wake_fraction" and near < 0.9 * number.value:
            share = near / number.value
            yield Prior(
                key,
                number.value,
                share,
                max(WIDE, share),
                WRONG,
                True,
                number.write,
                _log_factors(number),
            )
        else:
            low, high = number.search_range
            yield Prior(
                key, number.value, near, WIDE_SHIFT * near, WRONG, False, number.write,
                (low - number.value, high - number.value),
            )  # fmt: skip


def _of_terms(ship: Ship) -> Iterator[Prior]:
    """Yield priors of the parameters of the ship's own terms that have no tolerance."""
    for term in ship.term:
        for name in term.parameters:
            number = ship.parameter(f"term.{term.id}.{name}")
            if number.value != 0.0 and number.key not in ship.tolerances.numbers:
                yield guessed_prior(number)


def _log_factors(number: ShipParameter) -> tuple[float, float]:
    """Return the logarithms of the least and the largest factor on a parameter of either sign."""
    ends = sorted(end / number.value for end in number.search_range)
    low = math.log(ends[0]) if ends[0] > 0.0 else -LARGEST_LOG_FACTOR
    high = math.log(ends[1]) if math.isfinite(ends[1]) else LARGEST_LOG_FACTOR
    return max(low, -LARGEST_LOG_FACTOR), min(high, LARGEST_LOG_FACTOR)
