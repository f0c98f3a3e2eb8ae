"""Table 4-1: how well each observer follows the advance velocity, load case by load case."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd
import scipy

from shaftline.observers import follow, get_observer, readings_of
from shaftline.observers.following import Floats, variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, LoadCase

from ..cells import Cell, Kind, Reason, half_digit
from ..side_by_side import Judged, compare, published_text

ROWS = {
    "luenberger-low": "luenberger-low",
    "luenberger-moderate": "luenberger-moderate",
    "luenberger-high": "luenberger-high",
    "shaft-kalman": "shaft-kalman",
    "power-balance": "power-balance",
    "shaft-acceleration": "shaft-acceleration",
    "shaft-acceleration-derived": "shaft-acceleration-derived",
    "immersion-invariance-low": "immersion-invariance-low",
    "immersion-invariance-moderate": "immersion-invariance-moderate",
    "immersion-invariance-high": "immersion-invariance-high",
    "random-walk-kalman": "random-walk-kalman-printed",
    "random-walk-kalman-extended": "random-walk-kalman",
}
"""Rows of the table and the observers behind them; the last is ours, the others the thesis's."""

SEA, SEA_SEEDS = "jonswap", 10
IN_SEAS = (
    f"half a unit of the last printed digit, and the 95 % prediction interval of one sea's score from "
    f"{SEA_SEEDS} seeded seas: the thesis has one sea, with phases that it does not print"
)
COLUMNS = [name for name, case in CASES.items() if not case.noisy]


def scores(observer: str, ship: Ship, readings: Floats, truth: Floats, dt: float) -> float:
    """VAF [%] of one observer on one record."""
    estimate, _ = follow(get_observer(observer), ship, readings, dt)
    return variance_accounted_for(truth, estimate)


def vaf_table(
    tick: Callable[[], None] = lambda: None,
) -> tuple[pd.DataFrame, pd.Series]:
    """Return the VAF [%] of every row in every noiseless load case, and its spread over the seas.

    Args:
        tick: called after each simulated record (:func:`records` gives the number).

    Returns:
        Scores, rows by observer and columns by load case, of the sea the mean over seeds; and the
        standard deviation of the sea's scores over the seeds, by observer.
    """
    frigate = load_ship("frigate")
    collected: dict[str, list[list[float]]] = {name: [] for name in COLUMNS}
    for case, seed in _records():
        samples = case.run(frigate, seed=seed)
        readings, truth = readings_of(samples), samples["advance_velocity"]
        collected[case.name].append(
            [scores(name, frigate, readings, truth, frigate.time_step_s) for name in ROWS.values()]
        )
        tick()
    means = {name: np.mean(values, axis=0) for name, values in collected.items()}
    spread = np.std(collected[SEA], axis=0, ddof=1)
    return pd.DataFrame(means, index=list(ROWS)), pd.Series(spread, index=list(ROWS))


def _records() -> Iterator[tuple[LoadCase, int]]:
    for name in COLUMNS:
        for seed in range(SEA_SEEDS if CASES[name].sea else 1):
            yield CASES[name], seed


def records() -> int:
    """How many records the table simulates."""
    return len(list(_records()))


def whole_table(scores_by_case: pd.DataFrame) -> pd.DataFrame:
    """Return Table 4-1: scores of :func:`vaf_table` with the mean and standard deviation of each row."""
    cells = scores_by_case[COLUMNS]
    return scores_by_case.assign(average=cells.mean(axis=1), sd=cells.std(axis=1))


CHOSEN_BY = {
    ("luenberger-low", "rack_step"),
    ("immersion-invariance-low", "pitch_step"),
    ("random-walk-kalman", "pitch_step"),
}
"""Scores by which the lengths of the two steps' records were chosen."""


def cells(
    ours: pd.DataFrame, spread: pd.Series, reasons: dict[tuple[str, str], Reason] | None = None
) -> list[Cell]:
    """Return the cells of Table 4-1 for our scores, from :func:`whole_table`.

    Args:
        ours: scores, their means and standard deviations.
        spread: standard deviation of the sea's scores, from :func:`vaf_table`.
        reasons: calculated causes by (row, column), from :func:`.rounded_table.reasons`.
    """
    # 95 % of the differences of one sea's score from the mean of ours
    wide = float(scipy.stats.t.ppf(0.975, SEA_SEEDS - 1)) * math.sqrt(1.0 + 1.0 / SEA_SEEDS)

    def judge(row: str, column: str, text: str) -> Judged:
        kind = Kind.CALIBRATED if (row, column) in CHOSEN_BY else Kind.FREE
        if column == SEA:
            return kind, half_digit(text, 2) + wide * float(spread[row]), IN_SEAS
        return kind, half_digit(text, 2), "half a unit of the last printed digit"

    theirs = published_text("advance_velocity_thesis_vaf").drop(columns="snr_db_for_95pct")
    return compare("4-1", ours, theirs, judge, reasons)
