"""Compare the CPP optimiser with the combinator at five levers, Tables 1 to 3 of the optimiser's paper.

Given to the model: the engine speeds of the combinator, the ship speeds before the disturbance and
the rise of the resistance, 15 % by the text. Fitted: all consumption (the engine map), the engine speeds
of the optimiser (its optima in the map), the pitches before the disturbance and the ship speeds after it
at one lever (propeller, gear and exponent of the resistance, :mod:`.similarity`). Predicted: the ship
speeds after the disturbance at the other four levers and the pitches of the optimiser.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure

from shaftline.baselines.combinator import TORQUE_MARGIN
from shaftline.baselines.combinator_surface import combinator_surface
from shaftline.baselines.steady_points import steady_point
from shaftline.display import figures
from shaftline.plant import Ship, load_ship

from ..cells import Cell, Kind, Reason, Verdict, number
from ..pages import fill_template, label_axis
from ..side_by_side import Page, Study, Tick, published
from . import experiment
from .experiment import (
    CALM,
    COMBINATOR,
    CORRECTED,
    HELD,
    LEVER,
    LEVERS,
    RAISED,
    RISE,
    WHOLE_ENVELOPE,
    pitch_for,
    printed_levers,
)
from .similarity import CALIBRATED_LEVER

PRINTED_TABLES = {COMBINATOR: "Table 1", HELD: "Table 2", CORRECTED: "Table 3"}

HALF_DIGIT = {
    "engine_speed_rpm": 0.5,
    "pitch_deg": 0.05,
    "ship_speed_m_s": 0.005,
    "sfoc_g_kwh": 0.05,
}
"""Half a unit of the last printed digit."""

HALF_PERCENT = 0.005
"""Half a unit of the last digit of the rise of 15 %."""

WHEN = {"before": CALM, "after": RAISED}

_BY_SLOPE = "of the ship speed by the printed slope between the levers"
BASES = {
    "engine_speed_rpm": f"half a digit of the engine speed, and {_BY_SLOPE}",
    "pitch_deg": "half a digit of the pitch and of the pitch at lever 1 that sets the zero, and "
    f"half a digit {_BY_SLOPE}",
    "ship_speed_m_s": "half a digit of the ship speed, of the speed before the disturbance, and of the "
    "rise of 15 %",
    "sfoc_g_kwh": f"half a digit of the consumption, and {_BY_SLOPE}",
}
_EXACT = 1.0 + 1e-9


class _Comparison(NamedTuple):
    """Our numbers and the printed ones of one table."""

    ours: pd.DataFrame  # by condition and lever
    printed: pd.DataFrame  # by lever
    zero: float  # of the printed pitch [deg]
    control: str

    def value(self, quantity: str, lever: int, when: str) -> float:
        """Return our number, the pitch from the printed zero."""
        value = float(self.ours.loc[(WHEN[when], lever), quantity])
        return value + self.zero if quantity == "pitch_deg" else value

    def slope(self, quantity: str, lever: int) -> float:
        """Return how fast a printed quantity changes with the ship speed about a lever, per m/s."""
        values = self.printed[f"{quantity}_before"].to_numpy(dtype=float)
        speeds = self.printed["ship_speed_m_s_before"].to_numpy(dtype=float)
        return float(abs(np.gradient(values, speeds)[lever - 1]))

    def rise_shift(self, lever: int) -> float:
        """Return the change of the speed after the disturbance by half a digit of the rise [m/s]."""
        before, after = (self.value("ship_speed_m_s", lever, when) for when in WHEN)
        return abs(after * math.log(after / before) / math.log(RISE) * HALF_PERCENT / RISE)

    def tolerance(self, quantity: str, lever: int, when: str) -> float:
        """Return half the width of a cell's interval, from the printed digits alone."""
        half = HALF_DIGIT[quantity]
        if quantity == "ship_speed_m_s":
            return (2.0 * half + self.rise_shift(lever) if when == "after" else half) * _EXACT
        if quantity == "engine_speed_rpm" and self.control == COMBINATOR:
            return half * _EXACT
        carried = HALF_DIGIT["ship_speed_m_s"] * self.slope(quantity, lever)
        return (half * (2.0 if quantity == "pitch_deg" else 1.0) + carried) * _EXACT

    def kind(self, quantity: str, lever: int, when: str) -> Kind:
        """Return what our model knew of a number."""
        if quantity == "engine_speed_rpm":
            return Kind.INPUT if self.control == COMBINATOR else Kind.CALIBRATED
        if quantity == "ship_speed_m_s" and when == "before":
            return Kind.INPUT
        free = {
            "ship_speed_m_s": lever != CALIBRATED_LEVER,
            "pitch_deg": when == "after" and self.control != COMBINATOR,
        }
        return Kind.FREE if free.get(quantity) else Kind.CALIBRATED


