"""Estimate parameters from sines: frequency response by correlation (method 4, eqs. 33 to 39).

A recording has one sine of the command about its mean, or several sines in sequence. The transient at
the start of each sine is left out, whole periods are kept, and command and channels are correlated
with sine and cosine. The scatter between periods gives the error. A constant and a drift are estimated
as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import drive_column
from ...plant.ship import Ship
from ..estimate import Tick, ignore_progress
from .free_parameters import parse_free, usual_keys
from .frequency import (
    OUTPUTS,
    FrequencyResponse,
    attenuation,
    channels_of,
    fit_response,
    interval_of,
    means_of,
    slowest_s,
    zero_order_hold,
)
from .parameters import MethodResult

Array = NDArray[np.float64]

METHOD = "sine"
FADED = 8.0  # transient in time constants of the slowest pole, after which 3e-4 of it remains
PURE = 0.1  # largest relative rms deviation of a command from a sine
FEWEST = 8  # smallest number of rows of a sine
SAME_POINT = 0.03  # largest relative difference of the working points of sines that are combined


def sine(
    ship: Ship,
    tables: Iterable[pd.DataFrame],
    free: Sequence[str] | None = None,
    tick: Tick = ignore_progress,
) -> MethodResult:
    """Estimate parameters of a ship from its response to sines of the command.

    Args:
        ship: ship with the start of the search and the parameters that are not free; its slowest pole
            gives the duration of the transients.
        tables: recordings in canonical columns at an even interval, with one or more sines of the
            command about one working point. Columns: ``shaft_speed_rad_s`` (needed),
            ``motor_current_A``, ``shaft_torque_N_m``, ``ship_speed_m_s``.
        free: dotted keys; by default those of :func:`.free_parameters.usual_keys`, the paper's six for a
            direct-current motor at bollard pull. ``sensors.speed_delay_s`` is allowed.
        tick: progress callback ``tick(stage, done, total)``.

    Returns:
        Estimates by least squares of complex errors, with the covariance from the scatter between
        periods and from the residual. Tables: ``frequency-response`` (measured and identified ship),
        ``search`` (cost function) and, for a drive train, ``closed-form`` (from poles, zero and steady
        gains).

    Raises:
        ValueError: a missing column, no sine, too few periods, several working points, a shaft that
            stops or reverses, or parameters that the response does not distinguish.
    """
    chosen = parse_free(ship, free, usual_keys(ship, response=True))
    measured = sine_response(ship, tables, tick)
    return fit_response(METHOD, chosen, measured)


def sine_response(
    ship: Ship, tables: Iterable[pd.DataFrame], tick: Tick = ignore_progress
) -> FrequencyResponse:
    """Return the frequency response by correlation; arguments and errors as in :func:`sine`."""
    tables = list(tables)
    parts: list[FrequencyResponse] = []
    for number, table in enumerate(tables, 1):
        channels = channels_of(ship, table, METHOD)
        excitations = sines(channels[drive_column(ship)], interval_of(table))
        parts += [_correlate(ship, table, channels, one) for one in excitations]
        tick(METHOD, number, len(tables))
    if not parts:
        raise ValueError(
            f"{METHOD}: no sine of {drive_column(ship)} in the recording; it needs at least two periods "
            "of one frequency about a mean"
        )
    return _combine(parts)


class Excitation(NamedTuple):
    """One sine of the command in a recording."""

    begin: int  # row
    end: int  # behind the last row
    frequency: float  # [rad/s]


def sines(demand: Array, interval_s: float) -> list[Excitation]:
    """Return the sines of a command: sequences of equal half periods between its crossings of the mean.

    The command has the shape (n,), the sampling interval the unit [s].
    """
    found: list[Excitation] = []
    middle = 0.5 * float(np.quantile(demand, 0.02) + np.quantile(demand, 0.98))
    for begin, end in _runs(_crossings(demand - middle)):
        least = found[-1].end if found else 0
        begin = max(begin, least)
        frequency = _frequency(demand[begin:end], interval_s)
        if frequency is not None:
            half = round(math.pi / frequency / interval_s)
            wide = slice(max(begin - half, least), min(end + half, len(demand)))
            before, behind = _rows_on_sine(demand, wide, begin, end, frequency * interval_s)
            found.append(Excitation(begin - before, end + behind, frequency))
    return found


def _crossings(deviation: Array) -> Array:
    """Return the interpolated rows at which a deviation clearly changes its sign."""
    clear = 0.25 * float(np.quantile(np.abs(deviation), 0.9))
    if clear <= 0.0:
        return np.empty(0)
    known = np.flatnonzero(np.abs(deviation) > clear)
    side = np.sign(deviation[known])
    found = []
    for turn in np.flatnonzero(side[1:] != side[:-1]):
        a, b = known[turn], known[turn + 1]
        last = a + int(np.flatnonzero(deviation[a : b + 1] * side[turn] >= 0.0)[-1])
        low, high = deviation[last], deviation[last + 1]
        found.append(last - low / (high - low))
    return np.array(found)


def _runs(crossings: Array) -> list[tuple[int, int]]:
    """Return the rows of sequences of at least two half periods of equal length."""
    halves = np.diff(crossings)
    found, first = [], 0
    for k in range(1, len(halves) + 1):
        usual = float(np.median(halves[first:k]))
        if k == len(halves) or abs(halves[k] - usual) > max(0.1 * usual, 2.0):
            if k - first >= 2:
                found.append((math.ceil(crossings[first]), math.floor(crossings[k]) + 1))
            first = k
    return found


def _rows_on_sine(demand: Array, wide: slice, begin: int, end: int, turn: float) -> tuple[int, int]:
    """Return the numbers of rows before ``begin`` and after ``end``, in ``wide``, that fit the sine."""
    time = np.arange(wide.start, wide.stop) * turn
    basis = np.column_stack([np.ones(len(time)), np.cos(time), np.sin(time)])
    inner = slice(begin - wide.start, end - wide.start)
    fitted = np.linalg.lstsq(basis[inner], demand[begin:end], rcond=None)[0]
    away = np.abs(demand[wide] - basis @ fitted) > 2.0 * PURE * float(np.hypot(*fitted[1:]))
    before, behind = away[: inner.start][::-1], away[inner.stop :]
    return (
        int(np.argmax(before)) if before.any() else len(before),
        int(np.argmax(behind)) if behind.any() else len(behind),
    )


def _basis(rows: int, frequency: float, interval_s: float) -> Array:
    """Return constant, drift, cosine and sine over rows, shape (rows, 4)."""
    turn, drift = frequency * (np.arange(rows) * interval_s), np.linspace(-1.0, 1.0, rows)
    return np.column_stack([np.ones(rows), drift, np.cos(turn), np.sin(turn)])


def _phasor(values: Array, basis: Array) -> tuple[complex, float]:
    """Return the complex amplitude of exp(j w t), and the mean (eqs. 33 to 37 without the division)."""
    mean, _, cosine, sine_part = np.linalg.lstsq(basis, values, rcond=None)[0]
    return complex(cosine, -sine_part), float(mean)


def _frequency(demand: Array, interval_s: float) -> float | None:
    """Return the frequency [rad/s] of a command over whole periods; None if it is no sine."""
    rows = len(demand)
    if rows < FEWEST:
        return None
    spectrum = np.abs(np.fft.rfft(demand - demand.mean()))
    strongest = max(int(np.argmax(spectrum)), 1)
    unit = 2.0 * math.pi / (rows * interval_s)

    def left(frequency: float) -> float:
        basis = _basis(rows, frequency, interval_s)
        fitted = basis @ np.linalg.lstsq(basis, demand, rcond=None)[0]
        return float(np.sum((demand - fitted) ** 2))

    best = scipy.optimize.minimize_scalar(
        left,
        bounds=(max(strongest - 1.0, 0.4) * unit, (strongest + 1.0) * unit),
        method="bounded",
        options={"xatol": 1e-7 * unit * strongest},
    )
    variation = float(np.sum((demand - demand.mean()) ** 2))
    return float(best.x) if left(float(best.x)) < PURE**2 * variation else None


def _correlate(
    ship: Ship, table: pd.DataFrame, channels: dict[str, Array], one: Excitation
) -> FrequencyResponse:
    """Return the response at one frequency from the whole periods after the transient."""
    demand, interval_s = drive_column(ship), interval_of(table)
    period = 2.0 * math.pi / one.frequency / interval_s  # rows
    means = means_of(ship, table, channels, slice(one.begin, one.end))
    mean = float(channels[demand][one.begin : one.end].mean())
    about = FrequencyResponse(mean, means, np.empty(0), {}, {}, interval_s)
    start = one.begin + FADED * slowest_s(ship, about) / interval_s
    periods = math.floor((one.end - start) / period + 1e-6)
    if periods < 1:
        raise ValueError(
            f"{METHOD}: the sine of {one.frequency:.4g} rad/s ends before its transient does; it lasts "
            f"{(one.end - one.begin) * interval_s:.3g} s and must last "
            f"{(start - one.begin + period) * interval_s:.3g} s"
        )
    begin = one.end - round(periods * period)
    whole = _basis(one.end - begin, one.frequency, interval_s)
    cause, mean = _phasor(channels[demand][begin : one.end], whole)
    response, error = {}, {}
    for column in (c for c in OUTPUTS if c in channels):
        values = channels[column][begin : one.end]
        answer, means[column] = _phasor(values, whole)
        unit = mean / means[column] / cause / zero_order_hold(one.frequency, interval_s)
        response[column] = np.atleast_1d(answer * unit)
        scatter = _scatter(values, whole, periods, period)
        lacking = attenuation(values, interval_s, one.frequency)
        error[column] = np.hypot(scatter * abs(unit), lacking * np.abs(response[column]))
    return FrequencyResponse(mean, means, np.array([one.frequency]), response, error, interval_s)


def _scatter(values: Array, basis: Array, periods: int, period: float) -> float:
    """Return the standard error of the real and of the imaginary part of a phasor.

    It follows from the scatter between up to eight groups of periods, or, with fewer than three periods,
    from the residual of the sine as white noise.
    """
    groups = min(periods, 8)
    if groups < 3:
        left = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
        return math.sqrt(2.0 * float(np.mean(left**2)) / len(values))
    edges = [round(g * periods / groups) * period for g in range(groups + 1)]
    found = []
    for a, b in itertools.pairwise(edges):
        rows = slice(round(a), min(round(b), len(values)))
        found.append(_phasor(values[rows], basis[rows])[0])
    spread = np.array(found) - np.mean(found)
    variance = float(np.sum(np.abs(spread) ** 2)) / (groups - 1) / 2.0
    return math.sqrt(variance / groups)


def _combine(parts: list[FrequencyResponse]) -> FrequencyResponse:
    """Return the responses at single frequencies as one response about their common working point."""
    parts = sorted(parts, key=lambda part: float(part.frequency[0]))
    first = parts[0]
    for part in parts:
        if set(part.response) != set(first.response):
            raise ValueError(f"{METHOD}: the recordings have different columns")
        if abs(part.interval_s / first.interval_s - 1.0) > 0.01:
            raise ValueError(f"{METHOD}: the recordings have different intervals")
    demand = float(np.mean([part.demand for part in parts]))
    means = {c: float(np.mean([part.means[c] for part in parts])) for c in first.means}
    for part in parts:
        if abs(part.demand / demand - 1.0) > SAME_POINT:
            raise ValueError(
                f"{METHOD}: a sine has the mean {part.demand:.4g}, all sines together {demand:.4g}; a "
                "frequency response needs one working point"
            )
    return FrequencyResponse(
        demand,
        means,
        np.concatenate([part.frequency for part in parts]),
        {c: np.concatenate([part.response[c] for part in parts]) for c in first.response},
        {c: np.concatenate([part.error[c] for part in parts]) for c in first.error},
        first.interval_s,
    )
