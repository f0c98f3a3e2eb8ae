"""The page and the picture of the storms: :mod:`.results` in words and tables."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.display.tables import markdown

from ..cells import Cell, half_digit, number
from ..side_by_side import published_text
from .experiment import INTERVAL_STEPS, ORDER_M_S, RESISTANCE_FACTOR, Storm
from .results import (
    AWARE,
    CASES,
    EFFICIENCY,
    HELD_SPEED_M_S,
    HIGH_ORDER_M_S,
    OFF,
    ON,
    POWER,
    SEEDS,
    THRUST,
    VENTILATED_SPEEDS,
    Results,
)

_SHOWN_S = 90.0


NEAREST = "high thrust, speed held"
"""The storm that is nearest to the paper's test: a carriage that keeps its speed."""


def cells(beside: pd.DataFrame) -> list[Cell]:
    """Return the paper's ratios beside those of the storm nearest to its test.

    Args:
        beside: ratios with the paper's row first, from :func:`~.storm_results.beside_table_1`.
    """
    digits = published_text("anti_spin_towing_tank")
    with_it, without = digits.loc["anti-spin"], digits.loc["no-anti-spin"]
    rows = beside.set_index("storm")
    return [
        number(
            "Table 1", f"{name}, anti-spin over without", "", float(rows.loc[NEAREST, name]),
            float(a) / float(b),
            float(a) / float(b) * (half_digit(a) / float(a) + half_digit(b) / float(b)),
            "half a unit of the last digit of both printed numbers",
        )
        for name, a, b in zip(beside.columns[1:], with_it, without, strict=True)
    ]  # fmt: skip


def why(results: Results) -> str:
    """Return what the ratios rest on, from the study's own numbers, as list items."""
    heads = results.suction_heads
    loaded = heads["towing tank, 45 rad/s"] / heads["high thrust"]
    cell = _Cells(results.numbers)

    def change(case: str, quantity: str) -> float:
        return 100.0 * (cell.value(case, f"{ON} / {OFF}", quantity) - 1.0)

    gains = [change(case, EFFICIENCY) for case in CASES]
    free, held = ("high thrust", NEAREST)
    per_power = "thrust per power [N/kW]"
    told = ", ".join(f"{name} {head:.2f}" for name, head in heads.items())
    return (
        f"- The energy efficiency number changes by {min(gains):+.1f} to {max(gains):+.1f} % in these "
        "storms, where the paper has +23 %.\n"
        "- Air is drawn in, and blades in air lose, by the suction head of the propeller against the "
        f"static head of the water. Mean suction heads H/R without air are: {told}. At the higher "
        f"order the ship's propellers are loaded {loaded:.1f} times less than the tank's at the printed "
        "limit.\n"
        "- Free at the higher order, the ship's thrust per power changes by "
        f"{change(free, per_power):+.1f} % and her energy efficiency by "
        f"{change(free, EFFICIENCY):+.1f} %, since the number (27) counts thrust "
        "times advance speed and she slows with her thrust. Held at "
        f"her speed, the two are {change(held, per_power):+.1f} and {change(held, EFFICIENCY):+.1f} %.\n"
        "- With fixed shares, lost by depth alone at any shaft speed, the thrust changes by "
        f"{change('fixed shares', THRUST):+.1f} %, the power by {change('fixed shares', POWER):+.1f} % "
        f"and the energy efficiency by {change('fixed shares', EFFICIENCY):+.1f} %."
    )


class _Cells:
    """The study's numbers as cells ``value (low to high)``."""

    def __init__(self, numbers: pd.DataFrame) -> None:
        self.table = numbers.set_index(["case", "controller", "quantity"])

    def __call__(self, case: str, controller: str, quantity: str, style: str = ".3g") -> str:
        found: Any = self.table.loc[(case, controller, quantity)]
        value = f"{found['value']:{style}}"
        if np.isnan(found["low"]):
            return value
        return f"{value} ({found['low']:{style}} to {found['high']:{style}})"

    def value(self, case: str, controller: str, quantity: str) -> float:
        """Return one value."""
        return float(self.table.loc[(case, controller, quantity), "value"])

    def change(self, case: str, controller: str, quantity: str) -> str:
        """Interval of a change against anti-spin off."""
        found: Any = self.table.loc[(case, f"{controller} / {OFF}", quantity)]
        low, high = (100.0 * (found[end] - 1.0) for end in ("low", "high"))
        return f"{low:+.1f} to {high:+.1f} %"


def _table(columns: list[str], rows: list[list[str]]) -> str:
    return markdown(pd.DataFrame(rows, columns=columns))


