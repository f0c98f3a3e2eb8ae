"""Models of the structure search: effects, parameter shifts and nuisance values, with their priors.

The prior of a parameter is a mixture of two normal distributions: the parameter lies within the
tolerance of the ship file, or, with a small probability, the file is wrong (a guess, or the value of
another machine). Near the file the cost is that of a normal variable. Far from the file it is limited,
so that recordings with clear evidence of another value overrule the file, and noise does not.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...plant.keys import ShipParameter
from ...plant.ship import Ship
from ...plant.tolerances import Tolerances
from ..search.catalogue import SizedEffect
from ..simulate.balances import tolerance_perturbations
from ..simulate.joint_replay import Floats, JointReplay

if TYPE_CHECKING:
    from .output_error import OutputError

STEP_RATIO, STEP_SIZE = 0.01, 0.02
"""Finite differences of a parameter's logarithm, and of an effect's value as a share of its start."""

STEP_NEAR = 0.3
"""Finite difference of a first state, and of a parameter that moves by a difference, in deviations."""

MOST_SKEW = 0.5
"""Largest clock skew of a channel, in recorded rows."""

FIXED = 1e12
"""Precision of a coordinate that does not move."""

WRONG = 0.01
"""Probability that a parameter lies outside what its tolerance says."""

WIDE = 0.7
"""Deviation of the logarithm of a parameter in a wrong file: one in three is off by 2 or more."""

WIDE_SHIFT = 30.0
"""Standard deviation of a parameter in a wrong file, in tolerances, if its tolerance is a difference."""

LEAST_EIGENVALUE = 1e-9
"""Least eigenvalue of the correlation of calibrated parameters; those in a file are rounded."""

LARGEST_LOG_FACTOR = 5.0
"""Largest logarithm of a factor by which a parameter may move."""


@dataclass(frozen=True)
class Model:
    """Ship with effects and shifted parameters, fitted to recordings.

    The nuisance values are the shift of each recording's first states, in deviations, and then of each
    channel's clock, in rows.
    """

    effects: tuple[SizedEffect, ...]  # effects with their values
    shifts: Floats  # distance of each parameter from the ship file, shape (priors,)
    nuisance: Floats  # shape (states x recordings + channels,)
    score: float  # 2 log L with the priors [-]; only differences mean anything

    @property
    def labels(self) -> frozenset[str]:
        """Labels of the effects."""
        return frozenset(sized.effect.label for sized in self.effects)

    @property
    def kinds(self) -> frozenset[tuple[str, str]]:
        """Kinds of the effects, without their forms."""
        return frozenset(sized.effect.kind for sized in self.effects)

    @property
    def size(self) -> int:
        """Number of values that the effects have."""
        return sum(len(sized.values) for sized in self.effects)


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
        ship = owner.trial_ship
        pairs = [pair for sized in effects for pair in sized.pairs]
        values = np.array([value for _, value in pairs], np.float64)
        self._origins = np.array([ship.origin(parameter) for parameter, _ in pairs], np.float64)
        sizes = (abs(v - o) or abs(v) or 1.0 for v, o in zip(values, self._origins, strict=True))
        self._scales = np.array([*sizes], np.float64)
        ends = np.array([ship.range_of(parameter) for parameter, _ in pairs]).reshape(-1, 2).T
        self._low, self._high = (ends - self._origins) / self._scales
        scaled = (values - self._origins) / self._scales
        self.start = np.concatenate([begin.shifts, begin.nuisance, scaled])
        self.units = np.concatenate([np.ones(self.edge), self._scales])
        self.steps = np.zeros(len(self.start))
        set_by = {key for sized in effects for key in ship.settings(sized)}
        for k, prior in enumerate(owner.priors):
            if prior.key not in set_by:
                self.steps[k] = STEP_RATIO if prior.ratio else STEP_NEAR * prior.near
        for run, (a, b) in enumerate(owner.replay.segments):
            if np.any((owner.rows >= a) & (owner.rows < b)):
                own = np.arange(owner.states * run, owner.states * (run + 1))
                self.steps[self._count + own] = np.where(owner.starts[own] > 0.0, STEP_NEAR, 0.0)
        self.steps[self.edge :] = STEP_SIZE

    def run_of(self, k: int) -> int | None:
        """Return the recording whose first state a coordinate shifts; None for any other coordinate."""
        return (k - self._count) // self._owner.states if self._count <= k < self.clocks else None

    def precision(self, point: Floats, guessed: bool) -> Floats:
        """Return the precision matrix of the coordinates' prior; an effect's value has none."""
        precision = np.zeros((len(point), len(point)))
        count, own = self._count, self._owner
        precision[:count, :count] = own.prior.precision(point[:count], guessed)
        fixed = np.flatnonzero(self.steps[:count] == 0.0)
        precision[fixed, :] = precision[:, fixed] = 0.0
        precision[fixed, fixed] = FIXED
        nuisance = np.arange(count, self.edge)
        precision[nuisance, nuisance] = own.nuisance_precision()
        return precision

    def inside(self, point: Floats) -> Floats:
        """Return the nearest point within the bounds."""
        nearest = point.copy()
        for k, prior in enumerate(self._owner.priors):
            nearest[k] = min(max(point[k], prior.range[0]), prior.range[1])
        most, clocks = MOST_SKEW / self._owner.replay.every, slice(self.clocks, self.edge)
        nearest[clocks] = np.clip(point[clocks], -most, most)
        nearest[self.edge :] = np.clip(point[self.edge :], self._low, self._high)
        return nearest

    def step(self, point: Floats, lhs: Floats, rhs: Floats) -> Floats:
        """Return the point after the step that solves ``lhs x = rhs``, stopped at the bounds."""
        step, free = np.zeros(len(point)), self.steps > 0.0
        free[self.clocks : self.edge] = True
        size = np.sqrt(np.maximum(np.diag(lhs), 1e-300))
        for _ in range(4):
            wanted = (rhs[free] - lhs[np.ix_(free, ~free)] @ step[~free]) / size[free]
            whole = lhs[np.ix_(free, free)] / np.outer(size[free], size[free])
            step[free] = np.linalg.lstsq(whole, wanted, rcond=1e-12)[0] / size[free]
            nearest = self.inside(point + step)
            over = free & (np.abs(nearest - point - step) > 1e-12)
            if not over.any():
                break
            step[over] = (nearest - point)[over]
            free &= ~over
        return self.inside(point + step)

    def split(self, point: Floats) -> tuple[tuple[SizedEffect, ...], Floats, Floats]:
        """Return effects with their values, shifts of parameters, and nuisance values."""
        values = iter(self._origins + self._scales * point[self.edge :])
        effects = tuple(
            sized.with_values(itertools.islice(values, len(sized.values)))
            for sized in self._effects
        )
        return effects, point[: self._count], point[self._count : self.edge]


@dataclass(frozen=True)
class Prior:
    """Prior distribution of a parameter that is estimated while physics is searched."""

    key: str  # dotted key of the ship file
    value: float  # value in the ship file, in the key's unit
    near: float  # standard deviation by the file's tolerance, of the logarithm or in the key's unit
    far: float  # standard deviation where the file is wrong, likewise
    wrong: float  # probability that the file is wrong
    ratio: bool  # whether the parameter moves by a factor exp(x); else by a difference x
    write: Callable[[Any, float], None]  # writes a value into a ship's record
    range: tuple[float, float] = (-LARGEST_LOG_FACTOR, LARGEST_LOG_FACTOR)  # range of x

    def value_at(self, shift: float) -> float:
        """Return the parameter, shifted from the file's value."""
        return self.value * math.exp(shift) if self.ratio else self.value + shift

    def unit_at(self, shift: float) -> float:
        """Return the change of the parameter by a unit of x at a shift, in the key's unit."""
        return self.value_at(shift) if self.ratio else 1.0

    def penalty(self, shift: float, guessed: bool = False) -> float:
        """Return 2 log p of the file's own value less that of a shifted one.

        The wide prior alone is used if the file is guessed.
        """
        if guessed:
            return (shift / self.far) ** 2
        near, far = self._densities(shift)
        first, second = self._densities(0.0)
        return 2.0 * math.log((first + second) / max(near + far, 1e-300))

    def precision(self, shift: float, guessed: bool = False) -> float:
        """Return the inverse variance of the normal distribution with the same slope at a shift."""
        near, far = self._densities(shift)
        if guessed or near + far < 1e-300:
            return 1.0 / self.far**2
        return (near / self.near**2 + far / self.far**2) / (near + far)

    def _densities(self, shift: float) -> tuple[float, float]:
        near = math.exp(-0.5 * (shift / self.near) ** 2) / self.near
        far = math.exp(-0.5 * (shift / self.far) ** 2) / self.far
        return (1.0 - self.wrong) * near, self.wrong * far


