"""Recordings in which the commands answer the waves, as those of a governor do."""

from __future__ import annotations

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from ...plant.columns import SHAFT_SPEED
from ..judge.whiteness import slower_than_waves_hertz
from ..simulate.joint_replay import JointReplay

ANSWERED = -0.5
"""Correlation of command and shaft speed in the band of the waves below which the command answers them.
A shaft follows its command, so that the correlation of an open loop is positive."""

BAND = 10.0
"""Ratio of the band's highest to its lowest frequency."""

PERIODS = 4.0
"""Periods of the lowest frequency in each of the spectra that are averaged."""


def answers_waves(replay: JointReplay) -> bool:
    """Return whether the command of a ship that moves opposes what waves do to its shaft speed.

    A simulation without the waves then mistakes the command's answer for a cause: inertia, lags and
    delays that are estimated from it are biased.
    """
    if not replay.ship.moves or SHAFT_SPEED not in replay.channels or replay.steady:
        return False
    low, rate = slower_than_waves_hertz(replay.ship), 1.0 / replay.interval_s
    pairs = [
        (replay.drive_rows[a:b], replay.recorded[SHAFT_SPEED][a:b]) for a, b in replay.segments
    ]
    found = [
        correlation(drive, speed, rate, low, BAND * low)
        for drive, speed in pairs
        if len(drive) * low > 2.0 * PERIODS * rate
    ]
    return bool(found) and float(np.median(found)) < ANSWERED


def correlation(
    one: NDArray[np.float64], other: NDArray[np.float64], rate: float, low: float, high: float
) -> float:
    """Return the correlation of two signals in a band of frequencies; 0 where one does not move.

    Args:
        one: shape (rows,).
        other: likewise.
        rate: rows in a second [Hz].
        low: edge of the band [Hz].
        high: likewise.
    """
    rows = min(len(one), round(PERIODS * rate / low))
    pairs = ((one, other), (one, one), (other, other))
    spectra = [scipy.signal.csd(a, b, rate, nperseg=rows) for a, b in pairs]
    frequency = spectra[0][0]
    band = (frequency >= low) & (frequency <= high)
    both, own, others = (float(np.sum(s[1][band].real)) for s in spectra)
    return both / np.sqrt(own * others) if own * others > 0.0 else 0.0
