"""Any controller on any task, on paired seas, in figures that an engineer asks for."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from ..baselines.interface import Controller
from ..envs import FrigateVectorEnv
from ..envs.kernel import TRUTH
from ..plant.files import write_json

KPIS = {
    "fuel_kg_nmi": "fuel per nautical mile [kg]",
    "speed_error_rms_m_s": "rms of ship speed minus order [m/s]",
    "torque_sd_kN_m": "standard deviation of the shaft torque [kN m]",
    "torque_peak_kN_m": "highest shaft torque [kN m]",
    "rack_travel_mm_min": "travel of the rack command [mm/min]",
    "overload_s": "time beyond the engine's envelope [s]",
    "overspeed_s": "time beyond the engine's highest speed [s]",
    "cavitation_s": "time beyond Burrill's limit [s]",
    "ventilation_s": "time ventilating [s]",
    "thrust_mean_kN": "mean thrust of one propeller [kN]",
    "power_mean_kW": "mean brake power of one engine [kW]",
    "power_peak_kW": "highest brake power of one engine [kW]",
    "failed": "episodes that stalled or tripped [share]",
    "reward": "sum of rewards",
}
"""Key performance indicators of an episode, by column."""

_NAUTICAL_MILE = 1852.0


@dataclass(frozen=True)
class Setting:
    """One cell of an evaluation."""

    controller: str
    task: str
    sea: str
    observer: str
    seeds: int
    ship: str = "frigate"
    episode_s: float = 300.0
    sensor_noise: float = 1.0

    @property
    def name(self) -> str:
        """File name of the cell; differs where any field differs."""
        text = "_".join(str(value) for value in asdict(self).values())
        return "".join(c if c.isalnum() or c in "-._" else "-" for c in text)


def run(
    setting: Setting, controller: Controller, first_seed: int = 0
) -> tuple[pd.DataFrame, NDArray[np.float64]]:
    """Sail one episode a seed.

    Args:
        setting: task, sea, observer and so on; ``sea`` ``task`` leaves the choice to the task.
        controller: with ``predict``.
        first_seed: seeds run from here; equal seeds meet equal seas whatever the controller.

    Returns:
        KPIs, one row a seed; and the first seed's episode, shape (intervals, 4 + 9 + 2): time [s],
        order [m/s], pitch ratio, rack [mm], the environment's ``TRUTH``, estimate and its validity.
    """
    env = FrigateVectorEnv(
        setting.seeds,
        ship=setting.ship,
        task=setting.task,
        sea=None if setting.sea == "task" else setting.sea,
        observer=setting.observer,
        sensor_noise=setting.sensor_noise,
        episode_s=setting.episode_s,
    )
    interval = env.fleet.steps * env.fleet.dt
    gear = env.fleet.ship.transmission.gear_ratio
    observation, _ = env.reset(seed=first_seed)
    sums = _Sums(setting.seeds)
    alive = np.ones(setting.seeds, dtype=bool)
    starting = alive.copy()
    state: Any = None
    trace: list[list[float]] = []
    order = observation[:, 0].astype(float)
    while alive.any():
        action, state = controller.predict(observation, state, starting, deterministic=True)
        observation, reward, terminated, truncated, info = env.step(action)
        sums.add(alive, info, reward, order, interval, gear)
        if alive[0]:
            seen = info["final_obs"][0] if terminated[0] or truncated[0] else observation[0]
            truth = [float(info[name][0]) for name in TRUTH]
            trace.append(
                [len(trace) * interval, order[0], seen[3], seen[4], *truth, seen[6], seen[7]]
            )
        sums.failed |= alive & terminated
        starting = terminated | truncated
        alive &= ~starting
        order = observation[:, 0].astype(float)
    env.close()
    return sums.kpis(interval), np.array(trace, dtype=np.float64)


TRACE = ("time", "speed_order", "pitch_ratio", "fuel_rack", *TRUTH, "estimate", "valid")
"""Columns of an episode's trace."""