class _Case(NamedTuple):
    """One normal distribution of a mixture."""

    wrong: NDArray[np.bool_]  # whether each parameter is wrong in the file
    log: float  # logarithm of weight and density at 0, without the constant that all share
    precision: Floats


class JointPrior:
    """Prior of all parameters; those with correlated errors are far from the file one at a time.

    The errors of calibrated parameters are correlated: a reference period may give the ratio of two
    parameters far better than either. The prior of such parameters is a mixture of normal distributions:
    all have the errors and correlations of the file, one is wrong and the others have theirs, or all are
    wrong. The prior of a parameter without correlations is its own.

    Args:
        priors: prior of each parameter.
        tolerances: tolerances of the ship, with the correlations.
    """

    def __init__(self, priors: Sequence[Prior], tolerances: Tolerances) -> None:
        self._priors = list(priors)
        keys = [prior.key for prior in priors]
        correlation = np.array([[tolerances.correlation(a, b) for b in keys] for a in keys])
        correlation = correlation.reshape(len(keys), len(keys))
        known = np.array([prior.wrong < 1.0 for prior in priors], bool)
        linked = (correlation != 0.0) & ~np.eye(len(keys), dtype=bool) & np.outer(known, known)
        self._group = np.flatnonzero(linked.any(axis=1))
        self._alone = np.flatnonzero(~linked.any(axis=1))
        self._cases = [*self._mixture(correlation)] if len(self._group) else []

    def _mixture(self, correlation: Floats) -> Iterator[_Case]:
        """Yield the normal distributions of the correlated parameters; in the first, none is wrong."""
        own = [self._priors[k] for k in self._group]
        near, far = np.array([p.near for p in own]), np.array([p.far for p in own])
        wrong = np.array([p.wrong for p in own])
        count = len(own)
        cases = np.vstack([np.zeros((1, count), bool), np.eye(count, dtype=bool)])
        if count > 1:
            cases = np.vstack([cases, np.ones((1, count), bool)])
        for case in cases:
            weight = float(np.prod(np.where(case, wrong, 1.0 - wrong)))
            if weight <= 0.0:
                continue
            size = np.where(case, far, near)
            inner = correlation[np.ix_(self._group, self._group)] * np.outer(~case, ~case)
            np.fill_diagonal(inner, 1.0)
            values, axes = np.linalg.eigh(inner)
            values = np.maximum(values, LEAST_EIGENVALUE)
            precision = (axes / values) @ axes.T / np.outer(size, size)
            log = math.log(weight) - float(np.sum(np.log(size)) + 0.5 * np.sum(np.log(values)))
            yield _Case(case, log, precision)

    def penalty(self, shifts: Floats, guessed: bool = False) -> float:
        """Return 2 log p of the file's own values less that of shifted ones."""
        alone = range(len(self._priors)) if guessed else self._alone
        cost = sum(self._priors[k].penalty(float(shifts[k]), guessed) for k in alone)
        if self._cases and not guessed:
            own = shifts[self._group]
            there, here = self._logs(np.zeros_like(own)), self._logs(own)
            cost += 2.0 * float(np.logaddexp.reduce(there) - np.logaddexp.reduce(here))
        return float(cost)

    def precision(self, shifts: Floats, guessed: bool = False) -> Floats:
        """Return the precision matrix of the normal distribution with the same slope at the shifts."""
        found = np.zeros((len(self._priors), len(self._priors)))
        alone = range(len(self._priors)) if guessed else self._alone
        for k in alone:
            found[k, k] = self._priors[k].precision(float(shifts[k]), guessed)
        if self._cases and not guessed:
            shares = self._shares(shifts[self._group])
            own = np.tensordot(shares, np.array([case.precision for case in self._cases]), 1)
            found[np.ix_(self._group, self._group)] = own
        return found

    def distances(self, shifts: Floats) -> Floats:
        """Return the distance of each parameter from the file, in standard deviations.

        That of a parameter with correlated errors which is likelier wrong than not is its distance from
        what the other parameters let expect.
        """
        found = np.abs(shifts) / np.array([prior.near for prior in self._priors])
        if self._cases:
            own, near = shifts[self._group], self._cases[0].precision
            wrong = self._shares(own) @ np.array([case.wrong for case in self._cases])
            expected = np.abs(near @ own) / np.sqrt(np.diag(near))
            found[self._group] = np.where(wrong > 0.5, expected, found[self._group])
        return np.asarray(found)

    def _shares(self, shifts: Floats) -> Floats:
        """Return the probability of each distribution at shifts of the correlated parameters."""
        logs = self._logs(shifts)
        return np.asarray(np.exp(logs - np.logaddexp.reduce(logs)))

    def _logs(self, shifts: Floats) -> Floats:
        return np.array(
            [case.log - 0.5 * float(shifts @ case.precision @ shifts) for case in self._cases]
        )


