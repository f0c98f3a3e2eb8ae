"""Trainings of seconds, and a policy without one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from shaftline.agents.learning.recipe import Recipe
from shaftline.agents.learning.training import train
from shaftline.agents.policy.policy import Network, Policy, layout
from shaftline.agents.policy.residual import ANSWERS, Form
from shaftline.envs import get_task

PPO: dict[str, Any] = {
    "n_steps": 16, "batch_size": 32, "n_epochs": 2, "learning_rate": "lin_1e-3", "use_sde": True,
    "sde_sample_freq": 4, "policy_kwargs": {"net_arch": [8, 8]},
}  # fmt: skip
SAC: dict[str, Any] = {
    "learning_starts": 20, "batch_size": 16, "buffer_size": 1000, "train_freq": 4,
    "gradient_steps": 2, "policy_kwargs": {"net_arch": [8, 8]},
}  # fmt: skip


def recipe(algorithm: str = "ppo", **changes: Any) -> Recipe:
    """Return a recipe of two legs of 64 steps in four environments."""
    fields: dict[str, Any] = {
        "algorithm": algorithm, "task": "transit", "n_envs": 4, "n_timesteps": 128, "legs": 2,
        "env_kwargs": {"max_episode_steps": 20}, "hyperparameters": PPO if algorithm == "ppo" else SAC,
    }  # fmt: skip
    return Recipe.model_validate(fields | changes)


def plain_policy(task: str = "transit", form: Form | None = None) -> Policy:
    """Return a policy whose answers are 0."""
    form = form or Form()
    n, answers = len(form.features), len(ANSWERS)
    network = Network(
        np.zeros(n), np.ones(n), 10.0, (np.zeros((answers, n), np.float32),),
        (np.zeros(answers, np.float32),), "tanh", False, np.zeros(answers, np.float32),
    )  # fmt: skip
    plan = {"task": task, "algorithm": "ppo", "form": asdict(form), "env_kwargs": {}}
    vessel = get_task(task).vessel
    ship = get_task(task).sailed()
    return Policy(
        network,
        {"layout": layout(ship, form), "ship_source": vessel, "control_interval_s": 0.5,
         "recipe": plan, "seed": 0},
    )  # fmt: skip


class StopTestError(Exception):
    """As Ctrl-C, which a test should not raise."""


def interrupted_after_a_leg(plan: Recipe, seed: int, folder: Path) -> None:
    """Train until the second leg has begun."""

    def tick(done: int, total: int, said: str) -> None:
        if done > total // 2 + 20:
            raise StopTestError

    try:
        train(plan, seed, folder, device="cpu", tick=tick)
    except StopTestError:
        return
    raise AssertionError("was not interrupted")
