"""The augmented filter's three examples, worked out once for page, figure and JSON."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from . import esso_osaka, falling_body, frigate

BETAS = (3000.0, 2000.0)  # lb/ft2
FALLS = {
    "exact readings": (0.05, 0.0, 1),
    "noise of 10 ft, ten a second": (0.1, 10.0, 40),
    "noise of 10 ft, a hundred a second": (0.01, 10.0, 4),
}
"""Interval of the readings [s], their noise [ft] and how many seeds, by what it is called."""

TWINS = (
    (1e-8, 1e-4, 10), (1e-6, 1e-3, 10), (1e-4, 1e-2, 10), (1e-2, 1e-1, 10), (1e-2, 0.0, 1),
)  # fmt: skip
"""R of the filter, rms of the noise that is there, and how many seeds."""

MINUTES = (3, 5, 7, 20)
TICKS = len(BETAS) * len(FALLS) + len(TWINS) + len(frigate.SEAS) * (len(frigate.SEEDS) + 1)


class Results(NamedTuple):
    """Of the study."""

    falls: pd.DataFrame  # a row a truth and kind of readings: median over the seeds, and worst
    fall: dict[float, pd.DataFrame]  # one of each truth, to draw
    twins: (
        pd.DataFrame
    )  # a row a noise and time: each coefficient over the truth, median; worst error
    twin: dict[str, pd.DataFrame]  # one of each noise, to draw
    turns: dict[str, float]  # diameters in lengths
    told: pd.DataFrame  # of the frigate from recordings
    followed: dict[str, pd.DataFrame]  # its fouling as it grows, by sea
    velocity: dict[str, dict[str, float]]  # rms errors [m/s] by sea and observer
    friction: dict[str, tuple[float, float]]  # on line, by sea


def measured(tick: Callable[[], None]) -> Results:
    """Everything; about three minutes.

    Args:
        tick: called :data:`TICKS` times.
    """
    falls, fall = _falls(tick)
    twins, twin, turns = _twins(tick)
    told = frigate.from_recordings(tick)
    followed, velocity, friction = {}, {}, {}
    for sea in frigate.SEAS:
        followed[sea], velocity[sea] = frigate.while_it_grows(sea, 1)
        friction[sea] = frigate.friction_on_line(sea, 1)
        tick()
    return Results(falls, fall, twins, twin, turns, told, followed, velocity, friction)


def _falls(tick: Callable[[], None]) -> tuple[pd.DataFrame, dict[float, pd.DataFrame]]:
    rows = []
    for beta in BETAS:
        for name, (update_s, noise, seeds) in FALLS.items():
            found = np.array(
                [
                    falling_body.story(falling_body.fallen(beta, seed, update_s, noise), beta)
                    for seed in range(seeds)
                ]
            )
            for k, quantity in enumerate(falling_body.STORY):
                rows.append(
                    {"beta": beta, "readings": name, "quantity": quantity, "seeds": seeds,
                     "median": np.median(found[:, k]), "worst": found[:, k].max()}
                )  # fmt: skip
            tick()
    return pd.DataFrame(rows), {beta: falling_body.fallen(beta, 0) for beta in BETAS}


def _twins(
    tick: Callable[[], None],
) -> tuple[pd.DataFrame, dict[str, pd.DataFrame], dict[str, float]]:
    rows, drawn = [], {}
    names = [*esso_osaka.COEFFICIENTS]
    turns = {"truth": esso_osaka.steady_turn(esso_osaka.TRUE)[2]}
    for variance, noise, seeds in TWINS:
        voyages = [
            esso_osaka.identified(variance, noise, 60.0 * MINUTES[-1], s) for s in range(seeds)
        ]
        label = f"R = {variance:g}" + ("" if noise else ", exact readings")
        drawn[label] = voyages[0]
        turns[label] = esso_osaka.steady_turn(esso_osaka.TRUE * voyages[0][names].iloc[-1])[2]
        for minutes in MINUTES:
            at = np.array([v.set_index("time_s").loc[60.0 * minutes, names] for v in voyages])
            row: dict[str, Any] = {
                "R": variance,
                "noise": noise,
                "minutes": minutes,
                "seeds": seeds,
            }
            row |= dict(zip(names, np.median(at, axis=0), strict=True))
            row["median error"] = float(np.median(np.abs(at - 1.0).max(axis=1)))
            row["worst error"] = float(np.abs(at - 1.0).max())
            rows.append(row)
        tick()
    return pd.DataFrame(rows), drawn, turns
