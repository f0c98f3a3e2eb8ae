"""The page on KVLCC2: words, tables and figure, every number from the recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import markdown, write_table
from shaftline.mismatch.identify import Identification
from shaftline.plant import Ship
from shaftline.plant.columns import SHAFT_SPEED, TIME

from . import oblique_page, turning_page
from .numbers import DEDUCTION, EFFICIENCY, FRESH_COLD, RESISTANCE, WAKE, best_wake, judged
from .oblique import Own
from .runs import (
    APPROACH_SPEED,
    BEFORE,
    DENSITY,
    PRINTED_DEDUCTION,
    PRINTED_WAKE,
    SMALL,
    SPEED,
    SWAY,
    THRUST,
    UNSEEN,
    Runs,
    loads_at,
    straight_parts,
    straight_rows,
)
from .turning import Turning

COMMAND = "python -m reproductions kvlcc2 --recordings FOLDER --out docs/results"
NAME, TITLE = "kvlcc2", "KVLCC2: wake and thrust deduction from the straight parts of zig-zags"
SHOWN = ("z_05_01", UNSEEN)
"""Runs of the figure."""


@dataclass(frozen=True)
class Findings:
    """Everything that the page tells.

    Args:
        ship: with the printed numbers.
        runs: all thirteen.
        small: what the parts of small drift tell.
        first: what the rows before the first rudder order tell.
        refused: what the tool said, by the numbers that it was asked for.
        sensitivity: the numbers by other answers to what is straight.
        others: other questions to the parts of small drift.
        own: what a term of one's own makes of the zig-zags.
        turning: the zig-zags as the turning ship sails them.
    """

    ship: Ship
    runs: Runs
    small: Identification
    first: Identification
    refused: dict[tuple[str, ...], str]
    sensitivity: pd.DataFrame
    others: dict[str, Identification]
    own: Own
    turning: Turning


INTRODUCTION = f"""\
Thirteen free zig-zag tests of a 7 m model of the tanker KVLCC2 in HSVA's towing tank, 20 Hz, at
constant revolutions that the rig holds: thrust, torque and speed are measured, what drove the shaft is
not. The measurements are their owners' (public repository
martinlarsalbert/System-identification-of-Vessel-Manoeuvring-Models, commit 4b7ce53) and are not kept
here.

**Ship.** The model's printed numbers (D 0.204 m, mass 3272 kg, w {PRINTED_WAKE:.2f}, t
{PRINTED_DEDUCTION:.2f}), its own open-water table (`propeller.model = "table"`) and a speed that is
held (`prime_mover.type = "speed-command"`). Not printed: the water's density ({DENSITY:g} kg/m3 is
taken), eta_R (1) and the resistance, which starts where the printed w and t are in balance at
{APPROACH_SPEED:.3f} m/s (15.5 kn full scale). Nor is an added mass in surge.

**Straight.** Nothing in a file says when the model sails straight. Two answers:

- *{SMALL.title}*: {SMALL.least_rows} rows or more in which the drift angle at the propeller stays below
  {SMALL.drift_deg:g} degrees, the yaw rate below {SMALL.yaw_deg_s:g} degrees/s and the rudder below
  {SMALL.rudder_deg:g} degrees, the first {SMALL.from_s:g} s left out;
- *{BEFORE.title}*: from a run's first row until the rudder has moved by {BEFORE.rudder_deg:g} degree.

