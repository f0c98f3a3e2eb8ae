"""Convert time stamps to seconds, fill in missing samples and resample a recording evenly."""

from __future__ import annotations

import datetime
import itertools
import re
import warnings
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, TIME
from ...plant.recording import RecordingError
from .course import interpolate

Array = NDArray[np.float64]

Cleaned: TypeAlias = tuple[pd.DataFrame, list[str]]
"""Table after a cleaning step, and a warning for each kind of change."""

LONGEST_GAP = 3  # largest number of missing samples in a row that are interpolated

FEWEST_ROWS = 10
"""Fewest rows of a recording; a part of a voyage with a constant course may be this short."""

_EVEN = 0.01  # largest deviation of an even step, as a share of the interval
_UNEVEN = 0.05  # share of uneven steps above which a recording is called irregular
_FASTEST_S, _SLOWEST_S = 1e-4, 5.0
_DAY_S = 86400.0
_REGULAR = 0.9  # share of the stamps of a coarse clock that cover the usual number of rows ± 1
_SPARSE = 0.95  # share of the values of a slow channel that have the same spacing
_CLOCK = re.compile(r"\s*(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?\s*")
_DOTTED = re.compile(r"\s*\d{1,2}\.\d{1,2}\.\d{2,4}\b")
_STAMP = re.compile(r"\d:\d\d|\d{4}-\d\d?-\d|\d\d?[./]\d\d?[./]\d")
_COMMA_SECONDS = re.compile(r"(:\d{2}),(\d)")
_COLON_SECONDS = re.compile(r"(\d:\d{2}:\d{2}):(\d{3}|\d{6})$")  # milliseconds after a colon
_WHOLE_SECONDS = re.compile(r"(\d:\d{2}:\d{2})(?=\s*$)")  # without a fraction
_REPEATED = 0.1  # largest share of the rows that repeat the time of the row before


def seconds_since_first(values: pd.Series, form: str | None = None) -> pd.Series:
    """Return the seconds since the first of a column of dates with times, or of times of day.

    Times of day continue after midnight. A date with dots has its day first. Other dates whose day and
    month could be exchanged are refused if the elapsed time depends on the order.

    Example:
        >>> seconds_since_first(pd.Series(["23:59:59,5", "00:00:00,5", "00:00:01,5"])).tolist()
        [0.0, 1.0, 2.0]

    Args:
        values: texts, or dates or times of a spreadsheet.
        form: format of the stamps as in ``strptime``; None to recognise it.

    Raises:
        ValueError: a stamp cannot be read, or its day and month could be exchanged.
    """
    texts = values if pd.api.types.is_datetime64_any_dtype(values) else values.astype(str)
    if (form is None and texts.dtype == object) or pd.api.types.is_string_dtype(texts):
        clock = texts.str.extract(f"^{_CLOCK.pattern}$").to_numpy()
        if form is None and not pd.isna(clock[:, :2]).any():
            return pd.Series(_counted_on(clock), values.index)
        texts = texts.str.replace(_COMMA_SECONDS, r"\1.\2", regex=True)
        if form is None:
            texts = texts.str.replace(_COLON_SECONDS, r"\1.\2", regex=True)
            if texts.str.contains(r":\d{2}\.\d").any():  # some loggers leave out a fraction of 0
                texts = texts.str.replace(_WHOLE_SECONDS, r"\1.0", regex=True)
    stamps = _moments(texts, form)
    return (stamps - stamps.iloc[0]).dt.total_seconds()


def convert_dates(path: Path, table: pd.DataFrame) -> Cleaned:
    """Return the table with dates or durations of its time column as seconds, and a warning on dates.

    Raises:
        RecordingError: the time column holds dates or times of day as text.
    """
    if TIME not in table or not len(table):
        return table, []
    values, first = table[TIME], table[TIME].iloc[0]
    if pd.api.types.is_timedelta64_dtype(values):
        return table.assign(**{TIME: values.dt.total_seconds()}), []
    if pd.api.types.is_datetime64_any_dtype(values):
        warning = f"{TIME} holds dates; it was read as seconds since {first}"
        return table.assign(**{TIME: seconds_since_first(values)}), [warning]
    if isinstance(first, datetime.date) or (isinstance(first, str) and _STAMP.search(first)):
        raise RecordingError(
            f"{path}: {TIME} holds dates or times of day ({str(first)!r}) where seconds are needed; "
            f'add {TIME} = {{ column = "{TIME}", unit = "datetime" }} to the column map'
        )
    return table, []


def time_in_seconds(path: Path, table: pd.DataFrame) -> Array:
    """Return the time of each row [s], shape (rows,): NaN for text, empty without a time column.

    Errors are those of :func:`convert_dates`.
    """
    time = convert_dates(path, table)[0].get(TIME, pd.Series(dtype=float))
    return np.asarray(pd.to_numeric(time, errors="coerce"), dtype=np.float64)


def first_day(values: pd.Series, form: str | None = None) -> str | None:
    """Return the day of the first stamp as year-month-day; None for a time of day or unreadable text."""
    first = str(values.iloc[0])
    if _CLOCK.fullmatch(first):
        return None
    try:
        first = _COLON_SECONDS.sub(r"\1.\2", _COMMA_SECONDS.sub(r"\1.\2", first))
        stamp = _moments(pd.Series([first]), form).iloc[0]
        return str(stamp.date())
    except ValueError:
        return None


def _counted_on(clock: NDArray[Any]) -> Array:
    """Return the seconds of hours, minutes and seconds; each fall by half a day or more adds a day."""
    parts = [
        [float(str(part).replace(",", ".")) if isinstance(part, str) else 0.0 for part in row]
        for row in clock
    ]
    seconds = np.array(parts) @ [3600.0, 60.0, 1.0]
    falls = np.diff(seconds, prepend=seconds[0]) < -0.5 * _DAY_S
    seconds = seconds + _DAY_S * np.cumsum(falls)
    return np.asarray(seconds - seconds[0], dtype=np.float64)


class _AmbiguousDayError(ValueError):
    """Day and month of the stamps could be exchanged."""


def _moments(texts: pd.Series, form: str | None) -> pd.Series:
    """Return the moments of stamps that are all written alike.

    Raises:
        ValueError: a stamp cannot be read, or its day and month could be exchanged.
    """
    try:
        return _parse_stamps(texts, form)
    except _AmbiguousDayError:
        raise
    except ValueError:
        raise ValueError(_unreadable_stamp(texts, form)) from None


def _unreadable_stamp(texts: pd.Series, form: str | None) -> str:
    """Return a message that names the first stamp that cannot be read in the form of the first row."""
    with warnings.catch_warnings():  # pandas warns if it cannot recognise a form.
        warnings.simplefilter("ignore", UserWarning)
        unread = pd.to_datetime(texts, format=form, dayfirst=True, utc=True, errors="coerce").isna()
    row = int(np.argmax(unread))
    stamp = f"the time stamp {str(texts.iloc[row])!r} of row {row + 1}"
    if form is not None:
        return f"{stamp} does not match the form {form!r}"
    return (
        f"{stamp} cannot be read, and that of row 1 is {str(texts.iloc[0])!r}: write all stamps in one "
        "form, such as 2026-05-31 23:59:59, or give their form, for example unit = "
        '"datetime %d.%m.%Y %H:%M:%S"'
    )


def _parse_stamps(texts: pd.Series, form: str | None) -> pd.Series:
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
            with warnings.catch_warnings():  # pandas warns if the stamps need the other order.
                warnings.simplefilter("ignore", UserWarning)
                read[day_first] = pd.to_datetime(texts, dayfirst=day_first, utc=True)
        except ValueError as error:
            refused = error
    if not read:
        raise refused
    spans = [stamps - stamps.iloc[0] for stamps in read.values()]
    if len(spans) == 2 and not spans[0].equals(spans[1]):
        raise _AmbiguousDayError(
            f"{first!r} may have its day or its month first, and the date changes; set for example "
            'unit = "datetime %d/%m/%Y %H:%M:%S"'
        )
    return next(iter(read.values()))


def spread_coarse_clock(path: Path, table: pd.DataFrame) -> Cleaned:
    """Return the table with the rows between two ticks of a coarse clock spread evenly, and a warning.

    A time that falls is left as it is.
    """
    time = table[TIME].to_numpy()
    stamps, first, counts = np.unique(time, return_index=True, return_counts=True)
    if len(stamps) == len(time) or len(stamps) < 4 or (np.diff(time) < 0.0).any():
        return table, []
    inner = counts[1:-1]  # The first and the last tick may be cut off.
    usual, step = float(np.median(inner)), float(np.median(np.diff(stamps)))
    regular = np.abs(inner - usual) <= 1.0
    if usual < 2.0 or np.mean(regular) < _REGULAR:
        return table, []
    rate = step / float(np.mean(inner[regular]))
    rows = np.arange(len(time), dtype=np.float64)
    knots, at = first[1:].astype(np.float64), stamps[1:]
    even = np.interp(rows, knots, at)
    even = np.where(rows < knots[0], at[0] - rate * (knots[0] - rows), even)
    even = np.where(rows > knots[-1], at[-1] + rate * (rows - knots[-1]), even)
    return table.assign(**{TIME: even - even[0] + time[0]}), [
        f"the clock repeats each time for {usual:g} rows and then steps by {step:g} s; the rows were "
        f"spread evenly between its steps, {rate:.4g} s apart"
    ]


