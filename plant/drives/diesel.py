"""Diesel engine with a fuel rack map, torque limits and a lag of the torque.

The map is valid between the lowest and the highest running speed. :mod:`.low_speed` gives the torque
below the lowest running speed, at standstill and astern.

Two limits below the torque limit rise with the power that the engine has delivered, each through its own
lag. The smoke limit follows the charge air, which a turbocharger builds up in seconds. The loading limit
follows the warmth of the engine's parts, which takes minutes. Both are assumed to be straight lines over
the lagged share of the rated power.
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from ...core.compiled import Real, Record, compiled
from ...core.lanes import where
from ...core.numeric import clip, modulus
from ..keys import INF, effect, parameter, quantity, require
from ..signals import Signal
from ..validity import Validity
from .low_speed import FULL_FIRING_SHARE, low_speed_torque
from .prime_mover import PrimeMover, end_stops


def _coefficient(record: str, term: str, default: float = 0.0) -> Any:
    """Declare a coefficient of the fuel surface: fuel share per power share and speed share."""
    about = f"coefficient of {term} in the fuel surface"
    return parameter(about, record=record, ge=-1e5, le=1e5, default=default)


class Diesel(PrimeMover):
    """Diesel engine with the fuel rack map M_b = a omega_e + b X + c."""

    type: Literal["diesel"] = Field(description="kind of drive")

    code, balance = 0, "engine"
    demand = Signal(
        "fuel_rack_demand", "X", "mm", 0, 200, "demand", "fuel_rack_mm", "command to the fuel rack"
    )
    steady_keys = (
        "prime_mover.torque_per_speed_N_m_s_rad",
        "prime_mover.torque_per_rack_N_m_mm",
        "prime_mover.torque_offset_N_m",
    )
    response_keys = (*steady_keys, "transmission.inertia_engine_side_kg_m2")
    derived = tuple(
        (n, np.float64) for n in ("engine_speed_min", "engine_speed_max", "rated_power")
    )
    validity = (
        end_stops("fuel rack command", "mm"),
        Validity(
            "engine speed",
            "rad/s",
            lambda plant, samples: plant["gear_ratio"] * samples["shaft_speed"],
            lambda plant: (float(plant["engine_speed_min"]), float(plant["engine_speed_max"])),
            "below it friction and ignition are assumed, above it the rack map is extrapolated",
        ),
    )

    # fmt: off
    torque_per_speed_N_m_s_rad: float = parameter("a, torque per engine speed", "N m s/rad",
        record="torque_per_speed", ge=-1e5, le=0)
    torque_per_rack_N_m_mm: float = parameter("b, torque per fuel rack", "N m/mm",
        record="torque_per_rack", gt=0, le=1e6)
    torque_offset_N_m: float = parameter("c, torque offset", "N m", record="torque_offset", ge=-1e6,
        le=1e6)
    rack_max_mm: float = parameter("end stop of the rack", "mm", record="drive_max", gt=0, le=200)
    speed_min_rpm: float = quantity("lowest running (idle) speed; below it ignition fails gradually",
        "rpm", gt=0, le=3000)
    speed_max_rpm: float = quantity("highest running speed", "rpm", gt=0, le=5000)
    torque_limit_N_m: float = parameter("highest brake torque", "N m", record="torque_limit", gt=0,
        default=INF)
    torque_limit_at_min_speed_N_m: float = parameter("brake torque limit at the lowest speed", "N m",
        record="torque_limit_idle", gt=0, default=INF)
    torque_limit_slope_N_m_s_rad: float = parameter("rise of the limit with engine speed", "N m s/rad",
        record="torque_limit_slope", ge=0, le=1e6, default=0.0)
    starting_air_torque_N_m: float = parameter(
        "torque of starting air below the firing speed if the rack is open; 0: no starting air", "N m",
        record="starting_air_torque", ge=0, le=1e7, default=0.0)
    lag_s: float = effect(0.0, "first-order lag of the torque", "s", record="engine_lag", lag=True, ge=0,
        le=30)
    charge_air_lag_s: float = effect(0.0, "lag of the charge air behind the power; 0: no smoke limit",
        "s", record="charge_lag", lag=True, ge=0, le=60)
    smoke_limit_N_m: float = parameter("highest brake torque without charge air", "N m",
        record="smoke_limit", gt=0, default=INF)
    smoke_limit_rise_N_m: float = parameter("increase of that limit up to the charge air at rated power",
        "N m", record="smoke_limit_rise", ge=0, le=1e7, default=0.0)
    warmth_lag_s: float = effect(0.0, "lag of the engine's warmth behind the power; 0: no loading limit",
        "s", record="warmth_lag", lag=True, ge=0, le=7200)
    loading_limit_N_m: float = parameter("highest brake torque of the cold engine", "N m",
        record="loading_limit", gt=0, default=INF)
    loading_limit_rise_N_m: float = parameter("increase of that limit up to the warmth at rated power",
        "N m", record="loading_limit_rise", ge=0, le=1e7, default=0.0)
    dead_time_s: float = effect(0.0, "dead time of the rack command", "s", record="command_dead_time",
        ge=0, le=6)
    rack_rate_limit_mm_s: float = effect(INF, "rate limit of the rack", "mm/s", record="rack_rate_limit",
        gt=0)
    derating_fraction: float = effect(0.0, "share of torque lost", record="derating", ge=-0.5, le=0.9)
    torque_curvature_N_m_s2_rad2: float = effect(0.0, "curvature of the map over engine speed",
        "N m s2/rad2", record="torque_curvature", ge=-1e4, le=1e4)
    torque_curvature_speed_rad_s: float = parameter("engine speed at which the curvature has no effect",
        "rad/s", record="torque_curvature_speed", ge=0, le=500, default=0.0)
    fuel_base_g_kWh: float = effect(0.0,
        "specific consumption that scales the fuel surface; 0: no fuel model", "g/kWh",
        record="fuel_base", ge=0, le=1000)
    fuel_rated_power_W: float = parameter(
        "reference power N_r of the fuel surface (its reference speed is the highest one)", "W",
        record="fuel_rated_power", gt=0, le=1e9, default=1.0)
    # fmt: on
    fuel_p0_s1: float = _coefficient("fuel_p0_s1", "omega")
    fuel_p0_s2: float = _coefficient("fuel_p0_s2", "omega^2")
    fuel_p1_s0: float = _coefficient("fuel_p1_s0", "N", 1.0)
    fuel_p1_s1: float = _coefficient("fuel_p1_s1", "N omega")
    fuel_p1_s2: float = _coefficient("fuel_p1_s2", "N omega^2")
    fuel_p1_s3: float = _coefficient("fuel_p1_s3", "N omega^3")
    fuel_p2_s0: float = _coefficient("fuel_p2_s0", "N^2")
    fuel_p2_s1: float = _coefficient("fuel_p2_s1", "N^2 omega")
    fuel_p2_s2: float = _coefficient("fuel_p2_s2", "N^2 omega^2")
    fuel_p2_s3: float = _coefficient("fuel_p2_s3", "N^2 omega^3")
    fuel_p3_s0: float = _coefficient("fuel_p3_s0", "N^3")
    fuel_p3_s1: float = _coefficient("fuel_p3_s1", "N^3 omega")
    fuel_p3_s2: float = _coefficient("fuel_p3_s2", "N^3 omega^2")
    fuel_p3_s3: float = _coefficient("fuel_p3_s3", "N^3 omega^3")

    @model_validator(mode="after")
    def _complete(self) -> Diesel:
        if self.fuel_base_g_kWh > 0.0:
            require(self, ("fuel_rated_power_W",), "with a fuel_base_g_kWh")
        for lag, limit in (("charge_air_lag_s", "smoke"), ("warmth_lag_s", "loading")):
            if getattr(self, lag) > 0.0:
                keys = ("torque_limit_N_m", f"{limit}_limit_N_m", f"{limit}_limit_rise_N_m")
                require(self, keys, f"with a {lag}")
        if self.speed_min_rpm >= self.speed_max_rpm:
            raise ValueError(
                f"speed_min_rpm = {self.speed_min_rpm:g} must be below speed_max_rpm = "
                f"{self.speed_max_rpm:g}"
            )
        return self

    @property
    def least_running_speed_rad_s(self) -> float:
        """Lowest engine speed at which all fuel ignites [rad/s]."""
        return FULL_FIRING_SHARE * self.speed_min_rpm * math.pi / 30.0

    def fill(self, record: Any) -> None:
        """Write the parameters, and the engine speeds in rad/s."""
        super().fill(record)
        record["engine_speed_min"] = self.speed_min_rpm * math.pi / 30.0
        record["engine_speed_max"] = self.speed_max_rpm * math.pi / 30.0
        record["rated_power"] = record["engine_speed_max"] * self.torque_limit_N_m


@compiled
def rack_torque(plant: Record, engine_speed: Real, fuel_rack: Real) -> Real:
    """Return the brake torque M_b [N m] of the rack map (thesis eqs. 2-13 and 2-14), before its limits.

    It is linear in omega_e [rad/s] and X [mm]; :func:`.low_speed_torque` corrects it at low speed.
    ``torque_curvature`` bends it about ``torque_curvature_speed``, ``derating`` removes a share of the
    torque.
    """
    torque = plant.torque_per_speed * engine_speed + plant.torque_per_rack * fuel_rack
    torque = torque + plant.torque_offset
    deviation = engine_speed - plant.torque_curvature_speed
    torque = torque + plant.torque_curvature * deviation * deviation
    return torque * (1.0 - plant.derating)


@compiled
def rack_of_torque(plant: Record, engine_speed: Real, brake_torque: Real) -> Real:
    """Return the fuel rack X [mm] at which the rack map gives a brake torque [N m] at omega_e [rad/s].

    Stops and limits are left out, and all fuel ignites, also at low speed.
    """
    at_no_rack = rack_torque(plant, engine_speed, 0.0)
    return (brake_torque - at_no_rack) / (plant.torque_per_rack * (1.0 - plant.derating))


@compiled
def torque_limit(plant: Record, engine_speed: Real) -> Real:
    """Return the torque limit of the engine [N m], above 0 at any speed of either sign.

    It rises linearly with speed and is constant on both sides: above where it reaches ``torque_limit``,
    and below the speed at which fuel begins to fail to ignite or at which the line has fallen to half
    the limit at idle speed.
    """
    above_idle = engine_speed - plant.engine_speed_min
    fall = (1.0 - FULL_FIRING_SHARE) * plant.engine_speed_min
    half = 0.5 * plant.torque_limit_idle
    if fall.real * plant.torque_limit_slope.real > half.real:
        fall = half / plant.torque_limit_slope
    above_idle = where(above_idle.real < -fall.real, -fall, above_idle)
    return clip(
        plant.torque_limit_idle + plant.torque_limit_slope * above_idle,
        -plant.torque_limit,
        plant.torque_limit,
    )


@compiled
def _limited_torque(plant: Record, engine_speed: Real, fuel_rack: Real) -> Real:
    """Return the torque [N m] of the rack map below the torque limit, as if all fuel ignited."""
    torque = rack_torque(plant, engine_speed, fuel_rack)
    limit = torque_limit(plant, engine_speed)
    return where(torque.real > limit.real, limit, torque)


@compiled
def diesel_torque(plant: Record, engine_speed: Real, fuel_rack: Real) -> Real:
    """Return the steady brake torque M_b [N m] below the torque limit, at any speed of either sign."""
    torque = _limited_torque(plant, engine_speed, fuel_rack)
    no_fuel = rack_torque(plant, modulus(engine_speed), 0.0)
    return low_speed_torque(plant, engine_speed, fuel_rack, torque, no_fuel)


@compiled
def _ceiling(lag: float, limit: float, rise: float, followed: Real, torque: Real) -> Real:
    """Return a torque [N m] below a limit that rises with the lagged share of rated power.

    The share is negative if the engine is driven; the limit falls with it, but never below 0.
    """
    if lag.real > 0.0:
        highest = limit + rise * followed
        highest = where(highest.real < 0.0, 0.0 * highest, highest)
        torque = where(torque.real > highest.real, highest, torque)
    return torque


class DieselOutput(NamedTuple):
    """Outputs of a diesel at one instant."""

    brake_torque: Real  # M_b [N m]
    brake_torque_rate: Real  # rate of the torque with a lag [N m/s]
    charge_rate: Real  # of the charge air [1/s]
    warmth_rate: Real  # of the engine's warmth [1/s]


@compiled
def drive_diesel(
    plant: Record, engine_speed: Real, fuel_rack: Real, lagged: Real, charge: Real, warmth: Real
) -> DieselOutput:
    """Return the brake torque M_b, and the rates of the lag states, at omega_e [rad/s] and X [mm].

    ``lagged`` is the brake torque state [N m] as if all fuel ignited; friction has no lag. ``charge``
    and ``warmth`` are relative to those at rated power [-]. With ``engine_lag`` 0 the torque follows the
    rack map at once, with ``charge_lag`` or ``warmth_lag`` 0 the corresponding limit is absent.
    """
    torque = _limited_torque(plant, engine_speed, fuel_rack)
    torque = _ceiling(plant.charge_lag, plant.smoke_limit, plant.smoke_limit_rise, charge, torque)
    torque = _ceiling(
        plant.warmth_lag, plant.loading_limit, plant.loading_limit_rise, warmth, torque
    )
    rate = charge_rate = warmth_rate = 0.0
    if plant.engine_lag.real > 0.0:
        rate = (torque - lagged) / plant.engine_lag
        torque = lagged
    no_fuel = rack_torque(plant, modulus(engine_speed), 0.0)
    torque = low_speed_torque(plant, engine_speed, fuel_rack, torque, no_fuel)
    if plant.charge_lag.real > 0.0 or plant.warmth_lag.real > 0.0:
        share = torque * engine_speed / plant.rated_power
        if plant.charge_lag.real > 0.0:
            charge_rate = (share - charge) / plant.charge_lag
        if plant.warmth_lag.real > 0.0:
            warmth_rate = (share - warmth) / plant.warmth_lag
    return DieselOutput(torque, rate, charge_rate, warmth_rate)
