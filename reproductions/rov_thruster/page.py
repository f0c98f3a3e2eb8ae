"""Page of the ROV thruster: diagnosis and identification, evaluated on held-out runs.

Run ``python -m reproductions rov_thruster --recordings FOLDER --out docs/results``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import write_csv, write_table
from shaftline.mismatch import Diagnosis
from shaftline.mismatch.search.selection import INDISTINGUISHABLE

from ..pages import fill_template, make_parser
from . import numbers
from .runs import (
    AS_RECORDED,
    CONSTANTS,
    OWNERS_DEAD_ZONE_V,
    REFERENCES,
    SPEED,
    TOLERANCE_FACTOR,
    WHOLE,
    WITH_THRUST,
    Runs,
    Split,
    describe_finding,
    excess_speed,
    load_runs,
    speed_of,
    splits,
    table_of,
)

NAME, TITLE = "rov-thruster", "ROV thruster: diagnosis and identification of a real machine"
COMMAND = "python -m reproductions rov_thruster --recordings FOLDER --out docs/results"


def main() -> None:
    """Diagnose, identify, evaluate, and write ``rov-thruster.md``, its tables and its figure."""
    parser = make_parser(
        "rov_thruster", __doc__, "out/rov-thruster", recordings="folder of the nine CSVs"
    )
    options = parser.parse_args()
    runs = load_runs(options.recordings)
    found = splits(runs)
    table = table_of(found)
    write(options.out, table, found, runs, numbers.refits(runs), numbers.refusals(runs))
    for one in found[CONSTANTS]:
        print(f"{one.unseen} held out: {one.diagnosis.sentence}")
    print(f"page: {options.out / f'{NAME}.md'}")


def write(
    folder: Path,
    table: pd.DataFrame,
    found: dict[str, list[Split]],
    runs: Runs,
    refits: list[numbers.Refit],
    refused: list[str],
) -> None:
    """Write ``rov-thruster.md``, its two tables and ``figures/rov-thruster.png``."""
    estimated = numbers.table_of(refits)
    named = [one.diagnosis for one in found[CONSTANTS] if one.diagnosis.findings]
    ahead = [best_gain(d, "command-dead-zone") - best_gain(d, "coulomb-friction") for d in named]
    ratios = {
        "smooth": ratio(table, CONSTANTS, ("sine", "ramp")),
        "step": ratio(table, CONSTANTS, ("step",)),
        "whole_sine": ratio(table, WHOLE, ("sine",)),
        "whole_ramp": ratio(table, WHOLE, ("ramp",)),
    }
    body = fill_template(
        Path(__file__).with_name("page.md"), dead_zone=OWNERS_DEAD_ZONE_V, factor=TOLERANCE_FACTOR,
        errors=errors_table(table), findings=findings_table(found), named=named, voltage=_voltage,
        ahead=ahead, distinct=bool(ahead) and min(map(abs, ahead)) > INDISTINGUISHABLE,
        limit=INDISTINGUISHABLE,
        ratios=ratios, excess=excess_speed(runs), constants=CONSTANTS, whole=WHOLE,
        verdicts={s: _verdicts(found[s]) for s in (AS_RECORDED, WHOLE, WITH_THRUST)},
        as_recorded=AS_RECORDED, with_thrust=WITH_THRUST,
        estimated={s: numbers.errors_table(s, estimated, table) for s in (CONSTANTS, WHOLE)},
        estimates=numbers.estimates_table(refits), refused=refused,
        left_out=refits[0].identification.left_out, n=numbers.summary(refits, estimated, table),
    )  # fmt: skip
    write_table(folder, NAME, TITLE, COMMAND, table, body)
    write_csv(folder, f"{NAME}-numbers", estimated)
    figures.save(figure_of(found, runs), folder / "figures" / f"{NAME}.png")


def errors_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the errors on held-out runs before and after each diagnosis."""
    shown = table[["start", "unseen", "named", "after/before"]].copy()
    for what, column, digits in (("rms", "rms_{}_rad_s", 2), ("fit", "fit_{}_percent", 1)):
        pairs = zip(table[column.format("before")], table[column.format("after")], strict=True)
        shown[what] = [f"{b:.{digits}f} → {a:.{digits}f}" for b, a in pairs]
    shown = shown[["start", "unseen", "named", "rms", "after/before", "fit"]]
    shown.columns = ["start", "held-out run", "identified effect", "rms, before → after",
                     "after/before", "FitPercent"]  # fmt: skip
    return shown


def findings_table(found: dict[str, list[Split]]) -> pd.DataFrame:
    """Return what each diagnosis identified, with its alternatives and the first round."""
    rows = []
    for title, group in found.items():
        for one in group:
            said, best = one.diagnosis, one.diagnosis.ranking[:4]
            for f in said.findings:
                sizes = [
                    f"{e.name} {e.value:.3g} ({e.ci95[0]:.3g} to {e.ci95[1]:.3g}) {e.unit}"
                    for e in f.estimates
                ]
                rows.append(
                    {"start": title, "held out": one.unseen, "verdict": said.verdict,
                     "effect": f.effect.label,
                     "size": "; ".join(sizes),
                     "2 Δ log L (threshold)": f"{f.score:.0f} ({f.threshold:.0f})",
                     "indistinguishable": ", ".join(c.effect.label for c in f.rivals),
                     "explained": f"{said.explained:.0%}",
                     "first round": ", ".join(f"{c.effect.label} {c.gain:.0f}" for c, _ in best)}
                )  # fmt: skip
    return pd.DataFrame(rows)


def ratio(table: pd.DataFrame, start: str, references: tuple[str, ...]) -> str:
    """Return the span of after/before over the held-out runs of some references."""
    rows = table[(table["start"] == start) & table["unseen"].str.endswith(references)]
    return numbers.span(rows["after/before"])


def best_gain(diagnosis: Diagnosis, effect: str) -> float:
    """Return the gain of an effect's best form in the first round [2 Δ log L]; 0 if it was not tried."""
    return max((c.gain for c, _ in diagnosis.ranking if c.effect.id == effect), default=0.0)


def _verdicts(group: list[Split]) -> str:
    said: Any = [f"{one.diagnosis.verdict} ({describe_finding(one.diagnosis)})" for one in group]
    return ", ".join(dict.fromkeys(said))


def loss_as_voltage(diagnosis: Diagnosis) -> tuple[float, float, float]:
    """Return the first finding as a voltage loss [V]: value, lower and upper 95 % limit."""
    f = diagnosis.findings[0]
    motor = diagnosis.ship.record()
    ohm_per_constant = float(motor["armature_resistance"] / motor["motor_constant"])
    factor = 1.0 if f.effect.id == "command-dead-zone" else ohm_per_constant
    loss = f.estimates[0]
    low, high = loss.ci95
    return loss.value * factor, low * factor, high * factor


def _voltage(diagnosis: Diagnosis) -> str:
    value, low, high = loss_as_voltage(diagnosis)
    text = f"{value:.3f} V ({low:.3f} to {high:.3f}"
    finding = diagnosis.findings[0]
    if finding.effect.form == "by-direction":
        share = finding.estimates[1].value
        text += f"; {value * (1.0 - share):.3f} astern, {value * (1.0 + share):.3f} ahead"
    return f"{text})"


def figure_of(found: dict[str, list[Split]], runs: Runs) -> Figure:
    """Draw measured and simulated speed of each held-out run of the first start."""
    group = found[CONSTANTS]
    figure, axes = figures.new_figure(len(group), len(REFERENCES), (12.0, 2.6 * len(group)))
    for line, one in zip(axes, group, strict=True):
        for axis, result in zip(line, one.judged, strict=True):
            table = runs[result.run]
            time = table["time_s"]
            axis.plot(time, table[SPEED], color=figures.TRUTH, linewidth=1.4, label="measured")
            for ship, label, colour, style in (
                (one.diagnosis.ship, "owners' constants", figures.THESIS, "--"),
                (one.diagnosis.corrected, "corrected", figures.ESTIMATE, "-"),
            ):
                axis.plot(
                    time, speed_of(ship, table), style, color=colour, linewidth=1.1, label=label
                )
            axis.set_title(
                f"{' '.join(result.run)}: rms {result.before:.1f} → {result.after:.1f} rad/s",
                fontsize=9, loc="left",
            )  # fmt: skip
            axis.tick_params(labelsize=8)
        line[0].set_ylabel("shaft speed [rad/s]", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    axes[0, 0].legend(fontsize=8, frameon=False)
    return figure
