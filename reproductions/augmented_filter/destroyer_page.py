"""The page of the destroyer: :mod:`.destroyer` beside the thesis."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.display.tables import markdown

from ..cells import Cell, Kind, number
from ..side_by_side import Page, cell_table
from . import destroyer
from .destroyer import HEADLINE, KEPT, LENGTHS, SEEDS, Results
from .zig_zag import COEFFICIENTS

TITLE = "DDG-51: a nonlinear ship identified by a linear model (Taylor 2000, sections 4.2 and 4.3)"

CALLED = {
    "a": "(a) Q = 0, FQ = 0",
    "b": "(b) Q = 0, FQ = 0.01",
    "c": "(c) Q = 0.05, FQ = 0.01",
}

INTRO = f"""\
`ddg-51-surrogate` sails {LENGTHS:g} ship lengths of the 10/10 zig-zag at 22 knots. The filter
(`shaftline.observers.ShipFilter`) believes in the same ship without
{", ".join(destroyer.NONLINEAR)}, and begins at half of her four coefficients. It reads
ship speed, sway, rate of turn and revolutions twice a second (the thesis prints no interval), and knows
the rudder's angle. Three runs, as the thesis has them: (a) no noise that it believes in, (b) fake noise
on the coefficients alone, (c) Table 4.1's Q = 0.05, FQ = 0.01; R = 0.01 in each. These are read as
absolute densities per ship length and as a variance, without dimension. The coefficients are means over
the last
{100.0 * KEPT:.0f} % of a run, and the turn is the one that the linear ship sails with them. The table
has medians of {SEEDS} seeds with noise of {HEADLINE:g} rms on each reading. The ship is a surrogate:
the thesis's own plant is not in it."""

CALIBRATED = """\
The surrogate was scaled to the printed K and T, and its nonlinear terms were chosen such that a turn
loses a fifth of the speed and is 15 % wider than that of its linear terms (here {limit:.1f} %). These
rows are therefore no evidence. The identified ship does not reach these 15 %: the coefficients that the
linear model finds on the zig-zag are larger than the true ones."""

RUNS_TEXT = """\
## The three runs

Coefficients over those of the plant, medians of the seeds; by how much the turn of the identified ship
is tighter than the plant's, and the least and most of it among the seeds; seeds that found no ship that
turns; rms errors of sway and yaw beside their own rms, without dimension."""


INTERVALS_TEXT = """\
## How often it is read

The thesis prints no interval of its readings. Run (c) again, by the seconds between them:"""


def _row(results: Results, run: str, noise: float) -> Any:
    runs = results.runs
    return runs[(runs["run"] == run) & (runs["noise"] == noise)].iloc[0]


NOISIER = destroyer.NOISES[-1]


def measures(results: Results) -> dict[str, float]:
    """Return what stands beside the print, by the names of the JSON."""
    c, turn = _row(results, "c", HEADLINE), results.truth_turn
    steering = destroyer.steering()
    return {
        "turn_tighter_percent": float(c["tighter [%]"]),
        "speed_loss_percent": 100.0 * (1.0 - turn.speed_ratio),
        "revolutions_loss_percent": 100.0 * (1.0 - turn.shaft_speed_ratio),
        "sway_error_share_percent": 100.0 * float(c["sway_rms_error"] / c["sway_rms"]),
        "yaw_error_share_percent": 100.0 * float(c["yaw_rms_error"] / c["yaw_rms"]),
        "slowest_pole_without_noise_believed_in": float(
            _row(results, "a", HEADLINE)["slowest pole"]
        ),
        "turn_tighter_percent_noisy": float(_row(results, "c", NOISIER)["tighter [%]"]),
        "nomoto_gain": steering.gain,
        "nomoto_time": steering.time,
    }


