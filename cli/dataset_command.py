"""``shaftline dataset``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from ..envs import get_task
from .console import report_errors, require_extra, say, stages
from .machine import add_results
from .task_options import TaskName

_QUALITIES = ["expert", "medium", "random"]


def dataset(
    task: TaskName = "rough-sea",
    quality: Annotated[
        list[str], typer.Option(help=f"Quality of the data: {', '.join(_QUALITIES)}; repeatable.")
    ] = _QUALITIES,
    episodes: Annotated[
        int, typer.Option(min=1, max=100_000, help="Number of episodes of each data set.")
    ] = 100,
    policy: Annotated[
        Path | None,
        typer.Option(
            help="Policy file whose actions are recorded.", show_default="that of the package"
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the episodes; equal seeds record the same episodes.")
    ] = 0,
    out: Annotated[Path, typer.Option(help="Folder of the data sets.")] = Path("out/datasets"),
) -> None:
    """Record episodes of a task for offline learning, as data sets of Minari.

    The quality `expert` records the actions of a trained policy, `medium` the same with half of the
    actions random, and `random` random actions only. Needs pip install 'shaftline[datasets]'.

    Written: one data set for each quality in the output folder. A data set contains the keywords of its
    environment, which `recover_environment` of Minari creates again.

    Examples:
        shaftline dataset --task rough-sea --episodes 100

        shaftline dataset --task storm --quality expert --policy out/train/policy.npz --out out/mine
    """
    with report_errors():
        get_task(task)
        with require_extra("datasets", "recording data sets"):
            import minari  # noqa: F401
        from ..agents.learning.datasets import record
        from ..agents.policy.policy import load_policy

        acting = None if policy is None else load_policy(policy)
        made = []
        with stages("recording") as tick:
            for name in dict.fromkeys(quality):
                update = partial(tick, name)
                made.append(
                    record(task, name, episodes, out, policy=acting, seed=seed, tick=update)
                )
        add_results({"datasets": made})
        say("\n".join(made))
        say("to load a data set in Python, after importing shaftline.envs:")
        say(f"  MINARI_DATASETS_PATH={out.resolve()}")
        say(f"  minari.load_dataset({made[0]!r})")
