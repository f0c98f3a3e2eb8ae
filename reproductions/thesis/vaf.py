"""Compute Table 4-1: the variance accounted for by each observer in each load case.

The thesis simulates on a rounded open-water table (:mod:`.rounded_table`). The scores on this table
(:mod:`.table_plant`) are reasons of the differences from ours, which have smooth curves.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.observers import follow, get_observer, simulated_measurements
from shaftline.observers.following import variance_accounted_for
from shaftline.observers.records import Floats
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, PITCH_STEP_DURATION, RACK_STEP_DURATION, LoadCase

from .. import side_by_side as beside
from ..cells import HALF_DIGIT, Cell, Kind, Reason, explain, half_digit, printed_number, shift_to
from ..side_by_side import published
from . import figures, table_plant

INVERTING_ROWS = (
    "luenberger-low",
    "luenberger-moderate",
    "luenberger-high",
    "shaft-kalman",
    "power-balance",
    "shaft-acceleration",
    "shaft-acceleration-derived",
)
"""The observers that invert the torque curve."""
ROWS = dict(zip(INVERTING_ROWS, INVERTING_ROWS, strict=True)) | {
    "immersion-invariance-low": "immersion-invariance-low",
    "immersion-invariance-moderate": "immersion-invariance-moderate",
    "immersion-invariance-high": "immersion-invariance-high",
    "random-walk-kalman": "random-walk-kalman-printed",
    "random-walk-kalman-extended": "random-walk-kalman",
}
"""Rows of the table and the observers behind them; the last is ours, the others the thesis's."""

SEA, SEA_SEEDS = "jonswap", 10
IN_SEAS = (
    f"{HALF_DIGIT}, and the 95 % prediction interval of one sea's score from {SEA_SEEDS} seeded seas: "
    "the thesis has one sea, with phases that it does not print"
)
COLUMNS = [name for name, case in CASES.items() if not case.noisy]


def estimate(observer: Any, ship: Ship, readings: Floats, dt: float) -> Floats:
    """Return the advance velocity [m/s] by an observer, or that with a name, shape (n,)."""
    own = get_observer(observer) if isinstance(observer, str) else observer
    return follow(own, ship, readings, dt)[0]


def score(observer: Any, ship: Ship, readings: Floats, truth: Floats, dt: float) -> float:
    """Return the VAF [%] of :func:`estimate`."""
    return variance_accounted_for(truth, estimate(observer, ship, readings, dt))


def _estimates(rows: Iterable[str], ship: Ship, samples: NDArray[Any]) -> dict[str, Floats]:
    readings = simulated_measurements(samples)
    return {row: estimate(ROWS[row], ship, readings, ship.time_step_s) for row in rows}


def vaf_table(tick: beside.Tick = lambda: None) -> tuple[pd.DataFrame, pd.Series]:
    """Return the VAF [%] by observer and noiseless load case, and its spread over the seas by observer.

    The sea's score is the mean over the seeds, the spread its standard deviation.
    """
    frigate = load_ship("frigate")
    collected: dict[str, list[list[float]]] = {name: [] for name in COLUMNS}
    for case, seed in _records():
        samples = case.run(frigate, seed=seed)
        truth, found = samples["advance_velocity"], _estimates(ROWS, frigate, samples)
        collected[case.name].append([variance_accounted_for(truth, one) for one in found.values()])
        tick()
    means = {name: np.mean(values, axis=0) for name, values in collected.items()}
    spread = np.std(collected[SEA], axis=0, ddof=1)
    return pd.DataFrame(means, index=list(ROWS)), pd.Series(spread, index=list(ROWS))


def _records() -> Iterator[tuple[LoadCase, int]]:
    for name in COLUMNS:
        for seed in range(SEA_SEEDS if CASES[name].sea else 1):
            yield CASES[name], seed


def records() -> int:
    """Return the number of records that the table simulates."""
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
    ours: pd.DataFrame,
    spread: pd.Series,
    reasons: Mapping[tuple[str, str], tuple[Reason | None, ...]] | None = None,
) -> list[Cell]:
    """Return the cells of the scores of Table 4-1 for ours, from :func:`vaf_table`."""
    # 95 % of the differences of one sea's score from the mean of ours
    wide = float(scipy.stats.t.ppf(0.975, SEA_SEEDS - 1)) * math.sqrt(1.0 + 1.0 / SEA_SEEDS)

    def judge(row: str, column: str, text: str) -> beside.Judged:
        kind = Kind.CALIBRATED if chosen_by(row, column) else Kind.FREE
        if column == SEA:
            return kind, half_digit(text, 2) + wide * float(spread[row]), IN_SEAS
        return kind, half_digit(text, 2), HALF_DIGIT

    theirs = beside.published_text("advance_velocity_thesis_vaf").drop(columns="snr_db_for_95pct")
    found = beside.compare("4-1", ours[COLUMNS], theirs, judge)
    return [explain(cell, *(reasons or {}).get((cell.row, cell.column), ())) for cell in found]


