"""Working point by hand, and the grid search for allowed settings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.baselines.working_point import (
    WorkingPoint,
    fit_open_water,
    search,
    slack,
    surface,
    working_point,
)
from shaftline.plant import load_ship
from shaftline.plant.cavitation import burrill_ratio
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
        count = search(plant, FIT.thrust, FIT.torque, 3.0, speeds, pitches, share, found)
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
