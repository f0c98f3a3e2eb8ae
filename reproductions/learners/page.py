"""The page of the standard learners: scores, returns, intervals and learning curves."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.agents.evaluation.scores import Bound
from shaftline.agents.evaluation.statistics import middle_of_runs
from shaftline.display.figures import PALETTE, new_figure, save
from shaftline.display.tables import markdown, write_table
from shaftline.envs import DEFAULTS
from shaftline.envs.tasks import HELD_OUT

from ..policies.trainings import from_nothing
from .bounds import EPISODES as PLANNED
from .bounds import STARTS, STEPS
from .references import BLIND, CONTROLLERS, EPISODES, FIRST_SEED, PREVIEWING, TUNED
from .trainings import ALGORITHMS, DEFAULT_LEARNERS, RECIPE

COMBINATOR = CONTROLLERS[0]
UNTUNED = CONTROLLERS[1:]
COMMAND = "python -m reproductions learners --out docs/results"
_ACROSS = 3  # panels of the figure


def bound_of(task: str, found: dict[str, Any]) -> Bound | None:
    """Return the bound of a task; None where a plan is missing."""
    same = found.get(f"same_{task}")
    seeds = sorted(
        {int(name.split("_")[-2]) for name in found if name.startswith(f"bound_{task}_")}
    )
    plans = [
        [
            found[name]["return"]
            for start in STARTS
            if (name := f"bound_{task}_{seed}_{start}") in found
        ]
        for seed in seeds
    ]
    judged = [episodes_of(task, name, "", found) for name in (COMBINATOR, TUNED)]
    missing = any(len(row) < len(STARTS) for row in plans) or not all(map(len, judged))
    if same is None or len(plans) < PLANNED or missing:
        return None
    best, worst = (np.array([end(row) for row in plans]) for end in (max, min))
    combinator, tuned = (float(v.mean()) / (DEFAULTS.max_episode_steps or 1) for v in judged)
    return Bound(
        combinator=combinator,
        tuned=tuned,
        best=tuned + (float(best.mean()) - same[TUNED]) / STEPS,
        spread=float((best - worst).mean()) / STEPS,
    )


def episodes_of(task: str, name: str, part: str, found: dict[str, Any]) -> NDArray[np.float64]:
    """Return episode returns of shape (trainings, episodes); no row where nothing is there."""
    if name in ALGORITHMS:
        rows = [v[part]["values"] for k, v in found.items() if k.startswith(f"{name}_{task}_")]
    else:
        key = f"reference_{task}_{name.replace(' ', '-')}"
        rows = [found[key][part]["values"]] if key in found else []
    return np.atleast_2d(np.array(rows, dtype=np.float64)) if rows else np.zeros((0, 0))


def table_of(names: list[str], found: dict[str, Any]) -> pd.DataFrame:
    """Return a row for each task and controller: return with its interval, score, gain, failures."""
    rows = []
    known = {task: bound_of(task, found) for task in names}
    kinds = (*CONTROLLERS, *PREVIEWING, TUNED, *BLIND, *ALGORITHMS)
    for task, part, name in itertools.product(names, ("", f":{HELD_OUT}"), kinds):
        values = episodes_of(task, name, part, found)
        base = episodes_of(task, COMBINATOR, part, found)
        if not len(values) or not len(base):
            continue
        mean, low, high = middle_of_runs(values)
        gain, gain_low, gain_high = middle_of_runs(values - base)
        bound = known[task]
        steps = DEFAULTS.max_episode_steps or 1
        rows.append(
            {"task": f"{task}{part}", "controller": name, "trainings": len(values), "return": mean,
             "return_low": low, "return_high": high, "gain": gain, "gain_low": gain_low,
             "gain_high": gain_high, "score": np.nan if bound is None or part else
             bound.score(mean / steps)}
        )  # fmt: skip
    return pd.DataFrame(rows)


def _wide(table: pd.DataFrame, names: list[str], part: str) -> pd.DataFrame:
    """Return controllers as rows and tasks as columns: return, and score where there is one."""
    columns: dict[str, dict[str, str]] = {}
    for task in names:
        rows = table[table["task"] == f"{task}{part}"]
        columns[task] = {
            row["controller"]: f"{row['return']:.0f}"
            + ("" if np.isnan(row["score"]) else f" ({row['score']:.2f})")
            for _, row in rows.iterrows()
        }
    return pd.DataFrame(columns).fillna("–").rename_axis("controller").reset_index()


def _targets(table: pd.DataFrame, names: list[str], learners: Iterable[str]) -> pd.DataFrame:
    """Return, for each learner and task, the gain over the combinator and the best untuned classic."""
    rows = []
    for task, name in itertools.product(names, learners):
        here = table[table["task"] == task].set_index("controller")
        if name not in here.index:
            continue
        one = here.loc[name]
        classic = here.loc[[c for c in UNTUNED if c in here.index], "return"]
        rows.append(
            (task, name, int(one["trainings"]),
             f"{one['gain']:+.0f} ({one['gain_low']:+.0f} to {one['gain_high']:+.0f})",
             "yes" if one["gain_low"] > 0.0 else "no" if one["gain_high"] < 0.0 else "not decided",
             f"{classic.idxmax()} {classic.max():.0f}",
             "yes" if one["return_low"] > classic.max() else "no")
        )  # fmt: skip
    return pd.DataFrame(
        rows,
        columns=["task", "learner", "trainings", "return less the combinator's", "beats it",
                 "best untuned classic controller", "beats it, too"],
    )  # fmt: skip


def _bounds(names: list[str], found: dict[str, Any]) -> pd.DataFrame:
    rows = []
    for task in names:
        bound = bound_of(task, found)
        if bound is not None:
            returns = (DEFAULTS.max_episode_steps or 1) * np.array(bound)
            rows.append((task, *returns.round(1), round(100.0 * (1.0 - bound.score(bound.tuned)))))
    return pd.DataFrame(
        rows,
        columns=["task", "combinator", "tuned controller", "bound", "spread of the starts",
                 "gap of the tuned controller [% of the score]"],
    )  # fmt: skip


def curves(names: list[str], found: dict[str, Any]) -> Figure:
    """Draw the return over the steps of each training, task by task."""
    rows = -(-len(names) // _ACROSS)
    figure, axes = new_figure(rows, _ACROSS, (11.0, 2.6 * rows))
    for axis, task in itertools.zip_longest(axes.flat, names):
        if task is None:
            axis.set_visible(False)
            continue
        for k, name in enumerate(ALGORITHMS):
            runs = [v["curve"] for key, v in found.items() if key.startswith(f"{name}_{task}_")]
            for j, run in enumerate(runs):
                x, y, _ = np.array(run).T
                axis.plot(1e-3 * x, y, color=PALETTE[k], lw=0.9, label=name if not j else None)
        for name, style in ((COMBINATOR, "--"), ("va-pitch", ":"), (TUNED, "-.")):
            values = episodes_of(task, name, "", found)
            if len(values):
                axis.axhline(values.mean(), color="black", lw=0.8, ls=style, label=name)
        axis.set_title(task, fontsize=9, loc="left")
        axis.tick_params(labelsize=7)
    axes.flat[0].legend(fontsize=6, frameon=False)
    for axis in axes[-1]:
        axis.set_xlabel("control intervals [thousand]", fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("return", fontsize=8)
    return figure


_TEXT = """\
The learners are those of stable-baselines3 and sb3-contrib with their default hyperparameters and
default policies (`MlpPolicy`, `MlpLstmPolicy`), from scratch, on
`gymnasium.make("shaftline/Frigate-v0", task=TASK)` (`Steering-v0` for the steered tasks): one
environment, default keywords, no base controller. Each is a mean over its trainings; none is chosen.
Returns are sums of rewards over 600 intervals, so 600 is the most that the reward allows; {episodes}
episodes from seed {first}, which no training draws. In brackets, where the bound of a task is known,
the **score**: 0 is the combinator, 1 the clairvoyant bound.

