"""Compare the CPP optimiser with the combinator at five levers, Tables 1 to 3 of the optimiser's paper.

Given to the model: the engine speeds of the combinator and the ship speeds before the disturbance.
Fitted: all consumption (the engine map), the engine speeds of the optimiser (its optima in the map),
the ship speeds after the disturbance of Table 2 (the rise of resistance follows from them) and the
pitches before it (hull and gear were chosen by their fall). Predicted: the ship speeds after the
disturbance in Tables 1 and 3 and the pitches of the optimiser.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure

from shaftline.baselines.combinator import TORQUE_MARGIN
from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface
from shaftline.baselines.steady_points import steady_point
from shaftline.display import figures
from shaftline.plant import Ship, load_ship

from ..cells import Cell, Kind, Reason, Verdict, number
from ..pages import fill_template
from ..side_by_side import Page, Study, Tick, published
from .experiment import (
    CALM,
    COMBINATOR,
    CORRECTED,
    HELD,
    LEVER,
    PAPERS,
    RAISED,
    STEP_AT,
    WHOLE_ENVELOPE,
    blade_angle,
    compare_controls,
    in_units_of_paper,
    optimal_state,
    pitch_for,
    resistance_rises,
    settled_means,
    simulate_voyages,
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
    """Our numbers and the printed ones of one table."""

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
    """Return the change of the speed after the disturbance by Table 2's half digits [m/s]."""
    held = published(PAPERS).loc[HELD].set_index("condition").loc[lever]
    half, rise = HALF_DIGIT["ship_speed_m_s"], resistance_rises()[lever - 1]
    share = 2.0 * half * sum(1.0 / float(held[f"ship_speed_m_s_{when}"]) for when in WHEN)
    before, after = (
        float(table.ours.loc[(condition, lever), "ship_speed_m_s"]) for condition in WHEN.values()
    )
    return abs(after * math.log(after / before) / math.log(rise) * share)


def _tolerance(table: _Comparison, quantity: str, lever: int, when: str) -> float:
    """Return half the width of a cell's interval, from the printed digits alone."""
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
    point = optimal_state(
        ship, surface, float(printed["ship_speed_m_s_after"]), resistance_rises()[lever - 1]
    )
    return in_units_of_paper(ship, point) if point is not None else {}


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
    """Return each printed number of Tables 1 to 3 with ours."""
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
    """Return the counts of cells by quantity, table and kind, with the largest difference."""
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


def table_in_paper_form(rows: pd.DataFrame, control: str, beside: bool) -> pd.DataFrame:
    """Return one of the paper's tables, before and after the rise of resistance, by lever."""
    mine = rows[rows["control"] == control].set_index(["condition", "lever"])
    theirs = published(PAPERS).loc[control].set_index("condition")
    lines = []
    for lever in theirs.index:
        line: dict[str, Any] = {"lever": lever}
        for name, label, digits in (
            ("engine_speed_rpm", "engine [rpm]", 0), ("pitch_deg", "pitch [deg]", 1),
            ("ship_speed_m_s", "ship [m/s]", 2), ("sfoc_g_kwh", "SFOC [g/kWh]", 1),
        ):  # fmt: skip
            ours = [float(mine.loc[(c, lever), name]) for c in (CALM, RAISED)]
            printed = [float(theirs.loc[lever, f"{name}_{w}"]) for w in ("before", "after")]
            for when, value, printed_value in zip(("", ", disturbed"), ours, printed, strict=True):
                extra = f" ({printed_value:.{digits}f})" if beside else ""
                line[label + when] = f"{value:.{digits}f}{extra}"
            if name == "sfoc_g_kwh":
                extra = f" ({printed[1] - printed[0]:+.1f})" if beside else ""
                line["variation"] = f"{round(ours[1] - ours[0], 1) + 0.0:+.1f}{extra}"
        lines.append(line)
    return pd.DataFrame(lines)


def against_combinator(rows: pd.DataFrame) -> pd.DataFrame:
    """Return optimiser less combinator at equal speed, fuel per mile [%] / SFOC [g/kWh], by lever."""
    keys = ["ship", "curve", "condition", "lever"]
    fuel = rows[rows["control"] == CORRECTED].set_index(keys)
    plain = rows[rows["control"] == COMBINATOR].set_index(keys)
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
    tables, gear = published(PAPERS), ship.transmission.gear_ratio
    lines = []
    for lever in range(1, 6):
        power, sfoc, angle = {}, {}, {}
        for control in (COMBINATOR, CORRECTED):
            row = tables.loc[control].set_index("condition").loc[lever]
            shaft = float(row["engine_speed_rpm_after"]) * math.pi / 30.0 / gear
            pitch = pitch_for(
                ship, shaft, float(row["ship_speed_m_s_after"]), resistance_rises()[lever - 1]
            )
            point = steady_point(ship, shaft, pitch, resistance_rises()[lever - 1])
            power[control] = point.brake_torque * gear * shaft
            sfoc[control] = float(row["sfoc_g_kwh_after"])
            angle[control] = blade_angle(pitch), float(row["pitch_deg_after"])
        gain = sfoc[CORRECTED] / sfoc[COMBINATOR]
        ours, theirs = (angle[CORRECTED][i] - angle[COMBINATOR][i] for i in (0, 1))
        lines.append(
            {
                "lever": str(lever),
                "power, Table 1 [kW]": 1e-3 * power[COMBINATOR],
                "power, Table 3 [kW]": 1e-3 * power[CORRECTED],
                "pitch change [deg]": f"{ours:+.2f} ({theirs:+.1f})",
                "printed SFOC change [%]": 100.0 * (gain - 1.0),
                "fuel per mile change [%]": 100.0
                * (gain * power[CORRECTED] / power[COMBINATOR] - 1.0),
            }
        )
    return pd.DataFrame(lines)


