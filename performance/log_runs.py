"""Find the runs of a speed trial in a log: stretches on a steady course at a steady power."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import check_size
from ..core.rows import true_runs
from ..plant.surroundings import KNOT
from .corrections import Wind, mean_wind
from .speed_trial import COLUMNS, TrialError, are_reciprocal, double_runs
from .tables import canonical

Floats = NDArray[np.float64]

LEAST_S = 600.0
"""Least length of a run [s] (ISO 15016:2015)."""

_COLUMNS = COLUMNS | {
    name: COLUMNS[name]._replace(low=low)
    for name, low in (("speed_over_ground", 0.0), ("shaft_power", -COLUMNS["shaft_power"].high))
}
"""Columns of a log, in which the ship may also be at rest."""

_BINS = 60  # of a shortest run
_PARTS = 5  # of a shortest run, whose means are compared
_HEADING = math.radians(6.0)  # largest range of the means within a run
_POWER, _SPEED = 0.05, 0.03  # largest range of the means over their mean
_TREND = 0.015  # largest change of the speed from the first third to the last
_SETTLING = 0.5  # most of a longer stretch's beginning that is left out, over a shortest run


class LogRuns(NamedTuple):
    """Runs of a speed trial that were found in a log."""

    runs: pd.DataFrame
    """Table for :func:`.analyse_trial`."""
    texts: tuple[str, ...]
    """Times, heading, speed and power of each run."""
    left_out: tuple[str, ...]
    """Likewise of each steady stretch without a run on the reciprocal course."""


def find_runs(log: pd.DataFrame, source: str = "log", least_s: float = LEAST_S) -> LogRuns:
    """Find the runs of a speed trial in a log, and average each.

    A run is a stretch of at least ``least_s`` in which heading, shaft power and speed are steady. Means
    over a fifth of ``least_s`` are compared, so waves and steering do not count. The beginning of a
    longer stretch is left out, because the speed still settles there. A stretch without a run on the
    reciprocal course at the same power is left out.

    Args:
        log: one row for each sample, in the order of time, with the names and units of
            :func:`read_runs` and a column ``time``.
        source: name of the log in messages.
        least_s: least length of a run [s].

    Raises:
        TableError: a column is missing or has a value outside its range.
        TrialError: the times do not ascend, the rows are too far apart, or there are no reciprocal runs.
        SizeError: the times span too long for the memory.

    Examples:
        >>> heading = np.repeat([20.0, 110.0, 200.0], [120, 20, 120])
        >>> log = pd.DataFrame({"time_s": 10.0 * np.arange(260), "hdg_deg": heading, "sog_kn": 14.0})
        >>> find_runs(log.assign(power_kW=9000.0)).runs["shaft_power"].tolist()
        [9000000.0, 9000000.0]
    """
    table = canonical(log, _COLUMNS, source, gaps=True)
    steady = [_average(table, *span) for span in _steady_spans(table, source, least_s)]
    # A stretch of another course or power between two reciprocal runs must not separate them.
    paired = [k for k, run in enumerate(steady) if any(are_reciprocal(run, one) for one in steady)]
    if len(paired) > 1:
        numbers = double_runs(pd.DataFrame([steady[k] for k in paired]))
        paired = [k for k, number in zip(paired, numbers, strict=True) if numbers.count(number) > 1]
    texts = [_description(run, table) for run in steady]
    left_out = tuple(text for k, text in enumerate(texts) if k not in paired)
    if not paired:
        raise TrialError(
            f"{source}: no runs on reciprocal courses at one power (within 6 %). Steady stretches of at "
            f"least {least_s / 60.0:g} min: {'; '.join(left_out) or 'none'}. Check the units, or allow "
            "shorter runs"
        )
    runs = pd.DataFrame([steady[k] for k in paired]).reset_index(drop=True)
    runs.attrs = table.attrs
    return LogRuns(runs, tuple(texts[k] for k in paired), left_out)


def _steady_spans(table: pd.DataFrame, source: str, least_s: float) -> list[tuple[float, float]]:
    """Return first and last time [s] of each steady stretch."""
    time = table["time"].to_numpy()
    if not np.isfinite(time).all():
        raise TrialError(f"{source}: a log needs the time of every row (column 'time')")
    steps = np.diff(time)
    if (steps < 0.0).any():
        row = 2 + int(np.argmax(steps < 0.0))
        raise TrialError(f"{source}: the times must ascend; row {row} is before row {row - 1}")
    if not (steps > 0.0).any():
        raise TrialError(f"{source}: a log has at least two times, not {len(time)} rows at one")
    interval = float(np.median(steps[steps > 0.0]))
    if interval > least_s / _PARTS:
        raise TrialError(
            f"{source}: a row every {interval:g} s is too few for runs of {least_s / 60.0:g} min; at "
            f"least one every {least_s / _PARTS:g} s is needed"
        )
    width = max(least_s / _BINS, interval)
    bins, parts = round(least_s / width), max(round(least_s / width / _PARTS), 1)
    check_size((time[-1] - time[0]) / width, 200.0, f"parts of {width:g} s in {source}")
    place = ((time - time[0]) / width).astype(np.int64)
    values = table[["heading", "shaft_power", "speed_over_ground"]].copy()
    known = values["heading"].notna()
    values.loc[known, "heading"] = np.unwrap(values.loc[known, "heading"])
    grid = values.groupby(place).mean().reindex(range(place[-1] + 1))
    grid = grid.interpolate(limit=1, limit_area="inside")  # clocks of loggers are not even
    smooth = grid.rolling(parts, min_periods=parts).mean()
    over = smooth.rolling(bins - parts + 1, min_periods=bins - parts + 1)
    ranges, mean = over.max() - over.min(), grid.rolling(bins, min_periods=bins).mean()
    third = max(bins // 3, 1)
    speed = grid["speed_over_ground"].rolling(third, min_periods=third).mean()
    steady = (
        (mean["shaft_power"] >= COLUMNS["shaft_power"].low)
        & (mean["speed_over_ground"] >= COLUMNS["speed_over_ground"].low)
        & (ranges["heading"] <= _HEADING)
        & (ranges["shaft_power"] <= _POWER * mean["shaft_power"])
        & (ranges["speed_over_ground"] <= _SPEED * mean["speed_over_ground"])
        & ((speed - speed.shift(bins - third)).abs() <= _TREND * mean["speed_over_ground"])
    ).to_numpy()
    spans: list[tuple[float, float]] = []
    for first, after in true_runs(steady):  # window ends, the last one past the stretch
        begin, end = time[0] + (first - bins + 1) * width, time[0] + after * width
        begin += float(np.clip(end - begin - least_s, 0.0, _SETTLING * least_s))
        if not spans or begin >= spans[-1][1]:
            spans.append((begin, end))
    return spans


def _average(table: pd.DataFrame, begin: float, end: float) -> pd.Series:
    """Return the means of a stretch; directions by their vectors."""
    rows = table[(table["time"] >= begin) & (table["time"] < end)]
    mean = rows[list(COLUMNS)].mean()
    for name in ("heading", "wave_angle", "swell_angle"):
        across, along = (f(rows[name]).mean() for f in (np.sin, np.cos))
        mean[name] = math.atan2(across, along) % (2.0 * math.pi)
    winds = rows[["wind_speed", "wind_angle"]].dropna()
    if len(winds):
        wind = mean_wind([Wind(*pair) for pair in winds.itertuples(index=False)])
        mean["wind_speed"], mean["wind_angle"] = wind.speed, wind.angle % (2.0 * math.pi)
    mean["time"] = 0.5 * (begin + end)
    mean["duration"] = end - begin
    return mean


def _description(run: pd.Series, table: pd.DataFrame) -> str:
    """Return times, heading, speed and power of a run as text."""
    middle, half = run["time"], 0.5 * run["duration"]
    return (
        f"{_clock(middle - half, table)} to {_clock(middle + half, table)}, "
        f"heading {math.degrees(run['heading']):.0f} deg, "
        f"{run['speed_over_ground'] / KNOT:.1f} kn, {run['shaft_power'] / 1e3:.0f} kW"
    )


def _clock(time: float, table: pd.DataFrame) -> str:
    """Return a time of a canonical log [s] as its date and time; in minutes in a log without dates."""
    if "stamp" not in table:
        return f"{time / 60.0:.1f} min"
    return f"{table['stamp'].iloc[0] + pd.Timedelta(seconds=time):%Y-%m-%d %H:%M}"
