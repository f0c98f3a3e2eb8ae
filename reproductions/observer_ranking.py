"""Rank the observers by the torque fluctuation of a pitch controller that uses their estimate.

Run ``python -m reproductions observer_ranking --out docs/results``; a quarter of an hour on two cores.
"""

from __future__ import annotations

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
from shaftline.display import figures
from shaftline.display.tables import write_table
from shaftline.envs.tasks import get_task
from shaftline.observers import observer_names

from .pages import fill_template, make_parser, print_dot

LAW = "va-pitch:speed_gain=1"
FIRST_SEED = 900_000
KPI = "wave_torque_kN_m"
NONE = "none"
NAME = "observer-ranking"
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
    keys, settings = [], []
    for condition in CONDITIONS:
        for observer in observer_names():
            keys.append((condition.words, observer))
            settings.append(
                Setting(
                    LAW, condition.task, "task", observer, seeds, sensor_noise=condition.noise,
                    first_seed=FIRST_SEED, randomise=condition.wrong,
                )
            )  # fmt: skip
    found = episodes(settings, _load, folder, jobs=jobs, tick=print_dot)
    return {key: one.kpis[KPI].to_numpy(np.float64) for key, one in zip(keys, found, strict=True)}


def table_of(values: dict[tuple[str, str], NDArray[np.float64]]) -> pd.DataFrame:
    """Return mean and change against ``none`` with intervals, a row for each condition and observer."""
    rows = []
    for (condition, observer), own in values.items():
        middle, low, high = mean_with_interval(own)
        change = relative_change(own, values[condition, NONE])
        rows.append(
            {"condition": condition, "observer": observer, KPI: middle, "low": low, "high": high,
             "change_percent": change[0], "change_low": change[1], "change_high": change[2]}
        )  # fmt: skip
    return pd.DataFrame(rows)


def page_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return observers as rows and conditions as columns, sorted by the hardest condition."""
    order = table[table["condition"] == CONDITIONS[3].words].sort_values(KPI)["observer"]
    rows = []
    for observer in order:
        row = {"observer": observer}
        for _, one in table[table["observer"] == observer].iterrows():
            row[one["condition"]] = (
                f"{one[KPI]:.2f} ({one['change_percent']:+.0f}; {one['change_low']:+.0f} to "
                f"{one['change_high']:+.0f})"
            )
        rows.append(row)
    return pd.DataFrame(rows)


def figure_of(table: pd.DataFrame) -> Figure:
    """Draw the changes against no estimate, a panel for each condition."""
    order = list(page_table(table)["observer"])[::-1]
    figure, axes = figures.new_figure(1, len(CONDITIONS), (3.0 * len(CONDITIONS) + 1.5, 4.8))
    for axis, condition in zip(axes[0], CONDITIONS, strict=True):
        part = table[table["condition"] == condition.words].set_index("observer").loc[order]
        middle = part["change_percent"]
        ends = [middle - part["change_low"], part["change_high"] - middle]
        axis.errorbar(middle, np.arange(len(order)), xerr=np.abs(ends), fmt="o", markersize=4)
        axis.axvline(0.0, color="0.4", linewidth=0.8)
        axis.set_yticks(np.arange(len(order)), order if axis is axes[0, 0] else [])
        axis.set_title(condition.words, fontsize=9)
        axis.set_xlabel("torque fluctuation against none [%]", fontsize=8)
        axis.tick_params(labelsize=8)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Simulate, rank and write ``observer-ranking.md``, its table and its figure."""
    folder = f"out/{NAME}"
    parser = make_parser("observer_ranking", __doc__, folder, kept=folder, jobs=None)
    parser.add_argument("--seeds", type=int, default=60, help="number of episodes")
    options = parser.parse_args(arguments)
    if options.seeds < 1:
        parser.error("--seeds must be at least 1")
    table = table_of(run_conditions(options.kept, options.seeds, options.jobs))
    figures.save(figure_of(table), options.out / "figures" / f"{NAME}.png")
    body = fill_template(
        Path(__file__).with_name("observer_ranking.md"), seeds=options.seeds, first=FIRST_SEED,
        table=page_table(table),
    )  # fmt: skip
    command = "python -m reproductions observer_ranking --out docs/results"
    write_table(options.out, NAME, "Observers in a pitch controller", command, table, body)
    print(f"\npage: {options.out / f'{NAME}.md'}")


if __name__ == "__main__":
    main()
