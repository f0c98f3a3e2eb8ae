"""Compute Table 4-1: the variance accounted for by each observer in each load case.

The thesis inverts KQ by a table that it does not print. The second half of the module shows what a
coarse table costs: the column of the pitch node at or below the measured pitch, and in this column the
entry nearest to KQ, without interpolation. Its steps are round numbers, chosen by the printed scores of
:data:`CHOSEN_BY_ROWS`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
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
from shaftline.plant.open_water import MAX_ADVANCE_RATIO, open_water

from .. import side_by_side as beside
from ..cells import HALF_DIGIT, Cell, Kind, Reason, half_digit
from ..side_by_side import published
from . import figures

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
    ours: pd.DataFrame, spread: pd.Series, reasons: dict[tuple[str, str], Reason] | None = None
) -> list[Cell]:
    """Return the cells of Table 4-1 for our scores, from :func:`whole_table`."""
    # 95 % of the differences of one sea's score from the mean of ours
    wide = float(scipy.stats.t.ppf(0.975, SEA_SEEDS - 1)) * math.sqrt(1.0 + 1.0 / SEA_SEEDS)

    def judge(row: str, column: str, text: str) -> beside.Judged:
        kind = Kind.CALIBRATED if (row, column) in CHOSEN_BY else Kind.FREE
        if column == SEA:
            return kind, half_digit(text, 2) + wide * float(spread[row]), IN_SEAS
        return kind, half_digit(text, 2), HALF_DIGIT

    theirs = beside.published_text("advance_velocity_thesis_vaf").drop(columns="snr_db_for_95pct")
    return beside.compare("4-1", ours, theirs, judge, reasons)


PITCH_STEP, ADVANCE_STEP = 0.01, 0.005  # steps of the table in P/D and J [-]
CHOSEN_BY_ROWS = ("shaft-acceleration", "power-balance")
"""Rows of Table 4-1 by which the steps and the rule were chosen."""
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
    """Return J [-] by the table, shape (n,), of KQ and P/D [-], shape (n,).

    ``curve`` are the coefficients of KQ, the steps those of the table in P/D and J, and ``node`` is
    :func:`node_below` or :func:`node_nearest`.
    """
    ratios = np.arange(0.0, MAX_ADVANCE_RATIO, advance_step)
    nodes = np.array([node(pitch, pitch_step) for pitch in pitch_ratio])
    found = np.empty(len(coefficient))
    for one in np.unique(nodes):
        column = np.array([open_water(curve, j, one) for j in ratios])
        for i in np.flatnonzero(nodes == one):
            found[i] = ratios[np.argmin(np.abs(column - coefficient[i]))]
    return found


def _score_by_table(
    ship: Ship, samples: NDArray[Any], estimated: Floats, factor: float = 1.0, **table: Any
) -> float:
    """Return the VAF [%] of an estimate whose exact inverse is replaced by the table of factor x KQ."""
    record, pitch = ship.record(), samples["pitch_ratio"]
    turns = samples["shaft_speed"] / (2.0 * np.pi) * float(record["diameter"])
    pairs = zip(estimated / turns, pitch, strict=True)
    kq = np.array([open_water(record["kq"], j, p) for j, p in pairs])
    inverse = table_inverse(factor * record["kq"], kq, pitch, **table)
    return variance_accounted_for(samples["advance_velocity"], inverse * turns)


def table_scores() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the VAF [%] by observer and load case, with the exact inverse and with the table.

    The sea is that of seed 0 in both.
    """
    frigate = load_ship("frigate")
    exact, rounded = {}, {}
    for name in COLUMNS:
        samples = CASES[name].run(frigate)
        truth, found = samples["advance_velocity"], _estimates(INVERTING_ROWS, frigate, samples)
        exact[name] = {row: variance_accounted_for(truth, one) for row, one in found.items()}
        rounded[name] = {row: _score_by_table(frigate, samples, one) for row, one in found.items()}
    return pd.DataFrame(exact), pd.DataFrame(rounded)


def other_tables() -> pd.DataFrame:
    """Return the pitch step's VAF [%] of two observers for other tables, one line a table."""
    frigate = load_ship("frigate")
    samples, lines = CASES["pitch_step"].run(frigate), []
    found = _estimates(CHOSEN_BY_ROWS, frigate, samples)
    nodes = {"at or below": node_below, "nearest": node_nearest}
    pitches, advances = (0.02, 0.0125, 0.01, 0.005), (0.001, 0.005, 0.01)
    for name, pitch, advance in itertools.product(nodes, pitches, advances):
        steps: dict[str, Any] = {"pitch_step": pitch, "advance_step": advance, "node": nodes[name]}
        line = {"pitch node": name, "step in P/D": pitch, "step in J": advance}
        scores = {
            row: _score_by_table(frigate, samples, one, **steps) for row, one in found.items()
        }
        lines.append(line | scores)
    printed = published("advance_velocity_thesis_vaf")["pitch_step"]
    lines.append(
        {"pitch node": "the thesis"} | {row: float(printed[row]) for row in CHOSEN_BY_ROWS}
    )
    return pd.DataFrame(lines)


def wrong_curve_changes() -> pd.DataFrame:
    """Return the change of VAF [points] of the shaft acceleration observer when its KQ is wrong."""
    frigate, rows = load_ship("frigate"), []
    samples = CASES["inflow_sine_high"].run(frigate)
    truth, steps = samples["advance_velocity"], (1e-4, ADVANCE_STEP)
    right, low, high = (
        [_score_by_table(frigate, samples, truth, factor, advance_step=step) for step in steps]
        for factor in (1.0, 0.9, 1.1)
    )
    printed = published("advance_velocity_thesis_sensitivity").loc["shaft-acceleration"]
    for factor, wrong, column in ((0.9, low, "minus"), (1.1, high, "plus")):
        fine, coarse = (a - b for a, b in zip(wrong, right, strict=True))
        rows.append(
            {
                "KQ believed / right": factor,
                "step in J 0.0001": fine,
                f"step in J {ADVANCE_STEP:g}": coarse,
                "printed": float(printed[f"open_water_{column}_10pct"]),
            }
        )
    return pd.DataFrame(rows)


def table_reasons(exact: pd.DataFrame, rounded: pd.DataFrame) -> dict[tuple[str, str], Reason]:
    """Return the effect of the table on each score, as reasons of Table 4-1.

    The rows by which the table was chosen have no reason, because the table was fitted to them.
    """
    found = {}
    for row, case in itertools.product(set(INVERTING_ROWS) - set(CHOSEN_BY_ROWS), exact.columns):
        shift = float(rounded.loc[row, case] - exact.loc[row, case])
        within = PITCH_POINTS if case == "pitch_step" else OTHER_POINTS
        text = (
            f"a table of KQ with steps of {PITCH_STEP:g} in P/D (node at or below) and {ADVANCE_STEP:g} "
            "in J (nearest entry), read without interpolation, brings our score to within "
            f"{within:g} points of the print; steps and rule are chosen by the printed scores of two "
            "rows"
        )
        if abs(shift) >= 2.0 * within:
            found[row, case] = Reason(text, shift, within)
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
    exact, rounded = table_scores()
    compared = cells(ours, spread, table_reasons(exact, rounded))
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
        pitch_step=PITCH_STEP,
        advance_step=ADVANCE_STEP,
        rounded=shown,
        others=other_tables(),
    )


TITLE = "Variance accounted for by each observer, % (thesis, Table 4-1)"
STUDY = beside.Study(TITLE, page, records() + 1)
