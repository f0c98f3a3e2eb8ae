"""Evaluate classic controllers, and policies that ignore their observation."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, run_episodes
from shaftline.agents.learning.recipe import tuned_controller
from shaftline.baselines.controller import Predictor
from shaftline.envs import DEFAULTS, get_task
from shaftline.envs.tasks import HELD_OUT, controller_for

FIRST_SEED, EPISODES = 900_000, 48
"""Episodes of all comparisons; no training and no search draws their seeds."""

CONTROLLERS = (
    "combinator",
    "combinator-trimmed",
    "cpp-optimiser",
    "anti-spin",
    "speed-pilot",
    "va-pitch",
    "mpc",
)
PREVIEWING = ("va-pitch-preview", "mpc-preview")
"""Classic controllers of tasks with a preview of the waves."""

TUNED, HOLD, CONSTANT, RANDOM = "tuned controller", "hold", "best constant", "random"
BLIND = (HOLD, CONSTANT, RANDOM)
"""Policies that ignore their observation."""


_GRID = 9  # constants by axis
_SEARCH_EPISODES = 8


class Blind:
    """A policy that ignores its observation: constant or random actions.

    Args:
        actions: constant actions, shape (n, a); None for uniformly random actions.
        numbers: number of values of an action.
        interface: keywords of the environment.
    """

    def __init__(
        self, actions: NDArray[np.float32] | None, numbers: int, interface: Mapping[str, Any]
    ) -> None:
        self.actions, self.numbers = actions, numbers
        self.interface = {"normalised": True} | dict(interface)
        self._rng = np.random.default_rng(0)

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return the actions of all episodes."""
        n = len(observation)
        if self.actions is None:
            return self._rng.uniform(-1.0, 1.0, (n, self.numbers)).astype(np.float32), None
        return np.resize(self.actions, (n, self.numbers)), None


class Returns(NamedTuple):
    """Episodes of one controller."""

    values: list[float]
    """Return of each episode."""
    failed: float
    """Share of episodes that ended in a stall or trip."""
    kpis: dict[str, float]
    """Mean of each key performance indicator."""


def returns_of(
    controller: Predictor,
    task: str,
    episodes: int = EPISODES,
    first_seed: int = FIRST_SEED,
    steps: int | None = None,
) -> Returns:
    """Run a controller through episodes of a task.

    Args:
        controller: controller with ``predict``.
        task: name, ``NAME:held-out`` for the held-out seas.
        episodes: number of episodes.
        first_seed: seed of the first episode.
        steps: control intervals of an episode; the default of the environments.
    """
    length = (steps or DEFAULTS.max_episode_steps or 0) * DEFAULTS.control_interval_s
    setting = Setting(
        "one", task, "task", DEFAULTS.observer, episodes, episode_s=length, first_seed=first_seed
    )
    kpis, _ = run_episodes(setting, controller, threads=1)
    means = {name: float(value) for name, value in kpis.mean().items()}
    return Returns(kpis["reward"].tolist(), means["failed"], means)


def names_of(task: str) -> tuple[str, ...]:
    """Return the names of all references of a task."""
    return (*CONTROLLERS, *(PREVIEWING if get_task(task).preview else ()), TUNED, *BLIND)


def reference(task: str, name: str) -> Predictor:
    """Return a reference controller."""
    model = get_task(task)
    ship, interval = model.load_ship(), DEFAULTS.control_interval_s
    numbers = 3 if model.steered else 2
    if name == CONSTANT:
        return best_constant(task, numbers)
    if name in (HOLD, RANDOM):
        held = np.zeros((1, numbers), np.float32) if name == HOLD else None
        return Blind(held, numbers, {"action_mode": "increment"})
    text = tuned_controller(task) if name == TUNED else name
    return controller_for(model, text, ship, interval, model.steered)


def best_constant(task: str, numbers: int) -> Blind:
    """Return the constant command of a grid with the highest mean return, on separate seeds."""
    values = np.linspace(-1.0, 1.0, _GRID)
    grid = np.zeros((_GRID**2, numbers), np.float32)
    grid[:, :2] = list(itertools.product(values, values))
    interface = {"action_mode": "absolute", "command": "shaft-speed"}
    best, highest = grid[0], -np.inf
    for action in grid:
        one = Blind(action[None], numbers, interface)
        mean = float(np.mean(returns_of(one, task, _SEARCH_EPISODES, 800_000).values))
        if mean > highest:
            best, highest = action, mean
    return Blind(best[None], numbers, interface)


def reference_cell(cell: tuple[str, str]) -> dict[str, Any]:
    """Return the episodes of a reference on a task and its held-out seas, as JSON allows."""
    task, name = cell
    controller = reference(task, name)
    return {
        part: returns_of(controller, f"{task}{part}")._asdict() for part in ("", f":{HELD_OUT}")
    }
