"""First states of recordings that are not fitted, estimated from their first rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .model import Floats, Model

if TYPE_CHECKING:
    from .output_error import OutputError

FIRST_ROWS = 100
"""Rows from which the first state of a held-out recording is estimated, at most."""

STEP = 0.3
"""Finite difference of a first state, in deviations."""


def with_first_states(problem: OutputError, model: Model) -> Floats:
    """Return a model's nuisance values with the first states of recordings that are not fitted.

    They are estimated from those recordings' first rows: what a lagging instrument measures first is
    not the ship's state.

    Args:
        problem: fit of the recordings.
        model: fitted.
    """
    nuisance = model.nuisance.copy()
    for run, (a, b) in enumerate(problem.replay.segments):
        every = range(problem.states * run, problem.states * (run + 1))
        own = [k for k in every if problem.starts[k] > 0.0]
        if not own or np.any((problem.rows >= a) & (problem.rows < b)):
            continue
        first = slice(0, max(2, min(FIRST_ROWS, (b - a) // 4)))
        for _ in range(3):
            here = problem.channels_of_run(run, model.effects, model.shifts, nuisance)
            columns = []
            for k in own:
                moved = nuisance.copy()
                moved[k] += STEP
                there = problem.channels_of_run(run, model.effects, model.shifts, moved)
                columns.append(((there - here)[:, first] / STEP).ravel())
            lacking = (problem.measured[:, a : a + first.stop] - here[:, first]).ravel()
            if not np.isfinite(columns).all() or not np.isfinite(lacking).all():
                break
            nuisance[own] += np.linalg.lstsq(np.transpose(columns), lacking, rcond=1e-9)[0]
    return nuisance
