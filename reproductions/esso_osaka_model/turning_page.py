"""The page's section on the model that turns, every number from :mod:`.turning`."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import markdown
from shaftline.plant.columns import HEADING, SWAY_SPEED, TIME, YAW_RATE
from shaftline.plant.replay import simulate_recording

from .. import nomoto
from .runs import HELD_OUT, SPEED, Recordings
from .turning import SURGE, Turning, over

TITLES = {
    YAW_RATE: "rate of turn, deg/s", HEADING: "heading, deg", SWAY_SPEED: "sway, m/s",
    SPEED: "speed ahead, m/s", SURGE: f"{SURGE}, m/s",
}  # fmt: skip


def _shown(channel: str, value: float) -> str:
    if channel in (YAW_RATE, HEADING):
        return f"{np.degrees(value):.{2 if channel == YAW_RATE else 0}f}"
    return f"{value:.4f}"


def table_of(turning: Turning) -> pd.DataFrame:
    """A row a ship and run: rms errors in SI units."""
    parts = [
        own.rename_axis("run").reset_index().assign(ship=what)
        for what, own in turning.errors.items()
    ]
    table = pd.concat(parts, ignore_index=True)
    table["held out"] = np.where(table["run"].isin(HELD_OUT), "yes", "")
    return table[["ship", "run", "held out", *TITLES]]


def _errors(turning: Turning) -> str:
    rows = []
    for what, own in turning.errors.items():
        fitted = tuple(name for name in own.index if name not in HELD_OUT)
        for group, names in (("seven fitted", fitted), ("two held out", HELD_OUT)):
            means = over(own, names)
            told = {t: _shown(c, means[c]) if c in means else "" for c, t in TITLES.items()}
            rows.append({"ship": what, "runs": group, **told})
    return markdown(pd.DataFrame(rows))


def _each(turning: Turning, channel: str) -> str:
    known = {what: own for what, own in turning.errors.items() if channel in own}
    whole = pd.DataFrame({what: own[channel] for what, own in known.items()})
    told = whole.map(lambda value: _shown(channel, value))
    told.insert(0, "held out", np.where(told.index.isin(HELD_OUT), "yes", ""))
    return markdown(told.rename_axis("run").reset_index())


def _named(turning: Turning) -> str:
    rows = []
    for finding in turning.said.findings:
        for own in finding.estimates:
            low, high = own.ci95
            rows.append(
                {"effect": finding.effect.label, "parameter": own.name, "file": f"{own.neutral:.3g}",
                 "value": f"{own.value:.3g}", "95 %": f"{low:.3g} to {high:.3g}", "unit": own.unit,
                 "evidence": f"{finding.score:.0f}"}
            )  # fmt: skip
    return markdown(pd.DataFrame(rows))


def _found(turning: Turning) -> str:
    rows = [
        {"key": e.key, "before": f"{e.neutral:.4g}", "found": f"{e.value:.4g}",
         "95 %": f"{e.ci95[0]:.4g} to {e.ci95[1]:.4g}"}
        for e in turning.found.estimates
    ]  # fmt: skip
    return markdown(pd.DataFrame(rows))


def section(turning: Turning) -> str:
    """The section below its title."""
    response = turning.response
    balances = ", ".join(f"{b.name} {b.explained:.0%}" for b in turning.said.balance_verdicts)
    return "\n\n".join(
        [
            f"""\
The same runs by a ship that [turns](../manoeuvring.md).
[Her file](../../studies/esso_osaka_model/turning.toml) holds what her owners measured in captive tests
(Miyauchi et al. 2022), none of it fitted to these runs. She is given revolutions, rudder and wind,
starts from a run's first row and sails it to its end on her own. The last column is the question that
the ship of surge alone is asked: speed by her surge equation where sway, rate of turn and heading are
the measured.

