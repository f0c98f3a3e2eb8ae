from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.plant import (
    Equilibrium,
    Schedule,
    Ship,
    ShipError,
    State,
    equilibrium,
    load_ship,
    ship_names,
    simulate,
)
from shaftline.plant.hull import (
    episode_factor,
    resistance,
    wake_inflow,
    water_speed,
    wave_resistance,
)
from shaftline.plant.seas import Sea
from shaftline.plant.waves import realise, wave_motion

DRAG = 3306.2  # thesis Table B-1 [N s2/m2]


def with_hull(ship: Ship, **values: float) -> Ship:
    return ship.with_values({f"hull.{key}": value for key, value in values.items()})


@pytest.mark.parametrize("speed", [8.0, 0.0, -2.0])
def test_resistance_is_quadratic_and_opposes_the_motion(plant: Any, speed: float) -> None:
    expected = DRAG * speed * abs(speed)
    assert resistance(plant, speed, 1.0) == pytest.approx(expected, rel=1e-14)


def test_fouling_and_disturbance_each_multiply_it(plant: Any) -> None:
    plant["hull_fouling"] = 0.3
    assert resistance(plant, 8.0, 1.2) == pytest.approx(1.2 * 1.3 * DRAG * 64.0, rel=1e-14)


@pytest.mark.parametrize(
    ("heading", "height"), [(180.0, 3.0), (140.0, 3.0), (130.0, 0.0), (0.0, 0.0), (-140.0, 3.0)]
)
def test_waves_from_ahead_add_resistance(frigate: Ship, heading: float, height: float) -> None:
    """STAWAVE-1 by hand: 1025 x 9.81 / 16 x Hs^2 x 14.4 x sqrt(14.4 / 45)."""
    plant = with_hull(frigate, beam_m=14.4, bow_length_m=45.0).record()
    sea = realise(Sea(hs_m=3.0, tp_s=9.0, heading_deg=heading), 4.0, 1)
    found = wave_resistance(plant, wave_motion(sea).head_sea, 2.0)
    assert found == pytest.approx(5119.2975 * height**2, rel=1e-5)


@pytest.mark.parametrize(
    ("speed", "share"),
    [(8.0, 1.0), (2.0, 1.0), (1.0, 0.5), (0.5, 0.15625), (0.0, 0.0), (-3.0, 0.0)],
)
def test_waves_hold_back_a_ship_under_way_only(frigate: Ship, speed: float, share: float) -> None:
    plant = with_hull(frigate, beam_m=14.4, bow_length_m=45.0).record()
    assert wave_resistance(plant, 9.0, speed) == pytest.approx(share * 5119.2975 * 9.0, rel=1e-5)
    slope = complex(wave_resistance(plant, 9.0, speed + 1e-30j)).imag / 1e-30
    assert slope >= 0.0


@pytest.mark.parametrize("name", [n for n in ship_names() if load_ship(n).hull.beam_m > 0.0])
@pytest.mark.parametrize("speed", [0.0, 6.0])
def test_waves_drive_no_dead_ship_astern(name: str, speed: float) -> None:
    ship = load_ship(name)
    pitch = ship.propeller.pitch_ratio_max
    begin = State(pitch, 0.0, speed)
    sea = realise(Sea(hs_m=6.0, tp_s=12.0), ship.propeller.depth_m, 1)
    run = simulate(ship, Schedule(0.0, pitch), 600.0, initial=begin, sea=sea)
    assert run["ship_speed"].min() > -0.5  # what orbital motion at the blades may give
    assert run["ship_speed"][-1] < 3.0


def test_a_beam_needs_the_length_of_its_bow(frigate: Ship) -> None:
    with pytest.raises(ShipError, match="bow_length_m is missing"):
        with_hull(frigate, beam_m=14.4)


def test_current_carries_the_ship_along(plant: Any) -> None:
    assert water_speed(plant, 8.0) == 8.0
    plant["current"] = 0.8
    assert water_speed(plant, 8.0) == pytest.approx(7.2)


