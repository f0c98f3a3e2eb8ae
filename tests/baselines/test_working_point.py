"""Working point by hand, and the grid search for allowed settings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.baselines.working_point import (
    WorkingPoint,
    fit_open_water,
    robust_point,
    search,
    slack,
    speed_of_thrust,
    surface,
    working_point,
)
from shaftline.plant import load_ship
from shaftline.plant.cavitation import burrill_ratio
from shaftline.plant.emissions import nox_rate
from shaftline.plant.fuel import fuel_rate

FERRY = load_ship("ferry").with_values(
    {
        "transmission.coulomb_friction_propeller_side_N_m": 30.0,
        "transmission.viscous_friction_engine_side_N_m_s_rad": 0.4,
        "propeller.relative_rotative_efficiency": 1.02,
    }
)
FIT = fit_open_water(FERRY)
V, OMEGA, PITCH = 5.5, 55.0, 0.95


def efficiency(j: float) -> float:
    return j * surface(FIT.thrust, j, PITCH) / (2 * math.pi * surface(FIT.torque, j, PITCH))


def test_a_working_point_by_hand() -> None:
    plant, n = FERRY.record(), OMEGA / (2.0 * math.pi)
    j = V / n  # D = 1 m
    w = working_point(plant, FIT.thrust, FIT.torque, V, OMEGA, PITCH)
    thrust = surface(FIT.thrust, j, PITCH) * 1025.0 * n**2
    assert w.thrust == pytest.approx(thrust, rel=1e-12)
    propeller = surface(FIT.torque, j, PITCH) * 1025.0 * n**2 / 1.02
    brake = (propeller + 30.0 + 0.4 * OMEGA) / (3.5 * 0.97)
    engine = 3.5 * OMEGA
    limit = min(260.0 + 2.4 * (engine - 700.0 * math.pi / 30.0), 434.0)
    assert w.torque_share == pytest.approx(brake / limit, rel=1e-12)
    assert w.cost == pytest.approx(fuel_rate(plant, engine, brake), rel=1e-12)
    slope = (efficiency(j + 1e-6) - efficiency(j - 1e-6)) / 2e-6
    assert w.efficiency_slope == pytest.approx(slope, rel=1e-6)
    assert w.burrill == pytest.approx(burrill_ratio(plant, thrust, V, OMEGA, PITCH, 1.0), rel=1e-12)
    assert w.advance_room == pytest.approx(1.05 * PITCH + 0.15 - j, rel=1e-12)
    plant["fuel_base"] = 0.0  # without a fuel model the cost is the brake power
    power = working_point(plant, FIT.thrust, FIT.torque, V, OMEGA, PITCH).cost
    assert power == pytest.approx(brake * engine, rel=1e-12)


def test_nox_of_a_working_point_is_that_of_the_engine_s_map() -> None:
    ship = FERRY.with_values({"emissions.nox_base_g_kWh": 9.0, "emissions.nox_m1_s0": 0.5})
    plant = ship.record()
    w = working_point(plant, FIT.thrust, FIT.torque, V, OMEGA, PITCH)
    engine = 3.5 * OMEGA
    limit = min(260.0 + 2.4 * (engine - 700.0 * math.pi / 30.0), 434.0)
    assert w.nox == pytest.approx(nox_rate(plant, engine, w.torque_share * limit), rel=1e-9)
    assert w.nox > 0.0
    assert working_point(FERRY.record(), FIT.thrust, FIT.torque, V, OMEGA, PITCH).nox == 0.0


@pytest.mark.parametrize("velocity", [0.85, 1.0, 1.15])
def test_speed_of_thrust_gives_the_thrust(velocity: float) -> None:
    plant = FERRY.record()
    wanted = working_point(plant, FIT.thrust, FIT.torque, V, OMEGA, PITCH).thrust
    speed = speed_of_thrust(plant, FIT.thrust, wanted, velocity * V, OMEGA, PITCH)
    found = working_point(plant, FIT.thrust, FIT.torque, velocity * V, speed, PITCH).thrust
    assert found == pytest.approx(wanted, rel=1e-6)
    assert (speed > OMEGA * (1.0 + 1e-9)) == (velocity > 1.0)


CASES = np.array([[0.95, 0.96, 0.5], [1.05, 1.04, 0.5]])


def test_a_robust_point_takes_the_worst_or_the_mean_of_its_cases() -> None:
    ship = FERRY.with_values({"emissions.nox_base_g_kWh": 9.0})
    plant, curves = ship.record(), (FIT.thrust, FIT.torque)
    w = working_point(plant, *curves, V, OMEGA, PITCH)
    trimmed, kept = [], []
    for factor, velocity, _ in CASES:
        speed = speed_of_thrust(plant, FIT.thrust, w.thrust, velocity * V, OMEGA, PITCH)
        trimmed.append(working_point(plant, *curves, velocity * V, speed, PITCH, factor))
        kept.append(working_point(plant, *curves, velocity * V, OMEGA, PITCH, factor))
    worst = robust_point(plant, *curves, V, OMEGA, PITCH, CASES, False)
    mean = robust_point(plant, *curves, V, OMEGA, PITCH, CASES, True)
    assert worst.cost == pytest.approx(max(c.cost for c in trimmed), rel=1e-12)
    assert worst.cost > 1.05 * w.cost
    assert worst.nox == pytest.approx(max(c.nox for c in trimmed), rel=1e-12)
    assert worst.torque_share == max(w.torque_share, *(c.torque_share for c in kept))
    assert mean.cost == pytest.approx(0.5 * sum(c.cost for c in trimmed), rel=1e-12)
    assert mean.nox == pytest.approx(0.5 * sum(c.nox for c in trimmed), rel=1e-12)
    assert mean.torque_share == w.torque_share
    for robust in (worst, mean):
        assert (robust.thrust, robust.burrill) == (w.thrust, w.burrill)
    assert robust_point(plant, *curves, V, OMEGA, PITCH, CASES[:0], False) == w


def test_a_torque_factor_is_an_error_of_kq_or_of_eta_r() -> None:
    w = working_point(FERRY.record(), FIT.thrust, FIT.torque, V, OMEGA, PITCH, 1.05)
    by_curve = working_point(FERRY.record(), FIT.thrust, 1.05 * FIT.torque, V, OMEGA, PITCH)
    less = FERRY.with_values({"propeller.relative_rotative_efficiency": 1.02 / 1.05})
    by_eta_r = working_point(less.record(), FIT.thrust, FIT.torque, V, OMEGA, PITCH)
    for other in (by_curve, by_eta_r):
        assert w.cost == pytest.approx(other.cost, rel=1e-9)
        assert w.torque_share == pytest.approx(other.torque_share, rel=1e-9)


ROOM = WorkingPoint(1e4, 0.5, 1.0, 0.4, 0.7, 0.6)


@pytest.mark.parametrize(
    ("change", "least"),
    [
        ({}, 0.3),  # 1 - burrill
        ({"torque_share": 0.9}, 0.07),  # 0.97 - share
        ({"torque_share": 0.98}, -0.01),
        ({"efficiency_slope": -0.2}, -0.2),
        ({"burrill": 1.1}, -0.1),
        ({"advance_room": 0.05}, 0.05),
    ],
)
def test_slack_is_the_nearest_constraint(change: dict[str, float], least: float) -> None:
    assert slack(ROOM._replace(**change), 0.97) == pytest.approx(least)


def test_search_returns_the_allowed_settings() -> None:
    plant = FERRY.record()
    speeds, pitches = np.linspace(25.0, 65.0, 15), np.linspace(0.4, 1.2, 11)
    for share in (0.97, 0.5):
        found = np.zeros((len(speeds) * len(pitches), 4))
        certain = np.zeros((0, 3)), False
        count = search(plant, FIT.thrust, FIT.torque, 3.0, speeds, pitches, share, *certain, found)
        allowed = []
        for speed in speeds:
            for pitch in pitches:
                w = working_point(plant, FIT.thrust, FIT.torque, 3.0, speed, pitch)
                room = min(
                    share - w.torque_share, 1.0 - w.burrill, w.efficiency_slope, w.advance_room
                )
                if w.thrust > 0.0 and room >= 0.0:
                    allowed.append((speed, pitch, w.thrust, w.cost))
        assert 0 < count < len(found)
        np.testing.assert_allclose(found[:count], allowed)
