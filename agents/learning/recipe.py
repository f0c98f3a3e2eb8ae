"""Training recipes: hyperparameters in YAML, in the layout of rl-zoo3.

A file has a section for each task. The keys of a section are those of the algorithm of
stable-baselines3, and ``n_envs``, ``n_timesteps``, ``frame_stack``, ``plans``, ``evaluations`` and
``env_kwargs``. A value such as ``lin_3e-4`` falls linearly to zero during the training.
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
from pydantic import Field, ValidationError, field_validator, model_validator

from ...core.files import FileError, check_size, read_text, reason_of
from ...core.models import FileModel, short
from ...envs import get_task
from ...envs.settings import Settings
from ...observers import ObserverError, get_observer
from ..policy.policy import MOST_FRAMES

ALGORITHMS = ("ppo", "sac", "td3")
_SET_HERE = {"env", "policy", "verbose", "seed", "device", "tensorboard_log", "_init_setup_model"}
_ENVIRONMENT = (
    "observer",
    "tuning",
    "sea",
    "sensor_noise",
    "max_episode_steps",
    "randomise",
    "action_mode",
    "command",
)
"""Keywords of the environment that a recipe can set."""

_ON_TUNED = "residual:tuned"
"""Action mode of a recipe: a residual on the tuned classic controller of the task."""

_RANGES = {
    "gamma": (0.0, 1.0),
    "gae_lambda": (0.0, 1.0),
    "learning_rate": (0.0, 10.0),
    "tau": (0.0, 1.0),
    "clip_range": (0.0, 10.0),
    "n_steps": (0.0, 1e9),
    "batch_size": (0.0, 1e9),
    "n_epochs": (0.0, 1e6),
    "buffer_size": (0.0, 1e12),
    "max_grad_norm": (0.0, 1e9),
}
"""Range of hyperparameters: above the first value, at most the second."""

_WHOLE = ("n_steps", "batch_size", "n_epochs", "buffer_size")
"""Hyperparameters that are whole numbers."""

_BYTES_A_STEP, _BYTES_A_WEIGHT = 1000.0, 64.0  # gradients, moments, both networks


class RecipeError(ValueError):
    """A recipe does not exist or cannot be used; the message names file, key and range."""


class Recipe(FileModel):
    """Recipe of a training: everything that determines its result except the seed.

    Examples:
        >>> recipe = Recipe(algorithm="ppo", task="transit", n_envs=4, n_timesteps=1000)
        >>> recipe.evaluations, recipe.frame_stack
        (10, 1)
    """

    algorithm: Literal["ppo", "sac", "td3"]
    task: str = Field(description="task of the training")
    n_envs: int = Field(ge=1, le=4096)
    n_timesteps: int = Field(ge=1, description="control intervals of all environments together")
    policy: Literal["MlpPolicy"] = "MlpPolicy"
    frame_stack: int = Field(
        1, ge=1, le=MOST_FRAMES, description="number of the last observations in the policy input"
    )
    plans: int = Field(
        default=0,
        ge=0,
        le=1000,
        description="clairvoyant plans to imitate before reinforcement learning",
    )
    evaluations: int = Field(10, ge=1, description="evaluations, each followed by a checkpoint")
    env_kwargs: dict[str, Any] = Field(default_factory=dict)
    hyperparameters: dict[str, Any] = Field(default_factory=dict)

    @property
    def settings(self) -> Settings:
        """Settings of the training environment."""
        return Settings.of({"task": self.task} | self.env_kwargs)

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
        """Refuse values that the algorithms accept but that make training fail or use up the memory."""
        for key, (low, high) in _RANGES.items():
            given = self.hyperparameters.get(key)
            if isinstance(given, str):
                number = _number_of(given)
                if number is None or key in _WHOLE:
                    also = "" if key in _WHOLE else ", or lin_NUMBER"
                    raise ValueError(f"{key} = {short(given)}: must be a number{also}")
                given = number
            elif not isinstance(given, int | float | None):
                raise ValueError(f"{key} = {short(given)}: must be a number")
            if isinstance(given, int | float) and not low < given <= high:
                raise ValueError(f"{key} = {given:g}: must be above {low:g} and at most {high:g}")
        rollout = float(self.hyperparameters.get("n_steps", 1)) * self.n_envs
        kept = float(self.hyperparameters.get("buffer_size", 0))
        check_size(max(rollout, kept), _BYTES_A_STEP, "steps kept (n_steps n_envs, or buffer_size)")
        policy = self.hyperparameters.get("policy_kwargs") or {}
        if not isinstance(policy, dict):
            raise ValueError(f"policy_kwargs = {short(policy)}: must be a mapping")
        net = policy.get("net_arch") or []
        if not isinstance(net, list | dict):
            raise ValueError(
                f"net_arch = {short(net)}: must be a list of widths, or lists by network"
            )
        layers = net if isinstance(net, list) else [n for part in net.values() for n in part]
        widths = [float(n) for n in layers if isinstance(n, int | float)]
        weights = sum(a * b for a, b in itertools.pairwise([256.0, *widths, 256.0]))
        check_size(weights, _BYTES_A_WEIGHT, "weights of a network (net_arch)")
        return self

    @model_validator(mode="after")
    def _imitable(self) -> Recipe:
        """Refuse plans that cannot be computed, or that the policy could not follow."""
        if not self.plans:
            return self
        said = f"plans = {self.plans}: "
        if get_task(self.task).steered:
            raise ValueError(
                f"{said}a plan has no rudder command, which {self.task} needs; set plans: 0"
            )
        env = self.settings
        mode, command = env.action_mode.partition(":")[0], env.drive_command
        if self.algorithm != "ppo" or mode == "increment" or command == "shaft-speed":
            raise ValueError(
                f"{said}only PPO with commands of pitch and fuel rack can imitate plans, not "
                f"{self.algorithm} with {mode} and {command}; set algorithm ppo and env_kwargs: "
                "{action_mode: absolute, command: limited-rack} or a residual, or set plans: 0"
            )
        if env.max_episode_steps is None:
            raise ValueError(
                f"{said}a plan needs an episode with an end; set env_kwargs.max_episode_steps, or set "
                "plans: 0"
            )
        gamma = self.hyperparameters.get("gamma", 0.99)
        if not (isinstance(gamma, int | float) and gamma < 1.0):
            raise ValueError(
                f"{said}the value network is fitted to discounted rewards, which needs a gamma below 1, "
                f"not {gamma!r}; set gamma below 1, or plans: 0"
            )
        return self


def _number_of(text: str) -> float | None:
    """Return the number of ``NUMBER`` or ``lin_NUMBER``, because YAML 1.1 reads 1e-3 as text."""
    try:
        return float(text.removeprefix("lin_"))
    except ValueError:
        return None


def _numbers_in(value: Any) -> list[float]:
    """Return the floating-point numbers that a value of a recipe contains at any depth."""
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return [number for part in value for number in _numbers_in(part)]
    return [value] if isinstance(value, float) else []


def recipe_path(algorithm: str) -> Path:
    """Return the path of the recipes of the package for an algorithm.

    Examples:
        >>> recipe_path("ppo").name
        'ppo.yml'
    """
    folder = resources.files("shaftline.agents.learning").joinpath("recipes")
    return Path(str(folder.joinpath(f"{algorithm}.yml")))


def tuned_controller(task: str) -> str:
    """Return the best controller that ``shaftline tune`` found for a task, ``NAME:option=number,...``.

    Raises:
        RecipeError: no tuned controller is known for the task.

    Examples:
        >>> tuned_controller("storm").partition(":")[0]
        'va-pitch'
    """
    found = yaml.safe_load(recipe_path("tuned_controllers").read_text(encoding="utf-8"))
    if task not in found:
        raise RecipeError(f"no tuned controller is known for {task!r}; known: {', '.join(found)}")
    return str(found[task])


def read_recipe(
    algorithm: str, task: str, path: str | Path | None = None, **changes: Any
) -> Recipe:
    """Return the recipe of a task from a file.

    Args:
        algorithm: ``ppo``, ``sac`` or ``td3``.
        task: name of the task, which is that of the section.
        path: file; that of the package by default.
        changes: fields of :class:`Recipe` that replace those of the file; ``env_kwargs`` are merged.

    Raises:
        RecipeError: no such algorithm, file or section; an unknown key or a value out of range.
    """
    if algorithm not in ALGORITHMS:
        raise RecipeError(f"unknown algorithm {algorithm!r}; known: {', '.join(ALGORITHMS)}")
    file = recipe_path(algorithm) if path is None else Path(path)
    if path is None and not file.is_file():
        raise RecipeError(f"the package has no recipes for {algorithm}; give a recipe file")
    try:
        sections = yaml.safe_load(read_text(file))
    except FileError as error:
        raise RecipeError(str(error)) from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise RecipeError(f"{file}: cannot be read as YAML ({reason_of(error)})") from None
    if not isinstance(sections, dict) or not isinstance(sections.get(task), dict):
        known = ", ".join(map(str, sections)) if isinstance(sections, dict) else "none"
        raise RecipeError(f"{file}: no section {task!r}; its sections are {known}")
    return build_recipe(sections[task], algorithm, task, str(file), **changes)


def recipe_section(recipe: Recipe) -> dict[str, Any]:
    """Return a recipe as a section for :func:`build_recipe`."""
    values = recipe.model_dump(exclude={"algorithm", "task", "hyperparameters"})
    return values | recipe.hyperparameters


def build_recipe(
    section: Mapping[str, Any], algorithm: str, task: str, file: str, **changes: Any
) -> Recipe:
    """Return a recipe from its section; ``file`` is named in messages.

    The other arguments and the errors are those of :func:`read_recipe`.
    """
    values = dict(section)
    own = {key: values.pop(key) for key in list(values) if key in Recipe.model_fields}
    if not isinstance(own.get("env_kwargs") or {}, dict):
        raise RecipeError(f"{file}: [{task}] env_kwargs = {own['env_kwargs']!r}: must be a mapping")
    env = (own.get("env_kwargs") or {}) | changes.pop("env_kwargs", {})
    if refused := sorted(map(str, set(env) - set(_ENVIRONMENT))):
        raise RecipeError(
            f"{file}: [{task}] env_kwargs.{refused[0]}: cannot be set by a recipe; allowed are "
            f"{', '.join(_ENVIRONMENT)}"
        )
    if env.get("action_mode") == _ON_TUNED:
        env["action_mode"] = f"residual:{tuned_controller(task)}"
    _check_keys(file, task, algorithm, values)
    if "observer" in env:
        try:
            get_observer(str(env["observer"]))
        except ObserverError as error:
            raise RecipeError(f"{file}: [{task}] env_kwargs.observer: {error}") from None
    own = {"task": task} | own | {"algorithm": algorithm, "hyperparameters": values}
    try:
        recipe = Recipe.model_validate(own | changes | {"env_kwargs": env})
        get_task(recipe.task)
    except ValidationError as error:
        said = "; ".join(map(_said, error.errors()))
        raise RecipeError(f"{file}: [{task}] {said}") from None
    return recipe


def _said(error: Any) -> str:
    """Return an error as text; the message of a check of several keys names the keys itself."""
    if not error["loc"]:
        return str(error["msg"]).removeprefix("Value error, ")
    return f"{'.'.join(map(str, error['loc']))} = {error['input']!r}: {error['msg']}"


def _check_keys(file: str, task: str, algorithm: str, values: dict[str, Any]) -> None:
    from stable_baselines3 import PPO, SAC, TD3  # Importing torch takes seconds.

    parameters = inspect.signature({"ppo": PPO, "sac": SAC, "td3": TD3}[algorithm]).parameters
    known = set(parameters) - _SET_HERE
    for key, value in values.items():
        if key in known and isinstance(value, bool) and type(parameters[key].default) is not bool:
            raise RecipeError(f"{file}: [{task}] {key} = {value}: must be a number")
        if key not in known:
            raise RecipeError(
                f"{file}: [{task}] unknown key {key!r}; known keys of {algorithm.upper()}: "
                f"{', '.join(sorted(known))}; of a recipe: {', '.join(Recipe.model_fields)}"
            )
