"""Leads and lags: of a channel against the simulation, and of a channel against its own derivative.

Remarks on a recording that is usable: rectified channels, leads and lags, and quantisation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import (
    BOUNDS,
    HEADING,
    SHAFT_ANGLE,
    SHAFT_SPEED,
    YAW_RATE,
    answered_columns,
    drive_column,
)
from ...plant.ship import Ship
from .load import Recording
from .reference_simulation import Yardstick
from .unit_errors import demands, rectified_remark

Array = NDArray[np.float64]

KINEMATIC = ((SHAFT_ANGLE, SHAFT_SPEED), (HEADING, YAW_RATE))
"""Columns of an angle and of the rate at which it turns."""

_LEAST_ROWS = 200
_WIDEST = 0.08  # share of the rows up to which a lag is looked for
_MOST = 400  # rows, the same
_SMOOTHED = (
    3,
    7,
    15,
    31,
    63,
)  # rows over which both derivatives are averaged, the least that tells
_TELLS = 0.8  # correlation from which no more smoothing is tried
_LEAST = 0.6  # correlation below which no lag is told
_NEAREST = 0.95  # share of the highest peak from which one nearer to no lag is preferred
_PARTS = 8
_FEWEST_PARTS = 4
_STANDARD_ERRORS = 4.0  # by which a lag must be off zero
_ROWS = 0.5  # lag below which nothing is said
_BETTER = 0.02  # by which the squared correlation must be higher than without a lag


class Lag(NamedTuple):
    """A lag: in rows, positive where the first signal is late; its standard error; the correlation."""

    rows: float
    error: float
    correlation: float
    without: float

    @property
    def is_significant(self) -> bool:
        """Whether it is more than half a row, and better than chance."""
        return (
            abs(self.rows) > max(_ROWS, _STANDARD_ERRORS * self.error)
            and self.correlation**2 > max(self.without, 0.0) ** 2 + _BETTER
        )


def lag_of(signal: Array, reference: Array) -> Lag | None:
    """Return by how many rows a signal is later than a reference; None where they are too unlike.

    The derivatives of both are averaged over a few rows, and their cross-correlation is read at its peak
    by a parabola. The standard error is that of the lags of eight parts of the recording.

    Args:
        signal: (n,) evenly spaced.
        reference: (n,) of the same rows.
    """
    rows = len(signal)
    reach = min(_MOST, int(_WIDEST * rows))
    if rows < _LEAST_ROWS or np.ptp(signal) == 0.0 or np.ptp(reference) == 0.0:
        return None
    best: tuple[float, float, float, Array, Array] | None = None
    for width in (width for width in _SMOOTHED if 4 * _PARTS * width <= rows):
        a, b = (_derivative(values, width) for values in (signal, reference))
        found = _peak(a, b, reach)
        if found is not None and (best is None or found[1] > best[1]):
            best = (*found, a, b)
        if best is not None and best[1] >= _TELLS:
            break
    if best is None or best[1] < _LEAST:
        return None
    whole, correlation, without, a, b = best
    near = math.ceil(1.5 * abs(whole)) + 4
    count = min(_PARTS, len(a) // (4 * near))
    if count < _FEWEST_PARTS:
        return None
    parts = []
    for part in np.array_split(np.arange(len(a)), count):
        if np.std(b[part]) < 0.2 * np.std(b):
            continue
        found = _peak(a[part], b[part], near)
        if found is not None and found[1] >= _LEAST:
            parts.append(found[0])
    if len(parts) < _FEWEST_PARTS:
        return None
    error = float(np.std(parts, ddof=1)) / math.sqrt(len(parts))
    return Lag(whole, max(error, abs(whole - float(np.median(parts))) / 4.0), correlation, without)


def _derivative(values: Array, width: int) -> Array:
    """Return the steps from row to row, averaged over a window that shifts nothing."""
    window = np.hanning(width + 2)[1:-1]
    steps = np.convolve(np.diff(values), window / window.sum(), mode="valid")
    return np.asarray(steps - steps.mean())


def _peak(a: Array, b: Array, reach: int) -> tuple[float, float, float] | None:
    """Return lag of ``a`` behind ``b`` [rows], correlation there and at no lag; None without a peak."""
    size = float(np.sqrt((a @ a) * (b @ b)))
    if not size > 0.0:
        return None
    full = scipy.signal.correlate(a, b, mode="full", method="fft") / size
    middle = len(b) - 1
    reach = min(reach, middle - 1)
    some = full[middle - reach : middle + reach + 1]
    inner = np.arange(1, len(some) - 1)
    tops = inner[(some[inner] >= some[inner - 1]) & (some[inner] > some[inner + 1])]
    if not len(tops):
        return None
    if some[tops].max() <= 0.0:
        return None
    high = tops[some[tops] >= _NEAREST * some[tops].max()]
    top = int(high[np.argmin(np.abs(high - reach))])
    before, at, after = some[top - 1 : top + 2]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return top - reach + float(shift), float(at), float(some[reach])


def lags_against(
    table: pd.DataFrame, simulated: pd.DataFrame, columns: list[str]
) -> dict[str, Lag]:
    """Return the lag of each measured channel behind its simulation, where it can be told."""
    found = {}
    for column in columns:
        lag = lag_of(table[column].to_numpy(dtype=float), simulated[column].to_numpy(dtype=float))
        if lag is not None:
            found[column] = lag
    return found


def timing_remarks(
    table: pd.DataFrame, simulated: pd.DataFrame | None, columns: list[str], interval_s: float
) -> Iterator[str]:
    """Yield remarks on channels that are early or late by a significant time.

    Args:
        table: canonical columns on an even time base.
        simulated: the nominal ship driven by the same commands; None where it cannot be simulated.
        columns: measured channels.
        interval_s: from row to row [s].
    """
    for angle, rate in KINEMATIC:
        if angle in table and rate in table:
            turned = np.diff(np.unwrap(table[angle].to_numpy(dtype=float)))
            between = table[rate].rolling(2).mean().to_numpy(dtype=float)[1:]
            lag = lag_of(turned, between)
            if lag is not None and lag.is_significant:
                late = "later" if lag.rows > 0.0 else "earlier"
                yield (
                    f"{angle} is {_said(lag, interval_s)} {late} than the integral of {rate}: "
                    "the two were logged at different times, or one is filtered"
                )
    if simulated is None:
        return
    lags = lags_against(table.iloc[: len(simulated)], simulated, columns)
    rows = [lag.rows if lag.is_significant else 0.0 for lag in lags.values()]
    alike = len(rows) > 1 and all(rows) and np.ptp(rows) < 1.0
    for column, lag in lags.items():
        if not lag.is_significant:
            continue
        late = "lags" if lag.rows > 0.0 else "leads"
        if lag.rows < 0.0:
            why = "the command is logged late, the channel is shifted, or the file's machine is slower"
        else:
            why = "a delay or a filter in the channel or the drive, or the file's machine is faster"
        if alike:
            why = f"all channels do alike; {why}"
        elif len(lags) > 1:
            others = ", ".join(f"{c} by {o.rows:+.1f} rows" for c, o in lags.items() if c != column)
            why += f"; behind the simulation are {others}"
        yield f"{column} {late} the simulation by {_said(lag, interval_s)}: {why}"


def _said(lag: Lag, interval_s: float) -> str:
    return (
        f"{abs(lag.rows) * interval_s:.3g} s ({abs(lag.rows):.1f} rows, standard error {lag.error:.1f}; "
        f"correlation of the derivatives {lag.correlation:.2f}, {lag.without:.2f} as recorded)"
    )


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