def test_wake_takes_its_share_of_the_inflow(plant: Any) -> None:
    assert wake_inflow(plant, 8.0) == pytest.approx(0.95 * 8.0, rel=1e-14)


@pytest.mark.parametrize(("speed", "wake"), [(8.0, 0.08), (5.0, 0.05), (2.0, 0.02)])
def test_wake_changes_with_speed_about_its_reference(plant: Any, speed: float, wake: float) -> None:
    plant["wake_slope"], plant["wake_reference_speed"] = 0.01, 5.0
    assert wake_inflow(plant, speed) == pytest.approx((1.0 - wake) * speed, rel=1e-14)


@pytest.mark.parametrize(
    ("time", "factor"),
    [
        (0.0, 1.0),
        (9.94, 1.0),
        (9.98, 1.3),  # 0.03 of the step's 0.05 s lie inside
        (10.0, 1.5),
        (39.0, 1.5),
        (39.99, 1.3),  # 0.03 again
        (40.02, 1.0),
        (60.0, 1.0),
    ],
)
def test_episode_has_the_mean_over_a_step_that_its_edge_cuts(
    plant: Any, time: float, factor: float
) -> None:
    plant["episode_resistance"] = 0.5
    plant["episode_start"], plant["episode_end"] = 10.0, 40.02
    assert episode_factor(plant, time, 0.05) == pytest.approx(factor, rel=1e-9)


def test_episode_may_lie_within_one_step(plant: Any) -> None:
    plant["episode_resistance"] = 0.5
    plant["episode_start"], plant["episode_end"] = 10.01, 10.02
    assert episode_factor(plant, 10.0, 0.05) == pytest.approx(1.1, rel=1e-9)


def test_without_an_episode_its_factor_is_one(plant: Any) -> None:
    plant["episode_start"], plant["episode_end"] = 10.0, 40.0
    assert episode_factor(plant, 20.0, 0.05) == 1.0
    plant["episode_resistance"], plant["episode_end"] = 0.5, np.inf
    assert episode_factor(plant, 2000.0, 0.05) == pytest.approx(1.5)


def test_record_counts_propellers_and_knows_whether_the_hull_moves(frigate: Ship) -> None:
    moored = with_hull(frigate, fixed=True, propellers=3).record()
    assert (moored["propellers"], moored["hull_fixed"]) == (3.0, 1)
    assert (frigate.record()["propellers"], frigate.record()["hull_fixed"]) == (2.0, 0)


def test_episode_before_it_begins_is_refused(frigate: Ship) -> None:
    assert with_hull(frigate, episode_start_s=10.0, episode_end_s=10.0).hull.episode_end_s == 10.0
    with pytest.raises(
        ShipError, match="episode_end_s = 9 s must not be before episode_start_s = 10 s"
    ):
        with_hull(frigate, episode_start_s=10.0, episode_end_s=9.0)


@pytest.mark.parametrize("key", ["mass_kg", "resistance_coefficient_N_s2_m2"])
def test_a_hull_that_moves_needs_mass_and_resistance(frigate: Ship, key: str) -> None:
    tree = frigate.model_dump(exclude_unset=True)
    del tree["hull"][key]
    with pytest.raises(ValueError, match=f"{key} is missing; it is required unless hull.fixed"):
        Ship.model_validate(tree)
    tree["hull"]["fixed"] = True
    assert Ship.model_validate(tree).hull.fixed
    with pytest.raises(ShipError, match=r"hull\.mass_kg is missing"):
        load_ship("tito-neri-sine").with_values({"hull.fixed": False})


