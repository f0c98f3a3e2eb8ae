from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env

from shaftline.envs import FrigateEnv, tasks
from shaftline.envs.sb3 import Sb3Frigates
from shaftline.observers import observer_names


@pytest.mark.parametrize("task", tasks())
@pytest.mark.parametrize("observer", observer_names())
def test_checker_has_nothing_to_say(observer: str, task: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(FrigateEnv(task=task, observer=observer, episode_s=4.0))


@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_algorithms_learn_on_it(algorithm: type[PPO] | type[SAC]) -> None:
    envs = Sb3Frigates(4, episode_s=5.0)
    keywords: dict[str, Any] = (
        {"n_steps": 16, "batch_size": 32} if algorithm is PPO else {"learning_starts": 20}
    )
    model = algorithm("MlpPolicy", envs, device="cpu", seed=0, **keywords)
    model.learn(128)
    assert np.isfinite(model.predict(envs.reset())[0]).all()


def test_ended_episodes_say_how() -> None:
    envs = Sb3Frigates(3, episode_s=2.0, sea="calm")
    envs.seed(3)
    first = envs.reset()
    action = np.full((3, 2), 0.2, np.float32)
    for _ in range(4):
        observation, _, done, infos = envs.step(action)
    assert isinstance(observation, np.ndarray)
    assert done.all()
    for i, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True
        assert info["terminal_observation"].shape == (8,)
        assert not np.array_equal(info["terminal_observation"], observation[i])
    envs.seed(3)
    assert np.array_equal(envs.reset(), first)
