"""Compute Table 4-1: the variance accounted for by each observer in each load case.

The thesis inverts KQ by a table that it does not print. The second half of the module shows what a
coarse table costs: the column of the pitch node at or below the measured pitch, and in this column the
entry nearest to KQ, without interpolation. Its steps are round numbers, chosen by the printed scores of
:data:`CHOSEN_BY_ROWS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.observers import follow, get_observer, simulated_measurements
from shaftline.observers.following import Floats, variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, PITCH_STEP_DURATION, RACK_STEP_DURATION, LoadCase
from shaftline.plant.open_water import MAX_ADVANCE_RATIO, open_water

from ..cells import Cell, Kind, Reason, half_digit
from ..pages import fill_template
from ..side_by_side import (
    Judged,
    Page,
    Study,
    Tick,
    compare,
    numbers_by_row,
    published,
    published_text,
    side_by_side,
)
from . import figures

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
    """Return the VAF [%] of one observer on one record."""
    estimate, _ = follow(get_observer(observer), ship, readings, dt)
    return variance_accounted_for(truth, estimate)


def vaf_table(tick: Callable[[], None] = lambda: None) -> tuple[pd.DataFrame, pd.Series]:
    """Return the VAF [%] by observer and noiseless load case, and its spread over the seas by observer.

    The sea's score is the mean over the seeds, the spread its standard deviation.
    """
    frigate = load_ship("frigate")
    collected: dict[str, list[list[float]]] = {name: [] for name in COLUMNS}
    for case, seed in _records():
        samples = case.run(frigate, seed=seed)
        readings, truth = simulated_measurements(samples), samples["advance_velocity"]
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
    ours: pd.DataFrame, spread: pd.Series, reasons: dict[tuple[str, str], Reason] | None = None
) -> list[Cell]:
    """Return the cells of Table 4-1 for our scores, from :func:`whole_table`."""
    # 95 % of the differences of one sea's score from the mean of ours
    wide = float(scipy.stats.t.ppf(0.975, SEA_SEEDS - 1)) * math.sqrt(1.0 + 1.0 / SEA_SEEDS)

    def judge(row: str, column: str, text: str) -> Judged:
        kind = Kind.CALIBRATED if (row, column) in CHOSEN_BY else Kind.FREE
        if column == SEA:
            return kind, half_digit(text, 2) + wide * float(spread[row]), IN_SEAS
        return kind, half_digit(text, 2), "half a unit of the last printed digit"

    theirs = published_text("advance_velocity_thesis_vaf").drop(columns="snr_db_for_95pct")
    return compare("4-1", ours, theirs, judge, reasons)


PITCH_STEP, ADVANCE_STEP = 0.01, 0.005
"""Steps of the table in P/D and J [-]."""
CHOSEN_BY_ROWS = ("shaft-acceleration", "power-balance")
"""Rows of Table 4-1 by which the steps and the rule were chosen."""
INVERTING_ROWS = (
    "luenberger-low", "luenberger-moderate", "luenberger-high", "shaft-kalman", "power-balance",
    "shaft-acceleration", "shaft-acceleration-derived",
)  # fmt: skip
"""The observers that invert the torque curve."""
PITCH_POINTS, OTHER_POINTS = 4.5, 0.02
"""Distance from the printed score [points] that still counts, in the pitch step and elsewhere."""

_EPSILON = 1e-9


def node_below(pitch_ratio: float, step: float) -> float:
    """Return the pitch node at or below a pitch ratio."""
    return float(np.floor(pitch_ratio / step + _EPSILON) * step)


def node_nearest(pitch_ratio: float, step: float) -> float:
    """Return the pitch node nearest to a pitch ratio."""
    return float(np.round(pitch_ratio / step) * step)


def table_inverse(
    curve: Floats,
    coefficient: Floats,
    pitch_ratio: Floats,
    pitch_step: float = PITCH_STEP,
    advance_step: float = ADVANCE_STEP,
    node: Callable[[float, float], float] = node_below,
) -> Floats:
    """Return J [-] by the table, shape (n,).

    Args:
        curve: coefficients of KQ.
        coefficient: KQ [-], shape (n,).
        pitch_ratio: P/D [-], shape (n,).
        pitch_step: step of the table in P/D.
        advance_step: step in J.
        node: :func:`node_below` or :func:`node_nearest`.
    """
    ratios = np.arange(0.0, MAX_ADVANCE_RATIO, advance_step)
    nodes = np.array([node(pitch, pitch_step) for pitch in pitch_ratio])
    found = np.empty(len(coefficient))
    for one in np.unique(nodes):
        column = np.array([open_water(curve, j, one) for j in ratios])
        for i in np.flatnonzero(nodes == one):
            found[i] = ratios[np.argmin(np.abs(column - coefficient[i]))]
    return found


def _score(ship: Ship, samples: NDArray[Any], estimate: Floats, **table: Any) -> float:
    """Return the VAF [%] of an estimate whose exact inverse is replaced by the table."""
    record = ship.record()
    turns = samples["shaft_speed"] / (2.0 * np.pi) * float(record["diameter"])
    kq = np.array([
        open_water(record["kq"], j, pitch)
        for j, pitch in zip(estimate / turns, samples["pitch_ratio"], strict=True)
    ])  # fmt: skip
    ratio = table_inverse(record["kq"], kq, samples["pitch_ratio"], **table)
    return variance_accounted_for(samples["advance_velocity"], ratio * turns)


def table_scores() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the VAF [%] by observer and load case, with the exact inverse and with the table.

    The sea is that of seed 0 in both.
    """
    frigate = load_ship("frigate")
    exact: dict[str, dict[str, float]] = {row: {} for row in INVERTING_ROWS}
    rounded: dict[str, dict[str, float]] = {row: {} for row in INVERTING_ROWS}
    for case in (c for c in CASES.values() if not c.noisy):
        samples = case.run(frigate)
        for row in INVERTING_ROWS:
            estimate, _ = follow(
                get_observer(row), frigate, simulated_measurements(samples), frigate.time_step_s
            )
            exact[row][case.name] = variance_accounted_for(samples["advance_velocity"], estimate)
            rounded[row][case.name] = _score(frigate, samples, estimate)
    return (
        pd.DataFrame.from_dict(exact, orient="index"),
        pd.DataFrame.from_dict(rounded, orient="index"),
    )