def table_cells(rows: pd.DataFrame, ship: Ship | None = None) -> list[Cell]:
    """Return each printed number of Tables 1 to 3 with ours."""
    ship = ship or load_ship("ferry-printed")
    surface = combinator_surface(ship, WHOLE_ENVELOPE)
    ours = rows.set_index(["control", "condition", "lever"])
    first = published(experiment.PAPERS).loc[COMBINATOR].iloc[0]
    zero = float(first["pitch_deg_before"]) - float(ours.loc[(COMBINATOR, CALM, 1), "pitch_deg"])
    found = []
    for control, name in PRINTED_TABLES.items():
        table = _Comparison(ours.loc[control], printed_levers(control), zero, control)
        changes = published("cpp_ferry_variations").loc[control].set_index("condition")
        for lever in range(1, LEVERS + 1):
            at_printed = {}
            speed = float(table.printed.loc[lever, "ship_speed_m_s_after"])
            if control != COMBINATOR and (
                point := experiment.optimal_state(ship, surface, speed, RISE)
            ):
                at_printed = experiment.in_units_of_paper(ship, point)
            found += _cells_of_lever(table, name, lever, at_printed)
            found += _variations(table, name, lever, changes.loc[lever])
    return found


def _cells_of_lever(
    table: _Comparison, name: str, lever: int, at_printed: dict[str, float]
) -> list[Cell]:
    """Return the cells of a lever; ``at_printed`` is our optimum at the printed ship speed."""
    found = []
    ends = "our combinator, whose speed the optimiser keeps, ends at"
    if table.control == HELD:
        ends = "at held thrust and 15 % more resistance our ship ends at"
    for when in WHEN:
        speed = table.value("ship_speed_m_s", lever, when)
        for quantity in HALF_DIGIT:
            ours, reason = table.value(quantity, lever, when), None
            printed = float(table.printed.loc[lever, f"{quantity}_{when}"])
            if when == "after" and at_printed and quantity != "ship_speed_m_s":
                own = at_printed[quantity] + (table.zero if quantity == "pitch_deg" else 0.0)
                shift, digits = own - ours, 2 if quantity == "pitch_deg" else 1
                if abs(own - printed) < 0.5 * abs(ours - printed):  # the cause has the larger part
                    text = (
                        f"{ends} {speed:.3f} m/s; at the printed ship speed our optimiser has "
                        f"{own:.{digits}f}, {shift:+.{digits}f} from {ours:.{digits}f}"
                    )
                    reason = Reason(text, shift)
            found.append(
                number(
                    name,
                    f"lever {lever}, {when}",
                    quantity,
                    ours,
                    printed,
                    table.tolerance(quantity, lever, when),
                    BASES[quantity],
                    table.kind(quantity, lever, when),
                    reason,
                )
            )
    return found


def _variations(table: _Comparison, name: str, lever: int, printed: pd.Series) -> list[Cell]:
    """Return the cells of the column "Variation" of one lever: after the disturbance less before it."""
    half, speed = HALF_DIGIT["sfoc_g_kwh"], HALF_DIGIT["ship_speed_m_s"]
    carried = 2.0 * speed * table.slope("sfoc_g_kwh", lever)
    rise = table.rise_shift(lever)
    found = []
    for quantity, tolerance, basis in (
        (
            "ship_speed_m_s",
            speed + rise,
            "half a digit of the variation, and of the rise of 15 %",
        ),
        (
            "sfoc_g_kwh",
            half + carried,
            "half a digit of the variation, and of both ship speeds by the printed slope",
        ),
    ):
        before, after = (table.value(quantity, lever, when) for when in WHEN)
        row, kind = f"lever {lever}, variation", table.kind(quantity, lever, "after")
        value = float(printed[quantity])
        found.append(
            number(name, row, quantity, after - before, value, tolerance * _EXACT, basis, kind)
        )
    return found


