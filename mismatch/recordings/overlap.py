"""Recordings that repeat each other's rows: held-out data must not be among the fitted data."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import HEADING, MEASURED, SHAFT_ANGLE, TIME
from ...plant.recording import RecordingError
from .load import Recording

LEAST_REPEATED = 10
"""Rows in a row, no two of them alike, from which on two recordings overlap. Fewer may agree by chance
where a ship rests and its instruments are coarse."""


def refuse_overlap(recordings: Sequence[Recording], why: str) -> None:
    """Refuse recordings two of which hold the same stretch of a voyage.

    Args:
        recordings: any number.
        why: they must not, as the end of the message.

    Raises:
        RecordingError: names two of them, the rows that are repeated, and the reason.
    """
    for one, other in combinations(recordings, 2):
        refuse_shared(one, other, why)


def refuse_shared(one: Recording, other: Recording, why: str) -> None:
    """Refuse two recordings that hold the same stretch of a voyage.

    Time stamps are not compared: a copy may count from elsewhere.

    Args:
        one: a recording.
        other: another.
        why: they must not share rows, as the end of the message.

    Raises:
        RecordingError: as of :func:`refuse_overlap`.
    """
    # a heading or an angle may have been counted from elsewhere too
    columns = [c for c in one.channels if c in other and c not in (SHAFT_ANGLE, HEADING, TIME)]
    if not columns:
        return
    first, length = _repeated(_rows(one, columns), _rows(other, columns))
    if length < LEAST_REPEATED:
        return
    # a command that is alike while nothing moves is no copy: two runs from rest begin alike
    measured = other.table[[c for c in columns if c in MEASURED]].to_numpy(dtype=np.float64)
    if np.any(np.ptp(measured[first : first + length], axis=0) > 0.0):
        raise RecordingError(
            f"{other.source}: rows {first + 1} to {first + length} stand in {one.source} as well; {why}"
        )


def _rows(recording: Recording, columns: Sequence[str]) -> NDArray[np.void]:
    values = np.ascontiguousarray(recording.table[list(columns)].to_numpy(dtype=np.float64)) + 0.0
    return values.view(np.dtype((np.void, values.itemsize * len(columns)))).ravel()


def _repeated(one: NDArray[np.void], other: NDArray[np.void]) -> tuple[int, int]:
    """First row and length of the longest stretch of the second that follows the first row by row.

    Rows that occur more than once in either are no mark of a moment and end a stretch.
    """
    places: dict[bytes, int] = {}
    counts: dict[bytes, int] = {}
    for rows, own in ((one, places), (other, counts)):
        for place, row in enumerate(rows.tolist()):
            own[row] = -1 if row in own else place
    best, begin, before = (0, 0), 0, -2
    for place, row in enumerate(other.tolist()):
        there = places.get(row, -1) if counts[row] >= 0 else -1
        if there < 0:
            before = -2
            continue
        if there != before + 1:
            begin = place
        before = there
        best = max(best, (place - begin + 1, begin))
    return best[1], best[0]
