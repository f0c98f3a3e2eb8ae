"""The preview of the waves, and ships that differ from their file: what some tasks have besides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.baselines.controller import PREVIEW
from shaftline.envs import FrigateEnv, FrigateVectorEnv
from shaftline.plant.state import get_state
from shaftline.plant.waves import inflow_ahead

N = 40


def previews(**settings: Any) -> Any:
    """Return the preview of one episode in units, shape (N, 7), with its true inflow, shape (N,)."""
    env = FrigateEnv(task="wave-preview", normalised=False, **settings)
    first = env.batch.observed.index(PREVIEW[0])
    observation, _ = env.reset(seed=3, options={"initial_speed_m_s": 6.0, "speed_order_m_s": 6.0})
    rows, true = [observation], []
    for _ in range(N):
        arrays = env.batch.arrays
        found, elapsed = np.empty(1), 0.5 * float(arrays.episodes["elapsed"][0])
        inflow_ahead(arrays.seas[0], elapsed, get_state(arrays.states[0]), 1.0, found)
        true.append(float(found[0]))
        rows.append(env.step(np.zeros(2, np.float32))[0])
    return np.array(rows[:-1])[:, first : first + 7], np.array(true)


def test_the_preview_tells_what_comes_where_the_ship_keeps_her_speed() -> None:
    seen, true = previews(sensor_noise=0.0)
    assert np.allclose(seen[:, 0], true, atol=1e-6)
    assert np.std(true) > 0.1
    for ahead in (1, 3, 6):  # two intervals a second; she gathers way, so it is not exact
        error = seen[: -2 * ahead, ahead] - true[2 * ahead :]
        assert np.std(error) < 0.1 * np.std(true)
        assert np.std(seen[: -2 * ahead, ahead] - true[: -2 * ahead]) > 0.3 * np.std(true)


def test_its_noise_is_that_of_the_instrument() -> None:
    noisy, _ = previews(sensor_noise={"wave_inflow": 0.2})
    clean, _ = previews(sensor_noise=0.0)
    assert np.std(noisy - clean) == pytest.approx(0.2, rel=0.1)


def test_other_tasks_have_no_preview_and_meet_the_same_episode() -> None:
    plain, ahead = (
        FrigateEnv(task=task, sensor_noise=0.0) for task in ("rough-sea", "wave-preview")
    )
    assert not set(PREVIEW) & set(plain.batch.observed)
    assert plain.reset(seed=5)[0].shape == (15,)
    assert ahead.reset(seed=5)[0].shape == (22,)
    for _ in range(5):
        assert plain.step(np.ones(2, np.float32))[1] == ahead.step(np.ones(2, np.float32))[1]


def test_a_task_draws_a_ship_each_episode_unless_it_is_told_otherwise() -> None:
    env = FrigateVectorEnv(64, task="unknown-ship", threads=1)
    env.reset(seed=0)
    drawn = env.batch.arrays.plants["resistance_coefficient"]
    file = float(env.batch.ship.record()["resistance_coefficient"])
    assert 0.7 <= drawn.min() / file < 0.8
    assert 1.2 < drawn.max() / file <= 1.3
    known = FrigateVectorEnv(8, task="unknown-ship", randomise={}, threads=1)
    known.reset(seed=0)
    assert (known.batch.arrays.plants["resistance_coefficient"] == file).all()
