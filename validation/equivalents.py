"""Fit the catalogue's simpler form of an effect to its true form over the course of a case.

Parameters are comparable only where both forms have the same meaning.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import scipy

from .simulator.effects import TrueEffect
from .simulator.motion import pitch_travel
from .simulator.parameters import NEUTRAL, Floats, Parameters
from .simulator.voyage import current_over

CATALOGUE_SOLIDITY = 2.073  # c Z / (D EAR) of the B-series at 0.75 R, ITTC-78's roughness


def _dry(torque: float, n: Parameters, omega: Floats) -> float:
    rise = n["stribeck_rise"] * np.exp(-((omega / n["stribeck_speed"]) ** 2))
    return float(torque * np.mean(1.0 + rise))


def _wet(slope: float, n: Parameters, omega: Floats, middle: float) -> float:
    torque = slope * np.abs(omega) ** n["wet_power"] * middle ** (1.0 - n["wet_power"])
    return float(np.sum(torque * np.abs(omega)) / np.sum(omega**2))


def _roughness(n: Parameters, table: pd.DataFrame) -> float:
    omega = table["shaft_speed_rad_s"].to_numpy()
    arriving = (1.0 - n["wake"]) * table["ship_speed_m_s"].to_numpy()
    j = arriving / (omega / (2.0 * math.pi) * n["diameter"])
    added = n["section_drag"] * n["section_torque"] * 0.45 * n["area_ratio"] * math.pi
    added = added * np.sqrt(1.0 + (j / (0.75 * math.pi)) ** 2)
    weight = omega**4
    unit = 0.25 * CATALOGUE_SOLIDITY * n["area_ratio"]
    return float(np.sum(added * weight) / np.sum(weight) / unit)


def _water(n: Parameters, table: pd.DataFrame) -> float:
    weight = np.gradient(table["shaft_speed_rad_s"].to_numpy()) ** 2
    swirl = n["water_inertia"] * (1.0 + n["water_load"] * (table["pitch_ratio"].to_numpy() - 1.2))
    return float(np.sum(swirl * weight) / np.sum(weight))


def _wake(n: Parameters, table: pd.DataFrame) -> float:
    v = table["ship_speed_m_s"].to_numpy()
    wake = n["wake_change"] * np.tanh((v - n["wake_middle"]) / n["wake_width"])
    return float(np.polyfit(v, wake, 1)[0])


def _fouling(n: Parameters, table: pd.DataFrame) -> float:
    v = np.abs(table["ship_speed_m_s"].to_numpy())
    drag = n["fouling"] * v ** n["fouling_power"] * n["fouling_speed"] ** (2.0 - n["fouling_power"])
    return float(np.sum(drag * v**2) / np.sum(v**4))


def _torque_gain(n: Parameters, table: pd.DataFrame) -> float:
    read = table["shaft_torque_N_m"].to_numpy()
    true = read / (1.0 + n["torque_scale"])
    bow = 1.0 + n["torque_scale_bow"] * (true / 2e5 - 1.0)
    return 1.0 + n["torque_scale"] * float(np.sum(bow * true**2) / np.sum(true**2))


def _log_gain(n: Parameters, table: pd.DataFrame) -> float:
    speed = table["ship_speed_m_s"].to_numpy() / (1.0 + n["log_scale"])
    bow = 1.0 + n["log_scale_bow"] * (speed / 7.0 - 1.0)
    return 1.0 + n["log_scale"] * float(np.sum(bow * speed**2) / np.sum(speed**2))


def _simple_pitch(command: Floats, n: Parameters, step: float, name: str, value: float) -> Floats:
    """Return the blade pitch of a first-order mechanism with one imperfection of the catalogue."""
    goal = np.clip(command, n["pitch_low"], n["pitch_high"])
    share = -math.expm1(-step / n["pitch_time"])
    here = blade = float(goal[0])
    track = np.empty(len(goal))
    for k, wanted in enumerate(goal.tolist()):
        track[k] = blade
        error = wanted - here
        if name == "pitch_dead_band":
            error -= min(max(error, -value), value)
        travel = error * share
        if name == "pitch_slowness":
            travel = min(max(travel, -step / value), step / value)
        here += travel
        half = 0.5 * value if name == "pitch_play" else 0.0
        blade = min(max(blade, here - half), here + half)
    return track


def _pitch_fit(name: str) -> Callable[[Parameters, pd.DataFrame], float]:
    def fit(n: Parameters, table: pd.DataFrame) -> float:
        step = float(table["time_s"].iloc[1] - table["time_s"].iloc[0]) / 2.0
        command = np.repeat(table["pitch_ratio_command"].to_numpy(), 2)
        true = pitch_travel(command, n, step)

        def misfit(log_value: float) -> float:
            simple = _simple_pitch(command, n, step, name, math.exp(log_value))
            return float(np.mean((simple - true) ** 2))

        middle = math.log(n[name])
        found = scipy.optimize.minimize_scalar(
            misfit, bounds=(middle - 1.5, middle + 1.0), method="bounded", options={"xatol": 5e-3}
        )
        value = math.exp(float(found.x))
        return 1.0 / value if name == "pitch_slowness" else value

    return fit


Form = Callable[[Parameters, pd.DataFrame], float]


def _speeds(table: pd.DataFrame) -> Floats:
    return np.asarray(table["shaft_speed_rad_s"].to_numpy())


def _drag(n: Parameters, table: pd.DataFrame) -> float:
    speeds = np.abs(_speeds(table))
    return n["turning_drag"] * float(
        np.sum(speeds ** (n["turning_power"] + 2.0)) / np.sum(speeds**4)
    )


def _bent(size: str, slope: str, column: str, middle: float, unit: float = 1.0) -> Form:
    """Return the mean of a size that changes in proportion to a signal's distance from a middle."""
    return lambda n, t: n[size] * float(np.mean(1.0 + n[slope] * (t[column] / unit - middle)))


