"""A nonlinear destroyer identified by a linear model: Taylor 2000, sections 4.2 and 4.3, Table 4.1.

The ship is ``ddg-51-surrogate`` with its nonlinear terms. The model of the filter is the same ship
without them, so the four coefficients must represent the missing terms. Q, FQ and R of Table 4.1 are
read as non-dimensional densities per ship length and as a variance.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.display.figures import PALETTE, THESIS, TRUTH, new_figure
from shaftline.plant import Nomoto, Ship, ShipError, approach, load_ship, nomoto, zig_zag
from shaftline.plant.stepping import DivergenceError

from ..cells import Cell, Kind, number
from ..pages import fill_template
from ..side_by_side import Page, cell_table
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

TITLE = "DDG-51: a nonlinear ship identified by a linear model (Taylor 2000, sections 4.2 and 4.3)"
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


@functools.cache
def voyage() -> Truth:
    """Return the zig-zag of the nonlinear ship."""
    ship = load_ship("ddg-51-surrogate")
    seconds = LENGTHS * ship.manoeuvring.length_m / SPEED
    return simulate_zig_zag(ship, SPEED, seconds, EXECUTES)


def linear() -> Ship:
    """Return the ship without its nonlinear terms."""
    ship = load_ship("ddg-51-surrogate")
    return ship.with_values({f"manoeuvring.{name}": 0.0 for name in NONLINEAR})


def run_case(tuning: Tuning, noise: float, seed: int, every: int = 1) -> FilterRun:
    """Run the linear filter on one recording of the nonlinear ship.

    Args:
        tuning: of the filter.
        noise: rms of the measurement noise [-].
        seed: of the noise.
        every: time steps between two measurements.
    """
    return run_filter(voyage(), linear(), make_recording(voyage(), noise, seed, every), tuning)


def mean_ratios(run: FilterRun) -> Any:
    """Return the estimated over the true coefficients, averaged over :data:`AVERAGED`, shape (4,)."""
    first = round((1.0 - AVERAGED) * (len(run.ratios) - 1))
    return run.ratios[first:].mean(axis=0)


def identified_ship(ratios: Any) -> Ship:
    """Return the linear ship with coefficients of these ratios to the truth, shape (4,).

    Raises:
        ShipError: a coefficient is outside the range of a ship file.
    """
    ship = linear()
    return with_coefficients(ship, np.asarray(ratios) * coefficients(ship))


def tracking_errors(run: FilterRun) -> dict[str, float]:
    """Return rms errors of the estimated sway and yaw, and the rms of both signals [-]."""
    truth, rms = voyage(), {}
    for name, state in (("sway", "sway_speed"), ("yaw", "yaw_rate")):
        own = truth.track[state].to_numpy()
        error = run.states[state].to_numpy() - own
        for label, values in ((f"{name}_rms_error", error), (f"{name}_rms", own)):
            rms[label] = float(np.sqrt(np.mean(values**2))) / truth.units[state]
    return rms


def turn_of(ratios: Any) -> Turn | None:
    """Return the turn of an identified ship; None where it does not turn steadily."""
    try:
        return steady_turn(identified_ship(ratios), SPEED)
    except (ShipError, DivergenceError):
        return None


def steering() -> Nomoto:
    """Return K and T of the surrogate at 22 knots."""
    ship = load_ship("ddg-51-surrogate")
    return nomoto(ship, approach(ship, SPEED))


def slowest_pole(ratios: Any) -> float:
    """Return the largest real part of the poles of sway and yaw of an identified ship [1/L].

    Args:
        ratios: its coefficients over the truth, shape (4,).

    Raises:
        ShipError: a coefficient is outside the range of a ship file.
    """
    ship = identified_ship(ratios)
    return max(pole.real for pole in nomoto(ship, approach(ship, SPEED)).poles)


class Results(NamedTuple):
    """Results of the three tunings."""

    runs: pd.DataFrame  # a row for each run and noise: median ratios, turn, tracking
    intervals: pd.DataFrame  # of run (c): a row for each measurement interval and noise
    examples: dict[str, FilterRun]  # one of each run, with the noise HEADLINE
    turns: dict[str, Turn]  # of the ships that these runs identify
    zig_zags: dict[str, pd.DataFrame]  # of the same ships
    truth_turn: Turn
    linear_turn: Turn  # of the linear ship with the true coefficients


def compute_results(tick: Callable[[], None]) -> Results:
    """Return all results; takes about a minute."""
    truth_turn = steady_turn(load_ship("ddg-51-surrogate"), SPEED)
    rows: list[dict[str, Any]] = []
    examples, turns, zig_zags = {}, {}, {}
    for name, tuning in RUNS.items():
        for noise in NOISES:
            runs = [run_case(tuning, noise, seed) for seed in range(SEEDS if noise else 1)]
            ratios, summary = _summarise(runs, truth_turn)
            row: dict[str, Any] = {"run": name, "noise": noise, "seeds": len(runs)} | summary
            errors = [tracking_errors(run) for run in runs]
            row |= {key: _median([one[key] for one in errors]) for key in errors[0]}
            row["slowest pole"] = slowest_pole(ratios[0]) if name == "a" else math.nan
            rows.append(row)
            if noise == HEADLINE:
                examples[name] = runs[0]
                if (turn := turn_of(ratios[0])) is not None:
                    turns[name], own = turn, identified_ship(ratios[0])
                    start = approach(own, SPEED)
                    zig_zags[name] = zig_zag(own, start, TEN, TEN, executes=EXECUTES).track
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


def _summarise(runs: list[FilterRun], truth_turn: Turn) -> tuple[Any, dict[str, Any]]:
    """Return the ratios of all runs, shape (seeds, 4), and by name their medians and the turns."""
    ratios = np.array([mean_ratios(run) for run in runs])
    widths = [turn.diameter if turn else math.nan for turn in map(turn_of, ratios)]
    tighter = 100.0 * (1.0 - np.array(widths) / truth_turn.diameter)
    any_turn = bool(np.isfinite(tighter).any())
    return ratios, {
        **dict(zip(COEFFICIENTS, np.median(ratios, axis=0), strict=True)),
        "diameter": _median(widths),
        "tighter [%]": _median(tighter),
        "least": float(np.nanmin(tighter)) if any_turn else math.nan,
        "most": float(np.nanmax(tighter)) if any_turn else math.nan,
        "no turn": int(np.isnan(widths).sum()),
    }


def _median(values: Any) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else math.nan


def _row(results: Results, run: str, noise: float) -> Any:
    runs = results.runs
    return runs[(runs["run"] == run) & (runs["noise"] == noise)].iloc[0]


def measures(results: Results) -> dict[str, float]:
    """Return the numbers that are compared with the thesis, by their names in the JSON file."""
    c, turn, own = _row(results, "c", HEADLINE), results.truth_turn, steering()
    return {
        "turn_tighter_percent": float(c["tighter [%]"]),
        "speed_loss_percent": 100.0 * (1.0 - turn.speed_ratio),
        "revolutions_loss_percent": 100.0 * (1.0 - turn.shaft_speed_ratio),
        "sway_error_share_percent": 100.0 * float(c["sway_rms_error"] / c["sway_rms"]),
        "yaw_error_share_percent": 100.0 * float(c["yaw_rms_error"] / c["yaw_rms"]),
        "slowest_pole_without_noise_believed_in": float(
            _row(results, "a", HEADLINE)["slowest pole"]
        ),
        "turn_tighter_percent_noisy": float(_row(results, "c", NOISIEST)["tighter [%]"]),
        "nomoto_gain": own.gain,
        "nomoto_time": own.time,
    }


def cells_of(found: dict[str, float]) -> list[Cell]:
    """Return the printed numbers and sentences with ours."""
    digit = "half a unit of the last printed digit"
    five = "'approximately' or 'about', a number rounded to 5"
    line = "the width of a plotted line, read as 5 % of the signal's rms"
    diameter, turn = "section 4.3.4, Figure 4-11", "section 4.3.4, Figure 4-10"
    ours = "turn of the identified ship tighter than the plant's [%]"
    calibrated, free = Kind.CALIBRATED, Kind.FREE
    noisy, losses = f"{ours}, noise of {NOISIEST:g}", ("speed", "revolutions")
    speed, revolutions = (found[f"{loss}_loss_percent"] for loss in losses)
    nearly = [
        (diameter, ours, found["turn_tighter_percent"], 15.0, calibrated),
        (diameter, noisy, found["turn_tighter_percent_noisy"], 15.0, calibrated),
        (turn, "speed lost in the plant's turn [%]", speed, 20.0, calibrated),
        (turn, "revolutions lost in it [%]", revolutions, 10.0, free),
    ]
    return [
        number("eqs. 5.25 and 5.26", "K [-]", "", found["nomoto_gain"], 2.04, 0.005, digit, calibrated),
        number("eqs. 5.25 and 5.26", "T [L]", "", found["nomoto_time"], 1.9287, 0.00005, digit,
               calibrated),
        *(number(where, what, "", value, printed, 2.5, five, kind)
          for where, what, value, printed, kind in nearly),
        *(Cell("Figure 4-8", f"rms error of the {name} over its rms [%]", "",
               found[f"{name}_error_share_percent"], 0.0, 5.0, line, words="tracks quite well")
          for name in ("sway", "yaw")),
        Cell("Figure 4-6", "slowest pole of the ship identified in run (a) [1/L]", "",
             found["slowest_pole_without_noise_believed_in"], 0.0, math.inf,
             "a pole on the right", words="an unstable plant"),
    ]  # fmt: skip


def page(tick: Callable[[], None]) -> Page:
    """Return the page of the destroyer."""
    results = compute_results(tick)
    found = measures(results)
    cells = cells_of(found)
    body = fill_template(
        Path(__file__).with_name("destroyer.md"), cells=cell_table(cells), lengths=LENGTHS,
        terms=", ".join(NONLINEAR), averaged=100.0 * AVERAGED, seeds=SEEDS, noise=HEADLINE,
        truth=results.truth_turn.diameter, linear=results.linear_turn.diameter,
        runs=_format_runs(results.runs), intervals=_format_numbers(results.intervals),
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
    for name in ("sway", "yaw"):
        pairs = zip(runs[f"{name}_rms_error"], runs[f"{name}_rms"], strict=True)
        shown[f"{name}: error, rms"] = [
            f"{error:.2g}, {rms:.2g}" if math.isfinite(error) else "–" for error, rms in pairs
        ]
    return shown


def _figure(results: Results) -> Figure:
    """Draw the coefficients over time, sway and yaw, zig-zags and turns."""
    truth = voyage()
    figure, axes = new_figure(2, 3, (13.0, 8.0))
    figure.suptitle(
        f"DDG-51's surrogate at 22 knots, identified by a linear model; noise {HEADLINE:g} rms",
        fontsize=12,
    )
    way = truth.track["time_s"].to_numpy() / truth.length_s
    for axis, (name, run) in zip(axes[0], results.examples.items(), strict=True):
        for colour, label, own in zip(PALETTE, COEFFICIENTS, run.ratios.T, strict=False):
            axis.plot(way, own, color=colour, label=label, linewidth=1.0)
        axis.axhline(1.0, color=TRUTH, linewidth=0.8, linestyle=":")
        axis.axvline((1.0 - AVERAGED) * way[-1], color=THESIS, linewidth=0.8, linestyle="--")
        axis.set(title=f"estimate over truth, {LABELS[name]}", xlabel="distance at 22 knots [L]")
        axis.set_ylim(0.0, 2.5)
    axes[0, 0].legend(fontsize=8, frameon=False)
    axis = axes[1, 0]
    for state, label, factor, colour in (
        ("sway_speed", "sway over U", 1.0 / truth.units["sway_speed"], PALETTE[0]),
        ("yaw_rate", "yaw, r L / U", 1.0 / truth.units["yaw_rate"], PALETTE[1]),
    ):
        axis.plot(way, factor * truth.track[state], color=TRUTH, linewidth=1.6)
        axis.plot(way, factor * results.examples["c"].states[state], color=colour, linestyle="--",
                  linewidth=1.0, label=f"{label}, estimated in (c)")  # fmt: skip
    axis.set(title="sway and yaw; ship in black", xlabel="distance at 22 knots [L]")
    axis.set(xlim=(0.0, 25.0), ylim=(-0.33, 0.26))
    axis.legend(fontsize=8, frameon=False, loc="lower left")
    axis = axes[1, 1]
    axis.plot(way, np.degrees(truth.track["heading"]), color=TRUTH, label="ship")
    for colour, (name, track) in zip(PALETTE, results.zig_zags.items(), strict=False):
        axis.plot(track["time_s"] / truth.length_s, np.degrees(track["heading_rad"]), color=colour,
                  linestyle="--", linewidth=1.0, label=f"identified, ({name})")  # fmt: skip
    axis.set(title="zig-zag: heading [deg]", xlabel="distance at 22 knots [L]", xlim=(0.0, 25.0))
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
    axis.set_ylabel("advance [L]")
    axis.set_aspect("equal", adjustable="datalim")
    axis.legend(fontsize=8, frameon=False)
    return figure