def cells_of(found: dict[str, float]) -> list[Cell]:
    """Return the printed numbers and sentences with ours.

    Args:
        found: from :func:`measures`.
    """
    five = "'approximately' or 'about', a number rounded to 5"
    line = "the width of a plotted line, read as 5 % of the signal's rms"
    diameter, turn = "section 4.3.4, Figure 4-11", "section 4.3.4, Figure 4-10"
    ours = "turn of the identified ship tighter than the plant's [%]"

    def near(where: str, what: str, key: str, printed: float, kind: Kind) -> Cell:
        return number(where, what, "", found[key], printed, 2.5, five, kind)

    return [
        number("eqs. 5.25 and 5.26", "K [-]", "", found["nomoto_gain"], 2.04, 0.005,
               "half a unit of the last printed digit", Kind.CALIBRATED),
        number("eqs. 5.25 and 5.26", "T [L]", "", found["nomoto_time"], 1.9287, 0.00005,
               "half a unit of the last printed digit", Kind.CALIBRATED),
        near(diameter, ours, "turn_tighter_percent", 15.0, Kind.CALIBRATED),
        near(diameter, f"{ours}, noise of {NOISIER:g}", "turn_tighter_percent_noisy", 15.0,
             Kind.CALIBRATED),
        near(turn, "speed lost in the plant's turn [%]", "speed_loss_percent", 20.0, Kind.CALIBRATED),
        near(turn, "revolutions lost in it [%]", "revolutions_loss_percent", 10.0, Kind.FREE),
        Cell("Figure 4-8", "rms error of the sway over its rms [%]", "",
             found["sway_error_share_percent"], 0.0, 5.0, line, words="tracks quite well"),
        Cell("Figure 4-8", "rms error of the yaw over its rms [%]", "",
             found["yaw_error_share_percent"], 0.0, 5.0, line, words="tracks quite well"),
        Cell("Figure 4-6", "slowest pole of the ship identified in run (a) [1/L]", "",
             found["slowest_pole_without_noise_believed_in"], 0.0, math.inf,
             "a pole on the right", words="an unstable plant"),
    ]  # fmt: skip


def page(tick: Callable[[], None]) -> Page:
    """The page of the destroyer.

    Args:
        tick: called :data:`.destroyer.TICKS` times.
    """
    results = destroyer.measured(tick)
    found = measures(results)
    cells = cells_of(found)
    shown = _shown(results.runs)
    turn, width = results.truth_turn, results.linear_turn.diameter
    limit = 100.0 * (1.0 - width / turn.diameter)
    body = "\n\n".join(
        [
            INTRO, markdown(cell_table(cells)), CALIBRATED.format(limit=limit),
            "![Coefficients, zig-zag and turns](figures/destroyer.png)", RUNS_TEXT,
            markdown(shown),
            "Run (b) tracks the readings as closely as (c), but its coefficients go up and down with "
            "each swing of the zig-zag: they stand for what the linear model lacks. With noise of 0.003 "
            "and more, (b) and (c) find ships that turn too widely, or none.",
            INTERVALS_TEXT, markdown(_told(results.intervals)),
            f"Diameter of the plant's turn: {results.truth_turn.diameter:.2f} lengths; of the linear "
            f"ship with the true coefficients {results.linear_turn.diameter:.2f}.",
        ]
    )  # fmt: skip
    numbers: dict[str, Any] = dict(found)
    numbers["turn_diameter_lengths"] = results.truth_turn.diameter
    numbers["runs"] = {
        f"{row['run']}, noise {row['noise']:g}": {
            str(key): float(value)
            for key, value in row.drop(["run", "noise"]).items()
            if math.isfinite(value)
        }
        for _, row in results.runs.iterrows()
    }
    return Page(cells, body, {"destroyer": _figure(results)}, numbers)


def _told(runs: pd.DataFrame) -> pd.DataFrame:
    """Runs as text; numbers over a thousand, of runs that were lost, in powers of ten."""

    def told(value: Any) -> str:
        if not isinstance(value, float):
            return str(value)
        if not math.isfinite(value):
            return "–"
        return f"{value:.1e}" if abs(value) > 1e3 else f"{value:.4g}"

    return runs.astype(object).map(told)