def by_quantity(cells: list[Cell]) -> pd.DataFrame:
    """Return the counts of cells by quantity, table and kind, with the largest difference."""
    groups: dict[tuple[str, ...], list[Cell]] = {}
    for cell in cells:
        key = cell.column, cell.row.split(", ")[1], cell.table, str(cell.kind)
        groups.setdefault(key, []).append(cell)
    found = [
        (
            *key,
            len(own),
            sum(cell.verdict is Verdict.MET for cell in own),
            f"{max(abs(cell.ours - cell.printed) for cell in own):.3g}",
        )
        for key, own in groups.items()
    ]
    columns = ["quantity", "when", "table", "kind", "cells", "met", "largest difference"]
    return pd.DataFrame(found, columns=columns)


def table_in_paper_form(rows: pd.DataFrame, control: str) -> pd.DataFrame:
    """Return one of the paper's tables, before and after the rise of resistance, by lever."""
    mine = rows[rows["control"] == control].set_index(["condition", "lever"])
    theirs, lines = printed_levers(control), []
    for lever in theirs.index:
        line: dict[str, Any] = {"lever": lever}
        for name, label, digits in (
            ("engine_speed_rpm", "engine [rpm]", 0),
            ("pitch_deg", "pitch [deg]", 1),
            ("ship_speed_m_s", "ship [m/s]", 2),
            ("sfoc_g_kwh", "SFOC [g/kWh]", 1),
        ):
            ours = [float(mine.loc[(condition, lever), name]) for condition in WHEN.values()]
            printed = [float(theirs.loc[lever, f"{name}_{when}"]) for when in WHEN]
            for when, value, other in zip(("", ", disturbed"), ours, printed, strict=True):
                line[label + when] = f"{value:.{digits}f} ({other:.{digits}f})"
        change = round(ours[1] - ours[0], 1) + 0.0
        lines.append(line | {"variation": f"{change:+.1f} ({printed[1] - printed[0]:+.1f})"})
    return pd.DataFrame(lines)


def against_combinator(rows: pd.DataFrame) -> pd.DataFrame:
    """Return optimiser less combinator at equal speed, fuel per mile [%] / SFOC [g/kWh], by lever."""
    keys = ["ship", "curve", "condition", "lever"]
    fuel, plain = (rows[rows["control"] == c].set_index(keys) for c in (CORRECTED, COMBINATOR))
    lines: dict[tuple[str, ...], dict[str, str]] = {}
    for key in plain.index:
        cell = "not reached"
        if key in fuel.index:
            change = fuel.loc[key, "sfoc_g_kwh"] - plain.loc[key, "sfoc_g_kwh"]
            saved = fuel.loc[key, "saving_percent"]
            # adding zero takes the sign off a rounded nothing
            cell = f"{round(-saved, 2) + 0.0:+.2f} / {round(change, 1) + 0.0:+.1f}"
        lines.setdefault(key[:3], {})[str(key[3])] = cell
    frame = pd.DataFrame.from_dict(lines, orient="index")
    return frame.rename_axis(keys[:3]).reset_index()


def implied_savings(ship: Ship) -> pd.DataFrame:
    """Return the fuel per mile that the printed consumption implies with the power of our ferry.

    Returns:
        One row per lever: brake power [kW] of our ferry at the printed engine and ship speeds after
        the disturbance, for Tables 1 and 3; the printed change of SFOC [%]; change of fuel per mile [%].
    """
    gear, lines = ship.transmission.gear_ratio, []
    for lever in range(1, LEVERS + 1):
        found = []
        for control in (COMBINATOR, CORRECTED):
            row = printed_levers(control).loc[lever]
            shaft = float(row["engine_speed_rpm_after"]) * math.pi / 30.0 / gear
            pitch = pitch_for(ship, shaft, float(row["ship_speed_m_s_after"]), RISE)
            power = steady_point(ship, shaft, pitch, RISE).brake_torque * gear * shaft
            angle = experiment.blade_angle(pitch)
            found.append(
                (power, angle, float(row["pitch_deg_after"]), float(row["sfoc_g_kwh_after"]))
            )
        (power_1, *angle_1, sfoc_1), (power_3, *angle_3, sfoc_3) = found
        ours, theirs = (after - before for before, after in zip(angle_1, angle_3, strict=True))
        gain = sfoc_3 / sfoc_1
        lines.append(
            {
                "lever": str(lever),
                "power, Table 1 [kW]": 1e-3 * power_1,
                "power, Table 3 [kW]": 1e-3 * power_3,
                "pitch change [deg]": f"{ours:+.2f} ({theirs:+.1f})",
                "printed SFOC change [%]": 100.0 * (gain - 1.0),
                "fuel per mile change [%]": 100.0 * (gain * power_3 / power_1 - 1.0),
            }
        )
    return pd.DataFrame(lines)


