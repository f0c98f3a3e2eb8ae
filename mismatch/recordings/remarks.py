"""Remarks on a recording that is usable: rectified channels, leads and lags, and quantisation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, answered_columns, drive_column
from ...plant.ship import Ship
from .load import Recording
from .rectified import rectified_remark
from .slips import demands
from .timing import timing_remarks
from .yardstick import Yardstick

_LEVELS = 8
_RECURS = 1.5  # rows for each level, at least
_COARSE = 1e-3  # share of a channel's range from which its step is worth a remark
_OFF_GRID = 0.08  # of a step
_ON_GRID = 0.98  # share of the levels


def remarks(recording: Recording, ship: Ship) -> Iterator[str]:
    """Yield remarks on what is odd in a recording, with numbers; nothing is changed.

    Args:
        recording: as it would be diagnosed.
        ship: the nominal ship, which is simulated with the recording's commands.
    """
    table = recording.table
    reference = Yardstick(ship, table, recording.interval_s, recording.steady)
    simulated = reference.sailed
    orders = demands(ship, table)
    measured = [c for c in answered_columns(ship) if c in table and c not in orders]
    rectified = []
    for column in measured:
        noise = recording.noise[column].white_rms if column in recording.noise else 0.0
        if said := rectified_remark(table, simulated, column, drive_column(ship), noise):
            rectified.append(column)
            yield said
    compared = [
        c for c in measured if c not in rectified and simulated is not None and c in simulated
    ]
    if not recording.steady:
        yield from timing_remarks(reference.table, simulated, compared, recording.interval_s)
    for column in (*orders, *measured):
        if said := quantisation_remark(column, table[column].to_numpy(dtype=float)):
            yield said


def quantisation_remark(column: str, values: NDArray[Any]) -> str:
    """Return a remark on a column whose values lie on a coarse grid; empty where they do not.

    Args:
        column: canonical.
        values: (n,) in its unit.
    """
    step, levels = grid(values)
    span = float(np.ptp(values))
    if not step > _COARSE * span:
        return ""
    return (
        f"{column} is quantised: it comes in steps of {step:.4g} {BOUNDS[column][2]} "
        f"({step / span:.2%} of its range, {levels} levels)"
    )


def grid(values: NDArray[Any]) -> tuple[float, int]:
    """Return the step of a grid on which values lie, and how many levels they take; (0, 0) if none.

    The file may have rounded the levels. A column counts only where its levels recur, and where there
    are enough of them: a command that is switched between three values is not quantised.
    """
    levels = np.unique(values)
    if not _LEVELS <= len(levels) <= len(values) / _RECURS:
        return 0.0, 0
    apart = np.diff(levels)
    step = float(np.quantile(apart, 0.1))
    for _ in range(5):
        counts = np.round(apart / step)
        near = (counts >= 1) & (counts <= 10)
        if not near.any():
            return 0.0, 0
        step = float(apart[near].sum() / counts[near].sum())
    off = np.abs(apart / step - np.maximum(1.0, np.round(apart / step)))
    few = np.round(apart / step) <= 10
    return (step, len(levels)) if np.mean(off[few] < _OFF_GRID) >= _ON_GRID else (0.0, 0)