def _shown(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs as text, each rms error beside its signal's."""
    shown = _told(runs.drop(columns=[c for c in runs if "_rms" in str(c)]))
    for name in ("sway", "yaw"):
        pairs = zip(runs[f"{name}_rms_error"], runs[f"{name}_rms"], strict=True)
        shown[f"{name}: error, rms"] = [
            f"{error:.2g}, {rms:.2g}" if math.isfinite(error) else "–" for error, rms in pairs
        ]
    return shown


def _figure(results: Results) -> Figure:
    """Coefficients over time of the three runs; sway and yaw, zig-zags, turns."""
    truth = destroyer.voyage()
    figure, axes = new_figure(2, 3, (13.0, 8.0))
    figure.suptitle(
        f"DDG-51's surrogate at 22 knots, identified by a linear model; noise {HEADLINE:g} rms",
        fontsize=12,
    )
    way = truth.track["time_s"].to_numpy() / truth.length_s
    for axis, (name, run) in zip(axes[0], results.drawn.items(), strict=True):
        for colour, label, own in zip(PALETTE, COEFFICIENTS, run.ratios.T, strict=False):
            axis.plot(way, own, color=colour, label=label, linewidth=1.0)
        axis.axhline(1.0, color=TRUTH, linewidth=0.8, linestyle=":")
        axis.axvline((1.0 - KEPT) * way[-1], color=THESIS, linewidth=0.8, linestyle="--")
        axis.set(title=f"estimate over truth, {CALLED[name]}", xlabel="way at 22 knots [L]")
        axis.set_ylim(0.0, 2.5)
    axes[0, 0].legend(fontsize=8, frameon=False)
    axis = axes[1, 0]
    for state, label, factor, colour in (
        ("sway_speed", "sway over U", 1.0 / truth.units["sway_speed"], PALETTE[0]),
        ("yaw_rate", "yaw, r L / U", 1.0 / truth.units["yaw_rate"], PALETTE[1]),
    ):
        axis.plot(way, factor * truth.track[state], color=TRUTH, linewidth=1.6)
        axis.plot(way, factor * results.drawn["c"].states[state], color=colour, linestyle="--",
                  linewidth=1.0, label=f"{label}, estimated in (c)")  # fmt: skip
    axis.set(title="sway and yaw tracked; the ship dark", xlabel="way at 22 knots [L]")
    axis.set(xlim=(0.0, 25.0), ylim=(-0.33, 0.26))
    axis.legend(fontsize=8, frameon=False, loc="lower left")
    axis = axes[1, 1]
    axis.plot(way, np.degrees(truth.track["heading"]), color=TRUTH, label="ship")
    for colour, (name, track) in zip(PALETTE, results.zig_zags.items(), strict=False):
        axis.plot(track["time_s"] / truth.length_s, np.degrees(track["heading_rad"]), color=colour,
                  linestyle="--", linewidth=1.0, label=f"identified, ({name})")  # fmt: skip
    axis.set(title="zig-zag: heading [deg]", xlabel="way at 22 knots [L]", xlim=(0.0, 25.0))
    axis.set_ylim(-32.0, 21.0)
    axis.legend(fontsize=8, frameon=False, loc="lower left", ncols=2)
    axis, length = axes[1, 2], truth.ship.manoeuvring.length_m
    turns = {"ship": results.truth_turn} | {
        f"identified, ({n})": t for n, t in results.turns.items()
    }
    for colour, (name, turn) in zip((TRUTH, *PALETTE), turns.items(), strict=False):
        axis.plot(
            turn.track["cross_track_m"] / length, turn.track["position_m"] / length, color=colour,
            linestyle="-" if name == "ship" else "--", linewidth=1.1, label=name,
        )  # fmt: skip
    axis.set(title="turn with 10 degrees of rudder", xlabel="to starboard [L]")
    axis.set_ylabel("along the first course [L]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(fontsize=8, frameon=False)
    return figure
