"""The examples of ``examples/`` run, and the README lists them."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml

from shaftline.agents.evaluation.episodes import Setting, run_episodes
from shaftline.baselines import make_controller
from shaftline.envs import CLASSIC, FrigateVectorEnv, Sb3Frigates
from shaftline.plant import load_ship

EXAMPLES = Path(__file__).parent.parent / "examples"


def load_example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_the_readme_lists_every_example() -> None:
    page = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    for file in EXAMPLES.rglob("*.*"):
        if file.name != "README.md" and "__pycache__" not in file.parts:
            assert file.relative_to(EXAMPLES).as_posix() in page


def test_ppo_in_one_file_runs(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("torch")
    module = load_example("ppo_single_file")
    s = module.Settings(steps=20_000, environments=8, seed=3)
    agent, returns = module.train(s)
    assert min(returns) > 0.0
    assert 0.0 < module.evaluate(agent, s, episodes=2) < 600.0
    assert "steps" in capsys.readouterr().out


@pytest.mark.slow
def test_ppo_in_one_file_learns(capsys: pytest.CaptureFixture[str]) -> None:
    """A fifth of the example's steps raise the mean return of the untrained policy by half or more."""
    pytest.importorskip("torch")
    module = load_example("ppo_single_file")
    s = module.Settings(steps=200_000, seed=3)
    agent, returns = module.train(s)
    first, last = np.mean(returns[:30]), np.mean(returns[-30:])
    assert last > 1.5 * first > 0.0, (first, last)
    assert module.evaluate(agent, s, episodes=8) > 1.5 * first
    assert "steps" in capsys.readouterr().out


def test_defaults_of_stable_baselines3_are_compared_with_the_combinator() -> None:
    """The combinator's return is that of ``evaluate`` in the same episodes."""
    pytest.importorskip("stable_baselines3")
    line = ["--seed", "1", "--steps", "2048", "--episodes", "1"]
    learned, combinator = load_example("sb3_ppo").main(line)
    assert 0.0 < learned < combinator
    cell = Setting("combinator", "speed-keeping", "task", "none", seeds=1, first_seed=900_000)
    controller = make_controller("combinator", load_ship("frigate"), 0.5)
    assert combinator == pytest.approx(float(run_episodes(cell, controller)[0]["reward"][0]))


def test_hyperparameters_for_rl_zoo_are_ppos() -> None:
    stable = pytest.importorskip("stable_baselines3")
    text = (EXAMPLES / "rl-zoo3/ppo.yml").read_text(encoding="utf-8")
    ((name, given),) = yaml.safe_load(text).items()
    assert name == "shaftline/Frigate-v0"
    outside = (
        "env_kwargs",
        "n_envs",
        "n_timesteps",
        "policy",
        "normalize",
        "policy_kwargs",
        "learning_rate",
    )
    rest: dict[str, Any] = {k: v for k, v in given.items() if k not in outside}
    env = Sb3Frigates(given["n_envs"], **given["env_kwargs"])
    stable.PPO(given["policy"], env, learning_rate=5e-4, device="cpu", **rest)
    assert given["n_steps"] * given["n_envs"] % given["batch_size"] == 0
    module = load_example("ppo_single_file")
    s = module.Settings()
    assert (given["n_envs"], given["n_steps"], given["n_timesteps"]) == (
        s.environments,
        s.rollout,
        s.steps,
    )


def test_an_own_controller_runs() -> None:
    made = load_example("own_controller").Steady("frigate", 0.5)
    env = FrigateVectorEnv(3, task="transit", max_episode_steps=40, **CLASSIC)
    seen, _ = env.reset(seed=1)
    memory, done = None, np.zeros(3, dtype=bool)
    while not done.any():
        action, memory = made.predict(seen, memory)
        seen, _, terminated, truncated, _ = env.step(action)
        assert not terminated.any()
        done = truncated
    with pytest.raises(ValueError, match="lag_s"):
        load_example("own_controller").Steady("frigate", 0.5, lag_s=0.0)


def test_torchrl_learns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A single batch shows that environment, collector and loss fit together."""
    pytest.importorskip("torchrl")
    monkeypatch.setattr(sys, "argv", ["torchrl_ppo.py", "--steps", "2048", "--episodes", "1"])
    load_example("torchrl_ppo").main()
    assert "mean return of 1 episodes: " in capsys.readouterr().out