def implied_rises(ship: Ship) -> pd.DataFrame:
    """Return the rise of resistance that Tables 1 and 2 each imply.

    Table 2 holds the thrust: (v0 / v1)^2. Table 1 holds shaft speed and pitch: the rise at which our
    ferry, with its own propeller, slows from the printed speed before to the printed speed after. Where
    both have one rise, the thrust at held shaft speed and pitch grows less with the loss of speed than
    ours.

    Returns:
        One row per lever: rises [%], growth of the thrust [%] that Table 2's rise leaves for Table 1 and
        that of our propeller, and the exponent k of the resistance that fits both tables with our
        propeller, from growth = (speed after in Table 1 / in Table 2)^k, with its rise [%].
    """
    plain = published(PAPERS).loc[COMBINATOR].set_index("condition")
    lines = []
    for lever, rise in enumerate(resistance_rises(), 1):
        before, after = (
            float(plain.loc[lever, f"ship_speed_m_s_{w}"]) for w in ("before", "after")
        )
        shaft = float(plain.loc[lever, "engine_speed_rpm_before"]) * math.pi / 30.0
        shaft /= ship.transmission.gear_ratio
        pitch = pitch_for(ship, shaft, before, 1.0)

        def missing(factor: float, at: tuple[float, ...] = (shaft, pitch, after)) -> float:
            return steady_point(ship, at[0], at[1], factor).ship_speed - at[2]

        asked = float(scipy.optimize.brentq(missing, 0.9, 1.5, xtol=1e-9))
        squared = (after / before) ** 2
        held = before / math.sqrt(rise)
        exponent = math.log(asked * squared) / math.log(after / held)
        lines.append(
            {
                "lever": str(lever),
                "rise by Table 2 [%]": 100.0 * (rise - 1.0),
                "rise by Table 1 [%]": 100.0 * (asked - 1.0),
                "growth of thrust in Table 1 with the rise of Table 2 [%]": 100.0
                * (rise * squared - 1.0),
                "growth of thrust of our propeller [%]": 100.0 * (asked * squared - 1.0),
                "exponent of the resistance that fits both [-]": exponent,
                "its rise [%]": 100.0 * ((before / held) ** exponent - 1.0),
            }
        )
    return pd.DataFrame(lines)


def draw_levers(rows: pd.DataFrame, sailed: dict[str, pd.DataFrame]) -> Figure:
    """Draw the savings at the levers, and the voyage through the disturbance."""
    figure, axes = figures.new_figure(2, 4, (16.0, 7.0))
    whole = rows[(rows["torque_allowed"] == WHOLE_ENVELOPE) & (rows["control"] == CORRECTED)]
    disturbed = whole[whole["condition"] == RAISED]
    styles = {"standard": "o-", "design": "s--", "printed": "^:"}
    for axis, ship in zip(axes[0], disturbed["ship"].unique(), strict=False):
        for i, (curve, line) in enumerate(disturbed[disturbed["ship"] == ship].groupby("curve")):
            axis.plot(line["lever"], line["saving_percent"], styles[str(curve)],
                      color=figures.PALETTE[i], label=f"against the {curve} curve")  # fmt: skip
        axis.set_title(f"{ship}, {RAISED}: fuel saved per mile [%]", fontsize=9)
        axis.set_xlabel("lever", fontsize=9)
        axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))
        axis.legend(fontsize=8, frameon=False)
    shown = (("ship_speed_m_s", "ship speed [m/s]"), ("engine_speed_rpm", "engine speed [rpm]"),
             ("pitch_ratio", "P/D [-]"), ("sfoc_g_kwh", "SFOC [g/kWh]"))  # fmt: skip
    for axis, (name, label) in zip(axes[1], shown, strict=True):
        for i, (control, log) in enumerate(sailed.items()):
            part = log[log["time_s"] > STEP_AT - 60.0]
            axis.plot(part["time_s"], part[name], color=figures.PALETTE[i], label=control)
        axis.axvline(STEP_AT, color=figures.THESIS, linewidth=0.8)
        axis.set_title(f"ferry-printed, lever {LEVER}: {label}", fontsize=9)
        axis.set_xlabel("time [s]", fontsize=9)
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


