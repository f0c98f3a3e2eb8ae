"""Four coefficients of the Esso Osaka from a zig-zag: Taylor 2000, section 2.3, Figures 2-3 to 2-7.

Plant and filter model are ``esso-osaka`` with surge and propeller; the filter starts at half of the four
coefficients of Table 2.3, without process noise.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.plant import Ship, ShipError, approach, load_ship, nomoto, zig_zag

from ..cells import Cell, Kind, half_digit, number
from ..pages import fill_template
from ..side_by_side import Page, cell_table, published_text
from .zig_zag import (
    COEFFICIENTS,
    STEP_S,
    TEN,
    FilterRun,
    Truth,
    Tuning,
    Turn,
    coefficients,
    make_recording,
    run_filter,
    simulate_zig_zag,
    steady_turn,
    with_coefficients,
)

SPEED = 7.0 * 1852.0 / 3600.0  # m/s; assumed, the thesis prints none
EVERY = 2  # time steps between measurements: one second
EXECUTES = 6
MINUTES = (3, 5, 7, 20)

TWINS = ((1e-8, 1e-4), (1e-6, 1e-3), (1e-4, 1e-2), (1e-2, 1e-1), (1e-2, 0.0))
"""R of the filter, and rms of the actual noise."""

SEEDS = 20
TICKS = len(TWINS) + 1


@functools.cache
def voyage() -> Truth:
    """Return twenty minutes of the zig-zag."""
    return simulate_zig_zag(load_ship("esso-osaka"), SPEED, 60.0 * MINUTES[-1], EXECUTES)


def run_case(variance: float, noise: float, seed: int) -> FilterRun:
    """Run the filter on one recording.

    Args:
        variance: R, the variance that the filter assumes [-].
        noise: rms of the noise that is added to the measurements [-].
        seed: of the noise.
    """
    truth = voyage()
    table = make_recording(truth, noise, seed, EVERY)
    return run_filter(truth, truth.ship, table, Tuning(variance))


def identified_ship(ratios: Any) -> Ship:
    """Return the ship with coefficients of these ratios to the truth, shape (4,)."""
    ship = load_ship("esso-osaka")
    return with_coefficients(ship, np.asarray(ratios) * coefficients(ship))


def diameter(ratios: Any) -> float:
    """Return the diameter of an identified ship's turn [ship lengths]; NaN without a steady turn."""
    try:
        return steady_turn(identified_ship(ratios), SPEED).diameter
    except ShipError:
        return np.nan


def heading_difference(ratios: Any) -> tuple[float, pd.DataFrame]:
    """Return the largest heading error of an identified ship's zig-zag [deg] and its track."""
    own = identified_ship(ratios)
    track = zig_zag(own, approach(own, SPEED), TEN, TEN, executes=EXECUTES).track
    theirs = voyage().track
    rows = min(len(track), len(theirs))
    off = track["heading_rad"].to_numpy()[:rows] - theirs["heading"].to_numpy()[:rows]
    return float(np.degrees(np.abs(off).max())), track


class Results(NamedTuple):
    """Results on the simulated ship."""

    twins: pd.DataFrame  # a row for each noise and time: median ratios, worst of the four by seed
    examples: dict[str, FilterRun]  # one run of each noise
    turns: pd.DataFrame  # a row for each noise: diameters after twenty minutes
    truth_turn: Turn
    own_turn: Turn  # of the median seed after three minutes at R = 1e-8
    own_track: pd.DataFrame  # zig-zag of the same ship
    headings_apart_deg: float
    half_diameter: float  # with half of each coefficient, where the filter starts
    poles: dict[str, float]  # slowest pole [1/L] of the ship, and with half of the coefficients


