"""Train the standard learners, compare them with classic controllers and bounds, and write the page.

Run ``python -m reproductions learners --out docs/results --kept out/learners``. Every training, plan and
reference is kept in the folder ``--kept``. ``--page-only`` writes the page from these results.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from shaftline.agents.evaluation.scores import Bound, bounds_file
from shaftline.agents.evaluation.statistics import mean_with_interval
from shaftline.core.files import read_json, write_json
from shaftline.core.sweep import SweepError, sweep
from shaftline.display.figures import PALETTE, new_figure, save
from shaftline.display.tables import write_table
from shaftline.envs import DEFAULTS, tasks
from shaftline.envs.tasks import HELD_OUT

from ..pages import fill_template, make_parser, print_dot
from ..policies.trainings import from_nothing
from . import bounds
from .bounds import EPISODES as PLANNED
from .bounds import STARTS, STEPS
from .references import (
    BLIND,
    CONTROLLERS,
    EPISODES,
    FIRST_SEED,
    PREVIEWING,
    TUNED,
    names_of,
    reference_cell,
)
from .trainings import ALGORITHMS, DEFAULT_LEARNERS, RECIPE, Learner, train_cell

COMBINATOR = CONTROLLERS[0]
UNTUNED = CONTROLLERS[1:]
TITLE = "Standard learners on the tasks"
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


def trainings_of(
    task: str, name: str, found: dict[str, Any]
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield control intervals and result of each training of a learner on a task."""
    for key, cell in found.items():
        if key.startswith(f"{name}_{task}_"):
            yield int(key.rpartition("_")[-1]), cell


def episodes_of(task: str, name: str, part: str, found: dict[str, Any]) -> NDArray[np.float64]:
    """Return episode returns of shape (trainings, episodes); no row without results."""
    if name in ALGORITHMS:
        rows = [
            cell[part]["values"]
            for steps, cell in trainings_of(task, name, found)
            if steps == INTERVALS[name]
        ]
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
        mean, low, high = mean_with_interval(values)
        gain, gain_low, gain_high = mean_with_interval(values - base)
        bound = known[task]
        steps = DEFAULTS.max_episode_steps or 1
        rows.append(
            {
                "task": f"{task}{part}",
                "controller": name,
                "trainings": len(values),
                "return": mean,
                "return_low": low,
                "return_high": high,
                "gain": gain,
                "gain_low": gain_low,
                "gain_high": gain_high,
                "score": np.nan if bound is None or part else bound.score(mean / steps),
            }
        )
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


def _gain_words(mean: float, low: float, high: float) -> tuple[str, str]:
    """Return a gain over the combinator with its interval, and whether it is above zero."""
    decided = "yes" if low > 0.0 else "no" if high < 0.0 else "not decided"
    return f"{mean:+.0f} ({low:+.0f} to {high:+.0f})", decided


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
            (
                task,
                name,
                int(one["trainings"]),
                *_gain_words(one["gain"], one["gain_low"], one["gain_high"]),
                f"{classic.idxmax()} {classic.max():.0f}",
                "yes" if one["return_low"] > classic.max() else "no",
            )
        )
    return pd.DataFrame(
        rows,
        columns=[
            "task",
            "learner",
            "trainings",
            "return less the combinator's",
            "beats it",
            "best untuned classic controller",
            "beats it too",
        ],
    )


def shorter_trainings(names: list[str], found: dict[str, Any]) -> pd.DataFrame:
    """Return a row for each training with fewer control intervals than :data:`INTERVALS`."""
    rows = []
    for task, name in itertools.product(names, ALGORITHMS):
        for steps, cell in trainings_of(task, name, found):
            if steps >= INTERVALS[name]:
                continue
            values = np.array(cell[""]["values"])
            base = episodes_of(task, COMBINATOR, "", found)[0]
            rows.append(
                (
                    task,
                    name,
                    steps,
                    f"{cell['curve'][0][1]:.0f}",
                    f"{values.mean():.0f}",
                    *_gain_words(*mean_with_interval((values - base)[None])),
                )
            )
    return pd.DataFrame(
        rows,
        columns=[
            "task",
            "learner",
            "control intervals",
            "return before",
            "return",
            "return less the combinator's",
            "beats it",
        ],
    )


def _bounds(names: list[str], found: dict[str, Any]) -> pd.DataFrame:
    rows = []
    for task in names:
        bound = bound_of(task, found)
        if bound is not None:
            returns = (DEFAULTS.max_episode_steps or 1) * np.array(bound)
            rows.append((task, *returns.round(1), round(100.0 * (1.0 - bound.score(bound.tuned)))))
    return pd.DataFrame(
        rows,
        columns=[
            "task",
            "combinator",
            "tuned controller",
            "bound",
            "spread of the starts",
            "gap of the tuned controller [% of the score]",
        ],
    )