def _shares(cells: list[Cell]) -> dict[str, int]:
    """Return numbers of cells, and of those that are met, by quantity."""
    plain = [c for c in cells if not c.row.endswith("variation") and c.column != "pitch_deg"]
    given = [c for c in plain if c.kind is Kind.INPUT]
    sfoc = [c for c in plain if c.column == "sfoc_g_kwh"]
    rest = [c for c in plain if c not in given and c not in sfoc]
    speeds = [c for c in rest if c.column == "ship_speed_m_s"]
    groups = {
        "sfoc": sfoc,
        "rest": rest,
        "rpm": [c for c in rest if c.column == "engine_speed_rpm"],
        "held": [c for c in speeds if c.kind is Kind.CALIBRATED],
        "speed": [c for c in speeds if c.kind is Kind.FREE],
        "change": [c for c in cells if c.row.endswith("variation") and c.column == "sfoc_g_kwh"],
    }
    found = {"inputs": len(given)}
    for name, group in groups.items():
        found[f"{name}_all"] = len(group)
        found[f"{name}_met"] = sum(c.verdict is Verdict.MET for c in group)
    return found


def _span(values: pd.Series, digits: int = 1) -> str:
    return f"{values.min():.{digits}f} to {values.max():.{digits}f}"


def experiment(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Return the experiment on all ships, with the whole torque envelope and with a margin."""
    frames = []
    for name in SHIPS:
        for allowed in (WHOLE_ENVELOPE, TORQUE_MARGIN):
            frame = compare_controls(load_ship(name), allowed)
            frame.insert(0, "torque_allowed", allowed)
            frames.append(frame)
            tick()
    return pd.concat(frames, ignore_index=True)


def whole_envelope(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows in which both controls may use the engine's whole torque limit."""
    return rows[rows["torque_allowed"] == WHOLE_ENVELOPE]


def _findings(rows: pd.DataFrame, cells: list[Cell], implied: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers that the findings of the page name."""
    asked, own = implied_rises(load_ship("ferry-printed")), own_size(rows)
    two, one, slope, mine, steep, large = (asked[name] for name in asked.columns[1:])
    saved = own[
        (own["lever"] < 5) & (own["condition"] == RAISED) & (own["control"] == CORRECTED)
    ]["saving_percent"]  # fmt: skip
    plain = own[own["control"] == COMBINATOR].set_index(["condition", "lever"])["ship_speed_m_s"]
    states = rows[rows["control"] != COMBINATOR]
    active = states["active"].str.contains("gradient")
    first, second = (states["ship"] == name for name in ("ferry-printed", "ferry"))
    return {
        "met": sum(cell.verdict is Verdict.MET for cell in cells), "all": len(cells),
        **_shares(cells), "two": _span(two), "one": _span(one), "slope": _span(slope),
        "own": _span(mine), "lost": _span(plain["calm"] - plain[RAISED], 2), "steep": _span(steep),
        "large": _span(large, 0), "saved": _span(saved),
        "printed": _span(-implied["fuel per mile change [%]"].iloc[:4]),
        "active": f"{(active & first).sum()} of {first.sum()}",
        "active_ferry": f"{(active & second).sum()} of {second.sum()}",
    }  # fmt: skip


def page(tick: Tick = lambda: None) -> Page:
    """Return the page of Tables 1 to 3 and of one lever in closed loop."""
    rows, ferry = experiment(tick), load_ship(SHIPS[0])
    voyages, implied = simulate_voyages(ferry, tick), implied_savings(ferry)
    whole = whole_envelope(rows)
    cells = table_cells(own_size(whole))
    body = fill_template(
        Path(__file__).with_suffix(".md"), **_findings(whole, cells, implied), lever=LEVER,
        rise=100.0 * (resistance_rises()[LEVER - 1] - 1.0), margin=100 * TORQUE_MARGIN,
        quantities=by_quantity(cells), asked=implied_rises(ferry), implied=implied,
        tables=[(t, table_in_paper_form(own_size(whole), c, True)) for c, t in _TABLES.items()],
        changes=against_combinator(whole), voyages=settled_means(voyages), change=CHANGE,
        kept_back=against_combinator(rows[rows["torque_allowed"] == TORQUE_MARGIN]),
    )  # fmt: skip
    keys = ["ship", "curve", "condition", "control", "lever"]
    numbers = {
        " / ".join(map(str, row[keys])): row.drop([*keys, "active"]).dropna().to_dict()
        for _, row in whole.iterrows()
    }
    drawn = {"levers": draw_levers(rows, voyages)}
    return Page(cells, body, drawn, numbers, rows, against_combinator(whole))


STUDY = Study(
    "CPP optimiser against combinator at five levers (the paper's Tables 1 to 3)",
    page,
    2 * len(SHIPS) + 3,
)
