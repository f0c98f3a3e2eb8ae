"""Changes tried in several scratch trees at once."""

from __future__ import annotations

import queue
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from .report import Outcome
from .rests import Rests
from .sample import Mutant
from .tree import Tree
from .worker import PASSED, TIMED_OUT

NO_TESTS = 5  # pytest's code
COMPILING_S = 150.0  # for the kernels that rest on a change


class TestsFailError(RuntimeError):
    """The tests fail without a change; says which."""


def try_all(root: Path, mutants: list[Mutant], jobs: int) -> Iterator[Outcome]:
    """Outcomes in the order in which they are found.

    Args:
        root: of the repository.
        mutants: changes to try.
        jobs: how many at once, each in a scratch tree of its own.

    Raises:
        TestsFailError: there is nothing to be learned from tests that fail anyway.
    """
    rooms = sorted({init.parent.name for init in root.glob("*/__init__.py")} - {"tests"})
    files = [file for room in rooms for file in (root / room).rglob("*.py")]
    rests = Rests(root, [file.relative_to(root).as_posix() for file in files])
    pool = ThreadPoolExecutor(jobs)
    trees: list[Tree] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as scratch:
        try:
            trees += [Tree(root, Path(scratch) / "0", rooms, rests)]
            seconds = unchanged(trees[0], sorted({test for m in mutants for test in m.tests}))
            for i in range(1, jobs):  # with what the first has compiled
                trees += [Tree(trees[0].root, Path(scratch) / str(i), rooms, rests)]
            free: queue.SimpleQueue[Tree] = queue.SimpleQueue()
            for tree in trees:
                free.put(tree)

            def tried_in_one(mutant: Mutant) -> Outcome:
                tree = free.get()
                try:
                    return tried(tree, mutant, seconds)
                finally:
                    free.put(tree)

            for future in as_completed([pool.submit(tried_in_one, m) for m in mutants]):
                yield future.result()
        finally:
            for tree in trees:
                tree.close()
            pool.shutdown(cancel_futures=True)


def unchanged(tree: Tree, tests: list[str]) -> dict[str, float]:
    """Seconds by test file of the tree as it is, whose kernels are compiled on the way."""
    found = tree.test(tests, 3600.0, changed=False)
    if found["code"] != PASSED:
        raise TestsFailError(
            "\n".join(found["failed"].splitlines()[:1] + found["failed"].splitlines()[-20:])
        )
    return dict(found["seconds"])


def tried(tree: Tree, mutant: Mutant, seconds: dict[str, float]) -> Outcome:
    """Make one change and run its tests, the nearest file first and then the quickest."""
    nearest, *others = mutant.tests
    tests = [nearest, *sorted(others, key=lambda test: seconds.get(test, 0.0))]
    limit_s = COMPILING_S + 5.0 * sum(seconds.get(test, 0.0) for test in tests)
    began = time.monotonic()
    with tree.with_change(mutant.file, mutant.change):
        found = tree.test(tests, limit_s)
    if found["code"] == NO_TESTS:
        raise TestsFailError(f"{mutant.file}: {', '.join(tests)} hold no tests")
    by = "takes for ever" if found["code"] == TIMED_OUT else found["failed"].split("\n")[0]
    return Outcome(mutant, found["code"] != PASSED, by, round(time.monotonic() - began, 1))
