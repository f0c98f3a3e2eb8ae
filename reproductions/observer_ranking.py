"""Which observer is worth having: every one of them inside the law that places the pitch by it.

Run ``python -m reproductions observer_ranking --out docs/results``; a quarter of an hour on two
cores. What is sailed is kept, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, load_controller
from shaftline.agents.evaluation.statistics import middle_of_runs, relative_to
from shaftline.agents.evaluation.sweeps import episodes
from shaftline.baselines.controller import Predictor
from shaftline.display import figures
from shaftline.display.tables import markdown, write_table
from shaftline.envs.tasks import get_task
from shaftline.observers import observer_names

LAW = "va-pitch:speed_gain=1"
FIRST_SEED = 900_000
KPI = "wave_torque_kN_m"
NONE = "none"
WRONG = {"propeller.relative_rotative_efficiency": 0.05}
"""KQ in the ship that is sailed: off by up to so much, differently in each episode."""


class Condition(NamedTuple):
    """What the observers work with."""

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

INTRODUCTION = """\
The law [va-pitch](../va-pitch.md) places the pitch by the advance velocity that is about to come. Here
every observer gives it, in {seeds} episodes with the same seeds for all (from {first:,}): the seas
that `rough-sea` holds out, on `frigate-at-sea`; and the storm, where the propeller draws air, on the
thesis's frigate. *Clean* and *noisy*: instruments without and with their usual noise. *KQ wrong*: the
ship's torque is up to 5 % off what observer and law take it for, each episode by another amount. The
figure is the swing of the torque at the gauge in waves [kN m]; with `none` the law has the log's speed
alone and answers to no wave. In brackets: change against `none` in percent, with its 95 % interval over
episodes."""

AIR = """\
Where KQ is wrong another draw of the episodes follows as well, so compare within a column.

In the storm `oracle`, the true inflow, is not the best: where the propeller draws air its torque falls
for another reason than inflow. Observers that read the torque take that fall for faster inflow, the law
then raises the pitch, and the torque comes back, which is what is held. The true inflow does not tell of
the air, so the law leaves that fall alone. `frigate-at-sea` draws air too, in the highest seas, which
puts `oracle` behind most observers there."""


def _made(setting: Setting) -> Predictor:
    return load_controller(setting.controller, get_task(setting.task).sailed(), 0.5)


def sailed(folder: Path, seeds: int, jobs: int | None) -> dict[tuple[str, str], Any]:
    """The figure of each episode, by condition and observer; each of shape (seeds,)."""
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
    found = episodes(
        settings, _made, folder, jobs=jobs, tick=lambda: print(".", end="", flush=True)
    )
    return {key: one.kpis[KPI].to_numpy(np.float64) for key, one in zip(keys, found, strict=True)}


def table_of(values: dict[tuple[str, str], NDArray[np.float64]]) -> pd.DataFrame:
    """A row a condition and observer: mean, change against ``none`` in percent, and intervals."""
    rows = []
    for (condition, observer), own in values.items():
        middle, low, high = middle_of_runs(own)
        change = relative_to(own, values[condition, NONE])
        rows.append(
            {"condition": condition, "observer": observer, KPI: middle, "low": low, "high": high,
             "change_percent": change[0], "change_low": change[1], "change_high": change[2]}
        )  # fmt: skip
    return pd.DataFrame(rows)


def shown(table: pd.DataFrame) -> pd.DataFrame:
    """Observers as rows, conditions as columns, the best of the noisiest first."""
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


def drawn(table: pd.DataFrame) -> Figure:
    """Changes against no estimate, a panel a condition."""
    order = list(shown(table)["observer"])[::-1]
    drawn, axes = figures.new_figure(1, len(CONDITIONS), (3.0 * len(CONDITIONS) + 1.5, 4.8))
    for axis, condition in zip(axes[0], CONDITIONS, strict=True):
        part = table[table["condition"] == condition.words].set_index("observer").loc[order]
        middle = part["change_percent"]
        ends = [middle - part["change_low"], part["change_high"] - middle]
        axis.errorbar(middle, np.arange(len(order)), xerr=np.abs(ends), fmt="o", markersize=4)
        axis.axvline(0.0, color="0.4", linewidth=0.8)
        axis.set_yticks(np.arange(len(order)), order if axis is axes[0, 0] else [])
        axis.set_title(condition.words, fontsize=9)
        axis.set_xlabel("torque swing against none [%]", fontsize=8)
        axis.tick_params(labelsize=8)
    return drawn


def main(arguments: list[str] | None = None) -> None:
    """Sail, rank and write ``observer-ranking.md``, its table and its figure."""
    parser = argparse.ArgumentParser(
        "python -m reproductions observer_ranking", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/observer-ranking"), help="folder")
    add("--kept", type=Path, default=Path("out/observer-ranking"), help="of what is sailed")
    add("--seeds", type=int, default=60, help="episodes")
    add("--jobs", type=int, help="processes; one a core by default")
    options = parser.parse_args(arguments)
    if options.seeds < 1:
        parser.error("--seeds must be above zero")
    table = table_of(sailed(options.kept, options.seeds, options.jobs))
    figures.save(drawn(table), options.out / "figures" / "observer-ranking.png")
    introduction = INTRODUCTION.format(seeds=options.seeds, first=FIRST_SEED)
    body = [introduction, markdown(shown(table)), AIR,
            "![Ranking](figures/observer-ranking.png)"]  # fmt: skip
    command = "python -m reproductions observer_ranking --out docs/results"
    write_table(
        options.out, "observer-ranking", "Observers at work", command, table, "\n\n".join(body)
    )
    print(f"\npage: {options.out / 'observer-ranking.md'}")


if __name__ == "__main__":
    main()
