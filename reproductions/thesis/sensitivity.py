"""Compute Table 5-1: the change of VAF of each observer with wrong parameters of the ship."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.observers import follow_record, get_observer, simulated_measurements
from shaftline.observers.following import variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES

from .. import side_by_side as beside
from ..cells import HALF_DIGIT, Cell, Kind, Reason, explain, half_digit, printed_number, shift_to
from . import figures, rounded_table, table_plant
from .vaf import OTHER_POINTS, ROWS

RIGHT = "vaf_inflow_sine_high"


def _beliefs(ship: Ship) -> dict[str, tuple[Ship, float]]:
    """Return the assumed ship, and a factor on its open-water curves, for each column of the table."""
    sides = [f"transmission.inertia_{side}_side_kg_m2" for side in ("engine", "propeller")]

    def inertia(factor: float) -> Ship:
        return ship.with_values({key: factor * ship.parameter(key).value for key in sides})

    def area(ratio: float) -> Ship:
        return ship.with_values({"propeller.expanded_area_ratio": ratio})

    return {
        RIGHT: (ship, 1.0),
        "inertia_minus_10pct": (inertia(0.9), 1.0),
        "inertia_plus_10pct": (inertia(1.1), 1.0),
        "open_water_minus_10pct": (ship, 0.9),
        "open_water_plus_10pct": (ship, 1.1),
        "ear_0.6": (area(0.6), 1.0),
        "ear_1.0": (area(1.0), 1.0),
    }


_ROUNDED = 0.008
"""Tolerance of the printed standard deviation: changes and deviation are printed to two digits."""


def find_sign_misprints(printed: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the cells with a misprinted sign, as (row, column), by the row's own standard deviation.

    The printed standard deviation of the row does not follow from its changes, but follows with the
    other sign of exactly one of them.
    """
    found = []
    for row, cells in printed.iterrows():
        changes = cells.iloc[1:7].astype(float)

        def off(values: pd.Series, printed: float = cells["sd"]) -> bool:
            return bool(abs(values.std() - printed) >= _ROUNDED)

        turned = [
            column
            for column in changes.index[changes != 0.0]
            if not off(changes.where(changes.index != column, -changes))
        ]
        if off(changes) and len(turned) == 1:
            found.append((str(row), str(turned[0])))
    return found


def wrong_estimates(
    ship: Ship, tick: beside.Tick = lambda: None
) -> tuple[Any, dict[tuple[str, str], Any]]:
    """Return the samples of the 4 rad/s case, and the estimates [m/s] by row and belief, shape (n,)."""
    samples, estimates = CASES["inflow_sine_high"].run(ship), {}
    readings = simulated_measurements(samples)
    for name, (believed, curve) in _beliefs(ship).items():
        for row, observer in ROWS.items():
            record = get_observer(observer).discretise(believed, ship.time_step_s)
            record["ship"]["kq"] *= curve
            record["ship"]["kt"] *= curve
            estimates[row, name] = follow_record(record, readings)[0]
        tick()
    return samples, estimates


def sensitivity_table(tick: beside.Tick = lambda: None) -> pd.DataFrame:
    """Return the VAF [%] with the right ship, and its change in points with each wrong one."""
    return _table(*wrong_estimates(load_ship("frigate"), tick))


def _table(samples: Any, estimates: dict[tuple[str, str], Any]) -> pd.DataFrame:
    truth = samples["advance_velocity"]
    columns: dict[str, dict[str, float]] = {}
    for (row, name), estimate in estimates.items():
        columns.setdefault(name, {})[row] = variance_accounted_for(truth, estimate)
    table = pd.DataFrame(columns)
    changes = table.iloc[:, 1:].sub(table[RIGHT], axis=0)
    table.iloc[:, 1:] = changes
    return table.assign(rms=changes.pow(2).mean(axis=1).pow(0.5), sd=changes.std(axis=1))


_CHANGES = "the change is a difference of two scores that are rounded to two digits"
POINTS = 2.0 * OTHER_POINTS
"""Distance from the printed change [points] that still counts: that of two scores of Table 4-1."""
CHOSEN_BY = ("immersion-invariance-moderate", "open_water_minus_10pct")
"""The change that chose the entry of the table at J 1.0 and P/D 1.4."""

_BY_TABLE = (
    "plant and observers of the thesis have a rounded open-water table "
    "([poles](poles.md#the-open-water-table-of-the-thesis)). The change on this table is within "
    f"{POINTS:g} points of the print"
)
_TURNED = f"the print's sign is a misprint (errata page); besides, {_BY_TABLE}"


