"""Recordings of ships whose numbers are known, with instruments' noise."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pandas as pd

from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.014,
    "shaft_torque_N_m": 1400.0,
    "ship_speed_m_s": 0.05,
}


def _steps(rng: np.random.Generator, rows: int, low: float, high: float, hold: Any) -> Any:
    values = np.empty(rows)
    at = 0
    while at < rows:
        length = int(rng.uniform(*hold))
        values[at : at + length] = rng.uniform(low, high)
        at += length
    return values


@functools.cache
def quick_frigate() -> Ship:
    """The frigate in steps of a fifth of a second, as its recordings' rows: a quarter of the work."""
    return load_ship("frigate").with_values({"integration.time_step_s": 0.2})


def frigate_voyage(
    values: dict[str, Any] | Ship | None = None,
    *,
    seed: int = 0,
    seconds: float = 600.0,
    interval_s: float = 0.2,
    sea: Any = None,
    extra: dict[str, Any] | None = None,
) -> pd.DataFrame:
    """Steps of rack and pitch at random times, sailed by a frigate with some values of its own."""
    rng = np.random.default_rng(seed)
    rows = round(seconds / interval_s) + 1
    hold = (20.0 / interval_s, 90.0 / interval_s)
    table = pd.DataFrame({"time_s": np.arange(rows) * interval_s})
    table["fuel_rack_mm"] = _steps(rng, rows, 12.0, 26.0, hold)
    table["pitch_ratio_command"] = _steps(rng, rows, 0.9, 1.35, hold)
    for column, series in (extra or {}).items():
        table[column] = series(table["time_s"].to_numpy())
    ship = values if isinstance(values, Ship) else load_ship("frigate").with_values(values or {})
    if "inflow_velocity_m_s" in table:
        # the speed to which the measured inflow belongs: that of a first voyage without it
        calm = table.drop(columns="inflow_velocity_m_s")
        speed = simulate_recording(ship, calm, sea)["ship_speed_m_s"]
        table["ship_speed_m_s"] = speed
        table["inflow_velocity_m_s"] += (1.0 - ship.hull.wake_fraction) * speed
    sailed = simulate_recording(ship, table, sea)
    for column, rms in NOISE.items():
        sailed[column] = sailed[column] + rms * rng.standard_normal(rows)
    for column in extra or {}:
        sailed[column] = table[column]
    return sailed


def tug_run(values: dict[str, Any] | Ship | None = None, *, seed: int = 0) -> pd.DataFrame:
    """A model tug's drive train on the bench, its voltage stepped in both directions."""
    rng = np.random.default_rng(seed)
    rows, interval_s = 1500, 0.02
    voltage = _steps(rng, rows, -9.0, 9.0, (25, 90))
    table = pd.DataFrame({"time_s": np.arange(rows) * interval_s, "motor_voltage_V": voltage})
    table["shaft_speed_rad_s"] = 0.0
    ship = values if isinstance(values, Ship) else bench_tug().with_values(values or {})
    run = simulate_recording(ship, table)[["time_s", "motor_voltage_V", "shaft_speed_rad_s"]]
    run["shaft_speed_rad_s"] += 0.3 * rng.standard_normal(rows)
    return run


def bench_tug() -> Ship:
    """The published tug without its armature's inductance, so that it runs at a plain time step."""
    return load_ship("tito-neri-sine").with_values(
        {"prime_mover.armature_inductance_H": 0.0, "integration.time_step_s": 0.005}
    )