def implied_rises(ship: Ship) -> pd.DataFrame:
    """Return the rise of resistance that Tables 1 and 2 each imply.

    Table 1 holds shaft speed and pitch: the rise at which our ferry, with its own propeller, slows from
    the printed speed before to the printed speed after. Table 2 holds the thrust: (v0 / v1)^k with the
    exponent k of the ship's resistance.

    Returns:
        One row per lever: rises [%], and the change of the thrust [%] at which the rise of the text
        slows the ship to the speed of Table 2, 0 if the thrust is held.
    """
    lines, exponent = [], ship.hull.resistance_exponent
    held = printed_levers(HELD)
    for lever, row in printed_levers(COMBINATOR).iterrows():
        before, after = (float(row[f"ship_speed_m_s_{when}"]) for when in WHEN)
        lost = before / float(held.loc[lever, "ship_speed_m_s_after"])
        shaft = float(row["engine_speed_rpm_before"]) * math.pi / 30.0
        shaft /= ship.transmission.gear_ratio
        pitch = pitch_for(ship, shaft, before, 1.0)

        def missing(factor: float, at: tuple[float, ...] = (shaft, pitch, after)) -> float:
            return steady_point(ship, at[0], at[1], factor).ship_speed - at[2]

        asked = float(scipy.optimize.brentq(missing, 0.9, 1.5, xtol=1e-9))
        lines.append(
            {
                "lever": str(lever),
                "rise by Table 1 [%]": 100.0 * (asked - 1.0),
                "rise by Table 2 [%]": 100.0 * (lost**exponent - 1.0),
                "change of thrust at the speed of Table 2 [%]": 100.0
                * (RISE / lost**exponent - 1.0),
            }
        )
    return pd.DataFrame(lines)


def draw_levers(rows: pd.DataFrame, voyages: dict[str, pd.DataFrame]) -> Figure:
    """Draw the savings at the levers, and the voyage through the disturbance."""
    figure, axes = figures.new_figure(2, 4, (16.0, 7.0))
    disturbed = rows[(rows["control"] == CORRECTED) & (rows["condition"] == RAISED)]
    styles = {"standard": "o-", "design": "s--", "printed": "^:"}
    for axis, ship in zip(axes[0], disturbed["ship"].unique(), strict=False):
        for i, (curve, line) in enumerate(disturbed[disturbed["ship"] == ship].groupby("curve")):
            axis.plot(
                line["lever"],
                line["saving_percent"],
                styles[str(curve)],
                color=figures.PALETTE[i],
                label=f"against the {curve} curve",
            )
        axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))
        label_axis(axis, "lever", "", f"{ship}, {RAISED}: fuel saved per mile [%]", 9, None, 8)
    shown = {
        "ship_speed_m_s": "ship speed [m/s]",
        "engine_speed_rpm": "engine speed [rpm]",
        "pitch_ratio": "P/D [-]",
        "sfoc_g_kwh": "SFOC [g/kWh]",
    }
    begin = experiment.STEP_AT
    for axis, (name, label) in zip(axes[1], shown.items(), strict=True):
        for i, (control, log) in enumerate(voyages.items()):
            part = log[log["time_s"] > begin - 60.0]
            axis.plot(part["time_s"], part[name], color=figures.PALETTE[i], label=control)
        axis.axvline(begin, color=figures.THESIS, linewidth=0.8)
        label_axis(axis, "time [s]", "", f"ferry-printed, lever {LEVER}: {label}", 9, None)
    axes[1, 0].legend(fontsize=8, frameon=False)
    axes[0, 3].set_axis_off()
    return figure


SHIPS = ("ferry-printed", "ferry", "frigate")
CHANGE = "Optimiser less combinator at equal speed: fuel per mile [%] / SFOC [g/kWh]"
_TABLES = {
    COMBINATOR: "Table 1: combinator",
    HELD: "Table 2: optimiser, thrust held",
    CORRECTED: "Table 3: optimiser, thrust corrected to the combinator's ship speed",
}


