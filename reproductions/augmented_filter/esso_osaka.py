"""Four coefficients of the Esso Osaka from a zig-zag: Taylor 2000, section 2.3, Figures 2-3 to 2-7.

Plant and filter model are ``esso-osaka`` with surge and propeller; the filter starts at half of the four
coefficients of Table 2.3, without process noise.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS
from shaftline.plant import ShipError, load_ship
from shaftline.plant.manoeuvres import TurningCircle

from ..cells import Cell, Kind, half_digit
from ..pages import fill_template
from ..side_by_side import Page, Tick, cell_table, published_text
from ..writing import DIGIT, WORDS, Line, Panel, claim, draw, near
from . import zig_zag
from .zig_zag import COEFFICIENTS, STEP_S, FilterRun, Truth, identified_ship, steady_turn

TITLE = "Esso Osaka: four steering coefficients from a zig-zag (Taylor 2000, section 2.3)"
SPEED = 7.0 * 1852.0 / 3600.0  # m/s; assumed, the thesis prints none
EVERY = 2  # time steps between measurements: one second
EXECUTES = 6
MINUTES = (3, 5, 7, 20)

TWINS = ((1e-8, 1e-4), (1e-6, 1e-3), (1e-4, 1e-2), (1e-2, 1e-1), (1e-2, 0.0))
"""R of the filter, and rms of the actual noise."""

SEEDS = 20
TICKS = len(TWINS) + 1
HALF = (0.5,) * 4


@functools.cache
def voyage() -> Truth:
    """Return twenty minutes of the zig-zag."""
    return zig_zag.simulate_zig_zag(load_ship("esso-osaka"), SPEED, 60.0 * MINUTES[-1], EXECUTES)


def run_case(variance: float, noise: float, seed: int) -> FilterRun:
    """Run the filter with the variance R [-] on one recording with an rms noise [-] and a seed."""
    truth = voyage()
    table = zig_zag.make_recording(truth, noise, seed, EVERY)
    return zig_zag.run_filter(truth, truth.ship, table, zig_zag.Tuning(variance))


def diameter(ratios: Any) -> float:
    """Return the diameter of an identified ship's turn [ship lengths]; NaN without a steady turn."""
    try:
        own = identified_ship(load_ship("esso-osaka"), ratios)
        return steady_turn(own, SPEED).steady_diameter
    except ShipError:
        return np.nan


class Results(NamedTuple):
    """Results on the simulated ship."""

    twins: pd.DataFrame  # a row for each noise and time: median ratios, worst of the four by seed
    examples: dict[str, FilterRun]  # one run of each noise
    turns: pd.DataFrame  # a row for each noise: diameters after twenty minutes
    truth_turn: TurningCircle
    own_turn: TurningCircle  # of the median seed after three minutes at R = 1e-8
    own_track: pd.DataFrame  # zig-zag of the same ship
    half_diameter: float  # with half of each coefficient, where the filter starts
    poles: dict[str, float]  # slowest pole [1/L] of the ship, and with half of the coefficients


