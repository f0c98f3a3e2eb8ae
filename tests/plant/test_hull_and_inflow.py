from __future__ import annotations

import numpy as np
import pytest

from shaftline.plant import Equilibrium, Schedule, Ship, ShipError, equilibrium, simulate


def with_hull(ship: Ship, **values: float) -> Ship:
    return ship.with_values({f"hull.{key}": value for key, value in values.items()})


def test_resistance_is_quadratic(design_point: Equilibrium) -> None:
    speed = design_point.state.ship_speed
    assert design_point.outputs.resistance == pytest.approx(3306.2 * speed**2, rel=1e-12)


def test_steady_thrust_of_both_propellers_carries_the_resistance(
    design_point: Equilibrium,
) -> None:
    pull = 2 * (1.0 - 0.07) * design_point.outputs.thrust
    assert pull == pytest.approx(design_point.outputs.resistance, rel=1e-8)


def test_advance_velocity_is_the_wake(design_point: Equilibrium) -> None:
    expected = 0.95 * design_point.state.ship_speed
    assert design_point.outputs.advance_velocity == pytest.approx(expected, rel=1e-12)


def test_resistance_opposes_sternway(frigate: Ship, design_point: Equilibrium) -> None:
    astern = design_point.state._replace(ship_speed=-2.0)
    samples = simulate(frigate, Schedule(22.0, 1.4), 1.0, initial=astern)
    assert samples["resistance"][0] == pytest.approx(-3306.2 * 4.0)


def test_fouling_adds_its_share_and_slows(frigate: Ship, design_point: Equilibrium) -> None:
    found = equilibrium(with_hull(frigate, fouling_fraction=0.3), 22.0, 1.4)
    speed = found.state.ship_speed
    assert found.outputs.resistance == pytest.approx(1.3 * 3306.2 * speed**2, rel=1e-12)
    assert speed < 0.98 * design_point.state.ship_speed


def test_current_carries_the_ship_along(frigate: Ship, design_point: Equilibrium) -> None:
    found = equilibrium(with_hull(frigate, current_m_s=0.8), 22.0, 1.4)
    still = design_point.state
    assert found.state.ship_speed == pytest.approx(still.ship_speed + 0.8, rel=1e-8)
    assert found.state.shaft_speed == pytest.approx(still.shaft_speed, rel=1e-8)


def test_wake_changes_with_speed_about_its_reference(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = with_hull(frigate, wake_slope_s_m=0.01, wake_reference_speed_m_s=5.0)
    s = simulate(ship, Schedule(30.0, 1.4), 60.0, initial=design_point.state)
    wake = 0.05 + 0.01 * (s["ship_speed"] - 5.0)
    np.testing.assert_allclose(s["advance_velocity"], (1.0 - wake) * s["ship_speed"], rtol=1e-12)


def test_inflow_lag_is_first_order(frigate: Ship, design_point: Equilibrium) -> None:
    ship = frigate.with_values({"hull.mass_kg": 1e9, "propeller.inflow_lag_s": 2.0})
    before = 0.95 * design_point.state.ship_speed
    gust = Schedule(22.0, 1.4, inflow=0.7)
    s = simulate(ship, gust, 10.0, initial=design_point.state._replace(inflow=before))
    rise = s["advance_velocity"] - before
    np.testing.assert_allclose(rise, 0.7 * (1.0 - np.exp(-s["time"] / 2.0)), atol=1e-3)


def test_roughness_costs_torque_and_speed(frigate: Ship, design_point: Equilibrium) -> None:
    rough = equilibrium(frigate.with_values({"propeller.roughness_drag": 0.004}), 22.0, 1.4)
    assert rough.state.ship_speed < design_point.state.ship_speed
    assert rough.state.shaft_speed < design_point.state.shaft_speed


def test_cavitation_lets_the_shaft_race(frigate: Ship) -> None:
    ship = frigate.with_values(
        {"propeller.cavitation_breakdown": 0.3, "propeller.cavitation_onset_number": 5.0}
    )
    sound, cavitating = (equilibrium(s, 30.0, 1.4).state for s in (frigate, ship))
    assert cavitating.shaft_speed > sound.shaft_speed
    assert cavitating.ship_speed < sound.ship_speed


def test_resistance_factor_acts_while_it_lasts(frigate: Ship, design_point: Equilibrium) -> None:
    episode = Schedule(
        22.0, 1.4, resistance_factor=lambda t: np.where((t > 10.0) & (t < 40.0), 1.5, 1.0)
    )
    s = simulate(frigate, episode, 60.0, initial=design_point.state)
    factor = s["resistance"] / (3306.2 * s["ship_speed"] ** 2)
    np.testing.assert_allclose(factor[[100, 500, 1100]], [1.0, 1.5, 1.0], rtol=1e-12)


def test_episode_raises_the_resistance_inside_its_window(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = frigate.with_values(
        {"hull.episode_resistance_fraction": 0.5, "hull.episode_start_s": 10.0,
         "hull.episode_end_s": 40.02}
    )  # fmt: skip
    s = simulate(ship, Schedule(22.0, 1.4), 60.0, initial=design_point.state)
    factor = s["resistance"] / (3306.2 * s["ship_speed"] ** 2)
    # the window ends 0.02 s into step 800, which so has 2/5 of the rise
    expected = {0: 1.0, 199: 1.0, 200: 1.5, 799: 1.5, 800: 1.2, 801: 1.0, 1200: 1.0}
    assert factor[list(expected)] == pytest.approx(list(expected.values()), rel=1e-9)
    given = Schedule(22.0, 1.4, resistance_factor=lambda t: np.where((t > 10) & (t < 40), 1.5, 1.0))
    same = simulate(frigate, given, 60.0, initial=design_point.state)
    np.testing.assert_allclose(s["ship_speed"], same["ship_speed"], rtol=1e-3)


def test_voyage_depends_smoothly_on_the_edges_of_an_episode(
    frigate: Ship, design_point: Equilibrium
) -> None:
    def end(start: float) -> float:
        values = {"hull.episode_resistance_fraction": 0.5, "hull.episode_start_s": start}
        run = simulate(
            frigate.with_values(values), Schedule(22.0, 1.4), 20.0, initial=design_point.state
        )
        return float(run["ship_speed"][-1])

    slopes = [(end(t + 1e-3) - end(t)) / 1e-3 for t in (10.0, 10.01, 10.02, 10.04)]
    assert slopes == pytest.approx([slopes[0]] * 4, rel=0.01)


def test_episode_before_it_begins_is_refused(frigate: Ship) -> None:
    with pytest.raises(ShipError, match="episode_end_s must not be before episode_start_s"):
        frigate.with_values({"hull.episode_start_s": 10.0, "hull.episode_end_s": 9.0})


def test_fixed_hull_stays(frigate: Ship) -> None:
    ship = frigate.with_values({"hull.fixed": True})
    start = equilibrium(ship, 15.0, 0.8)
    s = simulate(ship, Schedule(20.0, 0.8), 30.0, initial=start.state)
    assert np.all(s["ship_speed"] == 0.0)
    assert np.all(s["position"] == 0.0)
    assert s["shaft_speed"][-1] > s["shaft_speed"][0]
