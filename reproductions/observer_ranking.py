"""Rank the observers by the torque fluctuation of a pitch controller that uses their estimate.

Run ``python -m reproductions observer_ranking --out docs/results``; a quarter of an hour on two cores.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, load_controller
from shaftline.agents.evaluation.statistics import mean_with_interval, relative_change
from shaftline.agents.evaluation.sweeps import episodes
from shaftline.baselines.controller import Predictor
from shaftline.envs.tasks import get_task
from shaftline.observers import observer_names

from .pages import make_parser, print_dot
from .writing import Panel, draw, write_results

LAW = "va-pitch:speed_gain=1"
FIRST_SEED = 900_000
KPI = "wave_torque_kN_m"
NONE = "none"
WRONG = {"propeller.relative_rotative_efficiency": 0.05}
"""Largest relative error of KQ in the simulated ship, drawn in each episode."""


class Condition(NamedTuple):
    """Sea, noise and parameter errors of a comparison."""

    words: str
    task: str
    noise: float
    wrong: dict[str, float] | None


CONDITIONS = (
    Condition("clean", "rough-sea:held-out", 0.0, None),
    Condition("noisy", "rough-sea:held-out", 1.0, None),
    Condition("clean, KQ wrong", "rough-sea:held-out", 0.0, WRONG),
    Condition("noisy, KQ wrong", "rough-sea:held-out", 1.0, WRONG),
    Condition("noisy, storm with air drawn", "storm:held-out", 1.0, None),
)


def _load(setting: Setting) -> Predictor:
    return load_controller(setting.controller, get_task(setting.task).load_ship(), 0.5)


def run_conditions(folder: Path, seeds: int, jobs: int | None) -> dict[tuple[str, str], Any]:
    """Return the KPI of each episode by condition and observer, each of shape (seeds,)."""
    settings = {
        (condition.words, observer): Setting(
            LAW,
            condition.task,
            "task",
            observer,
            seeds,
            sensor_noise=condition.noise,
            first_seed=FIRST_SEED,
            randomise=condition.wrong,
        )
        for condition in CONDITIONS
        for observer in observer_names()
    }
    found = episodes(list(settings.values()), _load, folder, jobs=jobs, tick=print_dot)
    return {
        key: one.kpis[KPI].to_numpy(np.float64) for key, one in zip(settings, found, strict=True)
    }


def table_of(values: dict[tuple[str, str], NDArray[np.float64]]) -> pd.DataFrame:
    """Return mean and change against ``none`` with intervals, a row for each condition and observer."""
    rows = []
    for (condition, observer), own in values.items():
        middle, low, high = mean_with_interval(own)
        change = relative_change(own, values[condition, NONE])
        rows.append(
            {
                "condition": condition,
                "observer": observer,
                KPI: middle,
                "low": low,
                "high": high,
                "change_percent": change[0],
                "change_low": change[1],
                "change_high": change[2],
            }
        )
    return pd.DataFrame(rows)


def page_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return observers as rows and conditions as columns, sorted by the hardest condition."""
    order = table[table["condition"] == CONDITIONS[3].words].sort_values(KPI)["observer"]
    columns = table[[KPI, "change_percent", "change_low", "change_high"]].to_numpy()
    text = [f"{own:.2f} ({c:+.0f}; {low:+.0f} to {high:+.0f})" for own, c, low, high in columns]
    shown = table.assign(text=text).pivot(index="observer", columns="condition", values="text")
    return shown.loc[order, list(table["condition"].unique())].reset_index()


def draw_changes(
    parts: Mapping[str, pd.DataFrame],
    names: Sequence[str],
    change: str,
    xlabel: str,
    size: tuple[float, float],
) -> Figure:
    """Draw changes with their intervals, a panel for each condition and a row for each name, from below.

    ``change`` begins the names of the columns ``..._percent``, ``..._low`` and ``..._high``; ``size`` is
    that of a panel [inch].
    """
    panels = [Panel((), {"title": name}) for name in parts]
    figure = draw(panels, (size[0] * len(parts) + 1.5, size[1]), len(parts), xlabel)
    places = np.arange(len(names))
    for axis, rows in zip(figure.axes, parts.values(), strict=True):
        middle, low, high = (rows[f"{change}_{end}"] for end in ("percent", "low", "high"))
        ends = np.abs([middle - low, high - middle])
        axis.errorbar(middle, places, xerr=ends, fmt="o", markersize=4)
        axis.axvline(0.0, color="0.4", linewidth=0.8)
        axis.set_yticks(places, names if axis is figure.axes[0] else [])
    return figure


def figure_of(table: pd.DataFrame) -> Figure:
    """Draw the changes against no estimate, a panel for each condition."""
    order = list(page_table(table)["observer"])[::-1]
    parts = {
        c.words: table[table["condition"] == c.words].set_index("observer").loc[order]
        for c in CONDITIONS
    }
    xlabel = "torque fluctuation against none [%]"
    return draw_changes(parts, order, "change", xlabel, (3.0, 4.8))


def main(arguments: list[str] | None = None) -> None:
    """Simulate, rank and write ``observer-ranking.md``, its table and its figure."""
    folder = "out/observer-ranking"
    parser = make_parser("observer_ranking", __doc__, folder, kept=folder, jobs=None)
    parser.add_argument("--seeds", type=int, default=60, help="number of episodes")
    options = parser.parse_args(arguments)
    if options.seeds < 1:
        parser.error("--seeds must be at least 1")
    table = table_of(run_conditions(options.kept, options.seeds, options.jobs))
    print()
    write_results(
        __file__,
        options.out,
        "Observers in a pitch controller",
        table,
        {"": figure_of(table)},
        seeds=options.seeds,
        first=FIRST_SEED,
        table=page_table(table),
    )


if __name__ == "__main__":
    main()
