"""``shaftline video``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..agents.evaluation.film import Span, draw_sea, simulate_episode, write_animation
from ..core.files import check_writable
from ..envs import get_task
from ..envs.settings import EPISODE_S
from ..observers import get_observer
from .console import report_errors, say, stages
from .task_options import OBSERVER, ObserverName, task_names

_MOST = 4


def video(
    controllers: Annotated[
        list[str],
        typer.Argument(
            help="Controllers as for `shaftline evaluate`, one for each column: NAME, "
            "NAME:option=number, policy:FILE.npz, module:Class."
        ),
    ],
    task: Annotated[
        str, typer.Option(help=f"Task, or TASK:held-out: {', '.join(task_names())}.")
    ] = "rough-sea",
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the episode, which is the same for all controllers.")
    ] = 1,
    begin_s: Annotated[float, typer.Option(min=0.0, help="Start of the animation [s].")] = 60.0,
    seconds: Annotated[
        float,
        typer.Option(min=1.0, max=600.0, help="Length of the animation in simulated time [s]."),
    ] = 40.0,
    observer: ObserverName = OBSERVER,
    out: Annotated[Path, typer.Option(help="File to write (.gif).")] = Path("out/film.gif"),
) -> None:
    """Animate controllers in the same waves, side by side.

    The animation shows the ship in the passing waves, and below it the last seconds of shaft torque,
    engine torque and pitch, 2.5 times faster than real time. The simulation includes surge only, so the
    ship is drawn level.

    Written: an animated GIF.

    Examples:
        shaftline video combinator va-pitch --task rough-sea --out out/film.gif

        shaftline video combinator-trimmed policy:rough-sea --task rough-sea:held-out --seed 900002
    """
    with report_errors():
        if out.suffix != ".gif":
            raise ValueError(f"--out {out}: the name of an animation must end in .gif")
        check_writable(out)
        if len(controllers) > _MOST:
            raise ValueError(f"{len(controllers)} controllers: give at most {_MOST}")
        if begin_s + seconds > EPISODE_S:
            raise ValueError(
                f"--begin-s {begin_s:g} and --seconds {seconds:g}: their sum must be at most the length "
                f"of an episode, {EPISODE_S:g} s"
            )
        get_task(task)
        get_observer(observer)
        with stages("animating") as tick:
            runs = []
            for i, text in enumerate(controllers):
                tick(f"simulating {text}", i, len(controllers))
                runs.append(simulate_episode(text, task, seed, observer))
            span = Span(begin_s, seconds)
            sea = draw_sea(task, seed, observer)
            write_animation(out, runs, sea, span, lambda done, total: tick("drawing", done, total))
        for run in runs:
            shaft, engine = run.fluctuations
            say(
                f"{run.words}: fluctuation in waves {shaft:.1f} kN m of the shaft, {engine:.2f} kN m "
                "of the engine"
            )
        say(f"animation: {out}")
