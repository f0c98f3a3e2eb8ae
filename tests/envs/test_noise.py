"""The noise of the instruments: of each, by its seed, and what it acts on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.envs import CLASSIC, FrigateEnv, FrigateVectorEnv
from shaftline.envs.randomness import normal
from shaftline.observers.torque_curve import model_torque
from shaftline.plant import Ship, load_ship

from .by_hand import STILL

USUAL = {
    "shaft_speed": 1e-3 * 1000.0 * math.pi / 30.0 / 7.38,  # 0.1 % of the highest speed
    "shaft_torque": 5e-3 * 38e3 * 7.38,  # 0.5 % of full scale
    "pitch_ratio": 4e-3,
    "shaft_acceleration": 2e-2,
    "ship_speed": 5e-2,
}
COLUMNS = {
    "shaft_speed": "shaft_speed",
    "shaft_torque": "measured_shaft_torque",
    "pitch_ratio": "measured_pitch_ratio",
    "ship_speed": "measured_ship_speed",
}


def readings(noise: Any, intervals: int = 40, n: int = 60) -> Any:
    """Return the observations of n environments under constant commands, shape (intervals + 1, n)."""
    env = FrigateVectorEnv(
        n,
        task=STILL,
        sensor_noise=noise,
        observer="shaft-acceleration",
        control_interval_s=0.05,
        max_episode_steps=None,
        threads=1,
        **CLASSIC,
    )
    env.reset(seed=7)
    rows = [env.batch.arrays.observations.copy()]
    for _ in range(intervals):
        env.step(np.full((n, 2), 0.4, np.float32))
        rows.append(env.batch.arrays.observations.copy())
    return np.stack(rows)


def accelerations(table: Any, ship: Ship) -> Any:
    """Return the shaft accelerations [rad/s2] that the observer read, from its estimates."""
    plant = ship.record()
    flat = table.ravel()
    torque = [
        model_torque(plant, *map(float, row))
        for row in zip(
            flat["estimated_advance_velocity"],
            flat["shaft_speed"],
            flat["measured_pitch_ratio"],
            strict=True,
        )
    ]
    own = (flat["measured_shaft_torque"] - np.array(torque)) / plant["inertia_propeller_side"]
    return own.reshape(table.shape)


def test_every_instrument_has_its_noise_and_no_other() -> None:
    clean, noisy = readings(0.0), readings(1.0)
    errors = {
        name: noisy[column].astype(np.float64) - clean[column] for name, column in COLUMNS.items()
    }
    for name, error in errors.items():
        assert np.std(error) == pytest.approx(USUAL[name], rel=0.05), name
        assert abs(np.mean(error)) < 0.1 * USUAL[name], name
        assert np.std(error[0]) == pytest.approx(USUAL[name], rel=0.35), name  # at the reset too
        assert abs(np.corrcoef(error[1:].ravel(), error[:-1].ravel())[0, 1]) < 0.06, name
    table = np.corrcoef([error.ravel() for error in errors.values()])
    assert np.abs(table - np.eye(len(errors))).max() < 0.06
    for name in ("speed_order", "fuel_rack"):
        assert np.array_equal(clean[name], noisy[name])


def test_the_accelerometers_noise_acts_on_the_observer_alone() -> None:
    ship = load_ship("frigate")
    clean, noisy = readings(0.0, 20), readings({"shaft_acceleration": 2e-2}, 20)
    for column in COLUMNS.values():
        assert np.array_equal(clean[column], noisy[column])
    error = accelerations(noisy, ship) - accelerations(clean, ship)
    assert np.std(error) == pytest.approx(2e-2, rel=0.06)


def test_a_seed_decides_the_noise() -> None:
    """One stream, drawn instrument by instrument; published results rest on its order."""
    batch = FrigateEnv(task=STILL, observer="none", normalised=False).batch
    batch.reset(np.array([0]), [np.random.default_rng(0)], batch.begin(None))
    stream, memory = batch.arrays.episodes[0].copy(), batch.arrays.memories[0]
    batch.observe(np.array([0]))
    draws = [normal(stream) for _ in range(5)]
    shown = batch.observation()[0]
    truth = [batch.arrays.states[0]["shaft_speed"], memory["shaft_torque"], memory["pitch_ratio"]]
    rms = [USUAL[name] for name in ("shaft_speed", "shaft_torque", "pitch_ratio")]
    assert shown[1:4] == pytest.approx(
        [x + s * n for x, s, n in zip(truth, rms, draws, strict=False)]
    )
    assert shown[5] == pytest.approx(memory["speed_log"] + 5e-2 * draws[4])
    assert batch.arrays.episodes[0]["random"] == stream["random"]


def test_noise_by_instrument_and_by_share() -> None:
    clean = readings(0.0, 10)
    log, half = readings({"ship_speed": 0.2}, 10), readings(0.5, 10)
    for name, column in COLUMNS.items():
        error = log[column].astype(np.float64) - clean[column]
        assert np.std(error) == pytest.approx(0.2 if name == "ship_speed" else 0.0, rel=0.1)
        error = half[column].astype(np.float64) - clean[column]
        assert np.std(error) == pytest.approx(0.5 * USUAL[name], rel=0.1)


def test_noise_does_not_act_on_the_plant_where_no_governor_uses_it() -> None:
    actions = np.random.default_rng(1).uniform(-0.2, 0.9, (12, 2)).astype(np.float32)
    truths = []
    for noise in (0.0, 1.0):
        env = FrigateEnv(task="transit", sensor_noise=noise, **CLASSIC)
        env.reset(seed=3)
        truths.append([env.step(action)[4]["shaft_speed"] for action in actions])
    assert truths[0] == truths[1]
