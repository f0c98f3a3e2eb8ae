"""Optimal surface: constraints at the nodes, least fuel, interpolation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.baselines.combinator import full_pitch
from shaftline.baselines.combinator_surface import CombinatorSurface, combinator_surface, look_up
from shaftline.baselines.steady_points import steady_point
from shaftline.baselines.uncertainty import CERTAIN, Uncertainty, uncertain_cases
from shaftline.baselines.working_point import fit_open_water, robust_point, slack, working_point
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


NOX_MAP = {
    "emissions.nox_base_g_kWh": 10.0,
    "emissions.nox_m0_s0": 0.9,
    "emissions.nox_m1_s0": 0.8,
    "emissions.nox_m0_s1": -0.7,
}
"""The specific emission rises with the torque and falls with the speed."""


def _middle(ship: Ship) -> tuple[float, float]:
    """Return an advance velocity and a thrust in the middle of the surface of least fuel."""
    plain, i = combinator_surface(ship), 7
    least, most = plain.least_thrust[i], plain.most_thrust[i]
    return float(plain.advance_velocity[i]), float(0.5 * (least + most))


@by_ship
def test_a_nox_weight_trades_fuel_for_nox_at_higher_speed(ship: Ship) -> None:
    """At equal thrust and advance speed: faster, less torque, less NOx, more fuel, all monotonous."""
    emitting = ship.with_values(NOX_MAP)
    fit, plant = fit_open_water(emitting), emitting.record()
    rows = []
    for weight in (0.0, 0.1, 0.3, 1.0):
        table = combinator_surface(emitting, nox_weight=weight)
        velocity, thrust = _middle(ship)
        setting = look_up(table, np.array([thrust]), np.array([velocity]))
        speed, pitch = float(setting.shaft_speed[0]), float(setting.pitch_ratio[0])
        w = working_point(plant, fit.thrust, fit.torque, velocity, speed, pitch)
        assert w.thrust == pytest.approx(thrust, rel=0.01)
        rows.append((speed, -pitch, w.cost, -w.nox, -w.torque_share))
    steps = np.diff(rows, axis=0)
    assert (steps > 0.0).all()
    fuel, nox = (np.array(rows)[:, k] for k in (2, 3))
    assert 0.85 < nox[2] / nox[0] < 0.97
    assert fuel[2] < 1.02 * fuel[0]


@by_ship
def test_no_setting_of_a_fine_search_is_better_with_a_nox_weight(ship: Ship) -> None:
    emitting, weight, i, k = ship.with_values(NOX_MAP), 0.5, 9, 6
    fit, plant = fit_open_water(emitting), emitting.record()
    table, plain = combinator_surface(emitting, nox_weight=weight), combinator_surface(ship)
    velocity = table.advance_velocity[i]

    def at(speed: float, pitch: float) -> Any:
        return working_point(plant, fit.thrust, fit.torque, velocity, speed, pitch)

    least = at(plain.shaft_speed[i, k], plain.pitch_ratio[i, k])
    best = at(table.shaft_speed[i, k], table.pitch_ratio[i, k])

    def cost(w: Any) -> float:
        return float(w.cost / least.cost + weight * w.nox / least.nox)

    pitches = np.linspace(ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max, 60)
    for speed in np.linspace(0.6, 1.6, 400) * table.shaft_speed[i, k]:
        for pitch in pitches:
            w = at(speed, pitch)
            if w.thrust >= best.thrust and slack(w) >= 0.0 and speed <= ship.shaft_speeds[1]:
                assert cost(w) >= cost(best) * (1 - 2e-3)


@by_ship
def test_without_a_weight_a_nox_map_changes_no_bit(ship: Ship) -> None:
    plain, emitting = combinator_surface(ship), combinator_surface(ship.with_values(NOX_MAP))
    for one, other in zip(plain, emitting, strict=True):
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()


def test_a_nox_weight_without_a_map_is_refused() -> None:
    with pytest.raises(
        ShipError, match=r"ferry: nox_weight = 0.3 needs a NOx map; .*\[emissions\]"
    ):
        combinator_surface(SHIPS[1], nox_weight=0.3)


BOUNDS = (0.05, 0.03, 0.04)


def test_uncertain_cases_are_corners_or_gauss_nodes() -> None:
    ferry = SHIPS[1]  # w = 0.08
    assert uncertain_cases(ferry, CERTAIN).shape == (0, 3)
    corners = uncertain_cases(ferry, Uncertainty(*BOUNDS))
    assert len(corners) == 8
    assert corners[:, 0].max() == pytest.approx(1.05 / 0.97)
    assert corners[:, 0].min() == pytest.approx(0.95 / 1.03)
    assert sorted({*corners[:, 1].round(12)}) == pytest.approx([0.88 / 0.92, 0.96 / 0.92])
    nodes = uncertain_cases(ferry, Uncertainty(*BOUNDS, expected=True))
    assert nodes[:, 2].sum() == pytest.approx(1.0)
    # mean and variance of the uniform distribution of the wake
    wake = 1.0 - 0.92 * nodes[:, 1] - 0.08
    assert nodes[:, 2] @ wake == pytest.approx(0.0, abs=1e-12)
    assert nodes[:, 2] @ wake**2 == pytest.approx(0.04**2 / 3.0)
    only = uncertain_cases(ferry, Uncertainty(eta_r=0.03))
    assert only[:, :2] == pytest.approx(np.array([[1.0 / 0.97, 1.0], [1.0 / 1.03, 1.0]]))


@pytest.mark.parametrize(
    ("bounds", "reason"),
    [
        ((0.31, 0.0, 0.0), "kq_error = 0.31: must be 0 to 0.3"),
        ((0.0, -0.1, 0.0), "eta_r_error = -0.1: must be 0 to 0.3"),
        ((0.0, 0.0, float("nan")), "wake_error = nan: must be 0 to 0.3"),
    ],
)
def test_bounds_out_of_range_are_refused(bounds: tuple[float, float, float], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        combinator_surface(SHIPS[1], uncertainty=Uncertainty(*bounds))


@by_ship
def test_the_worst_case_keeps_the_engine_within_its_torque_at_every_corner(ship: Ship) -> None:
    fit, plant = fit_open_water(ship), ship.record()
    corners = uncertain_cases(ship, Uncertainty(*BOUNDS))
    for uncertainty, within in ((Uncertainty(*BOUNDS), True), (CERTAIN, False)):
        table = combinator_surface(ship, uncertainty=uncertainty)
        assert table.refined > 0.95
        shares = [
            working_point(
                plant,
                fit.thrust,
                fit.torque,
                factor * velocity,
                table.shaft_speed[i, -1],
                table.pitch_ratio[i, -1],
                torque,
            ).torque_share
            for i, velocity in enumerate(table.advance_velocity)
            for torque, factor, _ in corners
        ]
        assert (max(shares) < 0.972) == within  # TORQUE_MARGIN, and the tolerance of SLSQP


@by_ship
@pytest.mark.parametrize("expected", [True, False])
def test_a_robust_surface_is_best_by_its_own_criterion(ship: Ship, expected: bool) -> None:
    uncertainty = Uncertainty(*BOUNDS, expected)
    fit, plant, cases = fit_open_water(ship), ship.record(), uncertain_cases(ship, uncertainty)
    costs = []
    for chosen in (uncertainty, CERTAIN):
        table = combinator_surface(ship, uncertainty=chosen)
        velocity, thrust = _middle(ship)
        setting = look_up(table, np.array([thrust]), np.array([velocity]))
        at = float(setting.shaft_speed[0]), float(setting.pitch_ratio[0])
        w = robust_point(plant, fit.thrust, fit.torque, velocity, *at, cases, expected)
        costs.append(w.cost * (thrust / w.thrust) ** 1.5)
    assert costs[0] <= costs[1] * (1.0 + 1e-6)
    nominal = working_point(plant, fit.thrust, fit.torque, velocity, *at).cost
    assert costs[0] > (1.0 if expected else 1.05) * nominal


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
