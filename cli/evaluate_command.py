"""``shaftline evaluate``."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from numpy.typing import NDArray

from .. import display
from ..agents.evaluation.episodes import (
    Setting,
    drawn_seas,
    label,
    load_controller,
)
from ..agents.evaluation.kpis import KPIS
from ..agents.evaluation.page import merge_equal_rows, zero_columns
from ..agents.evaluation.scores import bounds
from ..agents.evaluation.stability import Verdict, check_stability
from ..agents.evaluation.sweeps import evaluate as evaluate_all
from ..baselines import combinator_curve
from ..baselines.controller import Predictor
from ..core.files import write_atomically
from ..core.sweep import check_backend, digest_of
from ..envs import Task, get_task
from ..envs.orders import OrderProfile, OrdersFile, read_orders
from ..envs.settings import EPISODE_S, LARGEST_EPISODE
from ..envs.steering import environment_classes
from ..envs.tasks import highest_speed
from ..observers import get_observer, observer_names
from ..plant import Ship, get_sea
from ..plant.order_tables import with_combinator_table
from . import console
from .console import (
    check_folder,
    print_table,
    progress,
    report_errors,
    say,
    say_scaled_orders,
)
from .machine import add_results
from .task_options import INTERVAL_S, LONGEST_S, OBSERVER, TaskName, TaskShip

_LONGEST_INTERVAL_S = 60.0
_SHORT = 0.1  # mean shortfall of the ship speed over the highest order that is reported [-]
_MOST_SEAS = 12  # seas, and seeds of one sea, that are listed one by one
_SEA_COLUMNS = {
    "hs_m": "Hs [m]",
    "tp_s": "Tp [s]",
    "gamma": "gamma [-]",
    "heading_deg": "heading [deg]",
    "wind_m_s": "wind [m/s]",
}
_SHOWN = (
    "reward",
    "fuel_kg_nmi",
    "nox_g_nmi",
    "speed_error_rms_m_s",
    "torque_sd_kN_m",
    "rack_travel_mm_min",
    "overload_s",
    "overspeed_s",
    "cavitation_s",
    "ventilation_s",
    "heading_error_rms_deg",
    "track_error_rms_m",
    "rudder_travel_deg_min",
    "failed",
)


def evaluate(
    controller: Annotated[list[str], typer.Option(
        help="NAME or NAME:option=number,... (see `shaftline list --controllers`), module:Class, "
        "fmu:FILE.fmu, policy:FILE.npz, or policy:TASK for the packaged policy of a task; repeatable.")],
    task: TaskName = "transit",
    sea: Annotated[list[str] | None, typer.Option(
        help="Sea: a preset; hs=3.2,tp=9.1 with optional gamma=, heading= and wind=; or `task` for the "
        "seas of the task; repeatable.", show_default="task")] = None,
    hs: console.OwnHeight = None,
    tp: console.OwnPeriod = None,
    observer: Annotated[list[str], typer.Option(
        help="Observer, or `all`; repeatable.")] = [OBSERVER],  # noqa: B006
    ship: TaskShip = None,
    seeds: Annotated[int, typer.Option(
        min=1, max=console.MOST_SEEDS,
        help="Number of episodes; all controllers get the same seas.")] = 20,
    episode_s: Annotated[float | None, typer.Option(
        min=1.0, max=LONGEST_S, help="Length of an episode [s].",
        show_default="300, or that of --orders")] = None,
    interval: Annotated[float, typer.Option(
        help="Control interval [s], a multiple of the ship's time step.")] = INTERVAL_S,
    orders: Annotated[Path | None, typer.Option(
        help="Table of ordered speeds, in place of those of the task: `time_s`, `time_min` or `time_h`, "
        "and `speed_order_m_s`, `speed_order_kn`, `speed_order_km_h`, `lever` or `lever_percent`.",
        show_default="those of the task")] = None,
    ramp: Annotated[bool, typer.Option(
        "--ramp",
        help="Interpolate between the rows of --orders; without it each order is held.")] = False,
    lever: Annotated[list[str] | None, typer.Option(
        help="Combinator table (.toml or .csv) that the classic controllers follow, or `ship` for that "
        "of the ship; repeatable.", show_default="ship")] = None,
    stability: Annotated[bool, typer.Option(
        help="Check each controller for oscillation in calm water.")] = True,
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

    `fmu:FILE.fmu` is a controller as an FMU for co-simulation (FMI 2.0). An FMU contains machine code,
    which runs with your rights: evaluate only FMUs that you trust.

    A policy from `shaftline train` is given as `policy:FILE`. It must have been trained for this ship,
    these observations and this control interval; otherwise the message says what differs.

    Each controller is also simulated in calm water with constant orders. If its commands do not come to
    rest, it is reported as unstable, with the margins of its linearised loop.

    Written: `table.csv`, `table.json` and `table.md` with all figures, `seas.csv` with the sea of each
    episode, `comparison.png` with one episode of each controller, and `cells/` with every episode.
    `--render` adds a dashboard of each controller.

    Examples:
        shaftline evaluate --controller combinator --controller cpp-optimiser --task transit

        shaftline evaluate --task rough-sea --controller combinator-trimmed --controller policy:rough-sea

        shaftline evaluate --controller combinator --sea calm --orders orders.csv --lever lever.toml
    """
    with report_errors(resumes=True):
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
        _check_interval(interval, vessel, episode_s)
        levers = {text: _with_lever(vessel, text) for text in lever or ["ship"]}
        profile: OrderProfile | None = None
        if orders is not None:
            profile, length = _read_orders(orders, levers, interval if ramp else 0.0)
            episode_s = episode_s or length
        elif ramp:
            raise ValueError("--ramp: has an effect on --orders only; give --orders FILE as well")
        episode_s = EPISODE_S if episode_s is None else episode_s
        made = {
            name: loaded
            for text in controller
            for name, loaded in _load(text, vessel, levers, interval, model).items()
        }
        grid = itertools.product(made, dict.fromkeys(seas), dict.fromkeys(observer))
        cells = [
            Setting(
                c, task, s, o, seeds, ship, episode_s, interval_s=interval, order_profile=profile
            )
            for c, s, o in grid
        ]

        def make(setting: Setting) -> Predictor:
            return made[setting.controller]

        spread: dict[str, Any] = {"jobs": jobs, "backend": backend, "scheduler": scheduler}
        with progress("evaluating", len(cells)) as tick:
            found = evaluate_all(cells, make, out, **spread, tick=tick)
        checked = {(c.controller, c.observer): c for c in cells} if stability else {}
        with progress("checking the stability", len(checked)) as tick:
            verdicts = check_stability(list(checked.values()), make, out, **spread, tick=tick)
        unstable = {key: v for key, v in zip(checked, verdicts, strict=True) if not v.stable}
        title = f"{vessel.name}, {task}, {seeds} episodes of {episode_s:g} s"
        if interval != INTERVAL_S:
            title += f", control interval {interval:g} s"
        if orders is not None:
            title += f", orders of {orders.name}"
        usual = seas == ["task"] and ship is None and interval == INTERVAL_S and profile is None
        if usual and (bound := bounds().get(task)) is not None:
            count = cells[0].intervals
            found.table["score"] = [bound.score(r / count) for r in found.table["reward"]]
        if stability:
            found.table["stability"] = [
                "unstable" if (c.controller, c.observer) in unstable else "stable" for c in cells
            ]
        shown = merge_equal_rows(found.table)
        varied = [c for c in ("controller", "sea", "observer") if shown[c].nunique() > 1]
        # A ship without a NOx map does not emit zero NOx: its column is left out.
        without = set() if vessel.emissions.nox_base_g_kWh > 0.0 else {"nox_g_nmi"}
        columns = [name for name in _SHOWN if name not in without]
        zero = zero_columns(found.table, columns)
        figures = [name for name in columns if name not in zero]
        scored = ["score"] if "score" in shown else []
        marks = ["stability"] if unstable else []
        print_table(shown[[*(varied or ["controller"]), *marks, *scored, *figures]], title)
        if profile is None:
            say_scaled_orders(task, model, vessel)
        speeds = profile and [speed for _, speed in profile]
        highest = max(speeds or model.scale_orders(vessel).speed_order_m_s)
        missed = missed_orders(shown, vessel, highest)
        for sentence in (*_failures(shown), *missed, *_sentences(unstable)):
            say(sentence)
        waves = _print_seas(cells)
        if zero:
            say(f"zero everywhere: {', '.join(zero)}\n")
        if scored:
            say("score: 0 is the combinator, 1 the clairvoyant bound of the task")
        say("\n".join(f"{name}: {KPIS[name]}" for name in figures))
        judged = [
            {"controller": name, "observer": o, "stable": v.stable, "about": v.sentence} | v.numbers
            for (name, o), v in zip(checked, verdicts, strict=True)
        ]
        add_results(
            {
                "cells": found.table.to_dict(orient="records"),
                "control_interval_s": interval,
                "seas": waves.to_dict(orient="records"),
                "stability": judged,
                "orders": profile,
            }
        )
        bad = ", ".join(dict.fromkeys(name for name, _ in unstable))
        found.save(out, f"{title}; unstable: {bad}" if bad else title, columns)
        write_atomically(out / "seas.csv", lambda file: waves.to_csv(file, index=False))
        lasts = {cell.controller: (cell, i) for i, cell in enumerate(cells)}
        traces = {name: found.traces[i] for name, (_, i) in lasts.items()}
        picture = out / "comparison.png"
        display.figures.save(display.figures.controllers_figure(traces, vessel), picture)
        for cell, _ in lasts.values() if render else ():
            name = "".join(c if c.isalnum() or c == "-" else "-" for c in cell.controller)
            frame = _last_frame(cell, make(cell))
            display.figures.save_frame(frame, out / f"dashboard-{name}.png")
        say(f"table, cells and {picture.name}: {out}")


