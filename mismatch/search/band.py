"""Up to which frequency recordings tell of changes of a ship.

Above it, what is left holds next to nothing of them, but much of what the ship's equations leave out:
encoders, flexible shafts, the corner of a friction law. Judged there as well, those would speak for one
change or another; and the more so, the faster the recording was sampled.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import HEADING, SHAFT_ANGLE, YAW_RATE
from ..simulate.balances import Balances, Channels, rate
from ..simulate.joint_replay import UNMOVED, JointReplay, at_once
from ..simulate.tolerances import tolerance_records
from .catalogue import Effect
from .spectra import fast_length, taper
from .trial_ship import TrialShip

Segments = list[tuple[int, int]]

TELLING = 0.95
"""Share of what the channels tell of a change that lies below the frequency: what is above it would make
its size a fortieth surer.
"""

LEAST_FREQUENCIES = 60
"""That are judged in any case, however slow a change acts, so that noise can be told from it."""

SAMPLES_A_PERIOD = 5.0
"""Rows that are left of a period at the highest frequency where rows are averaged: the mean over a row
then passes 0.94 of it, and what folds back onto it from above is damped to a quarter."""


def telling_hertz(
    replay: JointReplay, here: Channels, moved: Iterable[Channels], segments: Segments
) -> list[float]:
    """Highest frequency that tells of each of some changes.

    What a change does to the simulated channels, over each channel's white noise, squared and summed up
    to a frequency, is what the recording tells of it up to there. An angle counts by its speed.

    Args:
        replay: of the recordings.
        here: channels of a simulation, each of shape (rows,).
        moved: the same after each change.
        segments: the part that may be fitted.

    Returns:
        Of each change [Hz]; infinite where it does nothing.
    """
    noise = replay.noise_rms
    segments = [(a, a + fast_length(b - a)) for a, b in segments]
    frequency = np.concatenate([np.fft.rfftfreq(b - a, replay.interval_s) for a, b in segments])
    order = np.argsort(frequency)
    rising = frequency[order]
    least = float(rising[: LEAST_FREQUENCIES + 1][-1])
    found = []
    for there in moved:
        told = np.zeros(len(frequency))
        for column in replay.channels:
            shift = there[column] - here[column]
            if column == HEADING and YAW_RATE in replay.channels:
                continue  # its derivative is measured better, and that is what the balances take
            if column in (SHAFT_ANGLE, HEADING):
                shift = rate(shift, replay.interval_s)
            if noise[column] > 0.0 and np.isfinite(shift).all():
                told += _power(shift / noise[column], segments)
        told = np.cumsum(told[order])
        if told[-1] > 0.0:
            found.append(max(least, float(rising[np.searchsorted(told, TELLING * told[-1])])))
        else:
            found.append(math.inf)
    return found


def catalogue_hertz(balances: Balances, effects: list[Effect], segments: Segments) -> float:
    """Highest frequency that tells of any effect at its smallest probe, or of a nominal number.

    Args:
        balances: of ship and recordings.
        effects: that will be tried; those that act for a time act slowly.
        segments: the part that may be fitted.

    Returns:
        [Hz]; infinite where nothing does anything.
    """
    replay, trial_ship = balances.replay, TrialShip(balances)
    trials = (next(trial_ship.smallest(effect, []), None) for effect in effects)
    records = [(trial_ship.record((placed,)), UNMOVED) for placed in trials if placed]
    changes = (*records, *tolerance_records(replay))
    moved = at_once(lambda change: replay.channels_of(*change), changes)
    found = telling_hertz(replay, balances.nominal, moved, segments)
    return max((hertz for hertz in found if math.isfinite(hertz)), default=math.inf)


def rows_averaged(interval_s: float, highest_Hz: float) -> int:
    """How many rows may become one where nothing above a frequency is judged.

    Args:
        interval_s: of the rows [s].
        highest_Hz: that is judged.
    """
    if not math.isfinite(highest_Hz):
        return 1
    return max(1, math.floor(1.0 / (SAMPLES_A_PERIOD * highest_Hz * interval_s) + 1e-9))


def _power(values: NDArray[np.float64], segments: Segments) -> NDArray[np.float64]:
    parts = [np.fft.rfft(values[a:b] * taper(b - a)) for a, b in segments]
    return np.asarray(np.abs(np.concatenate(parts)) ** 2)
