"""Compute Table 5-1: the change of VAF of each observer with wrong parameters of the ship."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.observers import follow_record, get_observer, simulated_measurements
from shaftline.observers.following import variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES

from .. import side_by_side as beside
from ..cells import HALF_DIGIT, Cell, Kind, half_digit
from . import figures
from .vaf import ROWS, wrong_curve_changes

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


def cells(ours: pd.DataFrame) -> list[Cell]:
    """Return the cells of Table 5-1 for our changes, from :func:`sensitivity_table`."""

    def judge(row: str, column: str, text: str) -> beside.Judged:
        half = half_digit(text, 2)
        if column == RIGHT:
            return Kind.FREE, half, HALF_DIGIT
        if column in {"rms", "sd"}:
            return Kind.FREE, 3.0 * half, f"{HALF_DIGIT}; {_CHANGES}"
        return Kind.FREE, 2.0 * half, _CHANGES

    theirs = beside.published_text("advance_velocity_thesis_sensitivity")
    return beside.compare("5-1", ours, theirs, judge)


def page(tick: beside.Tick) -> beside.Page:
    """Return the page of Table 5-1 and Figures A-23 to A-33."""
    samples, estimates = wrong_estimates(load_ship("frigate"), tick)
    ours = _table(samples, estimates)
    drawn = {"beliefs": figures.belief_figure(samples, estimates, list(ROWS))}
    template, curves = Path(__file__).with_suffix(".md"), wrong_curve_changes()
    return beside.page_of_table(ours, cells(ours), drawn, 60, template, curves=curves)


TITLE = "Change of VAF with wrong parameters of the ship, points (thesis, Table 5-1)"
STUDY = beside.Study(TITLE, page, 7)
