"""Choose the corrected ship, which fits the held-out data at least as well as the nominal ship."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import HEADING, YAW_RATE
from ...plant.ship import Ship
from ..search.selection import INDISTINGUISHABLE
from ..simulate.joint_replay import JointReplay

WORSE = 0.02
"""Relative increase of a channel's open-loop error on the held-out data that counts as equal."""

OF_NOISE = 0.1
"""Increase of the error up to which it counts as equal, in rms of the channel's noise."""


class FreeRunning:
    """Open-loop simulation errors of ships on the held-out data.

    The heading is left out where the rate of turn is measured: it integrates the errors of the rate
    since the start, also those on the fitted data, and is right or wrong by chance.

    Args:
        replay: replay of the recordings.
        rows: held-out rows.
    """

    def __init__(self, replay: JointReplay, rows: NDArray[np.int64]) -> None:
        self._replay = replay
        self._rows = rows

    def errors(self, ship: Ship) -> dict[str, float]:
        """Return the rms error of each channel, in its unit."""
        simulated = self._replay.simulate_channels(ship.record())
        return {
            c: float(np.sqrt(np.mean((y[self._rows] - simulated[c][self._rows]) ** 2)))
            for c, y in self._replay.recorded.items()
            if not (c == HEADING and YAW_RATE in self._replay.recorded)
        }

    def worse(self, errors: Mapping[str, float], than: Mapping[str, float]) -> list[str]:
        """Return the channels with a larger error, or with a simulation that diverges."""
        noise = self._replay.noise_rms
        return [
            c for c, before in than.items()
            if not errors[c] <= (1.0 + WORSE) * before + OF_NOISE * noise[c]
        ]  # fmt: skip


def corrected_ship(
    nominal: Ship, candidates: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> tuple[Ship, float, list[str]]:
    """Return the first ship that is likelier than the nominal one without a larger error in a channel.

    Args:
        nominal: ship at the start of the diagnosis.
        candidates: corrected ships, the one with the most corrections first.
        judge: function that returns 2 log L of a ship's record on the held-out data.
        free: open-loop simulation errors there.

    Returns:
        The ship, or the nominal one; its gain in 2 log L; and the channels that the first candidate
        worsens.
    """
    spoilt: list[str] = []
    for k, (ship, gain, worse) in enumerate(_compare(nominal, candidates, judge, free)):
        if k == 0:
            spoilt = worse
        if gain > 0.0 and not worse:
            return ship, gain, spoilt
    return nominal, 0.0, spoilt


def uncorrected_remarks(spoilt: list[str]) -> list[str]:
    """Return the remark on a corrected ship without the identified effects.

    Args:
        spoilt: channels that the effects worsen in open loop.
    """
    why = f"fits {', '.join(spoilt)} worse" if spoilt else "does not fit better"
    return [
        "the corrected ship is the nominal ship, because the ship with the identified effects, "
        f"simulated open loop, {why}"
    ]


def is_any_confirmed(
    nominal: Ship, candidates: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> bool:
    """Return whether a ship is likelier than the nominal one, or as likely without a larger error.

    The complete missing physics would be likelier; an intermittent effect need not gain on the held-out
    data.

    Args:
        nominal: ship at the start of the diagnosis.
        candidates: corrected ships.
        judge: function that returns 2 log L of a ship's record on the held-out data.
        free: open-loop simulation errors there.
    """
    return any(
        gain > INDISTINGUISHABLE or (gain > -INDISTINGUISHABLE and not worse)
        for _, gain, worse in _compare(nominal, candidates, judge, free)
    )


def _compare(
    nominal: Ship, ships: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> Iterator[tuple[Ship, float, list[str]]]:
    """Yield each ship with its gain in 2 log L and the channels that it worsens."""
    before, start = free.errors(nominal), judge(nominal.record())
    for ship in ships:
        yield ship, judge(ship.record()) - start, free.worse(free.errors(ship), before)
