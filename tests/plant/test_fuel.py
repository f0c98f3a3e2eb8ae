from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import Ship, ShipError, equilibrium, load_ship
from shaftline.plant.cavitation import burrill_limit, burrill_ratio
from shaftline.plant.drives.diesel import rack_of_torque, rack_torque
from shaftline.plant.fuel import fuel_rate, specific_consumption

FRIGATE, FERRY = load_ship("frigate"), load_ship("ferry")

# docs/fuel.md: share of power, share of speed, consumption [g/kWh] at a base of 202
STATED = [
    (1.0, 1.0, 208), (0.85, 0.947, 203), (0.75, 0.909, 202), (0.5, 0.794, 208), (0.25, 0.63, 228),
    (0.1, 0.464, 270), (0.75, 1.0, 211), (0.5, 1.0, 224), (0.25, 1.0, 262), (0.1, 1.0, 370),
    (0.75, 0.80, 206), (0.5, 0.65, 214), (0.85, 0.85, 205), (0.35, 0.5, 230), (0.2, 0.4, 245),
    (0.25, 0.8, 240),
]  # fmt: skip


def operating(ship: Ship, power: float, speed: float) -> tuple[float, float]:
    """Engine speed [rad/s] and torque [N m] at shares of rated power and speed."""
    plant = ship.record()
    engine_speed = speed * float(plant["engine_speed_max"])
    return engine_speed, power * float(plant["fuel_rated_power"]) / engine_speed


@pytest.mark.parametrize(("power", "speed", "stated"), STATED)
def test_surface_meets_the_stated_points(power: float, speed: float, stated: float) -> None:
    found = specific_consumption(FRIGATE.record(), *operating(FRIGATE, power, speed))
    assert found == pytest.approx(stated, rel=0.014)
    small = specific_consumption(FERRY.record(), *operating(FERRY, power, speed))
    assert small == pytest.approx(found * 215.0 / 202.0, rel=1e-12)


@pytest.mark.parametrize(("speed", "share"), [(0.4, 0.020), (0.7, 0.042), (1.0, 0.080)])
def test_idling_costs_fuel(speed: float, share: float) -> None:
    full = 202.0 * 3.979e6 * 1e-3 / 3.6e6
    engine_speed = speed * float(FRIGATE.record()["engine_speed_max"])
    assert fuel_rate(FRIGATE.record(), engine_speed, 0.0) == pytest.approx(
        share * full, abs=0.003 * full
    )


@given(st.floats(-200, 400), st.floats(-2e5, 2e5))
def test_fuel_is_finite_and_never_negative(engine_speed: float, torque: float) -> None:
    rate = fuel_rate(FRIGATE.record(), engine_speed, torque)
    assert math.isfinite(rate)
    assert rate >= 0.0


@given(st.floats(0.35, 1.05), st.floats(0.0, 1.0), st.floats(0.01, 0.1))
def test_more_torque_burns_more(speed: float, share: float, more: float) -> None:
    plant = FRIGATE.record()
    engine_speed = speed * float(plant["engine_speed_max"])
    low, high = (fuel_rate(plant, engine_speed, x * 38000.0) for x in (share, share + more))
    assert high > low


def test_without_a_base_there_is_no_fuel_model() -> None:
    assert fuel_rate(load_ship("tito-neri-sine").record(), 100.0, 10.0) == 0.0
    assert math.isnan(specific_consumption(FRIGATE.record(), 50.0, 0.0))


def test_a_base_needs_a_rated_power() -> None:
    tree = FERRY.model_dump(exclude_unset=True)
    del tree["prime_mover"]["fuel_rated_power_W"]
    with pytest.raises(ValueError, match="fuel_rated_power_W is missing"):
        Ship.model_validate(tree)
    with pytest.raises(ShipError, match="fuel_base_g_kWh"):
        FERRY.with_values({"prime_mover.fuel_base_g_kWh": -1.0})


def test_rack_of_torque_inverts_the_rack_map() -> None:
    plant = FRIGATE.with_values({"prime_mover.derating_fraction": 0.1}).record()
    for speed, rack in ((40.0, 10.0), (100.0, 35.0)):
        assert rack_of_torque(plant, speed, rack_torque(plant, speed, rack)) == pytest.approx(rack)


def test_ferry_reaches_thirteen_knots_at_full_power() -> None:
    found = equilibrium(FERRY, FERRY.prime_mover.rack_max_mm, 0.705)  # type: ignore[union-attr]
    engine_speed = 3.5 * found.state.shaft_speed
    assert found.state.ship_speed == pytest.approx(13 * 0.514444, rel=0.005)
    assert engine_speed * 30 / math.pi == pytest.approx(2200, rel=0.005)
    assert engine_speed * found.outputs.brake_torque == pytest.approx(100e3, rel=0.005)


@pytest.mark.parametrize("pitch", [0.4, 0.7, 1.0, 1.2])
@pytest.mark.parametrize("rack", [8.0, 16.0, 24.0, 32.0])
def test_ferry_has_steady_states_over_its_range(rack: float, pitch: float) -> None:
    assert equilibrium(FERRY, rack, pitch).state.ship_speed > 0.5


def test_burrill_limit_at_read_points() -> None:
    # 0.28 (sigma - 0.03)^0.57, by hand
    for sigma, limit in ((0.2, 0.1020), (0.5, 0.1821), (1.0, 0.2752)):
        assert burrill_limit(sigma) == pytest.approx(limit, abs=2e-4)


def test_burrill_ratio_by_hand() -> None:
    plant = FRIGATE.record()
    square = 8.0**2 + (0.7 * math.pi * 2.0 * 4.2) ** 2
    dynamic = 0.5 * 1025 * square
    area = 0.9 * math.pi / 4 * 4.2**2 * (1.067 - 0.229 * 1.2)
    sigma = (101325 - 1671 + 1025 * 9.81 * 4.0) / dynamic
    expected = 2e5 / (dynamic * area) / (0.28 * (sigma - 0.03) ** 0.57)
    found = burrill_ratio(plant, 2e5, 8.0, 4.0 * math.pi, 1.2, 4.0)
    assert found == pytest.approx(expected, rel=1e-12)


def test_burrill_ratio_behaves() -> None:
    plant = FRIGATE.record()
    shallow, deep = (burrill_ratio(plant, 2e5, 8.0, 12.0, 1.2, h) for h in (1.0, 8.0))
    assert shallow > deep > 0.0
    assert burrill_ratio(plant, 0.0, 0.0, 0.0, 1.0, 4.0) == 0.0
    assert burrill_ratio(plant, -1e5, 5.0, 10.0, 1.0, 4.0) == 0.0
    assert np.isfinite(burrill_ratio(plant, 1e7, 0.0, 0.5, 1.4, -30.0))
