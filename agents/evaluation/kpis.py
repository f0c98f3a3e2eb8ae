"""Running sums over a batch of episodes, and the key performance indicators from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...envs.rewards import MEAN_S, NEAR_LIMIT

_NAUTICAL_MILE = 1852.0
_STEP_M_S = 0.5
"""Smallest change of an order that counts as a step for the rise time."""

_SETTLED_S = 3.0 * MEAN_S
"""Time after a new order, or the start, after which torque fluctuations are those of the waves [s]."""

_BEYOND = 0.005
"""Share of the engine envelope within which a torque limiter holds it, given the speed measurement."""

FLUCTUATIONS = ("torque", "engine_torque", "power", "attack")
"""Signals whose fluctuation about their mean over the last MEAN_S is a KPI."""


class EpisodeSums:
    """Running sums of the KPIs, one entry for each seed.

    Args:
        n: number of episodes.
        interval_s: control interval [s].
        gear_ratio: engine speed over shaft speed [-].
    """

    def __init__(self, n: int, interval_s: float, gear_ratio: float) -> None:
        self.interval_s, self.gear_ratio = interval_s, gear_ratio
        self.count, self.fuel, self.error, self.torque, self.square = np.zeros((5, n))
        self.peak, self.travel, self.overload, self.overspeed = np.zeros((4, n))
        self.fastest = np.zeros(n)
        self.cavitation, self.ventilation, self.thrust, self.reward = np.zeros((4, n))
        self.power, self.power_peak, self.distance, self.short = np.zeros((4, n))
        self.failed = np.zeros(n, dtype=bool)
        self.pitch_travel, self.outside, self.limit = np.zeros((3, n))
        self.heading, self.track, self.rudder = np.zeros((3, n))
        self.pitch = np.full(n, np.nan)
        # Angles of attack by interval; nan after the end of an episode.
        self.attack: list[NDArray[np.float64]] = []
        self.mean: NDArray[np.float64] | None = None  # of FLUCTUATIONS, over the last MEAN_S
        # Squared deviations from it: of all intervals, and of those long after a new order.
        self.deviation, self.settled_deviation = np.zeros((2, len(FLUCTUATIONS), n))
        self.settled, self.since_order = np.zeros((2, n))
        self.order = np.full(n, np.nan)
        # Step of the present order, and whether it is done; intervals and number of all rises.
        self.step, self.rising, self.rises = np.zeros((3, n))
        self.risen = np.ones(n, dtype=bool)

    def add(self, alive: Any, info: dict[str, Any], reward: Any, order: Any) -> None:
        """Add one control interval of the episodes that still run.

        Args:
            alive: mask of these episodes, shape (n,).
            info: info of the vector environment.
            reward: rewards, shape (n,).
            order: ordered ship speed [m/s] that was observed before the interval, shape (n,).
        """
        terms, interval = info["reward_terms"], self.interval_s
        self._follow(alive, info["ship_speed"], np.asarray(order))
        torque = info["shaft_torque"] * 1e-3
        power = info["brake_torque"] * info["shaft_speed"] * self.gear_ratio * 1e-3
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
        self.overload += alive * (terms["overload"] > _BEYOND) * interval
        self.limit += alive * (terms["near_limit"] > 1.0 - _BEYOND / NEAR_LIMIT) * interval
        self.overspeed += alive * (terms["overspeed"] > 0.0) * interval
        self.cavitation += alive * (terms["cavitation"] > 0.0) * interval
        self.ventilation += alive * (info["ventilation"] > 0.5) * interval
        self.thrust += alive * info["thrust"] * 1e-3
        self.power += alive * power
        self.power_peak = np.where(alive, np.maximum(self.power_peak, power), self.power_peak)
        self.reward += alive * reward
        self.distance = np.where(alive, info["position"], self.distance)
        self.failed |= np.logical_and(alive, info.get("_ended", False))
        self.heading += alive * terms["heading_error_deg"] ** 2
        self.track += alive * terms["track_error_m"] ** 2
        self.rudder += alive * terms["rudder_rate_deg_s"] * interval
        self.outside += alive * (info["outside_bucket"] > 0.0) * interval
        moved = np.abs(info["blade_pitch"] - self.pitch)
        self.pitch_travel += np.where(alive & np.isfinite(moved), moved, 0.0)
        self.pitch = info["blade_pitch"]
        self.attack.append(np.where(alive, info["angle_of_attack"], np.nan))
        fluctuating = np.array(
            [torque, info["brake_torque"] * 1e-3, power, info["angle_of_attack"]]
        )
        if self.mean is None:
            self.mean = fluctuating.copy()
        self.mean += interval / MEAN_S * (fluctuating - self.mean)
        squares = (fluctuating - self.mean) ** 2
        settled = alive & (self.since_order >= _SETTLED_S)
        self.deviation += alive * squares
        self.settled_deviation += settled * squares
        self.settled += settled

    def _follow(self, alive: Any, speed: Any, order: Any) -> None:
        """Count the time until 90 % of the step of each new order is done."""
        fresh = alive & np.isfinite(self.order) & (np.abs(order - self.order) > _STEP_M_S)
        self.step = np.where(fresh, np.abs(order - speed), self.step)
        self.risen &= ~fresh
        self.rises += fresh
        self.since_order = np.where(fresh, 0.0, self.since_order + self.interval_s)
        self.order = order.copy()
        self.rising += alive & ~self.risen
        self.risen |= np.abs(order - speed) <= 0.1 * self.step

    def rms(self, name: str) -> NDArray[np.float64]:
        """Return the rms of one of :data:`FLUCTUATIONS` about its mean, in the unit of the signal.

        Intervals within :data:`_SETTLED_S` of a new order count only where there are no others.
        """
        k = FLUCTUATIONS.index(name)
        late = self.settled_deviation[k] / np.maximum(self.settled, 1.0)
        return np.asarray(
            np.sqrt(np.where(self.settled > 0.0, late, self.deviation[k] / self.count))
        )

    @property
    def attack_99(self) -> NDArray[np.float64]:
        """99th percentile of the angle of attack [deg]."""
        return np.asarray(np.nanpercentile(self.attack, 99.0, axis=0))

    @property
    def time(self) -> NDArray[np.float64]:
        """Length of each episode [s]."""
        return self.count * self.interval_s

    @property
    def torque_sd(self) -> NDArray[np.float64]:
        """Standard deviation of the shaft torque [kN m]."""
        mean = self.torque / self.count
        return np.sqrt(np.maximum(self.square / self.count - mean**2, 0.0))

    def kpis(self) -> pd.DataFrame:
        """Return the KPIs, one row for each seed."""
        return pd.DataFrame({name: kpi.of(self) for name, kpi in _DECLARED.items()})


class _Kpi(NamedTuple):
    meaning: str
    of: Callable[[EpisodeSums], Any]


_DECLARED = {
    "fuel_kg_nmi": _Kpi(
        "fuel per nautical mile [kg]",
        lambda s: s.fuel / np.maximum(s.distance, 1.0) * _NAUTICAL_MILE,
    ),
    "speed_error_rms_m_s": _Kpi(
        "rms of ship speed less ordered speed [m/s]", lambda s: np.sqrt(s.error / s.count)
    ),
    "speed_mean_m_s": _Kpi("distance over time [m/s]", lambda s: s.distance / s.time),
    "speed_short_m_s": _Kpi(
        "mean of ordered speed less ship speed [m/s]", lambda s: s.short / s.count
    ),
    "torque_sd_kN_m": _Kpi("standard deviation of the shaft torque [kN m]", lambda s: s.torque_sd),
    "torque_peak_kN_m": _Kpi("highest shaft torque [kN m]", lambda s: s.peak),
    "rack_travel_mm_min": _Kpi(
        "travel of the rack command [mm/min]", lambda s: s.travel / s.time * 60.0
    ),
    "overload_s": _Kpi(
        "time more than 0.5 % beyond the engine's envelope [s]", lambda s: s.overload
    ),
    "limit_s": _Kpi(
        "time within 0.5 % of the engine's envelope or beyond it [s]", lambda s: s.limit
    ),
    "shaft_speed_peak_rad_s": _Kpi("highest shaft speed [rad/s]", lambda s: s.fastest),
    "overspeed_s": _Kpi("time beyond the engine's highest speed [s]", lambda s: s.overspeed),
    "cavitation_s": _Kpi("time beyond Burrill's limit [s]", lambda s: s.cavitation),
    "ventilation_s": _Kpi("time ventilating [s]", lambda s: s.ventilation),
    "thrust_mean_kN": _Kpi("mean thrust of one propeller [kN]", lambda s: s.thrust / s.count),
    "power_mean_kW": _Kpi("mean brake power of one engine [kW]", lambda s: s.power / s.count),
    "power_peak_kW": _Kpi("highest brake power of one engine [kW]", lambda s: s.power_peak),
    "wave_torque_kN_m": _Kpi(
        "fluctuation of the shaft torque in waves: rms about its mean over 20 s, later than 60 s after "
        "a new order [kN m]",
        lambda s: s.rms("torque"),
    ),
    "wave_engine_torque_kN_m": _Kpi(
        "fluctuation of one engine's torque in waves [kN m]", lambda s: s.rms("engine_torque")
    ),
    "wave_power_kW": _Kpi(
        "fluctuation of one engine's power in waves [kW]", lambda s: s.rms("power")
    ),
    "wave_attack_deg": _Kpi(
        "fluctuation of the effective angle of attack of the blades in waves [deg]",
        lambda s: s.rms("attack"),
    ),
    "attack_99_deg": _Kpi(
        "99th percentile of the effective angle of attack of the blades [deg]",
        lambda s: s.attack_99,
    ),
    "outside_bucket_s": _Kpi("time outside the cavitation bucket [s]", lambda s: s.outside),
    "pitch_travel_min": _Kpi(
        "travel of the blades' P/D [1/min]", lambda s: s.pitch_travel / s.time * 60.0
    ),
    "rise_s": _Kpi(
        "mean time from a new order until 90 % of its step is done, or the next order [s]",
        lambda s: s.rising * s.interval_s / np.maximum(s.rises, 1.0),
    ),
    "heading_error_rms_deg": _Kpi(
        "rms of heading less ordered heading, 0 without rudder control [deg]",
        lambda s: np.sqrt(s.heading / s.count),
    ),
    "track_error_rms_m": _Kpi(
        "rms of the distance from the ordered track, 0 without rudder control [m]",
        lambda s: np.sqrt(s.track / s.count),
    ),
    "rudder_travel_deg_min": _Kpi(
        "travel of the rudder [deg/min]", lambda s: s.rudder / s.time * 60.0
    ),
    "failed": _Kpi(
        "share of episodes in which the engine stalled or tripped [-]",
        lambda s: s.failed.astype(np.float64),
    ),
    "reward": _Kpi(
        "sum of the rewards of the task, 0 where the episode failed; higher is better",
        lambda s: np.where(s.failed, 0.0, s.reward),
    ),
}

KPIS = {name: kpi.meaning for name, kpi in _DECLARED.items()}
"""Meaning and unit of each key performance indicator, by column."""
