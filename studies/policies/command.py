"""Learned policies against classic controllers: page, tables, figures and model cards.

Run ``python -m shaftline.studies.policies --out docs/results/policies``. What is sailed is kept in the
folder's ``cells``, so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ...agents.policy.policy import PolicyError, load_policy, trained
from ...core.sweep import SweepError
from ...envs.tasks import HELD_OUT, get_task
from . import cards, page
from .comparison import BASELINES, Comparison, compare
from .targets import verdicts


def sources(tasks: list[str], files: list[Path]) -> dict[str, Path]:
    """Policy files by task: those given, else those that come with the package.

    Args:
        tasks: that are asked for.
        files: policies on trial; each belongs to the task it was trained on.

    Raises:
        PolicyError: a file that holds no policy, or one for a task that is not compared here.
    """
    if not files:
        return {task: path for task, path in trained().items() if task in tasks}
    found = {}
    for file in files:
        task = load_policy(file).about["recipe"]["task"]
        if task not in BASELINES:
            raise PolicyError(f"{file}: made for {task!r}; compared are {', '.join(BASELINES)}")
        found[task] = file
    return found


def main(arguments: list[str] | None = None) -> None:
    """Sail, compare, and write."""
    parser = argparse.ArgumentParser(
        "python -m shaftline.studies.policies", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/policies"), help="folder")
    add("--task", nargs="+", choices=list(BASELINES), default=list(BASELINES), help="tasks")
    add("--seeds", type=int, default=100, help="episodes a sea")
    add("--episode-s", type=float, default=300.0, help="length of an episode [s]")
    add("--policy", type=Path, action="append", default=[],
        help="policy file on trial, in place of the packaged ones; repeatable")  # fmt: skip
    add("--cards", action="store_true", help="write a model card beside each policy file")
    add("--jobs", type=int, help="processes; one a core by default")
    options = parser.parse_args(arguments)
    if options.seeds < 1 or not options.episode_s > 0.0:
        parser.error("--seeds and --episode-s must be above zero")
    try:
        found = sources(options.task, options.policy)
        comparisons: list[Comparison] = []
        for task in options.task:
            if task not in found:
                print(f"{task}: no policy to compare; left out")
                continue
            count = (1 + len(BASELINES[task])) * len(get_task(f"{task}:{HELD_OUT}").seas)
            print(f"{task}: {found[task]}, {count} cells of {options.seeds} episodes", flush=True)
            comparisons.append(
                compare(task, found[task], options.out / "cells", seeds=options.seeds,
                        episode_s=options.episode_s, jobs=options.jobs,
                        tick=lambda: print(".", end="", flush=True))
            )  # fmt: skip
            print()
    except (PolicyError, SweepError) as error:
        parser.exit(1, f"{error}\n")
    if not comparisons:
        parser.exit(1, "no policy to compare\n")
    differences = page.write(options.out, comparisons)
    print("\n".join(verdicts(differences)))
    print(f"page: {options.out / 'policies.md'}")
    if options.cards:
        for one in comparisons:
            print(f"card: {cards.write(one, differences)}")


if __name__ == "__main__":
    main()
