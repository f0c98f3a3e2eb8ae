"""Compute clairvoyant plans of the tasks from several starts."""

from __future__ import annotations

from typing import Any

import numpy as np

from shaftline.agents.evaluation.clairvoyant import Clairvoyant
from shaftline.baselines import make_controller
from shaftline.envs import get_task
from shaftline.envs.settings import DEFAULTS, Settings

from .references import CONTROLLERS, FIRST_SEED, TUNED, reference, returns_of

STARTS = ("combinator", "combinator-trimmed", "speed-pilot", "va-pitch")
"""Controllers whose commands are the starts of the plans."""

STEPS = 400
"""Control intervals of a planned episode, with two telegraph orders."""

EPISODES, ROUNDS = 2, 200


def plan_cell(cell: tuple[str, int, str]) -> dict[str, Any]:
    """Return the plan of one episode from one start, as JSON allows."""
    task, seed, start = cell
    episode = Clairvoyant(Settings.of({"task": task, "max_episode_steps": STEPS}), seed)
    plan = episode.plan(
        make_controller(start, get_task(task).load_ship(), DEFAULTS.control_interval_s), ROUNDS
    )
    return {"return": float(plan.rewards.sum()), "gradients": plan.rounds}


def same_episodes(task: str) -> dict[str, float]:
    """Return the mean return of each classic controller in the planned episodes."""
    return {
        name: float(
            np.mean(returns_of(reference(task, name), task, EPISODES, FIRST_SEED, STEPS).values)
        )
        for name in (*CONTROLLERS, TUNED)
    }


def cells(task: str) -> dict[str, tuple[str, int, str]]:
    """Return the arguments of the plans of a task by name of the cell."""
    return {
        f"bound_{task}_{seed}_{start}": (task, seed, start)
        for seed in range(FIRST_SEED, FIRST_SEED + EPISODES)
        for start in STARTS
    }
