"""What could be had at best in a task's held-out seas, and which share of it each controller gets.

The gap is from the combinator with a trimmed lever to the clairvoyant plan, in the task's own reward.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...agents.evaluation.clairvoyant import Clairvoyant
from ...agents.evaluation.controllers import load_controller
from ...agents.evaluation.episodes import Setting, run_episodes
from ...agents.evaluation.sweeps import version_of_cells
from ...agents.policy.policy import load_policy
from ...core.sweep import digest_of, sweep
from ...envs.settings import DEFAULTS, Settings
from ...envs.tasks import HELD_OUT, get_task
from .comparison import BASELINES, FIRST_SEED, HELD, OBSERVER, POLICY, SHOWN, TUNED

BOUND = "clairvoyant"
_LENGTH_S = 150.0
_SECOND = "speed-pilot"
"""Plans begin from the tuned law and from this; the better one is the bound."""


def length_of(task: str) -> float:
    """Length of a task's planned episodes [s]: 150, or two orders where a new one comes sooner."""
    interval = get_task(task).order_interval_s
    return 2.0 * interval if interval < _LENGTH_S else _LENGTH_S


class _Recorded:
    """Plays plans back, one an episode."""

    def __init__(self, actions: NDArray[np.float32]) -> None:
        self._actions, self._next = actions, 0

    def predict(self, *_: Any, **__: Any) -> tuple[NDArray[np.float32], None]:
        self._next += 1
        return self._actions[self._next - 1], None


def planned(cell: tuple[str, str, int]) -> dict[str, Any]:
    """The plan of a task's episode, from a law, as JSON allows."""
    task, law, seed = cell
    apart = f"{task}:{HELD_OUT}"
    ship = get_task(task).sailed()
    episode = Clairvoyant(
        Settings.of(
            {
                "task": apart,
                "max_episode_steps": round(length_of(task) / DEFAULTS.control_interval_s),
            }
        ),
        seed,
    )
    plans = [
        episode.plan(load_controller(name, ship, episode.interval_s)) for name in (law, _SECOND)
    ]
    best = max(plans, key=lambda plan: float(plan.rewards.sum()))
    return {
        "actions": best.actions.tolist(), "reward": float(best.rewards.sum()),
        "rewards": [float(plan.rewards.sum()) for plan in plans],
    }  # fmt: skip


def bound(
    task: str,
    policy: Path,
    folder: Path,
    *,
    seeds: int = 6,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> pd.DataFrame:
    """KPIs of the plans and of all controllers in the same episodes, and shares of the gap.

    Args:
        task: name.
        policy: file; plans begin from the law that it is added to.
        folder: for the plans; those that stand there are not made again.
        seeds: episodes.
        jobs: see :func:`shaftline.core.sweep.sweep`.
        tick: called after each plan.

    Returns:
        A row a controller: means of the KPIs, ``share`` of the gap in the reward [%].
    """
    law = load_policy(policy).adapter.form.base
    version = version_of_cells(get_task(task).vessel)
    cells = {
        f"{task}-{seed}_{digest_of(law)}_{version}": (task, law, seed)
        for seed in range(FIRST_SEED, FIRST_SEED + seeds)
    }
    plans = sweep(planned, cells, folder, jobs=jobs, tick=tick)
    actions = np.array([plans[name]["actions"] for name in cells], np.float32).swapaxes(0, 1)
    ship = get_task(task).sailed()
    texts = dict.fromkeys(BASELINES) | {TUNED: law, POLICY: f"policy:{policy}"}
    sailing: dict[str, Any] = {
        name: load_controller(text or name, ship, DEFAULTS.control_interval_s)
        for name, text in texts.items()
    }
    rows = {}
    for name, controller in ({BOUND: _Recorded(actions)} | sailing).items():
        setting = Setting(
            name, f"{task}:{HELD_OUT}", "task", OBSERVER, seeds, episode_s=length_of(task)
        )
        kpis, _ = run_episodes(setting, controller, first_seed=FIRST_SEED)
        rows[name] = kpis[list(SHOWN)].mean()
    table = pd.DataFrame(rows).T
    worst, best = table["reward"][HELD], table["reward"][BOUND]
    share = 100.0 * (table["reward"] - worst) / (best - worst)
    return table.assign(share=share).rename_axis("controller").reset_index()