`hold` never changes the first commands; `best constant` is the best of 81 constant commands, chosen on
8 other episodes; `random` draws increments evenly. `tuned controller` is the best classic law that
`shaftline tune` found for the task."""

_BOUND_TEXT = """\
A plan knows the waves and the resistance that come, but an order only from when it is given. [How it is
made](../evaluate.md#the-bound). Plans of {n} episodes, {steps} intervals each, start from the commands
of {starts}. The best of them, episode by
episode, gains so much over the tuned controller in the same episodes; the bound is the return of the
tuned controller in the {episodes} episodes of the tables and that gain. The spread is the best less the
worst, a measure of how far the local optima differ. The true bound may lie higher."""


_RECIPE_TEXT = """\
`ppo-recipe` is PPO from scratch as well, with increments and no base controller, but with the
hyperparameters of the package's recipes, the same in all tasks: {text}. They were searched for once, in
trainings of other seeds. Its learning curves are interquartile means."""


def _hyperparameters(tasks: list[str]) -> dict[str, str]:
    recipe = from_nothing(tasks[0], {})
    given = {"n_envs": recipe.n_envs, **recipe.hyperparameters}
    return {"text": ", ".join(f"`{key}` {value}" for key, value in given.items())}


def write(folder: Path, names: list[str], found: dict[str, Any]) -> Path:
    """Write page, table and figure.

    Args:
        folder: of the results.
        names: tasks; those that the combinator has not been run on are left out.
        found: results by name of their cells.
    """
    names = [task for task in names if len(episodes_of(task, COMBINATOR, "", found))]
    table = table_of(names, found)
    learned = [
        task for task in names if any(len(episodes_of(task, a, "", found)) for a in ALGORITHMS)
    ]
    save(curves(learned, found), folder / "figures" / "learners.png")
    budget: dict[str, set[int]] = {}
    for key in found:
        algorithm = key.split("_")[0]
        if algorithm in ALGORITHMS:
            budget.setdefault(algorithm, set()).add(int(key.split("_")[-1]))
    steps = ", ".join(f"{name} {max(counts):,}" for name, counts in budget.items())
    parts = [
        _TEXT.format(episodes=EPISODES, first=FIRST_SEED) + f" Control intervals: {steps}.",
        "## Seas of the training", markdown(_wide(table, names, "")),
        "## Learners against classic controllers",
        "95 % intervals are over trainings and episodes together; a gain counts where its interval lies "
        "above zero.",
        markdown(_targets(table, names, DEFAULT_LEARNERS)),
        "![Learning curves](figures/learners.png)",
        "## Held-out seas", markdown(_wide(table, names, f":{HELD_OUT}")),
    ]  # fmt: skip
    if RECIPE in budget:
        parts += [
            "## Hyperparameters searched once", _RECIPE_TEXT.format(**_hyperparameters(learned)),
            markdown(_targets(table, names, [RECIPE])),
        ]  # fmt: skip
    if any(bound_of(task, found) for task in names):
        starts = ", ".join(f"`{start}`" for start in STARTS)
        text = _BOUND_TEXT.format(steps=STEPS, n=PLANNED, starts=starts, episodes=EPISODES)
        parts += ["## Bounds", text, markdown(_bounds(names, found))]
    write_table(folder, "learners", "Standard learners", COMMAND, table, "\n\n".join(parts))
    return folder / "learners.md"
