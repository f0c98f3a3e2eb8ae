"""Compare the trade-off of fuel and load of tuned and learned controllers; write ``frontier.md``.

Tasks differ from ``calm-machinery`` by the weights of fuel and load only. Every training and tuning is
kept in the folder ``--kept``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.agents.evaluation.episodes import Setting, run_episodes
from shaftline.agents.learning.tuning import tune
from shaftline.baselines import make_controller
from shaftline.baselines.controller import Predictor
from shaftline.core.sweep import sweep
from shaftline.display.figures import PALETTE, new_figure
from shaftline.envs import DEFAULTS, get_task
from shaftline.envs.steering import environment_classes
from shaftline.envs.tasks import Task

from .learners.references import EPISODES, FIRST_SEED
from .learners.trainings import Trained
from .pages import make_parser, print_dot
from .writing import write_results

TITLE = "Fuel against machinery load"

BASE = "calm-machinery"
LOADS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the load in the weights of a task; the rest is the share of the fuel."""

UNTUNED = ("combinator", "combinator-trimmed", "cpp-optimiser", "speed-pilot", "va-pitch")
TUNED, LEARNED = "va-pitch, tuned", "PPO"
ROUNDS = 25
"""Generations of a tuning."""

INTERVALS = 300_000
"""Control intervals of a training with default hyperparameters."""

FUEL, TORQUE, ENGINE = "fuel_kg_nmi", "wave_torque_kN_m", "wave_engine_torque_kN_m"
KPIS = (FUEL, TORQUE, ENGINE, "speed_error_rms_m_s", "failed")


class Cell(NamedTuple):
    """One controller of the comparison."""

    kind: str  # a name of UNTUNED, TUNED or LEARNED
    load: float | None = None  # share of the load in the weights, None for an untuned controller
    seed: int = 1

    @property
    def name(self) -> str:
        """File name of the result."""
        kind = self.kind.replace(", ", "-")
        return kind if self.load is None else f"{kind}_{self.load:g}_{self.seed}"


def task_of(load: float) -> Task:
    """Return the task with a share of the load, half of it of the shaft and half of the engine."""
    goals = get_task(BASE).model_dump(exclude_none=True)["goals"]
    shares = {
        "torque_fluctuation": load / 2,
        "engine_fluctuation": load / 2,
        "fuel_excess": 1 - load,
    }
    for term, share in shares.items():
        if share > 0.0:
            goals[term]["weight"] = share
        else:
            del goals[term]
    return get_task(get_task(BASE).model_dump(exclude_none=True) | {"goals": goals})


def measure(cell: Cell) -> dict[str, Any]:
    """Return the mean of each KPI of a controller in episodes that no tuning or training draws."""
    task = get_task(BASE) if cell.load is None else task_of(cell.load)
    text, controller = _controller(cell, task)
    setting = Setting("one", BASE, "task", DEFAULTS.observer, EPISODES, first_seed=FIRST_SEED)
    kpis, _ = run_episodes(setting, controller, threads=1)
    return {"controller": text} | {name: float(kpis[name].mean()) for name in KPIS}


def _controller(cell: Cell, task: Task) -> tuple[str, Predictor]:
    """Return a controller and its text, tuned or trained where the cell asks for it."""
    ship, interval = task.load_ship(), DEFAULTS.control_interval_s
    if cell.kind == LEARNED:
        import torch
        from stable_baselines3 import PPO

        torch.set_num_threads(1)
        env = gymnasium.make(environment_classes(task.steered).id, task=task)
        model = PPO("MlpPolicy", env, seed=cell.seed, device="cpu").learn(INTERVALS)
        return LEARNED, Trained(model, {})
    text = cell.kind
    if cell.kind == TUNED:
        text = tune("va-pitch", task, rounds=ROUNDS, seed=cell.seed, threads=1).controller
    return text, make_controller(text, ship, interval)


def load_at_equal_fuel(point: pd.Series, front: pd.DataFrame) -> float:
    """Return the torque fluctuation of a point over that of the tuned controllers at its fuel [-].

    Between two tuned controllers the front is interpolated linearly. A point that needs less fuel than
    all of them has no value (nan).
    """
    ordered = front.sort_values(FUEL)
    if point[FUEL] < ordered[FUEL].iloc[0]:
        return float("nan")
    least = np.minimum.accumulate(ordered[TORQUE].to_numpy())
    return float(point[TORQUE] / np.interp(point[FUEL], ordered[FUEL], least))


def table_of(found: dict[Cell, dict[str, Any]]) -> pd.DataFrame:
    """Return a row for each controller with its KPIs and its load at equal fuel."""
    rows = [
        {"kind": cell.kind, "load": cell.load, "seed": cell.seed} | result
        for cell, result in found.items()
    ]
    table = pd.DataFrame(rows)
    front = table[table["kind"] == TUNED]
    table["load_at_equal_fuel"] = [load_at_equal_fuel(row, front) for _, row in table.iterrows()]
    return table


def draw_front(table: pd.DataFrame) -> Figure:
    """Draw fuel and torque fluctuation of every controller."""
    figure, axes = new_figure(1, 1, (6.4, 4.2))
    axis = axes.flat[0]
    for color, kind in zip(PALETTE, (TUNED, LEARNED), strict=False):
        some = table[table["kind"] == kind].sort_values("load")
        style = "o-" if kind == TUNED else "s"
        axis.plot(some[FUEL], some[TORQUE], style, color=color, label=kind)
        for _, row in some.iterrows():
            axis.annotate(f" {row['load']:g}", (row[FUEL], row[TORQUE]), fontsize=7)
    some = table[table["kind"].isin(UNTUNED)]
    axis.plot(some[FUEL], some[TORQUE], "x", color="black", label="untuned")
    for _, row in some.iterrows():
        axis.annotate(f" {row['kind']}", (row[FUEL], row[TORQUE]), fontsize=7)
    axis.set_xlabel("fuel [kg/nmi]")
    axis.set_ylabel("fluctuation of the shaft torque in waves [kN m]")
    axis.legend(fontsize=8, frameon=False)
    return figure


def cells(seeds: int) -> list[Cell]:
    """Return all controllers of the comparison."""
    return [
        *(Cell(name) for name in UNTUNED),
        *(Cell(TUNED, load) for load in LOADS),
        *(Cell(LEARNED, load, seed) for seed in range(1, seeds + 1) for load in LOADS[::2]),
    ]


def main(arguments: list[str] | None = None) -> None:
    """Tune, train and evaluate what is missing, and write the page."""
    parser = make_parser("frontier", __doc__, "out/frontier", kept="out/frontier/cells", jobs=None)
    parser.add_argument("--seeds", type=int, default=1, help="trainings of each task")
    options = parser.parse_args(arguments)
    wanted = cells(options.seeds)
    kept: Path = options.kept
    results = sweep(measure, {c.name: c for c in wanted}, kept, jobs=options.jobs, tick=print_dot)
    table = table_of({cell: results[cell.name] for cell in wanted})
    shown = table.drop(columns="controller")
    learned = table[table["kind"] == LEARNED]
    write_results(
        __file__,
        options.out,
        TITLE,
        table,
        {"": draw_front(table)},
        f"--seeds {options.seeds}",
        table=shown,
        rounds=ROUNDS,
        intervals=INTERVALS,
        base=BASE,
        episodes=EPISODES,
        seeds=options.seeds,
        below=int((learned["load_at_equal_fuel"] < 1.0).sum()),
        learned=len(learned),
    )


if __name__ == "__main__":
    main()
