"""Page of KVLCC2: wake from straight parts, a user-defined wake term, free-running zig-zags.

Run ``python -m reproductions kvlcc2 --recordings FOLDER --out docs/results``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import ESTIMATE, PALETTE, THESIS
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME

from ..pages import fill_template, make_parser
from ..writing import Panel, against_measured, draw, interval, write_results
from . import oblique, runs, turning
from .runs import BEFORE, PRINTED_DEDUCTION, PRINTED_WAKE, RESISTANCE, SMALL, UNSEEN, WAKE

TITLE = "KVLCC2: wake, propeller in oblique flow and manoeuvring of a tanker model"
SHOWN = ("z_05_01", UNSEEN)  # runs of the figure
_LABELS = {
    WAKE: ("wake fraction w", ".3f"),
    runs.EFFICIENCY: ("eta_R", ".4f"),
    RESISTANCE: ("c1 [N s2/m2]", ".1f"),
}


class Findings(NamedTuple):
    """Results of the page."""

    ship: Ship  # with the printed values
    runs: runs.Runs  # all thirteen
    small: Identification  # from the parts of small drift
    first: Identification  # from the rows before the first rudder execute
    refused: dict[tuple[str, ...], str]  # messages of runs.refusals
    sensitivity: pd.DataFrame  # from runs.sensitivity
    others: dict[str, Identification]  # from runs.identify_variants
    own: oblique.Own  # with user-defined terms
    turning: turning.Turning  # the manoeuvring ship


def main() -> None:
    """Identify, evaluate, and write ``kvlcc2.md``, its table and its figures."""
    parser = make_parser("kvlcc2", __doc__, "out/kvlcc2", recordings="folder of the CSVs")
    options = parser.parse_args()
    known = runs.load_runs(options.recordings)
    ship = runs.ship_of(options.recordings)
    small, first = (runs.identify_straight(ship, known, by) for by in (SMALL, BEFORE))
    found = Findings(
        ship,
        known,
        small,
        first,
        runs.refusals(ship, known),
        runs.sensitivity(ship, known),
        runs.identify_variants(ship, known, SMALL),
        oblique.own_terms(ship, known),
        turning.simulate_all(options.recordings, known),
    )
    print(found.small.summary())
    write(options.out, found)


def write(folder: Path, found: Findings) -> None:
    """Write ``kvlcc2.md``, ``kvlcc2.csv`` and the figures."""
    ships = {"small_drift": found.small.identified, "before_rudder": found.first.identified}
    table = runs.zigzag_errors(found.ship, ships, found.runs)
    drawn = {
        "": figure_of(found),
        "-own-term": oblique.figure_of(found.own, found.runs),
        "-turning": turning.figure_of(found.turning, found.runs),
    }
    fields = _fields(found, table)
    write_results(__file__, folder, TITLE, table, drawn, "--recordings FOLDER", **fields)


def _fields(found: Findings, table: pd.DataFrame) -> dict[str, Any]:
    """Return the fields of the page."""
    before = [run.iloc[slice(*runs.straight_rows(run, BEFORE)[0])] for run in found.runs.values()]
    seen, unseen = (table[table["unseen"] == word] for word in ("no", "yes"))
    fitted = {name: run for name, run in found.runs.items() if name != UNSEEN}
    better = seen["thrust_small_drift_N"] < seen["thrust_before_N"]
    settled = found.sensitivity[found.sensitivity["from_s"] > 0.0]
    widest = settled["wake_fraction"].idxmax()
    straight = {name for name, run in fitted.items() if runs.straight_rows(run, SMALL)}
    numbers: dict[str, Any] = {
        "rises": [float(rows[runs.THRUST].iloc[-1] - rows[runs.THRUST].iloc[0]) for rows in before],
        "lasts": [0.05 * len(rows) for rows in before],
        "speeds": [float(p[runs.SPEED].mean()) for p in runs.straight_parts(found.runs, SMALL)],
        "sides": _sides(fitted),
        "density_shift": found.others["density"].parameters[WAKE] - found.small.parameters[WAKE],
        "ratio": (1.0 - PRINTED_DEDUCTION) / found.small.parameters[RESISTANCE],
        "start": found.ship.parameter(RESISTANCE).value,
        "better": int(better.sum()),
        "worse": ", ".join(seen["run"][~better]),
        "straight_runs": ", ".join(sorted(straight)),
        "whole": runs.best_wake(found.ship, *fitted.values())[0],
        "shares": 1.0 - table["thrust_least_N"] / table["thrust_before_N"],
        "spread": settled["wake_fraction"],
        "widest_parts": int(settled["parts"].loc[widest]),
    }
    own, last = found.own, found.runs[UNSEEN]
    own_before, own_after, own_squares = (
        oblique.errors_in_flow(ship, last) for ship in (own.ship, own.named.corrected, own.squares)
    )
    return {
        "found": found, "wake": PRINTED_WAKE, "t": PRINTED_DEDUCTION, "density": runs.DENSITY,
        "cold": runs.FRESH_COLD, "approach": runs.APPROACH_SPEED, "small": SMALL, "before": BEFORE,
        "held": UNSEEN, "estimates": _estimates(found), "n": numbers, "ratio": _ratio(found.small),
        "w_small": interval(_estimate(found.small, WAKE), ".3f"),
        "w_first": interval(_estimate(found.first, WAKE), ".3f"),
        "c1": interval(_estimate(found.small, RESISTANCE), ".1f"),
        "deduction": interval(_estimate(found.others["deduction"], runs.DEDUCTION), ".3f"),
        "zigzags": _zigzags(table), "row": unseen.iloc[0], "ob": oblique,
        "torque": [1e3 * seen[f"torque_{w}_N_m"].mean() for w in ("before", "small_drift")],
        "sensitivity": _sensitivity(found), "auto": found.others["auto"], "own_before": own_before,
        "own_after": own_after, "own_squares": own_squares,
        "turning_section": turning_section(found.turning),
    }  # fmt: skip


def turning_section(found: turning.Turning) -> str:
    """Return the section on the manoeuvring ship below its heading."""
    return fill_template(
        Path(__file__).with_name("turning.md"),
        turn=turning,
        found=found,
        held=UNSEEN,
        errors=turning.errors_table(found),
        estimates=turning.estimates_table(found),
        response=found.response,
        neutral=np.degrees(found.response.neutral),
    )


def _estimate(identification: Identification, key: str) -> Any:
    return next(e for e in identification.estimates if e.key == key)


def _ratio(one: Identification) -> str:
    """Return (1 - t) / c1 with its 95 % interval as text."""
    e, kept = _estimate(one, RESISTANCE), 1.0 - PRINTED_DEDUCTION
    low, high = e.ci95
    return f"{kept / e.value:.4f} ({kept / high:.4f} to {kept / low:.4f})"


def _estimates(found: Findings) -> pd.DataFrame:
    rows = []
    for by, one in ((SMALL, found.small), (BEFORE, found.first)):
        parts = runs.straight_parts(found.runs, by)
        row = {"parts": f"{by.title}: {len(parts)}, {sum(map(len, parts))} rows"}
        row |= {label: interval(_estimate(one, key), f) for key, (label, f) in _LABELS.items()}
        rows.append(row | {"(1 - t) / c1 [m2/(N s2)]": _ratio(one)})
    return pd.DataFrame(rows)


def _sides(fitted: runs.Runs) -> list[float]:
    """Return the mean thrust [N] of the straight parts that drift to either side, in rising order."""
    means: dict[bool, list[float]] = {True: [], False: []}
    for run in fitted.values():
        for a, b in runs.straight_rows(run, SMALL):
            rows = run.iloc[a:b]
            means[bool(rows[runs.SWAY].mean() > 0.0)].append(float(rows[runs.THRUST].mean()))
    return sorted(float(np.mean(side)) for side in means.values())


def _zigzags(table: pd.DataFrame) -> pd.DataFrame:
    pairs = zip(table["thrust_least_N"], table["best_wake"], strict=True)
    return pd.DataFrame(
        {
            "run": table["run"].where(table["unseen"] == "no", table["run"] + ", held out"),
            f"w {PRINTED_WAKE:.2f}, printed": table["thrust_before_N"],
            SMALL.title: table["thrust_small_drift_N"],
            BEFORE.title: table["thrust_before_rudder_N"],
            "best constant wake of this run": [f"{least:.2f} (w {w:.3f})" for least, w in pairs],
        }
    )


def _sensitivity(found: Findings) -> pd.DataFrame:
    rows = []
    for row in found.sensitivity.to_dict("records"):
        limits = (
            "until the rudder moves"
            if row["title"] == BEFORE.title
            else (
                f"drift {row['drift_deg']:g}, yaw {row['yaw_deg_s']:g}, rudder {row['rudder_deg']:g}, "
                f"from {row['from_s']:g} s"
            )
        )
        w, half = row["wake_fraction"], 1.96 * row["wake_fraction_se"]
        rows.append(
            {
                "limits, degrees, degrees/s": limits,
                "parts": row["parts"],
                "rows": row["rows"],
                "w": f"{w:.3f} ({w - half:.3f} to {w + half:.3f})",
                "eta_R": f"{row['relative_rotative_efficiency']:.4f}",
                "c1": f"{row['resistance_coefficient_N_s2_m2']:.1f}",
            }
        )
    return pd.DataFrame(rows)


def figure_of(found: Findings) -> Figure:
    """Draw the thrust of two zig-zags, measured, printed and identified; straight parts are shaded."""
    wake, panels = found.small.parameters[WAKE], list[Panel]()
    labels = f"w = {PRINTED_WAKE:.2f}, printed", f"w = {wake:.3f}, straight parts"
    ships = dict(zip(labels, (found.ship, found.small.identified), strict=True))
    for name in SHOWN:
        run = found.runs[name]
        speeds = run[runs.SPEED].to_numpy(), run[SHAFT_SPEED].to_numpy()
        thrusts = {label: runs.loads_at(ship, *speeds)[0] for label, ship in ships.items()}
        lines = against_measured(run[TIME], run[runs.THRUST], thrusts, (THESIS, ESTIMATE))
        title = f"{name}{', held out' if name == UNSEEN else ''}"
        panels.append(Panel(lines, {"title": title, "ylabel": "thrust [N]"}, 0 if panels else 3))
    figure, run = draw(panels, (10.0, 6.4), xlabel="time [s]"), found.runs[SHOWN[0]]
    for a, b in runs.straight_rows(run, SMALL):
        ends = run[TIME].iloc[[a, b - 1]]
        figure.axes[0].axvspan(*ends, color=PALETTE[2], alpha=0.25)
    return figure
