"""Compute Table 5-1: the change of VAF of each observer with wrong parameters of the ship."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from shaftline.observers import (
    follow_record,
    get_observer,
    simulated_measurements,
    variance_accounted_for,
)
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES

from ..cells import Cell, Kind, half_digit
from ..pages import fill_template
from ..side_by_side import (
    Judged,
    Page,
    Study,
    Tick,
    compare,
    numbers_by_row,
    published_text,
    side_by_side,
)
from . import figures
from .vaf import ROWS, wrong_curve_changes


def _beliefs(ship: Ship) -> dict[str, tuple[Ship, float]]:
    """Return the assumed ship, and a factor on its open-water curves, for each column of the table."""
    line = ship.transmission

    def inertia(factor: float) -> Ship:
        return ship.with_values(
            {
                "transmission.inertia_engine_side_kg_m2": factor * line.inertia_engine_side_kg_m2,
                "transmission.inertia_propeller_side_kg_m2": factor
                * line.inertia_propeller_side_kg_m2,
            }
        )

    def area(ratio: float) -> Ship:
        return ship.with_values({"propeller.expanded_area_ratio": ratio})

    return {
        "vaf_inflow_sine_high": (ship, 1.0),
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
        if abs(changes.std() - cells["sd"]) < _ROUNDED:
            continue
        turned = [
            column
            for column in changes.index[changes != 0.0]
            if abs(changes.where(changes.index != column, -changes).std() - cells["sd"]) < _ROUNDED
        ]
        if len(turned) == 1:
            found.append((str(row), str(turned[0])))
    return found


def _estimate(observer: str, believed: Ship, curve: float, readings: Any, dt: float) -> Any:
    record = get_observer(observer).discretise(believed, dt)
    record["ship"]["kq"] *= curve
    record["ship"]["kt"] *= curve
    return follow_record(record, readings)[0]


def wrong_estimates(ship: Ship) -> tuple[Any, dict[tuple[str, str], Any]]:
    """Return the samples of the 4 rad/s case, and the estimates [m/s], shape (n,)."""
    samples = CASES["inflow_sine_high"].run(ship)
    readings, beliefs = simulated_measurements(samples), _beliefs(ship)
    return samples, {
        (row, name): _estimate(observer, believed, curve, readings, ship.time_step_s)
        for row, observer in ROWS.items()
        for name, (believed, curve) in beliefs.items()
    }


def sensitivity_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Return the VAF [%] with the right ship, and its change in points with each wrong one."""
    frigate = load_ship("frigate")
    samples = CASES["inflow_sine_high"].run(frigate)
    readings, truth = simulated_measurements(samples), samples["advance_velocity"]
    columns = {}
    for name, (believed, curve) in _beliefs(frigate).items():
        columns[name] = [
            variance_accounted_for(
                truth, _estimate(row, believed, curve, readings, frigate.time_step_s)
            )
            for row in ROWS.values()
        ]
        tick()
    table = pd.DataFrame(columns, index=list(ROWS))
    right = table["vaf_inflow_sine_high"]
    table.iloc[:, 1:] = table.iloc[:, 1:].sub(right, axis=0)
    changes = table.iloc[:, 1:]
    table["rms"] = changes.pow(2).mean(axis=1).pow(0.5)
    table["sd"] = changes.std(axis=1)
    return table


_CHANGES = "the change is a difference of two scores that are rounded to two digits"


def cells(ours: pd.DataFrame) -> list[Cell]:
    """Return the cells of Table 5-1 for our changes, from :func:`sensitivity_table`."""

    def judge(row: str, column: str, text: str) -> Judged:
        half = half_digit(text, 2)
        if column == "vaf_inflow_sine_high":
            return Kind.FREE, half, "half a unit of the last printed digit"
        if column in {"rms", "sd"}:
            return Kind.FREE, 3.0 * half, f"half a unit of the last printed digit; {_CHANGES}"
        return Kind.FREE, 2.0 * half, _CHANGES

    return compare("5-1", ours, published_text("advance_velocity_thesis_sensitivity"), judge)


def page(tick: Tick) -> Page:
    """Return the page of Table 5-1 and Figures A-23 to A-33."""
    ours = sensitivity_table(tick)
    compared = cells(ours)
    shown = side_by_side(ours, compared)
    curves = wrong_curve_changes()
    body = fill_template(Path(__file__).with_suffix(".md"), shown=shown, curves=curves)
    frigate = load_ship("frigate")
    samples, estimates = wrong_estimates(frigate)
    drawn = {"beliefs": figures.belief_figure(samples, estimates, list(ROWS))}
    return Page(compared, body, drawn, numbers_by_row(ours), ours.reset_index(), shown, 60)


STUDY = Study(
    "Change of VAF with wrong parameters of the ship, points (thesis, Table 5-1)", page, 7
)
