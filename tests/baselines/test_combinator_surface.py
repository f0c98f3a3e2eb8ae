"""Optimal surface: constraints at the nodes, least fuel, interpolation."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.baselines.combinator import full_pitch
from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface, look_up
from shaftline.baselines.steady_points import steady_point
from shaftline.baselines.working_point import fit_open_water, slack, working_point
from shaftline.plant import Ship, ShipError, load_ship

SHIPS = [load_ship("frigate"), load_ship("ferry")]
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


@by_ship
def test_nodes_keep_the_constraints_and_their_thrust(ship: Ship) -> None:
    table, fit, plant = combinator_surface(ship), fit_open_water(ship), ship.record()
    assert table.refined > 0.95
    for i, velocity in enumerate(table.advance_velocity):
        for k, share in enumerate(table.share):
            thrust = table.least_thrust[i] + share * (table.most_thrust[i] - table.least_thrust[i])
            w = working_point(
                plant,
                fit.thrust,
                fit.torque,
                velocity,
                table.shaft_speed[i, k],
                table.pitch_ratio[i, k],
            )
            assert slack(w) > -2e-3
            assert w.thrust == pytest.approx(thrust, rel=0.03)


@by_ship
def test_no_setting_of_a_fine_search_needs_less_fuel(ship: Ship) -> None:
    table, fit, plant = combinator_surface(ship), fit_open_water(ship), ship.record()
    i, k = 9, 6
    velocity = table.advance_velocity[i]
    best = working_point(
        plant, fit.thrust, fit.torque, velocity, table.shaft_speed[i, k], table.pitch_ratio[i, k]
    )
    for shaft_speed in np.linspace(0.6, 1.6, 400) * table.shaft_speed[i, k]:
        for pitch in np.linspace(
            ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max, 60
        ):
            w = working_point(plant, fit.thrust, fit.torque, velocity, shaft_speed, pitch)
            if w.thrust >= best.thrust and slack(w) >= 0.0:
                assert w.cost >= best.cost * (1 - 1e-3)


@by_ship
def test_a_cavitation_weight_trades_fuel_for_a_quieter_propeller(ship: Ship) -> None:
    """At equal thrust and advance speed: less load of the blades, more fuel, both monotonous."""
    fit, plant, i, share = fit_open_water(ship), ship.record(), 7, 0.5
    fuel, load = [], []
    plain = combinator_surface(ship)
    velocity = plain.advance_velocity[i]
    thrust = plain.least_thrust[i] + share * (plain.most_thrust[i] - plain.least_thrust[i])
    for weight in (0.0, 0.3, 1.0):
        table = combinator_surface(ship, cavitation_weight=weight)
        setting = look_up(table, np.array([thrust]), np.array([velocity]))
        w = working_point(
            plant, fit.thrust, fit.torque, velocity, setting.shaft_speed[0], setting.pitch_ratio[0]
        )
        assert w.thrust == pytest.approx(thrust, rel=0.01)
        fuel.append(w.cost)
        load.append(w.burrill)
    assert fuel == sorted(fuel)
    assert load == sorted(load, reverse=True)
    assert load[1] < 0.97 * load[0]
    assert fuel[1] < 1.01 * fuel[0]


def test_a_margin_of_kq_keeps_the_engine_within_its_torque_when_kq_is_higher() -> None:
    ship = SHIPS[0]
    fit, plant = fit_open_water(ship), ship.record()
    for margin, within in ((0.05, True), (0.0, False)):
        table = combinator_surface(ship, kq_margin=margin)
        shares = [
            working_point(
                plant,
                fit.thrust,
                1.05 * fit.torque,
                velocity,
                table.shaft_speed[i, -1],
                table.pitch_ratio[i, -1],
            ).torque_share
            for i, velocity in enumerate(table.advance_velocity)
        ]
        assert (max(shares) < 0.972) == within  # TORQUE_MARGIN, and the tolerance of SLSQP


def test_surface_spans_the_speeds_of_the_ship() -> None:
    ferry = SHIPS[1]
    table = combinator_surface(ferry)
    low, top = ferry.shaft_speeds
    assert table.advance_velocity[0] == pytest.approx(0.02 * low / (2.0 * np.pi) * 1.0)
    fastest = steady_point(ferry, top, full_pitch(ferry)).advance_velocity
    steps = np.linspace(table.advance_velocity[0], 1.05 * fastest, 15)
    assert table.advance_velocity == pytest.approx(steps[: len(table.advance_velocity)])
    assert table.share == pytest.approx(np.linspace(0.0, 1.0, 13))
    assert np.all(table.most_thrust > table.least_thrust)


def test_the_whole_engine_may_be_allowed() -> None:
    ferry = SHIPS[1]
    kept, whole = combinator_surface(ferry), combinator_surface(ferry, 1.0)
    rows = min(len(kept.most_thrust), len(whole.most_thrust))
    assert np.all(whole.most_thrust[:rows] >= kept.most_thrust[:rows])
    assert whole.most_thrust[rows // 2] > 1.005 * kept.most_thrust[rows // 2]


def test_settings_stay_within_engine_and_blades() -> None:
    """Return a ship with a slower engine, whose highest speed is the limit."""
    slow = SHIPS[1].with_values({"prime_mover.speed_max_rpm": 1200.0})
    table, (low, top) = combinator_surface(slow), slow.shaft_speeds
    assert table.shaft_speed.max() == pytest.approx(top, rel=1e-9)
    assert table.shaft_speed.min() >= low * (1.0 - 1e-9)
    assert 0.4 - 1e-9 <= table.pitch_ratio.min() < table.pitch_ratio.max() <= 1.2 + 1e-9


def test_ships_without_a_diesel_or_controllable_pitch_are_refused() -> None:
    with pytest.raises(ShipError, match="diesel"):
        combinator_surface(load_ship("rov-thruster"))
    fixed = SHIPS[1].with_values(
        {"propeller.pitch_ratio_min": 0.7, "propeller.pitch_ratio_max": 0.7}
    )
    with pytest.raises(ShipError, match="needs a controllable-pitch propeller"):
        combinator_surface(fixed)


GRID = np.array([[10.0, 20.0, 40.0], [30.0, 60.0, 50.0]])
TABLE = CombinatorSurface(
    np.array([2.0, 6.0]),
    np.array([100.0, 300.0]),
    np.array([500.0, 900.0]),
    np.array([0.0, 0.5, 1.0]),
    GRID,
    0.01 * GRID,
    1.0,
)


@pytest.mark.parametrize(
    ("thrust", "velocity", "speed"),
    [
        (100.0, 2.0, 10.0),  # nodes
        (300.0, 2.0, 20.0),
        (900.0, 6.0, 50.0),
        (200.0, 2.0, 15.0),  # between two thrusts
        (200.0, 4.0, 20.0),  # between two speeds: thrust from 200 to 700
        (450.0, 4.0, 40.0),
        (325.0, 4.0, 30.0),
        (487.5, 3.0, 0.75 * 30.0 + 0.25 * 55.0),  # thrust from 150 to 600, at 3/4
        (99.0, 2.0, 10.0),  # limited to the table
        (1e9, 6.0, 50.0),
        (300.0, -5.0, 20.0),
        (600.0, 99.0, 60.0),
    ],
)
def test_surface_is_interpolated_bilinearly(thrust: float, velocity: float, speed: float) -> None:
    found = look_up(TABLE, np.array([thrust]), np.array([velocity]))
    assert found.shaft_speed[0] == pytest.approx(speed)
    assert found.pitch_ratio[0] == pytest.approx(0.01 * speed)


def test_reach_falls_below_the_edge_and_aim_ends_at_the_most() -> None:
    thrust = np.array([100.0, 85.0, 70.0, 1.0, 450.0, 501.0])
    found = look_up(TABLE, thrust, np.full(6, 2.0))
    assert found.reach == pytest.approx([1.0, 0.5, 0.0, 0.0, 1.0, 1.0])
    assert found.thrust == pytest.approx([100.0, 85.0, 70.0, 1.0, 450.0, 500.0])


def test_look_up_meets_its_nodes_and_orders_beyond_them() -> None:
    table = combinator_surface(SHIPS[1])
    thrust = 0.5 * (table.least_thrust[4] + table.most_thrust[4])
    setting = look_up(table, np.array([thrust]), table.advance_velocity[4:5])
    assert setting.shaft_speed[0] == pytest.approx(table.shaft_speed[4, 6])
    assert setting.pitch_ratio[0] == pytest.approx(table.pitch_ratio[4, 6])
    beyond = look_up(table, np.array([1e9, 1.0]), np.array([4.0, 4.0]))
    assert beyond.thrust[0] < 1e5
    assert list(beyond.reach) == [1.0, 0.0]
