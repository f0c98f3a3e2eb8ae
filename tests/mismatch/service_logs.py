"""Logs of ships in service: a row every ten minutes, hour or day, each an equilibrium."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pandas as pd

from shaftline.plant import Ship, equilibrium, load_ship
from shaftline.plant.equilibria import simulate_steady

NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.002,
    "shaft_torque_N_m": 0.01,
    "ship_speed_m_s": 0.01,
    "shaft_power_W": 0.01,
}
"""Rms noise of each channel: P/D, and shares of the rms of the others."""

RACK_MM = {"ferry": 26.0, "frigate": 25.0}
HOUR_S, DAY_S = 3600.0, 86400.0


def _wandering(rng: np.random.Generator, rows: int, over: int) -> Any:
    """A signal of unit rms that changes slowly, over so many rows."""
    noise = rng.standard_normal(rows + over - 1)
    return np.convolve(noise, np.ones(over) / np.sqrt(over), "valid")


def service_log(
    name: str,
    values: dict[str, Any] | None = None,
    *,
    rows: int = 1500,
    interval_s: float = HOUR_S,
    seed: int = 0,
    over: int = 41,
) -> pd.DataFrame:
    """Slowly varying orders of rack and pitch, and what a ship with some values of its own does.

    Few rows are solved one by one by scipy's root finder, many by the package's replay.
    """
    ship, rng = load_ship(name), np.random.default_rng(seed)
    top, pitch = RACK_MM[name], ship.propeller.pitch_ratio_max
    table = pd.DataFrame({"time_s": interval_s * np.arange(rows)})
    rack = 0.75 + 0.12 * _wandering(rng, rows, over)
    table["fuel_rack_mm"] = np.clip(rack, 0.4, 1.0) * top
    order = pitch * (0.85 + 0.06 * _wandering(rng, rows, over))
    table["pitch_ratio_command"] = np.clip(order, None, pitch)
    true = ship.with_values(values or {})
    found = _by_scipy(true, table) if rows <= 100 else _by_replay(true, table)
    for column, share in NOISE.items():
        size = 1.0 if column == "pitch_ratio" else float(np.sqrt(np.mean(found[column] ** 2)))
        found[column] += share * size * rng.standard_normal(rows)
    return found


def _by_replay(ship: Ship, table: pd.DataFrame) -> pd.DataFrame:
    measured = dict.fromkeys(NOISE, 1.0)
    return simulate_steady(ship, table.assign(**measured))


def _by_scipy(ship: Ship, table: pd.DataFrame) -> pd.DataFrame:
    """Equilibria one by one, and what the gauge makes of the torque."""
    at = [
        equilibrium(ship, rack, pitch)
        for rack, pitch in zip(table["fuel_rack_mm"], table["pitch_ratio_command"], strict=True)
    ]
    torque = np.array([ship.sensors.torque_gain * one.outputs.shaft_torque for one in at])
    turning = np.array([one.state.shaft_speed for one in at])
    return table.assign(
        pitch_ratio=[one.outputs.pitch_ratio for one in at],
        shaft_speed_rad_s=turning,
        shaft_torque_N_m=torque,
        ship_speed_m_s=[one.state.ship_speed for one in at],
        shaft_power_W=torque * turning,
    )


@functools.cache
def fouled_log() -> pd.DataFrame:
    """Hourly rows: 20 days with a clean hull, 20 days with 12 % more resistance."""
    clean, rows = 203.5, 480
    parts = [service_log("ferry", rows=rows, seed=1)]
    fouled = {"hull.resistance_coefficient_N_s2_m2": 1.12 * clean}
    parts.append(service_log("ferry", fouled, rows=rows, seed=2))
    log = pd.concat(parts, ignore_index=True)
    return log.assign(time_s=HOUR_S * np.arange(2 * rows))
