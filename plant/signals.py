"""Registry of signals: name, symbol, unit, bounds, source and recording column of each quantity.

The column names of recordings, the dtype of simulated samples and the table in the documentation are
derived from it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np


class Signal(NamedTuple):
    """One quantity of the plant or of its controllers."""

    name: str
    symbol: str
    unit: str
    low: float
    high: float
    source: str  # demand, sensor, observer, clock or truth
    column: str  # name in recordings
    description: str


SIGNALS = (
    Signal("time", "t", "s", 0, math.inf, "clock", "time_s", "time"),
    Signal("drive", "X", "mm", 0, 200, "demand", "fuel_rack_mm",
           "command to the prime mover: fuel rack, or voltage [V], or torque [N m]"),
    Signal("pitch_command", "P/D_d", "-", -1.6, 1.6, "demand", "pitch_ratio_command",
           "commanded pitch ratio"),
    Signal("pitch_ratio", "P/D", "-", -2.1, 2.1, "truth", "true_pitch_ratio", "blade pitch ratio"),
    Signal("shaft_speed", "omega", "rad/s", -1e4, 1e4, "truth", "true_shaft_speed_rad_s",
           "speed of the propeller shaft"),
    Signal("shaft_torque", "M_m", "N m", -1e8, 1e8, "truth", "true_shaft_torque_N_m",
           "torque at the shaft torque meter, between I_L and I_R"),
    Signal("ship_speed", "v_s", "m/s", -40, 40, "truth", "true_ship_speed_m_s", "speed over ground"),
    Signal("measured_shaft_speed", "omega", "rad/s", -1e4, 1e4, "sensor", "shaft_speed_rad_s",
           "measurement of the shaft speed sensor"),
    Signal("measured_pitch_ratio", "P/D", "-", -2.6, 2.6, "sensor", "pitch_ratio",
           "measurement of the pitch sensor"),
    Signal("measured_shaft_torque", "M_m", "N m", -1e8, 1e8, "sensor", "shaft_torque_N_m",
           "measurement of the shaft torque meter"),
    Signal("measured_ship_speed", "v_s", "m/s", -40, 40, "sensor", "ship_speed_m_s",
           "measurement of the speed log"),
    Signal("measured_thrust", "T", "N", -1e8, 1e8, "sensor", "thrust_N",
           "measurement of the thrust sensor of one propeller"),
    Signal("measured_motor_current", "i_a", "A", -1e5, 1e5, "sensor", "motor_current_A",
           "measurement of the armature current sensor"),
    Signal("shaft_acceleration", "omega'", "rad/s2", -1e7, 1e7, "truth",
           "shaft_acceleration_rad_s2", "acceleration of the propeller shaft"),
    Signal("advance_velocity", "v_a", "m/s", -200, 200, "truth", "advance_velocity_m_s",
           "axial speed of the fluid through the propeller disc"),
    Signal("thrust", "T", "N", -1e8, 1e8, "truth", "true_thrust_N", "thrust of one propeller"),
    Signal("propeller_torque", "M_p", "N m", -1e8, 1e8, "truth", "propeller_torque_N_m",
           "torque of the propeller"),
    Signal("brake_torque", "M_b", "N m", -1e8, 1e8, "truth", "brake_torque_N_m",
           "torque of the prime mover"),
    Signal("resistance", "R", "N", -1e9, 1e9, "truth", "resistance_N", "resistance of the hull"),
    Signal("motor_current", "i_a", "A", -1e5, 1e5, "truth", "true_motor_current_A", "armature current"),
    Signal("shaft_power", "P_s", "W", -1e9, 1e9, "sensor", "shaft_power_W",
           "measured shaft torque times measured shaft speed"),
    Signal("electric_power", "P_el", "W", -1e9, 1e9, "sensor", "electric_power_W",
           "electric power that the drive takes from its supply"),
    Signal("submergence", "h", "m", -30, 60, "truth", "propeller_submergence_m",
           "depth of the propeller's centre below the surface"),
    Signal("ventilation", "alpha", "-", 0, 1, "truth", "ventilation", "degree of ventilation"),
    Signal("position", "x", "m", -math.inf, math.inf, "truth", "position_m", "distance along the track"),
    Signal("shaft_angle", "theta", "rad", -math.inf, math.inf, "sensor", "shaft_angle_rad",
           "angle turned by the propeller shaft, not reset after a turn"),
    Signal("rudder_command", "delta_d", "rad", -1.6, 1.6, "demand", "rudder_command_rad",
           "commanded rudder angle, positive turns to starboard"),
    Signal("rudder_angle", "delta", "rad", -1.6, 1.6, "sensor", "rudder_rad", "rudder angle"),
    Signal("sway_speed", "v", "m/s", -40, 40, "sensor", "sway_speed_m_s",
           "speed of midship to starboard, over ground"),
    Signal("yaw_rate", "r", "rad/s", -10, 10, "sensor", "yaw_rate_rad_s",
           "rate of turn, positive to starboard"),
    Signal("heading", "psi", "rad", -math.inf, math.inf, "sensor", "heading_rad",
           "heading to starboard of the initial course, not reset after a turn"),
    Signal("cross_track", "y", "m", -math.inf, math.inf, "truth", "cross_track_m",
           "distance to starboard of the initial course"),
    Signal("roll_angle", "phi", "rad", -math.pi, math.pi, "sensor", "roll_rad",
           "roll angle, positive with starboard down"),
    Signal("roll_rate", "p", "rad/s", -10, 10, "sensor", "roll_rate_rad_s",
           "rate of roll, positive to starboard"),
    Signal("nox", "m_NOx", "g/s", 0, 1e4, "truth", "nox_g_s", "NOx flow of the engines"),
    Signal("co2", "m_CO2", "kg/s", 0, 400, "truth", "co2_kg_s", "CO2 flow of the engines"),
)  # fmt: skip

CONTROL_SIGNALS = (
    Signal("speed_order", "v_d", "m/s", -40, 40, "demand", "speed_order_m_s",
           "set-point of the ship speed"),
    Signal("heading_order", "psi_d", "rad", -math.inf, math.inf, "demand", "heading_order_rad",
           "set-point of the heading, to starboard of the initial course"),
    Signal("cross_track_order", "y_d", "m", -math.inf, math.inf, "demand", "cross_track_order_m",
           "set-point of the cross track, to starboard of the initial course"),
    Signal("fuel_rack", "X", "mm", 0, 200, "sensor", "fuel_rack_position_mm",
           "position of the fuel rack"),
    Signal("estimated_advance_velocity", "v_a^", "m/s", -40, 40, "observer",
           "estimated_advance_velocity_m_s", "the observer's estimate of the advance velocity"),
    Signal("estimate_valid", "-", "-", 0, 1, "observer", "estimate_valid",
           "1 if the observer declares its estimate valid"),
    *(
        Signal(f"wave_inflow_{ahead}_s", f"u_{ahead}", "m/s", -40, 40, "sensor",
               f"wave_inflow_{ahead}_s_m_s",
                f"inflow of the waves at the propellers {ahead} s ahead, from a sensor at the bow")
        for ahead in range(7)
    ),
    Signal("speed_error", "e", "m/s", -80, 80, "sensor", "speed_error_m_s",
           "set-point of the ship speed minus the measurement of the speed log"),
    Signal("shaft_torque_deviation", "dM_m", "N m", -1e8, 1e8, "sensor",
           "shaft_torque_deviation_N_m", "measured shaft torque minus its mean over 20 s"),
    Signal("engine_torque_deviation", "dM_b", "N m", -1e8, 1e8, "observer",
           "engine_torque_deviation_N_m",
           "torque of one engine by its rack map, minus its mean over 20 s"),
    Signal("estimated_angle_of_attack", "alpha^", "deg", -180, 180, "observer",
           "estimated_angle_of_attack_deg",
           "effective angle of attack of the blades at the estimated advance velocity"),
    Signal("angle_of_attack_deviation", "dalpha^", "deg", -180, 180, "observer",
           "angle_of_attack_deviation_deg", "estimated angle of attack minus its mean over 20 s"),
    Signal("heading_error", "e_psi", "rad", -math.pi, math.pi, "sensor", "heading_error_rad",
           "set-point of the heading minus measured heading, in the shorter direction"),
    Signal("track_error", "e_y", "m", -math.inf, math.inf, "sensor", "track_error_m",
           "set-point of the cross track minus measured cross track"),
    Signal("shaft_speed_command", "omega_d", "rad/s", -1e4, 1e4, "demand",
           "shaft_speed_command_rad_s", "set-point of the shaft speed governor"),
    Signal("fuel_rack_command", "X_d", "mm", 0, 200, "demand", "fuel_rack_command_mm",
           "commanded fuel rack, before the limits of idle speed, torque and maximum speed"),
    Signal("base_pitch_ratio", "P/D_0", "-", -1.6, 1.6, "demand", "base_pitch_ratio_command",
           "pitch ratio commanded by the base controller of a residual policy"),
    Signal("base_fuel_rack", "X_0", "mm", 0, 200, "demand", "base_fuel_rack_command_mm",
           "fuel rack commanded by the base controller of a residual policy"),
    Signal("base_rudder_angle", "delta_0", "rad", -1.6, 1.6, "demand", "base_rudder_command_rad",
           "rudder angle commanded by the base controller of a residual policy"),
)  # fmt: skip
"""Signals of controllers and observers, in addition to those of the plant."""

LOG_SIGNALS = (
    Signal("speed_over_ground", "v_g", "m/s", -40, 40, "sensor", "speed_over_ground_m_s",
           "speed over ground of the satellite navigation"),
    Signal("course_over_ground", "chi", "rad", -7, 7, "sensor", "course_over_ground_rad",
           "course over ground, clockwise from north"),
    Signal("wind_speed", "u_w", "m/s", 0, 80, "sensor", "wind_speed_m_s",
           "apparent wind speed, relative to the ship"),
    Signal("wind_angle", "gamma", "rad", -7, 7, "sensor", "wind_angle_rad",
           "direction from which the apparent wind comes, from ahead clockwise"),
    Signal("true_wind_speed", "u_t", "m/s", 0, 80, "sensor", "true_wind_speed_m_s",
           "true wind speed, over ground"),
    Signal("true_wind_angle", "gamma_t", "rad", -7, 7, "sensor", "true_wind_angle_rad",
           "direction from which the true wind comes, from ahead clockwise"),
    Signal("wind_height", "z", "m", 0, 200, "sensor", "wind_height_m",
           "height of the wind measurement above the water"),
    Signal("draught_fore", "T_f", "m", 0, 40, "sensor", "draught_fore_m",
           "draught at the forward perpendicular"),
    Signal("draught_aft", "T_a", "m", 0, 40, "sensor", "draught_aft_m",
           "draught at the aft perpendicular"),
    Signal("water_depth", "h", "m", 0.5, 12000, "sensor", "water_depth_m",
           "depth of the water, from the surface"),
    Signal("water_temperature", "theta_w", "degC", -3, 40, "sensor", "water_temperature_C",
           "temperature of the water"),
    Signal("fuel_flow", "m_f", "kg/s", 0, 100, "sensor", "fuel_flow_kg_s", "fuel flow of the engines"),
)  # fmt: skip
"""Signals of ships' logs that no simulation gives: surroundings, navigation, loading condition, fuel."""

RECORDED_SIGNALS = (
    *LOG_SIGNALS,
    Signal(
        "inflow_velocity",
        "v_a",
        "m/s",
        -200,
        200,
        "sensor",
        "inflow_velocity_m_s",
        "measured speed of the fluid at the propeller",
    ),
)
"""Further signals of recordings; commands to prime movers are declared in ``drives/``."""


def get_signal(name: str) -> Signal:
    """Return a signal by name; an unknown name raises a KeyError."""
    return {signal.name: signal for signal in (*SIGNALS, *CONTROL_SIGNALS)}[name]


SAMPLE: np.dtype[Any] = np.dtype([(signal.name, np.float64) for signal in SIGNALS])
"""Structured dtype of one simulated sample."""
