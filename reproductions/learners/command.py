"""Train, plan, compare and write the page of the standard learners.

Run ``python -m reproductions learners --out docs/results --kept out/learners``. Every training, plan
and reference is kept in the folder ``--kept``; a run that was interrupted resumes there. ``--page-only``
writes the page from what stands there.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from shaftline.agents.evaluation.scores import bounds_file
from shaftline.core.files import read_json, write_json
from shaftline.core.sweep import SweepError, sweep
from shaftline.envs import tasks

from . import bounds, page
from .references import names_of, reference_cell
from .trainings import ALGORITHMS, RECIPE, Learner, train_cell

STEPS = {"ppo": 300_000, "recurrent-ppo": 300_000, "sac": 50_000, "td3": 50_000, RECIPE: 1_000_000}
"""Control intervals of a training."""


def learners(algorithms: list[str], names: list[str], seeds: int, folder: Path) -> list[Learner]:
    """Return all trainings, seed by seed, so that an interrupted run covers every task."""
    return [
        Learner(task, algorithm, seed, STEPS[algorithm], str(folder / "policies"))
        for seed in range(1, seeds + 1)
        for algorithm in algorithms
        for task in names
    ]


def main(arguments: list[str] | None = None) -> None:
    """Run what is asked for, and write the page."""
    parser = argparse.ArgumentParser(
        "python -m reproductions learners", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/learners/page"), help="folder of the page")
    add("--kept", type=Path, default=Path("out/learners"), help="folder of trainings and plans")
    add("--task", nargs="+", choices=list(tasks(None)), default=list(tasks(None)), help="tasks")
    add("--algorithm", nargs="*", choices=ALGORITHMS, default=list(ALGORITHMS), help="learners")
    add("--seeds", type=int, default=5, help="trainings of each learner on each task")
    add("--no-plans", action="store_true", help="no clairvoyant bounds")
    add("--page-only", action="store_true", help="compute nothing, write the page")
    add("--package", action="store_true", help="keep the bounds in the package, for scores")
    add("--jobs", type=int, help="processes; one for each core by default")
    options = parser.parse_args(arguments)

    def tick() -> None:
        print(".", end="", flush=True)

    kept, jobs = options.kept, options.jobs
    compared = {
        f"reference_{task}_{name.replace(' ', '-')}": (task, name)
        for task in options.task
        for name in names_of(task)
    }
    trainings = {
        one.name: one for one in learners(options.algorithm, options.task, options.seeds, kept)
    }
    planned = [task for task in options.task if task in tasks() and not options.no_plans]
    plans = {key: cell for task in planned for key, cell in bounds.cells(task).items()}
    try:
        if not options.page_only:
            sweep(reference_cell, compared, kept, jobs=jobs, tick=tick)
            sweep(
                bounds.same_episodes, {f"same_{t}": t for t in planned}, kept, jobs=jobs, tick=tick
            )
            sweep(train_cell, trainings, kept, jobs=jobs, tick=tick)
            sweep(bounds.plan_cell, plans, kept, jobs=jobs, tick=tick)
            print()
    except SweepError as error:
        parser.exit(1, f"{error}\n")
    found = {file.stem: read_json(file) for file in sorted(kept.glob("*.json"))}
    print(f"page: {page.write(options.out, options.task, found)}")
    if options.package:
        known = {task: bound._asdict() for task in tasks() if (bound := page.bound_of(task, found))}
        write_json(bounds_file(), known)
        print(f"bounds: {bounds_file()}")