def _drift(n: Parameters, table: pd.DataFrame) -> float:
    wave = np.sin(2.0 * math.pi * table["time_s"] / 1500.0)
    return n["torque_zero"] * float(np.mean(1.0 + n["torque_zero_drift"] * wave))


_FORMS: dict[str, tuple[tuple[str, ...], Form]] = {
    "engine-torque-lag/engine": (("lag_s",), lambda n, _: n["lag_time"]),
    "engine-dead-time/engine": (("dead_time_s",), lambda n, _: n["dead_time"]),
    "rack-rate-limit/engine": (("rack_rate_limit_mm_s", "rate_limit_mm_s"),
        lambda n, _: 1.0 / (n["rack_slowness"] * math.sqrt(n["rack_slowness_down"]))),
    "engine-derating/engine": (("derating_fraction", "fraction"),
        _bent("derating", "derating_slope", "shaft_speed_rad_s", 1.0, 10.0)),
    "coulomb-friction/engine": (("torque_N_m", "coulomb_friction_engine_side_N_m"),
        lambda n, t: _dry(n["dry_front"], n, _speeds(t))),
    "viscous-friction/engine": (("viscous_friction_engine_side_N_m_s_rad", "torque_N_m_s_rad"),
        lambda n, t: _wet(n["wet_front"], n, _speeds(t), 10.0)),
    "coulomb-friction/propeller": (("torque_N_m", "coulomb_friction_propeller_side_N_m"),
        lambda n, t: _dry(n["dry_back"], n, _speeds(t))),
    "viscous-friction/propeller": (("viscous_friction_propeller_side_N_m_s_rad", "torque_N_m_s_rad"),
        lambda n, t: _wet(n["wet_back"], n, _speeds(t), 10.0)),
    "propeller-roughness/propeller": (("roughness_drag",), _roughness),
    "entrained-water-inertia/propeller": (("entrained_inertia_kg_m2", "inertia_kg_m2"), _water),
    "inflow-lag/propeller": (("inflow_lag_s", "lag_s"),
        lambda n, t: float(np.mean(n["inflow_length"] / (0.5 + t["ship_speed_m_s"])))),
    "wake-speed-dependence/propeller": (("wake_slope_s_m",), _wake),
    "hull-fouling/hull": (("fouling_fraction", "fraction"), _fouling),
    "resistance-episode/hull": (("resistance_fraction", "fraction", "gain", "factor"),
        lambda n, _: n["episode_gain"]),
    "current/hull": (("current_m_s",),
        lambda n, t: float(current_over(n, t["time_s"].to_numpy()).mean())),
    "pitch-dead-band/pitch-actuator": (("dead_band",), _pitch_fit("pitch_dead_band")),
    "pitch-backlash/pitch-actuator": (("backlash",), _pitch_fit("pitch_play")),
    "pitch-rate-limit/pitch-actuator": (("rate_limit_per_s",), _pitch_fit("pitch_slowness")),
    "pitch-actuator-offset/pitch-actuator": (("offset", "pitch_actuator_offset"),
        _bent("pitch_shift", "pitch_shift_slope", "pitch_ratio_command", 1.1)),
    "pitch-sensor-offset/sensor": (("pitch_offset", "offset"),
        _bent("pitch_reading", "pitch_reading_slope", "pitch_ratio", 1.1)),
    "torque-sensor-bias/sensor": (("torque_bias_N_m", "bias_N_m"), _drift),
    "torque-sensor-gain/sensor": (("torque_gain", "gain"), _torque_gain),
    "torque-sensor-delay/sensor": (("torque_delay_s", "delay_s"), lambda n, _: n["torque_delay"]),
    "speed-log-gain/sensor": (("speed_log_gain", "gain"), _log_gain),
    "speed-log-lag/sensor": (("speed_log_lag_s", "lag_s"), lambda n, _: 0.5 * n["log_window"]),
    "command-dead-zone/motor": (("dead_zone_V", "command_dead_zone_V"),
        lambda n, _: n["command_gap"]),
    "coulomb-friction/motor": (("torque_N_m",),
        lambda n, t: n["rub"] + _dry(n["dry_front"], n, _speeds(t))),
    "viscous-friction/motor": (("torque_N_m_s_rad",),
        lambda n, t: _wet(n["wet_front"], n, _speeds(t), 30.0)),
    "quadratic-drag/motor": (("drag_N_m_s2_rad2", "torque_N_m_s2_rad2"), _drag),
}  # fmt: skip
"""Names that a report may give to the common parameter, and its value by the true form."""


