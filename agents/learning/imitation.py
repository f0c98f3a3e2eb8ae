"""Imitation: a policy that begins as what it can tell of plans that know everything.

A plan of an episode (:class:`..evaluation.clairvoyant.Clairvoyant`) knows waves and resistance before
they come. Its commands are sailed in the environment of the recipe, with noise and observer, and the
network of the policy is fitted to them, given only what a policy observes: behaviour cloning of a
privileged expert (Chen et al. 2020, *Learning by cheating*). What cannot be observed is averaged out.
The value function is fitted to the discounted rewards. PPO goes on from there, as in guided policy
search (Levine and Koltun 2013): the plans show manoeuvres that exploration at random does not find.
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
from ...envs.steering import kinds
from ..evaluation.clairvoyant import Clairvoyant
from .recipe import Recipe, tuned_controller

FIRST_SEED = 600_000
"""Of the planned episodes; apart from those of training, evaluations and comparisons."""

GRADIENTS = 60
"""Most gradients for each order of a plan; from 40 on a plan gains a few per cent at most."""

EPOCHS, BATCH, RATE = 150, 512, 1e-3
"""Of the fit: passes over all intervals, intervals for each step, and Adam's step size."""

_SOURCES = ("core", "plant", "baselines", "envs", "agents/evaluation/clairvoyant.py")
"""What decides a plan."""

_DECIDE_A_PLAN = ("task", "ship", "sea", "max_episode_steps", "randomise")
"""Keywords of the environment on which a plan depends: it reads no instrument."""

_VALUE_WEIGHT = 1e-4  # returns are of the order of 100, commands of 1
_TAIL = 100  # intervals whose mean reward continues an episode that its time limit ends


class Demonstrations(NamedTuple):
    """Intervals of planned episodes.

    Args:
        observations: stacked as the policy sees them, shape (n, width).
        actions: with which the environment follows the plans, shape (n, 2).
        returns: discounted sums of the rewards that follow, shape (n,).
    """

    observations: NDArray[np.float32]
    actions: NDArray[np.float32]
    returns: NDArray[np.float32]


def plan_cell(cell: tuple[Mapping[str, Any], str, int]) -> list[list[float]]:
    """Return the actions of a plan as JSON allows.

    Args:
        cell: keywords of the environment, the controller whose commands the plan starts from, and the
            seed of the episode.
    """
    keywords, start, seed = cell
    settings = Settings.of(keywords)
    ship = get_task(settings.task).sailed(settings.ship)
    controller = make_controller(start, ship, DEFAULTS.control_interval_s)
    plan = Clairvoyant(settings, seed).plan(controller, GRADIENTS)
    return [[float(value) for value in action] for action in plan.actions]


def plans(
    recipe: Recipe,
    ship: str,
    folder: Path,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> dict[int, NDArray[np.float32]]:
    """Plan the episodes that a recipe imitates, or read those that stand in the folder.

    Args:
        recipe: whose ``plans`` is their number.
        ship: preset or path.
        folder: where each plan is kept as soon as it is made.
        jobs: processes; one for each core by default.
        tick: called for each plan.

    Returns:
        Actions by seed, each of shape (intervals, 2).

    Raises:
        RecipeError: the task has no tuned controller to start from.
        SweepError: plans that failed, as for a ship whose pitch is fixed; the message says which.
    """
    keywords = {
        key: value for key, value in _environment(recipe, ship).items() if key in _DECIDE_A_PLAN
    }
    start = tuned_controller(recipe.task)
    seeds = range(FIRST_SEED, FIRST_SEED + recipe.plans)
    version = digest_of(f"{keywords} {start} {GRADIENTS} {source_digest(*_SOURCES)}")
    cells = {f"plan-{version}-{seed}": (keywords, start, seed) for seed in seeds}
    found = sweep(plan_cell, cells, folder, jobs=jobs, tick=tick)
    return {
        seed: np.array(actions, dtype=np.float32).reshape(-1, 2)
        for seed, actions in zip(seeds, found.values(), strict=True)
    }


def _environment(recipe: Recipe, ship: str) -> dict[str, Any]:
    """Return the keywords of the environment that a recipe trains in."""
    return {"task": recipe.task, "ship": ship, **recipe.env_kwargs}


def demonstrations(
    recipe: Recipe, ship: str, planned: Mapping[int, NDArray[np.float32]]
) -> Demonstrations:
    """Sail plans in the environment of a recipe, and return what a policy observes on the way.

    Args:
        recipe: of the training.
        ship: preset or path.
        planned: actions by seed.
    """
    gamma = float(recipe.hyperparameters.get("gamma", 0.99))
    env = kinds(get_task(recipe.task).steered).single(**_environment(recipe, ship))
    observations: list[NDArray[np.float32]] = []
    actions: list[NDArray[np.float32]] = []
    returns: list[float] = []
    for seed, commands in planned.items():
        seen, _ = env.reset(seed=seed)
        stack = np.zeros((recipe.frame_stack, len(seen)), np.float32)
        rewards: list[float] = []
        terminated = False
        for planned_action in commands:
            base = env.batch.base
            action = planned_action if base is None else base.towards(planned_action[None])[0]
            stack = np.concatenate([stack[1:], seen[None]])
            observations.append(stack.ravel())
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
    return Demonstrations(
        np.array(observations, np.float32),
        np.array(actions, np.float32),
        np.array(returns, np.float32),
    )


def imitate(model: Any, shown: Demonstrations) -> float:
    """Fit the policy and the value function of a PPO model to demonstrations.

    Args:
        model: of stable-baselines3; changed in place, its optimiser begins anew.
        shown: what is fitted.

    Returns:
        Mean squared error of the actions in the last pass [-].
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
