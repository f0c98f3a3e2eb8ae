from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.plant.signals import CONTROL_SIGNALS, RECORDED_SIGNALS, SAMPLE, SIGNALS, get_signal

EVERY = (*SIGNALS, *CONTROL_SIGNALS, *RECORDED_SIGNALS)

BOUNDS = {
    "time_s": (0, math.inf), "position_m": (-math.inf, math.inf),
    "shaft_angle_rad": (-math.inf, math.inf), "ventilation": (0, 1),
    "estimate_valid": (0, 1), "shaft_acceleration_rad_s2": (-1e7, 1e7),
    "advance_velocity_m_s": (-200, 200), "inflow_velocity_m_s": (-200, 200),
    "motor_current_A": (-1e5, 1e5),
    "thrust_N": (-1e8, 1e8), "resistance_N": (-1e9, 1e9), "fuel_flow_kg_s": (0, 100),
    "propeller_submergence_m": (-30, 60), "fuel_rack_mm": (0, 200), "fuel_rack_position_mm": (0, 200),
    "pitch_ratio_command": (-1.6, 1.6), "true_pitch_ratio": (-2.1, 2.1), "pitch_ratio": (-2.6, 2.6),
    "rudder_command_rad": (-1.6, 1.6), "rudder_rad": (-1.6, 1.6), "yaw_rate_rad_s": (-10, 10),
    "roll_rad": (-math.pi, math.pi), "roll_rate_rad_s": (-10, 10),
    "heading_rad": (-math.inf, math.inf), "cross_track_m": (-math.inf, math.inf),
    "heading_order_rad": (-math.inf, math.inf), "cross_track_order_m": (-math.inf, math.inf),
    "speed_error_m_s": (-80, 80), "estimated_angle_of_attack_deg": (-180, 180),
    "angle_of_attack_deviation_deg": (-180, 180), "heading_error_rad": (-math.pi, math.pi),
    "track_error_m": (-math.inf, math.inf), "fuel_rack_command_mm": (0, 200),
    "base_fuel_rack_command_mm": (0, 200), "base_pitch_ratio_command": (-1.6, 1.6),
    "base_rudder_command_rad": (-1.6, 1.6), "wind_speed_m_s": (0, 80), "true_wind_speed_m_s": (0, 80),
    "wind_height_m": (0, 200), "draught_fore_m": (0, 40), "draught_aft_m": (0, 40),
    "nox_g_s": (0, 1e4), "co2_kg_s": (0, 400),
    "water_depth_m": (0.5, 12000), "water_temperature_C": (-3, 40),
    **dict.fromkeys(("course_over_ground_rad", "wind_angle_rad", "true_wind_angle_rad"), (-7, 7)),
}  # fmt: skip
"""Beyond what any ship reaches; ships move within 40 m/s, torques are within 1e8 N m."""


@pytest.mark.parametrize("signal", EVERY, ids=lambda signal: signal.name)
def test_bounds_hold_any_ship_and_no_slip_of_unit(signal: object) -> None:
    by_unit = {
        "m/s": (-40, 40),
        "N m": (-1e8, 1e8),
        "rad/s": (-1e4, 1e4),
        "W": (-1e9, 1e9),
        "N": (-1e8, 1e8),
        "A": (-1e5, 1e5),
    }
    bounds = BOUNDS.get(signal.column) or by_unit[signal.unit]  # type: ignore[attr-defined]
    assert (signal.low, signal.high) == bounds  # type: ignore[attr-defined]


def test_pitch_bounds_leave_room_for_offsets() -> None:
    """A command of 1.6 at most, half of it as the actuator's offset, half as the sensor's."""
    low, true, read = (
        BOUNDS[c][1] for c in ("pitch_ratio_command", "true_pitch_ratio", "pitch_ratio")
    )
    assert true - low == pytest.approx(read - true) == pytest.approx(0.5)


def test_no_two_signals_share_a_name() -> None:
    assert len({signal.name for signal in EVERY}) == len(EVERY)
    columns = [signal.column for signal in EVERY]
    assert len(set(columns)) == len(columns)


def test_samples_hold_the_plants_signals_as_floats() -> None:
    assert SAMPLE.names == tuple(signal.name for signal in SIGNALS)
    assert {SAMPLE[name] for name in SAMPLE.names} == {np.dtype(np.float64)}


def test_a_signal_is_found_by_name() -> None:
    for signal in (*SIGNALS, *CONTROL_SIGNALS):
        assert get_signal(signal.name) is signal
    with pytest.raises(KeyError, match="rpm"):
        get_signal("rpm")
