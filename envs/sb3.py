"""The vector environment as a VecEnv of stable-baselines3, in the same process and without copies."""

from __future__ import annotations

import functools
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
        options: keywords of :class:`shaftline.envs.FrigateVectorEnv`, without ``autoreset_mode``:
            stable-baselines3 expects the next episode in the step that ends one.

    Raises:
        TypeError: unknown keyword, or an ``autoreset_mode``.
    """

    def __init__(
        self,
        num_envs: int,
        *,
        steered: bool = False,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        if "autoreset_mode" in options:
            raise TypeError(
                "autoreset_mode: stable-baselines3 expects the next episode in the step that ends one, "
                "so it cannot be chosen"
            )
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


_EMPTY = ""  # only key of an info that is not filled: json writes "{}" for a dictionary of size 0
_KEYS = frozenset((*TRUTHS, "reward_terms", _EMPTY))


class _Info(dict[str, Any]):
    """Info of one environment, a dictionary that is filled from the columns at its first use.

    Algorithms ask for the end of an episode in every info, but hardly ever for the true state. To fill
    the dictionaries of many environments takes as long as a third of their step.
    """

    __slots__ = ("_columns", "_row")

    def __init__(self, columns: dict[str, Any], row: int) -> None:
        self._columns: dict[str, Any] | None = columns
        self._row = row
        self[_EMPTY] = None

    def fill(self) -> None:
        """Add the true state and the reward terms, before any key that was set already."""
        columns, self._columns, i = self._columns, None, self._row
        if columns is not None:
            terms = columns["reward_terms"]
            super().__delitem__(_EMPTY)
            added = dict(super().items())
            super().clear()
            super().update({name: columns[name].item(i) for name in TRUTHS})
            super().update(reward_terms={name: terms[name].item(i) for name in TERMS}, **added)

    def __missing__(self, key: str) -> Any:
        """Return the value of a key that is not filled yet."""
        if key not in _KEYS or self._columns is None:
            raise KeyError(key)
        self.fill()
        return self[key]

    def get(self, key: str, default: Any = None) -> Any:
        """Return the value of a key, or a default; the keys of the algorithms need no filling."""
        if key in _KEYS:
            self.fill()
        return super().get(key, default)

    def __reduce__(self) -> Any:
        """Return the dictionary for copies and other processes, without the columns."""
        return dict, (dict(self.items()),)


def _after_filling(method: Any) -> Any:
    """Return a method of a dictionary that fills all infos among its arguments first."""

    @functools.wraps(method)
    def filled(*given: Any, **named: Any) -> Any:
        for argument in given:
            if isinstance(argument, _Info):
                argument.fill()
        return method(*given, **named)

    return filled


# fmt: off
for _name in (
    "__contains__", "__delitem__", "__eq__", "__ior__", "__iter__", "__len__", "__ne__", "__or__",
    "__repr__", "__reversed__", "__ror__", "clear", "copy", "items", "keys", "pop", "popitem",
    "setdefault", "update", "values",
):
    setattr(_Info, _name, _after_filling(getattr(dict, _name)))
# fmt: on


def _rows(info: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the infos of a vector environment as a dictionary for each environment."""
    return [_Info(info, i) for i in range(len(info[TRUTHS[0]]))]
