"""Up to which frequency a recording tells of some numbers.

Above it, what is left holds next to nothing of them, but much of what the ship's equations leave out:
encoders, flexible shafts, the corner of a friction law. Judged there as well, those would move the
numbers; and the more so, the faster the recording was sampled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import SHAFT_ANGLE
from ..judge.held_out import Segments
from ..search.spectra import taper
from ..simulate.balances import Balances, Channels, rate
from .free import Free

TELLING = 0.95
"""Share of what the channels tell of a number that lies below the frequency: what is above it would make
the number a fortieth surer.
"""

LEAST_FREQUENCIES = 60
"""That are judged in any case, however slow a number acts, so that noise can be told from it."""


def telling_hertz(
    balances: Balances, free: Free, values: Sequence[float], segments: Segments
) -> float:
    """Highest frequency that tells of some numbers.

    What a number does to the simulated channels, over each channel's white noise, squared and summed up
    to a frequency, is what the recording tells of it up to there. An angle counts by its speed.

    Args:
        balances: of ship and recordings.
        free: the numbers.
        values: of them.
        segments: the part that may be fitted.

    Returns:
        [Hz]; infinite where a number does nothing.
    """
    replay = balances.replay
    noise = replay.noise_rms

    def simulated(at: Sequence[float]) -> Channels:
        found = replay.simulated(replay.simulate(free.record(at)))
        if SHAFT_ANGLE in found:
            found[SHAFT_ANGLE] = rate(found[SHAFT_ANGLE], replay.interval_s)
        return found

    here = simulated(values)
    frequency = np.concatenate([np.fft.rfftfreq(b - a, replay.interval_s) for a, b in segments])
    order = np.argsort(frequency)
    highest = float(frequency[order][: LEAST_FREQUENCIES + 1][-1])
    for i, value in enumerate(values):
        moved = [*values]
        moved[i] += 1e-3 * abs(value) or 1e-3
        there = simulated(moved)
        power: Any = 0.0
        for column in replay.channels:
            shift = there[column] - here[column]
            if noise[column] > 0.0 and np.isfinite(shift).all():
                power = power + _power(shift / noise[column], segments)
        told = np.cumsum(np.broadcast_to(power, frequency.shape)[order])
        if not told[-1] > 0.0:
            return np.inf
        highest = max(highest, float(frequency[order][np.searchsorted(told, TELLING * told[-1])]))
    return highest


def _power(values: NDArray[np.float64], segments: Segments) -> NDArray[np.float64]:
    parts = [np.fft.rfft(values[a:b] * taper(b - a)) for a, b in segments]
    return np.asarray(np.abs(np.concatenate(parts)) ** 2)