def _check_interval(interval: float, ship: Ship, episode_s: float | None) -> None:
    """Refuse a control interval that is no multiple of the time step, or too many of them."""
    steps = round(interval / ship.time_step_s) if math.isfinite(interval) else 0
    if not (
        0.0 < interval <= _LONGEST_INTERVAL_S and abs(steps * ship.time_step_s - interval) < 1e-9
    ):
        raise ValueError(
            f"--interval {interval:g} s: must be a multiple of the time step of {ship.name}, "
            f"{ship.time_step_s:g} s, and at most {_LONGEST_INTERVAL_S:g} s"
        )
    if (episode_s or EPISODE_S) / interval > LARGEST_EPISODE:
        raise ValueError(
            f"--episode-s {episode_s:g} s has more than {LARGEST_EPISODE} intervals of {interval:g} s; "
            "give a shorter episode or a longer --interval"
        )


def _with_lever(ship: Ship, text: str) -> Ship:
    """Return a ship with the combinator table of ``--lever``."""
    if text == "ship":
        return ship
    if not Path(text).suffix:
        raise ValueError(
            f"--lever {text}: must be a combinator table (.toml or .csv), or `ship` for that of the ship"
        )
    lever = with_combinator_table(ship, text)
    combinator_curve(lever)  # refuses a curve along which the ship speed does not rise
    return lever


