"""Trainings of seconds, and a policy without one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from shaftline.agents.learning.recipe import Recipe
from shaftline.agents.learning.training import train
from shaftline.agents.policy.policy import Network, Policy, layout
from shaftline.envs import Settings, get_task
from shaftline.envs.batch import Batch

PPO: dict[str, Any] = {
    "n_steps": 16,
    "batch_size": 32,
    "n_epochs": 2,
    "learning_rate": "lin_1e-3",
    "use_sde": True,
    "sde_sample_freq": 4,
    "policy_kwargs": {"net_arch": [8, 8]},
}
SAC: dict[str, Any] = {
    "learning_starts": 20,
    "batch_size": 16,
    "buffer_size": 1000,
    "train_freq": 4,
    "gradient_steps": 2,
    "policy_kwargs": {"net_arch": [8, 8]},
}
HYPERPARAMETERS = {"ppo": PPO, "sac": SAC, "td3": SAC}


def recipe(algorithm: str = "ppo", **changes: Any) -> Recipe:
    """Return a training of two evaluations, 64 steps each, in four environments."""
    fields: dict[str, Any] = {
        "algorithm": algorithm,
        "task": "transit",
        "n_envs": 4,
        "n_timesteps": 128,
        "evaluations": 2,
        "env_kwargs": {"max_episode_steps": 20},
        "hyperparameters": HYPERPARAMETERS[algorithm],
    }
    return Recipe.model_validate(fields | changes)


def about(task: str = "transit", **recipe_fields: Any) -> dict[str, Any]:
    """Return the description of a policy of a task, trained in the default environment."""
    vessel = get_task(task).vessel
    keywords = {
        key: value for key, value in recipe_fields.items() if key in ("action_mode", "command")
    }
    batch = Batch(1, Settings.of({"task": task} | keywords), get_task(task).steered)
    return {
        "layout": layout(batch),
        "ship_source": vessel,
        "control_interval_s": 0.5,
        "seed": 7,
        "recipe": {"task": task, "algorithm": "ppo", "env_kwargs": {}} | recipe_fields,
    }


def plain_policy(task: str = "transit", **recipe_fields: Any) -> Policy:
    """Return a policy whose actions are zero: it holds the commands that run."""
    described = about(task, **recipe_fields)
    seen = len(described["layout"]["observed"]) * recipe_fields.get("frame_stack", 1)
    numbers = described["layout"]["actions"]
    network = Network(
        (np.zeros((numbers, seen), np.float32),), (np.zeros(numbers, np.float32),), "tanh", False
    )
    return Policy(network, described)


class StopTestError(Exception):
    """As Ctrl-C, which a test should not raise."""


def interrupted_after_an_evaluation(plan: Recipe, seed: int, folder: Path) -> None:
    """Train until the second part has begun."""

    def tick(done: int, total: int, said: str) -> None:
        if done > total // 2 + 20:
            raise StopTestError

    try:
        train(plan, seed, folder, device="cpu", tick=tick)
    except StopTestError:
        return
    raise AssertionError("was not interrupted")
