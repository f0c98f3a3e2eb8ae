"""How far a ship's numbers may be off while physics is searched: near what the file says, or far.

A number of a ship's file is right within its tolerance, or its tolerance is not what it seems: it was
guessed, or measured on another machine. Its prior is a mixture of both. Close to the file it costs what
a normal variable does; far from it no more than the small chance that the file is wrong, so that data
which speak clearly of another number are heard, and noise is not.
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
"""Chance that a number of a file lies outside what its tolerance says."""

FAR = 0.7
"""Standard deviation of the logarithm of such a number: one in three is off by more than a factor 2."""

FAR_SHIFT = 30.0
"""The same of a number whose tolerance is a shift and no share, in that tolerance."""

MOST = 5.0
"""Largest logarithm of a factor by which a number may move."""


@dataclass(frozen=True)
class Doubt:
    """A number that moves while physics is searched.

    Args:
        key: dotted key of the ship's file.
        value: that stands there.
        near: standard deviation by the file's tolerance, of a share of the value or in its unit.
        far: of the same where the file is wrong.
        wrong: chance of that.
        share: whether the number moves by a factor ``exp(x)``; else by ``x``.
        write: puts a value into a ship's record.
        range: how far it may move, that the ship's file allows it.
    """

    key: str
    value: float
    near: float
    far: float
    wrong: float
    share: bool
    write: Callable[[Any, float], None]
    range: tuple[float, float] = (-MOST, MOST)

    def at(self, moved: float) -> float:
        """The number, moved from the file's."""
        return self.value * math.exp(moved) if self.share else self.value + moved

    def penalty(self, moved: float, guessed: bool = False) -> float:
        """How much less likely it is than the file's own value, in 2 log p.

        Args:
            moved: how far it is.
            guessed: whether the file's tolerance is left aside.
        """
        if guessed:
            return (moved / self.far) ** 2
        near, far = self._weights(moved)
        first, second = self._weights(0.0)
        return 2.0 * math.log((first + second) / max(near + far, 1e-300))

    def precision(self, moved: float, guessed: bool = False) -> float:
        """Of the normal variable that it is like there; arguments as of :meth:`penalty`."""
        if guessed:
            return 1.0 / self.far**2
        near, far = self._weights(moved)
        if near + far < 1e-300:
            return 1.0 / self.far**2
        return (near / self.near**2 + far / self.far**2) / (near + far)

    def _weights(self, moved: float) -> tuple[float, float]:
        near = math.exp(-0.5 * (moved / self.near) ** 2) / self.near
        far = math.exp(-0.5 * (moved / self.far) ** 2) / self.far
        return (1.0 - self.wrong) * near, self.wrong * far


def doubts_of(replay: JointReplay, tolerance: float = 1.0) -> list[Doubt]:
    """Numbers of a ship that a recording moves: those that have tolerances, and those of its own terms.

    Args:
        replay: of the recordings; numbers that do not act in it are left out.
        tolerance: factor on the tolerances; 0 leaves all numbers out.
    """
    if tolerance == 0.0:
        return []
    return [*_tolerated(replay, tolerance), *_of_terms(replay.ship)]


def _tolerated(replay: JointReplay, tolerance: float) -> Iterator[Doubt]:
    """Each number that a tolerance of its own moves; of several that go together, each for itself."""
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
            yield Doubt(
                key,
                number.value,
                share,
                max(FAR, share),
                WRONG,
                True,
                number.write,
                _shares(number),
            )
        else:
            low, high = number.searched
            yield Doubt(
                key, number.value, near, FAR_SHIFT * near, WRONG, False, number.write,
                (low - number.value, high - number.value),
            )  # fmt: skip


def _of_terms(ship: Ship) -> Iterator[Doubt]:
    """Numbers of the ship's own terms, of which no tolerance speaks."""
    for term in ship.term:
        for name in term.parameters:
            number = ship.number(f"term.{term.id}.{name}")
            if number.value != 0.0 and number.key not in ship.tolerances.numbers:
                yield Doubt(
                    number.key, number.value, FAR, FAR, 1.0, True, number.write, _shares(number)
                )


def _shares(number: Number) -> tuple[float, float]:
    """Logarithms of the factors by which a number may move, of either sign."""
    ends = sorted(end / number.value for end in number.searched)
    low = math.log(ends[0]) if ends[0] > 0.0 else -MOST
    high = math.log(ends[1]) if math.isfinite(ends[1]) else MOST
    return max(low, -MOST), min(high, MOST)