def _read_orders(path: Path, levers: Mapping[str, Ship], ramp_s: float) -> OrdersFile:
    """Return the orders of a file; lever positions need one combinator table."""
    found = [read_orders(path, ship, ramp_s) for ship in levers.values()]
    if any(one != found[0] for one in found):
        raise ValueError(
            f"--orders {path}: the lever positions have another speed on each --lever; give one "
            "--lever, or ordered speeds"
        )
    return found[0]


def _load(
    text: str, ship: Ship, levers: Mapping[str, Ship], interval_s: float, task: Task
) -> dict[str, Predictor]:
    """Return a controller by its label, once for each combinator table if it is a classic one."""
    if text.partition(":")[0] in (
        "policy",
        "fmu",
    ):  # These hold the curve with which they were made.
        levers = {"ship": ship}
    found = {}
    for lever, own in levers.items():
        made = load_controller(text, own, interval_s, task)
        mark = (
            ""
            if lever == "ship"
            else f" lever:{Path(lever).name} {digest_of(repr(own.combinator))}"
        )
        found[label(text) + mark] = made
    return found


def _failures(rows: pd.DataFrame) -> list[str]:
    """Return a sentence for each row with failed episodes: how many, and why."""
    return [
        f"FAILED: {row['controller']} ({row['sea']}): {row['failed']:.0%} of the episodes; the engine "
        f"tripped on overspeed in {row['tripped']:.0%} and stalled in "
        f"{row['failed'] - row['tripped']:.0%}. The other figures hold until then\n"
        for row in rows.to_dict("records")
        if row["failed"] > 0.0
    ]


