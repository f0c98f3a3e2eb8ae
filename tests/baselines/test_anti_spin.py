from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.anti_spin import AntiSpin, AntiSpinTuning
from shaftline.baselines.combinator import combinator_curve
from shaftline.baselines.thrust_control import check_gains
from shaftline.baselines.ventilation import TorqueLossObserver, VentilationDetector
from shaftline.plant import Ship, equilibrium, load_ship
from shaftline.plant.drives.diesel import rack_torque, torque_limit

CRUISE = [8.0, 9.6, 1.2e5, 1.4, 19.0, 8.0, 7.6, 1.0]


@pytest.fixture(scope="module")
def controller(frigate: Ship) -> AntiSpin:
    return AntiSpin(frigate)


# gains


@pytest.mark.parametrize(
    ("condition", "gains"),
    [
        ("B1", (0.0, 10.0, 1.0)),
        ("B2", (1.0, -1.0, 1.0)),
        ("B2", (1.0, 99.0, 1.0)),  # gamma J_m - k_f2 = 99.5
        ("B3", (1.0, 200.0, 0.0)),
        ("B3", (0.004, 200.0, 0.0003)),  # -J_m gamma^2 + gamma k_f2 = 0.0004
        ("finite", (math.nan, 10.0, 1.0)),
    ],
)
def test_each_condition_is_named(condition: str, gains: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=condition):
        check_gains(*gains, inertia=100.0, viscous=0.5)


@pytest.mark.parametrize("gains", [(1.0, 99.6, 1.0), (0.004, 200.0, 0.0005)])
def test_gains_within_the_conditions_pass(gains: tuple[float, float, float]) -> None:
    check_gains(*gains, inertia=100.0, viscous=0.5)


@pytest.mark.parametrize(
    "change",
    [
        {"gamma": -0.1},
        {"proportional_rate": 0.05},
        {"integral_rate": -1.0},
        {"cutoff_rad_s": 0.0},
        {"ventilated_speed": 0.0},
        {"overspeed_only": 1.5},
        {"observer": TorqueLossObserver(loss_rate=1.0)},
        {"detector": VentilationDetector(on_below=0.8, off_above=0.7)},
        {"detector": VentilationDetector(blend_gain=0.0)},
        {"detector": VentilationDetector(hold_s=-1.0)},
        {"detector": VentilationDetector(sea_margin=-1.0)},
        {"detector": VentilationDetector(sea_memory_s=0.0)},
    ],
)
def test_bad_tuning_is_refused(frigate: Ship, change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"anti-spin|thrust control|observer|detector"):
        AntiSpin(frigate, tuning=replace(AntiSpinTuning(), **change))


def test_values_of_the_tuning_are_set_by_name(frigate: Ship) -> None:
    settings = AntiSpin(frigate, ventilated_speed=0.8, sea_margin=3.0, speed_rate=9.0).settings
    assert settings["ventilated_speed"] == 0.8
    assert settings["law"]["detector"]["sea_margin"] == 3.0
    assert settings["law"]["observer"]["speed_gain"] == 9.0 * settings["law"]["observer"]["inertia"]
    with pytest.raises(TypeError, match="nonsense"):
        AntiSpin(frigate, nonsense=1.0)


def test_engine_stays_within_its_envelope(controller: AntiSpin, frigate: Ship) -> None:
    # At full ahead and idle speed the torque set-point is far above the torque limit.
    observation = np.array([12.0, 5.0, 3e4, 1.4, 15.0, 2.0, 2.0, 1.0])
    state: Any = None
    for _ in range(10):
        action, state = controller.predict(observation, state)
    plant = frigate.record()
    engine_speed = 5.0 * float(plant["gear_ratio"])
    limit = torque_limit(plant, engine_speed)
    assert state["shaft_torque"][0] > 7.38 * 0.95 * limit
    rack = 0.5 * (float(action[1]) + 1.0) * float(plant["drive_max"])
    assert rack_torque(plant, engine_speed, rack) == pytest.approx(limit, rel=1e-5)
    # There was no integrator windup.
    assert state["error_integral"][0] == 0.0


def test_only_diesel_ships_with_a_b_series_propeller_are_allowed(frigate: Ship) -> None:
    with pytest.raises(ValueError, match="diesel"):
        AntiSpin(load_ship("tito-neri-sine"))
    with pytest.raises(ValueError, match="B-series"):
        AntiSpin(frigate.with_values({"propeller.model": "four-quadrant"}))


# parts


def test_set_points_are_steady_states(frigate: Ship) -> None:
    curve = combinator_curve(frigate)
    steady = equilibrium(frigate, 19.5, float(curve.set_points(8.0).pitch_ratio))
    at = curve.set_points(steady.state.ship_speed)
    assert at.shaft_speed == pytest.approx(steady.state.shaft_speed, rel=1e-3)
    assert at.thrust == pytest.approx(steady.outputs.thrust, rel=1e-3)


