"""``shaftline dataset``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from ..envs import get_task, tasks
from .console import clear_errors, needs, say, stages
from .machine import numbers

_QUALITIES = "expert, medium, random"


def dataset(
    task: Annotated[str, typer.Option(help=f"One of {', '.join(tasks(None))}.")] = "rough-sea",
    quality: Annotated[
        list[str],
        typer.Option(help=f"One of {_QUALITIES}; repeatable."),
    ] = ["expert", "medium", "random"],  # noqa: B006
    episodes: Annotated[int, typer.Option(min=1, max=100_000, help="Episodes of each.")] = 100,
    policy: Annotated[
        Path | None,
        typer.Option(help="Policy file that acts.", show_default="the packaged one of the task"),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Equal seeds record the same episodes.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder of the data sets.")] = Path("out/datasets"),
) -> None:
    """Record episodes for offline learning, as data sets of Minari.

    expert: what a trained policy does; medium: the same with half of its actions random; random: random
    actions alone. A data set carries the keywords of its environment, which `recover_environment` makes
    again. Needs pip install 'shaftline[datasets]'.

    Examples:
        shaftline dataset --task rough-sea --episodes 100

        shaftline dataset --task storm --quality expert --policy out/train/policy.npz --out out/mine
    """
    with clear_errors():
        get_task(task)
        with needs("datasets", "recording data sets"):
            import minari  # noqa: F401
        from ..agents.learning.datasets import record
        from ..agents.policy.policy import load_policy

        acting = None if policy is None else load_policy(policy)
        made = []
        with stages("recording") as tick:
            for name in dict.fromkeys(quality):
                told = partial(tick, name)
                made.append(record(task, name, episodes, out, policy=acting, seed=seed, tick=told))
        numbers({"datasets": made})
        say("\n".join(made))
        say("to load one, with shaftline.envs imported:")
        say(f"  MINARI_DATASETS_PATH={out.resolve()}")
        say(f"  minari.load_dataset({made[0]!r})")
