"""Prior distributions of a ship's parameters: within the file's tolerance, or far from the file.

A parameter of a ship file lies within its tolerance, or the tolerance is not to be trusted: it was
guessed, or measured on another machine. The prior is a mixture of both normal distributions. Close to
the file it costs what a normal variable does; far from it no more than the small probability that the
file is wrong, so that data which clearly speak of another value are heard, and noise is not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ...plant.keys import Number
from ...plant.ship import Ship
from ..simulate.joint_replay import JointReplay
from ..simulate.tolerances import tolerance_moves

WRONG = 0.01
"""Probability that a parameter lies outside what its tolerance says."""

WIDE = 0.7
"""Standard deviation of the logarithm of such a parameter: one in three is off by a factor 2 or more."""

WIDE_SHIFT = 30.0
"""The same of a parameter whose tolerance is a difference and no ratio, in units of that tolerance."""

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
            guessed: whether the file's tolerance is ignored and only the wide prior counts.
        """
        if guessed:
            return (shift / self.far) ** 2
        near, far = self._densities(shift)
        first, second = self._densities(0.0)
        return 2.0 * math.log((first + second) / max(near + far, 1e-300))

    def precision(self, shift: float, guessed: bool = False) -> float:
        """Return the inverse variance of the normal distribution that is alike at a shift.

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


def guessed_prior(number: Number) -> Prior:
    """Return the prior of a parameter of which the ship file's tolerance says nothing.

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
    for moved in tolerance_moves(replay, tolerance):
        for key, change in moved.numbers.items():
            if change != 0.0:
                spread[key] = math.hypot(spread.get(key, 0.0), change)
    for key, near in spread.items():
        number = ship.number(key)
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
            low, high = number.searched
            yield Prior(
                key, number.value, near, WIDE_SHIFT * near, WRONG, False, number.write,
                (low - number.value, high - number.value),
            )  # fmt: skip


def _of_terms(ship: Ship) -> Iterator[Prior]:
    """Yield priors of the parameters of the ship's own terms that have no tolerance."""
    for term in ship.term:
        for name in term.parameters:
            number = ship.number(f"term.{term.id}.{name}")
            if number.value != 0.0 and number.key not in ship.tolerances.numbers:
                yield guessed_prior(number)


def _log_factors(number: Number) -> tuple[float, float]:
    """Return the logarithms of the least and the largest factor on a parameter of either sign."""
    ends = sorted(end / number.value for end in number.searched)
    low = math.log(ends[0]) if ends[0] > 0.0 else -LARGEST_LOG_FACTOR
    high = math.log(ends[1]) if math.isfinite(ends[1]) else LARGEST_LOG_FACTOR
    return max(low, -LARGEST_LOG_FACTOR), min(high, LARGEST_LOG_FACTOR)
