"""Parameters of the true ship: those of the ship file within tolerances, and those of effects.

Only data files of the plant are read; none of its code is used.
"""

from __future__ import annotations

import functools
import math
import tomllib
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Parameters = dict[str, float]
"""All parameters by name; those of absent effects are neutral."""

J_TERMS, PITCH_TERMS = 4, 7
CURVE = (J_TERMS, PITCH_TERMS)

NEUTRAL: Parameters = {
    # engine: second-order lag, loss of torque that grows with speed, bend of the map
    "lag_time": 0.0, "lag_damping": 0.9, "derating": 0.0, "derating_slope": 0.0,
    "bend": 0.0, "bend_speed": 75.0, "bend_skew": 0.0,
    # shaft: Stribeck friction and nearly linear drag on both sides of the shaft torque meter
    "dry_front": 0.0, "dry_back": 0.0, "stribeck_rise": 0.0, "stribeck_speed": 4.0,
    "wet_front": 0.0, "wet_back": 0.0, "wet_power": 1.0,
    # propeller
    "section_drag": 0.0, "section_thrust": 0.25, "section_torque": 0.27,
    "water_inertia": 0.0, "water_load": 0.0,
    "air_torque": 0.0, "air_thrust_ratio": 1.1, "air_submergence": 1.0, "air_width": 0.08,
    "air_growth": 0.5, "air_washout": 2.0,
    "inflow_length": 0.0, "wake_change": 0.0, "wake_middle": 7.0, "wake_width": 2.5,
    "breakdown": 0.0, "breakdown_sigma": 2.0, "breakdown_torque": 0.7,
    # hull
    "fouling": 0.0, "fouling_power": 2.0, "fouling_speed": 7.0,
    # effects that are in no catalogue
    "shallow_rise": 0.0, "shallow_speed": 7.0, "bearing_heat": 0.0, "bearing_time": 300.0,
    "order_torque": 0.0, "order_ratio": 0.13, "limiter_cut": 0.0, "limiter_line": 2.4,
    # prescribed over time: a resistance episode, current, shaft generator, air, rudder, wind
    "episode_gain": 0.0, "episode_start": 0.4, "episode_end": 0.7, "episode_edge": 15.0,
    "current": 0.0, "current_swing": 0.0, "current_period": 900.0, "current_phase": 0.0,
    "generator_torque": 0.0, "generator_start": 0.3, "generator_end": 0.6,
    "bubbles": 0.0, "bubbles_period": 60.0, "bubbles_share": 0.3,
    "rudder": 0.0, "rudder_period": 40.0, "wind": 0.0, "track_speed": 0.0,
    # actuators
    "dead_time": 0.0, "dead_time_jitter": 0.0, "rack_slowness": 0.0, "rack_slowness_down": 0.85,
    "pitch_dead_band": 0.0, "pitch_dead_band_stop": 0.6, "pitch_play": 0.0, "pitch_play_round": 0.15,
    "pitch_slowness": 0.0, "pitch_shift": 0.0, "pitch_shift_slope": 0.0,
    # instruments
    "pitch_reading": 0.0, "pitch_reading_slope": 0.0, "torque_zero": 0.0, "torque_zero_drift": 0.0,
    "torque_scale": 0.0, "torque_scale_bow": 0.0, "torque_delay": 0.0, "torque_filter": 0.3,
    "log_scale": 0.0, "log_scale_bow": 0.0, "log_window": 0.0,
    "encoder_noise": 0.0, "gauge_noise": 0.0, "pitch_noise": 0.0, "log_noise": 0.0,
    "current_noise": 0.0, "depth_noise": 0.05, "thrust_noise": 0.01, "rounding": 0.0,
    # bench
    "command_gap": 0.0, "command_gap_round": 0.15, "turning_drag": 0.0, "turning_power": 2.0,
    "astern_change": 0.0, "astern_width": 3.0, "supply_sag": 0.0, "flow_memory": 0.0,
    "flow_share": 0.25, "winding_heat": 0.0, "winding_time": 120.0, "cogging": 0.0,
}  # fmt: skip
"""Parameters of effects and instruments at the values at which they are absent."""


@functools.cache
def ship_file(name: str) -> dict[str, Any]:
    """Return the TOML tables of a preset."""
    path = resources.files("shaftline.plant").joinpath(f"ships/{name}.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


@functools.cache
def open_water_curve(curve: str, blades: int, area_ratio: float) -> Floats:
    """Return the polynomial of one propeller: entry [s, t] multiplies J^s (P/D)^t."""
    table = np.zeros(CURVE)
    with resources.files("shaftline.plant").joinpath("data/b_series_polynomials.csv").open() as f:
        terms = pd.read_csv(f)
    for row in terms[terms["curve"] == curve].to_dict("records"):
        weight = area_ratio ** row["expanded_area_ratio_power"] * blades ** row["blades_power"]
        place = int(row["j_power"]), int(row["pitch_ratio_power"])
        table[place] += float(row["coefficient"]) * float(weight)
    return table


def frigate_parameters(**changes: float) -> Parameters:
    """Return the parameters of the frigate; ``resistance=1.01`` is a factor on that of the ship file."""
    file = ship_file("frigate")
    hull, screw, engine = file["hull"], file["propeller"], file["prime_mover"]
    line = file["transmission"]
    numbers = {
        "density": file["water"]["density_kg_m3"], "mass": hull["mass_kg"],
        "resistance": hull["resistance_coefficient_N_s2_m2"], "deduction": hull["thrust_deduction"],
        "wake": hull["wake_fraction"], "screws": hull["propellers"], "diameter": screw["diameter_m"],
        "rotative": screw["relative_rotative_efficiency"], "depth": screw["depth_m"],
        "pitch_low": screw["pitch_ratio_min"], "pitch_high": screw["pitch_ratio_max"],
        "area_ratio": screw["expanded_area_ratio"], "blades": screw["blades"],
        "map_speed": engine["torque_per_speed_N_m_s_rad"],
        "map_rack": engine["torque_per_rack_N_m_mm"], "map_zero": engine["torque_offset_N_m"],
        "rack_high": engine["rack_max_mm"], "limit_low": engine["torque_limit_at_min_speed_N_m"],
        "limit_slope": engine["torque_limit_slope_N_m_s_rad"], "limit_high": engine["torque_limit_N_m"],
        "idle": engine["speed_min_rpm"] * (math.pi / 30.0), "gear": line["gear_ratio"],
        "efficiency": line["efficiency"], "inertia_front": line["inertia_engine_side_kg_m2"],
        "inertia_back": line["inertia_propeller_side_kg_m2"],
        "pitch_time": file["pitch_actuator"]["time_constant_s"], "kt_scale": 1.0, "rub": 0.0,
    }  # fmt: skip
    for name, factor in changes.items():
        numbers[name] *= factor
    return {name: float(value) for name, value in numbers.items()} | NEUTRAL


TRUE_SHIP = np.dtype(
    [(name, np.float64) for name in frigate_parameters()]
    + [("kt", np.float64, CURVE), ("kq", np.float64, CURVE)],
    align=True,
)


def as_record(numbers: Parameters) -> NDArray[Any]:
    """Return the parameters for the compiled equations: an array of one TRUE_SHIP record."""
    ship = np.zeros(1, TRUE_SHIP)
    for name, value in numbers.items():
        ship[name] = value
    blades, area = round(numbers["blades"]), numbers["area_ratio"]
    ship["kt"], ship["kq"] = (open_water_curve(curve, blades, area) for curve in ("KT", "KQ"))
    ship["kt"] *= numbers["kt_scale"]
    return ship