def own_size(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the ferry of the paper's size, on the printed curve."""
    return rows[(rows["ship"] == "ferry-printed") & (rows["curve"] == "printed")]


def _shares(cells: list[Cell]) -> dict[str, str]:
    """Return how many cells of each group are met."""

    def of(cells: list[Cell]) -> str:
        return f"{sum(cell.verdict is Verdict.MET for cell in cells)} of {len(cells)}"

    free = [cell for cell in cells if cell.kind is Kind.FREE]
    held = [cell.table == PRINTED_TABLES[HELD] for cell in free]
    speeds = [cell.column == "ship_speed_m_s" for cell in free]
    best = [c for c in cells if c.table != PRINTED_TABLES[COMBINATOR]]
    plain = [c for c in cells if not c.row.endswith("variation")]
    changes = [c for c in cells if c.row.endswith("variation")]
    return {
        "all_met": of(cells),
        "inputs": str(sum(cell.kind is Kind.INPUT for cell in cells)),
        "free_met": of(free),
        "equal_met": of([c for c, h, v in zip(free, held, speeds, strict=True) if v and not h]),
        "held_met": of([c for c, h, v in zip(free, held, speeds, strict=True) if v and h]),
        "pitch_met": of([c for c, v in zip(free, speeds, strict=True) if not v]),
        "rpm_met": of([c for c in best if c.column == "engine_speed_rpm"]),
        "sfoc_met": of([c for c in plain if c.column == "sfoc_g_kwh"]),
        "change_met": of([c for c in changes if c.column == "sfoc_g_kwh"]),
        "loss_met": of([c for c in changes if c.column == "ship_speed_m_s"]),
    }


def _span(values: pd.Series, digits: int = 1) -> str:
    return f"{values.min():.{digits}f} to {values.max():.{digits}f}"


def all_ships(tick: Tick = lambda: None) -> pd.DataFrame:
    """Return the experiment on all ships, with the whole torque envelope and with a margin."""
    frames = []
    for name in SHIPS:
        for allowed in (WHOLE_ENVELOPE, TORQUE_MARGIN):
            frame = experiment.compare_controls(load_ship(name), allowed)
            frame.insert(0, "torque_allowed", allowed)
            frames.append(frame)
            tick()
    return pd.concat(frames, ignore_index=True)


def _findings(rows: pd.DataFrame, cells: list[Cell], implied: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers that the findings of the page name."""
    asked, own = implied_rises(load_ship("ferry-printed")), own_size(rows)
    one, two, thrust = (asked[name] for name in asked.columns[1:])
    fast = (own["lever"] < 5) & (own["condition"] == RAISED) & (own["control"] == CORRECTED)
    means = -implied["fuel per mile change [%]"].iloc[:4]
    states = rows[rows["control"] != COMBINATOR]
    active = states["active"].str.contains("gradient")
    first, second = (states["ship"] == name for name in ("ferry-printed", "ferry"))
    return {
        **_shares(cells),
        "one": _span(one),
        "two": _span(two),
        "thrust": f"{thrust.max():+.1f} to {thrust.min():+.1f}",
        "saved": _span(own.loc[fast, "saving_percent"]),
        "printed": _span(means),
        "apart": f"{np.abs(own.loc[fast, 'saving_percent'].to_numpy() - means).max():.1f}",
        "active": f"{(active & first).sum()} of {first.sum()}",
        "active_ferry": f"{(active & second).sum()} of {second.sum()}",
    }


def page(tick: Tick = lambda: None) -> Page:
    """Return the page of Tables 1 to 3 and of one lever in closed loop."""
    rows, ferry = all_ships(tick), load_ship(SHIPS[0])
    voyages, implied = experiment.simulate_voyages(ferry, tick), implied_savings(ferry)
    whole = rows[rows["torque_allowed"] == WHOLE_ENVELOPE]
    own, changes = own_size(whole), against_combinator(whole)
    cells = table_cells(own)
    body = fill_template(
        Path(__file__).with_suffix(".md"),
        **_findings(whole, cells, implied),
        lever=LEVER,
        rise=100.0 * (RISE - 1.0),
        margin=100 * TORQUE_MARGIN,
        quantities=by_quantity(cells),
        asked=implied_rises(ferry),
        implied=implied,
        tables=[(title, table_in_paper_form(own, control)) for control, title in _TABLES.items()],
        changes=changes,
        voyages=experiment.settled_means(voyages),
        change=CHANGE,
        kept_back=against_combinator(rows[rows["torque_allowed"] == TORQUE_MARGIN]),
    )
    keys = ["ship", "curve", "condition", "control", "lever"]
    numbers = {
        " / ".join(map(str, row[keys])): row.drop([*keys, "active"]).dropna().to_dict()
        for _, row in whole.iterrows()
    }
    return Page(cells, body, {"levers": draw_levers(whole, voyages)}, numbers, rows, changes)


TITLE = "CPP optimiser against combinator at five levers (the paper's Tables 1 to 3)"
STUDY = Study(TITLE, page, 2 * len(SHIPS) + 3)
