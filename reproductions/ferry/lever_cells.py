"""The printed numbers of the CPP optimiser paper's Tables 1 to 3 as cells, on the ferry of its size.

What the model was given: the combinator's engine speeds and the ship speeds before the disturbance. What
something was fitted to: all consumption (the engine map), the engine speeds of the optimiser (the map
is asked to have its optima there), the ship speeds after the disturbance of Table 2 (the rise of
resistance follows from them) and the pitches before it (the hull and the gear were chosen for their
fall). Predicted are the ship speeds after the disturbance in Tables 1 and 3 and the optimiser's pitches.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface
from shaftline.plant import Ship, load_ship

from ..cells import Cell, Kind, Reason, Verdict, number
from ..side_by_side import published
from .lever_points import (
    CALM,
    COMBINATOR,
    CORRECTED,
    HELD,
    PAPERS,
    RAISED,
    WHOLE_ENVELOPE,
    described_briefly,
    optimal,
    rises,
)

PRINTED_TABLES = {COMBINATOR: "Table 1", HELD: "Table 2", CORRECTED: "Table 3"}
VARIATIONS = "cpp_ferry_variations"
"""The column "Variation" of the three tables, in ``reproductions/data``."""

HALF_DIGIT = {
    "engine_speed_rpm": 0.5,
    "pitch_deg": 0.05,
    "ship_speed_m_s": 0.005,
    "sfoc_g_kwh": 0.05,
}
"""Half a unit of the last printed digit."""

WHEN = {"before": CALM, "after": RAISED}

BASES = {
    "engine_speed_rpm": "half a digit of the engine speed, and of the ship speed by the printed slope "
    "between the levers",
    "pitch_deg": "half a digit of the pitch and of the pitch at lever 1 that sets the zero, and half a "
    "digit of the ship speed by the printed slope between the levers",
    "ship_speed_m_s": "half a digit of the ship speed, of the speed before the disturbance, and of the "
    "rise that follows from Table 2",
    "sfoc_g_kwh": "half a digit of the consumption, and of the ship speed by the printed slope between "
    "the levers",
}
_EXACT = 1.0 + 1e-9


class _Comparison(NamedTuple):
    """What every cell of one table needs."""

    ours: pd.DataFrame  # by condition and lever
    printed: pd.DataFrame  # by lever
    zero: float  # of the printed pitch [deg]
    control: str


def _slope(printed: pd.DataFrame, quantity: str, lever: int) -> float:
    """Return how fast a printed quantity changes with the ship speed about a lever, per m/s."""
    values = printed[f"{quantity}_before"].to_numpy(dtype=float)
    speeds = printed["ship_speed_m_s_before"].to_numpy(dtype=float)
    return float(abs(np.gradient(values, speeds)[lever - 1]))


def _rise_shift(table: _Comparison, lever: int) -> float:
    """Return how far the speed after the disturbance moves with Table 2's half digits [m/s]."""
    held = published(PAPERS).loc[HELD].set_index("condition").loc[lever]
    half, rise = HALF_DIGIT["ship_speed_m_s"], rises()[lever - 1]
    share = 2.0 * half * sum(1.0 / float(held[f"ship_speed_m_s_{when}"]) for when in WHEN)
    before, after = (
        float(table.ours.loc[(condition, lever), "ship_speed_m_s"]) for condition in WHEN.values()
    )
    return abs(after * math.log(after / before) / math.log(rise) * share)


def _tolerance(table: _Comparison, quantity: str, lever: int, when: str) -> float:
    """Return half the width of a cell's interval, from the digits of the print alone."""
    half = HALF_DIGIT[quantity]
    if quantity == "ship_speed_m_s":
        own = table.control != HELD and when == "after"
        return (2.0 * half + _rise_shift(table, lever) if own else half) * _EXACT
    if quantity == "engine_speed_rpm" and table.control == COMBINATOR:
        return half * _EXACT
    carried = HALF_DIGIT["ship_speed_m_s"] * _slope(table.printed, quantity, lever)
    return (half * (2.0 if quantity == "pitch_deg" else 1.0) + carried) * _EXACT


def _kind(control: str, quantity: str, when: str) -> Kind:
    if quantity == "engine_speed_rpm":
        return Kind.INPUT if control == COMBINATOR else Kind.CALIBRATED
    if quantity == "sfoc_g_kwh":
        return Kind.CALIBRATED
    if quantity == "pitch_deg":
        return Kind.CALIBRATED if when == "before" or control == COMBINATOR else Kind.FREE
    if when == "before":
        return Kind.INPUT
    return Kind.CALIBRATED if control == HELD else Kind.FREE


def _at_printed_speed(
    ship: Ship, surface: CombinatorSurface, lever: int, printed: pd.Series
) -> dict[str, float]:
    """Return what the optimiser chooses after the disturbance at the printed ship speed of Table 3."""
    point = optimal(ship, surface, float(printed["ship_speed_m_s_after"]), rises()[lever - 1])
    return described_briefly(ship, point) if point is not None else {}


