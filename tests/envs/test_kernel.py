"""The compiled interval against the plant stepped by hand, and its parts at their limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.envs import CLASSIC, TERMS, FrigateEnv, get_task
from shaftline.envs.kernel import (
    ENDINGS,
    RUNNING,
    STALLED,
    TRIPPED,
    _gains_at,
    _why_ended,
    disturbance,
)
from shaftline.envs.records import EPISODE
from shaftline.envs.sensing import speed_order
from shaftline.observers import get_observer, update
from shaftline.observers.records import ESTIMATE, Measurement
from shaftline.plant import load_ship
from shaftline.plant.cavitation import burrill_ratio, effective_attack, outside_bucket
from shaftline.plant.drives.diesel import rack_torque, torque_limit
from shaftline.plant.emissions import nox_rate
from shaftline.plant.expressions import NO_SIGNALS

from .by_hand import STILL, ByHand, Moment

FAULTY = load_ship("frigate").with_values(
    {
        "prime_mover.lag_s": 0.4,
        "prime_mover.rack_rate_limit_mm_s": 8.0,
        "propeller.inflow_lag_s": 0.5,
        "sensors.pitch_offset": 0.02,
        "sensors.torque_bias_N_m": 2000.0,
        "sensors.torque_gain": 1.1,
        "sensors.speed_log_lag_s": 3.0,
        "propeller.expanded_area_ratio": 0.5,
        "cavitation_bucket.centre_deg": 4.0,
        "cavitation_bucket.suction_deg": 0.05,
        "cavitation_bucket.pressure_deg": 0.1,
        "emissions.nox_base_g_kWh": 9.0,
        "emissions.nox_m1_s0": 0.4,
    }
)
"""On this ship each measurement differs from the true value, the rack from its command."""

OPTIONS: dict[str, Any] = {
    "speed_order_m_s": (5.0, 5.5, 6.5),
    "order_interval_s": 0.7,
    "initial_speed_m_s": 9.0,
}
PLAN = np.full((40, 2), (0.9, 1.0), np.float32)
PLAN[:6] = np.random.default_rng(1).uniform(-0.2, 0.6, (6, 2))
"""Random actions, and then so much fuel that the engine trips where nothing limits it."""


def storm(**settings: Any) -> tuple[FrigateEnv, ByHand, Any]:
    """Return an environment in a storm, its reference by hand, and the first observation."""
    plain: dict[str, Any] = {"task": "storm", "normalised": False, "action_mode": "absolute"}
    env = FrigateEnv(ship=FAULTY, sea="state-7", sensor_noise=0.0, **plain | settings)
    first, _ = env.reset(seed=4, options=OPTIONS)
    return env, ByHand(env), first


FORMS = [
    (mode, command)
    for mode in ("absolute", "increment")
    for command in ("fuel-rack", "limited-rack", "shaft-speed")
]


@pytest.mark.parametrize(("mode", "command"), FORMS)
def test_observation_and_truth_are_the_plants_at_the_intervals_last_step(
    mode: str, command: str
) -> None:
    env, hand, _ = storm(action_mode=mode, command=command, observer="shaft-acceleration")
    observer = get_observer("shaft-acceleration").discretise(env.batch.ship, env.batch.dt)
    estimate = env.batch.arrays.estimates[0].copy()
    changed, ventilated = set(), 0.0
    for action in PLAN:
        seen, _, terminated, _, info = env.step(action)
        moments = hand.interval(action)
        for now in moments:
            velocity = update(
                observer,
                estimate,
                Measurement(
                    now.shaft_speed,
                    now.measured_torque_of,
                    now.measured_pitch_of,
                    now.outputs.shaft_acceleration,
                    now.outputs.advance_velocity,
                ),
            )
        expected = [
            now.order,
            now.shaft_speed,
            now.measured_torque_of,
            now.measured_pitch_of,
            now.rack,
            now.log,
            velocity,
            estimate["valid"],
        ]
        assert seen[:8] == pytest.approx(np.asarray(expected, np.float32), rel=1e-6)
        assert seen[9] == pytest.approx(hand.commands[0], rel=1e-6)
        assert seen[14] == pytest.approx(hand.commands[1], rel=1e-6)
        truth = {
            "advance_velocity": now.outputs.advance_velocity,
            "thrust": now.outputs.thrust,
            "fuel_flow": now.fuel,
            "ventilation": now.ventilation_after,
            "ship_speed": now.ship_speed,
            "shaft_speed": now.shaft_speed,
            "shaft_torque": now.outputs.shaft_torque,
            "brake_torque": now.outputs.brake_torque,
            "position": now.position_after,
            "blade_pitch": now.outputs.pitch_ratio,
            "angle_of_attack": attack_of(hand.plant, now),
            "outside_bucket": outside_bucket(
                hand.plant, attack_of(hand.plant, now), now.shaft_speed, now.outputs.submergence
            ),
        }
        assert {name: info[name] for name in truth} == pytest.approx(truth, rel=1e-9)
        assert len({*expected, *truth.values()}) >= len(expected) + len(truth) - 2
        changed |= {now.order for now in moments}
        ventilated = max(ventilated, now.ventilation_after)
        if terminated:
            break
    assert changed == {5.0, 5.5, 6.5}
    assert ventilated > 0.1


def test_the_first_observation_is_of_the_beginning() -> None:
    env, hand, first = storm(observer="oracle")
    now = hand.interval(PLAN[0])[0]
    own = env.batch.arrays.episodes[0]
    assert first[:2] == pytest.approx(np.asarray([5.0, now.shaft_speed], np.float32))
    # torque and inflow lag, so they do not depend on the command that comes next
    assert first[2] == pytest.approx(now.measured_torque_of, rel=1e-6)
    assert first[3] == pytest.approx(now.measured_pitch_of, rel=1e-6)
    assert first[4] == pytest.approx(own["drive"], rel=1e-6)
    assert first[5:7] == pytest.approx(
        np.asarray([now.log, now.outputs.advance_velocity], np.float32)
    )
    assert own["mean_torque"] == pytest.approx(now.outputs.shaft_torque)
    assert own["mean_brake_torque"] == pytest.approx(now.outputs.brake_torque)
    assert own["mean_attack"] == pytest.approx(attack_of(hand.plant, now))


def test_the_observed_ship_speed_is_the_reading_of_the_log() -> None:
    env, _, first = storm(command="fuel-rack")
    for _ in range(8):
        seen, _, _, _, info = env.step((0.9, -0.5))
    assert abs(seen[5] - info["ship_speed"]) > 0.015 > abs(first[5] - 9.0)


def attack_of(plant: Any, now: Moment) -> float:
    out = now.outputs
    return float(effective_attack(plant, out.advance_velocity, now.shaft_speed, out.pitch_ratio))


def averaged_signals(plant: Any, now: Moment) -> Any:
    """Return the signals with a mean over 20 s: shaft and engine torque, angle of attack, ship speed."""
    out = now.outputs
    return np.array([out.shaft_torque, out.brake_torque, attack_of(plant, now), now.ship_speed])


def by_formula(
    plant: Any, moments: list[Moment], before: Moment, means: list[Any], episode: Any
) -> Any:
    """Return the terms of an interval, from the plant's own equations."""
    rows = []
    for last, now, mean in zip([before, *moments], moments, means, strict=False):
        swing = np.abs(averaged_signals(plant, now) - mean)
        engine = plant["gear_ratio"] * now.shaft_speed
        out, error = now.outputs, now.ship_speed - now.order
        order = [5.0, 5.5, 6.5].index(now.order)
        way = plant["mass"] * mean[3] * (now.ship_speed - mean[3]) / 20.0
        towing = episode["reference_power"][order]
        asked = rack_torque(plant, engine, now.rack) / torque_limit(plant, engine)
        burrill = burrill_ratio(
            plant,
            out.thrust,
            out.advance_velocity,
            now.shaft_speed,
            out.pitch_ratio,
            out.submergence,
        )
        rows.append(
            {
                "speed_error_m_s": abs(error),
                "fuel_kg_s": now.fuel,
                "nox_g_s": 2.0 * nox_rate(plant, engine, out.brake_torque),
                "overload": max(asked - 1.0, 0.0),
                "fuel_excess": now.fuel / episode["reference_fuel"][order] - way / towing - 1.0,
                "rack_travel_mm": len(moments) * abs(now.drive - last.drive),
                "cavitation": max(burrill - 1.0, 0.0),
                "overspeed": max(engine / plant["engine_speed_max"] - 1.0, 0.0),
                "pitch_travel": len(moments) * abs(out.pitch_ratio - last.outputs.pitch_ratio),
                "torque_fluctuation": swing[0] / (38e3 * 7.38),
                "engine_fluctuation": swing[1] / 38e3,
                "attack_fluctuation_deg": swing[2],
                "outside_bucket_deg": outside_bucket(
                    plant, attack_of(plant, now), now.shaft_speed, out.submergence
                ),
                "near_limit": np.clip((asked - 0.95) / 0.05, 0.0, 1.0),
                "heading_error_deg": 0.0,
                "track_error_m": 0.0,
                "rudder_rate_deg_s": 0.0,
            }
        )
    return {name: np.mean([row[name] for row in rows]) for name in rows[0]}


@pytest.mark.parametrize(("mode", "command"), FORMS)
def test_reward_terms_are_means_over_the_interval(mode: str, command: str) -> None:
    env, hand, _ = storm(action_mode=mode, command=command)
    start = env.batch.arrays.episodes[0].copy()
    means_of = ("torque", "brake_torque", "attack", "speed")
    mean = np.array([start[f"mean_{name}"] for name in means_of])
    before: Any = None
    met: dict[str, float] = {}
    for action in PLAN:
        _, _, terminated, _, info = env.step(action)
        moments = hand.interval(action)
        if before is None:
            before = moments[0]._replace(drive=float(start["drive"]))
        means = []
        for now in moments:
            mean = mean + 0.05 / 20.0 * (averaged_signals(hand.plant, now) - mean)
            means.append(mean)
        expected = by_formula(hand.plant, moments, before, means, start)
        found = dict(info["reward_terms"])
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
        met = {name: max(met.get(name, 0.0), abs(value)) for name, value in expected.items()}
        before = moments[-1]
        if terminated:
            break
    steered = ("heading_error_deg", "track_error_m", "rudder_rate_deg_s")
    never = [name for name, value in met.items() if value == 0.0 and name not in steered]
    if (mode, command) == ("absolute", "fuel-rack"):
        assert not never


def test_the_interval_of_a_failure_has_no_reward_and_the_failure_is_named() -> None:
    env = FrigateEnv(task=STILL, control_interval_s=0.05)
    limit = 1000.0 * math.pi / 30.0 / 7.38
    for speed, why in ((1.3 * limit, "overspeed trip"), (0.25, "stalled"), (0.9 * limit, None)):
        env.reset(seed=0)
        env.batch.arrays.states["shaft_speed"] = speed
        _, reward, terminated, _, info = env.step([1.0, -1.0])
        assert terminated == (why is not None)
        assert info.get("ended") == why
        assert (reward == 0.0) == terminated


def test_the_shaft_may_run_from_three_tenths_of_its_lowest_speed_to_the_trip() -> None:
    plant = load_ship("frigate").record()
    low, high = (rpm * math.pi / 30.0 / 7.38 for rpm in (350.0, 1000.0))
    assert _why_ended(plant, 1.1499 * high) == RUNNING
    assert _why_ended(plant, 1.1501 * high) == TRIPPED
    assert _why_ended(plant, 0.3001 * low) == RUNNING
    assert _why_ended(plant, 0.2999 * low) == STALLED
    assert _why_ended(plant, math.nan) == STALLED
    assert ENDINGS == (None, "stalled", "overspeed trip")


def episode(**values: Any) -> Any:
    record = np.zeros(1, EPISODE)[0]
    for name, value in values.items():
        record[name] = value
    return record


def test_orders_follow_one_another_and_the_last_is_held() -> None:
    record = episode(orders=np.arange(64.0), order_interval=10.0)
    times = {
        0.0: 0.0,
        9.99: 0.0,
        10.0: 1.0,
        19.99: 1.0,
        629.9: 62.0,
        630.0: 63.0,
        640.0: 63.0,
        1e6: 63.0,
    }
    assert {time: speed_order(record, time) for time in times} == times


def test_resistance_swings_about_its_mean() -> None:
    record = episode(
        resistance_mean=1.2,
        resistance_swing=0.1,
        resistance_frequency=math.pi / 40.0,
        resistance_phase=math.pi / 6.0,
    )
    for time, sine in ((0.0, 0.5), (40.0 / 3.0, 1.0), (100.0 / 3.0, 0.0), (160.0 / 3.0, -1.0)):
        found = disturbance(record, time)
        assert found[:3] == pytest.approx((0.0, 0.0, 1.2 + 0.1 * sine))
        assert found.outside == NO_SIGNALS


def test_gains_lie_on_lines_between_the_speeds_of_the_tuning() -> None:
    gains = np.array([[4.0, 6.0, 10.0], [1.0, 2.0, 8.0], [0.5, 0.4, 0.0]])
    expected = {
        3.0: (1.0, 0.5),
        4.0: (1.0, 0.5),
        5.5: (1.75, 0.425),
        6.0: (2.0, 0.4),
        7.0: (3.5, 0.3),
        9.0: (6.5, 0.1),
        10.0: (8.0, 0.0),
        12.0: (8.0, 0.0),
    }
    for speed, pair in expected.items():
        assert _gains_at(gains, speed) == pytest.approx(pair)
    for speed in (3.0, 4.0, 5.0):
        assert _gains_at(gains[:, :1].copy(), speed) == (1.0, 0.5)


def test_the_first_estimate_begins_from_nothing() -> None:
    env, _, first = storm(observer="none")
    assert tuple(env.batch.arrays.estimates[0]["x"]) == (0.0,) * 4
    assert np.zeros(1, ESTIMATE)[0]["valid"] == env.batch.arrays.estimates[0]["valid"] == first[7]


def test_terms_are_cleared_before_every_interval() -> None:
    env = FrigateEnv(task=STILL, sensor_noise=0.0, **CLASSIC)
    env.reset(seed=0)
    first = env.step([0.5, 1.0])[4]["reward_terms"]["rack_travel_mm"]
    second = env.step([0.5, 1.0])[4]["reward_terms"]["rack_travel_mm"]
    assert first > 10.0
    assert second == 0.0


def test_goals_are_the_tasks() -> None:
    record, goals = FrigateEnv(task="storm").batch.common["goals"], get_task("storm").goals.used
    assert goals
    for name in TERMS:
        goal = goals.get(name)
        found = tuple(float(record[part][name]) for part in ("within", "margin", "weight"))
        assert found == ((goal.within, goal.margin, goal.weight or 0.0) if goal else (0.0,) * 3)