**Judging.** The parts come from twelve runs; {UNSEEN}, the largest rudder, gives none and is never
fitted. Thrust and torque are judged over whole zig-zags by the measured speed, since a ship that only
surges does not lose what drift and rudder take. Beside each error stands the least that any constant
wake fraction reaches when it is fitted to that run itself: no result, but the bound on one.
"""


def write(folder: Path, found: Findings) -> None:
    """Write ``kvlcc2.md`` and ``.csv``, and ``figures/kvlcc2.png``."""
    ships = {"small_drift": found.small.identified, "before_rudder": found.first.identified}
    table = judged(found.ship, ships, found.runs)
    write_table(folder, NAME, TITLE, COMMAND, table, body(found, table))
    figures.save(drawn(found), folder / "figures" / f"{NAME}.png")
    figures.save(
        oblique_page.drawn(found.own, found.runs), folder / "figures" / f"{NAME}-own-term.png"
    )
    sailed = turning_page.drawn(found.turning, found.runs)
    figures.save(sailed, folder / "figures" / f"{NAME}-turning.png")


def body(found: Findings, table: pd.DataFrame) -> str:
    """The page below its title."""
    parts = [INTRODUCTION, "## What is told\n", _numbers(found), "", _told(found)]
    parts += ["\n## What is refused together\n", _refused(found)]
    parts += ["\n## Zig-zags: rms error of the thrust, N\n", _zigzags(table)]
    parts += ["\n![Thrust, measured and simulated](figures/kvlcc2.png)\n", _carried(found, table)]
    parts += ["\n## A term of one's own: the wake in drift\n"]
    parts += [oblique_page.section(found.own, found.runs)]
    parts += ["\n## The zig-zags sailed\n", turning_page.section(found.turning)]
    parts += [
        "\n## How much hangs on what is called straight\n",
        _sensitivity(found),
        "",
        _hangs(found),
    ]
    return "\n".join(parts)


def _interval(identification: Identification, key: str, digits: int) -> str:
    e = next(e for e in identification.estimates if e.key == key)
    low, high = e.ci95
    return f"{e.value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


_LABELS = {WAKE: ("wake fraction w", 3), EFFICIENCY: ("eta_R", 4), RESISTANCE: ("c1 [N s2/m2]", 1)}


def _numbers(found: Findings) -> str:
    rows = []
    for title, one in ((SMALL.title, found.small), (BEFORE.title, found.first)):
        by = SMALL if one is found.small else BEFORE
        parts = straight_parts(found.runs, by)
        row = {"parts": f"{title}: {len(parts)}, {sum(map(len, parts))} rows"}
        row |= {label: _interval(one, key, digits) for key, (label, digits) in _LABELS.items()}
        row["(1 - t) / c1 [m2/(N s2)]"] = _ratio(one)
        rows.append(row)
    return markdown(pd.DataFrame(rows))


def _ratio(one: Identification) -> str:
    e = next(e for e in one.estimates if e.key == RESISTANCE)
    low, high = e.ci95
    kept = 1.0 - PRINTED_DEDUCTION
    return f"{kept / e.value:.4f} ({kept / high:.4f} to {kept / low:.4f})"


def _sides(runs: Runs) -> tuple[float, float]:
    """Mean thrust [N] of the straight parts that drift to one side, and to the other, least first."""
    means: dict[bool, list[float]] = {True: [], False: []}
    for name, run in runs.items():
        for a, b in straight_rows(run, SMALL) if name != UNSEEN else []:
            rows = run.iloc[a:b]
            means[bool(rows[SWAY].mean() > 0.0)].append(float(rows[THRUST].mean()))
    low, high = sorted(float(np.mean(side)) for side in means.values())
    return low, high


def _told(found: Findings) -> str:
    told = ", ".join(found.others["auto"].parameters)
    left = "; ".join(f"{key}: {why}" for key, why in found.others["auto"].left_out.items())
    low, high = _sides(found.runs)
    wake = found.others["density"].parameters[WAKE] - found.small.parameters[WAKE]
    before = [
        run[THRUST].iloc[slice(*straight_rows(run, BEFORE)[0])] for run in found.runs.values()
    ]
    rises = np.array([float(thrust.iloc[-1] - thrust.iloc[0]) for thrust in before])
    lasts = [len(thrust) * 0.05 for thrust in before]
    speeds = [float(part[SPEED].mean()) for part in straight_parts(found.runs, SMALL)]
    return "\n".join(
        [
            f"- **Wake.** Sailing nearly straight the model has w = {_interval(found.small, WAKE, 3)}, "
            f"more than the printed {PRINTED_WAKE:.2f}. Before the first order it is "
            f"{_interval(found.first, WAKE, 3)}, about the printed one, but that is no steady state: "
            f"at constant revolutions and with the rudder at rest thrust rises by {rises.min():.1f} to "
            f"{rises.max():.1f} N in the {min(lasts):.1f} to {max(lasts):.1f} s before the rudder "
            "moves. "
            "What went before stands in no file."
            + (" The tool says that what is left is no noise." if found.first.warnings else ""),
            "- **eta_R** is told by the torque beside the thrust, and takes up whatever the two gauges "
            "and the open-water test differ by.",
            f"- **The water's density** is not printed. {FRESH_COLD:g} instead of {DENSITY:g} kg/m3 "
            f"moves w by {wake:+.3f}.",
            f"- **The intervals** hold for a wake that is constant. It is not even when nearly "
            f"straight: at {min(speeds):.2f} to {max(speeds):.2f} m/s the parts that drift to one "
            "side have "
            f"{low:.1f} N on average, those to the other {high:.1f}.",
            f"- `--free auto` finds the same three by itself ({told}) and leaves {left}.",
            "- FitPercent on the quarter of a part that the tool sets aside says nothing here: nothing "
            "moves in it. The zig-zags below judge.",
        ]
    )


def _refused(found: Findings) -> str:
    lines = [f"- {', '.join(keys)}: “{sentence}”." for keys, sentence in found.refused.items()]
    deduction = next(e for e in found.others["deduction"].estimates if e.key == DEDUCTION)
    low, high = deduction.ci95
    start = found.ship.number(RESISTANCE).value
    ratio = (1.0 - PRINTED_DEDUCTION) / found.small.parameters[RESISTANCE]
    return "\n".join(
        [
            *lines,
            "\n**Thrust deduction is not told.** At a speed that hardly changes the hull's balance is "
            f"(1 - t) T = c1 v², and says only (1 - t) / c1 = {_ratio(found.small)}. With the printed t "
            f"that is c1 = {_interval(found.small, RESISTANCE, 1)} N s2/m2. With the resistance "
            f"held where it starts ({start:.1f}) it is t = {deduction.value:.3f} ({low:.3f} to "
            f"{high:.3f}): "
            "how well t is told to somebody who knows the resistance, but no finding, as the start "
            "is no "
            f"measurement. With a towing test's c1, t = 1 - {ratio:.4f} c1; a run whose "
            "revolutions change would tell it too. In the zig-zags the speed does change, but by "
            "what drift and "
            "rudder take, which no number here describes; in the straight parts the drag of 5 "
            "degrees of "
            "rudder is inside the c1 found. Nor is the mass told.",
        ]
    )


def _zigzags(table: pd.DataFrame) -> str:
    shown = pd.DataFrame(
        {"run": table["run"].where(table["unseen"] == "no", table["run"] + ", unseen")}
    )
    shown[f"w {PRINTED_WAKE:.2f}, printed"] = table["thrust_before_N"]
    shown[SMALL.title] = table["thrust_small_drift_N"]
    shown[BEFORE.title] = table["thrust_before_rudder_N"]
    pairs = zip(table["thrust_least_N"], table["best_wake"], strict=True)
    shown["best constant wake of this run"] = [f"{least:.2f} (w {w:.3f})" for least, w in pairs]
    return markdown(shown)


def _carried(found: Findings, table: pd.DataFrame) -> str:
    unseen = table[table["unseen"] == "yes"].iloc[0]
    seen = table[table["unseen"] == "no"]
    lower = int((seen["thrust_small_drift_N"] < seen["thrust_before_N"]).sum())
    worse = ", ".join(seen["run"][seen["thrust_small_drift_N"] >= seen["thrust_before_N"]])
    own = {n for n, r in found.runs.items() if n != UNSEEN and straight_rows(r, SMALL)}
    whole, _ = best_wake(found.ship, *(r for n, r in found.runs.items() if n != UNSEEN))
    shares = 1.0 - table["thrust_least_N"] / table["thrust_before_N"]
    return "\n".join(
        [
            f"- **{UNSEEN}, unseen: {unseen['thrust_before_N']:.2f} → "
            f"{unseen['thrust_small_drift_N']:.2f} N**, where no constant wake comes below "
            f"{unseen['thrust_least_N']:.2f}. Before the first order gives "
            f"{unseen['thrust_before_rudder_N']:.2f} N: nothing.",
            f"- Of the other twelve, {lower} come nearer"
            + (f" (not {worse})" if worse else "")
            + f". Their whole zig-zags together would ask for w = {whole:.3f} (least squares of the "
            f"thrust); the straight parts are all from {', '.join(sorted(own))}.",
            f"- **It is little.** The bound itself takes off {shares.min():.0%} to {shares.max():.0%}. "
            "What is left is a wake that follows the drift angle at the propeller, to either side "
            "differently, and the speed, and no constant number describes it.",
            f"- **Torque** gains next to nothing: {unseen['torque_before_N_m'] * 1e3:.0f} → "
            f"{unseen['torque_small_drift_N_m'] * 1e3:.0f} mN m on {UNSEEN}, "
            f"{seen['torque_before_N_m'].mean() * 1e3:.0f} → "
            f"{seen['torque_small_drift_N_m'].mean() * 1e3:.0f} on average of the others. The eta_R of "
            "straight sailing is not that of a propeller in oblique flow.",
        ]
    )


def _sensitivity(found: Findings) -> str:
    rows = []
    for row in found.sensitivity.to_dict("records"):
        limits = "until the rudder moves" if row["title"] == BEFORE.title else (
            f"drift {row['drift_deg']:g}, yaw {row['yaw_deg_s']:g}, rudder {row['rudder_deg']:g}, "
            f"from {row['from_s']:g} s"
        )  # fmt: skip
        half = 1.96 * row["wake_fraction_se"]
        w = row["wake_fraction"]
        rows.append(
            {
                "degrees, degrees/s": limits,
                "parts": row["parts"],
                "rows": row["rows"],
                "w": f"{w:.3f} ({w - half:.3f} to {w + half:.3f})",
                "eta_R": f"{row['relative_rotative_efficiency']:.4f}",
                "c1": f"{row['resistance_coefficient_N_s2_m2']:.1f}",
            }
        )
    return markdown(pd.DataFrame(rows))


def _hangs(found: Findings) -> str:
    settled = found.sensitivity[found.sensitivity["from_s"] > 0.0]
    w = settled["wake_fraction"]
    own = next(e for e in found.small.estimates if e.key == WAKE)
    low, high = own.ci95
    return (
        f"With the start left out, w lies between {w.min():.3f} and {w.max():.3f}; the interval is "
        f"{low:.3f} to {high:.3f} with the limits used. The largest w rests on "
        f"{int(settled['parts'].iloc[int(np.argmax(w))])} parts, too few to show how parts differ, and "
        "its interval is too narrow. The limits used are the first that were tried. They were set by "
        "drift, yaw and rudder alone, but with the thrust of all thirteen runs in view, "
        f"{UNSEEN} among them."
    )


def drawn(found: Findings) -> Figure:
    """Thrust of two zig-zags, measured and by printed and found numbers; straight parts shaded."""
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
        axis.set_title(f"{name}{', unseen' if name == UNSEEN else ''}", fontsize=9, loc="left")
        axis.set_ylabel("thrust [N]", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=3)
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure
