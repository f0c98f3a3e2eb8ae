"""Table 4-1: how well each observer follows the advance velocity, load case by load case."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from ...observers import follow, get_observer, readings_of
from ...observers.metrics import Floats, variance_accounted_for
from ...plant import Ship, load_ship
from ..cells import Cell, Kind, half_digit
from ..side_by_side import Judged, compare, published_text
from .load_cases import CASES, LoadCase

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

SEA_SEEDS = 10
COLUMNS = [name for name, case in CASES.items() if not case.noisy]


def scores(observer: str, ship: Ship, readings: Floats, truth: Floats, dt: float) -> float:
    """VAF [%] of one observer on one record."""
    estimate, _ = follow(get_observer(observer), ship, readings, dt)
    return variance_accounted_for(truth, estimate)


def vaf_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """VAF [%] of every row in every noiseless load case; the sea's column is a mean over seeds.

    Args:
        tick: called after each simulated record (:func:`records` tells how many).
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
    return pd.DataFrame(
        {name: np.mean(values, axis=0) for name, values in collected.items()}, index=list(ROWS)
    )


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


def _judge(row: str, column: str, text: str) -> Judged:
    return Kind.FREE, half_digit(text, 2), "half a unit of the last printed digit"


def cells(ours: pd.DataFrame) -> list[Cell]:
    """Return the cells of Table 4-1 for our scores, from :func:`whole_table`."""
    return compare("4-1", ours, published_text("advance_velocity_thesis_vaf"), _judge)