def other_tables() -> pd.DataFrame:
    """Return the pitch step's VAF [%] of two observers for other tables, one line a table."""
    frigate = load_ship("frigate")
    samples, lines = CASES["pitch_step"].run(frigate), []
    estimates = {
        row: follow(
            get_observer(row), frigate, simulated_measurements(samples), frigate.time_step_s
        )[0]
        for row in CHOSEN_BY_ROWS
    }
    for node, name in ((node_below, "at or below"), (node_nearest, "nearest")):
        for steps in (0.02, 0.0125, 0.01, 0.005):
            for advance in (0.001, 0.005, 0.01):
                scores = {
                    row: _score(frigate, samples, one, pitch_step=steps, advance_step=advance,
                                node=node)
                    for row, one in estimates.items()
                }  # fmt: skip
                lines.append(
                    {"pitch node": name, "step in P/D": steps, "step in J": advance, **scores}
                )
    printed = published("advance_velocity_thesis_vaf")["pitch_step"]
    lines.append(
        {"pitch node": "the thesis", **{row: float(printed[row]) for row in CHOSEN_BY_ROWS}}
    )
    return pd.DataFrame(lines)


def wrong_curve_changes() -> pd.DataFrame:
    """Return the change of VAF [points] of the shaft acceleration observer when its KQ is wrong."""
    frigate = load_ship("frigate")
    samples, record = CASES["inflow_sine_high"].run(frigate), frigate.record()
    turns = samples["shaft_speed"] / (2.0 * np.pi) * float(record["diameter"])
    pitch, truth = samples["pitch_ratio"], samples["advance_velocity"]
    kq = np.array([
        open_water(record["kq"], j, one) for j, one in zip(truth / turns, pitch, strict=True)
    ])  # fmt: skip

    def score(factor: float, step: float) -> float:
        ratio = table_inverse(factor * record["kq"], kq, pitch, advance_step=step)
        return variance_accounted_for(truth, ratio * turns)

    printed = published("advance_velocity_thesis_sensitivity").loc["shaft-acceleration"]
    rows = []
    for factor, column in ((0.9, "open_water_minus_10pct"), (1.1, "open_water_plus_10pct")):
        fine, coarse = (score(factor, step) - score(1.0, step) for step in (1e-4, ADVANCE_STEP))
        rows.append(
            {"KQ believed / right": factor, "step in J 0.0001": fine,
             f"step in J {ADVANCE_STEP:g}": coarse, "printed": float(printed[column])}
        )  # fmt: skip
    return pd.DataFrame(rows)