- *captive tests*: the file as it is, without wind;
- *diagnosed*: the file, after `shaftline diagnose` on the seven runs: balances of hull, sway and yaw;
- *diagnosed, numbers found*: then `shaftline identify` of resistance, damping and rudder there;
- *Nomoto*: T' (L/U) dr/dt + r = K' (U/L) (delta - delta_0), fitted to the rates of turn of the same
  seven: K' {response.gain:.2f}, T' {response.time:.2f}, delta_0 {np.degrees(response.neutral):.1f} deg,
  turning about a point {response.pivot:.2f} L ahead of midship. It is given the measured speed, for it
  has none.""",
            _errors(turning),
            "![Rate of turn of the runs held out](figures/esso-osaka-model-turning.png)",
            f"**Named**: {turning.said.verdict}. Of the power beyond noise is explained: {balances}.",
            _named(turning),
            "**Numbers found**:",
            _found(turning),
            "Rate of turn by run, deg/s:",
            _each(turning, YAW_RATE),
            "Speed ahead by run, free-running, m/s:",
            _each(turning, SPEED),
            _words(turning),
        ]
    )


def _words(turning: Turning) -> str:
    def at(what: str, channel: str, names: tuple[str, ...] = HELD_OUT) -> float:
        return float(over(turning.errors[what], names)[channel])

    def rate(what: str, names: tuple[str, ...] = HELD_OUT) -> str:
        return f"{np.degrees(at(what, YAW_RATE, names)):.2f}"

    first, named, last = turning.ships
    rows = turning.errors[first].index
    fitted = tuple(name for name in rows if name not in HELD_OUT)
    turns = tuple(name for name in fitted if name.startswith("turn"))
    k = next(e.value for f in turning.said.findings for e in f.estimates if "wind-side" in e.key)
    worst = turning.errors[named][SURGE].idxmax()
    apart = "far more than noise" if turning.said.verdict != "nothing-missing" else "noise"
    drift, own = at(first, SURGE, turns), at(first, SPEED, turns)
    return "\n".join(
        [
            f"- **Nomoto**, fitted to the seven runs, is off by {rate('Nomoto')} deg/s on the two held "
            f"out; captive tests, fitted to nothing, by {rate(first)}, after the "
            f"diagnosis {rate(named)}, "
            f"with numbers found {rate(last)}. On the seven: {rate('Nomoto', fitted)}, "
            f"{rate(first, fitted)}, {rate(named, fitted)}, {rate(last, fitted)}. "
            "Where the rudder is all "
            "that acts (zig-zags, turns) two numbers do nearly as well as all "
            "equations of motion; where "
            "the shaft reverses they do not.",
            f"- **Sway**: {at(first, SWAY_SPEED):.3f} → {at(named, SWAY_SPEED):.3f} "
            "m/s held out, by the "
            f"wind across and the force that a turn gives. k = {k:.3f} N s²/m² is a "
            "side force coefficient "
            f"of {k / (0.5 * 1.166 * 0.52038):.2f} on the 0.520 m² that her owners "
            "print of her side above "
            "water.",
            "- **A trap**: the printed X_vr stands beside (m + m_y) v r and makes a "
            "turn cost far more surge "
            "than was measured. Free-running, the ship drifts too little as well, and the two errors "
            f"cancel: in the turns of the seven her speed is off by {own:.3f} m/s on her own and by "
            f"{drift:.3f} with the drift that was measured. So the hull's term is named with a negative "
            "size.",
            "- **Surge** by her own equations, at measured sway and turn, comes to "
            f"{at(named, SURGE):.4f} "
            f"m/s on the two held out, {at(named, SPEED):.4f} on her own: 0.025 is not reached this way "
            f"either. Most of it is {worst}.",
            "- **Not named**: anything in the yaw balance, where what is left is "
            f"{apart}; the derivatives "
            "that were found afterwards take up some of it. N_v and N_r are not told apart.",
        ]
    )


def drawn(runs: Recordings, turning: Turning) -> Figure:
    """Rate of turn and sway of the runs held out, measured and sailed."""
    figure, axes = figures.new_figure(len(HELD_OUT), 2, (10.0, 5.6))
    length = turning.ships["captive tests"].manoeuvring.length_m
    tables = runs.tables(turning.ships["diagnosed"])
    for row, name in zip(axes, HELD_OUT, strict=True):
        table = tables[name]
        lines = {what: simulate_recording(ship, table) for what, ship in turning.ships.items()}
        lines["Nomoto"] = nomoto.sailed(turning.response, table, length)
        for axis, column in zip(row, (YAW_RATE, SWAY_SPEED), strict=True):
            factor = np.degrees(1.0) if column == YAW_RATE else 1.0
            measured = factor * table[column]
            axis.plot(table[TIME], measured, color=figures.TRUTH, lw=1.3, label="measured")
            for colour, (what, sailed) in zip(figures.PALETTE, lines.items(), strict=False):
                style = ":" if what == "Nomoto" else "-"
                values = factor * sailed[column]
                axis.plot(sailed[TIME], values, style, color=colour, lw=1.0, label=what)
            axis.set_title(f"{name}, held out", fontsize=8, loc="left")
            axis.set_ylabel(TITLES[column], fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    axes[0, 0].legend(fontsize=7, frameon=False, ncols=2)
    return figure
