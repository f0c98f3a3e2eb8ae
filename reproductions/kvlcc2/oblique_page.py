"""The part of the page on KVLCC2 that tells of terms of one's own."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display import figures
from shaftline.display.tables import markdown
from shaftline.mismatch import Diagnosis
from shaftline.plant import Ship
from shaftline.plant.columns import TIME
from shaftline.plant.replay import simulate_recording

from .numbers import Errors
from .oblique import (
    EVERY,
    FITTED,
    FORMS,
    NEAR,
    WEIGHTS,
    Own,
    beside,
    errors_in_flow,
    file_of,
)
from .runs import PRINTED_WAKE, SPEED, THRUST, TORQUE, UNSEEN, Runs, drift_at_propeller

INTRODUCTION = f"""\
What is left above follows drift and yaw, and neither is a channel of the plant. So the wake becomes
a term of one's own ([add your own physics](../own-physics.md)), which hears what the recording
holds besides: the drift angle at the propeller, from sway and yaw rate, the yaw rate and the rudder
angle, declared under `[signals]`.

**Ship.** The hull is held, and {1.0 - PRINTED_WAKE:g} times the measured speed is given as
`inflow_velocity_m_s`: the propeller is judged in the flow that it met, and what drift and rudder do
to the hull does not matter. So the measured speed enters as `advance_velocity`. At constant
revolutions no torque is simulated but the propeller's: what can be judged is the **propeller
balance**, by the torque gauge and by the thrust. eta_R is not printed, so it is free.

**Judging.** {", ".join(FITTED)} are given; {UNSEEN} is set aside and judged, from its first row on,
every row. Which form the term has is chosen by the five alone: each is left out in turn, the form
fitted to the other four by least squares of thrust and torque (1 error of {WEIGHTS[0]:g} N counts
as one of {WEIGHTS[1]:g} N m), and judged on the one that was left out. Of forms that come
within {NEAR - 1.0:.0%} of the best the one of fewest numbers is taken.
"""

TRAP = f"""\
- **The trap.** {UNSEEN} goes beyond all that was fitted: it drifts to {{beyond[0]:.1f}} degrees at
  the propeller where the five reach {{inside[0]:.1f}}, and slows to {{beyond[1]:.2f}} m/s where
  they keep {{inside[1]:.2f}}. The form that is best inside need not be best there; leaving out the
  strongest of the five is the nearest question that they can answer.
- **Sway is no measurement of an instrument**: whoever made the recordings took it from the track,
  smoothed to both sides in time, so drift knows half a second of what comes.
- **Not laid down beforehand.** The five runs choose among the {len(FORMS)} forms, but the list
  itself was drawn up by somebody who had seen errors of other forms on {UNSEEN}, cubic and
  exponential ones among them.
