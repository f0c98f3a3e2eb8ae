"""``shaftline tune``."""

from __future__ import annotations

from typing import Annotated

import typer

from ..envs import get_task
from ..observers import get_observer
from ..plant import get_sea
from .console import (
    MOST_SEEDS,
    report_errors,
    require_extra,
    say,
    say_scaled_orders,
    stages,
)
from .machine import add_results
from .task_options import EPISODE_S, OBSERVER, EpisodeLength, ObserverName, TaskName, TaskShip


def tune(
    controller: Annotated[
        str,
        typer.Option(
            help="Controller: NAME (see `shaftline list --controllers`), or NAME:option=number,... with "
            "fixed options; HELMSMAN+NAME where the rudder is an action."
        ),
    ] = "speed-pilot",
    task: TaskName = "rough-sea",
    vary: Annotated[
        list[str] | None,
        typer.Option(help="OPTION=LOW:HIGH; repeatable.", show_default="ranges of the controller"),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Generations of the search.")] = 40,
    seeds: Annotated[
        int, typer.Option(min=1, max=MOST_SEEDS, help="Number of episodes for each candidate.")
    ] = 24,
    episode_s: EpisodeLength = EPISODE_S,
    seed: Annotated[int, typer.Option(min=0, help="Seed; equal seeds give equal constants.")] = 0,
    observer: ObserverName = OBSERVER,
    ship: TaskShip = None,
    sea: Annotated[
        str,
        typer.Option(
            help="Sea: a preset; hs=3.2,tp=9.1 with optional gamma=, heading= and wind=; or `task` for "
            "the seas of the task."
        ),
    ] = "task",
) -> None:
    """Tune the constants of a classic controller for a task.

    CMA-ES draws constants within their ranges. All candidates are simulated in the same episodes of the
    task's seas or of `--sea`, and the mean reward decides. A best candidate is refused if its commands
    oscillate in calm water. The result and the given controller are then evaluated in as many unused
    episodes. A learned policy should be better than the result.

    Written: nothing; the result is printed as `NAME:option=number,...`, and as JSON with `--json`.

    Examples:
        shaftline tune --controller speed-pilot --task acceleration

        shaftline tune --controller combinator-trimmed --vary response_s=1:20 --task transit
    """
    with report_errors():
        model = get_task(task)
        vessel = model.load_ship(ship)
        get_observer(observer)
        if sea != "task":
            get_sea(sea)
        ranges = dict(map(_range, vary)) if vary else None
        with require_extra("tune", "tuning"):
            from ..agents.learning.tuning import tune as search
        say_scaled_orders(task, model, vessel)
        with stages("tuning") as tick:
            found = search(
                controller,
                task,
                ranges=ranges,
                rounds=rounds,
                episodes=seeds,
                episode_s=episode_s,
                seed=seed,
                observer=observer,
                ship=ship,
                sea=sea,
                tick=lambda done, total, said: tick(said, done, total),
            )
        add_results(found._asdict())
        say(f"{found.candidates} candidates on {seeds} episodes of {task}")
        say(f"reward on {seeds} unused episodes: {found.fresh:.5g}, untuned {found.untuned:.5g}")
        if found.fresh == found.untuned == 0.0:
            say(
                "the reward is 0 where the engine stalls or trips, here in every episode, so that there "
                "is nothing to compare. See what fails, and tune in a lower sea (--sea):"
            )
            _say_evaluation([controller], task, sea, ship)
            return
        if found.fresh <= found.untuned:
            say(f"the tuned constants {found.controller} are not better: keep the given ones")
            return
        say("evaluate the result " + ("on the held-out seas:" if sea == "task" else "in this sea:"))
        held_out = f"{task}:held-out" if sea == "task" else task
        _say_evaluation([found.controller, controller], held_out, sea, ship)


def _say_evaluation(controllers: list[str], task: str, sea: str, ship: str | None) -> None:
    """Print the command that evaluates controllers."""
    named = " ".join(f"--controller {name}" for name in controllers)
    options = ("" if sea == "task" else f" --sea {sea}") + (f" --ship {ship}" if ship else "")
    say(f"  shaftline evaluate {named} --task {task}{options}")


def _range(text: str) -> tuple[str, tuple[float, float]]:
    key, _, ends = text.partition("=")
    low, _, high = ends.partition(":")
    try:
        return key, (float(low), float(high))
    except ValueError:
        raise ValueError(
            f"--vary {text!r}: must be OPTION=LOW:HIGH, such as response_s=1:20"
        ) from None
