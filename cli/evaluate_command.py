"""``shaftline evaluate``."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from .. import display
from ..agents.evaluation.episodes import Setting, known_controllers, label, load_controller
from ..agents.evaluation.kpis import KPIS
from ..agents.evaluation.page import merge_equal_rows, zero_columns
from ..agents.evaluation.scores import bounds
from ..agents.evaluation.sweeps import evaluate as evaluate_all
from ..baselines.controller import Predictor
from ..core.sweep import check_backend
from ..envs import DEFAULTS, get_task
from ..envs.settings import EPISODE_S
from ..envs.steering import environment_classes
from ..observers import get_observer, observer_names
from ..plant import get_sea
from . import console
from .console import check_folder, print_table, progress, report_errors, say
from .machine import add_results
from .train_command import EpisodeLength, TaskName, TaskShip

_INTERVAL = DEFAULTS.control_interval_s
_SHOWN = (
    "reward", "fuel_kg_nmi", "speed_error_rms_m_s", "torque_sd_kN_m", "rack_travel_mm_min",
    "overload_s", "overspeed_s", "cavitation_s", "ventilation_s", "heading_error_rms_deg",
    "track_error_rms_m", "rudder_travel_deg_min", "failed",
)  # fmt: skip


def evaluate(
    controller: Annotated[list[str], typer.Option(
        help=f"NAME, NAME:option=number or policy:FILE; repeatable. {known_controllers()}.")],
    task: TaskName = "transit",
    sea: Annotated[list[str] | None, typer.Option(
        help="Sea: a preset; hs=3.2,tp=9.1 with optional gamma= and heading=; or `task` for the "
        "seas of the task; repeatable.", show_default="task")] = None,
    hs: console.OwnHeight = None,
    tp: console.OwnPeriod = None,
    observer: Annotated[list[str], typer.Option(
        help="Observer, or `all`; repeatable.")] = [DEFAULTS.observer],  # noqa: B006
    ship: TaskShip = None,
    seeds: Annotated[int, typer.Option(
        min=1, max=console.MOST_SEEDS,
        help="Number of episodes; all controllers get the same seas.")] = 20,
    episode_s: EpisodeLength = EPISODE_S,
    out: Annotated[Path, typer.Option(
        help="Folder for tables and figures.")] = Path("out/evaluate"),
    render: Annotated[bool, typer.Option(help="Also save a dashboard of each controller.")] = False,
    jobs: console.Jobs = None,
    backend: Annotated[console.Backend, typer.Option(
        help="Where cells are simulated: this machine or a dask cluster.")] = console.Backend.PROCESSES,
    scheduler: console.Scheduler = None,
) -> None:  # fmt: skip
    """Evaluate controllers in the same seas and compare them.

    Each combination of controller, sea and observer is a cell. Cells that the output folder already
    contains are not simulated again, so an interrupted evaluation resumes. Each figure is the
    interquartile mean over the episodes; the files also give its 95 % interval (from 4 episodes).

    Cells are distributed over the cores of this machine. To use several machines, install
    `shaftline[cluster]` on all of them, run `dask scheduler` on one and `dask worker ADDRESS` on each,
    and give `--backend dask --scheduler ADDRESS`. The results agree to the last digit.

    A policy from `shaftline train` is given as `policy:FILE`. It must have been trained for this ship,
    these observations and this control interval; otherwise the message says what differs.

    Written: `table.csv`, `table.json` and `table.md` with all figures, `comparison.png` with one episode
    of each controller, and `cells/` with every episode. `--render` adds a dashboard of each controller.

    Examples:
        shaftline evaluate --controller combinator --controller cpp-optimiser --task transit

        shaftline evaluate --task rough-sea --controller combinator-trimmed --controller policy:rough-sea
    """
    with report_errors():
        check_folder(out)
        check_backend(jobs, backend, scheduler)
        model = get_task(task)
        vessel = model.load_ship(ship)
        if "all" in observer:
            observer = observer_names()
        for name in observer:
            get_observer(name)
        seas = [*(sea or ()), *console.read_own_sea(hs, tp)] or ["task"]
        for name in seas:
            if name != "task":
                get_sea(name)
        loaded = [load_controller(text, vessel, _INTERVAL, model) for text in controller]
        made = dict(zip(map(label, controller), loaded, strict=True))  # a label needs a valid file
        grid = itertools.product(*map(dict.fromkeys, (made, seas, observer)))
        cells = [Setting(c, task, s, o, seeds, ship, episode_s) for c, s, o in grid]

        def make(setting: Setting) -> Predictor:
            return made[setting.controller]

        with progress("evaluating", len(cells)) as tick:
            found = evaluate_all(
                cells, make, out, jobs=jobs, backend=backend, scheduler=scheduler, tick=tick
            )
        title = f"{vessel.name}, {task}, {seeds} episodes of {episode_s:g} s"
        if (bound := bounds().get(task)) is not None and seas == ["task"] and ship is None:
            intervals = max(round(episode_s / _INTERVAL), 1)
            found.table["score"] = [bound.score(r / intervals) for r in found.table["reward"]]
        shown = merge_equal_rows(found.table)
        varied = [c for c in ("controller", "sea", "observer") if shown[c].nunique() > 1]
        zero = zero_columns(found.table, _SHOWN)
        figures = [name for name in _SHOWN if name not in zero]
        scored = ["score"] if "score" in shown else []
        print_table(shown[[*(varied or ["controller"]), *scored, *figures]], title)
        if zero:
            say(f"zero everywhere: {', '.join(zero)}\n")
        if scored:
            say("score: 0 is the combinator, 1 the clairvoyant bound of the task")
        say("\n".join(f"{name}: {KPIS[name]}" for name in figures))
        add_results({"cells": found.table.to_dict(orient="records")})
        found.save(out, title, _SHOWN)
        lasts = {cell.controller: (cell, i) for i, cell in enumerate(cells)}
        traces = {name: found.traces[i] for name, (_, i) in lasts.items()}
        picture = out / "comparison.png"
        display.figures.save(display.figures.controllers_figure(traces, vessel), picture)
        for cell, _ in lasts.values() if render else ():
            name = "".join(c if c.isalnum() or c == "-" else "-" for c in cell.controller)
            frame = _last_frame(cell, make(cell))
            display.figures.save_frame(frame, out / f"dashboard-{name}.png")
        say(f"table, cells and {picture.name}: {out}")


def _last_frame(setting: Setting, controller: Predictor) -> NDArray[np.uint8]:
    env = environment_classes(get_task(setting.task).steered).single(
        **setting.environment(controller), render_mode="rgb_array"
    )
    observation, _ = env.reset(seed=0)
    state, start, done = None, True, False
    while not done:
        action, state = controller.predict(observation, state, np.array([start]))
        observation, _, terminated, truncated, _ = env.step(action)
        start, done = False, terminated or truncated
    return np.asarray(env.render())
