"""Up to which frequency a recording tells of some numbers (see :mod:`..search.band`)."""

from __future__ import annotations

from collections.abc import Sequence

from ..judge.held_out import Segments
from ..search.band import telling_hertz
from ..simulate.balances import Balances
from .free import Free


def numbers_hertz(
    balances: Balances, free: Free, values: Sequence[float], segments: Segments
) -> float:
    """Highest frequency that tells of some numbers.

    Args:
        balances: of ship and recordings.
        free: the numbers.
        values: of them.
        segments: the part that may be fitted.

    Returns:
        [Hz]; infinite where a number does nothing.
    """
    replay = balances.replay
    moved = []
    for i, value in enumerate(values):
        there = [*values]
        there[i] += 1e-3 * abs(value) or 1e-3
        moved.append(there)
    return max(
        telling_hertz(
            replay,
            replay.channels_of(free.record(values)),
            (replay.channels_of(free.record(there)) for there in moved),
            segments,
        )
    )
