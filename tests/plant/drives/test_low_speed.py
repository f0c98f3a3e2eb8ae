from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import load_ship, ship_names
from shaftline.plant.drives.diesel import diesel_torque, drive_diesel, rack_torque
from shaftline.plant.drives.low_speed import (
    FIRING_SHARE,
    FULL_FIRING_SHARE,
    STICKING_SHARE,
    firing_share,
    friction_torque,
    low_speed_torque,
)

DIESELS = [name for name in ship_names() if load_ship(name).has_diesel]
STEP = 1e-30


def slope(plant: Any, engine_speed: float, rack: float) -> float:
    """Derivative of the torque with speed, by a complex step."""
    return complex(diesel_torque(plant, engine_speed + STEP * 1j, rack)).imag / STEP


@given(
    name=st.sampled_from(DIESELS),
    share=st.floats(-2.0, 2.0),
    derating=st.floats(-0.5, 0.9),
    lagged=st.floats(0.0, 1.0),
)
def test_engine_without_fuel_never_drives(
    name: str, share: float, derating: float, lagged: float
) -> None:
    plant = load_ship(name).record()
    plant["derating"] = derating
    speed = share * plant["engine_speed_min"]
    assert diesel_torque(plant, speed, 0.0) * speed <= 0.0
    # nor does an engine whose lagging torque is one of a lower speed and no fuel
    plant["engine_lag"] = 0.5
    before = rack_torque(plant, lagged * abs(speed), 0.0)
    burning = drive_diesel(plant, speed, 0.0, before, 0.0, 0.0)
    assert burning.brake_torque * speed <= 0.0


@given(name=st.sampled_from(DIESELS), rack=st.floats(0.0, 200.0), lag=st.sampled_from([0.0, 0.5]))
def test_engine_at_rest_gives_nothing_whatever_its_rack(name: str, rack: float, lag: float) -> None:
    plant = load_ship(name).record()
    plant["engine_lag"] = lag
    assert diesel_torque(plant, 0.0, rack) == 0.0
    assert drive_diesel(plant, 0.0, rack, 1e4, 0.0, 0.0).brake_torque == 0.0


@given(name=st.sampled_from(DIESELS), share=st.floats(-2.0, 1.0), rack=st.floats(0.0, 200.0))
def test_fuel_below_the_firing_speed_changes_nothing(name: str, share: float, rack: float) -> None:
    plant = load_ship(name).record()
    speed = share * FIRING_SHARE * plant["engine_speed_min"]
    assert diesel_torque(plant, speed, rack) == diesel_torque(plant, speed, 0.0)


@pytest.mark.parametrize("rack", [0.0, 7.0, 22.0])
def test_from_full_firing_on_the_map_holds_to_the_bit(plant: Any, rack: float) -> None:
    idle = float(plant["engine_speed_min"])
    for speed in (FULL_FIRING_SHARE * idle, 0.99 * idle, idle, 60.0, 104.0, 200.0):
        line = -45.5 * speed + 1428.6 * rack - 7381.0
        limit = min(15000.0 + 467.0 * (speed - idle), 38000.0)
        assert diesel_torque(plant, speed, rack) == min(line, limit)


def test_torque_and_slope_are_continuous(plant: Any) -> None:
    """At standstill, at the end of sticking, and at either end of firing."""
    idle, near = float(plant["engine_speed_min"]), 1e-7
    shares = (-STICKING_SHARE, 0.0, STICKING_SHARE, FIRING_SHARE, FULL_FIRING_SHARE)
    for joint in np.array(shares) * idle:
        for rack in (0.0, 9.0):  # inside the envelope, whose own edge is a corner
            below, above = joint - near, joint + near
            jump = diesel_torque(plant, above, rack) - diesel_torque(plant, below, rack)
            assert abs(jump) < 1e4 * 2.0 * near
            assert slope(plant, above, rack) == pytest.approx(slope(plant, below, rack), abs=0.05)


def test_friction_is_the_map_without_fuel_and_opposes_the_rotation(plant: Any) -> None:
    idle = float(plant["engine_speed_min"])
    for speed in (0.5 * idle, 0.9 * idle, 2.0 * idle):
        assert friction_torque(plant, speed, -8000.0) == -8000.0
        assert friction_torque(plant, -speed, -8000.0) == 8000.0
        assert diesel_torque(plant, -speed, 0.0) == pytest.approx(45.5 * speed + 7381.0)
    half = 0.5 * STICKING_SHARE * idle
    assert friction_torque(plant, half, -8000.0) == pytest.approx(-8000.0 * 0.6875)


def test_fuel_ignites_from_firing_speed_on(plant: Any) -> None:
    idle = float(plant["engine_speed_min"])
    assert firing_share(plant, FIRING_SHARE * idle) == 0.0
    assert firing_share(plant, FULL_FIRING_SHARE * idle) == 1.0
    speed = 0.6 * idle
    assert firing_share(plant, speed) == pytest.approx(0.5)
    fuel = diesel_torque(plant, speed, 10.0) - diesel_torque(plant, speed, 0.0)
    assert fuel == pytest.approx(0.5 * 14286.0)


def test_derivative_by_complex_step_is_that_of_the_torque(plant: Any) -> None:
    idle, step = float(plant["engine_speed_min"]), 1e-4
    plant["torque_curvature"], plant["torque_curvature_speed"] = -0.5, 60.0
    for speed in np.array([-1.3, -0.07, 0.05, 0.3, 0.6, 0.95, 1.5]) * idle:
        beside = [float(diesel_torque(plant, speed + s, 8.0)) for s in (-step, step)]
        assert slope(plant, speed, 8.0) == pytest.approx(np.diff(beside)[0] / 2.0 / step, rel=1e-5)


def test_map_that_gives_torque_at_no_rack_has_no_friction_and_vanishes_at_rest(plant: Any) -> None:
    plant["torque_offset"] = 5000.0
    idle = float(plant["engine_speed_min"])
    assert diesel_torque(plant, 0.0, 0.0) == 0.0
    assert diesel_torque(plant, -20.0, 0.0) == 0.0
    assert 0.0 < diesel_torque(plant, 0.7 * idle, 0.0) < rack_torque(plant, 0.7 * idle, 0.0)


def test_starting_air_acts_while_the_rack_is_open_and_fades_as_the_fuel_ignites(plant: Any) -> None:
    idle = float(plant["engine_speed_min"])
    plant["starting_air_torque"] = 12000.0
    assert diesel_torque(plant, 0.0, 0.0) == 0.0
    assert diesel_torque(plant, 0.0, 1.0) == 12000.0
    for speed in (-0.5 * FIRING_SHARE * idle, FIRING_SHARE * idle):
        without = low_speed_torque(plant, speed, 0.0, 0.0, -8000.0)
        assert low_speed_torque(plant, speed, 5.0, 0.0, -8000.0) == without + 12000.0
    assert low_speed_torque(plant, idle, 5.0, 3000.0, -8000.0) == 3000.0
    assert low_speed_torque(plant, -idle, 5.0, 0.0, -8000.0) == 8000.0
