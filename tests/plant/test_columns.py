from __future__ import annotations

import pytest

from shaftline.plant import Ship, load_ship, ship_names
from shaftline.plant.columns import (
    ALWAYS_SIMULATED,
    BOUNDS,
    COLUMNS,
    DEMANDS,
    MEASURED,
    TURNING_COLUMNS,
    drive_column,
    input_columns,
    signal_columns,
)
from shaftline.plant.signals import SAMPLE, get_signal

MEASURED_ON_ANY_SHIP = ("pitch_ratio", "shaft_speed_rad_s", "shaft_torque_N_m", "ship_speed_m_s")


def test_a_ship_is_driven_by_time_its_demand_and_its_pitch(frigate: Ship) -> None:
    assert input_columns(frigate) == ["time_s", "fuel_rack_mm", "pitch_ratio_command"]
    assert drive_column(frigate) == "fuel_rack_mm"
    tug = load_ship("tito-neri-sine")
    assert input_columns(tug) == ["time_s", "motor_voltage_V"]
    assert drive_column(tug) == "motor_voltage_V"


@pytest.mark.parametrize("name", ship_names())
def test_what_a_ship_is_simulated_to_can_drive_her_again(name: str) -> None:
    ship = load_ship(name)
    found = signal_columns(ship)
    assert {*input_columns(ship)} <= set(found)
    assert len({*found.values()}) == len(found)
    others = {demand.column for demand in DEMANDS} - {drive_column(ship), "shaft_speed_rad_s"}
    assert not others & set(found)


def test_a_ship_has_no_columns_of_what_she_lacks(frigate: Ship) -> None:
    assert not {*TURNING_COLUMNS, "rudder_command_rad", "motor_current_A"} & set(
        signal_columns(frigate)
    )
    assert "motor_current_A" in signal_columns(load_ship("tito-neri-sine"))
    led = signal_columns(load_ship("esso-osaka"))
    assert led["shaft_speed_rad_s"] == "measured_shaft_speed"
    assert {"rudder_command_rad", *TURNING_COLUMNS} <= set(led)
    assert "pitch_ratio_command" not in led


def test_every_column_is_understood_once() -> None:
    assert len(set(COLUMNS)) == len(COLUMNS)
    assert set(COLUMNS) <= set(BOUNDS)
    assert COLUMNS[:4] == ("time_s", "fuel_rack_mm", "motor_voltage_V", "motor_torque_N_m")
    assert {demand.column for demand in DEMANDS} <= set(COLUMNS)


def test_bounds_are_those_of_the_signals() -> None:
    assert BOUNDS["fuel_rack_mm"] == (0, 200, "mm")
    assert BOUNDS["motor_voltage_V"] == (-1e5, 1e5, "V")
    assert BOUNDS["fuel_flow_kg_s"] == (0, 100, "kg/s")
    assert BOUNDS["shaft_torque_N_m"] == (-1e8, 1e8, "N m")


def test_each_measured_column_has_the_signal_that_answers_it() -> None:
    for column, name in MEASURED.items():
        assert name in (SAMPLE.names or ())
        assert get_signal(name).column == column
    assert tuple(MEASURED) == (
        *MEASURED_ON_ANY_SHIP,
        "thrust_N",
        "motor_current_A",
        "shaft_power_W",
        "electric_power_W",
        "shaft_angle_rad",
        *TURNING_COLUMNS,
    )
    assert TURNING_COLUMNS == ("sway_speed_m_s", "yaw_rate_rad_s", "heading_rad", "rudder_rad")
    assert ALWAYS_SIMULATED == MEASURED_ON_ANY_SHIP