def curves(names: list[str], found: dict[str, Any]) -> Figure:
    """Draw the return over the steps of each training, task by task."""
    rows = -(-len(names) // _ACROSS)
    figure, axes = new_figure(rows, _ACROSS, (11.0, 2.6 * rows))
    for axis, task in itertools.zip_longest(axes.flat, names):
        if task is None:
            axis.set_visible(False)
            continue
        for k, name in enumerate(ALGORITHMS):
            runs = [cell["curve"] for _, cell in trainings_of(task, name, found)]
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


def write(folder: Path, names: list[str], found: dict[str, Any]) -> Path:
    """Write page, table and figure."""
    names = [task for task in names if len(episodes_of(task, COMBINATOR, "", found))]
    table = table_of(names, found)
    learned = [task for task in names if any([*trainings_of(task, a, found)] for a in ALGORITHMS)]
    save(curves(learned, found), folder / "figures" / "learners.png")
    budget = [name for name in ALGORITHMS if any(key.startswith(f"{name}_") for key in found)]
    steps = ", ".join(f"{name} {INTERVALS[name]:,}" for name in budget)
    recipe = from_nothing(learned[0], {}) if RECIPE in budget else None
    body = fill_template(
        Path(__file__).with_name("page.md"),
        episodes=EPISODES,
        first=FIRST_SEED,
        steps=steps,
        table=_wide(table, names, ""),
        targets=_targets(table, names, DEFAULT_LEARNERS),
        held_out=_wide(table, names, f":{HELD_OUT}"),
        recipe=recipe,
        recipe_targets=_targets(table, names, [RECIPE]),
        bounds=_bounds(names, found),
        short=shorter_trainings(names, found),
        planned=PLANNED,
        plan_steps=STEPS,
        starts=STARTS,
    )
    write_table(folder, "learners", TITLE, COMMAND, table, body)
    return folder / "learners.md"


INTERVALS = {
    "ppo": 300_000,
    "recurrent-ppo": 300_000,
    "sac": 50_000,
    "td3": 50_000,
    RECIPE: 1_000_000,
}
"""Control intervals of a training."""


def learners(
    algorithms: list[str], names: list[str], seeds: int, folder: Path, steps: int | None = None
) -> list[Learner]:
    """Return all trainings, seed by seed, so that an interrupted run covers every task."""
    return [
        Learner(task, algorithm, seed, steps or INTERVALS[algorithm], str(folder / "policies"))
        for seed in range(1, seeds + 1)
        for algorithm in algorithms
        for task in names
    ]


def main(arguments: list[str] | None = None) -> None:
    """Compute the missing results, and write the page."""
    folder = "out/learners"
    parser = make_parser("learners", __doc__, f"{folder}/page", kept=folder, jobs=None)
    add = parser.add_argument
    add("--task", nargs="+", choices=list(tasks(None)), default=list(tasks(None)), help="tasks")
    add("--algorithm", nargs="*", choices=ALGORITHMS, default=list(ALGORITHMS), help="learners")
    add(
        "--steps",
        type=int,
        help="control intervals of a training; the page lists shorter ones apart",
    )
    add("--seeds", type=int, default=5, help="trainings of each learner on each task")
    add("--no-plans", action="store_true", help="no clairvoyant bounds")
    add("--page-only", action="store_true", help="compute nothing, write the page")
    add("--package", action="store_true", help="keep the bounds in the package, for scores")
    options = parser.parse_args(arguments)
    kept, jobs = options.kept, options.jobs
    compared = {
        f"reference_{task}_{name.replace(' ', '-')}": (task, name)
        for task in options.task
        for name in names_of(task)
    }
    trainings = {
        one.name: one
        for one in learners(options.algorithm, options.task, options.seeds, kept, options.steps)
    }
    planned = [task for task in options.task if task in tasks() and not options.no_plans]
    plans = {key: cell for task in planned for key, cell in bounds.cells(task).items()}
    try:
        if not options.page_only:
            sweep(reference_cell, compared, kept, jobs=jobs, tick=print_dot)
            sweep(
                bounds.same_episodes,
                {f"same_{t}": t for t in planned},
                kept,
                jobs=jobs,
                tick=print_dot,
            )
            sweep(train_cell, trainings, kept, jobs=jobs, tick=print_dot)
            sweep(bounds.plan_cell, plans, kept, jobs=jobs, tick=print_dot)
            print()
    except SweepError as error:
        parser.exit(1, f"{error}\n")
    found = {file.stem: read_json(file) for file in sorted(kept.glob("*.json"))}
    print(f"page: {write(options.out, options.task, found)}")
    if options.package:
        known = {task: bound._asdict() for task in tasks() if (bound := bound_of(task, found))}
        write_json(bounds_file(), known)
        print(f"bounds: {bounds_file()}")