PITCH_POINTS, OTHER_POINTS = 4.5, 0.02
"""Distance from the printed score [points] that still counts, in the pitch step and elsewhere."""

_BY_TABLE = (
    "plant and observers of the thesis have a rounded open-water table "
    "([poles](poles.md#the-open-water-table-of-the-thesis))"
)
_BY_INVERSE = (
    f"{_BY_TABLE}, and the observers that invert KQ a polynomial fit of J, whose degrees the row of the "
    "shaft acceleration observer chose. The score with both is within {within:g} points of the print"
)
_FORWARD = f"{_BY_TABLE}, whose score this is"


def table_reasons(
    smooth: pd.DataFrame, rounded: pd.DataFrame
) -> dict[tuple[str, str], tuple[Reason | None, ...]]:
    """Return the effect of the rounded table on each score, as reasons of Table 4-1.

    ``smooth`` are our scores, ``rounded`` those of :func:`.table_plant.score_table`. A reason without a
    distance comes first: the score on the table then meets the print's own interval.
    """
    found: dict[tuple[str, str], tuple[Reason | None, ...]] = {}
    for row, case in itertools.product(rounded.index, rounded.columns):
        if chosen_by(row, case):
            continue
        pair = float(smooth.loc[row, case]), float(rounded.loc[row, case])
        within = PITCH_POINTS if case == "pitch_step" else OTHER_POINTS
        inverting = row in INVERTING_ROWS
        text = _BY_INVERSE.format(within=within) if inverting else _FORWARD
        near = shift_to(text, *pair, within) if inverting else None
        found[row, case] = (shift_to(text, *pair), near)
    return found


def chosen_by(row: str, case: str) -> bool:
    """Return whether a score chose a length of a record, or the degrees of the inverse."""
    chosen = CHOSEN_BY | table_plant.CHOSEN_BY
    return (row, case) in chosen or row == "shaft-acceleration"


def derived_cells() -> list[Cell]:
    """Return the cells of average and standard deviation, by arithmetic on the printed scores."""
    printed, found = published("advance_velocity_thesis_vaf"), []
    texts = beside.published_text("advance_velocity_thesis_vaf")
    for row, values in printed[COLUMNS].iterrows():
        for column, value in (("average", values.mean()), ("sd", values.std())):
            text = str(texts.loc[str(row), column])
            more = half_digit("0.00")  # the scores are rounded as well
            basis = f"{HALF_DIGIT}, and that of the row's scores"
            found.append(
                printed_number(
                    "4-1", str(row), column, float(value), text, Kind.DERIVED, more, basis
                )
            )
    return found


def _traces(ship: Ship) -> dict[str, Figure]:
    """Return the time traces of every observer in every load case (Figures A-1 to A-11)."""
    traces: dict[str, dict[str, Any]] = {row: {} for row in ROWS}
    for name in COLUMNS:
        samples = CASES[name].run(ship)
        time, truth = samples["time"], samples["advance_velocity"]
        shown = time <= 10.0 if name == "inflow_sine_high" else time >= 0.0
        if name == SEA:
            shown = time >= time[-1] - 60.0
        for row, found in _estimates(ROWS, ship, samples).items():
            vaf = variance_accounted_for(truth, found)
            traces[row][name] = (time[shown], truth[shown], found[shown], vaf)
    title = "Advance velocity estimated by"
    return {
        f"traces-{r}": figures.observer_traces(f"{title} {r}", own) for r, own in traces.items()
    }


def page(tick: beside.Tick) -> beside.Page:
    """Return the page of Table 4-1 and Figures A-1 to A-11."""
    table, spread = vaf_table(tick)
    ours = whole_table(table)
    rounded = table_plant.score_table(SEA_SEEDS, COLUMNS, tick)
    compared = [*cells(ours, spread, table_reasons(table, rounded)), *derived_cells()]
    printed = published("advance_velocity_thesis_vaf")
    both = {
        case: [f"{v:.2f} ({printed.loc[row, case]:.2f})" for row, v in rounded[case].items()]
        for case in rounded
    }
    shown = pd.DataFrame(both, index=rounded.index).reset_index(names="")
    drawn = _traces(load_ship("frigate"))
    tick()
    return beside.page_of_table(
        ours,
        compared,
        drawn,
        75,
        Path(__file__).with_suffix(".md"),
        seeds=SEA_SEEDS,
        rows=list(ROWS),
        rack_s=RACK_STEP_DURATION,
        pitch_s=PITCH_STEP_DURATION,
        before_s=table_plant.BEFORE_S,
        after_s=table_plant.AFTER_S,
        high_sine_s=table_plant.HIGH_SINE_S,
        ramp_s=table_plant.RAMP_S,
        points=(PITCH_POINTS, OTHER_POINTS),
        rounded=shown,
    )


TITLE = "Variance accounted for by each observer, % (thesis, Table 4-1)"
STUDY = beside.Study(TITLE, page, 2 * records() + 1)
