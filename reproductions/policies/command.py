"""Train, judge and write the page of the package's policies.

Run ``python -m reproductions policies --out docs/results --kept out/policies``. Trainings and
episodes are kept in the folder ``--kept``; a run that was interrupted resumes there. ``--package`` puts
the first training of each task into the package, with its card.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from shaftline.agents.learning.imitation import make_plans
from shaftline.agents.learning.recipe import read_recipe
from shaftline.agents.policy.card import card
from shaftline.agents.policy.policy import load_policy, trained_folder
from shaftline.core.files import read_json, write_text
from shaftline.core.sweep import SweepError, sweep
from shaftline.envs import get_task, tasks

from . import page
from .trainings import classic_cell, policy_cell


def main(arguments: list[str] | None = None) -> None:
    """Run what is asked for, and write the page."""
    parser = argparse.ArgumentParser(
        "python -m reproductions policies", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/policies/page"), help="folder of the page")
    add("--kept", type=Path, default=Path("out/policies"), help="folder of trainings and episodes")
    add("--task", nargs="+", choices=list(tasks(None)), default=list(tasks(None)), help="tasks")
    add("--seeds", type=int, default=1, help="trainings for each task")
    add("--page-only", action="store_true", help="compute nothing, write the page")
    add(
        "--package",
        action="store_true",
        help="put the first training of each task into the package",
    )
    add("--jobs", type=int, help="processes; one for each core by default")
    options = parser.parse_args(arguments)

    def tick() -> None:
        print(".", end="", flush=True)

    kept = options.kept
    classic = {
        f"classic_{task}_{name}".replace(" ", "-"): (task, name)
        for task in options.task
        for name in page.CLASSIC
    }
    policies = {
        f"policy_{task}_{seed}": (task, seed, kept)
        for seed in range(1, options.seeds + 1)
        for task in options.task
    }
    try:
        if not options.page_only:
            sweep(classic_cell, classic, kept, jobs=options.jobs, tick=tick)
            for task in options.task:
                recipe = read_recipe("ppo", task)
                make_plans(recipe, get_task(task).vessel, kept / "plans", options.jobs, tick)
            sweep(policy_cell, policies, kept, jobs=options.jobs, tick=tick)
            print()
    except SweepError as error:
        parser.exit(1, f"{error}\n")
    found = {file.stem: read_json(file) for file in sorted(kept.glob("*.json"))}
    print(f"page: {page.write(options.out, found)}")
    if options.package:
        for task in options.task:
            print(f"packaged: {package(task, kept)}")


def package(task: str, kept: Path) -> Path:
    """Put the first training of a task into the package, with its card; returns the file.

    Args:
        task: name.
        kept: folder of trainings and episodes.
    """
    place = trained_folder() / f"{task}.npz"
    shutil.copyfile(kept / "trainings" / f"{task}-1" / "policy.npz", place)
    rows = {"policy": page.means(read_json(kept / f"policy_{task}_1.json"))}
    for name in page.CLASSIC:
        rows[name] = page.means(read_json(kept / f"classic_{task}_{name.replace(' ', '-')}.json"))
    write_text(place.with_suffix(".md"), card(task, load_policy(place), rows, page.NOTES))
    return place
