"""``shaftline tune``."""

from __future__ import annotations

from typing import Annotated

import typer

from ..baselines import controller_names
from ..envs import DEFAULTS, get_task, tasks
from ..envs.settings import EPISODE_S, LONGEST_S
from ..observers import get_observer
from .console import MOST_SEEDS, clear_errors, needs, say, stages
from .machine import numbers


def tune(
    controller: Annotated[
        str,
        typer.Option(
            help=f"One of {', '.join(controller_names())}, or NAME:option=number,... whose options "
            "stay; HELMSMAN+NAME where the rudder is an action."
        ),
    ] = "speed-pilot",
    task: Annotated[str, typer.Option(help=f"One of {', '.join(tasks(None))}.")] = "rough-sea",
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="OPTION=LOW:HIGH; repeatable.", show_default="what the controller declares"
        ),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Generations of the search.")] = 40,
    seeds: Annotated[
        int, typer.Option(min=1, max=MOST_SEEDS, help="Episodes that each candidate sails.")
    ] = 24,
    episode_s: Annotated[
        float, typer.Option(min=1.0, max=LONGEST_S, help="Length of an episode [s].")
    ] = EPISODE_S,
    seed: Annotated[int, typer.Option(min=0, help="Equal seeds find equal constants.")] = 0,
    observer: Annotated[
        str, typer.Option(help="Observer whose estimate it sees.")
    ] = DEFAULTS.observer,
    ship: Annotated[
        str | None,
        typer.Option(
            help="Ship: a preset or a .toml file.", show_default="the one the task is made for"
        ),
    ] = None,
) -> None:
    """Search the constants of a classic controller for a task.

    CMA-ES draws constants within their ranges; all candidates sail the same episodes of the task's own
    seas, and the mean reward decides. What is found is judged on as many fresh episodes beside the
    controller as it was given. A learned policy should beat what this finds.

    Examples:
        shaftline tune --controller speed-pilot --task acceleration

        shaftline tune --controller combinator-trimmed --vary response_s=1:20 --task transit
    """
    with clear_errors():
        get_task(task).sailed(ship)
        get_observer(observer)
        ranges = dict(map(_range, vary)) if vary else None
        with needs("train", "tuning"):
            from ..agents.learning.tuning import tune as search
        with stages("tuning") as tick:
            found = search(
                controller, task, ranges=ranges, rounds=rounds, episodes=seeds,
                episode_s=episode_s, seed=seed, observer=observer, ship=ship,
                tick=lambda done, total, said: tick(said, done, total),
            )  # fmt: skip
        numbers(found._asdict())
        say(f"{found.sailed} candidates on {seeds} episodes of {task}")
        say(f"reward on {seeds} fresh episodes: {found.fresh:.5g}, untuned {found.untuned:.5g}")
        if found.fresh <= found.untuned:
            say("nothing was gained: keep the constants that you have")
        say("sail it on seas that it has not seen:")
        say(
            f"  shaftline evaluate --controller {found.controller} --controller {controller} "
            f"--task {task}:held-out" + (f" --ship {ship}" if ship else "")
        )


def _range(text: str) -> tuple[str, tuple[float, float]]:
    key, _, ends = text.partition("=")
    low, _, high = ends.partition(":")
    try:
        return key, (float(low), float(high))
    except ValueError:
        raise ValueError(f"--vary {text!r}: must be OPTION=LOW:HIGH, two numbers") from None