def test_a_fixed_pitch_is_allowed(frigate: Ship) -> None:
    fixed = frigate.with_values(
        {"propeller.pitch_ratio_min": 1.2, "propeller.pitch_ratio_max": 1.2}
    )
    controller = AntiSpin(fixed)
    assert np.all(np.diff(controller.curve.shaft_speed) > 0.0)
    assert controller.predict(CRUISE)[0][0] == 0.0


# predict


def test_filter_is_that_of_the_paper(frigate: Ship) -> None:
    tuning = AntiSpinTuning(cutoff_rad_s=1.5, damping=1.0)
    turn = AntiSpin(frigate, 0.5, tuning=tuning).settings["law"]["filter"]
    # In a critically damped filter the remaining error of a step is (1 + w t) exp(-w t).
    assert turn[0, 0] == pytest.approx((1.0 + 0.75) * math.exp(-0.75))
    assert turn[0, 1] == pytest.approx(0.5 * math.exp(-0.75))


def test_single_equals_batch(frigate: Ship, controller: AntiSpin) -> None:
    rng = np.random.default_rng(0)
    fleet_state: Any = None
    states: list[Any] = [None] * 4
    for k in range(40):
        observations = np.array(CRUISE) * rng.uniform(0.3, 1.5, (4, 8))
        starts = np.array([k == 17, False, False, False])
        actions, fleet_state = controller.predict(observations, fleet_state, starts)
        for i in range(4):
            action, states[i] = controller.predict(observations[i], states[i], starts[i : i + 1])
            assert action.shape == (2,)
            assert action.dtype == np.float32
            np.testing.assert_array_equal(action, actions[i])
            np.testing.assert_array_equal(states[i][0], fleet_state[i])


def test_the_state_argument_is_not_changed(controller: AntiSpin) -> None:
    _, state = controller.predict(CRUISE)
    before = state.copy()
    first, _ = controller.predict(CRUISE, state)
    np.testing.assert_array_equal(state, before)
    second, _ = controller.predict(CRUISE, state)
    np.testing.assert_array_equal(first, second)


def test_an_episode_starts_with_the_initial_state(controller: AntiSpin) -> None:
    fresh, _ = controller.predict(CRUISE)
    _, state = controller.predict(np.array(CRUISE) * 0.7)
    again, _ = controller.predict(CRUISE, state, np.array([True]))
    np.testing.assert_array_equal(again, fresh)


def test_a_lost_measurement_is_replaced_by_the_last_plausible_one(controller: AntiSpin) -> None:
    curve = controller.curve
    slow = [
        curve.ship_speed[0],
        curve.shaft_speed[0],
        0.0,
        curve.pitch_ratio[0],
        0.0,
        curve.ship_speed[0],
        0.0,
        0.0,
    ]
    _, first = controller.predict(np.full(8, math.nan))
    assert first["measured"][0].tolist() == pytest.approx(slow)
    _, second = controller.predict(CRUISE, first)
    assert second["measured"][0].tolist() == CRUISE
    bounds = np.array([40.0, 1e4, 1e8, 2.6, 200.0, 40.0, 40.0, 1.0])  # of the signal registry
    for sign in (1.0, -1.0):
        _, inside = controller.predict(sign * bounds, second)
        assert inside["measured"][0].tolist() == (sign * bounds).tolist()
        _, beyond = controller.predict(sign * bounds * 1.000001, second)
        assert beyond["measured"][0].tolist() == CRUISE