"""


def section(own: Own, runs: Runs) -> str:
    """The part of the page, with its tables."""
    parts = [INTRODUCTION, "**Forms**, with the yaw rate, the rudder or a memory heard or not.\n"]
    parts += [_forms(own), "", _chosen(own), "\n**Diagnoses** on the five runs.\n"]
    parts += [_diagnoses(own, runs), "\n![Thrust in the zig-zag that was not fitted]"]
    parts[-1] += "(figures/kvlcc2-own-term.png)\n"
    parts += [_said(own, runs), _trap(runs)]
    return "\n".join(parts)


def _forms(own: Own) -> str:
    rows = []
    for result in own.tried:
        strongest = result.left_out[FITTED[-1]]
        rows.append(
            {
                "form": f"[{result.name}](../../reproductions/kvlcc2/forms/{file_of(result.name).name})",
                "numbers": result.numbers,
                "left out: thrust, N": f"{result.thrust:.2f}",
                "torque, mN m": f"{1e3 * result.torque:.0f}",
                f"of these {FITTED[-1]}": f"{strongest.thrust:.2f}, {1e3 * strongest.torque:.0f}",
            }
        )
    return markdown(pd.DataFrame(rows))


def _chosen(own: Own) -> str:
    best = own.form
    return (
        f"The five choose **{best.name}**: {best.thrust:.2f} N on runs left out. Its numbers by least "
        "squares on all five are the probes with which the tool begins: from coarse ones its own search "
        "does not find ten numbers at once."
    )


def _diagnoses(own: Own, runs: Runs) -> str:
    rows = []
    said: list[tuple[str, Ship, Diagnosis | None]] = [("as printed", own.ship, None)]
    said += [
        (title, found.corrected, found)
        for title, found in (
            ("catalogue alone", own.catalogue),
            (f"{own.form.name} alone", own.named),
            (f"catalogue and {own.form.name}", own.beside),
        )
    ]
    for title, ship, found in said:
        seen = [errors_in_flow(ship, runs[name]) for name in FITTED]
        unseen = errors_in_flow(ship, runs[UNSEEN])
        named = " + ".join(f.effect.label for f in found.findings) if found else ""
        rows.append(
            {
                "tried": title,
                "verdict": found.verdict if found else "",
                "named": named or "–",
                "thrust, the five": f"{_together(seen).thrust:.2f}",
                f"thrust, {UNSEEN}": f"{unseen.thrust:.2f}",
                "torque, the five": f"{1e3 * _together(seen).torque:.0f}",
                f"torque, {UNSEEN}": f"{1e3 * unseen.torque:.0f}",
            }
        )
    return markdown(pd.DataFrame(rows))


def _together(errors: list[Errors]) -> Errors:
    thrust, torque = np.sqrt(np.mean(np.square(errors), axis=0))
    return Errors(float(thrust), float(torque))


def _said(own: Own, runs: Runs) -> str:
    before = errors_in_flow(own.ship, runs[UNSEEN])
    after = errors_in_flow(own.named.corrected, runs[UNSEEN])
    direct, bound = errors_in_flow(own.squares, runs[UNSEEN]), own.bound
    heard = sorted({name for term in own.named.corrected.term for name in term.hears})
    return "\n".join(
        [
            f"- **{UNSEEN}, unseen: thrust {before.thrust:.2f} → {after.thrust:.2f} N (target 1.6), "
            f"torque {1e3 * before.torque:.0f} → {1e3 * after.torque:.0f} mN m**, "
            f"{after.thrust / before.thrust:.2f} and {after.torque / before.torque:.2f} of before; the "
            f"bound, the same form fitted to that run itself, is {bound.thrust:.2f} N "
            f"and {1e3 * bound.torque:.0f} mN m. In the propeller "
            f"balance, by {', '.join(heard) or 'no signal'} and the plant's own advance_velocity. By "
            f"least squares in place of the tool's likelihood the same form gives {direct.thrust:.2f} N "
            f"and {1e3 * direct.torque:.0f} mN m.",
            f"- **What the tool says**: {own.named.sentence}",
            f"- **Beside the catalogue**: {own.beside.sentence}",
            f"- **The catalogue alone**: {own.catalogue.sentence} In its first round: "
            + ", ".join(f"{c.effect.label} {c.gain:.0f}" for c, _ in own.catalogue.ranking[:3])
            + " in 2 log L.",
        ]
    )


def _trap(runs: Runs) -> str:
    def reached(names: tuple[str, ...]) -> tuple[float, float]:
        drift = max(float(np.abs(drift_at_propeller(runs[name])).max()) for name in names)
        return float(np.degrees(drift)), min(float(runs[name][SPEED].min()) for name in names)

    return TRAP.format(inside=reached(FITTED), beyond=reached((UNSEEN,)))


def drawn(own: Own, runs: Runs) -> Figure:
    """Thrust and torque of the unseen run: measured, as printed, and with the term."""
    run = runs[UNSEEN]
    table = beside(run)
    figure, axes = figures.new_figure(2, 1, (10.0, 6.0))
    for axis, column, unit in zip(axes[:, 0], (THRUST, TORQUE), ("N", "N m"), strict=True):
        axis.plot(run[TIME], run[column], color=figures.TRUTH, linewidth=0.8, label="measured")
        for ship, label, colour, style in (
            (own.ship, f"w = {PRINTED_WAKE:.2f}, printed", figures.THESIS, "--"),
            (own.named.corrected, "corrected by the five runs", figures.ESTIMATE, "-"),
        ):
            simulated = simulate_recording(ship, table)[column]
            axis.plot(run[TIME], simulated, style, color=colour, linewidth=1.3, label=label)
        axis.set_ylabel(f"{'thrust' if column == THRUST else 'torque'} [{unit}]", fontsize=8)
        axis.tick_params(labelsize=8)
    axes[0, 0].set_title(f"{UNSEEN}, unseen (fitted at {20 // EVERY} Hz)", fontsize=9, loc="left")
    axes[0, 0].legend(fontsize=8, frameon=False, ncols=3)
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure
