"""``shaftline evaluate``."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from matplotlib.image import imsave

from ..agents.evaluation import KPIS, TRACE, Setting, run
from ..agents.evaluation import evaluate as evaluate_all
from ..baselines.catalogue import CONTROLLERS, make_controller
from ..baselines.interface import Controller
from ..envs import FrigateEnv, get_task, tasks
from ..observers import get_observer
from ..plant import Ship, get_sea, load_ship
from ..plant.files import write_atomically, write_json, write_text
from ..studies import figures
from ..studies.tables import markdown
from .console import clear_errors, console, print_table, progress

_INTERVAL = 0.5
_SHOWN = (
    "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m", "rack_travel_mm_min", "overload_s",
    "overspeed_s", "cavitation_s", "ventilation_s", "failed",
)  # fmt: skip


def evaluate(
    controller: Annotated[
        list[str],
        typer.Option(help=f"NAME or NAME:option=number; repeatable. {', '.join(CONTROLLERS)}."),
    ],
    task: Annotated[str, typer.Option(help=f"One of {', '.join(tasks())}.")] = "transit",
    sea: Annotated[
        list[str], typer.Option(help="Sea preset, or `task` for those of the task; repeatable.")
    ] = ["task"],  # noqa: B006 (typer copies it)
    observer: Annotated[list[str], typer.Option(help="Observer; repeatable.")] = [  # noqa: B006
        "random-walk-kalman"
    ],
    ship: Annotated[str, typer.Option(help="Ship: a preset or a .toml file.")] = "frigate",
    seeds: Annotated[int, typer.Option(min=1, help="Episodes; equal seeds meet equal seas.")] = 20,
    episode_s: Annotated[float, typer.Option(min=1.0, help="Length of an episode [s].")] = 300.0,
    out: Annotated[Path, typer.Option(help="Folder for table, CSV, JSON, figures.")] = Path(
        "out/evaluate"
    ),
    render: Annotated[bool, typer.Option(help="Also save a dashboard frame of each.")] = False,
) -> None:
    """Sail controllers through paired seas and compare them.

    Every combination of controller, sea and observer is a cell; cells that already stand in the output
    folder are not sailed again, so an interrupted evaluation goes on where it stopped. Each figure is
    the interquartile mean over the episodes, in the files with its 95 % bootstrap interval.

    Example:
        shaftline evaluate --controller combinator --controller cpp-optimiser --task transit
    """
    with clear_errors():
        vessel = load_ship(ship)
        get_task(task)
        for name in observer:
            get_observer(name)
        for name in sea:
            if name != "task":
                get_sea(name)
        sailed = _task_ship(vessel, task)
        made = {text: make_controller(text, sailed, _INTERVAL) for text in controller}
        cells = [
            Setting(c, task, s, o, seeds, ship, episode_s)
            for c, s, o in itertools.product(controller, sea, observer)
        ]

        def make(setting: Setting) -> Controller:
            return made[setting.controller]

        with progress("evaluating", len(cells)) as tick:
            table = evaluate_all(cells, make, out, tick)
        varied = [c for c in ("controller", "sea", "observer") if table[c].nunique() > 1]
        shown = table[[*(varied or ["controller"]), *_SHOWN]]
        print_table(shown, f"{vessel.name}, {task}, {seeds} episodes of {episode_s:g} s")
        console.print(
            "\n".join(f"{name}: {KPIS[name]}" for name in _SHOWN), highlight=False, markup=False
        )
        write_atomically(out / "table.csv", lambda f: table.to_csv(f, index=False))
        write_text(out / "table.md", _page(table, f"{vessel.name}, {task}, {seeds} episodes"))
        write_json(out / "table.json", table.to_dict(orient="records"))
        traces = {}
        for cell in cells[:: len(sea) * len(observer)]:
            _, trace = run(replace(cell, seeds=1), make(cell))
            traces[cell.controller] = pd.DataFrame(trace, columns=list(TRACE))
        picture = out / "comparison.png"
        figures.save(figures.controllers(traces, sailed), picture)
        if render:
            for cell in cells[:: len(sea) * len(observer)]:
                name = "".join(c if c.isalnum() or c == "-" else "-" for c in cell.controller)
                frame = _last_frame(cell, make(cell))
                write_atomically(
                    out / f"dashboard-{name}.png",
                    lambda f, frame=frame: imsave(f, frame),  # type: ignore[misc]
                )
        console.print(f"table, cells and {picture.name}: {out}", highlight=False, soft_wrap=True)


def _page(table: pd.DataFrame, title: str) -> str:
    """The table with its intervals as Markdown."""
    shown = table[["controller", "sea", "observer"]].copy()
    for name in _SHOWN:
        middle, low, high = (table[f"{name}{end}"] for end in ("", "_low", "_high"))
        rows = zip(middle, low, high, strict=True)
        shown[name] = [f"{m:.2f} ({a:.2f} to {b:.2f})" if a < b else f"{m:.2f}" for m, a, b in rows]
    meanings = "\n".join(f"- `{name}`: {KPIS[name]}" for name in _SHOWN)
    head = "Interquartile mean over the episodes, with its 95 % bootstrap interval."
    return f"# {title}\n\n{head}\n\n{markdown(shown)}\n\n{meanings}\n"


def _task_ship(ship: Ship, task: str) -> Ship:
    """The ship as the task has it: what a controller is built for."""
    return ship.with_values(dict(get_task(task).ship))


def _last_frame(setting: Setting, controller: Controller) -> np.ndarray:  # type: ignore[type-arg]
    env = FrigateEnv(
        ship=setting.ship,
        task=setting.task,
        sea=None if setting.sea == "task" else setting.sea,
        observer=setting.observer,
        episode_s=setting.episode_s,
        render_mode="rgb_array",
    )
    observation, _ = env.reset(seed=0)
    state, start, done = None, True, False
    while not done:
        action, state = controller.predict(observation, state, np.array([start]))
        observation, _, terminated, truncated, _ = env.step(action)
        start, done = False, terminated or truncated
    return np.asarray(env.render())
