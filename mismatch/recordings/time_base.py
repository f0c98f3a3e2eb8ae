"""The time base of a recording: what loggers' stamps mean, what is missing, and an even spacing."""

from __future__ import annotations

import datetime
import itertools
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import TIME
from ...plant.recording import RecordingError

LONGEST_GAP = 3
"""Missing samples that are filled in."""

LEAST_OF_ONE = 10
"""Rows of a recording: parts of a voyage in which the ship sails straight may be as short as this."""

_EVEN = 0.01  # share of the interval by which a step may differ and still be even
_UNEVEN = 0.05  # share of steps far from the usual above which a recording is called irregular
_FASTEST_S, _SLOWEST_S = 1e-4, 5.0
_DAY_S = 86400.0
_REGULAR = 0.9  # share of a coarse clock's stamps that stand over as many rows, or one more or less
_SPARSE = 0.95  # share of a slow channel's values that come at the same spacing
_CLOCK = re.compile(r"\s*(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?\s*")
_DOTTED = re.compile(r"\s*\d{1,2}\.\d{1,2}\.\d{2,4}\b")
_STAMP = re.compile(r"\d:\d\d|\d{4}-\d\d?-\d|\d\d?[./]\d\d?[./]\d")
_COMMA_SECONDS = re.compile(r"(:\d{2}),(\d)")
_COLON_SECONDS = re.compile(r"(\d:\d{2}:\d{2}):(\d{3}|\d{6})$")  # milliseconds behind a colon
_REPEATED = 0.1  # share of the rows that may have the time of the row before; more is no time base


def seconds_of_stamps(values: pd.Series, form: str | None = None) -> pd.Series:
    """Seconds since the first of a column of dates with times, or of times of day alone.

    Times of day count on over midnight. Dates with dots have their day first; others that could be
    read with the day or the month first are refused where it matters.

    Args:
        values: texts, or what a spreadsheet holds as dates or times.
        form: of the stamps, as of ``strptime``; none to find out.

    Raises:
        ValueError: a stamp cannot be read, or may mean two moments.
    """
    texts = values if pd.api.types.is_datetime64_any_dtype(values) else values.astype(str)
    if (form is None and texts.dtype == object) or pd.api.types.is_string_dtype(texts):
        clock = texts.str.extract(f"^{_CLOCK.pattern}$").to_numpy()
        if form is None and not pd.isna(clock[:, :2]).any():
            return pd.Series(_counted_on(clock), values.index)
        texts = texts.str.replace(_COMMA_SECONDS, r"\1.\2", regex=True)
        if form is None:
            texts = texts.str.replace(_COLON_SECONDS, r"\1.\2", regex=True)
    stamps = _moments(texts, form)
    return (stamps - stamps.iloc[0]).dt.total_seconds()


