"""A policy is evaluated in the environment that its recipe describes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shaftline.agents import read_recipe
from shaftline.agents.evaluation.statistics import interquartile_mean
from shaftline.agents.learning.training import FIRST_EVALUATION_SEED, evaluate_policy
from shaftline.envs import FrigateVectorEnv

from ..tiny import plain_policy


@pytest.mark.parametrize(
    "own",
    [
        {"sea": {"hs_m": [1.0, 3.0], "tp_s": 8.0}},
        {"observer": "luenberger", "tuning": "low"},
        {"randomise": {"hull.resistance_coefficient_N_s2_m2": 0.5}},
    ],
)
def test_evaluation_intervals_use_every_keyword_of_the_recipe(own: dict[str, Any]) -> None:
    """The evaluation uses the same keywords of the environment as the training."""
    policy = plain_policy("rough-sea")
    keywords: dict[str, Any] = {"max_episode_steps": 10, "sensor_noise": 0.0, "observer": "none"}
    keywords |= own
    plan = read_recipe("ppo", "rough-sea", env_kwargs=keywords)
    found = evaluate_policy(policy, plan, "frigate-at-sea", threads=1)
    env = FrigateVectorEnv(24, threads=1, ship="frigate-at-sea", task="rough-sea", **keywords)
    env.reset(seed=FIRST_EVALUATION_SEED)
    rewards = sum(env.step(np.zeros((24, 2)))[1] for _ in range(10))
    assert found["reward"] == pytest.approx(interquartile_mean(rewards))
    default = read_recipe("ppo", "rough-sea", env_kwargs={"max_episode_steps": 10})
    plain = evaluate_policy(policy, default, "frigate-at-sea", threads=1)
    assert found != plain
