"""Options that the commands for tasks share: training, tuning, evaluation, animation, data sets."""

from __future__ import annotations

import tomllib
from enum import StrEnum
from typing import Annotated

import typer

from .source import PACKAGE, constant

_SETTINGS = "envs/settings.py"
OBSERVER: str = constant(_SETTINGS, "Settings.observer")
"""Observer of the environments by default."""

INTERVAL_S: float = constant(_SETTINGS, "Settings.control_interval_s")
"""Control interval of the environments by default [s]."""

EPISODE_S: float = constant(_SETTINGS, "EPISODE_S")
"""Length of an episode by default [s]."""

LONGEST_S: float = constant(_SETTINGS, "LARGEST_EPISODE") * INTERVAL_S
"""Length of the longest episode at the default control interval [s]."""


def task_names() -> list[str]:
    """Return the names of all tasks."""
    tables = tomllib.loads((PACKAGE / "envs/tasks.toml").read_text(encoding="utf-8"))
    return [name for name in tables if name != "tolerances"]


class Device(StrEnum):
    """Device on which the network is trained."""

    AUTO = "auto"
    CPU = "cpu"
    CUDA = "cuda"


TaskName = Annotated[str, typer.Option(help=f"Task: {', '.join(task_names())}.")]
ObserverName = Annotated[str, typer.Option(help="Observer of the advance velocity.")]
EpisodeLength = Annotated[
    float, typer.Option(min=1.0, max=LONGEST_S, help="Length of an episode [s].")
]
Algorithm = Annotated[str, typer.Option(help="Algorithm: `ppo` or `sac`.")]
Timesteps = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Control intervals of all environments together.",
        show_default="that of the recipe",
    ),
]
Envs = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=4096,
        help="Number of environments in parallel.",
        show_default="that of the recipe",
    ),
]
Plans = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=1000,
        show_default="that of the recipe",
        help="Episodes to plan with known waves and to imitate before reinforcement learning.",
    ),
]
TaskShip = Annotated[
    str | None,
    typer.Option(help="Ship: a preset or a .toml file.", show_default="that of the task"),
]
OnDevice = Annotated[
    Device, typer.Option(help="Device of torch; `auto` uses a GPU if there is one.")
]


def sizes(timesteps: int | None, envs: int | None, plans: int | None) -> dict[str, int]:
    """Return the sizes of a recipe that are given as options."""
    given = {"n_timesteps": timesteps, "n_envs": envs, "plans": plans}
    return {key: value for key, value in given.items() if value is not None}


def check_device(device: Device) -> None:
    """Refuse a GPU that torch cannot use."""
    import torch

    if device is Device.CUDA and not torch.cuda.is_available():
        raise ValueError("--device cuda: torch finds no GPU; give cpu or auto")
