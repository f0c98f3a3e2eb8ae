"""Running sums over a batch of episodes, and the key performance indicators from them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...envs.kernel import ENDINGS, TRIPPED
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


SIGNED = ("speed_mean_m_s", "speed_short_m_s", "thrust_mean_kN", "power_mean_kW", "attack_99_deg")
"""KPIs that can be negative; no interval of another KPI extends below 0."""


class EpisodeSums:
    """Running sums of the KPIs, one entry for each seed.

    Args:
        n: number of episodes.
        interval_s: control interval [s].
        gear_ratio: engine speed over shaft speed [-].
    """

    def __init__(self, n: int, interval_s: float, gear_ratio: float) -> None:
        self.interval_s, self.gear_ratio = interval_s, gear_ratio
        self.total: dict[str, NDArray[np.float64]] = defaultdict(lambda: np.zeros(n))
        self.highest: dict[str, NDArray[np.float64]] = defaultdict(lambda: np.zeros(n))
        self.distance = np.zeros(n)
        self.failed, self.tripped = np.zeros((2, n), dtype=bool)
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
        torque, brake = info["shaft_torque"] * 1e-3, info["brake_torque"] * 1e-3
        power = info["brake_torque"] * info["shaft_speed"] * self.gear_ratio * 1e-3
        moved = np.abs(info["blade_pitch"] - self.pitch)
        self.pitch = info["blade_pitch"]
        for name, value in {
            "intervals": 1.0,
            "fuel": terms["fuel_kg_s"] * interval,
            "nox": terms["nox_g_s"] * interval,
            "error": (info["ship_speed"] - order) ** 2,
            "short": order - info["ship_speed"],
            "torque": torque,
            "square": torque**2,
            "travel": terms["rack_travel_mm"],
            "overload": (terms["overload"] > _BEYOND) * interval,
            "limit": (terms["near_limit"] > 1.0 - _BEYOND / NEAR_LIMIT) * interval,
            "overspeed": (terms["overspeed"] > 0.0) * interval,
            "cavitation": (terms["cavitation"] > 0.0) * interval,
            "ventilation": (info["ventilation"] > 0.5) * interval,
            "thrust": info["thrust"] * 1e-3,
            "power": power,
            "reward": reward,
            "heading": terms["heading_error_deg"] ** 2,
            "track": terms["track_error_m"] ** 2,
            "rudder": terms["rudder_rate_deg_s"] * interval,
            "outside": (info["outside_bucket"] > 0.0) * interval,
            "pitch_travel": np.where(np.isfinite(moved), moved, 0.0),
        }.items():
            self.total[name] += alive * value
        for name, value in (("torque", torque), ("speed", info["shaft_speed"]), ("power", power)):
            most = self.highest[name]
            self.highest[name] = np.where(alive, np.maximum(most, value), most)
        self.distance = np.where(alive, info["position"], self.distance)
        failing = np.logical_and(alive, info.get("_ended", False))
        self.failed |= failing
        if failing.any():
            self.tripped |= failing & (info["ended"] == ENDINGS[TRIPPED])
        self.attack.append(np.where(alive, info["angle_of_attack"], np.nan))
        fluctuating = np.array([torque, brake, power, info["angle_of_attack"]])
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

    def per_interval(self, name: str) -> NDArray[np.float64]:
        """Return the mean of a sum over the intervals of each episode."""
        return np.asarray(self.total[name] / self.total["intervals"])

    def rms(self, name: str) -> NDArray[np.float64]:
        """Return the rms of one of :data:`FLUCTUATIONS` about its mean, in the unit of the signal.

        Intervals within :data:`_SETTLED_S` of a new order count only where there are no others.
        """
        k = FLUCTUATIONS.index(name)
        late = self.settled_deviation[k] / np.maximum(self.settled, 1.0)
        whole = self.deviation[k] / self.total["intervals"]
        return np.asarray(np.sqrt(np.where(self.settled > 0.0, late, whole)))

    @property
    def time(self) -> NDArray[np.float64]:
        """Length of each episode [s]."""
        return np.asarray(self.total["intervals"] * self.interval_s)

    @property
    def torque_sd(self) -> NDArray[np.float64]:
        """Standard deviation of the shaft torque [kN m]."""
        return np.sqrt(
            np.maximum(self.per_interval("square") - self.per_interval("torque") ** 2, 0.0)
        )

    def kpis(self) -> pd.DataFrame:
        """Return the KPIs, one row for each seed."""
        return pd.DataFrame({name: kpi(self) for name, (_, kpi) in _DECLARED.items()})


def _mean(name: str) -> Callable[[EpisodeSums], Any]:
    return lambda s: s.per_interval(name)


def _rms(name: str) -> Callable[[EpisodeSums], Any]:
    return lambda s: np.sqrt(s.per_interval(name))


def _sum(name: str) -> Callable[[EpisodeSums], Any]:
    return lambda s: s.total[name]


def _per_minute(name: str) -> Callable[[EpisodeSums], Any]:
    return lambda s: s.total[name] / s.time * 60.0


def _per_mile(name: str) -> Callable[[EpisodeSums], Any]:
    return lambda s: s.total[name] / np.maximum(s.distance, 1.0) * _NAUTICAL_MILE


_DECLARED: dict[str, tuple[str, Callable[[EpisodeSums], Any]]] = {
    "fuel_kg_nmi": ("fuel per nautical mile [kg]",
        _per_mile("fuel")),
    "nox_g_nmi": ("NOx per nautical mile, 0 without a NOx map in the ship file [g]",
        _per_mile("nox")),
    "speed_error_rms_m_s": ("rms of ship speed less ordered speed [m/s]", _rms("error")),
    "speed_mean_m_s": ("distance over time [m/s]", lambda s: s.distance / s.time),
    "speed_short_m_s": ("mean of ordered speed less ship speed [m/s]", _mean("short")),
    "torque_sd_kN_m": ("standard deviation of the shaft torque [kN m]", lambda s: s.torque_sd),
    "torque_peak_kN_m": ("highest shaft torque [kN m]", lambda s: s.highest["torque"]),
    "rack_travel_mm_min": ("travel of the rack command [mm/min]", _per_minute("travel")),
    "overload_s": ("time more than 0.5 % beyond the engine's envelope [s]", _sum("overload")),
    "limit_s": ("time within 0.5 % of the engine's envelope or beyond it [s]", _sum("limit")),
    "shaft_speed_peak_rad_s": ("highest shaft speed [rad/s]", lambda s: s.highest["speed"]),
    "overspeed_s": ("time beyond the engine's highest speed [s]", _sum("overspeed")),
    "cavitation_s": ("time beyond Burrill's limit [s]", _sum("cavitation")),
    "ventilation_s": ("time ventilating [s]", _sum("ventilation")),
    "thrust_mean_kN": ("mean thrust of one propeller [kN]", _mean("thrust")),
    "power_mean_kW": ("mean brake power of one engine [kW]", _mean("power")),
    "power_peak_kW": ("highest brake power of one engine [kW]", lambda s: s.highest["power"]),
    "wave_torque_kN_m": ("fluctuation of the shaft torque in waves: rms about its mean over 20 s, "
        "later than 60 s after a new order [kN m]", lambda s: s.rms("torque")),
    "wave_engine_torque_kN_m": ("fluctuation of one engine's torque in waves [kN m]",
        lambda s: s.rms("engine_torque")),
    "wave_power_kW": ("fluctuation of one engine's power in waves [kW]", lambda s: s.rms("power")),
    "wave_attack_deg": ("fluctuation of the effective angle of attack of the blades in waves [deg]",
        lambda s: s.rms("attack")),
    "attack_99_deg": ("99th percentile of the effective angle of attack of the blades [deg]",
        lambda s: np.nanpercentile(s.attack, 99.0, axis=0)),
    "outside_bucket_s": ("time outside the cavitation bucket [s]", _sum("outside")),
    "pitch_travel_min": ("travel of the blades' P/D [1/min]", _per_minute("pitch_travel")),
    "rise_s": ("mean time from a new order until 90 % of its step is done, or the next order [s]",
        lambda s: s.rising * s.interval_s / np.maximum(s.rises, 1.0)),
    "heading_error_rms_deg": ("rms of heading less ordered heading, 0 without rudder control [deg]",
        _rms("heading")),
    "track_error_rms_m": ("rms of the distance from the ordered track, 0 without rudder control [m]",
        _rms("track")),
    "rudder_travel_deg_min": ("travel of the rudder [deg/min]", _per_minute("rudder")),
    "failed": ("share of episodes in which the engine stalled or tripped [-]",
        lambda s: s.failed.astype(np.float64)),
    "tripped": ("share of episodes in which the engine tripped on overspeed [-]",
        lambda s: s.tripped.astype(np.float64)),
    "reward": ("sum of the rewards of the task, 0 where the episode failed; higher is better",
        lambda s: np.where(s.failed, 0.0, s.total["reward"])),
}  # fmt: skip
"""Meaning and function of each KPI."""

KPIS = {name: meaning for name, (meaning, _) in _DECLARED.items()}
"""Meaning and unit of each key performance indicator, by column."""
