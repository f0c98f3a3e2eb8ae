"""Train a standard learner from scratch, with evaluations during the training."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from shaftline import envs  # noqa: F401 (registers the environments)
from shaftline.baselines.controller import Predictor
from shaftline.envs import get_task
from shaftline.envs.steering import environment_classes
from shaftline.envs.tasks import HELD_OUT

from .references import returns_of

DEFAULT_LEARNERS = ("ppo", "sac", "td3", "recurrent-ppo")
"""Learners with default hyperparameters."""

RECIPE = "ppo-recipe"
"""PPO with the hyperparameters of the package."""

ALGORITHMS = (*DEFAULT_LEARNERS, RECIPE)
POINTS, CURVE_EPISODES, CURVE_SEED = 10, 24, 500_000


class Learner(NamedTuple):
    """One training.

    Args:
        task: name.
        algorithm: one of :data:`ALGORITHMS`.
        seed: seed of the training.
        steps: control intervals.
        folder: folder of the policy file; None writes no file.
    """

    task: str
    algorithm: str
    seed: int
    steps: int
    folder: str | None = None

    @property
    def name(self) -> str:
        """Name of the cell."""
        return f"{self.algorithm}_{self.task}_{self.seed}_{self.steps}"


class Trained:
    """A model of stable-baselines3 with the keywords of its environment.

    Args:
        model: model with ``predict``.
        interface: keywords of the environment.
    """

    def __init__(self, model: Any, interface: Mapping[str, Any]) -> None:
        self.model, self.interface = model, dict(interface)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> Any:
        """Return actions and the state of a recurrent model."""
        return self.model.predict(observation, state, episode_start, deterministic)


def model_of(learner: Learner) -> Any:
    """Return the untrained model with default hyperparameters and one environment."""
    env = gymnasium.make(environment_classes(get_task(learner.task).steered).id, task=learner.task)
    keywords: dict[str, Any] = {"seed": learner.seed, "device": "cpu"}
    if learner.algorithm == "recurrent-ppo":
        from sb3_contrib import RecurrentPPO

        return RecurrentPPO("MlpLstmPolicy", env, **keywords)
    from stable_baselines3 import PPO, SAC, TD3

    algorithm: Any = {"ppo": PPO, "sac": SAC, "td3": TD3}[learner.algorithm]
    if learner.algorithm != "ppo":
        keywords["buffer_size"] = min(1_000_000, learner.steps)  # holds every step all the same
    return algorithm("MlpPolicy", env, **keywords)


def train_cell(learner: Learner) -> dict[str, Any]:
    """Train, and return curve and final episodes as JSON allows."""
    if learner.algorithm == RECIPE:
        return _train_recipe(learner)
    import torch

    torch.set_num_threads(1)
    model, begin = model_of(learner), time.perf_counter()
    trained = Trained(model, {})
    curve = []
    for part in range(POINTS + 1):
        if part:
            model.learn(learner.steps // POINTS, reset_num_timesteps=part == 1)
        found = returns_of(trained, learner.task, CURVE_EPISODES, CURVE_SEED)
        curve.append([model.num_timesteps, float(np.mean(found.values)), found.failed])
    if learner.folder is not None and learner.algorithm != "recurrent-ppo":
        _save(learner, model, Path(learner.folder))
    return _judged(trained, learner.task) | {
        "curve": curve,
        "seconds": time.perf_counter() - begin,
    }


def _judged(policy: Predictor, task: str) -> dict[str, Any]:
    """Evaluate a policy in each part; return its episodes as JSON allows."""
    return {part: returns_of(policy, f"{task}{part}")._asdict() for part in ("", f":{HELD_OUT}")}


def _train_recipe(learner: Learner) -> dict[str, Any]:
    """Train with the package's hyperparameters, and return curve and final episodes."""
    from shaftline.agents.learning.training import train
    from shaftline.agents.policy.policy import load_policy

    from ..policies.trainings import from_nothing

    recipe = from_nothing(learner.task, {}, n_timesteps=learner.steps)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(learner.folder or scratch) / learner.name
        policy = load_policy(train(recipe, learner.seed, folder, device="cpu", threads=1))
    points = (policy.curve[key] for key in ("steps", "reward", "failed"))
    curve = [list(point) for point in zip(*points, strict=True)]
    return _judged(policy, learner.task) | {"curve": curve, "seconds": policy.curve["seconds"][-1]}


def _save(learner: Learner, model: Any, folder: Path) -> None:
    """Write the policy as a file of the package."""
    from shaftline.agents.learning.recipe import Recipe
    from shaftline.agents.learning.training import about_training, extract_network
    from shaftline.agents.policy.policy import Policy

    recipe = Recipe.model_validate(
        {
            "algorithm": learner.algorithm,
            "task": learner.task,
            "n_envs": 1,
            "n_timesteps": learner.steps,
        }
    )
    batch = model.get_env().envs[0].unwrapped.batch
    about = about_training(recipe, learner.seed, get_task(learner.task).vessel, batch)
    Policy(extract_network(model), about).save(folder / f"{learner.name}.npz")
