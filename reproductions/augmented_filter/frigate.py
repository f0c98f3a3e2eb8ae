"""The frigate with more friction and fouling than its file says: told from a recording, and on line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.mismatch.identification.augmented_filter import ekf
from shaftline.observers import follow, follow_number, get_observer, readings_of
from shaftline.plant import Schedule, Ship, equilibrium, get_sea, load_ship, realise, simulate
from shaftline.plant.columns import MEASURED, drive_column

FOULING = "hull.fouling_fraction"
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
STERN_TUBE = "transmission.coulomb_friction_propeller_side_N_m"

CONCEALED = {FOULING: 0.15, FRICTION: 6e3}
SEAS = ("calm", "state-5")
SEEDS = (1, 2, 3, 4)
SECONDS = 900.0

NOISE = {
    "pitch_ratio": 0.004, "shaft_speed_rad_s": 0.01, "shaft_torque_N_m": 1.5e3,
    "ship_speed_m_s": 0.05,
}  # fmt: skip
"""Rms of the instruments at 20 Hz."""

GROWTH = ([0.0, 1800.0, 5400.0, 7200.0], [0.0, 0.0, 0.2, 0.2])
"""Seconds and fouling of the voyage on which it grows."""

GAUGE_ERROR_N_M = 1.5e3
"""A hundredth of the torque at the design point."""


def sailed(
    ship: Ship, seconds: float, sea: str, seed: int, grows: bool = False
) -> tuple[Any, pd.DataFrame]:
    """A voyage with steps of rack and pitch every minute.

    Args:
        ship: as it is.
        seconds: length.
        sea: preset, or ``calm``.
        seed: of orders, waves and noise.
        grows: whether fouling grows as :data:`GROWTH` says.

    Returns:
        The samples, and what noisy instruments recorded.
    """
    rng = np.random.default_rng(seed)
    count = int(seconds / 60.0) + 1
    rack, pitch = rng.uniform(14.0, 24.0, count), rng.uniform(1.0, 1.35, count)

    def held(values: NDArray[np.float64]) -> Callable[[Any], Any]:
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
    for column, rms in NOISE.items():
        columns[column] = samples[MEASURED[column]] + rms * rng.standard_normal(len(samples))
    return samples, pd.DataFrame(columns)


def from_recordings(tick: Callable[[], None]) -> pd.DataFrame:
    """Fouling and friction told together by ``identify --method ekf``, a row a sea, seed and key."""
    ship = load_ship("frigate")
    rows = []
    for sea in SEAS:
        for seed in SEEDS:
            _, table = sailed(ship.with_values(CONCEALED), SECONDS, sea, seed)
            found = ekf(ship, [table], tuple(CONCEALED))
            for key, value, error in zip(
                found.keys, found.values, found.standard_errors, strict=True
            ):
                own = float(found.tables["estimates"][f"{key} se"].iloc[-1])
                rows.append(
                    {"sea": sea, "seed": seed, "key": key, "truth": CONCEALED[key],
                     "found": value, "own error": own, "standard error": float(error)}
                )  # fmt: skip
            tick()
    return pd.DataFrame(rows)


def readings(samples: Any, table: pd.DataFrame, gauge_error: float = 0.0) -> NDArray[np.float64]:
    """What an observer is given of a voyage, shape (n, 5).

    Args:
        samples: of the voyage, for the truth that the oracle reads.
        table: recorded.
        gauge_error: added to the torque [N m].
    """
    found = readings_of(samples)
    columns = ["shaft_speed_rad_s", "shaft_torque_N_m", "pitch_ratio"]
    found[:, :3] = table[columns].to_numpy()
    found[:, 1] += gauge_error
    return found


def while_it_grows(sea: str, seed: int) -> tuple[pd.DataFrame, dict[str, float]]:
    """Fouling followed over two hours: by the observer on line, and by the filter of the whole plant.

    Args:
        sea: preset, or ``calm``.
        seed: of the voyage.

    Returns:
        By second: ``truth``, ``observer`` and ``filter`` with their standard deviations; and how close
        the observer's advance velocity comes, beside the random-walk filter's [m/s].
    """
    ship = load_ship("frigate")
    samples, table = sailed(ship, GROWTH[0][-1], sea, seed, grows=True)
    dt = ship.time_step_s
    read = readings(samples, table)
    number, deviation = follow_number(get_observer("augmented-kalman"), ship, read, dt)
    biased, _ = follow_number(
        get_observer("augmented-kalman"), ship, readings(samples, table, GAUGE_ERROR_N_M), dt
    )
    coarse = table.iloc[::2].reset_index(drop=True)
    own = ekf(ship, [coarse], (FOULING,), number_walk={FOULING: 1e-3}).tables["estimates"]
    time = samples["time"][::20]
    found = pd.DataFrame(
        {
            "time_s": time,
            "truth": np.interp(time, *GROWTH),
            "observer": number[::20],
            "observer sd": deviation[::20],
            "observer, gauge 1 % off": biased[::20],
            "filter": np.interp(time, own["time_s"], own[FOULING]),
            "filter sd": np.interp(time, own["time_s"], own[f"{FOULING} se"]),
        }
    )
    errors = {}
    for name in ("augmented-kalman", "random-walk-kalman"):
        velocity, _ = follow(get_observer(name), ship, read, dt)
        errors[name] = float(np.std((velocity - samples["advance_velocity"])[2000:]))
    return found, errors


def friction_on_line(sea: str, seed: int) -> tuple[float, float]:
    """Friction in the stern tube after an hour by the observer: estimate and deviation [N m].

    Args:
        sea: preset, or ``calm``.
        seed: of the voyage.
    """
    nominal = load_ship("frigate")
    samples, table = sailed(
        nominal.with_values({STERN_TUBE: CONCEALED[FRICTION]}), 3600.0, sea, seed
    )
    observer = get_observer("augmented-kalman-friction")
    number, deviation = follow_number(observer, nominal, readings(samples, table), 0.05)
    return float(number[-1]), float(deviation[-1])
