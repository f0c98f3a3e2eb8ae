"""Score of a return: 0 is the combinator, 1 the clairvoyant bound of the task.

``python -m reproductions.learners`` computes the bounds of the tasks and writes them to ``bounds.json``.
They hold for the ship and the seas of each task.
"""

from __future__ import annotations

import functools
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from ...core.files import read_json


class Bound(NamedTuple):
    """Clairvoyant bound of a task, in return per control interval.

    Examples:
        >>> Bound(combinator=0.5, tuned=0.75, best=1.0, spread=0.0).score(0.75)
        0.5
    """

    combinator: float  # mean return of the combinator over the evaluation episodes
    tuned: float  # mean return of the tuned controller over the same episodes
    best: (
        float  # that of the tuned controller plus the gain of the best plan in the planned episodes
    )
    spread: float  # mean difference between the best and the worst plan of a controller

    def score(self, mean: float) -> float:
        """Return the score of a mean return per interval."""
        return (mean - self.combinator) / (self.best - self.combinator)


def bounds_file() -> Path:
    """Return the path of the file of bounds."""
    return Path(str(resources.files("shaftline.agents.evaluation").joinpath("bounds.json")))


@functools.cache
def bounds() -> dict[str, Bound]:
    """Return the known bounds by task.

    Examples:
        >>> bounds()["storm"].best > bounds()["storm"].tuned
        True
    """
    file = bounds_file()
    return {task: Bound(**row) for task, row in read_json(file).items()} if file.is_file() else {}
