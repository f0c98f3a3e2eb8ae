"""Table 5-1: what wrong knowledge of the ship does to each observer (4 rad/s inflow)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd

from shaftline.observers import follow_record, get_observer, readings_of, variance_accounted_for
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES

from ..cells import Cell, Kind, half_digit
from ..side_by_side import Judged, compare, published_text
from .vaf import ROWS


def _beliefs(ship: Ship) -> dict[str, tuple[Ship, float]]:
    """The ship as believed, and a factor on its torque curve, for each column of the table."""
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
"""By how much a standard deviation of changes to two digits may miss the one that is printed to two."""


def sign_slips(printed: pd.DataFrame) -> list[tuple[str, str]]:
    """Cells whose sign is a misprint, as (row, column): found by the row's own standard deviation.

    A row belongs here if its printed standard deviation does not follow from its changes, and does once
    the sign of one of them is turned; there is then only one such change.

    Args:
        printed: the thesis's table.
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


def _believing(observer: str, believed: Ship, curve: float, readings: Any, dt: float) -> Any:
    record = get_observer(observer).discretise(believed, dt)
    record["ship"]["kq"] *= curve
    record["ship"]["kt"] *= curve
    return follow_record(record, readings)[0]


def wrong_estimates(ship: Ship) -> tuple[Any, dict[tuple[str, str], Any]]:
    """Samples of the 4 rad/s case, and the estimate [m/s] of every row with every belief, shape (n,).

    Args:
        ship: the thesis's frigate.
    """
    samples = CASES["inflow_sine_high"].run(ship)
    readings, beliefs = readings_of(samples), _beliefs(ship)
    return samples, {
        (row, name): _believing(observer, believed, curve, readings, ship.time_step_s)
        for row, observer in ROWS.items()
        for name, (believed, curve) in beliefs.items()
    }


def sensitivity_table(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """VAF [%] with right knowledge, and its change in points with each wrong one."""
    frigate = load_ship("frigate")
    samples = CASES["inflow_sine_high"].run(frigate)
    readings, truth = readings_of(samples), samples["advance_velocity"]
    columns = {}
    for name, (believed, curve) in _beliefs(frigate).items():
        columns[name] = [
            variance_accounted_for(
                truth, _believing(row, believed, curve, readings, frigate.time_step_s)
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
    """Return the cells of Table 5-1 for our changes, from :func:`sensitivity_table`.

    Args:
        ours: scores with right knowledge, and their changes.
    """

    def judge(row: str, column: str, text: str) -> Judged:
        half = half_digit(text, 2)
        if column == "vaf_inflow_sine_high":
            return Kind.FREE, half, "half a unit of the last printed digit"
        if column in {"rms", "sd"}:
            return Kind.FREE, 3.0 * half, f"half a unit of the last printed digit; {_CHANGES}"
        return Kind.FREE, 2.0 * half, _CHANGES

    return compare("5-1", ours, published_text("advance_velocity_thesis_sensitivity"), judge)
