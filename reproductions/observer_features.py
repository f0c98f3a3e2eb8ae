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
from shaftline.envs.settings import DEFAULTS, noise_record
from shaftline.envs.tasks import HELD_OUT, get_task

from .observer_ranking import WRONG, draw_changes
from .pages import make_parser, print_dot
from .policies.trainings import FROM_NOTHING, from_nothing
from .writing import rms, write_results

TASK, PREVIEW = "rough-sea", "wave-preview"
"""Tasks in the same seas without and with a bow sensor of the inflow in the next 6 s."""

NONE, ORACLE = "none", "oracle"
OBSERVERS = (NONE, "random-walk-kalman", "luenberger", "immersion-invariance", ORACLE)
HISTORIES = (1, 8)
RUNS, STEPS = 5, 600_000
EPISODES, FIRST_SEED = 60, 900_000
NOISY = 4.0  # factor on the usual noise of the shaft torque meter
KPI = "reward"
NOISE_OF_RUNS = 0.9
"""Standard deviation between trainings [% of the reward], from ten trainings of an earlier recipe."""
LEVEL, POWER = 0.05, 0.8
FAMILY = len(HISTORIES) * (len(OBSERVERS) - 1) + 1


def detectable(deviation: float = NOISE_OF_RUNS) -> float:
    """Return the least difference of two arms [%] that is detected, by that of trainings [%]."""
    freedom = 2 * RUNS - 2
    limit = scipy.stats.t.ppf(1.0 - 0.5 * LEVEL / FAMILY, freedom)

    shift = scipy.optimize.brentq(
        lambda shift: scipy.stats.nct.sf(limit, freedom, shift) - POWER, 0.0, 20.0
    )
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
    arms, cells = {}, {}
    for seed, arm in itertools.product(range(1, RUNS + 1), ARMS):
        recipe = arm.recipe(**changes)
        version = digest_of(f"{source} {recipe.model_dump_json()}")
        name = f"{arm.task}-{arm.observer}-{arm.history}-{seed}-{version}"
        arms[name], cells[name] = arm, (recipe, seed, str(folder / name))
    paths = sweep(_train, cells, folder / "cells", jobs=jobs, tick=print_dot)
    found: dict[Arm, list[Path]] = {arm: [] for arm in ARMS}
    for name, arm in arms.items():
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
                    name,
                    f"{arm.task}:{HELD_OUT}",
                    "task",
                    arm.observer,
                    seeds,
                    sensor_noise=condition.sensor_noise,
                    first_seed=FIRST_SEED,
                    randomise=condition.wrong,
                )
            )

    def load(setting: Setting) -> Predictor:
        return load_controller(texts[setting.controller], get_task(TASK).load_ship(), 0.5)

    cells = episodes(settings, load, folder, jobs=jobs, tick=print_dot)
    means = pd.Series([float(cell.kpis[KPI].mean()) for cell in cells])
    return {key: means[[k == key for k in keys]].to_numpy() for key in dict.fromkeys(keys)}


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
            {
                "condition": condition,
                **arm._asdict(),
                KPI: float(own.mean()),
                "between_runs_percent": scale * float(np.std(own, ddof=1)),
                "gain_percent": gain,
                "gain_low": gain - half,
                "gain_high": gain + half,
            }
        )
        rows[-1]["said"] = "" if arm.observer == NONE else decision(gain - half, gain + half)
    return pd.DataFrame(rows)


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
        row: dict[str, Any] = arm._asdict()
        for one in table[(table[list(Arm._fields)] == list(arm)).all(axis=1)].to_dict("records"):
            gain, low, high = (f"{one[f'gain_{end}']:+.1f}" for end in ("percent", "low", "high"))
            said = f" ({gain} %; {low} to {high}: {one['said']})" if one["said"] else ""
            row[one["condition"]] = f"{one[KPI]:.1f}{said}"
        rows.append(row)
    return pd.DataFrame(rows)


def figure_of(table: pd.DataFrame) -> Figure:
    """Draw the gains over no estimate, a panel for each condition."""
    arms = [arm for arm in ARMS if arm.observer != NONE][::-1]
    by_arm = table.set_index(list(Arm._fields))
    parts = {
        c.words: by_arm[by_arm["condition"] == c.words].loc[[tuple(arm) for arm in arms]]
        for c in conditions()
    }
    names = [arm.words for arm in arms]
    figure = draw_changes(parts, names, "gain", "reward gained over none [%]", (3.2, 3.4))
    for axis in figure.axes:
        axis.axvspan(-2.0, 2.0, color="0.93", zorder=0)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Train, evaluate, and write ``observer-features.md``, its table and its figure."""
    folder = "out/observer-features"
    parser = make_parser("observer_features", __doc__, folder, kept=f"{folder}/kept", jobs=None)
    options = parser.parse_args(arguments)
    policies = train_arms(options.kept / "trained", options.jobs)
    table = table_of(evaluate_arms(policies, options.kept, options.jobs))
    print()
    usual = table[table["condition"] == conditions()[0].words]
    spread = rms(usual["between_runs_percent"])
    write_results(
        __file__, options.out, "Observer estimates as policy input", table, {"": figure_of(table)},
        observers=OBSERVERS, none=NONE, histories=HISTORIES, runs=RUNS, preview=PREVIEW, oracle=ORACLE,
        recipe=FROM_NOTHING, steps=STEPS, episodes=EPISODES, noisy=NOISY, deviation=NOISE_OF_RUNS,
        family=FAMILY, level=LEVEL, power=POWER, planned=detectable(), spread=spread,
        found=detectable(spread), table=page_table(table),
    )  # fmt: skip


if __name__ == "__main__":
    main()
