"""The falling body and the frigate, worked out once for page, figure and JSON."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from . import falling_body, frigate

BETAS = (3000.0, 2000.0)  # lb/ft2
FALLS = {
    "exact readings": (0.05, 0.0, 1),
    "noise of 10 ft, ten a second": (0.1, 10.0, 40),
    "noise of 10 ft, a hundred a second": (0.01, 10.0, 4),
}
"""Interval of the readings [s], their noise [ft] and how many seeds, by what it is called."""

TICKS = len(BETAS) * len(FALLS) + len(frigate.SEAS) * (len(frigate.SEEDS) + 1)


class Results(NamedTuple):
    """Of the study."""

    falls: pd.DataFrame  # a row a truth and kind of readings: median over the seeds, and worst
    fall: dict[float, pd.DataFrame]  # one of each truth, to draw
    told: pd.DataFrame  # of the frigate from recordings
    followed: dict[str, pd.DataFrame]  # its fouling as it grows, by sea
    velocity: dict[str, dict[str, float]]  # rms errors [m/s] by sea and observer
    friction: dict[str, tuple[float, float]]  # on line, by sea


def measured(tick: Callable[[], None]) -> Results:
    """Everything; about two minutes.

    Args:
        tick: called :data:`TICKS` times.
    """
    falls, fall = _falls(tick)
    told = frigate.from_recordings(tick)
    followed, velocity, friction = {}, {}, {}
    for sea in frigate.SEAS:
        followed[sea], velocity[sea] = frigate.while_it_grows(sea, 1)
        friction[sea] = frigate.friction_on_line(sea, 1)
        tick()
    return Results(falls, fall, told, followed, velocity, friction)


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
