"""Observers as what a policy sees: does an estimate of the advance velocity earn it more?

Run ``python -m reproductions observer_features --out docs/results``; half an hour on two cores. What
is trained and sailed is kept, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
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
from shaftline.display.tables import markdown, write_table
from shaftline.envs.settings import DEFAULTS, noise_of
from shaftline.envs.tasks import HELD_OUT, get_task

from .observer_ranking import WRONG
from .policies.trainings import FROM_NOTHING, from_nothing

TASK, PREVIEW = "rough-sea", "wave-preview"
"""The same seas without and with a sensor at the bow that tells the inflow of the next 6 s."""

NONE, ORACLE = "none", "oracle"
OBSERVERS = (NONE, "random-walk-kalman", "luenberger", "immersion-invariance", ORACLE)
HISTORIES = (1, 8)
RUNS, STEPS = 5, 600_000
EPISODES, FIRST_SEED = 60, 900_000
NOISY = 4.0
"""Times the torque gauge's usual noise."""

KPI = "reward"
NOISE_OF_RUNS = 0.9
"""Standard deviation between runs [% of the reward]: ten trainings of an earlier recipe of the task."""
LEVEL, POWER = 0.05, 0.8
FAMILY = len(HISTORIES) * (len(OBSERVERS) - 1) + 1


def detectable(deviation: float = NOISE_OF_RUNS) -> float:
    """Least difference of two arms' means that is found with the power asked for [%].

    Args:
        deviation: standard deviation between runs [%].
    """
    freedom = 2 * RUNS - 2
    limit = scipy.stats.t.ppf(1.0 - 0.5 * LEVEL / FAMILY, freedom)

    def missing(shift: float) -> float:
        return float(scipy.stats.nct.sf(limit, freedom, shift)) - POWER

    shift = scipy.optimize.brentq(missing, 0.0, 20.0)
    return float(shift * deviation * np.sqrt(2.0 / RUNS))


DESIGN = f"""\
Written before anything was trained.

- **Question**: does a policy that sees an observer's estimate earn more than one that does not, when
  both see shaft speed, torque, pitch and rack, from which an estimate is made?
- **Arms**: observers {", ".join(f"`{name}`" for name in OBSERVERS)} (with `{NONE}` the estimate is
  marked as not valid), each with the last {" and ".join(map(str, HISTORIES))} observations:
  {len(OBSERVERS) * len(HISTORIES)} arms of {RUNS} trainings, equal seeds in all. Two more have the
  preview of `{PREVIEW}`, one observation, and the estimate of `{ORACLE}` or none. The
  hyperparameters are those of `{FROM_NOTHING}`, over {STEPS:,} control intervals; the policies command
  increments, with no base controller and no plans, which would bring an estimate of their own.
- **Memory**: eight observations stand for it. Recurrent policies are left out: policy files hold none.
- **Judged** on {EPISODES} episodes of the held-out seas, the same for all, by the task's reward: with
  the usual noise; with {NOISY:g} times the torque gauge's noise; with KQ up to 5 % off, in each episode
  by another amount. The same policies in all three: nothing is trained again.
- **Power**: between trainings of an earlier recipe the reward's standard deviation was
  {NOISE_OF_RUNS:g} %. With {RUNS} against {RUNS} runs, {FAMILY} comparisons with `{NONE}` at a family's
  level of {LEVEL:.0%} (Bonferroni) and a power of {POWER:.0%}, a difference of
  {detectable():.1f} % is found.
- **Said**: a gain where the family-wise interval lies above zero, "no gain" only where it lies within
  2 % of zero, "not decided" elsewhere."""


class Condition(NamedTuple):
    """How the policies are judged."""

    words: str
    sensor_noise: Any
    wrong: dict[str, float] | None


def conditions() -> tuple[Condition, ...]:
    """The three of the design."""
    usual = noise_of(get_task(TASK).sailed(), DEFAULTS.sensor_noise)
    noisy = {name: float(usual[name]) for name in usual.dtype.names}
    noisy["shaft_torque"] *= NOISY
    return (
        Condition("usual", DEFAULTS.sensor_noise, None),
        Condition("noisy gauge", noisy, None),
        Condition("KQ wrong", DEFAULTS.sensor_noise, WRONG),
    )


class Arm(NamedTuple):
    """What a policy sees."""

    observer: str
    history: int
    preview: bool = False

    @property
    def task(self) -> str:
        """Name of the task that it is trained and judged on."""
        return PREVIEW if self.preview else TASK

    @property
    def words(self) -> str:
        """Label of a figure."""
        return f"{self.observer}, {'preview' if self.preview else self.history}"

    def recipe(self, **changes: Any) -> Recipe:
        """Return the recipe of its trainings."""
        fields = {"frame_stack": self.history, "n_timesteps": STEPS} | changes
        return from_nothing(self.task, {"observer": self.observer}, **fields)


