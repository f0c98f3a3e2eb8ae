"""The score of a return: 0 is the combinator, 1 the clairvoyant bound of the task.

The bounds of the package's tasks are in ``bounds.json``, written by ``python -m
reproductions.learners``. They hold for the task's own ship and seas.
"""

from __future__ import annotations

import functools
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from ...core.files import read_json


class Bound(NamedTuple):
    """Clairvoyant bound of a task, in return per control interval."""

    combinator: float
    """Mean of the combinator over the episodes that judge controllers."""
    tuned: float
    """Mean of the tuned controller over the same episodes."""
    best: float
    """The latter, and what the best plan gains over it in the planned episodes."""
    spread: float
    """Mean over the planned episodes of the best plan less the worst, of the starts."""

    def score(self, mean: float) -> float:
        """Return the score of a mean return per interval."""
        return (mean - self.combinator) / (self.best - self.combinator)


def bounds_file() -> Path:
    """Return the file of the bounds."""
    return Path(str(resources.files("shaftline.agents.evaluation").joinpath("bounds.json")))


@functools.cache
def bounds() -> dict[str, Bound]:
    """Return the known bounds by task."""
    file = bounds_file()
    return {task: Bound(**row) for task, row in read_json(file).items()} if file.is_file() else {}
