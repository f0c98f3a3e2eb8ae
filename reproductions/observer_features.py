"""Compare trained policies with and without an observer's estimate in their observation.

Run ``python -m reproductions observer_features --out docs/results``; half an hour on two cores.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, label, load_controller
from shaftline.agents.evaluation.sweeps import episodes
from shaftline.agents.learning.recipe import Recipe
from shaftline.baselines.controller import Predictor
from shaftline.core.sweep import digest_of, source_digest, sweep
from shaftline.display import figures
from shaftline.display.tables import write_table
from shaftline.envs.settings import DEFAULTS, noise_record
from shaftline.envs.tasks import HELD_OUT, get_task

from .observer_ranking import WRONG
from .pages import fill_template, make_parser, print_dot
from .policies.trainings import FROM_NOTHING, from_nothing

TASK, PREVIEW = "rough-sea", "wave-preview"
"""Tasks in the same seas without and with a bow sensor of the inflow in the next 6 s."""

NONE, ORACLE = "none", "oracle"
NAME = "observer-features"
OBSERVERS = (NONE, "random-walk-kalman", "luenberger", "immersion-invariance", ORACLE)
HISTORIES = (1, 8)
RUNS, STEPS = 5, 600_000
EPISODES, FIRST_SEED = 60, 900_000
NOISY = 4.0
"""Factor on the usual noise of the shaft torque meter."""

KPI = "reward"
NOISE_OF_RUNS = 0.9
"""Standard deviation between trainings [% of the reward], from ten trainings of an earlier recipe."""
LEVEL, POWER = 0.05, 0.8
FAMILY = len(HISTORIES) * (len(OBSERVERS) - 1) + 1


def detectable(deviation: float = NOISE_OF_RUNS) -> float:
    """Return the least difference of two arms that is detected with the planned power [%].

    Args:
        deviation: standard deviation between trainings [%].
    """
    freedom = 2 * RUNS - 2
    limit = scipy.stats.t.ppf(1.0 - 0.5 * LEVEL / FAMILY, freedom)

    def power_gap(shift: float) -> float:
        return float(scipy.stats.nct.sf(limit, freedom, shift)) - POWER

    shift = scipy.optimize.brentq(power_gap, 0.0, 20.0)
    return float(shift * deviation * np.sqrt(2.0 / RUNS))


class Condition(NamedTuple):
    """Noise and parameter errors of an evaluation."""

    words: str
    sensor_noise: Any
    wrong: dict[str, float] | None


def conditions() -> tuple[Condition, ...]:
    """Return the three conditions of the design."""
    usual = noise_record(get_task(TASK).load_ship(), DEFAULTS.sensor_noise)
    noisy = {name: float(usual[name]) for name in usual.dtype.names}
    noisy["shaft_torque"] *= NOISY
    return (
        Condition("usual", DEFAULTS.sensor_noise, None),
        Condition("noisy torque meter", noisy, None),
        Condition("KQ wrong", DEFAULTS.sensor_noise, WRONG),
    )


class Arm(NamedTuple):
    """Observer and history in the observation of a policy."""

    observer: str
    history: int
    preview: bool = False

    @property
    def task(self) -> str:
        """Name of the task of training and evaluation."""
        return PREVIEW if self.preview else TASK

    @property
    def words(self) -> str:
        """Label of a figure."""
        return f"{self.observer}, {'preview' if self.preview else self.history}"

    def recipe(self, **changes: Any) -> Recipe:
        """Return the recipe of the trainings."""
        fields = {"frame_stack": self.history, "n_timesteps": STEPS} | changes
        return from_nothing(self.task, {"observer": self.observer}, **fields)


ARMS = (
    *itertools.starmap(Arm, itertools.product(OBSERVERS, HISTORIES)),
    Arm(NONE, 1, preview=True),
    Arm(ORACLE, 1, preview=True),
)


def _train(cell: tuple[Recipe, int, str]) -> str:
    from shaftline.agents.learning.training import train

    recipe, seed, folder = cell
    return str(train(recipe, seed, Path(folder), device="cpu", threads=1))


def train_arms(folder: Path, jobs: int | None, **changes: Any) -> dict[Arm, list[Path]]:
    """Return the policies of each arm; existing ones are not trained again."""
    source = source_digest("core", "plant", "observers", "baselines", "envs", "agents")
    cells = {}
    for seed, arm in itertools.product(range(1, RUNS + 1), ARMS):
        recipe = arm.recipe(**changes)
        version = digest_of(f"{source} {recipe.model_dump_json()}")
        cells[f"{arm.task}-{arm.observer}-{arm.history}-{seed}-{version}"] = (arm, recipe, seed)
    paths = sweep(
        _train,
        {name: (recipe, seed, str(folder / name)) for name, (_, recipe, seed) in cells.items()},
        folder / "cells", jobs=jobs, tick=print_dot,
    )  # fmt: skip
    found: dict[Arm, list[Path]] = {arm: [] for arm in ARMS}
    for name, (arm, _, _) in cells.items():
        found[arm].append(Path(paths[name]))
    return found


def evaluate_arms(
    policies: dict[Arm, list[Path]], folder: Path, jobs: int | None, seeds: int = EPISODES
) -> dict[tuple[str, Arm], NDArray[np.float64]]:
    """Return the mean reward of each policy by condition and arm, shape (runs,)."""
    texts, keys, settings = {}, [], []
    for condition, (arm, paths) in itertools.product(conditions(), policies.items()):
        for path in paths:
            name = label(f"policy:{path}")
            texts[name] = f"policy:{path}"
            keys.append((condition.words, arm))
            settings.append(
                Setting(
                    name, f"{arm.task}:{HELD_OUT}", "task", arm.observer, seeds,
                    sensor_noise=condition.sensor_noise, first_seed=FIRST_SEED,
                    randomise=condition.wrong,
                )
            )  # fmt: skip

    def load(setting: Setting) -> Predictor:
        return load_controller(texts[setting.controller], get_task(TASK).load_ship(), 0.5)

    cells = episodes(settings, load, folder, jobs=jobs, tick=print_dot)
    found: dict[tuple[str, Arm], list[float]] = {}
    for key, cell in zip(keys, cells, strict=True):
        found.setdefault(key, []).append(float(cell.kpis[KPI].mean()))
    return {key: np.array(values) for key, values in found.items()}


def table_of(values: dict[tuple[str, Arm], NDArray[np.float64]]) -> pd.DataFrame:
    """Return mean, deviation between trainings and gain over ``none``, a row for each condition and arm.

    The gain is positive where the estimate increases the reward; its interval is the family-wise one.
    """
    rows = []
    for (condition, arm), own in values.items():
        without = values[condition, arm._replace(observer=NONE)]
        scale = 100.0 / abs(float(without.mean()))
        gain = scale * float(own.mean() - without.mean())
        spread = scale * float(np.sqrt(np.var(own, ddof=1) / RUNS + np.var(without, ddof=1) / RUNS))
        half = spread * float(scipy.stats.t.ppf(1.0 - 0.5 * LEVEL / FAMILY, 2 * RUNS - 2))
        rows.append(
            {"condition": condition, **arm._asdict(), KPI: float(own.mean()),
             "between_runs_percent": scale * float(np.std(own, ddof=1)), "gain_percent": gain,
             "gain_low": gain - half, "gain_high": gain + half}
        )  # fmt: skip
    table = pd.DataFrame(rows)
    table["said"] = [
        "" if row["observer"] == NONE else decision(row["gain_low"], row["gain_high"])
        for _, row in table.iterrows()
    ]
    return table


def decision(low: float, high: float) -> str:
    """Return the decision of the design for an interval of the gain [%]."""
    if low > 0.0:
        return "gain"
    if high < 0.0:
        return "loss"
    return "no gain" if max(-low, high) <= 2.0 else "not decided"


def page_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return arms as rows and conditions as columns."""
    rows = []
    for arm in ARMS:
        mine = table[(table[list(Arm._fields)] == list(arm)).all(axis=1)]
        row: dict[str, Any] = arm._asdict()
        for _, one in mine.iterrows():
            text = f"{one[KPI]:.1f}"
            if one["said"]:
                text += (
                    f" ({one['gain_percent']:+.1f} %; {one['gain_low']:+.1f} to "
                    f"{one['gain_high']:+.1f}: {one['said']})"
                )
            row[one["condition"]] = text
        rows.append(row)
    return pd.DataFrame(rows)


