"""Compare three controllers scheduled by the nominal wake, by observers and by the true inflow.

Run ``python -m reproductions advance_velocity_control --out docs/results``; about ten minutes on two
cores.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.agents.evaluation.episodes import Setting, load_controller, run_episodes
from shaftline.agents.evaluation.statistics import mean_with_interval
from shaftline.agents.evaluation.sweeps import version_of_cells
from shaftline.baselines import Combinator
from shaftline.baselines.controller import Predictor
from shaftline.baselines.inflow_schedule import BAND, FILTER_S
from shaftline.core.sweep import sweep
from shaftline.envs.tasks import Task, get_task

from .pages import make_parser, print_dot
from .writing import write_results

FIRST_SEED = 100
WAKE = (
    0.1  # by which the wake fraction of the simulated ship is higher than the controller knows [-]
)
WRONG_KQ = {"propeller.relative_rotative_efficiency": 0.1}
"""Largest relative error of KQ in the simulated ship, drawn in each episode."""

KPIS = {
    "combinator-trimmed": "overload_s",
    "cpp-optimiser": "fuel_kg_nmi",
    "anti-spin": "wave_torque_kN_m",
}
"""Controllers, each with the quantity that its schedule is to improve."""

REWARD, SHORT = "reward", "speed_short_m_s"
PLAIN, NOMINAL = "no schedule", "nominal wake"
OBSERVERS = ("power-balance", "luenberger", "oracle")
SETTLED_S = 60.0  # time after which deviations are counted [s]


class Condition(NamedTuple):
    """Sea and parameter errors of a comparison."""

    words: str
    task: str
    sea: str
    wake: float  # error of the wake fraction [-]
    wrong: dict[str, float] | None

    @property
    def model(self) -> Task:
        """Task with the true ship."""
        task = get_task(self.task)
        if not self.wake:
            return task
        wake = task.load_ship().hull.wake_fraction + self.wake
        return task.model_copy(update={"ship": {**task.ship, "hull.wake_fraction": wake}})

    def setting(self, controller: str, observer: str, seeds: int) -> Setting:
        """Return the cell of a controller; its label of the task contains the error of the wake."""
        return Setting(
            controller,
            f"{self.task} {self.wake:g}",
            self.sea,
            observer,
            seeds,
            task_model=self.model,
            first_seed=FIRST_SEED,
            randomise=self.wrong,
        )


_SEAS = (("calm", "transit", "calm"), ("waves", "flank", "task"), ("storm", "storm", "task"))
_ERRORS: tuple[tuple[str, float, dict[str, float] | None], ...] = (
    ("", 0.0, None),
    (", wake wrong", WAKE, None),
    (", KQ wrong", 0.0, WRONG_KQ),
)
CONDITIONS = [
    Condition(name + words, task, sea, wake, wrong)
    for (words, wake, wrong), (name, task, sea) in itertools.product(_ERRORS, _SEAS)
]


def _load(setting: Setting) -> Predictor:
    """Return a controller that is designed for the ship file, not for the true ship."""
    ship = get_task(setting.task.split()[0]).load_ship()
    return load_controller(setting.controller, ship, setting.interval_s)


def _simulate(setting: Setting) -> dict[str, list[float]]:
    kpis, _ = run_episodes(setting, _load(setting), threads=1)
    return {str(name): kpis[name].tolist() for name in (REWARD, SHORT, *KPIS.values())}


def variants(controller: str) -> dict[str, tuple[str, str]]:
    """Return controller text and observer by the heading of a column."""
    scheduled = {name: (f"{controller}:va_weight=1", name) for name in OBSERVERS}
    plain = {PLAIN: (controller, "luenberger"), NOMINAL: (f"{controller}:va_weight=0", "none")}
    return plain | scheduled


def run_conditions(
    folder: Path, seeds: int, jobs: int | None
) -> dict[tuple[str, str, str], pd.DataFrame]:
    """Return the KPIs of each episode by controller, condition and variant."""
    settings = {
        (controller, condition.words, name): condition.setting(text, observer, seeds)
        for controller in KPIS
        for condition in CONDITIONS
        for name, (text, observer) in variants(controller).items()
    }
    cells = {
        f"{setting.name}_{version_of_cells(setting.vessel, setting.observer)}": setting
        for setting in settings.values()
    }
    found = sweep(_simulate, cells, folder / "cells", jobs=jobs, tick=print_dot)
    return {key: pd.DataFrame(one) for key, one in zip(settings, found.values(), strict=True)}


def table_of(found: dict[tuple[str, str, str], pd.DataFrame]) -> pd.DataFrame:
    """Return mean and paired change against the nominal wake, with intervals, of reward and KPI."""
    rows = []
    for (controller, condition, name), own in found.items():
        base = found[controller, condition, NOMINAL]
        for quantity in (REWARD, KPIS[controller], SHORT):
            change, low, high = mean_with_interval(own[quantity] - base[quantity])
            rows.append(
                {
                    "controller": controller,
                    "condition": condition,
                    "schedule": name,
                    "quantity": quantity,
                    "mean": float(own[quantity].mean()),
                    "change": change,
                    "change_low": low,
                    "change_high": high,
                }
            )
    return pd.DataFrame(rows)


def page_table(table: pd.DataFrame, reward: bool) -> pd.DataFrame:
    """Return a row for each controller and condition: the mean with the nominal wake, and changes.

    The quantity is the reward or that which the schedule of the controller is to improve.
    """
    rows = []
    for (controller, condition), part in table.groupby(["controller", "condition"], sort=False):
        quantity = REWARD if reward else KPIS[str(controller)]
        own = part[part["quantity"] == quantity].set_index("schedule")
        digits = 1 if reward else 2
        row = {"controller": controller, "condition": condition}
        if not reward:
            row["quantity"] = quantity
        row[NOMINAL] = f"{own.loc[NOMINAL, 'mean']:.{digits}f}"
        for name, line in own.drop(index=NOMINAL).iterrows():
            values = [float(line[end]) for end in ("change", "change_low", "change_high")]
            change, low, high = (f"{value:+.{digits}f}" for value in values)
            row[str(name)] = f"{change} ({low} to {high})" if any(values) else "0"
        rows.append(row)
    return pd.DataFrame(rows)


class _Recorder:
    """Controller that keeps the deviation of the schedule of each call."""

    def __init__(self, controller: Combinator) -> None:
        self.controller = controller
        self.deviations: list[NDArray[np.float64]] = []

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return action and state of the controller."""
        action, state = self.controller.predict(observation, state, episode_start, deterministic)
        self.deviations.append(state[:, 2].copy())
        return action, state


