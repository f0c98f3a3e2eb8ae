from __future__ import annotations

import numpy as np
import pytest

from shaftline.baselines.combinator import Combinator
from shaftline.baselines.combinator_surface import combinator_surface, look_up
from shaftline.baselines.controller import readings
from shaftline.baselines.cpp_optimiser import CppOptimiser
from shaftline.baselines.open_water_fit import fit_open_water, surface, surface_slope
from shaftline.baselines.working_point import slack, working
from shaftline.plant import Ship, ShipError, load_ship
from shaftline.plant.open_water import open_water, open_water_slope

from .voyage import sail

SHIPS = [load_ship("frigate"), load_ship("ferry")]
LONG = {"frigate": 1500.0, "ferry": 500.0}  # s; until the ship's speed has settled
by_ship = pytest.mark.parametrize("ship", SHIPS, ids=lambda ship: ship.name)


@by_ship
def test_surfaces_fit_within_the_papers_error(ship: Ship) -> None:
    fit, plant = fit_open_water(ship), ship.record()
    assert max(fit.thrust_error, fit.torque_error) < 0.004
    for j, p in ((0.1, 0.7), (0.5, 0.9), (0.83, 1.13)):  # off the grid that was fitted
        assert surface(fit.thrust, j, p) == pytest.approx(open_water(plant["kt"], j, p), abs=2e-4)
        assert surface(fit.torque, j, p) == pytest.approx(open_water(plant["kq"], j, p), abs=2e-5)
        slope = surface_slope(fit.thrust, j, p)
        assert slope == pytest.approx(open_water_slope(plant["kt"], j, p), abs=2e-3)


def test_four_quadrant_curves_are_fitted_or_refused_by_name() -> None:
    other = SHIPS[0].with_values({"propeller.model": "four-quadrant"})
    with pytest.raises(ShipError, match=r"miss the curves by .* more than 0.4 %"):
        fit_open_water(other)
    fixed = SHIPS[0].with_values(
        {"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2}
    )
    with pytest.raises(ShipError, match="controllable pitch"):
        fit_open_water(fixed)


@by_ship
def test_nodes_keep_the_constraints_and_their_thrust(ship: Ship) -> None:
    table, fit, plant = combinator_surface(ship), fit_open_water(ship), ship.record()
    assert table.refined > 0.95
    for i, velocity in enumerate(table.advance_velocity):
        for k, share in enumerate(table.share):
            thrust = table.least_thrust[i] + share * (table.most_thrust[i] - table.least_thrust[i])
            w = working(
                plant, fit.thrust, fit.torque, velocity,
                table.shaft_speed[i, k], table.pitch_ratio[i, k],
            )  # fmt: skip
            assert slack(w) > -2e-3
            assert w.thrust == pytest.approx(thrust, rel=0.03)


@by_ship
def test_no_setting_of_a_fine_search_burns_less(ship: Ship) -> None:
    table, fit, plant = combinator_surface(ship), fit_open_water(ship), ship.record()
    i, k = 9, 6
    velocity = table.advance_velocity[i]
    best = working(
        plant, fit.thrust, fit.torque, velocity, table.shaft_speed[i, k], table.pitch_ratio[i, k]
    )
    for shaft_speed in np.linspace(0.6, 1.6, 400) * table.shaft_speed[i, k]:
        for pitch in np.linspace(
            ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max, 60
        ):
            w = working(plant, fit.thrust, fit.torque, velocity, shaft_speed, pitch)
            if w.thrust >= best.thrust and slack(w) >= 0.0:
                assert w.cost >= best.cost * (1 - 1e-3)


@by_ship
@pytest.mark.parametrize("share", [0.4, 0.65, 0.9])
def test_after_a_resistance_rise_no_more_fuel_than_the_combinator(ship: Ship, share: float) -> None:
    """The paper's experiment: 15 % more resistance, thrust corrected to the combinator's speed."""
    combinator, optimiser = Combinator(ship), CppOptimiser(ship)
    plain = combinator.steady(share * float(combinator.curve.ship_speed[-1]), 1.15)
    order = plain.ship_speed * 1.15**0.5  # asks the thrust that holds this speed after the rise
    log = sail(optimiser, ship, order, LONG[ship.name], resistance=1.15)
    end = log[-1]
    assert end.ship_speed == pytest.approx(plain.ship_speed, rel=0.005)
    per_resistance = (end.ship_speed / plain.ship_speed) ** 3  # for the last difference in speed
    assert end.fuel_flow <= plain.fuel_flow * per_resistance
    assert np.ptp([e.shaft_speed for e in log[-100:]]) < 1e-2 * end.shaft_speed  # no hunting


@by_ship
@pytest.mark.parametrize("share", [0.25, 0.85])
def test_ordered_speed_is_held_in_calm_water(ship: Ship, share: float) -> None:
    optimiser = CppOptimiser(ship)
    order = share * float(optimiser.combinator.curve.ship_speed[-1])
    order = max(order, float(optimiser.combinator.curve.ship_speed[0]))
    assert sail(optimiser, ship, order, LONG[ship.name])[-1].ship_speed == pytest.approx(
        order, rel=0.01
    )


def test_without_a_valid_estimate_it_is_the_combinator() -> None:
    ferry = SHIPS[1]
    plain = sail(Combinator(ferry), ferry, 5.0, 60.0)
    blind = sail(CppOptimiser(ferry), ferry, 5.0, 60.0, valid=False)
    for one, other in zip(plain, blind, strict=True):
        np.testing.assert_array_equal(one.action, other.action)


def test_a_broken_estimate_leaves_no_trace() -> None:
    optimiser = CppOptimiser(SHIPS[1])
    row = np.array([5.0, 45.0, 900.0, 0.8, 18.0, 4.8, 4.4, 1.0])
    _, state = optimiser.predict(row)
    broken = row.copy()
    broken[6], broken[7] = np.nan, 0.0
    actions, state = optimiser.predict(broken, state)
    assert np.all(np.isfinite(actions))
    assert np.all(np.isfinite(state))


def test_look_up_meets_its_nodes_and_orders_beyond_them() -> None:
    table = combinator_surface(SHIPS[1])
    thrust = 0.5 * (table.least_thrust[4] + table.most_thrust[4])
    setting = look_up(table, np.array([thrust]), table.advance_velocity[4:5])
    assert setting.shaft_speed[0] == pytest.approx(table.shaft_speed[4, 6])
    assert setting.pitch_ratio[0] == pytest.approx(table.pitch_ratio[4, 6])
    beyond = look_up(table, np.array([1e9, 1.0]), np.array([4.0, 4.0]))
    assert beyond.thrust[0] < 1e5
    assert list(beyond.reach) == [1.0, 0.0]


def test_thrust_estimate_is_the_plants_thrust() -> None:
    for ship in SHIPS:
        optimiser = CppOptimiser(ship)
        steady = optimiser.combinator.steady(0.7 * float(optimiser.combinator.curve.ship_speed[-1]))
        row = [
            6.0,
            steady.shaft_speed,
            0.0,
            steady.pitch_ratio,
            0.0,
            0.0,
            steady.advance_velocity,
            1,
        ]
        assert optimiser.thrust(readings(row))[0] == pytest.approx(steady.thrust, rel=1e-3)
