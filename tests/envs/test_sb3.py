"""The environments under stable-baselines3."""

from __future__ import annotations

import json
import pickle
import warnings
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecMonitor

from shaftline.envs import TERMS, FrigateEnv, FrigateVectorEnv, SteeringVectorEnv, tasks
from shaftline.envs.records import TRUTHS
from shaftline.envs.sb3 import Sb3Frigates
from shaftline.observers import observer_names


@pytest.mark.parametrize("task", tasks())
@pytest.mark.parametrize("observer", observer_names())
def test_checker_has_nothing_to_say(observer: str, task: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(FrigateEnv(task=task, observer=observer, max_episode_steps=8))


@pytest.mark.parametrize("steered", [False, True])
@pytest.mark.parametrize("algorithm", [PPO, SAC])
def test_algorithms_learn_on_it(algorithm: type[PPO] | type[SAC], steered: bool) -> None:
    envs = Sb3Frigates(4, steered=steered, max_episode_steps=10)
    keywords: dict[str, Any] = (
        {"n_steps": 16, "batch_size": 32} if algorithm is PPO else {"learning_starts": 20}
    )
    model = algorithm("MlpPolicy", envs, device="cpu", seed=0, **keywords)
    model.learn(128)
    assert np.isfinite(model.predict(np.asarray(envs.reset()))[0]).all()


def test_ended_episodes_say_how() -> None:
    envs = Sb3Frigates(3, max_episode_steps=4, sea="calm", normalised=False)
    assert envs.seed(3) == [3, 4, 5]
    first = envs.reset()
    action = np.full((3, 2), 0.2, np.float32)
    for _ in range(4):
        observation, _, done, infos = envs.step(action)
    assert isinstance(observation, np.ndarray)
    assert done.all()
    for i, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True
        assert info["terminal_observation"].shape == (15,)
        assert not np.array_equal(info["terminal_observation"], observation[i])
        assert info["ship_speed"] == pytest.approx(info["terminal_observation"][5], abs=0.3)
        assert info["reward_terms"]["fuel_kg_s"] > 0.0  # of the interval that ended it
        assert set(info) == {"terminal_observation", "TimeLimit.truncated", "reward_terms", *TRUTHS}
        assert envs.reset_infos[i]["reward_terms"] == dict.fromkeys(TERMS, 0.0)
        assert envs.reset_infos[i]["ship_speed"] == pytest.approx(observation[i][5], abs=0.3)
    following = envs.reset()  # a seed is for one reset
    assert not np.array_equal(following, first)
    assert envs.seed(None) == [None] * 3
    assert not np.array_equal(envs.reset(), following)
    envs.seed(3)
    assert np.array_equal(envs.reset(), first)


@pytest.mark.parametrize("steered", [False, True])
def test_it_is_the_vector_environment_step_by_step(steered: bool) -> None:
    kind = SteeringVectorEnv if steered else FrigateVectorEnv
    envs, vector = (
        Sb3Frigates(3, steered=steered, max_episode_steps=8),
        kind(3, max_episode_steps=8),
    )
    envs.seed(5)
    assert np.array_equal(envs.reset(), vector.reset(seed=5)[0])
    for k in range(20):
        action = np.full((3, 3 if steered else 2), 0.05 * k, np.float32)
        observation, reward, done, infos = envs.step(action)
        expected, due, terminated, truncated, info = vector.step(action)
        assert np.array_equal(observation, expected)  # type: ignore[arg-type]
        assert reward == pytest.approx(due)
        assert reward.dtype == np.float32
        assert np.array_equal(done, terminated | truncated)
        last = info.get("final_info", info)
        for i, own in enumerate(infos):
            assert {name: own[name] for name in TRUTHS} == {name: last[name][i] for name in TRUTHS}
            assert own["reward_terms"] == {name: last["reward_terms"][name][i] for name in TERMS}
            assert ("terminal_observation" in own) == done[i]
            if done[i]:
                assert np.array_equal(own["terminal_observation"], info["final_obs"][i])


def test_a_stall_at_the_last_interval_is_no_time_out() -> None:
    envs = Sb3Frigates(2, max_episode_steps=1, sea="calm", command="fuel-rack")
    envs.reset()
    envs.vector.batch.arrays.states["shaft_speed"][0] = 0.2
    _, reward, done, infos = envs.step(np.zeros((2, 2)))
    assert done.all()
    assert [info["TimeLimit.truncated"] for info in infos] == [False, True]
    assert infos[0]["ended"] == "stalled"
    assert "ended" not in infos[1]
    assert reward[0] == 0.0 < reward[1]


def test_the_monitor_of_stable_baselines3_gives_returns_and_lengths() -> None:
    envs: Any = VecMonitor(Sb3Frigates(3, max_episode_steps=6))
    envs.seed(1)
    envs.reset()
    returned, episodes = np.zeros(3), []
    for _ in range(12):
        _, reward, done, infos = envs.step(np.zeros((3, 2), np.float32))
        returned += reward
        for i in np.flatnonzero(done):
            episodes.append(infos[i]["episode"])
            assert infos[i]["episode"]["r"] == pytest.approx(returned[i], rel=1e-5)
            assert infos[i]["episode"]["l"] == 6
            returned[i] = 0.0
        assert all("reward_terms" in info and "fuel_flow" in info for info in infos)
    assert len(episodes) == 6


def test_the_evaluation_of_stable_baselines3_runs_on_it() -> None:
    envs = VecMonitor(Sb3Frigates(3, max_episode_steps=5))
    model = PPO("MlpPolicy", envs, device="cpu", seed=0, n_steps=8, batch_size=8)
    returns, lengths = evaluate_policy(
        model, envs, n_eval_episodes=7, return_episode_rewards=True, warn=True
    )
    assert lengths == [5] * 7
    assert all(0.0 < value <= 5.0 for value in np.atleast_1d(returns).tolist())


def test_images_are_the_dashboards() -> None:
    envs = Sb3Frigates(2, render_mode="rgb_array", max_episode_steps=8)
    assert envs.render_mode == "rgb_array"
    envs.reset()
    envs.step(np.array([[0.5, 0.9], [0.5, -0.9]]))
    first, second = envs.get_images()
    assert first.shape == second.shape == (600, 960, 3)
    assert not np.array_equal(first, second)
    tiled = envs.render()
    assert tiled is not None
    assert tiled.shape[0] * tiled.shape[1] == 2 * 600 * 960
    assert Sb3Frigates(2).get_images() == [None, None]


def test_attributes_and_methods_are_the_vector_environments() -> None:
    envs = Sb3Frigates(3, max_episode_steps=8)
    assert envs.get_attr("batch") == [envs.vector.batch] * 3
    assert envs.get_attr("num_envs", [0, 2]) == [3, 3]
    assert envs.get_attr("render_mode") == [None] * 3
    envs.set_attr("mark", 7)
    assert envs.vector.mark == 7  # type: ignore[attr-defined]
    found = envs.env_method("reset", seed=4, indices=[1])
    assert len(found) == 1
    assert np.array_equal(found[0][0], FrigateVectorEnv(3, max_episode_steps=8).reset(seed=4)[0])
    assert envs.env_is_wrapped(object, [0, 1]) == [False, False]
    closed: list[bool] = []
    envs.vector.close = lambda **_: closed.append(True)  # type: ignore[method-assign]
    envs.close()
    assert closed == [True]


USES: dict[str, Callable[[Any], Any]] = {
    "key": lambda info: info["thrust"],
    "get": lambda info: [info.get(name, 7) for name in ("thrust", "reward_terms", "episode")],
    "contains": lambda info: ["thrust" in info, "episode" in info],
    "length": len,
    "keys": list,
    "names": lambda info: list(info.keys()),
    "values": lambda info: list(info.values()),
    "items": lambda info: list(info.items()),
    "reversed": lambda info: list(reversed(info)),
    "text": str,
    "copy": lambda info: info.copy(),
    "dictionary": dict,
    "unpacked": lambda info: {**info, "k": 1},
    "argument": lambda info: dict(**info),
    "union": lambda info: info | {"k": 1},
    "union from the right": lambda info: {"k": 1} | info,
    "update of another": lambda info: [other := {"k": 1}, other.update(info)],
    "equal": lambda info: info == {"k": 1},
    "not equal": lambda info: info != {"k": 1},
    "set": lambda info: [info.__setitem__("thrust", 1.0), info.__setitem__("k", 2), dict(info)],
    "update": lambda info: [info.update(thrust=1.0, k=2), dict(info)],
    "union in place": lambda info: [info.__ior__({"thrust": 1.0}), dict(info)],
    "delete": lambda info: [info.__delitem__("thrust"), dict(info)],
    "pop": lambda info: [info.pop("thrust"), info.pop("k", 3), dict(info)],
    "last item": lambda info: [info.popitem(), dict(info)],
    "default": lambda info: [info.setdefault("thrust", 1.0), info.setdefault("k", 1), dict(info)],
    "clear": lambda info: [info.clear(), dict(info)],
    "json": json.dumps,
    "pickle": lambda info: pickle.loads(pickle.dumps(info)),
    "deep copy": deepcopy,
}


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_an_info_is_a_dictionary_in_every_use(use: Callable[[Any], Any]) -> None:
    """The infos are filled at their first use, which may be any of these."""
    envs = Sb3Frigates(2)
    envs.seed(1)
    envs.reset()
    infos = envs.step(np.zeros((2, 2), np.float32))[3]
    truth, terms = envs.vector.batch.truths[1].tolist(), envs.vector.batch.terms[1].tolist()
    plain: dict[str, Any] = dict(zip(TRUTHS, truth, strict=True))
    plain["reward_terms"] = dict(zip(TERMS, terms, strict=True))
    envs.step(np.ones((2, 2), np.float32))  # An info holds the values of its own step.
    assert str(use(infos[1])) == str(use(plain))


def test_infos_are_compared_by_their_content() -> None:
    envs = Sb3Frigates(2)
    found = []
    for _ in range(2):
        envs.seed(3)
        envs.reset()
        found.append(envs.reset_infos)
    assert found[0][0] == found[1][0]
    assert found[0][1] != found[1][0]


def test_a_key_that_an_info_does_not_have_is_refused() -> None:
    envs = Sb3Frigates(1)
    envs.reset()
    (info,) = envs.reset_infos
    for _ in range(2):
        with pytest.raises(KeyError, match="episode"):
            info["episode"]
        assert info["thrust"] > 0.0


def test_an_autoreset_that_the_algorithms_do_not_know_is_refused() -> None:
    with pytest.raises(TypeError, match="autoreset_mode: stable-baselines3 expects"):
        Sb3Frigates(2, autoreset_mode="NextStep")