def compute_results(tick: Callable[[], None]) -> Results:
    """Return all results; takes about a minute."""
    ship = load_ship("esso-osaka")
    truth_turn = steady_turn(ship, SPEED)
    rows, turns, examples = [], [], {}
    early: Any = None
    for variance, noise in TWINS:
        runs = [run_case(variance, noise, seed) for seed in range(SEEDS if noise else 1)]
        label = f"R = {variance:g}" + ("" if noise else ", exact measurements")
        examples[label] = runs[0]
        for minutes in MINUTES:
            at = np.array([run.ratios[round(60.0 * minutes / STEP_S)] for run in runs])
            worst = np.abs(at - 1.0).max(axis=1)
            row: dict[str, Any] = {"R": variance, "noise": noise, "minutes": minutes}
            row |= {"seeds": len(runs)} | dict(
                zip(COEFFICIENTS, np.median(at, axis=0), strict=True)
            )
            row |= {"median error": float(np.median(worst)), "worst error": float(worst.max())}
            rows.append(row)
            if early is None:  # the first noise after three minutes: the median seed
                early = at[np.argsort(worst)[len(worst) // 2]]
        widths = np.array([diameter(run.ratios[-1]) for run in runs])
        off = np.abs(widths / truth_turn.diameter - 1.0)
        turns.append(
            {"R": variance, "noise": noise, "seeds": len(runs), "diameter": np.nanmedian(widths),
             "median error": np.nanmedian(off), "worst error": np.nanmax(off),
             "no turn": int(np.isnan(widths).sum())}
        )  # fmt: skip
        tick()
    apart, track = heading_difference(early)
    poles = {
        name: max(pole.real for pole in nomoto(own, approach(own, SPEED)).poles)
        for name, own in (("ship", ship), ("half", identified_ship(np.full(4, 0.5))))
    }
    own_turn = steady_turn(identified_ship(early), SPEED)
    half = diameter(np.full(4, 0.5))
    tick()
    return Results(
        pd.DataFrame(rows),
        examples,
        pd.DataFrame(turns),
        truth_turn,
        own_turn,
        track,
        apart,
        half,
        poles,
    )


def row_at(results: Results, variance: float, minutes: int) -> pd.Series:
    """Return the row of :attr:`Results.twins` whose noise has the variance that the filter assumes."""
    twins = results.twins
    own = (twins["R"] == variance) & (twins["minutes"] == minutes) & (twins["noise"] > 0.0)
    return twins[own].iloc[0]


TITLE = "Esso Osaka: four steering coefficients from a zig-zag (Taylor 2000, section 2.3)"


def measures(results: Results) -> dict[str, float]:
    """Return the numbers that are compared with the thesis, by their names in the JSON file."""
    three, twenty = row_at(results, 1e-8, 3), row_at(results, 1e-4, 20)
    turns = results.turns.set_index(["R", "noise"])
    turn, coarse = turns.loc[(1e-4, 1e-2)], turns.loc[(1e-2, 1e-1)]
    twins = results.twins
    exact = twins[(twins["noise"] == 0.0) & (twins["minutes"] == 3)]
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
        "worst_error_percent_exact": 100.0 * float(exact["median error"].iloc[0]),
        "headings_apart_deg": results.headings_apart_deg,
    }


def cells_of(found: dict[str, float]) -> list[Cell]:
    """Return the printed numbers and sentences with ours."""
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


def page(tick: Callable[[], None]) -> Page:
    """Return the page of the Esso Osaka."""
    results = compute_results(tick)
    found = measures(results)
    cells = cells_of(found)
    twins, turns = (
        table.assign(R=table["R"].map("{:g}".format), noise=table["noise"].map("{:g}".format))
        for table in (results.twins, results.turns)
    )
    body = fill_template(
        Path(__file__).with_name("esso_osaka.md"), cells=cell_table(cells), minutes=MINUTES[-1],
        seeds=SEEDS, twins=twins, turns=turns, results=results,
    )  # fmt: skip
    numbers = dict(found)
    for minutes, variance in ((3, 1e-8), (20, 1e-4)):
        own = row_at(results, variance, minutes)
        numbers |= {f"{name} {minutes} min": float(own[name]) for name in COEFFICIENTS}
    numbers["turn_diameter_lengths"] = results.truth_turn.diameter
    numbers["turn_diameter_lengths_at_the_start"] = results.half_diameter
    return Page(cells, body, {"esso-osaka": _figure(results)}, numbers)


def _figure(results: Results) -> Figure:
    """Draw the coefficients over time for two noises, the zig-zag and the turn."""
    figure, axes = new_figure(2, 2, (11.0, 8.0))
    figure.suptitle("Esso Osaka, identified from its zig-zag at 7 knots", fontsize=12)
    ends = {"R = 1e-08": 6.0, "R = 0.0001": float(MINUTES[-1])}
    for axis, (label, most) in zip(axes[0], ends.items(), strict=True):
        run = results.examples[label]
        minutes = STEP_S * np.arange(len(run.ratios)) / 60.0
        for colour, name, own in zip(PALETTE, COEFFICIENTS, run.ratios.T, strict=False):
            axis.plot(minutes, own, color=colour, label=name, linewidth=1.1)
        axis.axhline(1.0, color=TRUTH, linewidth=0.8, linestyle=":")
        axis.set(title=f"estimate over truth, {label}", xlabel="time [min]", xlim=(0.0, most))
        axis.set_ylim(0.0, 2.0)
    axes[0, 0].legend(fontsize=8, frameon=False)
    axis, theirs = axes[1, 0], voyage().track
    own_track = results.own_track[results.own_track["time_s"] <= 60.0 * MINUTES[-1]]
    axis.plot(theirs["time_s"] / 60.0, np.degrees(theirs["heading"]), color=TRUTH, label="ship")
    axis.plot(theirs["time_s"] / 60.0, np.degrees(theirs["rudder"]), color=THESIS, linewidth=0.8,
              label="rudder")  # fmt: skip
    axis.plot(own_track["time_s"] / 60.0, np.degrees(own_track["heading_rad"]), color=PALETTE[0],
              linestyle="--", label="identified in 3 min, R = 1e-8")  # fmt: skip
    axis.set(title="zig-zag: heading [deg]", xlabel="time [min]", ylim=(-24.0, 15.0))
    axis.legend(fontsize=8, frameon=False, loc="lower left")
    axis, length = axes[1, 1], voyage().ship.manoeuvring.length_m
    for name, turn, colour, style in (
        ("ship", results.truth_turn, TRUTH, "-"),
        ("identified in 3 min, R = 1e-8", results.own_turn, PALETTE[0], "--"),
    ):
        axis.plot(
            turn.track["cross_track_m"] / length, turn.track["position_m"] / length, color=colour,
            linestyle=style, label=name,
        )  # fmt: skip
    axis.set(title="turn with 10 degrees of rudder", xlabel="to starboard [L]")
    axis.set_ylabel("advance [L]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(fontsize=8, frameon=False)
    return figure
