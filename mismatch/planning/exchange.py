"""Coordinate exchange: improve a design by changing one of its values at a time.

Meyer and Nachtsheim 1995, Technometrics 37(1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..estimate import Tick, ignore_progress
from .manoeuvres import Floats

SWEEPS, BETTER = 2, 1.02
"""Largest number of exchanges of each value, and factor on the merit from which another follows."""


def exchange(
    levels: Floats,
    choices: Mapping[int, Floats],
    merit_of: Callable[[Floats], float],
    *,
    sweeps: int = SWEEPS,
    better: float = BETTER,
    tick: Tick = ignore_progress,
) -> tuple[Floats, float]:
    """Return a design in which no change of a single value that was tried increases the merit.

    Args:
        levels: value of each input (row) in each interval, shape (inputs, intervals).
        choices: values that are tried for an input, by its row; other rows stay as they are.
        merit_of: figure that is made as large as possible; -inf outside the limits.
        sweeps: largest number of exchanges of each value.
        better: factor on the merit from which another sweep follows.
        tick: progress callback.

    Returns:
        The design, and its merit.

    Examples:
        >>> import numpy as np
        >>> choices = {0: np.array([0.0, 1.0])}
        >>> found, merit = exchange(np.zeros((1, 2)), choices, lambda x: x[0, 0] - x[0, 1])
        >>> found.tolist(), float(merit)
        ([[1.0, 0.0]], 1.0)
    """
    levels = levels.copy()
    best = merit_of(levels)
    places = [(row, column) for row in choices for column in range(levels.shape[1])]
    for sweep in range(sweeps):
        start = best
        for done, (row, column) in enumerate(places):
            tick(f"exchanging commands, round {sweep + 1}", done, len(places))
            for level in choices[row]:
                if level == levels[row, column]:
                    continue
                trial = levels.copy()
                trial[row, column] = level
                if (merit := merit_of(trial)) > best:
                    levels, best = trial, merit
        if not best > better * start:
            break
    return levels, best
