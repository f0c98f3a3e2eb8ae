"""What could be had at best in a task's held-out seas, and which share of it each controller gets.

The gap is from the combinator with a trimmed lever to the clairvoyant plan, in the task's own reward.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...agents.evaluation.clairvoyant import Clairvoyant
from ...agents.evaluation.controllers import load_controller
from ...agents.evaluation.episodes import Setting, run_episodes
from ...agents.evaluation.sweeps import version_of_cells
from ...core.sweep import sweep
from ...envs.settings import DEFAULTS, Settings
from ...envs.tasks import HELD_OUT, get_task
from .comparison import BASELINES, FIRST_SEED, HELD, OBSERVER, POLICY, SHOWN, VA_PITCH

EPISODE_S = 150.0
BOUND = "clairvoyant"
_BEGINS = (VA_PITCH, "speed-pilot")
"""Where plans begin; the better one is the bound."""


class _Recorded:
    """Plays plans back, one an episode."""

    def __init__(self, actions: NDArray[np.float32]) -> None:
        self._actions, self._next = actions, 0

    def predict(self, *_: Any, **__: Any) -> tuple[NDArray[np.float32], None]:
        self._next += 1
        return self._actions[self._next - 1], None


def planned(cell: tuple[str, int]) -> dict[str, Any]:
    """The plan of a task's episode, as JSON allows."""
    task, seed = cell
    apart = f"{task}:{HELD_OUT}"
    ship = get_task(task).sailed()
    episode = Clairvoyant(Settings.of({"task": apart, "episode_s": EPISODE_S}), seed)
    plans = [episode.plan(load_controller(name, ship, episode.interval_s)) for name in _BEGINS]
    best = max(plans, key=lambda plan: float(plan.rewards.sum()))
    return {
        "actions": best.actions.tolist(), "reward": float(best.rewards.sum()),
        "rewards": [float(plan.rewards.sum()) for plan in plans],
    }  # fmt: skip


def bound(
    task: str,
    policy: Path | None,
    folder: Path,
    *,
    seeds: int = 6,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> pd.DataFrame:
    """KPIs of the plans and of all controllers in the same episodes, and shares of the gap.

    Args:
        task: name.
        policy: file; None where there is none.
        folder: for the plans; those that stand there are not made again.
        seeds: episodes.
        jobs: see :func:`shaftline.core.sweep.sweep`.
        tick: called after each plan.

    Returns:
        A row a controller: means of the KPIs, ``share`` of the gap in the reward [%].
    """
    version = version_of_cells(get_task(task).vessel)
    cells = {
        f"{task}-{seed}_{version}": (task, seed) for seed in range(FIRST_SEED, FIRST_SEED + seeds)
    }
    plans = sweep(planned, cells, folder, jobs=jobs, tick=tick)
    actions = np.array([plans[name]["actions"] for name in cells], np.float32).swapaxes(0, 1)
    apart = f"{task}:{HELD_OUT}"
    ship = get_task(task).sailed()
    texts: Sequence[str] = (*BASELINES, *([f"policy:{policy}"] if policy else []))
    rows = {}
    for text in (BOUND, *texts):
        sailing: Any = (
            _Recorded(actions)
            if text == BOUND
            else load_controller(text, ship, DEFAULTS.control_interval_s)
        )
        name = POLICY if text.startswith("policy:") else text
        setting = Setting(name, apart, "task", OBSERVER, seeds, episode_s=EPISODE_S)
        kpis, _ = run_episodes(setting, sailing, first_seed=FIRST_SEED)
        rows[name] = kpis[list(SHOWN)].mean()
    table = pd.DataFrame(rows).T
    worst, best = table["reward"][HELD], table["reward"][BOUND]
    share = 100.0 * (table["reward"] - worst) / (best - worst)
    return table.assign(share=share).rename_axis("controller").reset_index()
