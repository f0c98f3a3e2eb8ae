"""Training recipes: hyperparameters in YAML, in the layout of rl-zoo3.

A file holds a section for each task. The keys of a section are those of the algorithm of
stable-baselines3, with ``n_envs``, ``n_timesteps``, ``frame_stack``, ``evaluations`` and ``env_kwargs``
beside them, and ``lin_3e-4`` for a value that falls to zero along the training.
"""

from __future__ import annotations

import inspect
import itertools
import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import (
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from ...core.files import FileError, check_size, read_text, reason_of
from ...core.models import FileModel
from ...envs import get_task
from ...envs.settings import Settings
from ...observers import ObserverError, get_observer
from ..policy.policy import MOST_FRAMES

ALGORITHMS = ("ppo", "sac", "td3")
_SET_HERE = {"env", "policy", "verbose", "seed", "device", "tensorboard_log", "_init_setup_model"}
_ENVIRONMENT = (
    "observer", "tuning", "sea", "sensor_noise", "max_episode_steps", "randomise", "action_mode",
    "command",
)  # fmt: skip
"""Keywords of the environment that a recipe may set."""

_ON_TUNED = "residual:tuned"
"""Action mode of a recipe: a residual on the tuned classic controller of the task."""

_RANGES = {
    "gamma": (0.0, 1.0), "gae_lambda": (0.0, 1.0), "learning_rate": (0.0, 10.0), "tau": (0.0, 1.0),
    "clip_range": (0.0, 10.0), "n_steps": (0.0, 1e9), "batch_size": (0.0, 1e9), "n_epochs": (0.0, 1e6),
    "buffer_size": (0.0, 1e12), "max_grad_norm": (0.0, 1e9),
}  # fmt: skip
"""Of hyperparameters: above the first, at most the second."""

_WHOLE = ("n_steps", "batch_size", "n_epochs", "buffer_size")
"""Hyperparameters that count something."""

_BYTES_A_STEP, _BYTES_A_WEIGHT = 1000.0, 64.0  # gradients, moments, both networks


class RecipeError(ValueError):
    """A recipe that does not exist or cannot be used; the message names file, key and range."""


class Recipe(FileModel):
    """Everything that decides a training, the seed apart."""

    algorithm: Literal["ppo", "sac", "td3"]
    task: str = Field(description="task that is trained on")
    n_envs: int = Field(ge=1, le=4096)
    n_timesteps: int = Field(ge=1, description="control intervals, all environments together")
    policy: Literal["MlpPolicy"] = "MlpPolicy"
    frame_stack: int = Field(
        1, ge=1, le=MOST_FRAMES, description="observations that the policy sees, the last ones"
    )
    plans: int = Field(
        default=0,
        ge=0,
        le=1000,
        description="episodes that are planned, and imitated before the learning",
    )
    evaluations: int = Field(10, ge=1, description="evaluations, at each of which it is saved")
    env_kwargs: dict[str, Any] = Field(default_factory=dict)
    hyperparameters: dict[str, Any] = Field(default_factory=dict)

    @field_validator("n_timesteps", mode="before")
    @classmethod
    def _whole(cls, value: Any) -> Any:
        return int(value) if isinstance(value, float) and value.is_integer() else value

    @field_validator("hyperparameters")
    @classmethod
    def _finite(cls, value: dict[str, Any]) -> dict[str, Any]:
        for key, given in value.items():
            if infinite := [n for n in _numbers_in(given) if not math.isfinite(n)]:
                raise ValueError(f"{key} = {infinite[0]}: must be a finite number")
        return value

    @model_validator(mode="after")
    def _within_ranges(self) -> Recipe:
        """What the algorithms would take without a word and train into nonsense or out of memory."""
        for key, (low, high) in _RANGES.items():
            given = self.hyperparameters.get(key)
            if isinstance(given, str):
                try:
                    if key in _WHOLE:
                        raise ValueError
                    given = float(given.removeprefix("lin_"))  # to YAML 1.1, 1e-3 is a text
                except ValueError:
                    also = "" if key in _WHOLE else ", or lin_NUMBER"
                    raise ValueError(f"{key} = {given!r}: must be a number{also}") from None
            if isinstance(given, int | float) and not low < given <= high:
                raise ValueError(f"{key} = {given:g}: must be above {low:g} and at most {high:g}")
        rollout = float(self.hyperparameters.get("n_steps", 1)) * self.n_envs
        kept = float(self.hyperparameters.get("buffer_size", 0))
        check_size(max(rollout, kept), _BYTES_A_STEP, "steps kept (n_steps n_envs, or buffer_size)")
        policy = self.hyperparameters.get("policy_kwargs") or {}
        if not isinstance(policy, dict):
            raise ValueError(f"policy_kwargs = {policy!r}: must be a mapping")
        net = policy.get("net_arch") or []
        if not isinstance(net, list | dict):
            raise ValueError(f"net_arch = {net!r}: must be a list of widths, or lists by network")
        layers = net if isinstance(net, list) else [n for part in net.values() for n in part]
        widths = [float(n) for n in layers if isinstance(n, int | float)]
        weights = sum(a * b for a, b in itertools.pairwise([256.0, *widths, 256.0]))
        check_size(weights, _BYTES_A_WEIGHT, "weights of a network (net_arch)")
        return self

    @model_validator(mode="after")
    def _imitable(self) -> Recipe:
        """Refuse plans that cannot be made, or that the policy could not follow."""
        if not self.plans:
            return self
        said = f"plans = {self.plans}: "
        if get_task(self.task).steered:
            raise ValueError(
                f"{said}a plan has no rudder, and {self.task} needs one; give plans: 0"
            )
        env = Settings.of({"task": self.task} | self.env_kwargs)
        mode, command = env.action_mode.partition(":")[0], env.drive_command
        if self.algorithm != "ppo" or mode == "increment" or command == "shaft-speed":
            raise ValueError(
                f"{said}PPO imitates commands of pitch and fuel rack, not {self.algorithm} with {mode} "
                f"and {command}; give algorithm ppo and env_kwargs: {{action_mode: absolute, command: "
                "limited-rack} or a residual, or plans: 0"
            )
        if env.max_episode_steps is None:
            raise ValueError(
                f"{said}a plan needs an episode with an end; give env_kwargs.max_episode_steps, or "
                "plans: 0"
            )
        gamma = self.hyperparameters.get("gamma", 0.99)
        if not (isinstance(gamma, int | float) and gamma < 1.0):
            raise ValueError(
                f"{said}the value network is fitted to discounted rewards, which needs a gamma below 1, "
                f"not {gamma!r}; or give plans: 0"
            )
        return self


def _numbers_in(value: Any) -> list[float]:
    """Return the floating-point numbers that a value of a recipe holds at any depth."""
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return [number for part in value for number in _numbers_in(part)]
    return [value] if isinstance(value, float) else []


def recipe_path(algorithm: str) -> Path:
    """Return the file of recipes for an algorithm that comes with the package."""
    return Path(
        str(resources.files("shaftline.agents.learning").joinpath("recipes", f"{algorithm}.yml"))
    )


def tuned_controller(task: str) -> str:
    """Return the tuned classic controller of a task, as ``NAME:option=number,...``.

    It is the best of those that ``shaftline tune`` found for the task, on the seas of the training.

    Raises:
        RecipeError: none is known for the task.
    """
    found = yaml.safe_load(recipe_path("tuned_controllers").read_text(encoding="utf-8"))
    if task not in found:
        raise RecipeError(f"no tuned controller is known for {task!r}; known: {', '.join(found)}")
    return str(found[task])


def read_recipe(
    algorithm: str, task: str, path: str | Path | None = None, **changes: Any
) -> Recipe:
    """A task's section of a file of recipes.

    Args:
        algorithm: ``ppo``, ``sac`` or ``td3``.
        task: section.
        path: file; the package's own by default.
        changes: values that replace the file's: fields of :class:`Recipe`; those of ``env_kwargs`` are
            merged.

    Raises:
        RecipeError: no such algorithm, file or section; an unknown key or a value out of range.
    """
    if algorithm not in ALGORITHMS:
        raise RecipeError(f"unknown algorithm {algorithm!r}; known: {', '.join(ALGORITHMS)}")
    file = recipe_path(algorithm) if path is None else Path(path)
    if path is None and not file.is_file():
        raise RecipeError(f"no recipes for {algorithm} come with the package; give a file of yours")
    try:
        sections = yaml.safe_load(read_text(file))
    except FileError as error:
        raise RecipeError(str(error)) from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise RecipeError(f"{file}: cannot be read as YAML ({reason_of(error)})") from None
    if not isinstance(sections, dict) or not isinstance(sections.get(task), dict):
        known = ", ".join(map(str, sections)) if isinstance(sections, dict) else "none"
        raise RecipeError(f"{file}: no section {task!r}; it has {known}")
    return recipe_of(sections[task], algorithm, task, str(file), **changes)


def section_of(recipe: Recipe) -> dict[str, Any]:
    """A recipe as :func:`recipe_of` takes it."""
    values = recipe.model_dump(exclude={"algorithm", "task", "hyperparameters"})
    return values | recipe.hyperparameters


def recipe_of(
    section: Mapping[str, Any], algorithm: str, task: str, file: str, **changes: Any
) -> Recipe:
    """A recipe from its section.

    Args:
        section: keys and values.
        algorithm: ``ppo``, ``sac`` or ``td3``.
        task: the section's name.
        file: where it stands, for the message.
        changes: as of :func:`read_recipe`.

    Raises:
        RecipeError: an unknown key or a value out of range.
    """
    values = dict(section)
    own = {key: values.pop(key) for key in list(values) if key in Recipe.model_fields}
    if not isinstance(own.get("env_kwargs") or {}, dict):
        raise RecipeError(f"{file}: [{task}] env_kwargs = {own['env_kwargs']!r}: must be a mapping")
    env = (own.get("env_kwargs") or {}) | changes.pop("env_kwargs", {})
    if refused := sorted(map(str, set(env) - set(_ENVIRONMENT))):
        raise RecipeError(
            f"{file}: [{task}] env_kwargs.{refused[0]}: cannot be set by a recipe; "
            f"it may set {', '.join(_ENVIRONMENT)}"
        )
    if env.get("action_mode") == _ON_TUNED:
        env["action_mode"] = f"residual:{tuned_controller(task)}"
    _check_keys(file, task, algorithm, values)
    if "observer" in env:
        try:
            get_observer(str(env["observer"]))
        except ObserverError as error:
            raise RecipeError(f"{file}: [{task}] env_kwargs.observer: {error}") from None
    try:
        recipe = Recipe.model_validate(
            {"task": task, **own, "algorithm": algorithm, "hyperparameters": values, **changes,
             "env_kwargs": env}
        )  # fmt: skip
        get_task(recipe.task)
    except ValidationError as error:
        said = "; ".join(
            f"{'.'.join(map(str, e['loc']))} = {e['input']!r}: {e['msg']}"
            if e["loc"]
            else e["msg"].removeprefix("Value error, ")  # of several keys: it names them itself
            for e in error.errors()
        )
        raise RecipeError(f"{file}: [{task}] {said}") from None
    return recipe


def _check_keys(file: str, task: str, algorithm: str, values: dict[str, Any]) -> None:
    from stable_baselines3 import PPO, SAC, TD3  # torch takes seconds to import

    parameters = inspect.signature({"ppo": PPO, "sac": SAC, "td3": TD3}[algorithm]).parameters
    known = set(parameters) - _SET_HERE
    for key, value in values.items():
        if key in known and isinstance(value, bool) and type(parameters[key].default) is not bool:
            raise RecipeError(f"{file}: [{task}] {key} = {value}: must be a number")
        if key not in known:
            raise RecipeError(
                f"{file}: [{task}] unknown key {key!r}; {algorithm.upper()} knows "
                f"{', '.join(sorted(known))}; beside them stand {', '.join(Recipe.model_fields)}"
            )
