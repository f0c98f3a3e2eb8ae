"""The page's section on the zig-zags as the turning ship sails them; numbers from :mod:`.turning`."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import markdown
from shaftline.plant.columns import HEADING, TIME
from shaftline.plant.replay import simulate_recording

from .. import nomoto
from .oblique import FITTED
from .runs import SPEED, SWAY, UNSEEN, YAW, Runs
from .turning import EIGHT, SIX, THREE, Turning, groups, over, steered_runs

TITLES = {
    YAW: "rate of turn, deg/s", HEADING: "heading, deg", SWAY: "sway, m/s", SPEED: "speed ahead, m/s",
}  # fmt: skip
DRAWN = ("her own propeller", "three numbers", "six numbers")


def _shown(channel: str, value: float) -> str:
    if channel in (YAW, HEADING):
        return f"{np.degrees(value):.{2 if channel == YAW else 1}f}"
    return f"{value:.4f}"


def errors_table(turning: Turning) -> str:
    """Errors of every ship on the three groups of runs."""
    rows = []
    for what in dict.fromkeys(turning.errors.columns.get_level_values(0)):
        own = turning.errors[what]
        for group, names in groups(own).items():
            means = over(own, names)
            told = {t: _shown(c, means[c]) if c in means else "" for c, t in TITLES.items()}
            rows.append({"ship": what, "runs": group, **told})
    return markdown(pd.DataFrame(rows))


def _numbers(turning: Turning) -> str:
    rows = []
    for key in EIGHT:
        row: dict[str, str] = {"key": key}
        for what, one in turning.found.items():
            known = {e.key: e for e in one.estimates}
            if key in known:
                low, high = known[key].ci95
                row["published"] = f"{known[key].neutral:.4g}"
                row[what] = f"{known[key].value:.3g} ({low:.3g} to {high:.3g})"
            else:
                row[what] = ""
        rows.append(row)
    table = pd.DataFrame(rows)
    return markdown(table[["key", "published", *turning.found]])


def section(turning: Turning) -> str:
    """The section below its title."""
    response = turning.response
    return "\n\n".join(
        [
            f"""\
The package's [ship that turns](../manoeuvring.md), `kvlcc2`, is this hull with every number published
(Yasukawa & Yoshimura 2015), none of them fitted here. She is given the recorded revolutions and the
recorded rudder, starts from a run's first row, and sails it to its end on her own: speed, drift and rate
of turn are hers. In the files the rudder is positive where it turns to port; the sign is changed.

- *as published*: her own file, with the propeller of the MMG paper (D 0.216 m).
- *her own propeller*: with the propeller that HSVA's model had (D 0.204 m, its measured table), w and t
  as printed for it; time step 0.1 s.
- *three*, *six*, *eight numbers*: those found by `shaftline identify` on {", ".join(FITTED)};
  {UNSEEN} is set aside and the seven other runs are not shown either.
- *Nomoto*: T' (L/U) dr/dt + r = K' (U/L) (delta - delta_0) fitted to the rates of turn of the same five
  by least squares: K' {response.gain:.2f}, T' {response.time:.2f}, delta_0
  {np.degrees(response.neutral):.2f} deg, the ship turning about a point {response.pivot:.2f} L ahead of
  midship. It is given the measured speed at every row, for it has none of its own.""",
            "rms errors over whole runs, all runs counted alike:",
            errors_table(turning),
            "![Zig-zags sailed](figures/kvlcc2-turning.png)",
            _numbers(turning),
            _words(turning),
        ]
    )


def _words(turning: Turning) -> str:
    def at(what: str, channel: str, group: str = UNSEEN) -> float:
        own = turning.errors[what]
        return float(over(own, groups(own)[group])[channel])

    own = "her own propeller"

    def to(what: str, group: str) -> str:
        return (
            f"{np.degrees(at(own, YAW, group)):.2f} → {np.degrees(at(what, YAW, group)):.2f} deg/s"
        )

    return "\n".join(
        [
            f"- **Published numbers, nothing fitted**: on {UNSEEN} the rate of turn is off by "
            f"{np.degrees(at('as published', YAW)):.2f} deg/s, Nomoto's, fitted to five runs of the "
            f"same kind, by {np.degrees(at('Nomoto', YAW)):.2f}; headings by "
            f"{np.degrees(at('as published', HEADING)):.1f} and "
            f"{np.degrees(at('Nomoto', HEADING)):.1f} deg.",
            f"- **{len(THREE)} numbers**: rate of turn on {UNSEEN} {to('three numbers', UNSEEN)}, on "
            f"the seven others {to('three numbers', 'seven others')}.",
            f"- **{len(SIX)} numbers**: on {UNSEEN} {to('six numbers', UNSEEN)}, on the seven others "
            f"{to('six numbers', 'seven others')}.",
            f"- **{len(EIGHT)} numbers** come nearer than these on the five "
            f"({to('eight numbers', 'five fitted')}); on {UNSEEN} {to('eight numbers', UNSEEN)}, "
            f"heading {np.degrees(at(own, HEADING)):.1f} → "
            f"{np.degrees(at('eight numbers', HEADING)):.1f} deg.",
            "- **Nothing is told of small rudder angles** by the five: the hull is unstable on her "
            "course, and at 5 to 15 degrees with the rudder put over at 1 degree the heading wanders "
            "off by what no number of the five decides. Nomoto, which is always stable, follows those "
            "better.",
        ]
    )


def drawn(turning: Turning, runs: Runs) -> Figure:
    """Rate of turn of a fitted run and of the unseen one, measured and sailed."""
    names, steered = ("z_20_05", UNSEEN), steered_runs(runs)
    figure, axes = figures.new_figure(len(names), 1, (9.0, 5.6))
    for axis, name in zip(axes[:, 0], names, strict=True):
        run = steered[name]
        lines = {w: simulate_recording(turning.ships[w], run) for w in DRAWN}
        lines["Nomoto"] = nomoto.sailed(
            turning.response, run, turning.ships[DRAWN[0]].manoeuvring.length_m
        )
        axis.plot(run[TIME], np.degrees(run[YAW]), color=figures.TRUTH, lw=1.4, label="measured")
        for colour, (what, sailed) in zip(figures.PALETTE, lines.items(), strict=False):
            style = ":" if what == "Nomoto" else "-"
            axis.plot(
                sailed[TIME], np.degrees(sailed[YAW]), style, color=colour, lw=1.1, label=what
            )
        axis.set_title(f"{name}{', unseen' if name == UNSEEN else ''}", fontsize=9, loc="left")
        axis.set_ylabel("rate of turn [deg/s]", fontsize=8)
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=3)
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure
