from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftline.plant import Ship, equilibrium, load_ship
from shaftline.plant.fuel import fuel_rate, specific_consumption

FRIGATE, FERRY = load_ship("frigate"), load_ship("ferry")
FULL = 202.0 * 3.979e6 * 1e-3 / 3.6e6  # kg/s of rated power at the base consumption

# docs/fuel.md: share of power, share of speed, consumption [g/kWh] at a base of 202
STATED = [
    (1.0, 1.0, 208),
    (0.85, 0.947, 203),
    (0.75, 0.909, 202),
    (0.5, 0.794, 208),
    (0.25, 0.63, 228),
    (0.1, 0.464, 270),
    (0.75, 1.0, 211),
    (0.5, 1.0, 224),
    (0.25, 1.0, 262),
    (0.1, 1.0, 370),
    (0.75, 0.80, 206),
    (0.5, 0.65, 214),
    (0.85, 0.85, 205),
    (0.35, 0.5, 230),
    (0.2, 0.4, 245),
    (0.25, 0.8, 240),
]

SURFACE = {
    "p0_s1": 0.03,
    "p0_s2": 0.05,
    "p1_s0": 1.6,
    "p1_s1": -1.5,
    "p1_s2": 1.1,
    "p2_s0": 0.07,
    "p2_s1": -0.4,
    "p3_s0": 0.3,
    "p1_s3": 0.4,
    "p2_s2": -0.2,
    "p2_s3": 0.15,
    "p3_s1": 0.25,
    "p3_s2": -0.35,
    "p3_s3": 0.12,
}
"""A coefficient for each power of power (p) and speed (s)."""


def operating(ship: Ship, power: float, speed: float) -> tuple[float, float]:
    """Engine speed [rad/s] and torque [N m] at shares of rated power and speed."""
    plant = ship.record()
    engine_speed = speed * float(plant["engine_speed_max"])
    return engine_speed, power * float(plant["fuel_rated_power"]) / engine_speed


@pytest.mark.parametrize(("power", "speed"), [(1.0, 1.0), (0.6, 0.9), (0.2, 0.4)])
def test_surface_is_its_polynomial(plant: Any, power: float, speed: float) -> None:
    for name, value in SURFACE.items():
        plant[f"fuel_{name}"] = value
    share = sum(c * power ** int(name[1]) * speed ** int(name[-1]) for name, c in SURFACE.items())
    found = fuel_rate(plant, *operating(FRIGATE, power, speed))
    assert found == pytest.approx(FULL * share, rel=1e-12)
    consumption = specific_consumption(plant, *operating(FRIGATE, power, speed))
    assert consumption == pytest.approx(202.0 * share / power, rel=1e-12)


def test_overrun_engine_follows_the_slope_in_power_alone(plant: Any) -> None:
    """At a share of -0.01 of the power: no term in its square or cube."""
    for name, value in SURFACE.items():
        plant[f"fuel_{name}"] = value
    straight = sum(
        c * (-0.01) ** int(n[1]) * 0.8 ** int(n[-1]) for n, c in SURFACE.items() if int(n[1]) < 2
    )
    found = fuel_rate(plant, *operating(FRIGATE, -0.01, 0.8))
    assert found == pytest.approx(FULL * straight, rel=1e-12)
    assert fuel_rate(plant, *operating(FRIGATE, -0.5, 0.8)) == 0.0


@pytest.mark.parametrize("engine_speed", [0.0, -50.0])
def test_engine_that_stands_or_turns_astern_burns_nothing(plant: Any, engine_speed: float) -> None:
    assert fuel_rate(plant, engine_speed, 2e4) == 0.0
    assert fuel_rate(plant, 1e-3, 2e4) > 0.0


@pytest.mark.parametrize(("power", "speed", "stated"), STATED)
def test_surface_meets_the_stated_points(power: float, speed: float, stated: float) -> None:
    found = specific_consumption(FRIGATE.record(), *operating(FRIGATE, power, speed))
    assert found == pytest.approx(stated, rel=0.014)
    small = specific_consumption(FERRY.record(), *operating(FERRY, power, speed))
    assert small == pytest.approx(found * 215.0 / 202.0, rel=1e-12)


@pytest.mark.parametrize(("speed", "share"), [(0.4, 0.020), (0.7, 0.042), (1.0, 0.080)])
def test_idling_costs_fuel(plant: Any, speed: float, share: float) -> None:
    engine_speed = speed * float(plant["engine_speed_max"])
    assert fuel_rate(plant, engine_speed, 0.0) == pytest.approx(share * FULL, abs=0.003 * FULL)


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


def test_without_a_base_there_is_no_fuel_model(plant: Any) -> None:
    assert fuel_rate(load_ship("tito-neri-sine").record(), 100.0, 10.0) == 0.0
    plant["fuel_base"] = 0.5  # any base above 0 is one
    assert fuel_rate(plant, *operating(FRIGATE, 1.0, 1.0)) > 0.0


@pytest.mark.parametrize("torque", [0.0, -10.0])
def test_without_power_there_is_no_consumption_per_power(plant: Any, torque: float) -> None:
    assert math.isnan(specific_consumption(plant, 50.0, torque))
    assert specific_consumption(plant, 50.0, 0.1) > 0.0


def test_ferry_reaches_thirteen_knots_at_full_power() -> None:
    found = equilibrium(FERRY, FERRY.diesel.rack_max_mm, 0.705)
    engine_speed = 3.5 * found.state.shaft_speed
    assert found.state.ship_speed == pytest.approx(13 * 0.514444, rel=0.005)
    assert engine_speed * 30 / math.pi == pytest.approx(2200, rel=0.005)
    assert engine_speed * found.outputs.brake_torque == pytest.approx(100e3, rel=0.005)