def _reason(
    ours: float, quantity: str, at_printed: dict[str, float], speed: float
) -> Reason | None:
    if quantity not in at_printed:
        return None
    shift = at_printed[quantity] - ours
    return Reason(
        f"our combinator, whose speed the optimiser keeps, ends at {speed:.3f} m/s; at the printed ship "
        f"speed our optimiser has {at_printed[quantity]:.1f}, {shift:+.1f} from {ours:.1f}",
        shift,
    )


def table_cells(rows: pd.DataFrame, ship: Ship | None = None) -> list[Cell]:
    """Return each printed number of Tables 1 to 3 with ours.

    Args:
        rows: of ``ferry-printed`` and curve ``printed``, from :func:`.lever_points.compared`.
        ship: this ferry, by default ``ferry-printed``.
    """
    ship = ship or load_ship("ferry-printed")
    surface = combinator_surface(ship, WHOLE_ENVELOPE)
    ours = rows.set_index(["control", "condition", "lever"])
    first = published(PAPERS).loc[COMBINATOR].iloc[0]
    zero = float(first["pitch_deg_before"]) - float(ours.loc[(COMBINATOR, CALM, 1), "pitch_deg"])
    found = []
    for control, name in PRINTED_TABLES.items():
        printed = published(PAPERS).loc[control].set_index("condition")
        table = _Comparison(ours.loc[control], printed, zero, control)
        changes = published(VARIATIONS).loc[control].set_index("condition")
        for lever in printed.index:
            at_printed = (
                _at_printed_speed(ship, surface, int(lever), printed.loc[lever])
                if control == CORRECTED
                else {}
            )
            found += _cells_of_lever(table, name, int(lever), at_printed)
            found += _variations(table, name, int(lever), changes.loc[lever])
    return found


def _value(table: _Comparison, quantity: str, lever: int, when: str) -> float:
    value = float(table.ours.loc[(WHEN[when], lever), quantity])
    return value + table.zero if quantity == "pitch_deg" else value


def _cells_of_lever(
    table: _Comparison, name: str, lever: int, at_printed: dict[str, float]
) -> list[Cell]:
    found = []
    for when in WHEN:
        speed = _value(table, "ship_speed_m_s", lever, when)
        for quantity in HALF_DIGIT:
            ours = _value(table, quantity, lever, when)
            known = {"engine_speed_rpm", "sfoc_g_kwh"} if when == "after" else set()
            reason = _reason(ours, quantity, at_printed, speed) if quantity in known else None
            found.append(
                number(name, f"lever {lever}, {when}", quantity, ours,
                       float(table.printed.loc[lever, f"{quantity}_{when}"]),
                       _tolerance(table, quantity, lever, when), BASES[quantity],
                       _kind(table.control, quantity, when), reason)
            )  # fmt: skip
    return found


def _variations(table: _Comparison, name: str, lever: int, printed: pd.Series) -> list[Cell]:
    """Return the cells of the column "Variation" of one lever: after the disturbance less before it."""
    found = []
    for quantity in ("ship_speed_m_s", "sfoc_g_kwh"):
        before, after = (_value(table, quantity, lever, when) for when in WHEN)
        half, speed = HALF_DIGIT[quantity], quantity == "ship_speed_m_s"
        if speed:
            tolerance = half + (_rise_shift(table, lever) if table.control != HELD else half)
            basis = "half a digit of the variation, and of the speeds of Table 2 that give the rise"
        else:
            slope = _slope(table.printed, quantity, lever)
            tolerance = half + 2.0 * HALF_DIGIT["ship_speed_m_s"] * slope
            basis = "half a digit of the variation, and of both ship speeds by the printed slope"
        found.append(
            number(name, f"lever {lever}, variation", quantity, after - before,
                   float(printed[quantity]), tolerance * _EXACT, basis,
                   _kind(table.control, quantity, "after"))
        )  # fmt: skip
    return found


def by_quantity(cells: list[Cell]) -> pd.DataFrame:
    """Return the counts of cells by quantity, table and kind, with the largest difference.

    Args:
        cells: from :func:`table_cells`.
    """
    rows = [
        (cell.column, cell.row.split(", ")[1], cell.table, str(cell.kind), cell.verdict,
         abs(cell.ours - cell.printed))
        for cell in cells
    ]  # fmt: skip
    frame = pd.DataFrame(rows, columns=["quantity", "when", "table", "kind", "verdict", "off"])
    found = []
    for key, own in frame.groupby(["quantity", "when", "table", "kind"], sort=False):
        met = int((own["verdict"] == Verdict.MET).sum())
        found.append((*key, len(own), met, f"{own['off'].max():.3g}"))
    columns = ["quantity", "when", "table", "kind", "cells", "met", "largest difference"]
    return pd.DataFrame(found, columns=columns)