def with_seconds(path: Path, table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The table with dates or durations in its time column as seconds, and a remark on it.

    Args:
        path: for messages.
        table: under canonical names.

    Raises:
        RecordingError: the time column holds texts of dates or of times of day.
    """
    if TIME not in table or not len(table):
        return table, []
    values, first = table[TIME], table[TIME].iloc[0]
    if pd.api.types.is_timedelta64_dtype(values):
        return table.assign(**{TIME: values.dt.total_seconds()}), []
    if pd.api.types.is_datetime64_any_dtype(values):
        said = f"{TIME} holds dates; it was read as seconds since {first}"
        return table.assign(**{TIME: seconds_of_stamps(values)}), [said]
    if isinstance(first, datetime.date) or (isinstance(first, str) and _STAMP.search(first)):
        raise RecordingError(
            f"{path}: {TIME} holds dates or times of day ({str(first)!r}) where seconds are needed; "
            f'say {TIME} = {{ column = "{TIME}", unit = "datetime" }} in the column map'
        )
    return table, []


def times_of(path: Path, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the time of each row [s], shape (rows,): NaN where it is no number, empty without a time.

    Args:
        path: for messages.
        table: under canonical names.

    Raises:
        RecordingError: as of :func:`with_seconds`.
    """
    time = with_seconds(path, table)[0].get(TIME, pd.Series(dtype=float))
    return np.asarray(pd.to_numeric(time, errors="coerce"), dtype=np.float64)


def first_day(values: pd.Series, form: str | None = None) -> str | None:
    """Day of the first stamp, year-month-day; None where stamps are times of day alone or unreadable."""
    first = str(values.iloc[0])
    if _CLOCK.fullmatch(first):
        return None
    try:
        first = _COLON_SECONDS.sub(r"\1.\2", _COMMA_SECONDS.sub(r"\1.\2", first))
        stamp = _moments(pd.Series([first]), form).iloc[0]
        return str(stamp.date())
    except ValueError:
        return None


def _counted_on(clock: NDArray[Any]) -> NDArray[np.float64]:
    """Seconds of hours, minutes and seconds, a day added at each fall by more than half a day."""
    seconds = np.array([[float(str(part).replace(",", ".")) if isinstance(part, str) else 0.0
                         for part in row] for row in clock]) @ [3600.0, 60.0, 1.0]  # fmt: skip
    falls = np.diff(seconds, prepend=seconds[0]) < -0.5 * _DAY_S
    seconds = seconds + _DAY_S * np.cumsum(falls)
    return np.asarray(seconds - seconds[0], dtype=np.float64)


def _moments(texts: pd.Series, form: str | None) -> pd.Series:
    if form is not None:
        return pd.to_datetime(texts, format=form, utc=True)
    try:
        return pd.to_datetime(texts, format="ISO8601", utc=True)
    except ValueError:
        pass
    first = str(texts.iloc[0])
    if _DOTTED.match(first):
        return pd.to_datetime(texts, dayfirst=True, utc=True)
    read = {}
    for day_first in (False, True):
        try:
            with warnings.catch_warnings():  # that the other order was asked for
                warnings.simplefilter("ignore", UserWarning)
                read[day_first] = pd.to_datetime(texts, dayfirst=day_first, utc=True)
        except ValueError as error:
            refused = error
    if not read:
        raise refused
    spans = [stamps - stamps.iloc[0] for stamps in read.values()]
    if len(spans) == 2 and not spans[0].equals(spans[1]):
        raise ValueError(
            f"{first!r} may have its day or its month first, and the date changes; say "
            'unit = "datetime %d/%m/%Y %H:%M:%S", for example'
        )
    return next(iter(read.values()))


def spread(path: Path, table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The table with the rows of a clock that is coarser than they are spread evenly, and a warning.

    Args:
        path: for messages.
        table: finite; its time never falls back where it is spread.
    """
    time = table[TIME].to_numpy()
    stamps, first, counts = np.unique(time, return_index=True, return_counts=True)
    if len(stamps) == len(time) or len(stamps) < 4 or (np.diff(time) < 0.0).any():
        return table, []
    inner = counts[1:-1]  # the first and the last may be cut off
    usual = float(np.median(inner))
    if usual < 2.0 or np.mean(np.abs(inner - usual) <= 1.0) < _REGULAR:
        return table, []
    rate = float(np.median(np.diff(stamps))) / float(np.mean(inner[np.abs(inner - usual) <= 1.0]))
    rows = np.arange(len(time), dtype=np.float64)
    knots, at = first[1:].astype(np.float64), stamps[1:]
    even = np.interp(rows, knots, at)
    even = np.where(rows < knots[0], at[0] - rate * (knots[0] - rows), even)
    even = np.where(rows > knots[-1], at[-1] + rate * (rows - knots[-1]), even)
    step = float(np.median(np.diff(stamps)))
    return table.assign(**{TIME: even - even[0] + time[0]}), [
        f"the clock stands still for {usual:g} rows at a time and then steps by {step:g} s; the rows "
        f"were spread evenly between its steps, {rate:.4g} s apart"
    ]


def parts(time: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Rows between gaps that are too long to be filled in, as (first, one past the last).

    Args:
        time: [s], shape (n,); one part where it is not finite or falls, which is refused later.
    """
    steps = np.diff(time)
    if not np.isfinite(time).all() or (steps < 0.0).any() or not (steps > 0.0).any():
        return [(0, len(time))]
    usual = float(np.median(steps[steps > 0.0]))
    gaps = np.flatnonzero(steps > (LONGEST_GAP + 1.5) * usual) + 1
    edges = [0, *map(int, gaps), len(time)]
    return list(itertools.pairwise(edges))


def filled(path: Path, table: pd.DataFrame, known: list[str]) -> tuple[pd.DataFrame, list[str]]:
    """The table with short runs of missing values filled in, and warnings that say how much.

    Up to :data:`LONGEST_GAP` values in a row are filled in along a straight line. A channel that has a
    value in every so many rows only, as a slow instrument has beside fast ones, keeps each until the
    next. Text that is no number is left for the check of numbers.

    Raises:
        RecordingError: more are missing in a row; names column, row and how many.
    """
    said = []
    for column in (c for c in known if c != TIME and c in table):
        missing = table[column].isna().to_numpy()
        if not missing.any() or missing.all():
            continue
        numbers = pd.to_numeric(table[column], errors="coerce")
        if (numbers.isna().to_numpy() & ~missing).any():
            continue  # text: refused by name later
        present = np.flatnonzero(~missing)
        edges = np.concatenate([[-1], present, [len(table)]])
        runs = np.diff(edges) - 1
        every = int(np.median(np.diff(present))) if len(present) > 2 else 1
        regular = every > 1 and np.mean(np.diff(present) == every) >= _SPARSE
        if regular and runs.max() <= every + LONGEST_GAP:
            table = table.assign(**{column: numbers.ffill().bfill()})
            said.append(f"{column} has a value in every {every} rows; each was kept until the next")
            continue
        if runs.max() > LONGEST_GAP:
            row = int(edges[int(np.argmax(runs))]) + 2
            raise RecordingError(
                f"{path}: {column}, row {row}: {runs.max()} values in a row are missing "
                f"({missing.sum()} of {len(table)} in all); up to {LONGEST_GAP} are filled in; cut the "
                "recording there and use the parts, or leave the column out"
            )
        whole = numbers.interpolate(limit_direction="both")
        table = table.assign(**{column: whole})
        said.append(
            f"{column}: {missing.sum()} of {len(table)} values were missing, up to {runs.max()} in a "
            f"row, first in row {int(np.argmax(missing)) + 1}; they were interpolated linearly"
        )
    return table, said


def on_even_time(path: Path, table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The table on an even time base, and warnings on what was interpolated for it."""
    said = []
    steps = np.diff(table[TIME].to_numpy())
    if 0.0 < np.mean(steps == 0.0) <= _REPEATED and (steps >= 0.0).all():
        row = int(np.argmax(steps == 0.0)) + 2
        said.append(
            f"{np.sum(steps == 0.0)} rows have the time of the row before, first row {row}; such rows "
            "were averaged"
        )
        table = table.groupby(TIME, as_index=False).mean()[[*table]]
    time = table[TIME].to_numpy()
    steps = np.diff(time)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: {time[row - 1]:g} s after {time[row - 2]:g} s; time must "
            "rise from row to row; sort the rows by it, or cut the recording there"
        )
    if time[0] < 0.0:
        raise RecordingError(
            f"{path}: {TIME} begins at {time[0]:g} s, and no time may be negative; subtract the first "
            f"value, or say offset = {-time[0]:g} in the column map"
        )
    usual = float(np.median(steps))
    if not _FASTEST_S * (1.0 - _EVEN) <= usual <= _SLOWEST_S:
        slow = usual > _SLOWEST_S
        steady = (
            "; if the ship ran steadily at each row, say --steady (steady=True)" if slow else ""
        )
        raise RecordingError(
            f"{path}: {TIME} steps by {usual:.4g} s from row to row; allowed: {_FASTEST_S:g} to "
            f"{_SLOWEST_S:g} s, or slower than the ship settles{steady}; if it counts another unit, say "
            f'so in the column map (unit = "{"ms" if slow else "day"}", for example)'
        )
    gaps = np.flatnonzero(steps > 1.5 * usual)
    long = gaps[steps[gaps] > (LONGEST_GAP + 1.5) * usual]
    if len(long):
        row = int(long[0]) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: a gap of {steps[row - 2]:.4g} s after {time[row - 2]:g} s "
            f"where {usual:.4g} s is usual ({len(long)} such gaps; up to {LONGEST_GAP} missing "
            "samples are filled in); cut the recording there and use the parts, each of at least "
            f"{LEAST_OF_ONE} rows"
        )
    uneven = np.abs(steps - usual) > 0.5 * usual
    if not len(gaps) and (np.abs(steps - usual) <= _EVEN * usual).all():
        return table, said
    onto = "every channel was interpolated linearly onto an even time base"
    if uneven.mean() > _UNEVEN:
        said.append(
            f"steps of time run from {steps.min():.3g} to {steps.max():.3g} s, {uneven.mean():.0%} of "
            f"them more than half off the usual {usual:.4g} s; {onto}, which hides some of its noise"
        )
    elif len(gaps):
        rows = ", ".join(str(row + 2) for row in gaps[:5]) + (", ..." if len(gaps) > 5 else "")
        said.append(
            f"samples are missing before row {rows}; they were interpolated linearly"
        )  # fmt: skip
    worst = float(np.max(np.abs(steps[steps <= 1.5 * usual] - usual)))
    if worst > _EVEN * usual and uneven.mean() <= _UNEVEN:
        said.append(
            f"steps of time differ by up to {worst:.2g} s from the usual {usual:.4g} s; {onto}"
        )
    count = round((time[-1] - time[0]) / float(np.mean(steps[~uneven]))) + 1
    even = np.linspace(time[0], time[-1], count)
    return pd.DataFrame({c: np.interp(even, time, table[c]) for c in table} | {TIME: even}), said