def compute_results(tick: Tick) -> Results:
    """Return all results; takes about a minute."""
    ship = load_ship("esso-osaka")
    truth_turn = steady_turn(ship, SPEED)
    rows, turns, examples = [], [], {}
    early: Any = None
    for variance, noise in TWINS:
        runs = [run_case(variance, noise, seed) for seed in range(SEEDS if noise else 1)]
        examples[f"R = {variance:g}" + ("" if noise else ", exact measurements")] = runs[0]
        case = {"R": variance, "noise": noise}
        for minutes in MINUTES:
            at = np.array([run.ratios[round(60.0 * minutes / STEP_S)] for run in runs])
            worst = np.abs(at - 1.0).max(axis=1)
            medians = zip(COEFFICIENTS, np.median(at, axis=0), strict=True)
            rows.append(
                {
                    **case,
                    "minutes": minutes,
                    "seeds": len(runs),
                    **dict(medians),
                    "median error": np.median(worst),
                    "worst error": worst.max(),
                }
            )
            if early is None:  # the first noise after three minutes: the median seed
                early = at[np.argsort(worst)[len(worst) // 2]]
        widths = pd.Series([diameter(run.ratios[-1]) for run in runs])
        off = (widths / truth_turn.steady_diameter - 1.0).abs()
        turns.append(
            {
                **case,
                "seeds": len(runs),
                "diameter": widths.median(),
                "median error": off.median(),
                "worst error": off.max(),
                "no turn": int(widths.isna().sum()),
            }
        )
        tick()
    own = identified_ship(ship, early)
    poles = {
        name: zig_zag.slowest_pole(one, SPEED)
        for name, one in (("ship", ship), ("half", identified_ship(ship, HALF)))
    }
    found = Results(
        pd.DataFrame(rows),
        examples,
        pd.DataFrame(turns),
        truth_turn,
        steady_turn(own, SPEED),
        zig_zag.zig_zag_track(own, SPEED, EXECUTES),
        diameter(HALF),
        poles,
    )
    tick()
    return found


def row_at(results: Results, variance: float, minutes: int, exact: bool = False) -> pd.Series:
    """Return the row of the twins for R and a time [min], with noise or exact measurements."""
    twins = results.twins
    own = (twins["R"] == variance) & (twins["minutes"] == minutes)
    return twins[own & ((twins["noise"] == 0.0) == exact)].iloc[0]


def measures(results: Results) -> dict[str, float]:
    """Return the numbers that are compared with the thesis, by their names in the JSON file."""
    three, twenty = row_at(results, 1e-8, 3), row_at(results, 1e-4, 20)
    turns = results.turns.set_index(["R", "noise"])
    turn, coarse = turns.loc[(1e-4, 1e-2)], turns.loc[(1e-2, 1e-1)]
    own = results.own_turn.steady_diameter / results.truth_turn.steady_diameter - 1.0
    track, theirs = results.own_track["heading_rad"], voyage().track["heading"]
    rows = min(len(track), len(theirs))
    off = track.to_numpy()[:rows] - theirs.to_numpy()[:rows]
    shares = {
        "worst_error_percent_3_min": three["median error"],
        "worst_seed_error_percent_3_min": three["worst error"],
        "worst_error_percent_20_min": twenty["median error"],
        "worst_seed_error_percent_20_min": twenty["worst error"],
        "bias_percent_20_min": (twenty[[*COEFFICIENTS]].astype(float) - 1.0).abs().max(),
        "turn_diameter_error_percent": turn["median error"],
        "turn_diameter_worst_seed_error_percent": turn["worst error"],
        "turn_diameter_error_percent_3_min": abs(own),
        "turn_diameter_error_percent_coarse": coarse["median error"],
        "worst_error_percent_exact": row_at(results, 1e-2, 3, exact=True)["median error"],
    }
    found = {key: 100.0 * float(value) for key, value in shares.items()}
    return found | {"headings_apart_deg": float(np.degrees(np.abs(off).max()))}


def cells_of(found: dict[str, float]) -> list[Cell]:
    """Return the printed numbers and sentences with ours."""
    table = published_text("esso_osaka_coefficients")["value"]
    ours = zig_zag.coefficients(load_ship("esso-osaka"))
    cells = [
        near(
            "Table 2.3", name, value, float(table[name]), half_digit(table[name]), DIGIT, Kind.INPUT
        )
        for name, value in zip(COEFFICIENTS, ours, strict=True)
    ]
    early = (
        "Figure 2-4",
        "about 3 minutes to the exact value",
        3.0,
        ("a plotted curve on its end value, read as 3 %"),
    )
    late = "Figure 2-4", "the exact value", 2.0, "a plotted curve on its end value, read as 2 %"
    circle = "Figure 2-7", "less than 5 %", 5.0, WORDS
    headings = (
        "Figure 2-5",
        "very small error",
        0.5,
        ("the width of a plotted line, read as 0.5 degrees of 10"),
    )
    fitted, free = Kind.CALIBRATED, Kind.FREE
    rows = (
        (early, "worst coefficient, 3 min, R = 1e-8 [%]", "worst_error_percent_3_min", fitted),
        (early, "worst coefficient of the worst seed, 3 min, R = 1e-8 [%]",
         "worst_seed_error_percent_3_min", fitted),
        (early, "worst coefficient, 3 min, exact measurements, R = 0.01 [%]",
         "worst_error_percent_exact", free),
        (late, "worst coefficient, 20 min, R = 1e-4 [%]", "worst_error_percent_20_min", free),
        (late, "worst coefficient of the worst seed, 20 min, R = 1e-4 [%]",
         "worst_seed_error_percent_20_min", free),
        (late, "median over the seeds, 20 min, R = 1e-4 [%]", "bias_percent_20_min", free),
        (circle, "diameter of the turn, 20 min, R = 1e-4 [%]", "turn_diameter_error_percent", free),
        (circle, "diameter of the worst seed, 20 min, R = 1e-4 [%]",
         "turn_diameter_worst_seed_error_percent", free),
        (circle, "diameter, 3 min, R = 1e-8 [%]", "turn_diameter_error_percent_3_min", free),
        (circle, "diameter, 20 min, R = 0.01 and such noise [%]", "turn_diameter_error_percent_coarse",
         free),
        (headings, "zig-zag of the identified ship, heading off by at most [deg]", "headings_apart_deg",
         free),
    )  # fmt: skip
    return cells + [
        claim(where, what, found[key], words, 0.0, most, basis, kind)
        for (where, words, most, basis), what, key, kind in rows
    ]


def page(tick: Tick) -> Page:
    """Return the page of the Esso Osaka."""
    results = compute_results(tick)
    found = measures(results)
    cells = cells_of(found)
    twins, turns = (
        table.assign(R=table["R"].map("{:g}".format), noise=table["noise"].map("{:g}".format))
        for table in (results.twins, results.turns)
    )
    body = fill_template(
        Path(__file__).with_name("esso_osaka.md"),
        cells=cell_table(cells),
        minutes=MINUTES[-1],
        seeds=SEEDS,
        twins=twins,
        turns=turns,
        results=results,
    )
    numbers = dict(found)
    for minutes, variance in ((3, 1e-8), (20, 1e-4)):
        own = row_at(results, variance, minutes)
        numbers |= {f"{name} {minutes} min": float(own[name]) for name in COEFFICIENTS}
    numbers["turn_diameter_lengths"] = results.truth_turn.steady_diameter
    numbers["turn_diameter_lengths_at_the_start"] = results.half_diameter
    return Page(cells, body, {"esso-osaka": _figure(results)}, numbers)


def _figure(results: Results) -> Figure:
    """Draw the coefficients over time for two noises, the zig-zag and the turn."""
    panels = []
    for label, most in (("R = 1e-08", 6.0), ("R = 0.0001", float(MINUTES[-1]))):
        run = results.examples[label]
        minutes = STEP_S * np.arange(len(run.ratios)) / 60.0
        settings = {"xlabel": "time [min]", "xlim": (0.0, most), "ylim": (0.0, 2.0)}
        panels.append(zig_zag.ratio_panel(minutes, run, label, **settings))
    theirs, identified = voyage().track, "identified in 3 min, R = 1e-8"
    own = results.own_track[results.own_track["time_s"] <= 60.0 * MINUTES[-1]]
    minutes = theirs["time_s"] / 60.0
    headings = [
        Line(minutes, np.degrees(theirs["heading"]), "ship"),
        Line(minutes, np.degrees(theirs["rudder"]), "rudder", THESIS, width=0.8),
        Line(own["time_s"] / 60.0, np.degrees(own["heading_rad"]), identified, PALETTE[0], "--"),
    ]
    settings = {"title": "zig-zag: heading [deg]", "xlabel": "time [min]", "ylim": (-24.0, 15.0)}
    turns = {"ship": results.truth_turn, identified: results.own_turn}
    panels += [
        Panel(headings, settings, 1),
        zig_zag.turn_panel(turns, voyage().ship.manoeuvring.length_m),
    ]
    title = "Esso Osaka, identified from its zig-zag at 7 knots"
    figure = draw(panels, (11.0, 8.0), 2, title=title)
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure
