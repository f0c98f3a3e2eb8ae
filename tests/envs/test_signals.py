"""Observations: the learner's signals, the scaling, and the bounds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines.controller import OBSERVED, measurements_of
from shaftline.baselines.helmsman import STEERED
from shaftline.envs import FrigateEnv, FrigateVectorEnv, SteeringVectorEnv
from shaftline.envs.records import COURSE_ERRORS, LEARNER_SIGNALS
from shaftline.plant.cavitation import effective_attack
from shaftline.plant.drives.diesel import rack_torque

INTERVAL_S, MEAN_S = 0.5, 20.0


def test_signals_stand_in_one_order() -> None:
    env, steered = FrigateEnv(), SteeringVectorEnv(1)
    assert env.batch.observed == (*OBSERVED, *LEARNER_SIGNALS, "shaft_speed_command")
    assert steered.batch.observed == (
        *OBSERVED,
        *STEERED,
        *LEARNER_SIGNALS,
        *COURSE_ERRORS,
        "shaft_speed_command",
    )
    rack = FrigateEnv(command="limited-rack").batch.observed
    assert rack == (*OBSERVED, *LEARNER_SIGNALS, "fuel_rack_command")
    residual = FrigateEnv(action_mode="residual").batch.observed
    assert residual == (*rack, "base_pitch_ratio", "base_fuel_rack")


def test_signals_of_the_learner_follow_from_the_measured_ones() -> None:
    """Deviations are from a mean that moves to each new sample by the interval's share of 20 s."""
    env = FrigateEnv(task="storm", normalised=False)
    seen, _ = env.reset(seed=3)
    plant, means = env.batch.ship.record(), np.zeros(3)
    rng = np.random.default_rng(0)
    largest = np.zeros(3)
    for k in range(60):
        order, speed, torque, pitch, rack, log, estimate = map(float, seen[:7])
        attack = effective_attack(plant, estimate, speed, pitch)
        now = np.array([torque, rack_torque(plant, plant["gear_ratio"] * speed, rack), attack])
        means = now.copy() if k == 0 else means + INTERVAL_S / MEAN_S * (now - means)
        deviations = now - means
        assert seen[8] == pytest.approx(order - log, abs=1e-5)
        assert seen[10] == pytest.approx(deviations[0], abs=0.1)
        assert seen[11] == pytest.approx(deviations[1], abs=0.1)
        assert seen[12] == pytest.approx(attack, rel=1e-5, abs=1e-5)
        assert seen[13] == pytest.approx(deviations[2], abs=1e-4)
        largest = np.maximum(largest, np.abs(deviations))
        seen, *_ = env.step(rng.uniform(-1.0, 1.0, 2))
    assert (largest > (5e4, 2e3, 1.0)).all()


@pytest.mark.parametrize("interval_s", [25.0, 0.05])
def test_the_mean_of_a_deviation_moves_with_the_control_interval(interval_s: float) -> None:
    env = FrigateEnv(control_interval_s=interval_s, normalised=False, sensor_noise=0.0)
    first, _ = env.reset(seed=1)
    seen, *_ = env.step([-1.0, 1.0])
    change = float(seen[2] - first[2])
    kept = 1.0 - min(interval_s / MEAN_S, 1.0)
    assert abs(change) > 100.0
    assert seen[10] == pytest.approx(kept * change, rel=1e-3, abs=0.1)


RANGES: dict[str, tuple[float, float]] = {
    "shaft_speed": (0.0, 1000.0 * math.pi / 30.0 / 7.38),
    "measured_shaft_torque": (0.0, 38e3 * 7.38),
    "measured_pitch_ratio": (0.6, 1.4),
    "fuel_rack": (0.0, 40.0),
    "estimate_valid": (0.0, 1.0),
    "speed_error": (-2.0, 2.0),
    "pitch_command": (0.6, 1.4),
    "shaft_torque_deviation": (-56088.0, 56088.0),
    "engine_torque_deviation": (-7600.0, 7600.0),
    "estimated_angle_of_attack": (0.0, 10.0),
    "angle_of_attack_deviation": (-4.0, 4.0),
    "fuel_rack_command": (0.0, 40.0),
    "base_pitch_ratio": (0.6, 1.4),
    "base_fuel_rack": (0.0, 40.0),
    "shaft_speed_command": (350.0 * math.pi / 30.0 / 7.38, 1000.0 * math.pi / 30.0 / 7.38),
}
"""Range of each signal of the frigate that is scaled to -1 to 1."""