def body(results: Results, beside: pd.DataFrame) -> str:
    """The page below its title, in Markdown.

    Args:
        results: of the study.
        beside: ratios with the paper's row first, from :func:`~.storm_results.beside_table_1`.
    """
    cell = _Cells(results.numbers)
    ratio = f"{ON} / {OFF}"
    paper = [f"{value:.2f}" for value in beside.iloc[0, 1:]]
    first = [["paper, Table 1", *paper]]
    first += [[c, *(cell(c, ratio, q, ".2f") for q in (THRUST, POWER, EFFICIENCY))] for c in CASES]
    shares = [f"anti-spin at {share:g} / {OFF}" for share in VENTILATED_SPEEDS] + [ratio]
    sweep = [[c, *(cell(c, name, EFFICIENCY, ".2f") for name in shares)] for c in CASES]
    parts = [
        "The frigate of the environment's storm task, head seas of state 6, resistance "
        f"{RESISTANCE_FACTOR:g} times calm water's (assumed), {len(SEEDS)} seeds of 300 s of which the "
        "first 30 are left out, commands every 0.5 s, perfect instruments. In parentheses the bootstrap "
        "95 % interval over the seeds, ratios and changes paired by seed.\n\n"
        f"*Storm task*: order {ORDER_M_S:g} m/s, propellers 3 m deep, ventilation as in the task. *High "
        f"thrust*: order {HIGH_ORDER_M_S:g} m/s. *Speed held*: a hull too heavy to slow down, at "
        f"{HELD_SPEED_M_S:g} m/s, as the paper's carriage. *Shallow*: propellers 2.5 m deep. *Fixed "
        "shares*: ventilation by depth alone from h/R = 1 on, the same shares lost at any shaft "
        "speed.",
        "## Beside the paper's Table 1: anti-spin over without",
        _table(["storm", "thrust", "power", "energy efficiency (27)"], first),
        why(results),
        "Energy efficiency over that without, by omega_v,opt as a share of the calm-water shaft speed "
        "(the paper's 45 rad/s is 0.6 of its highest speed):",
        _table(["storm", *(f"{share:g}" for share in VENTILATED_SPEEDS), "0.92 (kept)"], sweep),
        "## One storm\n\n![Anti-spin on and off in one storm](figures/storms.png)",
        "## What anti-spin does",
    ]
    quantities = dict.fromkeys(
        q for q in results.numbers["quantity"] if "[" in q and "alarms" not in q and "vent" not in q
    )
    for case in CASES:
        rows = [
            [q, *(cell(case, name, q, ".4g").split(" (")[0] for name in (ON, OFF)),
             cell.change(case, ON, q), cell.change(case, AWARE, q)]
            for q in quantities
        ]  # fmt: skip
        columns = [case, ON, OFF, "change, 95 %", "change with sea margin 3, 95 %"]
        parts.append(_table(columns, rows))
    scores = [
        "ventilated [-]", "events: precision", "events: recall", "samples 1 s late: precision",
        "samples 1 s late: recall", "rms error of Q_p / mean Q_p",
    ]  # fmt: skip
    parts += [
        "## What it detects",
        "An event is a run in which the true degree exceeds 0.5; a call counts if it overlaps one or "
        "comes at most 1 s late.",
        _table(
            ["storm", "controller", *scores],
            [
                [c, name, *(cell(c, name, s, ".2f") for s in scores)]
                for c in CASES
                for name in (ON, AWARE, OFF)
            ],
        ),
        "## False alarms in plain seas",
        "The same seas and propellers, ventilation switched off, resistance of calm water: every call "
        "is a wave taken for air. `sea_margin` 3 also asks that the loss be more than three standard "
        "deviations of what the waves do, told from the side on which they add torque. What the calls "
        "cost: the change of ship speed against the controller without anti-spin.",
    ]
    plain = [c for c in dict.fromkeys(results.numbers["case"]) if c not in CASES]
    alarms, speed = "false alarms [1/h]", "ship speed [m/s]"
    rows = [
        [c.split(", no")[0], cell(c, ON, alarms, ".1f"), cell(c, AWARE, alarms, ".1f"),
         cell.change(c, ON, speed), cell.change(c, AWARE, speed)]
        for c in plain
    ]  # fmt: skip
    columns = ["sea, order", "paper's rule [1/h]", "sea margin 3 [1/h]",
               "ship speed lost to it", "with sea margin 3"]  # fmt: skip
    parts.append(_table(columns, rows))
    return "\n\n".join(parts)


def figure(traces: dict[str, Storm], dt: float, ship: int = 0) -> Figure:
    """One ship in time: shaft speed, torque and thrust, and what is detected.

    Args:
        traces: storms by controller, the same seeds.
        dt: the plant's time step [s].
        ship: which of the ships.
    """
    drawn, axes = new_figure(4, 1, (9.5, 8.5))
    interval = INTERVAL_STEPS * dt
    kept = slice(0, round(_SHOWN_S / interval))
    for row, (name, storm) in enumerate(traces.items()):
        time = interval * np.arange(storm.thrust.shape[1])[kept]
        color = (PALETTE[1], PALETTE[0])[row % 2]
        for axis, values, label in (
            (axes[0, 0], storm.shaft_speed, "shaft speed [rad/s]"),
            (axes[1, 0], storm.propeller_torque * 1e-3, "propeller torque [kN m]"),
            (axes[2, 0], storm.thrust * 1e-3, "thrust [kN]"),
        ):
            axis.plot(time, values[ship, kept], color=color, linewidth=1.1, label=name)
            axis.set_ylabel(label, fontsize=9)
        called = storm.detected[ship, kept]
        axis = axes[3, 0]
        axis.fill_between(time, row, row + 0.4 * called, step="post", color=color, linewidth=0)
        truth = storm.ventilation[ship, kept]
        axis.plot(time, row + 0.8 * truth, color=TRUTH, linewidth=0.9)
    axes[0, 0].legend(fontsize=8, frameon=False, loc="upper right")
    axes[3, 0].set_yticks([0.2, 1.2], list(traces), fontsize=8)
    axes[3, 0].set_title("detected (filled) and true degree of ventilation (line)", fontsize=9)
    axes[3, 0].axhline(1.0, color=THESIS, linewidth=0.6)
    axes[3, 0].set_xlabel("time [s]", fontsize=9)
    return drawn