ARMS = (
    *itertools.starmap(Arm, itertools.product(OBSERVERS, HISTORIES)),
    Arm(NONE, 1, preview=True),
    Arm(ORACLE, 1, preview=True),
)


def _trained(cell: tuple[Recipe, int, str]) -> str:
    from shaftline.agents.learning.training import train

    recipe, seed, folder = cell
    return str(train(recipe, seed, Path(folder), device="cpu", threads=1))


def trained(folder: Path, jobs: int | None, **changes: Any) -> dict[Arm, list[Path]]:
    """Policies of each arm; those that stand in the folder are not trained again."""
    source = source_digest("core", "plant", "observers", "baselines", "envs", "agents")
    cells = {}
    for seed, arm in itertools.product(range(1, RUNS + 1), ARMS):
        recipe = arm.recipe(**changes)
        version = digest_of(f"{source} {recipe.model_dump_json()}")
        cells[f"{arm.task}-{arm.observer}-{arm.history}-{seed}-{version}"] = (arm, recipe, seed)
    paths = sweep(
        _trained,
        {name: (recipe, seed, str(folder / name)) for name, (_, recipe, seed) in cells.items()},
        folder / "cells", jobs=jobs, tick=_tick,
    )  # fmt: skip
    found: dict[Arm, list[Path]] = {arm: [] for arm in ARMS}
    for name, (arm, _, _) in cells.items():
        found[arm].append(Path(paths[name]))
    return found


def judged(
    policies: dict[Arm, list[Path]], folder: Path, jobs: int | None, seeds: int = EPISODES
) -> dict[tuple[str, Arm], NDArray[np.float64]]:
    """Mean reward of each policy, by condition and arm, shape (runs,)."""
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

    def made(setting: Setting) -> Predictor:
        return load_controller(texts[setting.controller], get_task(TASK).sailed(), 0.5)

    cells = episodes(settings, made, folder, jobs=jobs, tick=_tick)
    found: dict[tuple[str, Arm], list[float]] = {}
    for key, cell in zip(keys, cells, strict=True):
        found.setdefault(key, []).append(float(cell.kpis[KPI].mean()))
    return {key: np.array(values) for key, values in found.items()}


def table_of(values: dict[tuple[str, Arm], NDArray[np.float64]]) -> pd.DataFrame:
    """A row a condition and arm: mean, deviation between runs, and gain over ``none`` in percent.

    The gain is positive where the estimate earns more; its interval is the family-wise one.
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
        "" if row["observer"] == NONE else said(row["gain_low"], row["gain_high"])
        for _, row in table.iterrows()
    ]
    return table


def said(low: float, high: float) -> str:
    """What the design says of an interval of the gain [%]."""
    if low > 0.0:
        return "gain"
    if high < 0.0:
        return "loss"
    return "no gain" if max(-low, high) <= 2.0 else "not decided"


def shown(table: pd.DataFrame) -> pd.DataFrame:
    """Arms as rows, conditions as columns."""
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


def drawn(table: pd.DataFrame) -> Figure:
    """Gains over no estimate, a panel a condition."""
    names = [c.words for c in conditions()]
    drawn, axes = figures.new_figure(1, len(names), (3.2 * len(names) + 1.5, 3.4))
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
    return drawn


def _tick() -> None:
    print(".", end="", flush=True)


def main(arguments: list[str] | None = None) -> None:
    """Train, judge and write."""
    parser = argparse.ArgumentParser(
        "python -m reproductions observer_features", description=__doc__.split("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/observer-features"), help="folder")
    parser.add_argument(
        "--kept", type=Path, default=Path("out/observer-features/kept"), help="of what is made"
    )
    parser.add_argument("--jobs", type=int, help="processes; one a core by default")
    options = parser.parse_args(arguments)
    policies = trained(options.kept / "trained", options.jobs)
    table = table_of(judged(policies, options.kept, options.jobs))
    print()
    figures.save(drawn(table), options.out / "figures" / "observer-features.png")
    usual = table[table["condition"] == conditions()[0].words]
    spread = float(np.sqrt(np.mean(usual["between_runs_percent"] ** 2)))
    write_table(
        options.out, "observer-features", "Observers as features",
        "python -m reproductions observer_features --out docs/results", table,
        "## Design\n\n" + DESIGN + "\n\n## Found\n\n"
        "Mean reward of an arm; in brackets its gain over the same arm without an estimate, with "
        "the interval and what the design says of it. Between runs the deviation was "
        f"{spread:.2f} %, so {detectable(spread):.1f} % could be found.\n\n"
        + markdown(shown(table)) + "\n\n![Gains](figures/observer-features.png)",
    )  # fmt: skip
    print(f"page: {options.out / 'observer-features.md'}")


if __name__ == "__main__":
    main()
