"""A destroyer identified by a linear model: Taylor 2000, sections 4.2 and 4.3, Table 4.1.

The ship is ``ddg-51-surrogate`` with her nonlinear terms, the filter's model the same ship without them:
what is missing there must go into the four coefficients. Table 4.1's Q, FQ and R are read as absolute
densities per ship length and variance, all without dimension.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shaftline.plant import Nomoto, Ship, ShipError, approach, load_ship, nomoto, zig_zag
from shaftline.plant.stepping import DivergenceError

from .zig_zag import (
    COEFFICIENTS,
    STEP_S,
    TEN,
    Identified,
    Truth,
    Tuning,
    Turn,
    coefficients,
    identified,
    recorded,
    sailed,
    steady_turn,
    with_coefficients,
)

SPEED = 22.0 * 1852.0 / 3600.0  # m/s
LENGTHS = 60.0  # of the zig-zag; assumed
EXECUTES = 15
NONLINEAR = ("X_vr", "Y_vv", "Y_rr", "N_rr")
KEPT = 0.67
"""Share of the run, at its end, over which the coefficients are averaged."""

RUNS = {
    "a": Tuning(0.01),
    "b": Tuning(0.01, 0.0, 0.01),
    "c": Tuning(0.01, 0.05, 0.01),
}
"""The thesis's three: no noise believed in, fake noise alone, and Table 4.1's."""

NOISES = (0.0, 1e-3, 3e-3, 1e-2)
HEADLINE = 1e-3
"""Rms of the noise that is there in what stands at the top."""

EVERY = (1, 2, 4, 8, 16)
"""Time steps from one reading to the next; the thesis prints none, and the first one is taken."""

SEEDS = 10
TICKS = len(RUNS) + 2


@functools.cache
def voyage() -> Truth:
    """The zig-zag of the nonlinear ship."""
    ship = load_ship("ddg-51-surrogate")
    seconds = LENGTHS * ship.manoeuvring.length_m / SPEED
    return sailed(ship, SPEED, seconds, EXECUTES)


def linear() -> Ship:
    """The ship without her nonlinear terms."""
    ship = load_ship("ddg-51-surrogate")
    return ship.with_values({f"manoeuvring.{name}": 0.0 for name in NONLINEAR})


def found(tuning: Tuning, noise: float, seed: int, every: int = 1) -> Identified:
    """What the linear filter makes of one recording of the nonlinear ship.

    Args:
        tuning: of the filter.
        noise: rms of what is added to the readings [-].
        seed: of it.
        every: time steps from one reading to the next.
    """
    return identified(voyage(), linear(), recorded(voyage(), noise, seed, every), tuning)


def kept(run: Identified) -> Any:
    """Mean of the coefficients over the truth, over the last two thirds, shape (4,)."""
    first = round((1.0 - KEPT) * (len(run.ratios) - 1))
    return run.ratios[first:].mean(axis=0)


def as_identified(ratios: Any) -> Ship:
    """The linear ship with coefficients of these ratios to the truth, shape (4,).

    Raises:
        ShipError: coefficients that no ship's file may have.
    """
    ship = linear()
    return with_coefficients(ship, np.asarray(ratios) * coefficients(ship))


def tracked(run: Identified) -> dict[str, float]:
    """Rms errors of the estimated sway and yaw, and the rms of the two, without dimension."""
    truth, rms = voyage(), {}
    for name, state in (("sway", "sway_speed"), ("yaw", "yaw_rate")):
        own = truth.track[state].to_numpy()
        error = run.states[state].to_numpy() - own
        for label, values in ((f"{name}_rms_error", error), (f"{name}_rms", own)):
            rms[label] = float(np.sqrt(np.mean(values**2))) / truth.units[state]
    return rms


def turn_of(ratios: Any) -> Turn | None:
    """The turn of an identified ship; None where there is none."""
    try:
        return steady_turn(as_identified(ratios), SPEED)
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
        ShipError: coefficients that no ship file may have.
    """
    ship = as_identified(ratios)
    return max(pole.real for pole in nomoto(ship, approach(ship, SPEED)).poles)


class Results(NamedTuple):
    """Of the three runs."""

    runs: pd.DataFrame  # a row a run and noise: median ratios over the seeds, turn, tracking
    intervals: pd.DataFrame  # of the last run: a row an interval and noise
    drawn: dict[str, Identified]  # one of each run, at the noise that stands at the top
    turns: dict[str, Turn]  # of the ships that these found
    zig_zags: dict[str, pd.DataFrame]  # and theirs
    truth_turn: Turn
    linear_turn: Turn  # of the linear ship with the true coefficients


def measured(tick: Callable[[], None]) -> Results:
    """Everything; about a minute.

    Args:
        tick: called :data:`TICKS` times.
    """
    truth_turn = steady_turn(load_ship("ddg-51-surrogate"), SPEED)
    rows: list[dict[str, Any]] = []
    drawn, turns, zig_zags = {}, {}, {}
    for name, tuning in RUNS.items():
        for noise in NOISES:
            runs = [found(tuning, noise, seed) for seed in range(SEEDS if noise else 1)]
            ratios, judged = _judged(runs, truth_turn)
            row: dict[str, Any] = {"run": name, "noise": noise, "seeds": len(runs)} | judged
            told = [tracked(run) for run in runs]
            row |= {key: _median([one[key] for one in told]) for key in told[0]}
            row["slowest pole"] = slowest_pole(ratios[0]) if name == "a" else math.nan
            rows.append(row)
            if noise == HEADLINE:
                drawn[name] = runs[0]
                if (turn := turn_of(ratios[0])) is not None:
                    turns[name] = turn
                    zig_zags[name] = _zig_zag(ratios[0])
        tick()
    intervals = []
    for every in EVERY:
        for noise in (HEADLINE, NOISES[-1]):
            runs = [found(RUNS["c"], noise, seed, every) for seed in range(SEEDS)]
            row = {"interval_s": STEP_S * every, "noise": noise, "seeds": SEEDS}
            intervals.append(row | _judged(runs, truth_turn)[1])
    tick()
    linear_turn = steady_turn(linear(), SPEED)
    tick()
    return Results(
        pd.DataFrame(rows), pd.DataFrame(intervals), drawn, turns, zig_zags, truth_turn, linear_turn
    )


def _judged(runs: list[Identified], truth_turn: Turn) -> tuple[Any, dict[str, Any]]:
    """Coefficients over the truth, shape (seeds, 4), and by name their medians and the turns."""
    ratios = np.array([kept(run) for run in runs])
    widths = [turn.diameter if turn else math.nan for turn in map(turn_of, ratios)]
    tighter = 100.0 * (1.0 - np.array(widths) / truth_turn.diameter)
    return ratios, {
        **dict(zip(COEFFICIENTS, np.median(ratios, axis=0), strict=True)),
        "diameter": _median(widths),
        "tighter [%]": _median(tighter),
        "least": float(np.nanmin(tighter)) if _any(tighter) else math.nan,
        "most": float(np.nanmax(tighter)) if _any(tighter) else math.nan,
        "no turn": int(np.isnan(widths).sum()),
    }


def _zig_zag(ratios: Any) -> pd.DataFrame:
    own = as_identified(ratios)
    return zig_zag(own, approach(own, SPEED), TEN, TEN, executes=EXECUTES).track


def _any(values: Any) -> bool:
    return bool(np.isfinite(values).any())


def _median(values: Any) -> float:
    return float(np.nanmedian(values)) if _any(values) else math.nan
