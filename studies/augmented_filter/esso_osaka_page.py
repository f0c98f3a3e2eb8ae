"""The page of the Esso Osaka: :mod:`.esso_osaka` beside the thesis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from ...display.figures import PALETTE, THESIS, TRUTH, new_figure
from ...display.tables import markdown
from ..side_by_side import Page, Row, reasons, table
from . import esso_osaka
from .esso_osaka import MINUTES, SEEDS, Results
from .zig_zag import COEFFICIENTS, STEP_S

TITLE = "Esso Osaka: four steering coefficients from a zig-zag (Taylor 2000, section 2.3)"

INTRO = f"""\
`esso-osaka` sails the 10/10 zig-zag at 7 knots for {MINUTES[-1]} minutes. The filter
(`shaftline.observers.ShipFilter`, the same for any ship) has her plant, surge and propeller among it,
and begins at half of the four coefficients of Table 2.3, as unsure as they are large; Q = 0. Readings of
ship speed, sway speed and rate of turn each second; R is their variance without dimension. The plant
holds the revolutions, as the thesis does, so their reading tells nothing. The thesis's R = 0.01 is a
noise larger than the largest sway; R = 1e-8 is the one with which "about three minutes" holds. Numbers
are those of the voyage in the middle of {SEEDS} seeds unless said otherwise."""

TURNING = """\
## The identified ship turns

10 degrees of rudder, after twenty minutes of readings. Diameter in lengths, median of the seeds; errors
as shares of the truth's; the last column counts seeds that found a ship which does not turn so."""


def _rows(results: Results) -> list[Row]:
    three, twenty = esso_osaka.at(results, 1e-8, 3), esso_osaka.at(results, 1e-4, 20)
    turns = results.turns.set_index(["R", "noise"])
    turn, coarse = turns.loc[(1e-4, 1e-2)], turns.loc[(1e-2, 1e-1)]
    hundredth = esso_osaka.at(results, 1e-8, 20)["median error"]
    own = results.own_turn.diameter / results.truth_turn.diameter - 1.0
    ratios = np.abs(twenty[[*COEFFICIENTS]].to_numpy(dtype=float) - 1.0)
    limited = (
        "this is what the readings hold: with a hundredth of the noise the error is "
        f"{100.0 * hundredth:.2g} %, a hundredth too"
    )

    def share(key: str, what: str, value: float, printed: str, most: float, why: str = "") -> Row:
        return Row(key, what, 100.0 * float(value), printed, 0.0, most, why)

    return [
        share("worst_error_percent_3_min", "worst coefficient, 3 min, R = 1e-8 [%]",
              three["median error"], "exact in about 3 min; 3 accepted", 3.0,
              f"the print's R = 0.01 with exact readings gives {_exact(results):.0f} % then"),
        share("worst_seed_error_percent_3_min", "the same, worst seed [%]", three["worst error"],
              "the same", 3.0, "the thesis sails once"),
        share("worst_error_percent_20_min", "worst coefficient, 20 min, R = 1e-4 [%]",
              twenty["median error"], "exact; 2 accepted", 2.0, limited),
        share("worst_seed_error_percent_20_min", "the same, worst seed [%]", twenty["worst error"],
              "exact; 2 accepted", 2.0, "the same"),
        share("bias_percent_20_min", "the same, of each coefficient's median over the seeds [%]",
              ratios.max(), "exact; 2 accepted", 2.0, "no error that is common to all voyages"),
        share("turn_diameter_error_percent", "diameter of the turn, 20 min, R = 1e-4 [%]",
              turn["median error"], "within 5", 5.0),
        share("turn_diameter_worst_seed_error_percent", "the same, worst seed [%]",
              turn["worst error"], "within 5", 5.0),
        share("turn_diameter_error_percent_3_min", "the same, 3 min, R = 1e-8 [%]", abs(own),
              "within 5", 5.0),
        share("turn_diameter_error_percent_coarse", "the same, 20 min, R = 0.01 and such noise [%]",
              coarse["median error"], "within 5, R = 0.01 in all cases", 5.0,
              "noise of the printed variance hides the sway"),
        Row("headings_apart_deg", "zig-zag of the identified ship, heading off by at most [deg]",
            results.headings_apart_deg, "indistinguishable", 0.0, 0.5,
            f"identified in 3 min with R = 1e-8, sailed for {MINUTES[-1]}"),
    ]  # fmt: skip


def _exact(results: Results) -> float:
    """Worst error [%] after three minutes of exact readings with R = 0.01."""
    twins = results.twins
    own = twins[(twins["noise"] == 0.0) & (twins["minutes"] == 3)]
    return 100.0 * float(own["median error"].iloc[0])


