"""Options that the commands that train share."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from ..envs import tasks


class Device(StrEnum):
    """Where the network learns."""

    AUTO = "auto"
    CPU = "cpu"
    CUDA = "cuda"


TaskName = Annotated[str, typer.Option(help=f"One of {', '.join(tasks(None))}.")]
Algorithm = Annotated[str, typer.Option(help="`ppo` or `sac`.")]
Timesteps = Annotated[
    int | None,
    typer.Option(
        min=1, help="Control intervals, all environments together.", show_default="recipe's"
    ),
]
Envs = Annotated[
    int | None,
    typer.Option(min=1, max=4096, help="Environments at once.", show_default="recipe's"),
]
Plans = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=1000,
        help="Episodes that are planned with waves known, and imitated before the learning.",
        show_default="recipe's",
    ),
]
TaskShip = Annotated[
    str | None,
    typer.Option(
        help="Ship: a preset or a .toml file.", show_default="the one the task is made for"
    ),
]
OnDevice = Annotated[Device, typer.Option(help="`auto` takes a GPU where there is one.")]


def sizes(timesteps: int | None, envs: int | None, plans: int | None) -> dict[str, int]:
    """Return those of a recipe's sizes that are given."""
    given = {"n_timesteps": timesteps, "n_envs": envs, "plans": plans}
    return {key: value for key, value in given.items() if value is not None}


def check_device(device: Device) -> None:
    """Refuse a GPU where there is none.

    Raises:
        ValueError: torch sees none.
    """
    import torch

    if device is Device.CUDA and not torch.cuda.is_available():
        raise ValueError("--device cuda: torch sees no GPU here; give cpu or auto")