def split_at_gaps(time: Array) -> list[tuple[int, int]]:
    """Return the parts between gaps that are too long to be interpolated, as (first, one past the last).

    Example:
        >>> split_at_gaps(np.array([0.0, 1.0, 2.0, 60.0, 61.0]))
        [(0, 3), (3, 5)]

    The time of each row has the unit [s] and the shape (n,). A time that is not finite or falls gives
    one part; a later check refuses it.
    """
    steps = np.diff(time)
    if not np.isfinite(time).all() or (steps < 0.0).any() or not (steps > 0.0).any():
        return [(0, len(time))]
    usual = float(np.median(steps[steps > 0.0]))
    gaps = np.flatnonzero(steps > (LONGEST_GAP + 1.5) * usual) + 1
    edges = [0, *map(int, gaps), len(time)]
    return list(itertools.pairwise(edges))


def fill_missing(path: Path, table: pd.DataFrame, known: list[str]) -> Cleaned:
    """Interpolate short runs of missing values.

    Up to :data:`LONGEST_GAP` missing values in a row are interpolated linearly. The channel of a slow
    instrument, which has a value in every n-th row only, keeps each value until the next one. Text that
    is no number is left for the check of numbers.

    Raises:
        RecordingError: more values are missing in a row; gives the column, the row and the count.
    """
    messages = []
    for column in (c for c in known if c != TIME and c in table):
        missing = table[column].isna().to_numpy()
        if not missing.any() or missing.all():
            continue
        numbers = pd.to_numeric(table[column], errors="coerce")
        if (numbers.isna().to_numpy() & ~missing).any():
            continue  # A later check refuses the text and names the column.
        present = np.flatnonzero(~missing)
        edges = np.concatenate([[-1], present, [len(table)]])
        runs = np.diff(edges) - 1
        every = int(np.median(np.diff(present))) if len(present) > 2 else 1
        regular = every > 1 and np.mean(np.diff(present) == every) >= _SPARSE
        total = f"{missing.sum()} of {len(table)}"
        if regular and runs.max() <= every + LONGEST_GAP:
            whole = numbers.ffill().bfill()
            done = f" has a value in every {every} rows; each was kept until the next value"
        elif runs.max() > LONGEST_GAP:
            row = int(edges[int(np.argmax(runs))]) + 2
            said = table.attrs.get("texts", {}).get(column)
            raise RecordingError(
                f"{path}: {column}, row {row}: {runs.max()} values in a row are missing ({total} in "
                f"all); up to {LONGEST_GAP} are interpolated; cut the recording there and use the "
                "parts, or leave the column out"
                + (f". Text counts as missing: {said}" if said else "")
            )
        else:
            whole = numbers.interpolate(limit_direction="both")
            done = (
                f": {total} values were missing, up to {runs.max()} in a row, first in row "
                f"{int(np.argmax(missing)) + 1}; they were interpolated linearly"
            )
        table = table.assign(**{column: whole})
        messages.append(f"{column}{done}")
    return table, messages


def complete_log(table: pd.DataFrame, columns: list[str]) -> Cleaned:
    """Make columns of a ship's log that no simulation uses finite, or drop them.

    A cell that is no number or outside the range of its column is missing, and is interpolated
    between the other rows, across gaps of any length. A column with values in less than half of
    the rows is left out.
    """
    warnings, rows = [], np.arange(len(table), dtype=np.float64)
    for column in columns:
        low, high, unit = BOUNDS[column]
        numbers = np.array(pd.to_numeric(table[column], errors="coerce"), dtype=np.float64)
        outside = np.isfinite(numbers) & ~((numbers >= low) & (numbers <= high))
        missing = outside | ~np.isfinite(numbers)
        said = f"{missing.sum()} of {len(table)} values are missing"
        if outside.any():
            row = int(np.argmax(outside))
            said = (
                f"{said}, {outside.sum()} of them outside {low:g} to {high:g} {unit} (first in row "
                f"{row + 1}: {numbers[row]:g}; check the unit)"
            )
        if 2 * missing.sum() > len(table):
            table = table.drop(columns=column)
            warnings.append(f"{column}: {said}; the column was left out")
            continue
        if missing.any():
            warnings.append(f"{column}: {said}; they were interpolated")
            numbers[missing] = np.nan
            numbers = interpolate(rows, rows, numbers, column)
        table = table.assign(**{column: numbers})
    return table, warnings