def page(tick: Callable[[], None]) -> Page:
    """The page of the twin.

    Args:
        tick: called :data:`.esso_osaka.TICKS` times.
    """
    results = esso_osaka.measured(tick)
    rows = _rows(results)
    twins = results.twins.assign(
        R=results.twins["R"].map("{:g}".format), noise=results.twins["noise"].map("{:g}".format)
    )
    turns = results.turns.assign(
        R=results.turns["R"].map("{:g}".format), noise=results.turns["noise"].map("{:g}".format)
    )
    poles = results.poles
    body = "\n\n".join(
        [
            INTRO, markdown(table(rows)), "Where they differ, and what they rest on:", reasons(rows),
            "![Coefficients, zig-zag and turn](figures/esso-osaka.png)", "## Over time",
            "Estimate over truth, median of the seeds; errors: the worst of the four coefficients, as a "
            "share, of the seed in the middle and of the worst.", markdown(twins, 4),
            f"Half of the coefficients still holds its course: the slowest pole of sway and yaw is "
            f"{poles['half']:.2f} per ship length, with the true ones {poles['ship']:.2f}. On the way "
            "the estimates leave what a ship can be: -Yv falls to 0, the end of its key's range. The "
            "filter then moves all that goes with it along; where the number alone was held there, "
            "voyages at R = 1e-8 were lost.",
            TURNING, markdown(turns, 4),
            "The turn's diameter is a lenient judge: it hangs on the coefficients' ratios, and with "
            f"half of each, where the filter begins, it is {results.half_diameter:.2f} lengths.",
            f"Truth: {results.truth_turn.diameter:.2f} lengths, and {results.own_turn.diameter:.2f} of "
            "the ship identified in three minutes at R = 1e-8.",
            "What the thesis does not print is assumed, and its draught, which is the ship's depth, is "
            "replaced: see `plant/ships/esso-osaka.toml`.",
        ]
    )  # fmt: skip
    numbers = {row.key: row.ours for row in rows}
    for minutes, variance in ((3, 1e-8), (20, 1e-4)):
        own = esso_osaka.at(results, variance, minutes)
        numbers |= {f"{name} {minutes} min": float(own[name]) for name in COEFFICIENTS}
    numbers["turn_diameter_lengths"] = results.truth_turn.diameter
    numbers["turn_diameter_lengths_at_the_start"] = results.half_diameter
    return Page(rows, body, {"esso-osaka": _figure(results)}, numbers)


def _figure(results: Results) -> Figure:
    """The coefficients over time for two noises, the zig-zag, the turn."""
    figure, axes = new_figure(2, 2, (11.0, 8.0))
    figure.suptitle("Esso Osaka, identified from her zig-zag at 7 knots", fontsize=12)
    ends = {"R = 1e-08": 6.0, "R = 0.0001": float(MINUTES[-1])}
    for axis, (label, most) in zip(axes[0], ends.items(), strict=True):
        run = results.drawn[label]
        minutes = STEP_S * np.arange(len(run.ratios)) / 60.0
        for colour, name, own in zip(PALETTE, COEFFICIENTS, run.ratios.T, strict=False):
            axis.plot(minutes, own, color=colour, label=name, linewidth=1.1)
        axis.axhline(1.0, color=TRUTH, linewidth=0.8, linestyle=":")
        axis.set(title=f"estimate over truth, {label}", xlabel="time [min]", xlim=(0.0, most))
        axis.set_ylim(0.0, 2.0)
    axes[0, 0].legend(fontsize=8, frameon=False)
    axis, theirs = axes[1, 0], esso_osaka.voyage().track
    own_track = results.own_track[results.own_track["time_s"] <= 60.0 * MINUTES[-1]]
    axis.plot(theirs["time_s"] / 60.0, np.degrees(theirs["heading"]), color=TRUTH, label="ship")
    axis.plot(theirs["time_s"] / 60.0, np.degrees(theirs["rudder"]), color=THESIS, linewidth=0.8,
              label="her rudder")  # fmt: skip
    axis.plot(own_track["time_s"] / 60.0, np.degrees(own_track["heading_rad"]), color=PALETTE[0],
              linestyle="--", label="identified in 3 min, R = 1e-8")  # fmt: skip
    axis.set(title="zig-zag: heading [deg]", xlabel="time [min]", ylim=(-24.0, 15.0))
    axis.legend(fontsize=8, frameon=False, loc="lower left")
    axis, length = axes[1, 1], esso_osaka.voyage().ship.manoeuvring.length_m
    for name, turn, colour, style in (
        ("ship", results.truth_turn, TRUTH, "-"),
        ("identified in 3 min, R = 1e-8", results.own_turn, PALETTE[0], "--"),
    ):
        axis.plot(
            turn.track["cross_track_m"] / length, turn.track["position_m"] / length, color=colour,
            linestyle=style, label=name,
        )  # fmt: skip
    axis.set(title="turn with 10 degrees of rudder", xlabel="to starboard [L]")
    axis.set_ylabel("along the first course [L]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(fontsize=8, frameon=False)
    return figure
