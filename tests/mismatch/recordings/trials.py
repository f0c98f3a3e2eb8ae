"""Trials of the frigate with noisy instruments, and effects that are no unit errors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from shaftline.mismatch.recordings.noise import Noise, unusual_rests
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, realise, simulate

RPM = 30.0 / math.pi
NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.02,
    "shaft_torque_N_m": 1000.0,
    "ship_speed_m_s": 0.02,
}
COLUMNS = ["fuel_rack_mm", "pitch_ratio_command", *NOISE]


def longest_rest(values: Any, noise: Noise) -> tuple[int, int]:
    """Return first sample and length of the longest unusual constant stretch; (0, 0) without one."""
    return max(unusual_rests(values, noise), key=lambda rest: rest[1], default=(0, 0))


def voyage(
    ship: Ship, sea: str | None = None, seconds: float = 180.0, seed: int = 1
) -> pd.DataFrame:
    """A recording at 10 Hz of a ship whose rack and pitch step, with noisy instruments."""
    rng = np.random.default_rng(seed)
    time = ship.time_step_s * np.arange(round(seconds / ship.time_step_s))
    rack, pitch = 18.0 + 6.0 * (time // 40 % 2), 1.3 - 0.2 * (time // 60 % 2)
    waves = get_sea(sea) if sea else None
    realised = realise(waves, depth_m=ship.propeller.depth_m, seed=1) if waves else None
    start = equilibrium(ship, rack[0], pitch[0]).state
    samples = simulate(ship, Schedule(rack, pitch), seconds, initial=start, sea=realised)[:-1:2]
    names = ["measured_pitch_ratio", "shaft_speed", "measured_shaft_torque", "measured_ship_speed"]
    table = {
        "time_s": np.round(time[::2], 6),
        "fuel_rack_mm": rack[::2],
        "pitch_ratio_command": pitch[::2],
    }
    for (column, rms), name in zip(NOISE.items(), names, strict=True):
        table[column] = samples[name] + rms * rng.standard_normal(len(samples))
    return pd.DataFrame(table)


def degrees(pitch: pd.Series) -> pd.Series:
    return np.degrees(np.arctan(pitch / (0.7 * math.pi)))


EFFECTS: dict[str, dict[str, float]] = {
    "nominal": {},
    "fouled": {"hull.fouling_fraction": 1.0},
    "cleaner": {"hull.fouling_fraction": -0.5},
    "friction": {"transmission.coulomb_friction_engine_side_N_m": 26000.0},
    "propeller-friction": {"transmission.viscous_friction_propeller_side_N_m_s_rad": 2500.0},
    "rough": {"propeller.roughness_drag": 0.01},
    "derated": {"prime_mover.derating_fraction": 0.4},
    "lag": {"prime_mover.lag_s": 8.0},
    "gauge-low": {"sensors.torque_gain": 0.8},
    "gauge-high": {"sensors.torque_gain": 1.2},
    "gauge-late": {"sensors.torque_delay_s": 5.0},
    "head-current": {"hull.current_m_s": -2.0},
    "stern-current": {"hull.current_m_s": 2.0},
    "pitch-offset": {"sensors.pitch_offset": 0.2},
    "dead-band": {"pitch_actuator.dead_band": 0.08},
    "slow-pitch": {"pitch_actuator.rate_limit_per_s": 0.01},
    "slow-log": {"sensors.speed_log_lag_s": 60.0},
    "ventilated": {"ventilation.thrust_loss": 0.7, "ventilation.torque_loss": 0.6},
    "all-at-once": {
        "hull.fouling_fraction": 0.5,
        "prime_mover.derating_fraction": 0.2,
        "sensors.torque_gain": 0.8,
        "hull.current_m_s": -1.0,
    },
}
