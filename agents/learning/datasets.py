"""Data sets of recorded episodes for offline learning, in the format of Minari.

This module needs ``pip install 'shaftline[datasets]'``. The qualities are those of D4RL (Fu et al.
2020): actions of the policy of the package (``expert``), the same with half of the actions random
(``medium``), and random actions only (``random``).
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from ...core.files import check_size
from ...envs import DEFAULTS, get_task
from ...envs.steering import environment_classes
from ..policy.policy import Policy, PolicyError, load_policy, packaged_policies

RANDOM_SHARE = {"expert": 0.0, "medium": 0.5, "random": 1.0}
"""Share of the actions that are drawn uniformly, by quality."""

QUALITIES = tuple(RANDOM_SHARE)

FIRST_SEED = 1_000_000
"""First seed of the recorded episodes; training and evaluation use other seeds."""

_BYTES_A_STEP = 2000.0


def record(
    task: str,
    quality: str,
    episodes: int,
    folder: str | Path,
    *,
    policy: Policy | None = None,
    seed: int = 0,
    tick: Callable[[int, int], None] = lambda done, total: None,
) -> str:
    """Record episodes of a task as a Minari data set, and return its id.

    Args:
        task: name of the task.
        quality: one of :data:`QUALITIES`.
        episodes: number of episodes.
        folder: folder of the data sets, Minari's ``MINARI_DATASETS_PATH``.
        policy: policy whose actions are recorded; by default that of the package for the task.
        seed: seed of the episodes and of the random actions.
        tick: function called with the number of finished episodes and of all episodes.

    Raises:
        ValueError: an unknown quality, no episode, or a data set that already exists.
        PolicyError: the package has no policy for the task, or the given policy is one of another task.
    """
    if quality not in QUALITIES:
        raise ValueError(f"unknown quality {quality!r}; known: {', '.join(QUALITIES)}")
    if episodes < 1:
        raise ValueError(f"episodes = {episodes}: must be at least 1")
    check_size(episodes * (DEFAULTS.max_episode_steps or 1), _BYTES_A_STEP, "recorded intervals")
    if policy is None:
        if task not in packaged_policies():
            raise PolicyError(
                f"the package has no policy for the task {task!r}; give a policy file"
            )
        policy = load_policy(task)
    if (own := policy.about["recipe"]["task"]) != task:
        raise PolicyError(
            f"the policy was trained for the task {own!r}, the data set is of {task!r}"
        )
    name = f"shaftline/{task}/{quality}-v0"
    place = Path(folder)
    if (place / name).exists():
        raise ValueError(f"{place / name} already exists: remove it, or choose another folder")
    place.mkdir(parents=True, exist_ok=True)
    os.environ["MINARI_DATASETS_PATH"] = str(place.resolve())
    import minari  # It reads the environment variable when it is imported.

    random_share, first = RANDOM_SHARE[quality], FIRST_SEED + seed * episodes
    recorded = _record_episodes(policy, random_share, episodes, first, seed, tick)
    kind, ship = environment_classes(get_task(task).steered).id, policy.about["ship_source"]
    env = gymnasium.make(kind, task=task, ship=ship, **policy.interface)
    buffers = [minari.data_collector.EpisodeBuffer(id=k, **one) for k, one in enumerate(recorded)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # It asks for an e-mail address and a link.
        minari.create_dataset_from_buffers(
            name,
            buffers,
            env=env,
            eval_env=env,
            author={"shaftline"},
            algorithm_name=f"packaged policy, {100 * random_share:.0f} % of its actions random",
            description=get_task(task).description,
            requirements=["shaftline"],
        )
    env.close()
    return name


def _record_episodes(
    policy: Policy, random_share: float, episodes: int, first_seed: int, seed: int, tick: Any
) -> list[dict[str, Any]]:
    """Return the episodes as keywords of ``EpisodeBuffer`` of Minari."""
    task = policy.about["recipe"]["task"]
    env = environment_classes(get_task(task).steered).vector(
        episodes,
        task=task,
        ship=policy.about["ship_source"],
        autoreset_mode="NextStep",
        **policy.interface,
    )
    rng = np.random.default_rng(seed)
    seen, _ = env.reset(seed=first_seed)
    observations, actions, rewards, ends = [seen], [], [], []
    alive, lengths = np.ones(episodes, dtype=bool), np.zeros(episodes, dtype=int)
    state, starting = None, alive
    while alive.any():
        action, state = policy.predict(seen, state, starting)
        drawn = rng.random(episodes) < random_share
        action[drawn] = rng.uniform(-1.0, 1.0, action[drawn].shape)
        seen, reward, terminated, truncated, _ = env.step(action)
        lengths += alive
        starting = terminated | truncated
        alive = alive & ~starting
        observations.append(seen)
        actions.append(action)
        rewards.append(reward)
        ends.append((terminated, truncated))
        tick(int(episodes - alive.sum()), episodes)
    env.close()
    return [
        {
            "seed": first_seed + k,
            "observations": np.array([row[k] for row in observations[: n + 1]]),
            "actions": np.array([row[k] for row in actions[:n]]),
            "rewards": [float(row[k]) for row in rewards[:n]],
            "terminations": [bool(row[0][k]) for row in ends[:n]],
            "truncations": [bool(row[1][k]) for row in ends[:n]],
        }
        for k, n in enumerate(lengths)
    ]
