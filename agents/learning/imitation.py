"""Imitation of clairvoyant plans before reinforcement learning.

A clairvoyant plan (:class:`..evaluation.clairvoyant.Clairvoyant`) is the sequence of commands of an
episode, optimised while waves and resistance are known in advance. The plans are simulated in the
environment of the recipe, with sensor noise and observer. The policy network is fitted to the commands
as a function of the observations alone (behaviour cloning of a privileged expert: Chen et al. 2020,
*Learning by cheating*), so it averages over everything that it cannot observe. The value network is
fitted to the discounted rewards. PPO then continues from these networks, as in guided policy search
(Levine and Koltun 2013). The plans contain manoeuvres that random exploration does not find.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from ...baselines import make_controller
from ...core.sweep import digest_of, source_digest, sweep
from ...envs import DEFAULTS, get_task
from ...envs.settings import Settings
from ...envs.steering import environment_classes
from ...plant import Ship, load_ship
from ..evaluation.clairvoyant import Clairvoyant
from ..policy.policy import stack_frame
from .recipe import Recipe, RecipeError, tuned_controller

FIRST_SEED = 600_000
"""First seed of the planned episodes (1000 at most). Nothing else draws these seeds."""

GRADIENTS = 60
"""Limit of gradient evaluations for each order of a plan. More (100 instead of 40) gain 1 to 3 %."""

EPOCHS, BATCH, RATE = 150, 512, 1e-3
"""Settings of the fit: passes over all intervals, batch size, and learning rate of Adam."""

_SOURCES = ("core", "plant", "baselines", "envs", "agents/evaluation/clairvoyant.py")
"""Source folders and files on which a plan depends."""

_DECIDE_A_PLAN = ("task", "ship", "sea", "max_episode_steps", "randomise")
"""Keywords of the environment on which a plan depends. It uses no measurement."""

_VALUE_WEIGHT = 1e-4  # because returns are of the order of 100 and actions of the order of 1
_TAIL = 100  # intervals whose mean reward extrapolates the reward beyond the time limit


class Demonstrations(NamedTuple):
    """Observations, actions and returns of the control intervals of planned episodes."""

    observations: NDArray[np.float32]  # stacked over ``frame_stack`` intervals, shape (n, width)
    actions: NDArray[np.float32]  # with which the environment follows the plans, shape (n, 2)
    returns: NDArray[np.float32]  # discounted sums of the later rewards, shape (n,)


def plan_cell(cell: tuple[Mapping[str, Any], str, int]) -> list[list[float]]:
    """Return the actions of one plan as nested lists, which JSON can store.

    A cell has the keywords of the environment, the controller whose commands initialise the plan, and
    the seed of the episode.
    """
    keywords, start, seed = cell
    settings = Settings.of(keywords)
    ship = get_task(settings.task).load_ship(settings.ship)
    controller = make_controller(start, ship, DEFAULTS.control_interval_s)
    return list(Clairvoyant(settings, seed).plan(controller, GRADIENTS).actions.tolist())


def make_plans(
    recipe: Recipe,
    ship: str,
    folder: Path,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> dict[int, NDArray[np.float32]]:
    """Optimise the plans that a recipe imitates, or read the plans that a folder already holds.

    Args:
        recipe: recipe; ``recipe.plans`` is the number of plans.
        ship: preset or path.
        folder: folder in which each plan is stored when it is finished.
        jobs: number of processes; one for each core by default.
        tick: function called after each plan.

    Returns:
        Actions by seed, each of shape (intervals, 2).

    Raises:
        RecipeError: the task has no tuned controller to initialise a plan.
        SweepError: some plans failed; the message names them.
        ValueError: a file of the folder holds no plan of this recipe.
    """
    environment = _environment(recipe, ship)
    keywords = {key: value for key, value in environment.items() if key in _DECIDE_A_PLAN}
    start = tuned_controller(recipe.task)
    content = keywords | {"ship": repr(load_ship(ship))}  # a ship file may change under its path
    version = digest_of(f"{content} {start} {GRADIENTS} {source_digest(*_SOURCES)}")
    seeds = range(FIRST_SEED, FIRST_SEED + recipe.plans)
    cells = {f"plan-{version}-{seed}": (keywords, start, seed) for seed in seeds}
    found = sweep(plan_cell, cells, folder, jobs=jobs, tick=tick)
    intervals = Settings.of(keywords).max_episode_steps or 0
    return {
        cells[name][2]: _checked(actions, folder / f"{name}.json", intervals)
        for name, actions in found.items()
    }


def check_plannable(recipe: Recipe, ship: Ship) -> None:
    """Refuse plans for a ship with a fixed pitch by a RecipeError."""
    if recipe.plans and not ship.has_variable_pitch:
        raise RecipeError(
            f"plans = {recipe.plans}: a plan commands the pitch, which is fixed on {ship.name}; set "
            "plans: 0"
        )


def _checked(actions: Any, file: Path, intervals: int) -> NDArray[np.float32]:
    """Return the actions of a plan file as an array, or refuse the file."""
    try:
        table = np.array(actions, dtype=np.float32)
    except (TypeError, ValueError):
        table = np.zeros(0, np.float32)
    if table.shape != (intervals, 2) or not (np.abs(table) <= 1.0).all():
        raise ValueError(
            f"{file}: must contain {intervals} pairs of actions from -1 to 1; remove the file, and the "
            "next run computes the plan again"
        )
    return table


def _environment(recipe: Recipe, ship: str) -> dict[str, Any]:
    """Return the keywords of the training environment."""
    return {"task": recipe.task, "ship": ship, **recipe.env_kwargs}


def demonstrate(
    recipe: Recipe, ship: str, planned: Mapping[int, NDArray[np.float32]]
) -> Demonstrations:
    """Simulate plans from :func:`make_plans` in the training environment, and record them.

    With a residual action mode an action is the difference from the base controller, clipped to its
    range.
    """
    gamma = float(recipe.hyperparameters.get("gamma", 0.99))
    env = environment_classes(get_task(recipe.task).steered).single(**_environment(recipe, ship))
    observations, actions = [], []
    returns: list[float] = []
    for seed, commands in planned.items():
        seen, _ = env.reset(seed=seed)
        stack = np.zeros((1, recipe.frame_stack * len(seen)), np.float32)
        rewards: list[float] = []
        terminated = False
        for planned_action in commands:
            base = env.batch.base
            action = planned_action if base is None else base.towards(planned_action[None])[0]
            stack = stack_frame(stack, seen[None])
            observations.append(stack[0])
            actions.append(action)
            seen, reward, terminated, truncated, _ = env.step(action)
            rewards.append(float(reward))
            if terminated or truncated:
                break
        follows = 0.0 if terminated else float(np.mean(rewards[-_TAIL:])) / (1.0 - gamma)
        discounted = []
        for reward in reversed(rewards):
            follows = reward + gamma * follows
            discounted.append(follows)
        returns += reversed(discounted)
    env.close()
    return Demonstrations(*(np.array(one, np.float32) for one in (observations, actions, returns)))


def imitate(model: Any, shown: Demonstrations) -> float:
    """Fit the policy network and the value network of a PPO model to demonstrations, in place.

    Returns:
        Mean squared error of the actions in the last pass over the demonstrations [-].
    """
    policy = model.policy
    seen, wanted, worth = (torch.as_tensor(part, device=policy.device) for part in shown)
    optimiser = torch.optim.Adam(policy.parameters(), lr=RATE)
    error = np.inf
    for _ in range(EPOCHS):
        summed = 0.0
        order = torch.randperm(len(seen), device=policy.device)
        for first in range(0, len(seen), BATCH):
            part = order[first : first + BATCH]
            mean = policy.get_distribution(seen[part]).distribution.mean
            value = policy.predict_values(seen[part]).flatten()
            missed = torch.mean((mean - wanted[part]) ** 2)
            loss = missed + _VALUE_WEIGHT * torch.mean((value - worth[part]) ** 2)
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            optimiser.step()
            summed += missed.item() * len(part)
        error = summed / len(seen)
    return error
