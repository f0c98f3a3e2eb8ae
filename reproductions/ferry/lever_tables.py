"""The CPP optimiser paper's Tables 1 to 3 with our numbers beside, and what they say."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
import scipy
from matplotlib.figure import Figure

from shaftline.baselines.steady_points import steady_point
from shaftline.display import figures
from shaftline.plant import Ship

from ..side_by_side import published
from .lever_points import (
    CALM,
    COMBINATOR,
    CORRECTED,
    PAPERS,
    RAISED,
    WHOLE_ENVELOPE,
    blade_angle,
    pitch_for,
    rises,
)
from .lever_voyage import LEVER, STEP_AT


def paper_form(rows: pd.DataFrame, control: str, beside: bool) -> pd.DataFrame:
    """One of the paper's tables: before the rise of resistance and after it, a line a lever.

    Args:
        rows: of one ship, curve and allowed torque, from :func:`experiment`.
        control: whose table.
        beside: whether to put the paper's number in parentheses.
    """
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
            for when, value, number in zip(("", ", disturbed"), ours, printed, strict=True):
                extra = f" ({number:.{digits}f})" if beside else ""
                line[label + when] = f"{value:.{digits}f}{extra}"
            if name == "sfoc_g_kwh":
                extra = f" ({printed[1] - printed[0]:+.1f})" if beside else ""
                line["variation"] = f"{round(ours[1] - ours[0], 1) + 0.0:+.1f}{extra}"
        lines.append(line)
    return pd.DataFrame(lines)


def against_combinator(rows: pd.DataFrame) -> pd.DataFrame:
    """Optimiser less combinator at equal speed: fuel per mile [%] / SFOC [g/kWh], a column a lever."""
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
    """What the paper's printed consumption means per mile, with the power that our ferry takes.

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
            pitch = pitch_for(ship, shaft, float(row["ship_speed_m_s_after"]), rises()[lever - 1])
            point = steady_point(ship, shaft, pitch, rises()[lever - 1])
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


def asked_rises(ship: Ship) -> pd.DataFrame:
    """Return the rise of resistance that Tables 1 and 2 ask for, each by itself.

    Table 2 holds the thrust: (v0 / v1)^2. Table 1 holds shaft speed and pitch: the rise at which our
    ferry, with its own propeller, slows from the printed speed before to the printed speed after. Where
    both have one rise, the thrust at held shaft speed and pitch grows less with the loss of speed than
    ours.

    Args:
        ship: the ferry, with a resistance that follows the square of the speed.

    Returns:
        One row per lever: rises [%], growth of the thrust [%] that Table 2's rise leaves for Table 1 and
        that of our propeller, and the exponent k of the resistance that fits both tables with our
        propeller, from growth = (speed after in Table 1 / in Table 2)^k, with its rise [%].
    """
    plain = published(PAPERS).loc[COMBINATOR].set_index("condition")
    lines = []
    for lever, rise in enumerate(rises(), 1):
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


def draw(rows: pd.DataFrame, sailed: dict[str, pd.DataFrame]) -> Figure:
    """Savings at the levers above, the voyage through the disturbance below."""
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