class _Sums:
    """Running sums of the KPIs, one entry a seed."""

    def __init__(self, n: int) -> None:
        self.count, self.fuel, self.error, self.torque, self.square = np.zeros((5, n))
        self.peak, self.travel, self.overload, self.overspeed = np.zeros((4, n))
        self.cavitation, self.ventilation, self.thrust, self.reward = np.zeros((4, n))
        self.power, self.power_peak, self.distance = np.zeros((3, n))
        self.failed = np.zeros(n, dtype=bool)

    def add(
        self,
        alive: Any,
        info: dict[str, Any],
        reward: Any,
        order: Any,
        interval: float,
        gear: float,
    ) -> None:
        """Take one control interval of those episodes that still run."""
        terms = info["reward_terms"]
        torque = info["shaft_torque"] * 1e-3
        power = info["brake_torque"] * info["shaft_speed"] * gear * 1e-3
        self.count += alive
        self.fuel += alive * terms["fuel_kg_s"] * interval
        self.error += alive * (info["ship_speed"] - order) ** 2
        self.torque += alive * torque
        self.square += alive * torque**2
        self.peak = np.where(alive, np.maximum(self.peak, torque), self.peak)
        self.travel += alive * terms["rack_travel_mm"]
        self.overload += alive * (terms["overload"] > 0.0) * interval
        self.overspeed += alive * (terms["overspeed"] > 0.0) * interval
        self.cavitation += alive * (terms["cavitation"] > 0.0) * interval
        self.ventilation += alive * (info["ventilation"] > 0.5) * interval
        self.thrust += alive * info["thrust"] * 1e-3
        self.power += alive * power
        self.power_peak = np.where(alive, np.maximum(self.power_peak, power), self.power_peak)
        self.reward += alive * reward
        self.distance = np.where(alive, info["position"], self.distance)

    def kpis(self, interval: float) -> pd.DataFrame:
        """KPIs, one row a seed."""
        mean = self.torque / self.count
        return pd.DataFrame(
            {
                "fuel_kg_nmi": self.fuel / np.maximum(self.distance, 1.0) * _NAUTICAL_MILE,
                "speed_error_rms_m_s": np.sqrt(self.error / self.count),
                "torque_sd_kN_m": np.sqrt(np.maximum(self.square / self.count - mean**2, 0.0)),
                "torque_peak_kN_m": self.peak,
                "rack_travel_mm_min": self.travel / (self.count * interval) * 60.0,
                "overload_s": self.overload,
                "overspeed_s": self.overspeed,
                "cavitation_s": self.cavitation,
                "ventilation_s": self.ventilation,
                "thrust_mean_kN": self.thrust / self.count,
                "power_mean_kW": self.power / self.count,
                "power_peak_kW": self.power_peak,
                "failed": self.failed.astype(float),
                "reward": self.reward,
            }
        )


def interquartile_mean(values: Any) -> float:
    """Mean of the middle half (Agarwal et al. 2021)."""
    return float(stats.trim_mean(np.asarray(values, dtype=np.float64), 0.25))


def with_interval(values: Any, seed: int = 0) -> tuple[float, float, float]:
    """Interquartile mean with its 95 % percentile bootstrap interval."""
    sample = np.asarray(values, dtype=np.float64)
    middle = interquartile_mean(sample)
    if len(sample) < 3 or np.ptp(sample) == 0.0:
        return middle, middle, middle
    found = stats.bootstrap(
        (sample,),
        interquartile_mean,
        n_resamples=1000,
        method="percentile",
        rng=np.random.default_rng(seed),
        vectorized=False,
    ).confidence_interval
    return middle, float(found.low), float(found.high)


def summary(kpis: pd.DataFrame) -> dict[str, tuple[float, float, float]]:
    """Each KPI's interquartile mean and 95 % interval; ``failed`` is a plain mean."""
    found = {name: with_interval(kpis[name]) for name in KPIS if name != "failed"}
    share = float(kpis["failed"].mean())
    return {**found, "failed": (share, share, share)}


def evaluate(
    settings: Sequence[Setting],
    make: Callable[[Setting], Controller],
    folder: Path,
    tick: Callable[[], None] = lambda: None,
) -> pd.DataFrame:
    """Evaluate every setting; cells that already stand in the folder are not sailed again.

    Args:
        settings: cells.
        make: controller of a cell.
        folder: cells are kept in ``folder/cells`` as JSON.
        tick: called after each cell.

    Returns:
        One row a cell: its fields, then each KPI with ``_low`` and ``_high``.
    """
    rows = []
    for setting in settings:
        path = folder / "cells" / f"{setting.name}.json"
        if not path.is_file():
            kpis, _ = run(setting, make(setting))
            write_json(path, {"setting": asdict(setting), "kpis": kpis.to_dict(orient="list")})
        kept = pd.DataFrame(json.loads(path.read_text(encoding="utf-8"))["kpis"])
        row: dict[str, Any] = asdict(setting)
        for name, (middle, low, high) in summary(kept).items():
            row |= {name: middle, f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
        tick()
    return pd.DataFrame(rows)
