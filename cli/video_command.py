"""``shaftline video``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..agents.evaluation.film import Span, sailed, sea_of, write
from ..core.files import check_writable
from ..envs import DEFAULTS, get_task, tasks
from ..envs.settings import EPISODE_S
from ..observers import get_observer
from .console import clear_errors, say, stages

_MOST = 4


def video(
    controllers: Annotated[
        list[str],
        typer.Argument(
            help="Controllers as of `shaftline evaluate`, one a column: NAME, NAME:option=number, "
            "policy:FILE.npz, module:Class."
        ),
    ],
    task: Annotated[
        str, typer.Option(help=f"Task, or TASK:held-out: {', '.join(tasks(None))}.")
    ] = "rough-sea",
    seed: Annotated[int, typer.Option(min=0, help="Of the episode: all meet the same.")] = 1,
    begin_s: Annotated[float, typer.Option(min=0.0, help="Where the film begins [s].")] = 60.0,
    seconds: Annotated[
        float, typer.Option(min=1.0, max=600.0, help="Of the ship's time that it shows.")
    ] = 40.0,
    observer: Annotated[
        str, typer.Option(help="Observer whose estimate they see.")
    ] = DEFAULTS.observer,
    out: Annotated[Path, typer.Option(help="File, .gif.")] = Path("out/film.gif"),
) -> None:
    """Film controllers in the same waves, side by side.

    The ship in the waves that pass her, and the last seconds of torque at the gauge, torque of the
    engine and pitch, at two and a half times the sea's pace. She surges only, so she is drawn level.

    Examples:
        shaftline video combinator va-pitch --task rough-sea --out out/film.gif

        shaftline video combinator-trimmed policy:rough-sea --task rough-sea:held-out --seed 900002
    """
    with clear_errors():
        if out.suffix != ".gif":
            raise ValueError(f"--out {out}: a film's file ends in .gif")
        check_writable(out)
        if len(controllers) > _MOST:
            raise ValueError(f"{len(controllers)} controllers: at most {_MOST} fit side by side")
        if begin_s + seconds > EPISODE_S:
            raise ValueError(
                f"--begin-s {begin_s:g} and --seconds {seconds:g}: an episode ends after "
                f"{EPISODE_S:g} s"
            )
        get_task(task)
        get_observer(observer)
        with stages("filming") as tick:
            runs = []
            for i, text in enumerate(controllers):
                tick(f"sailing {text}", i, len(controllers))
                runs.append(sailed(text, task, seed, observer))
            span = Span(begin_s, seconds)
            sea = sea_of(task, seed, observer)
            write(out, runs, sea, span, lambda done, total: tick("drawing", done, total))
        for run in runs:
            gauge, engine = run.swings
            say(
                f"{run.words}: fluctuation in waves {gauge:.1f} kN m at the gauge, {engine:.2f} kN m "
                "of the engine"
            )
        say(f"film: {out}")
