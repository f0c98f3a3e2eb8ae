"""The first policy for the rudder: what it sees, what its answers do, and what silence does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.baselines import make_steering
from shaftline.envs import CLASSIC, SteeringVectorEnv

pytest.importorskip("stable_baselines3")

from shaftline.studies.steering.learning import (
    FEATURES,
    REACH,
    Corrected,
    RudderEnv,
    corrected,
    features,
    sail,
    trained,
)


class Silent:
    """A policy that answers the same to everything."""

    def __init__(self, answer: float) -> None:
        self.answer = answer

    def predict(self, rows: Any, deterministic: bool = True) -> tuple[Any, None]:
        return np.full((len(rows), 1), self.answer), None


def test_an_answer_turns_the_helmsman_s_rudder() -> None:
    env = SteeringVectorEnv(3, task="course-keeping", **CLASSIC)
    base = make_steering("autopilot", env.batch.ship, 0.5)
    observation, _ = env.reset(seed=1)
    action, _ = base.predict(observation)
    turned = corrected(action, np.array([[0.5], [-9.0], [0.0]]), base)
    most = base.helmsman.most
    assert (turned[:, 2] - action[:, 2]) * most == pytest.approx(
        [0.5 * REACH, -REACH, 0.0], abs=1e-6
    )
    assert np.array_equal(turned[:, :2], action[:, :2])
    rows = features(observation, action[:, 2], action[:, 2], base)
    assert rows.shape == (3, len(FEATURES))
    missing = (observation[:, 8] - observation[:, 9] + math.pi) % (2.0 * math.pi) - math.pi
    assert rows[:, 0] == pytest.approx(missing / 0.3, rel=1e-5)


def test_a_policy_whose_answers_are_zero_is_the_helmsman() -> None:
    ship = SteeringVectorEnv(1, task="track-keeping").batch.ship
    base = make_steering("track-keeper:change_lengths=8", ship, 0.5)
    one, other, third = (
        sail(who, "track-keeping", 5, 3, max_episode_steps=60)
        for who in (base, Corrected(base, Silent(0.0)), Corrected(base, Silent(1.0)))
    )
    assert np.array_equal(one.reward, other.reward)
    assert one.kpis.equals(other.kpis)
    assert not np.array_equal(one.reward, third.reward)


def test_training_runs_from_where_the_helmsman_is() -> None:
    env = SteeringVectorEnv(2, task="course-keeping", max_episode_steps=10, **CLASSIC)
    venv = RudderEnv(env, make_steering("autopilot", env.batch.ship, 0.5))
    first = venv.reset()
    assert first.shape == (2, len(FEATURES))
    ended = 0
    rows: Any
    for _ in range(12):
        rows, reward, done, infos = venv.step(np.zeros((2, 1), np.float32))
        ended += int(done.sum())
        for i in np.flatnonzero(done):
            assert infos[i]["terminal_observation"].shape == (len(FEATURES),)
            assert infos[i]["TimeLimit.truncated"]
    assert ended >= 2
    assert np.isfinite(rows).all()
    assert np.isfinite(reward).all()
    policy = trained("course-keeping", "autopilot", 1, 2048, environments=8)
    weights: Any = policy.policy.policy.action_net.weight.detach().numpy()
    assert 0.0 < np.abs(weights).max() < 1.0  # it has begun at 0, and learned