@pytest.mark.parametrize(
    "settings", [{"sensor_noise": 30.0}, {"action_mode": "residual"}], ids=["noisy", "residual"]
)
def test_normalised_observations_are_scaled_by_the_ranges_and_clipped(
    settings: dict[str, Any],
) -> None:
    plain = FrigateVectorEnv(4, task="storm", normalised=False, threads=1, **settings)
    scaled = FrigateVectorEnv(4, task="storm", threads=1, **settings)
    top = float(plain.batch.table["ship_speed"].max())
    ends = RANGES | dict.fromkeys(
        ("speed_order", "measured_ship_speed", "estimated_advance_velocity"), (0.0, top)
    )
    low, high = np.array([ends[name] for name in plain.batch.observed]).T
    raw, _ = plain.reset(seed=2)
    seen, _ = scaled.reset(seed=2)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (60, 4, 2))
    clipped = 0
    for action in actions:
        expected = (raw - 0.5 * (low + high)) / (0.5 * (high - low))
        assert seen == pytest.approx(np.clip(expected, -3.0, 3.0), abs=2e-5)
        clipped += int((np.abs(expected) > 3.0).sum())
        assert seen.dtype == np.float32
        raw, seen = plain.step(action)[0], scaled.step(action)[0]
    assert clipped > 0


FAR: list[dict[str, Any]] = [
    {"sensor_noise": 1e6},
    {"sensor_noise": {"shaft_speed": 1e3}},
    {"sea": {"hs_m": 12.0, "tp_s": 14.0}, "task": "storm"},
    {"ship": "ferry", "task": "transit"},
    {"observer": "none"},
    {"observer": "oracle", "sensor_noise": 0.0},
]


@pytest.mark.parametrize("settings", FAR)
def test_observations_stay_in_the_box_far_outside_the_usual(settings: dict[str, Any]) -> None:
    env = FrigateVectorEnv(8, threads=1, **settings)
    space: Any = env.observation_space
    assert space.shape == (8, 15)
    assert (np.abs(space.low).max(), np.abs(space.high).max()) == (3.0, 3.0)
    seen, _ = env.reset(seed=1, options={"speed_order_m_s": (40.0, 0.0), "order_interval_s": 5.0})
    rng = np.random.default_rng(2)
    for _ in range(60):
        assert space.contains(seen)
        seen, _, _, _, info = env.step(rng.choice([-1.0, 1.0], (8, 2)))
        for last in info.get("final_obs", []):
            assert last is None or env.single_observation_space.contains(last)


@pytest.mark.parametrize("task", ["course-keeping", "track-keeping"])
def test_steered_observations_stay_in_the_box(task: str) -> None:
    env = SteeringVectorEnv(4, task=task, threads=1, max_episode_steps=None)
    plain = SteeringVectorEnv(4, task=task, threads=1, max_episode_steps=None, normalised=False)
    seen, _ = env.reset(seed=1)
    raw, _ = plain.reset(seed=1)
    index = {name: k for k, name in enumerate(env.batch.observed)}
    length = env.batch.ship.manoeuvring.length_m
    halves = {"heading": math.pi, "cross_track": length, "rudder_angle": math.radians(35.0)}
    hard = np.tile([0.0, 0.0, 1.0], (4, 1))
    for _ in range(1100):
        assert env.observation_space.contains(seen)
        for name, half in halves.items():
            expected = np.clip(raw[:, index[name]] / half, -3.0, 3.0)
            assert seen[:, index[name]] == pytest.approx(expected, abs=1e-4), name
        seen, raw = env.step(hard)[0], plain.step(hard)[0]
    assert np.abs(raw[:, index["heading"]]).max() > 3.0 * math.pi  # beyond the box


def test_classic_controllers_refuse_normalised_observations_and_ignore_further_columns() -> None:
    seen, _ = FrigateVectorEnv(3).reset(seed=1)
    with pytest.raises(ValueError, match=r"observation is normalised.*\*\*shaftline.envs.CLASSIC"):
        measurements_of(seen)
    raw, _ = FrigateVectorEnv(3, normalised=False).reset(seed=1)
    found = measurements_of(raw)
    assert np.array_equal(np.column_stack(found[:8]), raw[:, :8].astype(np.float64))
    with pytest.raises(
        ValueError,
        match="the observation has 7 signals, but controllers need the 8 signals speed_order",
    ):
        measurements_of(raw[:, :7])