def figure_of(table: pd.DataFrame) -> Figure:
    """Draw the gains over no estimate, a panel for each condition."""
    names = [c.words for c in conditions()]
    figure, axes = figures.new_figure(1, len(names), (3.2 * len(names) + 1.5, 3.4))
    arms = [arm for arm in ARMS if arm.observer != NONE][::-1]
    for axis, name in zip(axes[0], names, strict=True):
        part = table[table["condition"] == name].set_index(list(Arm._fields))
        rows = part.loc[[tuple(arm) for arm in arms]]
        ends = [rows["gain_percent"] - rows["gain_low"], rows["gain_high"] - rows["gain_percent"]]
        axis.axvspan(-2.0, 2.0, color="0.93")
        axis.axvline(0.0, color="0.4", linewidth=0.8)
        axis.errorbar(rows["gain_percent"], np.arange(len(arms)), xerr=ends, fmt="o", markersize=4)
        axis.set_yticks(
            np.arange(len(arms)), [arm.words for arm in arms] if axis is axes[0, 0] else []
        )
        axis.set_title(name, fontsize=9)
        axis.set_xlabel("reward gained over none [%]", fontsize=8)
        axis.tick_params(labelsize=8)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Train, evaluate, and write ``observer-features.md``, its table and its figure."""
    folder = f"out/{NAME}"
    parser = make_parser("observer_features", __doc__, folder, kept=f"{folder}/kept", jobs=None)
    options = parser.parse_args(arguments)
    policies = train_arms(options.kept / "trained", options.jobs)
    table = table_of(evaluate_arms(policies, options.kept, options.jobs))
    print()
    figures.save(figure_of(table), options.out / "figures" / f"{NAME}.png")
    usual = table[table["condition"] == conditions()[0].words]
    spread = float(np.sqrt(np.mean(usual["between_runs_percent"] ** 2)))
    body = fill_template(
        Path(__file__).with_name("observer_features.md"), observers=OBSERVERS, none=NONE,
        histories=HISTORIES, runs=RUNS, preview=PREVIEW, oracle=ORACLE, recipe=FROM_NOTHING,
        steps=STEPS, episodes=EPISODES, noisy=NOISY, deviation=NOISE_OF_RUNS, family=FAMILY,
        level=LEVEL, power=POWER, planned=detectable(), spread=spread, found=detectable(spread),
        table=page_table(table),
    )  # fmt: skip
    command = "python -m reproductions observer_features --out docs/results"
    write_table(options.out, NAME, "Observer estimates as policy input", command, table, body)
    print(f"page: {options.out / f'{NAME}.md'}")


if __name__ == "__main__":
    main()