def test_steady_ship_balances_thrust_and_resistance(design_point: Equilibrium) -> None:
    speed = design_point.state.ship_speed
    assert design_point.outputs.resistance == pytest.approx(DRAG * speed**2, rel=1e-12)
    pull = 2 * (1.0 - 0.07) * design_point.outputs.thrust
    assert pull == pytest.approx(design_point.outputs.resistance, rel=1e-8)
    assert design_point.outputs.advance_velocity == pytest.approx(0.95 * speed, rel=1e-12)


def test_current_shifts_the_speed_over_ground_alone(
    frigate: Ship, design_point: Equilibrium
) -> None:
    found = equilibrium(with_hull(frigate, current_m_s=0.8), 22.0, 1.4)
    still = design_point.state
    assert found.state.ship_speed == pytest.approx(still.ship_speed + 0.8, rel=1e-8)
    assert found.state.shaft_speed == pytest.approx(still.shaft_speed, rel=1e-8)


def test_resistance_factor_acts_while_it_lasts(frigate: Ship, design_point: Equilibrium) -> None:
    episode = Schedule(
        22.0, 1.4, resistance_factor=lambda t: np.where((t > 10.0) & (t < 40.0), 1.5, 1.0)
    )
    s = simulate(frigate, episode, 60.0, initial=design_point.state)
    factor = s["resistance"] / (DRAG * s["ship_speed"] ** 2)
    np.testing.assert_allclose(factor[[100, 500, 1100]], [1.0, 1.5, 1.0], rtol=1e-12)


def test_episode_raises_the_resistance_of_a_voyage(
    frigate: Ship, design_point: Equilibrium
) -> None:
    values = {"episode_resistance_fraction": 0.5, "episode_start_s": 10.0, "episode_end_s": 40.02}
    s = simulate(with_hull(frigate, **values), Schedule(22, 1.4), 60.0, initial=design_point.state)
    factor = s["resistance"] / (DRAG * s["ship_speed"] ** 2)
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
        ship = with_hull(frigate, episode_resistance_fraction=0.5, episode_start_s=start)
        run = simulate(ship, Schedule(22.0, 1.4), 20.0, initial=design_point.state)
        return float(run["ship_speed"][-1])

    slopes = [(end(t + 1e-3) - end(t)) / 1e-3 for t in (10.0, 10.01, 10.02, 10.04)]
    assert slopes == pytest.approx([slopes[0]] * 4, rel=0.01)


def test_fixed_hull_stays(frigate: Ship) -> None:
    ship = with_hull(frigate, fixed=True)
    start = equilibrium(ship, 15.0, 0.8)
    s = simulate(ship, Schedule(20.0, 0.8), 30.0, initial=start.state)
    assert np.all(s["ship_speed"] == 0.0)
    assert np.all(s["position"] == 0.0)
    assert s["shaft_speed"][-1] > s["shaft_speed"][0]


def test_resistance_may_rise_by_another_power(frigate: Ship) -> None:
    """R = c1 v^2 (v / v_r)^(k - 2), odd in v, and its slope k R / v."""
    steep = with_hull(frigate, resistance_exponent=2.65, resistance_reference_speed_m_s=6.0)
    plant, c1 = steep.record(), steep.hull.resistance_coefficient_N_s2_m2
    assert resistance(plant, 6.0, 1.0) == pytest.approx(c1 * 36.0, rel=1e-12)
    assert resistance(plant, 3.0, 1.0) == pytest.approx(c1 * 36.0 * 0.5**2.65, rel=1e-12)
    assert resistance(plant, -3.0, 1.0) == -resistance(plant, 3.0, 1.0)
    assert resistance(plant, 0.0, 1.0) == 0.0
    by_step = resistance(plant, 7.0 + 1e-20j, 1.0).imag / 1e-20
    assert by_step == pytest.approx(2.65 * resistance(plant, 7.0, 1.0) / 7.0, rel=1e-12)
    assert steep.hull.resistance_slope(7.0) == pytest.approx(by_step, rel=1e-12)
    assert frigate.hull.resistance_slope(7.0) == 2.0 * DRAG * 7.0
