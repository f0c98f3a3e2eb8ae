"""Learned policies against classic controllers: page, tables, figures and model cards.

Run ``python -m shaftline.studies.policies --trained out/policies --out docs/results/policies``. The
folder of trainings holds ``TASK/seed-K/policy.npz`` as ``shaftline train`` writes them; without one, the
policies that come with the package are compared. What is sailed and planned is kept, so an interrupted
run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import functools
import shutil
from pathlib import Path

from ...agents.policy.policy import PolicyError, load_policy, trained
from ...core.files import write_atomically, write_text
from ...core.sweep import SweepError
from ...envs.tasks import tasks
from . import page
from .bound import bound
from .comparison import Comparison, compare


def sources(folder: Path | None) -> dict[str, list[Path]]:
    """Policy files by task, in the order of their seeds.

    Raises:
        PolicyError: a file that holds no policy, or one of another task than its folder says.
    """
    if folder is None:
        return {name: [path] for name, path in trained().items()}
    found: dict[str, list[Path]] = {}
    for task in tasks():
        files = list((folder / task).glob("seed-*/policy.npz"))
        for file in files:
            own = load_policy(file).about["recipe"]["task"]
            if own != task:
                raise PolicyError(f"{file}: made for {own!r}, not for {task!r}")
        if files:
            found[task] = sorted(files, key=lambda f: int(f.parent.name.removeprefix("seed-")))
    return found


def main(arguments: list[str] | None = None) -> None:
    """Sail, plan, compare, and write."""
    parser = argparse.ArgumentParser(
        "python -m shaftline.studies.policies", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/policies-page"), help="folder")
    add(
        "--trained",
        type=Path,
        help="folder of trainings, TASK/seed-K/policy.npz; the packaged ones by default",
    )
    add(
        "--kept",
        type=Path,
        default=Path("out/policies-page"),
        help="folder of what is sailed and planned",
    )
    add("--task", nargs="+", choices=list(tasks()), default=list(tasks()), help="tasks")
    add("--seeds", type=int, default=60, help="episodes")
    add("--plans", type=int, default=6, help="clairvoyant plans a task; 0 for none")
    add(
        "--package",
        type=Path,
        help="folder for the first training's policy of each task, with its card",
    )
    add("--jobs", type=int, help="processes; one a core by default")
    options = parser.parse_args(arguments)
    if options.seeds < 1 or options.plans < 0:
        parser.error("--seeds must be above zero, --plans 0 or more")
    comparisons: list[Comparison] = []
    bounds = {}

    def tick() -> None:
        print(".", end="", flush=True)

    try:
        for task, files in sources(options.trained).items():
            if task not in options.task:
                continue
            print(f"{task}: {len(files)} trainings, {options.seeds} episodes", flush=True)
            comparisons.append(
                compare(
                    task,
                    files,
                    options.kept / "cells",
                    seeds=options.seeds,
                    jobs=options.jobs,
                    tick=tick,
                )
            )
            if options.plans:
                bounds[task] = bound(
                    task,
                    files[0],
                    options.kept / "plans",
                    seeds=options.plans,
                    jobs=options.jobs,
                    tick=tick,
                )
            print()
    except (PolicyError, SweepError) as error:
        parser.exit(1, f"{error}\n")
    if not comparisons:
        parser.exit(1, "no policy to compare\n")
    page.write(options.out, comparisons, bounds)
    print(f"page: {options.out / 'policies.md'}")
    if options.package:
        for one in comparisons:
            first = one.sources[0]
            target = options.package / f"{one.task}.npz"
            write_atomically(target, functools.partial(shutil.copyfile, first))
            write_text(target.with_suffix(".md"), page.card(one, first))
            print(f"packaged: {target}")


if __name__ == "__main__":
    main()
