"""The vector environment as a VecEnv of stable-baselines3, in the same process and without copies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from .records import TRUTHS
from .rewards import TERMS
from .steering import environment_classes


class Sb3Frigates(VecEnv):
    """Batch of ships as a VecEnv for ``PPO``, ``SAC`` and the other algorithms of stable-baselines3.

    The infos of each step hold the true state and ``reward_terms`` of each environment, those of ended
    episodes also ``terminal_observation``, ``TimeLimit.truncated`` and, after an engine failure,
    ``ended``. Wrap the environment in ``VecMonitor`` of stable-baselines3 to record the returns of
    episodes.

    Args:
        num_envs: number of environments.
        steered: whether the rudder is an action.
        render_mode: None or ``rgb_array``, for :meth:`get_images` and ``render``.
        options: keywords of :class:`shaftline.envs.FrigateVectorEnv`.
    """

    def __init__(
        self,
        num_envs: int,
        *,
        steered: bool = False,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        kind = environment_classes(steered).vector
        self.vector = vector = kind(num_envs, render_mode=render_mode, **options)
        self.render_mode = render_mode
        self._seed: int | None = None
        self._action: Any = None
        super().__init__(num_envs, vector.single_observation_space, vector.single_action_space)

    def reset(self) -> Any:
        """Start an episode in every environment, with the seed of the last call of ``seed`` if any."""
        observation, info = self.vector.reset(seed=self._seed)
        self._seed = None
        self.reset_infos = _rows(info)
        return observation

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seed of the next reset; environment i uses seed + i."""
        self._seed = seed
        return [None if seed is None else seed + i for i in range(self.num_envs)]

    def step_async(self, actions: Any) -> None:
        """Store the actions."""
        self._action = actions

    def step_wait(self) -> Any:
        """Hold the actions over one control interval."""
        observation, reward, terminated, truncated, info = self.vector.step(self._action)
        done = terminated | truncated
        infos = _rows(info)
        if done.any():
            last = _rows(info["final_info"])
            for i in np.flatnonzero(done).tolist():
                self.reset_infos[i] = infos[i]
                infos[i] = last[i]
                infos[i]["terminal_observation"] = info["final_obs"][i]
                infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
                if terminated[i]:
                    infos[i]["ended"] = info["final_info"]["ended"][i]
        return observation, reward.astype(np.float32), done, infos

    def get_images(self) -> Sequence[Any]:
        """Return the dashboard of each environment as an RGB array of shape (height, width, 3)."""
        return list(self.vector.render() or [None] * self.num_envs)

    def close(self) -> None:
        """Stop the threads."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the vector environment, once for each selected environment."""
        value = getattr(self, attr_name, None)
        if value is None:
            value = getattr(self.vector, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the vector environment."""
        setattr(self.vector, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of the vector environment, once for each selected environment."""
        method = getattr(self.vector, method_name)
        return [method(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each environment, because wrappers are not supported."""
        return [False for _ in self._get_indices(indices)]


def _rows(info: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the infos of a vector environment as a dictionary for each environment."""
    terms = info["reward_terms"]
    truth = zip(*(info[name].tolist() for name in TRUTHS), strict=True)
    rewarded = zip(*(terms[name].tolist() for name in TERMS), strict=True)
    rows: list[dict[str, Any]] = [dict(zip(TRUTHS, row, strict=True)) for row in truth]
    for row, values in zip(rows, rewarded, strict=True):
        row["reward_terms"] = dict(zip(TERMS, values, strict=True))
    return rows
