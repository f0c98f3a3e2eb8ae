"""Trainings of seconds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shaftline.agents.learning.recipe import Recipe
from shaftline.agents.learning.training import train

PPO: dict[str, Any] = {
    "n_steps": 16, "batch_size": 32, "n_epochs": 2, "learning_rate": "lin_1e-3", "use_sde": True,
    "sde_sample_freq": 4, "policy_kwargs": {"net_arch": [8, 8]},
}  # fmt: skip
SAC: dict[str, Any] = {
    "learning_starts": 20, "batch_size": 16, "buffer_size": 1000, "train_freq": 4,
    "gradient_steps": 2, "policy_kwargs": {"net_arch": [8, 8]},
}  # fmt: skip


def recipe(algorithm: str = "ppo", **changes: Any) -> Recipe:
    """Two legs of 64 steps in four environments."""
    fields: dict[str, Any] = {
        "algorithm": algorithm, "task": "transit", "n_envs": 4, "n_timesteps": 128, "legs": 2,
        "env_kwargs": {"episode_s": 10.0}, "hyperparameters": PPO if algorithm == "ppo" else SAC,
    }  # fmt: skip
    return Recipe.model_validate(fields | changes)


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