def table_reasons(exact: pd.DataFrame, rounded: pd.DataFrame) -> dict[tuple[str, str], Reason]:
    """Return the effect of the table on each score, as reasons of Table 4-1.

    The rows by which the table was chosen have no reason, because the table was fitted to them.
    """
    found = {}
    for row in set(INVERTING_ROWS) - set(CHOSEN_BY_ROWS):
        for case in exact.columns:
            shift = float(rounded.loc[row, case] - exact.loc[row, case])
            within = PITCH_POINTS if case == "pitch_step" else OTHER_POINTS
            if abs(shift) >= 2.0 * within:
                text = (
                    f"a table of KQ with steps of {PITCH_STEP:g} in P/D (node at or below) and "
                    f"{ADVANCE_STEP:g} in J (nearest entry), read without interpolation, brings our "
                    f"score to within {within:g} points of the print; steps and rule are chosen by "
                    "the "
                    "printed scores of two rows"
                )
                found[row, case] = Reason(text, shift, within)
    return found


def _traces(ship: Ship) -> dict[str, Figure]:
    """Return the time traces of every observer in every load case (Figures A-1 to A-11)."""
    runs = {name: CASES[name].run(ship) for name in COLUMNS}
    drawn = {}
    for row, observer in ROWS.items():
        records: dict[str, Any] = {}
        for name, samples in runs.items():
            time, truth = samples["time"], samples["advance_velocity"]
            readings = simulated_measurements(samples)
            estimate, _ = follow(get_observer(observer), ship, readings, ship.time_step_s)
            score = variance_accounted_for(truth, estimate)
            shown = time >= (time[-1] - 60.0 if name == SEA else 0.0)
            if name == "inflow_sine_high":
                shown = time <= 10.0
            records[name] = (time[shown], truth[shown], estimate[shown], score)
        title = f"Advance velocity estimated by {row}"
        drawn[f"traces-{row}"] = figures.observer_traces(title, records)
    return drawn


def page(tick: Tick) -> Page:
    """Return the page of Table 4-1 and Figures A-1 to A-11."""
    table, spread = vaf_table(tick)
    ours = whole_table(table)
    exact, rounded = table_scores()
    compared = cells(ours, spread, table_reasons(exact, rounded))
    shown = side_by_side(ours, compared)
    printed = published("advance_velocity_thesis_vaf")
    beside = pd.DataFrame(
        {
            case: [f"{v:.2f} ({printed.loc[row, case]:.2f})" for row, v in rounded[case].items()]
            for case in rounded
        },
        index=rounded.index,
    )
    body = fill_template(
        Path(__file__).with_suffix(".md"), shown=shown, seeds=SEA_SEEDS, rows=list(ROWS),
        rack_s=RACK_STEP_DURATION, pitch_s=PITCH_STEP_DURATION, pitch_step=PITCH_STEP,
        advance_step=ADVANCE_STEP, rounded=beside.reset_index(names=""), others=other_tables(),
    )  # fmt: skip
    drawn = _traces(load_ship("frigate"))
    tick()
    return Page(compared, body, drawn, numbers_by_row(ours), ours.reset_index(), shown, 75)


STUDY = Study("Variance accounted for by each observer, % (thesis, Table 4-1)", page, records() + 1)