def missed_orders(rows: pd.DataFrame, ship: Ship, highest: float) -> list[str]:
    """Return a sentence for each sea in which no controller holds orders up to the highest [m/s]."""
    short = rows.groupby("sea", sort=False)["speed_short_m_s"].min()
    top = highest_speed(ship)
    calm = "" if top is None else f"; {ship.name} reaches {top:.2f} m/s in calm water"
    return [
        f"TOO SLOW: in {'the seas of the task' if sea == 'task' else sea} every controller is on "
        f"average at least {least:.2f} m/s below the orders of up to {highest:.2f} m/s{calm}. Give "
        "lower orders (--orders FILE) or a lower sea (--sea)\n"
        for sea, least in short.items()
        if least > _SHORT * highest
    ]


def _sentences(unstable: Mapping[tuple[str, str], Verdict]) -> list[str]:
    """Return a sentence for each unstable controller, with its observers where they differ."""
    by_sentence: dict[tuple[str, str], list[str]] = {}
    for (name, observer), verdict in unstable.items():
        by_sentence.setdefault((name, verdict.sentence), []).append(observer)
    return [
        f"UNSTABLE: {name} (observer {', '.join(observers)}): {sentence}\n"
        for (name, sentence), observers in by_sentence.items()
    ]


def _print_seas(cells: Sequence[Setting]) -> pd.DataFrame:
    """Print the seas of the episodes, equal ones together, and return one row for each episode."""
    one_each = {cell.sea: cell for cell in reversed(cells)}
    tables = {str(sea): drawn_seas(one_each[sea]) for sea in reversed(one_each)}
    parameters = list(_SEA_COLUMNS)
    rows = []
    for sea, table in tables.items():
        groups = [group for _, group in table.groupby(parameters, sort=False, dropna=False)]
        for group in groups if len(groups) <= _MOST_SEAS else [table]:
            low, high = group[parameters].min(), group[parameters].max()
            ends = {
                heading: "–"
                if np.isnan(low[key])
                else f"{low[key]:.3g}"
                if low[key] == high[key]
                else f"{low[key]:.3g} to {high[key]:.3g}"
                for key, heading in _SEA_COLUMNS.items()
            }
            numbers = group["seed"].tolist()
            seeds = ", ".join(map(str, numbers[:_MOST_SEAS]))
            if len(numbers) > _MOST_SEAS:
                seeds = f"{len(numbers)} of {numbers[0]} to {numbers[-1]}"
            rows.append({"sea": sea, **ends, "seeds": seeds})
    print_table(pd.DataFrame(rows), "seas of the episodes (JONSWAP)")
    return pd.concat([t.assign(sea=sea) for sea, t in tables.items()], ignore_index=True)


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
