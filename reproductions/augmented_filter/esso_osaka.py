"""The tanker Esso Osaka found again from a zig-zag: Taylor 2000, section 2.3, Figures 2-3 to 2-7.

Truth and filter are ``esso-osaka`` on the plant's own equations, surge and propeller among them; the
filter begins at half the four coefficients of Table 2.3. No process noise.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shaftline.plant import Ship, ShipError, approach, load_ship, nomoto, zig_zag

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

SPEED = 7.0 * 1852.0 / 3600.0  # m/s; assumed, the thesis prints none
EVERY = 2  # time steps to a reading: one a second
EXECUTES = 6
MINUTES = (3, 5, 7, 20)

TWINS = ((1e-8, 1e-4), (1e-6, 1e-3), (1e-4, 1e-2), (1e-2, 1e-1), (1e-2, 0.0))
"""R of the filter, and rms of the noise that is there."""

SEEDS = 20
TICKS = len(TWINS) + 1


@functools.cache
def voyage() -> Truth:
    """Twenty minutes of zig-zag."""
    return sailed(load_ship("esso-osaka"), SPEED, 60.0 * MINUTES[-1], EXECUTES)


def found(variance: float, noise: float, seed: int) -> Identified:
    """What the filter makes of one recording.

    Args:
        variance: R, as the filter has it [-].
        noise: rms of what is in fact added to the readings [-].
        seed: of it.
    """
    truth = voyage()
    table = recorded(truth, noise, seed, EVERY)
    return identified(truth, truth.ship, table, Tuning(variance))


def as_identified(ratios: Any) -> Ship:
    """The ship with coefficients of these ratios to the truth, shape (4,)."""
    ship = load_ship("esso-osaka")
    return with_coefficients(ship, np.asarray(ratios) * coefficients(ship))


def diameter(ratios: Any) -> float:
    """Diameter [lengths] of an identified ship's turn; NaN where she does not turn so."""
    try:
        return steady_turn(as_identified(ratios), SPEED).diameter
    except ShipError:
        return np.nan


def headings_apart(ratios: Any) -> tuple[float, pd.DataFrame]:
    """The zig-zag of an identified ship: largest difference of heading [deg], and her track."""
    own = as_identified(ratios)
    track = zig_zag(own, approach(own, SPEED), TEN, TEN, executes=EXECUTES).track
    theirs = voyage().track
    rows = min(len(track), len(theirs))
    off = track["heading_rad"].to_numpy()[:rows] - theirs["heading"].to_numpy()[:rows]
    return float(np.degrees(np.abs(off).max())), track


class Results(NamedTuple):
    """Of the twin."""

    twins: pd.DataFrame  # a row a noise and time: median ratios, worst of the four by seed
    drawn: dict[str, Identified]  # one of each noise
    turns: pd.DataFrame  # a row a noise: diameters after twenty minutes
    truth_turn: Turn
    own_turn: Turn  # of the middle seed after three minutes at R = 1e-8
    own_track: pd.DataFrame  # and her zig-zag
    headings_apart_deg: float
    half_diameter: float  # of the ship with half of each coefficient, where the filter begins
    poles: dict[str, float]  # slowest of sway and yaw [per length]: of the ship, and of half of her


def measured(tick: Callable[[], None]) -> Results:
    """Everything; about a minute.

    Args:
        tick: called :data:`TICKS` times.
    """
    ship = load_ship("esso-osaka")
    truth_turn = steady_turn(ship, SPEED)
    rows, turns, drawn = [], [], {}
    early: Any = None
    for variance, noise in TWINS:
        runs = [found(variance, noise, seed) for seed in range(SEEDS if noise else 1)]
        label = f"R = {variance:g}" + ("" if noise else ", exact readings")
        drawn[label] = runs[0]
        for minutes in MINUTES:
            at = np.array([run.ratios[round(60.0 * minutes / STEP_S)] for run in runs])
            worst = np.abs(at - 1.0).max(axis=1)
            row: dict[str, Any] = {"R": variance, "noise": noise, "minutes": minutes}
            row |= {"seeds": len(runs)} | dict(
                zip(COEFFICIENTS, np.median(at, axis=0), strict=True)
            )
            row |= {"median error": float(np.median(worst)), "worst error": float(worst.max())}
            rows.append(row)
            if early is None:  # the first noise, after three minutes: the seed in the middle
                early = at[np.argsort(worst)[len(worst) // 2]]
        widths = np.array([diameter(run.ratios[-1]) for run in runs])
        off = np.abs(widths / truth_turn.diameter - 1.0)
        turns.append(
            {"R": variance, "noise": noise, "seeds": len(runs), "diameter": np.nanmedian(widths),
             "median error": np.nanmedian(off), "worst error": np.nanmax(off),
             "no turn": int(np.isnan(widths).sum())}
        )  # fmt: skip
        tick()
    apart, track = headings_apart(early)
    poles = {
        name: max(pole.real for pole in nomoto(own, approach(own, SPEED)).poles)
        for name, own in (("ship", ship), ("half", as_identified(np.full(4, 0.5))))
    }
    own_turn = steady_turn(as_identified(early), SPEED)
    half = diameter(np.full(4, 0.5))
    tick()
    return Results(
        pd.DataFrame(rows),
        drawn,
        pd.DataFrame(turns),
        truth_turn,
        own_turn,
        track,
        apart,
        half,
        poles,
    )


def at(results: Results, variance: float, minutes: int) -> pd.Series:
    """Row of :attr:`Results.twins` with noise that is as large as the filter believes."""
    twins = results.twins
    own = (twins["R"] == variance) & (twins["minutes"] == minutes) & (twins["noise"] > 0.0)
    return twins[own].iloc[0]