def refuse_falling_time(path: Path, time: Array, falls: NDArray[np.bool_], more: str = "") -> None:
    """Raise a RecordingError at the first row whose step of time (row - 1,) is marked as a fall."""
    if falls.any():
        row = int(np.argmax(falls)) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: {time[row - 1]:g} s after {time[row - 2]:g} s; time must "
            f"rise from row to row; sort the rows by it{more}"
        )


def resample_evenly(path: Path, table: pd.DataFrame) -> Cleaned:
    """Average rows with the same time and interpolate the finite values onto an even time base.

    Raises:
        RecordingError: time falls or is negative, the usual step is outside 0.1 ms to 5 s, or a gap is
            too long to be interpolated.
    """
    messages = []
    steps = np.diff(table[TIME].to_numpy())
    if 0.0 < np.mean(steps == 0.0) <= _REPEATED and (steps >= 0.0).all():
        row = int(np.argmax(steps == 0.0)) + 2
        messages.append(
            f"{np.sum(steps == 0.0)} rows have the time of the row before, first row {row}; such rows "
            "were averaged"
        )
        table = table.groupby(TIME, as_index=False).mean()[[*table]]
    time = table[TIME].to_numpy()
    steps = np.diff(time)
    refuse_falling_time(path, time, steps <= 0.0, ", or cut the recording there")
    if time[0] < 0.0:
        raise RecordingError(
            f"{path}: {TIME} begins at {time[0]:g} s, and no time may be negative; subtract the first "
            f"value, or set offset = {-time[0]:g} in the column map"
        )
    usual = float(np.median(steps))
    if not _FASTEST_S * (1.0 - _EVEN) <= usual <= _SLOWEST_S:
        slow = usual > _SLOWEST_S
        steady = "; if each row is an equilibrium, use --steady (steady=True)" if slow else ""
        raise RecordingError(
            f"{path}: {TIME} steps by {usual:.4g} s from row to row; allowed: {_FASTEST_S:g} to "
            f"{_SLOWEST_S:g} s, or rows so far apart that the ship settles between them{steady}; if "
            "time counts another unit, set it in the column map (for example "
            f'unit = "{"ms" if slow else "day"}")'
        )
    gaps = np.flatnonzero(steps > 1.5 * usual)
    long = gaps[steps[gaps] > (LONGEST_GAP + 1.5) * usual]
    if len(long):
        row = int(long[0]) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: a gap of {steps[row - 2]:.4g} s after {time[row - 2]:g} s "
            f"where {usual:.4g} s is usual ({len(long)} such gaps; up to {LONGEST_GAP} missing "
            "samples are interpolated); cut the recording there and use the parts, each of at least "
            f"{FEWEST_ROWS} rows"
        )
    off = np.abs(steps - usual)
    uneven = off > 0.5 * usual
    if not len(gaps) and (off <= _EVEN * usual).all():
        return table, messages
    onto = "every channel was interpolated linearly onto an even time base"
    if uneven.mean() > _UNEVEN:
        messages.append(
            f"steps of time range from {steps.min():.3g} to {steps.max():.3g} s, {uneven.mean():.0%} of "
            f"them differ by more than half from the usual {usual:.4g} s; {onto}, which reduces its "
            "noise"
        )
    elif len(gaps):
        rows = ", ".join(str(row + 2) for row in gaps[:5]) + (", ..." if len(gaps) > 5 else "")
        messages.append(f"samples are missing before row {rows}; they were interpolated linearly")
    worst = float(np.max(off[steps <= 1.5 * usual]))
    if worst > _EVEN * usual and uneven.mean() <= _UNEVEN:
        messages.append(
            f"steps of time differ by up to {worst:.2g} s from the usual {usual:.4g} s; {onto}"
        )
    count = round((time[-1] - time[0]) / float(np.mean(steps[~uneven]))) + 1
    even = np.linspace(time[0], time[-1], count)
    columns = {c: interpolate(even, time, table[c].to_numpy(), c) for c in table} | {TIME: even}
    return pd.DataFrame(columns), messages
