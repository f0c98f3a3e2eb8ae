"""The corrected ship: all that holds, and never worse than the nominal one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import HEADING, YAW_RATE
from ...plant.ship import Ship
from ..search.selection import TELL_APART
from ..simulate.joint_replay import JointReplay

WORSE = 0.02
"""Share by which the error of a channel may rise, run freely on data set aside, and count as equal."""

OF_NOISE = 0.1
"""The same in rms of the channel's noise."""


class FreeRunning:
    """Errors of ships that run freely under the recorded demands, on data set aside.

    A heading is left out where the rate of turn is measured: it adds up every error of the rate since
    the start, those of the part that was fitted among them, and comes out right or wrong by chance.

    Args:
        replay: of the recordings.
        rows: set aside.
    """

    def __init__(self, replay: JointReplay, rows: NDArray[np.int64]) -> None:
        self._replay = replay
        self._rows = rows

    def errors(self, ship: Ship) -> dict[str, float]:
        """Rms error of each channel, in its unit."""
        simulated = self._replay.channels_of(ship.record())
        return {
            c: float(np.sqrt(np.mean((y[self._rows] - simulated[c][self._rows]) ** 2)))
            for c, y in self._replay.recorded.items()
            if not (c == HEADING and YAW_RATE in self._replay.recorded)
        }

    def worse(self, errors: Mapping[str, float], than: Mapping[str, float]) -> list[str]:
        """Channels that are followed worse, or not at all."""
        noise = self._replay.noise_rms
        return [
            c for c, before in than.items()
            if not errors[c] <= (1.0 + WORSE) * before + OF_NOISE * noise[c]
        ]  # fmt: skip


def corrected_ship(
    nominal: Ship, candidates: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> tuple[Ship, float, list[str]]:
    """The first of some ships that is likelier than the nominal one and runs no worse in any channel.

    Args:
        nominal: the ship as the diagnosis began.
        candidates: corrected ships, the one that carries most first.
        judge: 2 log L of a ship's record on data set aside.
        free: runs them freely there.

    Returns:
        The ship, or the nominal one; what it gains in 2 log L; and the channels in which the first
        candidate was worse.
    """
    spoilt: list[str] = []
    for k, (ship, gain, worse) in enumerate(_compared(nominal, candidates, judge, free)):
        if k == 0:
            spoilt = worse
        if gain > 0.0 and not worse:
            return ship, gain, spoilt
    return nominal, 0.0, spoilt


def not_carried(spoilt: list[str]) -> list[str]:
    """Return the remark on a corrected ship that does not carry what was named.

    Args:
        spoilt: channels that a ship with it follows worse.
    """
    why = f"it follows {', '.join(spoilt)} worse" if spoilt else "it gains nothing"
    return [f"the corrected ship is the nominal one: with what is named, run freely, {why}"]


def followed(
    nominal: Ship, candidates: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> bool:
    """Whether one of some ships is likelier than the nominal one, or as likely and worse in no channel.

    All of what is missing would be; what acts now and then need not gain on data set aside.

    Args:
        nominal: the ship as the diagnosis began.
        candidates: corrected ships.
        judge: 2 log L of a ship's record on data set aside.
        free: runs them freely there.
    """
    return any(
        gain > TELL_APART or (gain > -TELL_APART and not worse)
        for _, gain, worse in _compared(nominal, candidates, judge, free)
    )


def _compared(
    nominal: Ship, ships: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> Iterator[tuple[Ship, float, list[str]]]:
    """Each ship with its gain in 2 log L and the channels in which it runs worse."""
    before, start = free.errors(nominal), judge(nominal.record())
    for ship in ships:
        yield ship, judge(ship.record()) - start, free.worse(free.errors(ship), before)