def table_changes(tick: beside.Tick = lambda: None) -> pd.DataFrame:
    """Return the changes of VAF [points] on the rounded table, for the columns of wrong parameters."""
    ship = load_ship("frigate")
    right = rounded_table.rounded_table(ship)
    samples, columns = table_plant.simulate_case(ship, right, "inflow_sine_high"), {}
    for name, (believed, curve) in _beliefs(ship).items():
        table = rounded_table.rounded_table(believed)
        found = table_plant.estimates(believed, samples, table, curve)
        columns[name] = table_plant.scores(samples, found)
        tick()
    table_of_scores = pd.DataFrame(columns)
    return table_of_scores.iloc[:, 1:].sub(table_of_scores[RIGHT], axis=0)


def table_reasons(
    smooth: pd.DataFrame, rounded: pd.DataFrame
) -> dict[tuple[str, str], tuple[Reason | None, ...]]:
    """Return the effect of the rounded table on each change, as reasons of Table 5-1.

    ``smooth`` are our changes, ``rounded`` those of :func:`table_changes`. Where the print's sign is
    a misprint, the change has the other sign.
    """
    turned = find_sign_misprints(beside.published("advance_velocity_thesis_sensitivity"))
    found: dict[tuple[str, str], tuple[Reason | None, ...]] = {}
    for row in rounded.index:
        for column in rounded.columns:
            if (row, column) == CHOSEN_BY:
                continue
            ours, follows = float(smooth.loc[row, column]), float(rounded.loc[row, column])
            text = _TURNED if (row, column) in turned else _BY_TABLE
            follows = -follows if (row, column) in turned else follows
            pair = ours, follows
            found[row, column] = (shift_to(text, *pair), shift_to(text, *pair, POINTS))
    return found


def cells(
    ours: pd.DataFrame,
    reasons: Mapping[tuple[str, str], tuple[Reason | None, ...]] | None = None,
) -> list[Cell]:
    """Return the cells of the changes of Table 5-1 for ours, from :func:`sensitivity_table`."""

    def judge(row: str, column: str, text: str) -> beside.Judged:
        kind = Kind.CALIBRATED if (row, column) == CHOSEN_BY else Kind.FREE
        return kind, 2.0 * half_digit(text, 2), _CHANGES

    theirs = beside.published_text("advance_velocity_thesis_sensitivity")
    changes = ours.drop(columns=[RIGHT, "rms", "sd"], errors="ignore")
    found = beside.compare("5-1", changes, theirs, judge)
    return [explain(cell, *(reasons or {}).get((cell.row, cell.column), ())) for cell in found]


def derived_cells() -> list[Cell]:
    """Return the cells of the first and the last two columns, by arithmetic on printed numbers.

    The score with the right model is that of Table 4-1. RMS and standard deviation are those of the
    row's changes as printed, and with the sign that the errata turn as a reason.
    """
    printed = beside.published("advance_velocity_thesis_sensitivity")
    texts = beside.published_text("advance_velocity_thesis_sensitivity")
    scores = beside.published("advance_velocity_thesis_vaf")["inflow_sine_high"]
    turned, found = dict(find_sign_misprints(printed)), []
    for row, line in printed.iterrows():
        changes = line.iloc[1:7].astype(float)
        right = changes.where(changes.index != turned.get(str(row)), -changes)
        text = "one sign of the row is a misprint (errata page)"
        for column, value, follows in (
            (RIGHT, float(scores[row]), float(scores[row])),
            ("rms", _rms(changes), _rms(right)),
            ("sd", float(changes.std()), float(right.std())),
        ):
            more = 0.0 if column == RIGHT else half_digit("0.00")
            basis = (
                HALF_DIGIT if column == RIGHT else f"{HALF_DIGIT}, and that of the row's changes"
            )
            shown = str(texts.loc[str(row), column])
            cell = printed_number("5-1", str(row), column, value, shown, Kind.DERIVED, more, basis)
            found.append(explain(cell, shift_to(text, value, follows)))
    return found


def _rms(changes: pd.Series) -> float:
    return float(changes.pow(2).mean() ** 0.5)


def page(tick: beside.Tick) -> beside.Page:
    """Return the page of Table 5-1 and Figures A-23 to A-33."""
    samples, estimates = wrong_estimates(load_ship("frigate"), tick)
    ours, rounded = _table(samples, estimates), table_changes(tick)
    drawn = {"beliefs": figures.belief_figure(samples, estimates, list(ROWS))}
    compared = [*cells(ours, table_reasons(ours, rounded)), *derived_cells()]
    printed = beside.published("advance_velocity_thesis_sensitivity")
    both = {
        column: [f"{v:.2f} ({printed.loc[row, column]:.2f})" for row, v in values.items()]
        for column, values in rounded.items()
    }
    shown = pd.DataFrame(both, index=rounded.index).reset_index(names="")
    template = Path(__file__).with_suffix(".md")
    return beside.page_of_table(ours, compared, drawn, 60, template, rounded=shown, points=POINTS)


TITLE = "Change of VAF with wrong parameters of the ship, points (thesis, Table 5-1)"
STUDY = beside.Study(TITLE, page, 14)
