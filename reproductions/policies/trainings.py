"""Train the package's recipes; evaluate each on two blocks of seeds and in held-out seas."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shaftline.agents.learning.recipe import Recipe, read_recipe
from shaftline.agents.learning.training import train
from shaftline.agents.policy.policy import load_policy
from shaftline.envs.tasks import HELD_OUT

from ..learners.references import EPISODES, FIRST_SEED, reference, returns_of

BLOCKS = {
    "training": ("", FIRST_SEED),
    "second block": ("", FIRST_SEED + 10_000),
    "held-out": (f":{HELD_OUT}", FIRST_SEED),
}
"""Parts of the evaluation: suffix of the task's name, and first seed."""


FROM_NOTHING = "track-keeping"  # task whose recipe has neither plans nor a base controller


def from_nothing(task: str, env_kwargs: Mapping[str, Any], **changes: Any) -> Recipe:
    """Return a recipe with increments and no base controller, with the package's hyperparameters.

    ``changes`` are other fields of the recipe.
    """
    given = {"task": task, "env_kwargs": {**env_kwargs, "action_mode": "increment"}} | changes
    return Recipe.model_validate(read_recipe("ppo", FROM_NOTHING).model_dump() | given)


def judged(controller: Any, task: str) -> dict[str, Any]:
    """Evaluate a controller in each part; return its episodes as JSON allows."""
    return {
        name: returns_of(controller, f"{task}{part}", EPISODES, first)._asdict()
        for name, (part, first) in BLOCKS.items()
    }


def policy_cell(cell: tuple[str, int, Path]) -> dict[str, Any]:
    """Train the recipe of a task with a seed, or resume it, and evaluate the policy."""
    task, seed, folder = cell
    recipe = read_recipe("ppo", task)
    file = train(
        recipe,
        seed,
        folder / "trainings" / f"{task}-{seed}",
        device="cpu",
        threads=1,
        plan_folder=folder / "plans",
    )
    return judged(load_policy(file), task)


def classic_cell(cell: tuple[str, str]) -> dict[str, Any]:
    """Evaluate a classic controller on a task."""
    task, name = cell
    return judged(reference(task, name), task)
