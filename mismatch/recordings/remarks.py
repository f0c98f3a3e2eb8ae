"""Report rectified, early, late and coarsely quantised channels of a usable recording.

A lag is estimated against the simulation of the nominal ship, and between an angle and its recorded
rate.
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
    drive_column,
    simulated_columns,
)
from ...plant.ship import Ship
from .course import turn_remark
from .load import Recording
from .reference_simulation import ReferenceSimulation
from .unit_errors import command_columns, rectified_remark

Array = NDArray[np.float64]

KINEMATIC = ((SHAFT_ANGLE, SHAFT_SPEED), (HEADING, YAW_RATE))  # pairs of an angle and its rate

_LEAST_ROWS = 200
_WIDEST = 0.08  # largest lag as a share of the rows
_MOST = 400  # largest lag in rows
_SMOOTHED = (3, 7, 15, 31, 63)  # rows over which both derivatives are averaged, tried in this order
_SUFFICIENT = 0.8  # correlation from which no wider average is tried
_LEAST = 0.6  # correlation below which a lag is not identifiable
_NEAREST = 0.95  # share of the highest peak from which a peak at a smaller lag is preferred
_PARTS = 8  # parts of the recording whose lags give the standard error
_FEWEST_PARTS = 4
_STANDARD_ERRORS = 4.0  # least ratio of a significant lag to its standard error
_ROWS = 0.5  # smallest lag in rows that is reported
_BETTER = 0.02  # least increase of the squared correlation by a significant lag
_LEVELS = 8  # fewest levels of a quantised channel
_RECURS = 1.5  # fewest rows per level
_COARSE = 1e-3  # smallest step that is reported, as a share of the range of the channel
_OFF_GRID = 0.08  # largest distance of a level from the grid, in steps
_ON_GRID = 0.98  # least share of the levels within that distance


def remarks(recording: Recording, ship: Ship) -> Iterator[str]:
    """Yield remarks on few rows, on rectified, shifted and quantised channels, and on turns.

    The nominal ship is simulated with the recorded commands; the recording is not changed.
    """
    table = recording.table
    reference = ReferenceSimulation(ship, table, recording.interval_s, recording.steady)
    simulated = reference.simulated
    commands = command_columns(ship, table)
    measured = [c for c in simulated_columns(ship) if c in table and c not in commands]
    compared = []
    for column in measured:
        noise = recording.noise[column].white_rms if column in recording.noise else 0.0
        if remark := rectified_remark(table, simulated, column, drive_column(ship), noise):
            yield remark
        elif simulated is not None and column in simulated:
            compared.append(column)
    if not recording.steady:
        yield from _timing_remarks(reference.table, simulated, compared, recording.interval_s)
    for column in (*commands, *measured):
        if remark := quantisation_remark(column, table[column].to_numpy(dtype=float)):
            yield remark
    if len(table) < _LEAST_ROWS:
        yield (
            f"{len(table)} rows are few (fewer than {_LEAST_ROWS}): late channels are not looked for, "
            "and only a large change of the ship can be named"
        )
    if not ship.turns and (remark := turn_remark(recording.time_s, recording.navigation)):
        yield remark


def _timing_remarks(
    table: pd.DataFrame, simulated: pd.DataFrame | None, columns: list[str], interval_s: float
) -> Iterator[str]:
    """Yield remarks on measured channels with a significant lead or lag against the simulation."""
    for angle, rate in KINEMATIC:
        if angle in table and rate in table:
            turned = np.diff(np.unwrap(table[angle].to_numpy(dtype=float)))
            between = table[rate].rolling(2).mean().to_numpy(dtype=float)[1:]
            lag = estimate_lag(turned, between)
            if lag is not None and lag.is_significant:
                late = "later" if lag.rows > 0.0 else "earlier"
                yield (
                    f"{angle} is {_lag_text(lag, interval_s)} {late} than the integral of {rate}: the "
                    "two channels were logged at different times, or one of them is filtered"
                )
    if simulated is None:
        return
    lags: dict[str, Lag] = {}
    for c in columns:
        signals = (channels[c].to_numpy(dtype=float) for channels in (table, simulated))
        if (lag := estimate_lag(*(signal[: len(simulated)] for signal in signals))) is not None:
            lags[c] = lag
    rows = [lag.rows if lag.is_significant else 0.0 for lag in lags.values()]
    alike = len(rows) > 1 and all(rows) and np.ptp(rows) < 1.0
    for column, lag in lags.items():
        if not lag.is_significant:
            continue
        late = "leads"
        why = "the command is logged late, the channel is shifted, or the ship model is too slow"
        if lag.rows > 0.0:
            late = "lags"
            why = "the channel or the drive has a delay or a filter, or the ship model is too fast"
        if alike:
            why = f"all channels have this shift; {why}"
        elif len(lags) > 1:
            others = ", ".join(f"{c} {o.rows:+.1f} rows" for c, o in lags.items() if c != column)
            why += f"; lags of the other channels behind the simulation: {others}"
        yield f"{column} {late} the simulation by {_lag_text(lag, interval_s)}: {why}"


def _lag_text(lag: Lag, interval_s: float) -> str:
    return (
        f"{abs(lag.rows) * interval_s:.3g} s ({abs(lag.rows):.1f} rows, standard error {lag.error:.1f}; "
        f"correlation of the derivatives {lag.correlation:.2f} at this lag, {lag.without:.2f} without)"
    )


class Lag(NamedTuple):
    """Lag between two signals, from the correlation of their derivatives.

    Attributes:
        rows: lag in rows, positive if the first signal is late.
        error: standard error of the lag in rows.
        correlation: correlation of the derivatives at this lag.
        without: correlation of the derivatives without a lag.
    """

    rows: float
    error: float
    correlation: float
    without: float

    @property
    def is_significant(self) -> bool:
        """Whether the lag exceeds half a row and its standard error, and raises the correlation."""
        return (
            abs(self.rows) > max(_ROWS, _STANDARD_ERRORS * self.error)
            and self.correlation**2 > max(self.without, 0.0) ** 2 + _BETTER
        )


def estimate_lag(signal: Array, reference: Array) -> Lag | None:
    """Return the lag of a signal behind a reference; None if their shapes differ too much.

    The derivatives of both signals are averaged over a few rows, and a parabola through the peak of
    their cross-correlation gives the lag. The standard error comes from the lags of up to eight parts
    of the recording.

    Example:
        >>> noise = np.random.default_rng(1).normal(size=1010)
        >>> reference = np.convolve(noise, np.ones(11) / 11, "valid")
        >>> lag = estimate_lag(reference[:-3], reference[3:])
        >>> round(lag.rows, 1), lag.is_significant
        (3.0, True)

    Args:
        signal: (n,) evenly spaced.
        reference: (n,) samples at the same times.
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
        if best is not None and best[1] >= _SUFFICIENT:
            break
    if best is None or best[1] < _LEAST:
        return None
    whole, correlation, without, a, b = best
    near = math.ceil(1.5 * abs(whole)) + 4
    count = min(_PARTS, len(a) // (4 * near))
    if count < _FEWEST_PARTS:
        return None
    cuts = np.array_split(np.arange(len(a)), count)
    peaks = [_peak(a[c], b[c], near) for c in cuts if np.std(b[c]) >= 0.2 * np.std(b)]
    parts = [peak[0] for peak in peaks if peak is not None and peak[1] >= _LEAST]
    if len(parts) < _FEWEST_PARTS:
        return None
    error = float(np.std(parts, ddof=1)) / math.sqrt(len(parts))
    return Lag(whole, max(error, abs(whole - float(np.median(parts))) / 4.0), correlation, without)


def _derivative(values: Array, width: int) -> Array:
    """Return the differences from row to row without their mean, averaged over a symmetric window."""
    window = np.hanning(width + 2)[1:-1]
    steps = np.convolve(np.diff(values), window / window.sum(), mode="valid")
    return np.asarray(steps - steps.mean())


def _peak(a: Array, b: Array, reach: int) -> tuple[float, float, float] | None:
    """Return the lag of ``a`` behind ``b`` [rows] and the correlations at this lag and without a lag."""
    size = float(np.sqrt((a @ a) * (b @ b)))
    if not size > 0.0:
        return None
    reach = min(reach, len(b) - 2)
    # Zeros beyond the end keep the last rows apart from the first.
    length = scipy.fft.next_fast_len(max(len(a), len(b)) + reach, real=True)
    spectrum = np.fft.rfft(a, length) * np.conj(np.fft.rfft(b, length))
    full = np.fft.irfft(spectrum, length) / size
    some = np.concatenate([full[length - reach :], full[: reach + 1]])
    inner = np.arange(1, len(some) - 1)
    tops = inner[(some[inner] >= some[inner - 1]) & (some[inner] > some[inner + 1])]
    if not len(tops) or some[tops].max() <= 0.0:
        return None
    high = tops[some[tops] >= _NEAREST * some[tops].max()]
    top = int(high[np.argmin(np.abs(high - reach))])
    before, at, after = some[top - 1 : top + 2]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return top - reach + float(shift), float(at), float(some[reach])


def quantisation_remark(column: str, values: NDArray[Any]) -> str:
    """Return a remark on a column whose values (n,) lie on a coarse grid, else an empty string."""
    step, levels = quantisation_grid(values)
    span = float(np.ptp(values))
    if not step > _COARSE * span:
        return ""
    return (
        f"{column} is quantised: it changes in steps of {step:.4g} {BOUNDS[column][2]} "
        f"({step / span:.2%} of its range, {levels} levels)"
    )


def quantisation_grid(values: NDArray[Any]) -> tuple[float, int]:
    """Return the step of the grid on which values lie and the number of levels; (0, 0) without a grid.

    The file may have rounded the levels. Only a channel with many levels that recur has a grid: a
    command that is switched between three values is not quantised.

    Example:
        >>> step, levels = quantisation_grid(np.round(np.sin(0.01 * np.arange(2000)), 1))
        >>> round(step, 3), levels
        (0.1, 21)

    Args:
        values: (n,) samples.
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
    counts = np.round(apart / step)
    off = np.abs(apart / step - np.maximum(1.0, counts))[counts <= 10]
    return (step, len(levels)) if np.mean(off < _OFF_GRID) >= _ON_GRID else (0.0, 0)
