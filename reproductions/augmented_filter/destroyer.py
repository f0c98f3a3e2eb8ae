"""A nonlinear destroyer identified by a linear model: Taylor 2000, sections 4.2 and 4.3, Table 4.1.

The ship is ``ddg-51-surrogate`` with its nonlinear terms. The model of the filter is the same ship
without them, so the four coefficients must represent the missing terms. Q, FQ and R of Table 4.1 are
read as non-dimensional densities per ship length and as a variance.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS
from shaftline.plant import Ship, ShipError, approach, load_ship, nomoto
from shaftline.plant.manoeuvres import TurningCircle
from shaftline.plant.stepping import DivergenceError

from ..cells import Cell, Kind
from ..pages import fill_template
from ..side_by_side import Page, Tick, cell_table
from ..writing import DIGIT, Line, Panel, claim, draw, near, rms
from . import zig_zag
from .zig_zag import COEFFICIENTS, STEP_S, FilterRun, Truth, Tuning, identified_ship, steady_turn

TITLE = "DDG-51: a nonlinear ship identified by a linear model (Taylor 2000, sections 4.2 and 4.3)"
SHIP = "ddg-51-surrogate"
SPEED = 22.0 * 1852.0 / 3600.0  # m/s
LENGTHS = 60.0  # ship lengths of the zig-zag; assumed
EXECUTES = 15
NONLINEAR = ("X_vr", "Y_vv", "Y_rr", "N_rr")
AVERAGED = 0.67  # share of the run, at its end, over which the coefficients are averaged
RUNS = {"a": Tuning(0.01), "b": Tuning(0.01, 0.0, 0.01), "c": Tuning(0.01, 0.05, 0.01)}
"""Tunings of the thesis: no process noise, noise of the coefficients alone, and Table 4.1."""
LABELS = {"a": "(a) Q = 0, FQ = 0", "b": "(b) Q = 0, FQ = 0.01", "c": "(c) Q = 0.05, FQ = 0.01"}
NOISES = (0.0, 1e-3, 3e-3, 1e-2)
HEADLINE, NOISIEST = 1e-3, NOISES[-1]  # rms of the measurement noise in the first table
EVERY = (1, 2, 4, 8, 16)
"""Time steps between two measurements; the thesis prints no interval, the first one is used."""
SEEDS = 10
TICKS = len(RUNS) + 2
SIGNALS = {"sway": "sway_speed", "yaw": "yaw_rate"}


@functools.cache
def voyage() -> Truth:
    """Return the zig-zag of the nonlinear ship."""
    ship = load_ship(SHIP)
    seconds = LENGTHS * ship.manoeuvring.length_m / SPEED
    return zig_zag.simulate_zig_zag(ship, SPEED, seconds, EXECUTES)


def linear() -> Ship:
    """Return the ship without its nonlinear terms."""
    return load_ship(SHIP).with_values({f"manoeuvring.{name}": 0.0 for name in NONLINEAR})


def run_case(tuning: Tuning, noise: float, seed: int, every: int = 1) -> FilterRun:
    """Run the linear filter on one recording of the nonlinear ship, with an rms noise [-] and a seed."""
    recording = zig_zag.make_recording(voyage(), noise, seed, every)
    return zig_zag.run_filter(voyage(), linear(), recording, tuning)


def mean_ratios(run: FilterRun) -> Any:
    """Return the estimated over the true coefficients, averaged over :data:`AVERAGED`, shape (4,)."""
    first = round((1.0 - AVERAGED) * (len(run.ratios) - 1))
    return run.ratios[first:].mean(axis=0)


def tracking_errors(run: FilterRun) -> dict[str, float]:
    """Return rms errors of the estimated sway and yaw, and the rms of both signals [-]."""
    truth, found = voyage(), {}
    for name, state in SIGNALS.items():
        own, unit = truth.track[state].to_numpy(), truth.units[state]
        found[f"{name}_rms_error"] = rms(run.states[state].to_numpy() - own) / unit
        found[f"{name}_rms"] = rms(own) / unit
    return found


def turn_of(ratios: Any) -> TurningCircle | None:
    """Return the turn of an identified ship; None where it does not turn steadily."""
    try:
        return steady_turn(identified_ship(linear(), ratios), SPEED)
    except (ShipError, DivergenceError):
        return None


class Results(NamedTuple):
    """Results of the three tunings."""

    runs: pd.DataFrame  # a row for each run and noise: median ratios, turn, tracking
    intervals: pd.DataFrame  # of run (c): a row for each measurement interval and noise
    examples: dict[str, FilterRun]  # one of each run, with the noise HEADLINE
    turns: dict[str, TurningCircle]  # of the ships that these runs identify
    zig_zags: dict[str, pd.DataFrame]  # of the same ships
    truth_turn: TurningCircle
    linear_turn: TurningCircle  # of the linear ship with the true coefficients


def compute_results(tick: Tick) -> Results:
    """Return all results; takes about a minute."""
    truth_turn = steady_turn(load_ship(SHIP), SPEED)
    rows: list[dict[str, Any]] = []
    examples, turns, zig_zags = {}, {}, {}
    for name, tuning in RUNS.items():
        for noise in NOISES:
            runs = [run_case(tuning, noise, seed) for seed in range(SEEDS if noise else 1)]
            ratios, summary = _summarise(runs, truth_turn)
            errors = pd.DataFrame([tracking_errors(run) for run in runs]).median().to_dict()
            row = {"run": name, "noise": noise, "seeds": len(runs)} | summary | errors
            rows.append(row | {"slowest pole": math.nan})
            if name == "a":
                own = identified_ship(linear(), ratios[0])
                rows[-1]["slowest pole"] = zig_zag.slowest_pole(own, SPEED)
            if noise == HEADLINE:
                examples[name] = runs[0]
                if (turn := turn_of(ratios[0])) is not None:
                    turns[name], own = turn, identified_ship(linear(), ratios[0])
                    zig_zags[name] = zig_zag.zig_zag_track(own, SPEED, EXECUTES)
        tick()
    intervals = []
    for every in EVERY:
        for noise in (HEADLINE, NOISIEST):
            runs = [run_case(RUNS["c"], noise, seed, every) for seed in range(SEEDS)]
            row = {"interval_s": STEP_S * every, "noise": noise, "seeds": SEEDS}
            intervals.append(row | _summarise(runs, truth_turn)[1])
    tick()
    linear_turn = steady_turn(linear(), SPEED)
    tick()
    tables = pd.DataFrame(rows), pd.DataFrame(intervals)
    return Results(*tables, examples, turns, zig_zags, truth_turn, linear_turn)


def _summarise(runs: list[FilterRun], truth_turn: TurningCircle) -> tuple[Any, dict[str, Any]]:
    """Return the ratios of all runs, shape (seeds, 4), and by name their medians and the turns."""
    ratios = np.array([mean_ratios(run) for run in runs])
    widths = pd.Series(
        [turn.steady_diameter if turn else math.nan for turn in map(turn_of, ratios)]
    )
    tighter = 100.0 * (1.0 - widths / truth_turn.steady_diameter)
    return ratios, {
        **dict(zip(COEFFICIENTS, np.median(ratios, axis=0), strict=True)),
        "diameter": widths.median(),
        "tighter [%]": tighter.median(),
        "least": tighter.min(),
        "most": tighter.max(),
        "no turn": int(widths.isna().sum()),
    }


def measures(results: Results) -> dict[str, float]:
    """Return the numbers that are compared with the thesis, by their names in the JSON file."""
    runs = results.runs.set_index(["run", "noise"])
    c, turn, ship = runs.loc[("c", HEADLINE)], results.truth_turn, load_ship(SHIP)
    own = nomoto(ship, approach(ship, SPEED))
    return {
        "turn_tighter_percent": float(c["tighter [%]"]),
        "speed_loss_percent": 100.0 * (1.0 - turn.speed_ratio),
        "revolutions_loss_percent": 100.0 * (1.0 - turn.shaft_speed_ratio),
        **{
            f"{name}_error_share_percent": 100.0 * float(c[f"{name}_rms_error"] / c[f"{name}_rms"])
            for name in SIGNALS
        },
        "slowest_pole_without_noise_believed_in": float(runs.loc[("a", HEADLINE), "slowest pole"]),
        "turn_tighter_percent_noisy": float(runs.loc[("c", NOISIEST), "tighter [%]"]),
        "nomoto_gain": own.gain,
        "nomoto_time": own.time,
    }


def cells_of(found: dict[str, float]) -> list[Cell]:
    """Return the printed numbers and sentences with ours."""
    five = "'approximately' or 'about', a number rounded to 5"
    line = "the width of a plotted line, read as 5 % of the signal's rms"
    equations, diameter = "eqs. 5.25 and 5.26", "section 4.3.4, Figure 4-11"
    turn, tighter = "section 4.3.4, Figure 4-10", "turn_tighter_percent"
    ours = "turn of the identified ship tighter than the plant's [%]"
    fitted = Kind.CALIBRATED
    return [
        near(equations, "K [-]", found["nomoto_gain"], 2.04, 0.005, DIGIT, fitted),
        near(equations, "T [L]", found["nomoto_time"], 1.9287, 0.00005, DIGIT, fitted),
        near(diameter, ours, found[tighter], 15.0, 2.5, five, fitted),
        near(diameter, f"{ours}, noise of {NOISIEST:g}", found[f"{tighter}_noisy"], 15.0, 2.5, five,
             fitted),
        near(turn, "speed lost in the plant's turn [%]", found["speed_loss_percent"], 20.0, 2.5, five,
             fitted),
        near(turn, "revolutions lost in it [%]", found["revolutions_loss_percent"], 10.0, 2.5, five),
        *(claim("Figure 4-8", f"rms error of the {name} over its rms [%]",
                found[f"{name}_error_share_percent"], "tracks quite well", 0.0, 5.0, line)
          for name in SIGNALS),
        claim("Figure 4-6", "slowest pole of the ship identified in run (a) [1/L]",
              found["slowest_pole_without_noise_believed_in"], "an unstable plant", 0.0, math.inf,
              "a pole on the right"),
    ]  # fmt: skip


def page(tick: Tick) -> Page:
    """Return the page of the destroyer."""
    results = compute_results(tick)
    found = measures(results)
    cells, truth = cells_of(found), results.truth_turn.steady_diameter
    body = fill_template(
        Path(__file__).with_name("destroyer.md"),
        cells=cell_table(cells),
        lengths=LENGTHS,
        terms=", ".join(NONLINEAR),
        averaged=100.0 * AVERAGED,
        seeds=SEEDS,
        noise=HEADLINE,
        truth=truth,
        linear=results.linear_turn.steady_diameter,
        runs=_format_runs(results.runs),
        intervals=_format_numbers(results.intervals),
    )
    runs = {
        f"{row.pop('run')}, noise {row.pop('noise'):g}": {
            key: float(value) for key, value in row.items() if math.isfinite(value)
        }
        for row in results.runs.to_dict("records")
    }
    numbers = {**found, "turn_diameter_lengths": truth, "runs": runs}
    return Page(cells, body, {"destroyer": _figure(results)}, numbers)


def _format_numbers(runs: pd.DataFrame) -> pd.DataFrame:
    """Return a table as text; numbers over a thousand, of diverged runs, in powers of ten."""

    def text(value: Any) -> str:
        if not isinstance(value, float):
            return str(value)
        if not math.isfinite(value):
            return "–"
        return f"{value:.1e}" if abs(value) > 1e3 else f"{value:.4g}"

    return runs.astype(object).map(text)


def _format_runs(runs: pd.DataFrame) -> pd.DataFrame:
    """Return the runs as text, each rms error beside the rms of its signal."""
    shown = _format_numbers(runs.drop(columns=[c for c in runs if "_rms" in str(c)]))
    for name in SIGNALS:
        pairs = zip(runs[f"{name}_rms_error"], runs[f"{name}_rms"], strict=True)
        shown[f"{name}: error, rms"] = [
            f"{error:.2g}, {own:.2g}" if math.isfinite(error) else "–" for error, own in pairs
        ]
    return shown


def _figure(results: Results) -> Figure:
    """Draw the coefficients over time, sway and yaw, zig-zags and turns."""
    truth, x = voyage(), "distance at 22 knots [L]"
    way = truth.track["time_s"].to_numpy() / truth.length_s
    panels = [
        zig_zag.ratio_panel(way, run, LABELS[name], xlabel=x, ylim=(0.0, 2.5))
        for name, run in results.examples.items()
    ]
    states = []
    for (name, state), colour in zip(SIGNALS.items(), PALETTE, strict=False):
        label = f"{name}{' over U' if name == 'sway' else ', r L / U'}, estimated in (c)"
        unit, own = truth.units[state], results.examples["c"].states[state]
        states += [
            Line(way, truth.track[state] / unit, width=1.6),
            Line(way, own / unit, label, colour, "--"),
        ]
    headings = [Line(way, np.degrees(truth.track["heading"]), "ship")]
    headings += [
        Line(
            track["time_s"] / truth.length_s,
            np.degrees(track["heading_rad"]),
            f"identified, ({name})",
            colour,
            "--",
        )
        for colour, (name, track) in zip(PALETTE, results.zig_zags.items(), strict=False)
    ]
    turns = {"ship": results.truth_turn} | {
        f"identified, ({n})": t for n, t in results.turns.items()
    }
    common = {"xlabel": x, "xlim": (0.0, 25.0)}
    panels += [
        Panel(states, {"title": "sway and yaw; ship in black", "ylim": (-0.33, 0.26)} | common, 1),
        Panel(headings, {"title": "zig-zag: heading [deg]", "ylim": (-32.0, 21.0)} | common, 2),
        zig_zag.turn_panel(turns, truth.ship.manoeuvring.length_m),
    ]
    title = f"DDG-51's surrogate at 22 knots, identified by a linear model; noise {HEADLINE:g} rms"
    figure = draw(panels, (13.0, 8.0), 3, title=title)
    for axis in figure.axes[:3]:
        axis.axvline((1.0 - AVERAGED) * way[-1], color=THESIS, linewidth=0.8, linestyle="--")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure
