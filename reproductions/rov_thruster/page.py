"""Page of the ROV thruster: diagnosis and identification, evaluated on held-out runs.

Run ``python -m reproductions rov_thruster --recordings FOLDER --out docs/results``.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import ESTIMATE, THESIS
from shaftline.display.tables import write_csv
from shaftline.mismatch import Diagnosis
from shaftline.mismatch.search.selection import INDISTINGUISHABLE

from ..pages import make_parser
from ..writing import Panel, against_measured, draw, interval, span, write_results
from . import numbers
from . import runs as rov
from .runs import AS_RECORDED, CONSTANTS, WHOLE, WITH_THRUST, Runs, Split

TITLE = "ROV thruster: diagnosis and identification of a real machine"


def main() -> None:
    """Diagnose, identify, evaluate, and write ``rov-thruster.md``, its tables and its figure."""
    parser = make_parser(
        "rov_thruster", __doc__, "out/rov-thruster", recordings="folder of the nine CSVs"
    )
    options = parser.parse_args()
    runs = rov.load_runs(options.recordings)
    found = rov.splits(runs)
    for one in found[CONSTANTS]:
        print(f"{one.unseen} held out: {one.diagnosis.sentence}")
    write(options.out, found, runs, numbers.refits(runs), numbers.refusals(runs))


def write(
    folder: Path,
    found: dict[str, list[Split]],
    runs: Runs,
    refits: list[numbers.Refit],
    refused: list[str],
) -> None:
    """Write ``rov-thruster.md``, its two tables and ``figures/rov-thruster.png``."""
    table, estimated = rov.table_of(found), numbers.table_of(refits)
    named = [one.diagnosis for one in found[CONSTANTS] if one.diagnosis.findings]
    ahead = [_best_gain(d, "command-dead-zone") - _best_gain(d, "coulomb-friction") for d in named]
    ratios = {
        "smooth": _ratio(table, CONSTANTS, "sine", "ramp"),
        "step": _ratio(table, CONSTANTS, "step"),
        "whole_sine": _ratio(table, WHOLE, "sine"),
        "whole_ramp": _ratio(table, WHOLE, "ramp"),
    }
    write_csv(folder, "rov-thruster-numbers", estimated)
    write_results(
        __file__, folder, TITLE, table, {"": figure_of(found, runs)}, "--recordings FOLDER",
        dead_zone=rov.OWNERS_DEAD_ZONE_V, factor=rov.TOLERANCE_FACTOR, errors=errors_table(table),
        findings=findings_table(found), losses=[_voltage(d) for d in named], ahead=ahead,
        distinct=bool(ahead) and min(map(abs, ahead)) > INDISTINGUISHABLE, limit=INDISTINGUISHABLE,
        ratios=ratios, excess=rov.excess_speed(runs), whole=WHOLE, as_recorded=AS_RECORDED,
        with_thrust=WITH_THRUST, refused=refused, estimates=numbers.estimates_table(refits),
        verdicts={s: _verdicts(found[s]) for s in (AS_RECORDED, WHOLE, WITH_THRUST)},
        estimated={s: numbers.errors_table(s, estimated, table) for s in (CONSTANTS, WHOLE)},
        left_out=refits[0].identification.left_out, n=numbers.summary(refits, estimated, table),
    )  # fmt: skip


def errors_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the errors on held-out runs before and after each diagnosis."""
    shown = table[["start", "unseen", "named", "after/before"]].copy()
    for what, column, digits in (("rms", "rms_{}_rad_s", 2), ("fit", "fit_{}_percent", 1)):
        pairs = zip(table[column.format("before")], table[column.format("after")], strict=True)
        shown[what] = [f"{b:.{digits}f} → {a:.{digits}f}" for b, a in pairs]
    shown = shown[["start", "unseen", "named", "rms", "after/before", "fit"]]
    shown.columns = [
        "start",
        "held-out run",
        "identified effect",
        "rms, before → after",
        "after/before",
        "FitPercent",
    ]
    return shown


def findings_table(found: dict[str, list[Split]]) -> pd.DataFrame:
    """Return what each diagnosis identified, with its alternatives and the first round."""
    return pd.DataFrame(
        {
            "start": title,
            "held out": one.unseen,
            "verdict": one.diagnosis.verdict,
            "effect": f.effect.label,
            "size": "; ".join(f"{e.name} {interval(e)} {e.unit}" for e in f.estimates),
            "2 Δ log L (threshold)": f"{f.score:.0f} ({f.threshold:.0f})",
            "indistinguishable": ", ".join(c.effect.label for c in f.rivals),
            "explained": f"{one.diagnosis.explained:.0%}",
            "first round": ", ".join(
                f"{c.effect.label} {c.gain:.0f}" for c, _ in one.diagnosis.ranking[:4]
            ),
        }
        for title, group in found.items()
        for one in group
        for f in one.diagnosis.findings
    )


def _ratio(table: pd.DataFrame, start: str, *references: str) -> str:
    """Return the span of after/before over the held-out runs of some references."""
    rows = table[(table["start"] == start) & table["unseen"].str.endswith(references)]
    return span(rows["after/before"])


def _best_gain(diagnosis: Diagnosis, effect: str) -> float:
    """Return the gain of an effect's best form in the first round [2 Δ log L]; 0 if it was not tried."""
    return max((c.gain for c, _ in diagnosis.ranking if c.effect.id == effect), default=0.0)


def _verdicts(group: list[Split]) -> str:
    said = [f"{s.diagnosis.verdict} ({rov.describe_finding(s.diagnosis)})" for s in group]
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
    panels: list[Panel] = []
    group = found[CONSTANTS]
    for one in group:
        ships = {"owners' constants": one.diagnosis.ship, "corrected": one.diagnosis.corrected}
        for result in one.judged:
            table = runs[result.run]
            speeds = {label: rov.speed_of(ship, table) for label, ship in ships.items()}
            lines = against_measured(table["time_s"], table[rov.SPEED], speeds, (THESIS, ESTIMATE))
            title = f"{' '.join(result.run)}: rms {result.before:.1f} → {result.after:.1f} rad/s"
            ylabel = "shaft speed [rad/s]" if len(panels) % 3 == 0 else ""
            panels.append(Panel(lines, {"title": title, "ylabel": ylabel}, 0 if panels else 1))
    return draw(panels, (12.0, 2.6 * len(group)), len(rov.REFERENCES), "time [s]")
