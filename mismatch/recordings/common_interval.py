"""Recordings of different sampling rates, brought to the slowest of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ...plant.columns import TIME
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from .load import Recording
from .noise import describe
from .slips import demands

ALIKE = 0.01
"""Share by which sampling intervals may differ and still be the same."""

MOST_APART = 20.0
"""Ratio of sampling intervals up to which recordings are diagnosed together."""


def at_common_interval(ship: Ship, recordings: Sequence[Recording]) -> list[Recording]:
    """Bring recordings to the longest of their sampling intervals by linear interpolation.

    Measured channels of a recording that is much faster are averaged over one new interval first.

    Args:
        ship: the nominal ship.
        recordings: each on an even time base.

    Returns:
        The recordings; those that were changed say so in their warnings.

    Raises:
        RecordingError: the intervals differ by more than a factor of :data:`MOST_APART`.
    """
    slowest = max(recordings, key=lambda one: one.interval_s, default=None)
    if slowest is None:
        return []
    result = []
    for one in recordings:
        ratio = slowest.interval_s / one.interval_s
        if ratio > MOST_APART:
            raise RecordingError(
                f"{one.source}: a row every {one.interval_s:.4g} s, {slowest.source}: a row every "
                f"{slowest.interval_s:.4g} s; up to {MOST_APART:g} times apart they can be diagnosed "
                "together; leave one out or average the faster one"
            )
        result.append(one if ratio <= 1.0 + ALIKE else _slowed(ship, one, slowest.interval_s))
    return result


def _slowed(ship: Ship, one: Recording, interval_s: float) -> Recording:
    """Return a recording at a longer sampling interval."""
    time, width = one.time_s, round(interval_s / one.interval_s)
    even = time[0] + interval_s * np.arange(int((time[-1] - time[0]) / interval_s + 1e-9) + 1)
    ordered = demands(ship, one.table)

    def at(column: str) -> NDArray[np.float64]:
        values = one[column]
        if column not in ordered and width > 1:
            values = uniform_filter1d(values, width, mode="nearest")
        return np.asarray(np.interp(even, time, values))

    table = pd.DataFrame({c: even if c == TIME else at(str(c)) for c in one.table})
    noise = {c: describe(table[c].to_numpy(), interval_s) for c in one.noise}
    said = (
        f"its rows, one every {one.interval_s:.4g} s, were brought to one every {interval_s:.4g} s, the "
        "interval of the slowest recording"
    )
    return replace(
        one, table=table, interval_s=interval_s, noise=noise, warnings=(*one.warnings, said)
    )
