"""Rudder and steering gear, by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Schedule, approach, load_ship, simulate
from shaftline.plant.rudder import (
    race_inflow,
    rudder_angle,
    rudder_demand,
    rudder_forces,
    rudder_rate,
)


@pytest.fixture
def tanker() -> Any:
    return load_ship("kvlcc2").record()


@pytest.fixture
def osaka() -> Any:
    return load_ship("esso-osaka").record()


def test_orders_stop_at_the_end_stops(tanker: Any) -> None:
    most = math.radians(35.0)
    assert [rudder_demand(tanker, a) for a in (0.7, -0.7, 0.2)] == [most, -most, 0.2]


def test_gear_without_a_lag_follows_at_once(tanker: Any, osaka: Any) -> None:
    assert rudder_angle(osaka, 0.1, 0.3) == 0.3
    assert rudder_angle(osaka, 0.1, 2.0) == math.radians(35.0)
    assert rudder_angle(tanker, 0.1, 0.3) == 0.1


def test_gear_is_of_first_order_up_to_its_rate(tanker: Any) -> None:
    assert rudder_rate(tanker, 0.11, 0.10) == pytest.approx(0.01 / 0.1, rel=1e-12)
    assert rudder_rate(tanker, 0.5, 0.0) == 0.276
    assert rudder_rate(tanker, -0.5, 0.0) == -0.276


def test_rudder_runs_to_its_angle_at_its_rate() -> None:
    ship = load_ship("kvlcc2")
    point = approach(ship, 1.18)
    orders = Schedule(point.inputs.drive, 0.721, rudder_command=math.radians(35.0))
    run = simulate(ship, orders, 4.0, initial=point.state)
    np.testing.assert_allclose(run["rudder_angle"][:30], 0.276 * run["time"][:30], atol=1e-12)
    assert run["rudder_angle"][-1] == pytest.approx(math.radians(35.0), rel=1e-3)


def test_race_is_the_printed_one(tanker: Any) -> None:
    """Eq. 25: u_R = eps u_P sqrt(eta (1 + kappa (sqrt(1 + 8 KT / (pi J^2)) - 1))^2 + 1 - eta)."""
    inflow, turns, kt = 0.55, 11.0, 0.18
    advance = inflow / (turns * 0.216)
    thrust = 1000.0 * turns**2 * 0.216**4 * kt
    race = 1.0 + 0.50 * (math.sqrt(1.0 + 8.0 * kt / (math.pi * advance**2)) - 1.0)
    expected = 1.09 * inflow * math.sqrt(0.626 * race**2 + 1.0 - 0.626)
    assert race_inflow(tanker, inflow, thrust) == pytest.approx(expected, rel=1e-6)


def test_race_stands_where_the_ship_is_at_rest(tanker: Any) -> None:
    """Momentum theory at no inflow: the race is sqrt(8 T / (pi rho D^2))."""
    race = math.sqrt(8.0 * 20.0 / (math.pi * 1000.0 * 0.216**2))
    expected = 1.09 * math.sqrt(0.626) * 0.5 * race
    assert race_inflow(tanker, 0.0, 20.0) == pytest.approx(expected, rel=1e-6)
    assert race_inflow(tanker, 0.0, -20.0) == pytest.approx(-expected, rel=1e-6)


def test_rudder_without_a_race_meets_the_wake_alone(osaka: Any) -> None:
    assert race_inflow(osaka, 2.0, 1e6) == 2.0 * 1.53846154


@pytest.mark.parametrize(("across", "straightening"), [(-0.3, 0.640), (0.5, 0.395)])
def test_forces_by_hand(tanker: Any, across: float, straightening: float) -> None:
    """Eqs. 15 to 19 and 23: F_N = rho A_R U_R^2 f_alpha sin(alpha_R) / 2, drag and hull's share."""
    angle, inflow, thrust, yaw_rate = 0.4, 0.5, 12.0, 0.03
    along = race_inflow(tanker, inflow, thrust)
    cross = straightening * (across - 4.97 * yaw_rate)
    attack = angle + math.atan2(cross, along)
    normal = 0.5 * 1000.0 * 0.0539 * (along**2 + cross**2) * 2.747 * math.sin(attack)
    expected = (
        -(1.0 - 0.387) * normal * math.sin(angle),
        -(1.0 + 0.312) * normal * math.cos(angle),
        -(-3.5 + 0.312 * -3.248) * normal * math.cos(angle),
    )
    *found, own = rudder_forces(tanker, angle, inflow, thrust, across, yaw_rate)
    assert found == pytest.approx(expected, rel=1e-9)
    assert own == pytest.approx(-normal * math.cos(angle), rel=1e-9)


def test_profile_drag_goes_with_the_flow(osaka: Any) -> None:
    """Taylor (2000), eq. 3.33: a drag along the flow, beside the lift."""
    along, cross = 1.53846154 * 2.0, -0.4 - 162.5 * 0.001
    bare = load_ship("esso-osaka").with_values({"rudder.profile_drag": 0.0}).record()
    args = (0.1, 2.0, 1e6, -0.4, 0.001)
    difference = np.subtract(rudder_forces(osaka, *args), rudder_forces(bare, *args))
    drag = 0.5 * 1025.0 * 119.8 * 0.0085 * math.hypot(along, cross)
    expected = (-drag * along, -drag * cross, 162.5 * drag * cross, -drag * cross)
    assert difference == pytest.approx(expected, rel=1e-8)


def test_rudder_to_starboard_turns_to_starboard(tanker: Any) -> None:
    surge, side, moment, _ = rudder_forces(tanker, 0.3, 0.5, 12.0, 0.0, 0.0)
    assert surge < 0.0  # it drags
    assert side < 0.0  # the stern goes to port
    assert moment > 0.0
