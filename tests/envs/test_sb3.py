from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env

from shaftline.envs import FrigateEnv, FrigateVectorEnv, tasks
from shaftline.envs.records import TRUTHS
from shaftline.envs.sb3 import Sb3Frigates
from shaftline.observers import observer_names


@pytest.mark.parametrize("task", tasks())
@pytest.mark.parametrize("observer", observer_names())
def test_checker_has_nothing_to_say(observer: str, task: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(FrigateEnv(task=task, observer=observer, max_episode_steps=8))


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
    assert envs.seed(3) == [3, 4, 5]
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
        assert info["ship_speed"] == pytest.approx(info["terminal_observation"][5], abs=0.3)
        assert set(info) == {"terminal_observation", "TimeLimit.truncated", *TRUTHS}
    following = envs.reset()  # a seed is for one reset
    assert not np.array_equal(following, first)
    assert envs.seed(None) == [None] * 3
    assert not np.array_equal(envs.reset(), following)
    envs.seed(3)
    assert np.array_equal(envs.reset(), first)


def test_it_is_the_vector_environment_step_by_step() -> None:
    envs, vector = Sb3Frigates(3, episode_s=4.0), FrigateVectorEnv(3, episode_s=4.0)
    envs.seed(5)
    assert np.array_equal(envs.reset(), vector.reset(seed=5)[0])
    for k in range(12):
        action = np.full((3, 2), 0.05 * k, np.float32)
        observation, reward, done, infos = envs.step(action)
        expected, due, terminated, truncated, _ = vector.step(action)
        assert np.array_equal(observation, expected)  # type: ignore[arg-type]
        assert reward == pytest.approx(due)
        assert reward.dtype == np.float32
        assert np.array_equal(done, terminated | truncated)
        assert (infos == [{}] * 3) == (not done.any())


def test_a_stall_at_the_last_interval_is_no_time_out() -> None:
    envs = Sb3Frigates(2, episode_s=0.5, sea="calm")
    envs.reset()
    envs.vector.batch.arrays.states["shaft_speed"][0] = 0.2
    _, _, done, infos = envs.step(np.zeros((2, 2)))
    assert done.all()
    assert [info["TimeLimit.truncated"] for info in infos] == [False, True]


def test_attributes_and_methods_are_the_vector_environments() -> None:
    envs = Sb3Frigates(3, episode_s=4.0)
    assert envs.get_attr("batch") == [envs.vector.batch] * 3
    assert envs.get_attr("num_envs", [0, 2]) == [3, 3]
    assert envs.get_attr("render_mode") == [None] * 3
    envs.set_attr("mark", 7)
    assert envs.vector.mark == 7  # type: ignore[attr-defined]
    found = envs.env_method("reset", seed=4, indices=[1])
    assert len(found) == 1
    assert np.array_equal(found[0][0], FrigateVectorEnv(3, episode_s=4.0).reset(seed=4)[0])
    assert envs.env_is_wrapped(object, [0, 1]) == [False, False]
    closed: list[bool] = []
    envs.vector.close = lambda **_: closed.append(True)  # type: ignore[method-assign]
    envs.close()
    assert closed == [True]