def comparable(effect: TrueEffect) -> bool:
    """Return whether an effect has a parameter in common with the catalogue's form."""
    return effect.key in _FORMS


def names_of(effect: TrueEffect) -> tuple[str, ...]:
    """Return the names of the common parameter of a :func:`comparable` effect in a report."""
    return _FORMS[effect.key][0]


def equivalent(effect: TrueEffect, numbers: Parameters, measurements: pd.DataFrame) -> Any:
    """Return the comparable parameter of the catalogue's form; None where there is none.

    Args:
        effect: concealed effect.
        numbers: parameters of the true ship.
        measurements: noise-free measurements of the case.

    Returns:
        ``{"names": [...], "value": ..., "neutral": ...}``: names in a report, the first that of the ship
        file's key, the value with the effect, and the value without it.
    """
    if not comparable(effect) or numbers[effect.size] == NEUTRAL[effect.size]:
        return None
    names, form = _FORMS[effect.key]
    # The ship file of the thruster has some friction.
    absent = {
        "torque-sensor-gain/sensor": 1.0,
        "speed-log-gain/sensor": 1.0,
        "coulomb-friction/motor": numbers["rub"],
    }
    neutral = absent.get(effect.key, 0.0)
    return {"names": list(names), "value": float(form(numbers, measurements)), "neutral": neutral}
