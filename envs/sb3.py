"""The vector environment as stable-baselines3's VecEnv, without a process or a copy between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from .frigate import FrigateVectorEnv
from .records import TRUTHS


class Sb3Frigates(VecEnv):
    """Frigates for ``PPO``, ``SAC`` and the others of stable-baselines3.

    ``terminal_observation`` and ``TimeLimit.truncated`` stand in the infos of ended episodes, as
    stable-baselines3 expects them.

    Args:
        num_envs: how many.
        options: keywords of :class:`shaftline.envs.FrigateVectorEnv`.
    """

    def __init__(self, num_envs: int, **options: Any) -> None:
        self.vector = FrigateVectorEnv(num_envs, **options)
        self._seed: int | None = None
        self._action: Any = None
        super().__init__(
            num_envs, self.vector.single_observation_space, self.vector.single_action_space
        )

    def reset(self) -> Any:
        """Begin everywhere; with the seed given before, if any."""
        observation, _ = self.vector.reset(seed=self._seed)
        self._seed = None
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return observation

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Take a seed for the next reset; sub-environment i gets seed + i."""
        self._seed = seed
        return [None if seed is None else seed + i for i in range(self.num_envs)]

    def step_async(self, actions: Any) -> None:
        """Remember the actions."""
        self._action = actions

    def step_wait(self) -> Any:
        """Hold the actions over one control interval."""
        observation, reward, terminated, truncated, info = self.vector.step(self._action)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done):
            infos[i]["terminal_observation"] = info["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
            infos[i].update({name: float(info[name][i]) for name in TRUTHS})
        return observation, reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Let the threads go."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector environment, once for each asked sub-environment."""
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
        """Call a method of the vector environment, once for each asked sub-environment."""
        return [
            getattr(self.vector, method_name)(*args, **kwargs) for _ in self._get_indices(indices)
        ]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Nothing is wrapped."""
        return [False for _ in self._get_indices(indices)]
