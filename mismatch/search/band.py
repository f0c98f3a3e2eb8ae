"""Find the highest frequency at which recordings carry information about changes of a ship.

Above this frequency the residual holds hardly any effect of such changes, but much of what the ship
model leaves out: encoders, flexible shafts, the corner of a friction law. Fitted there as well, these
errors would bias the choice of effects, and more so with faster sampling.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import HEADING, SHAFT_ANGLE, YAW_RATE
from ..simulate.balances import Balances, Channels, time_derivative
from ..simulate.joint_replay import NO_SHIFT, JointReplay, map_threaded
from ..simulate.tolerances import tolerance_records
from .catalogue import Effect
from .spectra import cosine_taper, fast_length
from .trial_ship import TrialShip

Segments = list[tuple[int, int]]

INFORMATION_SHARE = 0.95
"""Share of the Fisher information on a change that lies below the frequency; the rest would reduce the
standard error of its size by a fortieth."""

LEAST_FREQUENCIES = 60
"""Fewest frequencies that are fitted, even for slow changes, so that a change is distinguishable from
noise."""

SAMPLES_A_PERIOD = 5.0
"""Averaged rows per period of the highest frequency. The mean over a row then passes 0.94 of it, and
aliases are damped to a quarter."""


def informative_frequencies(
    replay: JointReplay, here: Channels, moved: Iterable[Channels], segments: Segments
) -> list[float]:
    """Return the highest informative frequency of each of several changes.

    The information up to a frequency is the squared change of the simulated channels, divided by the
    variance of their white noise and summed up to this frequency. An angle counts by its derivative.

    Args:
        replay: replay of the recordings.
        here: channels of a simulation, each of shape (rows,).
        moved: channels after each change.
        segments: part of the rows that may be fitted.

    Returns:
        Frequency of each change [Hz]; infinite for a change without an effect.
    """
    noise = replay.noise_rms
    segments = [(a, a + fast_length(b - a)) for a, b in segments]
    frequency = np.concatenate([np.fft.rfftfreq(b - a, replay.interval_s) for a, b in segments])
    order = np.argsort(frequency)
    rising = frequency[order]
    least = float(rising[: LEAST_FREQUENCIES + 1][-1])
    found = []
    for there in moved:
        information = np.zeros(len(frequency))
        for column in replay.channels:
            shift = there[column] - here[column]
            if column == HEADING and YAW_RATE in replay.channels:
                continue  # The balances use the yaw rate, which is measured more precisely.
            if column in (SHAFT_ANGLE, HEADING):
                shift = time_derivative(shift, replay.interval_s)
            if noise[column] > 0.0 and np.isfinite(shift).all():
                information += _power(shift / noise[column], segments)
        information = np.cumsum(information[order])
        if information[-1] > 0.0:
            found.append(
                max(
                    least,
                    float(
                        rising[np.searchsorted(information, INFORMATION_SHARE * information[-1])]
                    ),
                )
            )
        else:
            found.append(math.inf)
    return found


def highest_informative_frequency(
    balances: Balances, effects: list[Effect], segments: Segments
) -> float:
    """Return the highest informative frequency of all effects and of all uncertain parameters.

    Args:
        balances: balances of ship and recordings.
        effects: effects at their smallest probes; windowed effects are slow and left out.
        segments: part of the rows that may be fitted.

    Returns:
        Frequency [Hz]; infinite if no change has an effect.
    """
    replay, trial_ship = balances.replay, TrialShip(balances)
    trials = (next(trial_ship.smallest_trials(effect, []), None) for effect in effects)
    records = [(trial_ship.record((placed,)), NO_SHIFT) for placed in trials if placed]
    changes = (*records, *tolerance_records(replay))
    moved = map_threaded(lambda change: replay.simulate_channels(*change), changes)
    found = informative_frequencies(replay, balances.nominal, moved, segments)
    return max((hertz for hertz in found if math.isfinite(hertz)), default=math.inf)


def rows_per_average(interval_s: float, highest_Hz: float) -> int:
    """Return the number of rows that may be averaged if only frequencies up to a limit are fitted.

    Example:
        >>> rows_per_average(0.01, 2.0)
        10

    Args:
        interval_s: sampling interval [s].
        highest_Hz: highest fitted frequency [Hz]; infinite for no averaging.
    """
    if not math.isfinite(highest_Hz):
        return 1
    return max(1, math.floor(1.0 / (SAMPLES_A_PERIOD * highest_Hz * interval_s) + 1e-9))


def _power(values: NDArray[np.float64], segments: Segments) -> NDArray[np.float64]:
    parts = [np.fft.rfft(values[a:b] * cosine_taper(b - a)) for a, b in segments]
    return np.asarray(np.abs(np.concatenate(parts)) ** 2)
