"""Estimate friction and fouling of a frigate from recordings, and on line with an observer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.mismatch.identification.augmented_filter import ekf
from shaftline.observers import follow, follow_parameter, get_observer, simulated_measurements
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, load_ship, realise, simulate
from shaftline.plant.columns import MEASURED, drive_column

from ..side_by_side import Tick

FOULING = "hull.fouling_fraction"
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
STERN_TUBE = "transmission.coulomb_friction_propeller_side_N_m"

CONCEALED = {FOULING: 0.15, FRICTION: 6e3}
SEAS = ("calm", "state-5")
SEEDS = (1, 2, 3, 4)
SECONDS = 900.0

NOISE = {
    "pitch_ratio": 0.004,
    "shaft_speed_rad_s": 0.01,
    "shaft_torque_N_m": 1.5e3,
    "ship_speed_m_s": 0.05,
}
"""Rms noise of the instruments at 20 Hz."""

GROWTH = ([0.0, 1800.0, 5400.0, 7200.0], [0.0, 0.0, 0.2, 0.2])
"""Time [s] and fouling fraction of the run with growing fouling."""

METER_ERROR_N_M = 1.5e3  # error of the shaft torque meter: 1 % of the torque at the design point


def simulate_run(
    ship: Ship, seconds: float, sea: str, seed: int, grows: bool = False
) -> tuple[Any, pd.DataFrame]:
    """Simulate a run with steps of fuel rack and pitch every minute; return samples and noisy recording.

    ``sea`` is a preset or ``calm``; fouling may grow by :data:`GROWTH`.
    """
    rng = np.random.default_rng(seed)
    count = int(seconds / 60.0) + 1
    rack, pitch = rng.uniform(14.0, 24.0, count), rng.uniform(1.0, 1.35, count)

    def held(values: Any) -> Any:
        return lambda t: values[(t // 60.0).astype(int)]

    def resistance(t: Any) -> Any:
        return 1.0 + np.interp(t, *GROWTH) if grows else np.ones_like(t)

    known = get_sea(sea)
    waves = realise(known, depth_m=ship.propeller.depth_m, seed=seed) if known else None
    schedule = Schedule(held(rack), held(pitch), resistance_factor=resistance)
    begin = equilibrium(ship, rack[0], pitch[0]).state
    samples = simulate(ship, schedule, seconds, initial=begin, sea=waves)
    columns = {
        "time_s": samples["time"],
        drive_column(ship): samples["drive"],
        "pitch_ratio_command": samples["pitch_command"],
    }
    for column, noise in NOISE.items():
        columns[column] = samples[MEASURED[column]] + noise * rng.standard_normal(len(samples))
    return samples, pd.DataFrame(columns)


def estimate_from_recordings(tick: Tick) -> pd.DataFrame:
    """Estimate fouling and friction by ``identify --method ekf``; a row for each sea, seed and key."""
    ship = load_ship("frigate")
    rows = []
    for sea in SEAS:
        for seed in SEEDS:
            _, table = simulate_run(ship.with_values(CONCEALED), SECONDS, sea, seed)
            found = ekf(ship, [table], tuple(CONCEALED))
            last = found.tables["estimates"].iloc[-1]
            rows += [
                {
                    "sea": sea,
                    "seed": seed,
                    "key": key,
                    "truth": CONCEALED[key],
                    "found": value,
                    "own error": float(last[f"{key} se"]),
                    "standard error": float(error),
                }
                for key, value, error in zip(
                    found.keys, found.values, found.standard_errors, strict=True
                )
            ]
            tick()
    return pd.DataFrame(rows)


def _measurements(
    samples: Any, table: pd.DataFrame, meter_error: float = 0.0
) -> NDArray[np.float64]:
    """Return the inputs of an observer, shape (n, 5); the torque meter may have an error [N m]."""
    found = simulated_measurements(samples)
    columns = ["shaft_speed_rad_s", "shaft_torque_N_m", "pitch_ratio"]
    found[:, :3] = table[columns].to_numpy()
    found[:, 1] += meter_error
    return found


def follow_growth(sea: str, seed: int) -> tuple[pd.DataFrame, dict[str, float]]:
    """Estimate growing fouling over two hours by the observer and by the filter of the whole plant.

    Returns:
        By second ``truth``, ``observer`` and ``filter`` with their standard deviations; and the rms
        error of the advance velocity by observer [m/s].
    """
    ship = load_ship("frigate")
    samples, table = simulate_run(ship, GROWTH[0][-1], sea, seed, grows=True)
    dt, observer = ship.time_step_s, get_observer("augmented-kalman")
    read = _measurements(samples, table)
    number, deviation = follow_parameter(observer, ship, read, dt)
    wrong = _measurements(samples, table, METER_ERROR_N_M)
    biased, _ = follow_parameter(observer, ship, wrong, dt)
    coarse = table.iloc[::2].reset_index(drop=True)
    own = ekf(ship, [coarse], (FOULING,), parameter_walk={FOULING: 1e-3}).tables["estimates"]
    time = samples["time"][::20]
    found = pd.DataFrame(
        {
            "time_s": time,
            "truth": np.interp(time, *GROWTH),
            "observer": number[::20],
            "observer sd": deviation[::20],
            "observer, torque meter 1 % off": biased[::20],
            "filter": np.interp(time, own["time_s"], own[FOULING]),
            "filter sd": np.interp(time, own["time_s"], own[f"{FOULING} se"]),
        }
    )
    errors = {}
    for name in ("augmented-kalman", "random-walk-kalman"):
        velocity, _ = follow(get_observer(name), ship, read, dt)
        errors[name] = float(np.std((velocity - samples["advance_velocity"])[2000:]))
    return found, errors


def estimate_friction_online(sea: str, seed: int) -> tuple[float, float]:
    """Estimate the friction in the stern tube in an hour: value and standard deviation [N m]."""
    ship, observer = load_ship("frigate"), get_observer("augmented-kalman-friction")
    truth = ship.with_values({STERN_TUBE: CONCEALED[FRICTION]})
    read = _measurements(*simulate_run(truth, 3600.0, sea, seed))
    number, deviation = follow_parameter(observer, ship, read, 0.05)
    return float(number[-1]), float(deviation[-1])