def test_settings_scale_with_the_ship() -> None:
    ship = load_ship("frigate").with_values(
        {
            "propeller.entrained_inertia_kg_m2": 1600.0,
            "transmission.viscous_friction_propeller_side_N_m_s_rad": 300.0,
        }
    )
    settings = AntiSpin(ship, 0.25, top_speed=0.9, highest_advance=0.8, gamma=0.05).settings
    inertia = 53697.0 + 14411.0 + 1600.0
    expected = {
        "anti_spin": 1,
        "inertia": inertia,
        "gamma": 0.05,
        "proportional": 0.6 * inertia,
        "integral": 0.05 * inertia,
        "highest_advance": 0.8,
        "ventilated_speed": 0.92,
        "speed_min": 350.0 * math.pi / 30.0 / 7.38,
        "speed_max": 0.9 * 1000.0 * math.pi / 30.0 / 7.38,
    }
    law = settings["law"]
    for name, value in expected.items():
        found = (settings if name == "ventilated_speed" else law)[name]
        assert found == pytest.approx(value, rel=1e-12), name
    assert law["observer"]["dt"] == law["detector"]["dt"] == 0.25
    assert AntiSpinTuning() == AntiSpinTuning(
        0.1, 0.6, 0.05, 1.5, 1.0, 0.9, ventilated_speed=0.92, top_speed=1.0
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("first", [True, False])
def test_bad_measurements_give_a_finite_action(
    controller: AntiSpin, bad: float, first: bool
) -> None:
    state = None if first else controller.predict(CRUISE)[1]
    for columns in [[c] for c in range(8)] + [list(range(8))]:
        observation = np.array(CRUISE)
        observation[columns] = bad
        memory = state
        for _ in range(5):
            action, memory = controller.predict(observation, memory)
            assert np.all(np.abs(action) <= 1.0)
        action, memory = controller.predict(CRUISE, memory)
        assert np.all(np.isfinite(action))


def test_random_measurements_give_a_finite_action(controller: AntiSpin) -> None:
    rng = np.random.default_rng(5)
    state: Any = None
    for _ in range(200):
        exponent = rng.uniform(-3.0, 9.0, (64, 8))
        observations = rng.choice([-1.0, 1.0], (64, 8)) * 10.0**exponent
        action, state = controller.predict(observations, state)
        assert np.all(np.abs(action) <= 1.0)


# schedule of the advance velocity, and limits only against overspeed


def torque_ratio_after(weight: float, velocity: float, samples: int = 30) -> Any:
    controller, state = AntiSpin("frigate", va_weight=weight), None
    observation = [*CRUISE[:6], velocity, 1.0]
    for _ in range(samples):
        _, state = controller.predict(observation, state)
    assert state is not None
    return state[0]


def test_the_nominal_torque_is_that_of_the_scheduled_velocity() -> None:
    plain = torque_ratio_after(0.0, 0.9 * 7.6)
    for weight, velocity, speed in (
        (0.0, 7.6, 8.0),
        (1.0, 7.6, 8.0),
        (1.0, 0.9 * 7.6, 7.2),
        (1.0, 1.1 * 7.6, 8.8),
        (1.0, 2.0 * 7.6, 8.0),  # outside the band
    ):
        found = torque_ratio_after(weight, velocity)
        assert found["measured"][5] == pytest.approx(speed)
        if speed == 8.0:
            assert found["detection"]["torque_ratio"] == plain["detection"]["torque_ratio"]
    slow, fast = (torque_ratio_after(1.0, f * 7.6)["detection"] for f in (0.9, 1.1))
    # Less inflow means a higher nominal torque, so the same torque is a larger loss.
    assert slow["torque_ratio"] < plain["detection"]["torque_ratio"] < fast["torque_ratio"]


def test_the_schedule_is_held_while_the_propeller_ventilates() -> None:
    controller = AntiSpin("frigate", va_weight=1.0)
    _, state = controller.predict(CRUISE)
    state["detection"]["ventilating"] = 1
    held = state["schedule"].copy()
    _, later = controller.predict([*CRUISE[:6], 9.0, 1.0], state)
    np.testing.assert_array_equal(later["schedule"], held)
    state["detection"]["ventilating"] = 0
    _, later = controller.predict([*CRUISE[:6], 9.0, 1.0], state)
    assert later["schedule"][0, 0] > held[0, 0]


def test_a_limit_against_overspeed_only_stands_down_at_part_load(frigate: Ship) -> None:
    top = frigate.shaft_speeds[1]
    paper, guard = AntiSpin(frigate), AntiSpin(frigate, overspeed_only=1.0)
    assert paper.settings["least_limit"] == frigate.shaft_speeds[0]
    assert guard.settings["least_limit"] == pytest.approx(math.sqrt(0.65) * top)
    deeper = AntiSpin(frigate, overspeed_only=1.0, on_below=0.5, top_speed=0.9)
    assert deeper.settings["least_limit"] == pytest.approx(math.sqrt(0.5) * 0.9 * top)

    def reference(controller: AntiSpin, order: float) -> float:
        speed = float(controller.curve.set_points(order).shaft_speed)
        state = None
        for _ in range(20):  # almost no torque: ventilation is detected
            row = [order, speed, 2e4, 1.392, 10.0, order, 0.95 * order, 1.0]
            _, state = controller.predict(row, state)
        assert state is not None
        assert state["detection"]["ventilating"][0] == 1
        return float(state["reference"][0])

    without = AntiSpin(frigate, anti_spin=False)
    assert reference(guard, 6.0) == reference(without, 6.0) > reference(paper, 6.0)
    assert reference(guard, 11.0) == reference(paper, 11.0) < reference(without, 11.0)


def test_a_bad_weight_is_refused(frigate: Ship) -> None:
    with pytest.raises(ValueError, match=r"anti-spin: va_weight = 3\.0: must be from 0 to 1"):
        AntiSpin(frigate, va_weight=3.0)


def test_scheduled_singles_equal_batches(frigate: Ship) -> None:
    controller = AntiSpin(frigate, va_weight=1.0)
    rng = np.random.default_rng(2)
    fleet: Any = None
    states: list[Any] = [None] * 3
    for _ in range(20):
        observations = np.array(CRUISE) * rng.uniform(0.7, 1.3, (3, 8))
        observations[:, 7] = 1.0
        actions, fleet = controller.predict(observations, fleet)
        for i in range(3):
            action, states[i] = controller.predict(observations[i], states[i])
            np.testing.assert_array_equal(action, actions[i])
            np.testing.assert_array_equal(states[i][0], fleet[i])
