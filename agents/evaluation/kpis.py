"""Running sums over a batch of episodes, and the key performance indicators that they become."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

KPIS = {
    "fuel_kg_nmi": "fuel per nautical mile [kg]",
    "speed_error_rms_m_s": "rms of ship speed minus order [m/s]",
    "speed_mean_m_s": "distance over time [m/s]",
    "speed_short_m_s": "mean of order minus ship speed [m/s]",
    "torque_sd_kN_m": "standard deviation of the shaft torque [kN m]",
    "torque_peak_kN_m": "highest shaft torque [kN m]",
    "rack_travel_mm_min": "travel of the rack command [mm/min]",
    "overload_s": "time beyond the engine's envelope [s]",
    "shaft_speed_peak_rad_s": "highest shaft speed [rad/s]",
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


class EpisodeSums:
    """Running sums of the KPIs, one entry a seed."""

    def __init__(self, n: int) -> None:
        self.count, self.fuel, self.error, self.torque, self.square = np.zeros((5, n))
        self.peak, self.travel, self.overload, self.overspeed = np.zeros((4, n))
        self.fastest = np.zeros(n)
        self.cavitation, self.ventilation, self.thrust, self.reward = np.zeros((4, n))
        self.power, self.power_peak, self.distance, self.short = np.zeros((4, n))
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
        self.short += alive * (order - info["ship_speed"])
        self.torque += alive * torque
        self.square += alive * torque**2
        self.peak = np.where(alive, np.maximum(self.peak, torque), self.peak)
        speed = info["shaft_speed"]
        self.fastest = np.where(alive, np.maximum(self.fastest, speed), self.fastest)
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
                "speed_mean_m_s": self.distance / (self.count * interval),
                "speed_short_m_s": self.short / self.count,
                "torque_sd_kN_m": np.sqrt(np.maximum(self.square / self.count - mean**2, 0.0)),
                "torque_peak_kN_m": self.peak,
                "rack_travel_mm_min": self.travel / (self.count * interval) * 60.0,
                "overload_s": self.overload,
                "shaft_speed_peak_rad_s": self.fastest,
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
