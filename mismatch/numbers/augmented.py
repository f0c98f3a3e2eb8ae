"""State-augmented extended Kalman filter: the numbers are estimated with the ship's states, row by row.

The filter is :class:`shaftline.observers.ship_filter.ShipFilter`; its noises are told from the recording
(:mod:`.filter_noises`), so nothing but the recording is asked of the user. The numbers are constant;
``number_walk`` lets them drift, to follow fouling as it grows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...observers.ship_filter import Followed
from ...plant.derivatives import acting, words
from ...plant.ship import Ship
from ..progress import Tick, silent
from ..simulate.joint_replay import JointReplay
from ..simulate.tolerances import UNMOVED, tolerance_records
from .filter_judged import estimates_over_time, innovations, unsettled, untold, unwhite
from .filter_noises import likeliest_walk, noises_told
from .filter_runs import FilterRuns
from .found import Found
from .identifiable import refuse_unidentifiable

MOST_PASSES = 6

SETTLED = 0.1
"""Standard errors by which the numbers may still move from one pass to the next."""

SLOPE_STEP = 1e-4
"""Share of a number's spread over which simulations are compared."""


def ekf(
    ship: Ship,
    tables: Sequence[pd.DataFrame],
    free: Sequence[str],
    tick: Tick = silent,
    *,
    spread: Mapping[str, float] | None = None,
    number_walk: Mapping[str, float] | None = None,
    tolerance: float = 1.0,
) -> Found:
    """Numbers by the augmented filter, over one recording after the other.

    The first pass starts from the file's numbers and is the one that the table ``estimates`` shows; it
    is repeated from what it found until that no longer moves.

    Args:
        ship: nominal.
        tables: canonical columns at an even interval; equal columns and intervals.
        free: dotted keys.
        tick: told how far the work is.
        spread: standard deviation of numbers at the start, by key, in its unit; see the module.
        number_walk: square roots of the densities of the numbers' drift [unit/s^0.5], by key. With any,
            the last value is the one at the end of the last recording.
        tolerance: factor on how far the numbers that are not free may be off.

    Raises:
        ValueError: a number of which the recordings tell nothing, or several of which they tell only a
            combination; recordings that do not go together; names them.
        ObserverError: an instrument that answers late.
        ShipError: a key that is no number with a derivative.
    """
    replay = JointReplay(ship, *tables)
    noises = noises_told(replay, free, dict(spread or {}), dict(number_walk or {}))
    runs = FilterRuns(replay, tuple(free), noises)
    refuse_unidentifiable(free, _information(runs))
    noises.state_walk.update(likeliest_walk(runs, tick))
    first, own = runs.passed(runs.start)
    values, last = own.numbers, first
    for count in range(0 if number_walk else MOST_PASSES):
        tick("passes of the filter", count, MOST_PASSES)
        last, own = runs.passed(values)
        moved = np.abs(own.numbers - values) / np.sqrt(np.diag(own.covariance))
        values = own.numbers
        if moved.max() < SETTLED:
            break
    covariance = own.covariance + _unsure(runs, values, tolerance, tick)
    _refuse_diverged(runs, first, covariance)
    held = [
        f"{key} ended at the end of the range that the filter allows, and is not identified"
        for key in own.at_bounds
    ]
    return Found(
        tuple(free), tuple(map(float, values)), covariance,
        {"estimates": estimates_over_time(runs, first), "innovations": innovations(runs, last)},
        (*held, *unsettled(runs, last), *untold(runs, own), *unwhite(runs, last)),
    )  # fmt: skip


def _refuse_diverged(
    runs: FilterRuns, followed: list[Followed], covariance: NDArray[np.float64]
) -> None:
    """Refuse estimates that are not finite numbers.

    Raises:
        ValueError: says from which time on.
    """
    estimates = np.concatenate([one.estimates for one in followed])
    lost = ~np.isfinite(estimates).all(axis=1)
    if lost.any() or not np.isfinite(covariance).all():
        when = f"from {runs.replay.time_s[int(np.argmax(lost))]:.4g} s on " if lost.any() else ""
        raise ValueError(
            f"ekf: {when}the filter's estimates of {', '.join(runs.keys)} are not finite numbers; a "
            "recording almost without noise, or numbers far from the file's, do this. Free fewer of "
            "them, or use --method output-error"
        )


def _information(runs: FilterRuns) -> NDArray[np.float64]:
    """What the recordings tell of the numbers, in units of their spreads, about the file's values.

    From simulations, not from the filter's own covariance: an extended filter that linearises anew at
    every row takes a combination that nothing tells for known (Huang et al. 2010).
    """
    replay, noises = runs.replay, runs.noises
    slopes = []
    for key in runs.keys:
        number, ends = acting(replay.ship, key), []
        for side in (SLOPE_STEP, -SLOPE_STEP):
            record = replay.ship.record()
            words(record)[number.words] += side * noises.numbers[key] * number.slopes
            after = replay.simulated(replay.simulate(record))
            ends.append(np.concatenate([after[c] / rms for c, rms in noises.readings.items()]))
        slopes.append((ends[0] - ends[1]) / (2.0 * SLOPE_STEP))
    found = np.array(slopes)
    return np.asarray(found @ found.T)


def _unsure(
    runs: FilterRuns, values: NDArray[np.float64], tolerance: float, tick: Tick
) -> NDArray[np.float64]:
    """Covariance that numbers which are not free add, each of them off by its tolerance."""
    found = np.zeros((len(values), len(values)))
    moved = [
        record
        for record, start in tolerance_records(runs.replay, tolerance, runs.keys)
        if start == UNMOVED
    ]
    for done, record in enumerate(moved):
        tick("tolerances of the other numbers", done, len(moved))
        _, own = runs.passed(values, record)
        found += np.outer(own.numbers - values, own.numbers - values)
    return found
