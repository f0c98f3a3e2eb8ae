"""The page of the Esso Osaka: :mod:`.esso_osaka` beside the thesis."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.display.tables import markdown
from shaftline.plant import load_ship

from ..cells import Cell, Kind, half_digit, number
from ..side_by_side import Page, cell_table, published_text
from . import esso_osaka
from .esso_osaka import MINUTES, SEEDS, Results
from .zig_zag import COEFFICIENTS, STEP_S, coefficients

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


def measures(results: Results) -> dict[str, float]:
    """Return what stands beside the print, by the names of the JSON."""
    three, twenty = esso_osaka.at(results, 1e-8, 3), esso_osaka.at(results, 1e-4, 20)
    turns = results.turns.set_index(["R", "noise"])
    turn, coarse = turns.loc[(1e-4, 1e-2)], turns.loc[(1e-2, 1e-1)]
    own = results.own_turn.diameter / results.truth_turn.diameter - 1.0
    ratios = np.abs(twenty[[*COEFFICIENTS]].to_numpy(dtype=float) - 1.0)
    shares = {
        "worst_error_percent_3_min": three["median error"],
        "worst_seed_error_percent_3_min": three["worst error"],
        "worst_error_percent_20_min": twenty["median error"],
        "worst_seed_error_percent_20_min": twenty["worst error"],
        "bias_percent_20_min": ratios.max(),
        "turn_diameter_error_percent": turn["median error"],
        "turn_diameter_worst_seed_error_percent": turn["worst error"],
        "turn_diameter_error_percent_3_min": abs(own),
        "turn_diameter_error_percent_coarse": coarse["median error"],
    }
    found = {key: 100.0 * float(value) for key, value in shares.items()}
    return found | {
        "worst_error_percent_exact": _exact(results),
        "headings_apart_deg": results.headings_apart_deg,
    }


def cells_of(found: dict[str, float]) -> list[Cell]:
    """Return the printed numbers and sentences with ours.

    Args:
        found: from :func:`measures`.
    """
    table = published_text("esso_osaka_coefficients")["value"]
    ours = coefficients(load_ship("esso-osaka"))
    cells = [
        number("Table 2.3", name, "", value, float(table[name]), half_digit(table[name]),
               "half a unit of the last printed digit", Kind.INPUT)
        for name, value in zip(COEFFICIENTS, ours, strict=True)
    ]  # fmt: skip
    exact = "a plotted curve on its end value, read as 3 %"
    converges = "about 3 minutes to the exact value"

    def share(
        where: str, what: str, key: str, words: str, most: float, basis: str, kind: Kind = Kind.FREE
    ) -> Cell:
        return Cell(where, what, "", found[key], 0.0, most, basis, kind, words=words)

    line, five = "a plotted curve on its end value, read as 2 %", "the limit that the words name"
    end, turn = "the exact value", "less than 5 %"
    figure, circle = "Figure 2-4", "Figure 2-7"
    return [
        *cells,
        share(figure, "worst coefficient, 3 min, R = 1e-8 [%]", "worst_error_percent_3_min", converges,
              3.0, exact, Kind.CALIBRATED),
        share(figure, "worst coefficient of the worst seed, 3 min, R = 1e-8 [%]",
              "worst_seed_error_percent_3_min", converges, 3.0, exact, Kind.CALIBRATED),
        share(figure, "worst coefficient, 3 min, exact measurements, R = 0.01 [%]",
              "worst_error_percent_exact", converges, 3.0, exact),
        share(figure, "worst coefficient, 20 min, R = 1e-4 [%]", "worst_error_percent_20_min", end, 2.0,
              line),
        share(figure, "worst coefficient of the worst seed, 20 min, R = 1e-4 [%]",
              "worst_seed_error_percent_20_min", end, 2.0, line),
        share(figure, "median over the seeds, 20 min, R = 1e-4 [%]", "bias_percent_20_min", end, 2.0,
              line),
        share(circle, "diameter of the turn, 20 min, R = 1e-4 [%]", "turn_diameter_error_percent", turn,
              5.0, five),
        share(circle, "diameter of the worst seed, 20 min, R = 1e-4 [%]",
              "turn_diameter_worst_seed_error_percent", turn, 5.0, five),
        share(circle, "diameter, 3 min, R = 1e-8 [%]", "turn_diameter_error_percent_3_min", turn, 5.0,
              five),
        share(circle, "diameter, 20 min, R = 0.01 and such noise [%]",
              "turn_diameter_error_percent_coarse", turn, 5.0, five),
        share("Figure 2-5", "zig-zag of the identified ship, heading off by at most [deg]",
              "headings_apart_deg", "very small error", 0.5,
              "the width of a plotted line, read as 0.5 degrees of 10"),
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
    found = measures(results)
    cells = cells_of(found)
    twins = results.twins.assign(
        R=results.twins["R"].map("{:g}".format), noise=results.twins["noise"].map("{:g}".format)
    )
    turns = results.turns.assign(
        R=results.turns["R"].map("{:g}".format), noise=results.turns["noise"].map("{:g}".format)
    )
    poles = results.poles
    body = "\n\n".join(
        [
            INTRO, markdown(cell_table(cells)),
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
    numbers = dict(found)
    for minutes, variance in ((3, 1e-8), (20, 1e-4)):
        own = esso_osaka.at(results, variance, minutes)
        numbers |= {f"{name} {minutes} min": float(own[name]) for name in COEFFICIENTS}
    numbers["turn_diameter_lengths"] = results.truth_turn.diameter
    numbers["turn_diameter_lengths_at_the_start"] = results.half_diameter
    return Page(cells, body, {"esso-osaka": _figure(results)}, numbers)


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
