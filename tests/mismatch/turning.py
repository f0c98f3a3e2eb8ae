"""Recordings of a tanker that turns, with instruments' noise."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pandas as pd

from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

NOISE = {
    "ship_speed_m_s": 0.005,
    "sway_speed_m_s": 0.003,
    "yaw_rate_rad_s": 0.0005,
    "heading_rad": 0.002,
}


@functools.cache
def quick_tanker() -> Ship:
    """The 7 m tanker model in steps of a fifth of a second, as its recordings' rows."""
    return load_ship("kvlcc2").with_values({"integration.time_step_s": 0.1})


def swinging(
    ship: Ship,
    *,
    seed: int = 1,
    seconds: float = 240.0,
    astern: bool = False,
    extra: dict[str, Any] | None = None,
) -> pd.DataFrame:
    """Rudder to either side by angles and for times of chance, at two shaft speeds.

    Args:
        ship: that sails it.
        seed: of rudder and noise.
        seconds: length.
        astern: whether the shaft is reversed in between.
        extra: further columns as functions of time.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.2)
    rudder, at, side = np.zeros(len(time)), 0, 1.0
    while at < len(time):
        rows = int(rng.uniform(60, 150))
        rudder[at : at + rows] = side * np.radians(rng.uniform(8.0, 30.0))
        at, side = at + rows, -side
    turns = 64.27 * (1.0 + 0.15 * np.sign(np.sin(time / 35.0)))
    if astern:
        turns = np.where(np.sin(time / 29.0) > 0.6, -turns, turns)
    given = pd.DataFrame(
        {
            "time_s": time,
            "shaft_speed_rad_s": turns,
            "rudder_command_rad": rudder,
            "ship_speed_m_s": 1.18,
            **dict.fromkeys([*NOISE][1:], 0.0),
        }
    )
    for column, series in (extra or {}).items():
        given[column] = series(time)
    sailed = given.copy()
    found = simulate_recording(ship, given)
    for column, rms in NOISE.items():
        sailed[column] = found[column] + rms * rng.standard_normal(len(time))
    return sailed