def deviation_table(seeds: int) -> pd.DataFrame:
    """Return percentiles of the deviation r and the share of time outside the band, in percent."""
    rows = []
    for condition, observer in itertools.product(CONDITIONS, OBSERVERS[::2]):
        setting = condition.setting("combinator-trimmed:va_weight=1", observer, seeds)
        recorder = _Recorder(
            Combinator(get_task(condition.task).load_ship(), trim_s=30.0, va_weight=1.0)
        )
        run_episodes(setting, recorder)
        late = np.array(recorder.deviations)[round(SETTLED_S / setting.interval_s) :]
        low, middle, high = np.percentile(100.0 * late, [5.0, 50.0, 95.0])
        rows.append(
            {
                "condition": condition.words,
                "observer": observer,
                "5 %": low,
                "median": middle,
                "95 %": high,
                "outside the band": 100.0 * float(np.mean(np.abs(late) > BAND)),
            }
        )
    return pd.DataFrame(rows)


def main(arguments: list[str] | None = None) -> None:
    """Simulate, compare and write ``advance-velocity-control.md`` and its table."""
    folder = "out/advance-velocity-control"
    parser = make_parser("advance_velocity_control", __doc__, folder, kept=folder, jobs=None)
    parser.add_argument("--seeds", type=int, default=32, help="number of episodes")
    options = parser.parse_args(arguments)
    if options.seeds < 2:
        parser.error("--seeds must be at least 2")
    table = table_of(run_conditions(options.kept, options.seeds, options.jobs))
    print()
    short = table[table["quantity"] == SHORT].set_index(["controller", "condition", "schedule"])
    write_results(
        __file__,
        options.out,
        "Controllers scheduled by the advance velocity",
        table,
        seeds=options.seeds,
        first=FIRST_SEED,
        last=FIRST_SEED + options.seeds - 1,
        wake=WAKE,
        kq=round(100.0 * next(iter(WRONG_KQ.values()))),
        band=round(100.0 * BAND),
        filter_s=FILTER_S,
        settled_s=SETTLED_S,
        rewards=page_table(table, reward=True),
        improved=page_table(table, reward=False),
        short={
            f"{condition}, {schedule}": float(
                short.loc[("cpp-optimiser", condition, schedule), "mean"]
            )
            for condition in ("calm, wake wrong", "waves, wake wrong", "storm", "storm, wake wrong")
            for schedule in (NOMINAL, "power-balance", "oracle")
        },
        deviations=deviation_table(options.seeds),
    )


if __name__ == "__main__":
    main()