def parameter_priors(replay: JointReplay, tolerance: float = 1.0) -> list[Prior]:
    """Return priors of the parameters with tolerances, and of the parameters of the ship's own terms.

    Parameters without influence on the replay are left out; all are, if the factor on the tolerances
    is 0.
    """
    if tolerance == 0.0:
        return []
    return [*_of_tolerances(replay, tolerance), *_of_terms(replay.ship)]


def _of_tolerances(replay: JointReplay, tolerance: float) -> Iterator[Prior]:
    """Yield the prior of each parameter that a tolerance moves, one by one."""
    ship = replay.ship
    spread: dict[str, float] = {}
    for perturbation in tolerance_perturbations(replay, tolerance):
        for key, change in perturbation.numbers.items():
            if change != 0.0:
                spread[key] = math.hypot(spread.get(key, 0.0), change)
    for key, near in spread.items():
        number = ship.parameter(key)
        value, far = number.value, WIDE_SHIFT * near
        if value > 0.0 and key != "hull.wake_fraction" and near < 0.9 * value:
            yield _factor_prior(number, near / value, WRONG)
        else:
            low, high = (end - value for end in number.search_range)
            yield Prior(key, value, near, far, WRONG, False, number.write, (low, high))


def _of_terms(ship: Ship) -> Iterator[Prior]:
    """Yield priors of the parameters of the ship's own terms that have no tolerance."""
    for term in ship.term:
        for name in term.parameters:
            number = ship.parameter(f"term.{term.id}.{name}")
            if number.value != 0.0 and number.key not in ship.tolerances.numbers:
                yield guessed_prior(number)


def guessed_prior(number: ShipParameter) -> Prior:
    """Return the prior of a parameter that is not 0 and has no tolerance in the ship file."""
    return _factor_prior(number, WIDE, 1.0)


def _factor_prior(number: ShipParameter, near: float, wrong: float) -> Prior:
    """Return the prior of a parameter of either sign that moves by a factor."""
    least, most = sorted(end / number.value for end in number.search_range)
    low = math.log(least) if least > 0.0 else -math.inf
    limits = max(low, -LARGEST_LOG_FACTOR), min(math.log(most), LARGEST_LOG_FACTOR)
    far = max(WIDE, near)
    return Prior(number.key, number.value, near, far, wrong, True, number.write, limits)
