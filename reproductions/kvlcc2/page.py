"""Page of KVLCC2: wake from straight parts, a user-defined wake term, free-running zig-zags.

Run ``python -m reproductions kvlcc2 --recordings FOLDER --out docs/results``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import write_table
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME

from ..pages import fill_template, make_parser
from . import oblique, turning
from .runs import (
    APPROACH_SPEED,
    BEFORE,
    DEDUCTION,
    DENSITY,
    EFFICIENCY,
    FRESH_COLD,
    PRINTED_DEDUCTION,
    PRINTED_WAKE,
    RESISTANCE,
    SMALL,
    SPEED,
    SWAY,
    THRUST,
    UNSEEN,
    WAKE,
    Runs,
    best_wake,
    identify_straight,
    identify_variants,
    load_runs,
    loads_at,
    refusals,
    sensitivity,
    ship_of,
    straight_parts,
    straight_rows,
    zigzag_errors,
)

COMMAND = "python -m reproductions kvlcc2 --recordings FOLDER --out docs/results"
NAME, TITLE = "kvlcc2", "KVLCC2: wake, propeller in oblique flow and manoeuvring of a tanker model"
SHOWN = ("z_05_01", UNSEEN)
"""Runs of the figure."""

_LABELS = {WAKE: ("wake fraction w", 3), EFFICIENCY: ("eta_R", 4), RESISTANCE: ("c1 [N s2/m2]", 1)}


@dataclass(frozen=True)
class Findings:
    """Results of the page.

    Args:
        ship: ship with the printed values.
        runs: all thirteen.
        small: identification from the parts of small drift.
        first: identification from the rows before the first rudder execute.
        refused: messages of :func:`.runs.refusals`.
        sensitivity: from :func:`.runs.sensitivity`.
        others: from :func:`.runs.identify_variants`.
        own: results with user-defined terms.
        turning: results of the manoeuvring ship.
    """

    ship: Ship
    runs: Runs
    small: Identification
    first: Identification
    refused: dict[tuple[str, ...], str]
    sensitivity: pd.DataFrame
    others: dict[str, Identification]
    own: oblique.Own
    turning: turning.Turning


def main() -> None:
    """Identify, evaluate, and write ``kvlcc2.md``, its table and its figures."""
    parser = make_parser("kvlcc2", __doc__, "out/kvlcc2", recordings="folder of the CSVs")
    options = parser.parse_args()
    runs = load_runs(options.recordings)
    ship = ship_of(options.recordings)
    found = Findings(
        ship, runs, identify_straight(ship, runs, SMALL), identify_straight(ship, runs, BEFORE),
        refusals(ship, runs), sensitivity(ship, runs), identify_variants(ship, runs, SMALL),
        oblique.own_terms(ship, runs), turning.simulate_all(options.recordings, runs),
    )  # fmt: skip
    write(options.out, found)
    print(found.small.summary())
    print(f"page: {options.out / f'{NAME}.md'}")


def write(folder: Path, found: Findings) -> None:
    """Write ``kvlcc2.md``, ``kvlcc2.csv`` and the figures."""
    ships = {"small_drift": found.small.identified, "before_rudder": found.first.identified}
    table = zigzag_errors(found.ship, ships, found.runs)
    write_table(folder, NAME, TITLE, COMMAND, table, body_of(found, table))
    drawn = {
        NAME: figure_of(found),
        f"{NAME}-own-term": oblique.figure_of(found.own, found.runs),
        f"{NAME}-turning": turning.figure_of(found.turning, found.runs),
    }
    for name, figure in drawn.items():
        figures.save(figure, folder / "figures" / f"{name}.png")


def body_of(found: Findings, table: pd.DataFrame) -> str:
    """Return the page below its title."""
    before = {
        name: run.iloc[slice(*straight_rows(run, BEFORE)[0])] for name, run in found.runs.items()
    }
    rises = [float(rows[THRUST].iloc[-1] - rows[THRUST].iloc[0]) for rows in before.values()]
    seen, unseen = (table[table["unseen"] == word] for word in ("no", "yes"))
    better = seen["thrust_small_drift_N"] < seen["thrust_before_N"]
    settled = found.sensitivity[found.sensitivity["from_s"] > 0.0]
    widest = settled["wake_fraction"].idxmax()
    deduction = next(e for e in found.others["deduction"].estimates if e.key == DEDUCTION)
    numbers: dict[str, Any] = {
        "rises": rises,
        "lasts": [0.05 * len(rows) for rows in before.values()],
        "speeds": [float(part[SPEED].mean()) for part in straight_parts(found.runs, SMALL)],
        "sides": _sides(found.runs),
        "density_shift": found.others["density"].parameters[WAKE] - found.small.parameters[WAKE],
        "ratio": (1.0 - PRINTED_DEDUCTION) / found.small.parameters[RESISTANCE],
        "start": found.ship.parameter(RESISTANCE).value,
        "better": int(better.sum()),
        "worse": ", ".join(seen["run"][~better]),
        "straight_runs": ", ".join(
            sorted(n for n, r in found.runs.items() if n != UNSEEN and straight_rows(r, SMALL))
        ),
        "whole": best_wake(found.ship, *(r for n, r in found.runs.items() if n != UNSEEN))[0],
        "shares": 1.0 - table["thrust_least_N"] / table["thrust_before_N"],
        "spread": settled["wake_fraction"],
        "widest_parts": int(settled["parts"].loc[widest]),
    }
    return fill_template(
        Path(__file__).with_name("page.md"), found=found, wake=PRINTED_WAKE, t=PRINTED_DEDUCTION,
        density=DENSITY, cold=FRESH_COLD, approach=APPROACH_SPEED, small=SMALL, before=BEFORE,
        held=UNSEEN, estimates=_estimates(found), w_small=_interval(found.small, WAKE, 3),
        w_first=_interval(found.first, WAKE, 3), n=numbers, ratio=_ratio(found.small),
        c1=_interval(found.small, RESISTANCE, 1), deduction=deduction, zigzags=_zigzags(table),
        row=unseen.iloc[0],
        torque=[1e3 * seen[f"torque_{w}_N_m"].mean() for w in ("before", "small_drift")],
        ob=oblique, turn=turning, sensitivity=_sensitivity(found),
        auto=found.others["auto"], own_before=oblique.errors_in_flow(found.own.ship, found.runs[UNSEEN]),
        own_after=oblique.errors_in_flow(found.own.named.corrected, found.runs[UNSEEN]),
        own_squares=oblique.errors_in_flow(found.own.squares, found.runs[UNSEEN]),
        turning_section=turning_section(found.turning),
    )  # fmt: skip


def turning_section(found: turning.Turning) -> str:
    """Return the section on the manoeuvring ship below its heading."""
    return fill_template(
        Path(__file__).with_name("turning.md"), turn=turning, found=found, held=UNSEEN,
        errors=turning.errors_table(found), estimates=turning.estimates_table(found),
        response=found.response, neutral=np.degrees(found.response.neutral),
    )  # fmt: skip


def _interval(identification: Identification, key: str, digits: int) -> str:
    e = next(e for e in identification.estimates if e.key == key)
    low, high = e.ci95
    return f"{e.value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _ratio(one: Identification) -> str:
    e = next(e for e in one.estimates if e.key == RESISTANCE)
    low, high = e.ci95
    kept = 1.0 - PRINTED_DEDUCTION
    return f"{kept / e.value:.4f} ({kept / high:.4f} to {kept / low:.4f})"


def _estimates(found: Findings) -> pd.DataFrame:
    rows = []
    for by, one in ((SMALL, found.small), (BEFORE, found.first)):
        parts = straight_parts(found.runs, by)
        row = {"parts": f"{by.title}: {len(parts)}, {sum(map(len, parts))} rows"}
        row |= {label: _interval(one, key, digits) for key, (label, digits) in _LABELS.items()}
        rows.append(row | {"(1 - t) / c1 [m2/(N s2)]": _ratio(one)})
    return pd.DataFrame(rows)


def _sides(runs: Runs) -> list[float]:
    """Return the mean thrust [N] of the straight parts that drift to either side, in rising order."""
    means: dict[bool, list[float]] = {True: [], False: []}
    for name, run in runs.items():
        for a, b in straight_rows(run, SMALL) if name != UNSEEN else []:
            rows = run.iloc[a:b]
            means[bool(rows[SWAY].mean() > 0.0)].append(float(rows[THRUST].mean()))
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
        limits = "until the rudder moves" if row["title"] == BEFORE.title else (
            f"drift {row['drift_deg']:g}, yaw {row['yaw_deg_s']:g}, rudder {row['rudder_deg']:g}, "
            f"from {row['from_s']:g} s"
        )  # fmt: skip
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
    figure, axes = figures.new_figure(len(SHOWN), 1, (10.0, 6.4))
    for axis, name in zip(axes[:, 0], SHOWN, strict=True):
        run = found.runs[name]
        time = run[TIME]
        axis.plot(time, run[THRUST], color=figures.TRUTH, linewidth=0.8, label="measured")
        for ship, label, colour, style in (
            (found.ship, f"w = {PRINTED_WAKE:.2f}, printed", figures.THESIS, "--"),
            (
                found.small.identified,
                f"w = {found.small.parameters[WAKE]:.3f}, straight parts",
                figures.ESTIMATE,
                "-",
            ),
        ):
            thrust, _ = loads_at(ship, run[SPEED].to_numpy(), run[SHAFT_SPEED].to_numpy())
            axis.plot(time, thrust, style, color=colour, linewidth=1.3, label=label)
        if name != UNSEEN:
            for a, b in straight_rows(run, SMALL):
                axis.axvspan(time.iloc[a], time.iloc[b - 1], color=figures.PALETTE[2], alpha=0.25)
        axis.set_title(f"{name}{', held out' if name == UNSEEN else ''}", fontsize=9, loc="left")
        axis.set_ylabel("thrust [N]", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=3)
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure
