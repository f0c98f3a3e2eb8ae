"""What a stranger tries first: PPO with its defaults on the default environment."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import shaftline.envs  # noqa: F401 (registers the environments)
from reproductions.learners.references import reference, returns_of
from reproductions.learners.trainings import Trained


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_default_ppo_ends_above_the_combinator(seed: int) -> None:
    stable = pytest.importorskip("stable_baselines3")
    env = gymnasium.make("shaftline/Frigate-v0")
    model = stable.PPO("MlpPolicy", env, seed=seed, device="cpu").learn(100_000)
    learned = returns_of(Trained(model, {}), "speed-keeping", 24).values
    combinator = returns_of(reference("speed-keeping", "combinator"), "speed-keeping", 24).values
    assert np.mean(learned) > np.mean(combinator)
