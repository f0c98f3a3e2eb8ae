"""Read several recordings of one condition of a ship for a joint diagnosis.

The recordings are resampled to the longest of their sampling intervals. Recordings that share rows are
refused, because held-out data must not be part of the fitted data.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import HEADING, MEASURED, SHAFT_ANGLE, TIME
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from ..estimate import Tick, ignore_progress
from .checks import TOO_SHORT, length_limits
from .course import SEVERAL_COURSES, has_several_courses
from .load import TABLE, Recording, load_parts
from .noise import estimate_noise
from .time_base import FEWEST_ROWS
from .unit_errors import command_columns

ALIKE = 0.01  # relative difference up to which two sampling intervals count as equal
MAX_INTERVAL_RATIO = 20.0  # largest ratio of the sampling intervals in a joint diagnosis


def at_common_interval(ship: Ship, recordings: Sequence[Recording]) -> list[Recording]:
    """Resample recordings to the longest of their sampling intervals by linear interpolation.

    Measured channels of a recording that is much faster are averaged over one new interval first. Each
    recording that was resampled has a warning.

    Raises:
        RecordingError: the intervals differ by more than a factor of :data:`MAX_INTERVAL_RATIO`.
    """
    slowest = max(recordings, key=lambda one: one.interval_s, default=None)
    if slowest is None:
        return []
    result = []
    for one in recordings:
        ratio = slowest.interval_s / one.interval_s
        if ratio > MAX_INTERVAL_RATIO:
            raise RecordingError(
                f"{one.source}: a row every {one.interval_s:.4g} s, {slowest.source}: a row every "
                f"{slowest.interval_s:.4g} s; up to {MAX_INTERVAL_RATIO:g} times as many rows are "
                "allowed in a joint diagnosis; leave one recording out or average the faster one"
            )
        result.append(one if ratio <= 1.0 + ALIKE else _slowed(ship, one, slowest.interval_s))
    return result


def _slowed(ship: Ship, one: Recording, interval_s: float) -> Recording:
    """Return a recording at a longer sampling interval."""
    time, width = one.time_s, round(interval_s / one.interval_s)
    even = time[0] + interval_s * np.arange(int((time[-1] - time[0]) / interval_s + 1e-9) + 1)
    commands = command_columns(ship, one.table)

    def at(column: str) -> NDArray[np.float64]:
        values = one[column]
        if column not in commands and width > 1:
            values = scipy.ndimage.uniform_filter1d(values, width, mode="nearest")
        return np.asarray(np.interp(even, time, values))

    table = pd.DataFrame({c: even if c == TIME else at(str(c)) for c in one.table})
    noise = {c: estimate_noise(table[c].to_numpy(), interval_s) for c in one.noise}
    warning = (
        f"resampled from one row every {one.interval_s:.4g} s to one row every {interval_s:.4g} s, the "
        "interval of the slowest recording"
    )
    return replace(
        one, table=table, interval_s=interval_s, noise=noise, warnings=(*one.warnings, warning)
    )


LEAST_REPEATED = 10
"""Number of consecutive equal rows, all different from each other, from which two recordings overlap.
Fewer may agree by chance on a ship at rest with coarse instruments."""


def refuse_overlap(recordings: Sequence[Recording], why: str) -> None:
    """Refuse recordings if two of them hold the same part of a voyage.

    Raises:
        RecordingError: gives the two recordings, the shared rows and the reason ``why``.
    """
    for one, other in combinations(recordings, 2):
        refuse_common_rows(one, other, why)


def refuse_common_rows(one: Recording, other: Recording, why: str) -> None:
    """Refuse two recordings that hold the same part of a voyage.

    Time stamps are not compared: a copy may count time from another start. Arguments and errors are
    those of :func:`refuse_overlap`.
    """
    # A heading or an angle may have another zero in a copy, too.
    columns = [c for c in one.channels if c in other and c not in (SHAFT_ANGLE, HEADING, TIME)]
    if not columns:
        return
    first, length = _repeated(_rows(one, columns), _rows(other, columns))
    if length < LEAST_REPEATED:
        return
    # Two runs that start from rest share rows in which no measured channel varies, and are no copies.
    measured = other.table[[c for c in columns if c in MEASURED]].to_numpy(dtype=np.float64)
    if np.any(np.ptp(measured[first : first + length], axis=0) > 0.0):
        raise RecordingError(
            f"{other.source}: rows {first + 1} to {first + length} are in {one.source} as well; {why}"
        )


def _rows(recording: Recording, columns: Sequence[str]) -> NDArray[np.void]:
    values = np.ascontiguousarray(recording.table[list(columns)].to_numpy(dtype=np.float64)) + 0.0
    return values.view(np.dtype((np.void, values.itemsize * len(columns)))).ravel()


def _repeated(one: NDArray[np.void], other: NDArray[np.void]) -> tuple[int, int]:
    """Return first row and length of the longest part of the second that the first also holds.

    Rows that occur more than once in either do not identify a moment, and end a part.
    """
    places = [pd.Series(np.arange(len(rows)), index=rows.tolist()) for rows in (one, other)]
    first, second = (own[~own.index.duplicated(keep=False)] for own in places)
    there = first.reindex(second.index)
    known = there.notna().to_numpy()
    if not known.any():
        return 0, 0
    own, here = there.to_numpy()[known], second.to_numpy()[known]
    breaks = (np.diff(own) != 1) | (np.diff(here) != 1)
    starts = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    lengths = np.diff(np.append(starts, len(here)))
    longest = int(np.flatnonzero(lengths == lengths.max())[-1])
    return int(here[starts[longest]]), int(lengths[longest])


LEAST_ROWS = 40  # fewest rows of all fitted recordings, so that a part can be held out

Recorded: TypeAlias = str | Path | Recording | pd.DataFrame
"""Recording as a CSV or Parquet file, a table, or the result of :func:`.load_recording`."""

NO_COMMON_ROWS = "held-out rows must not be fitted, and no row may count twice: give each part once"


@dataclass(frozen=True)
class JointRecordings:
    """Recordings of a joint diagnosis.

    Args:
        tables: canonical columns at an even interval; held-out recordings come last.
        held_out: number of held-out recordings.
        limits: reasons why the recordings may not allow a decision.
        warnings: warnings on the recordings.
        signals: units of the signals for terms that all recordings have, by name.
        steady: whether each row is an equilibrium at the inputs of that row.
        through_water: whether the ship speed of all recordings is that through the water.
        measured_pitch: whether the pitch command of all recordings is the measured pitch.
    """

    tables: tuple[pd.DataFrame, ...]
    held_out: int
    limits: list[str]
    warnings: list[str]
    signals: dict[str, str]
    steady: bool = False
    through_water: bool = False
    measured_pitch: bool = False

    @property
    def interval_s(self) -> float:
        """Interval between the rows [s]."""
        time = self.tables[0][TIME]
        return float(time.iloc[-1] - time.iloc[0]) / (len(time) - 1)


def load_jointly(
    ship: Ship,
    fitted: Sequence[Recorded],
    held_out: Sequence[Recorded] = (),
    columns: str | Path | None = None,
    tick: Tick = ignore_progress,
    signals: Mapping[str, str] = MappingProxyType({}),
) -> JointRecordings:
    """Read and check the recordings of a joint diagnosis.

    Example:
        >>> from shaftline.mismatch.example import COLUMN_MAP, FOLDER, RECORDING, SHIP_FILE
        >>> from shaftline.plant import load_ship
        >>> ship = load_ship(FOLDER / SHIP_FILE)
        >>> joint = load_jointly(ship, [FOLDER / RECORDING], columns=FOLDER / COLUMN_MAP)
        >>> len(joint.tables), joint.held_out, joint.limits
        (1, 0, [])

    Args:
        ship: the nominal ship.
        fitted: recordings to be fitted, at least one.
        held_out: recordings kept for the validation.
        columns: column map of the files, or None.
        tick: progress callback.
        signals: units of columns that are signals for terms, by name, in addition to those of the ship
            and of the column map.

    Raises:
        RecordingError: a recording or the column map cannot be used, with file, column and row; or a
            recording, or all fitted recordings together, have too few rows; or two recordings hold the
            same part of a voyage.
        ValueError: there is no recording to fit, or a file is given twice.
    """
    sources = [*fitted, *held_out]
    if not fitted:
        raise ValueError("no recording to fit: give at least one recording that is not held out")
    refuse_repeated_sources(sources)
    groups = load_each(ship, sources, columns, tick, signals)
    count = len(flatten(groups[: len(fitted)]))
    loaded = flatten(groups)
    steady = {recording.steady: recording.source for recording in loaded}
    if len(steady) > 1:
        raise RecordingError(
            f"{steady[True]} has rows that are equilibria, {steady[False]} has rows in transient "
            "motion; diagnose them separately, or use --steady if all rows are equilibria"
        )
    measured = {recording.measured_pitch: recording.source for recording in loaded}
    if len(measured) > 1:
        raise RecordingError(
            f"{measured[False]} has a pitch_ratio_command, {measured[True]} has the measured pitch "
            "alone; diagnose them separately"
        )
    if False in steady:
        loaded = at_common_interval(ship, loaded)
    refuse_too_few_rows(loaded[:count])
    refuse_overlap(loaded, NO_COMMON_ROWS)
    limits, warnings = _limits_and_warnings(loaded[:count], loaded, ship)
    common = {n: u for n, u in loaded[0].signals.items() if all(n in r.signals for r in loaded)}
    tables = tuple(r.table for r in loaded)
    water = all(recording.through_water for recording in loaded)
    return JointRecordings(
        tables,
        len(loaded) - count,
        limits,
        warnings,
        common,
        True in steady,
        water,
        True in measured,
    )


def refuse_too_few_rows(recordings: Sequence[Recording]) -> None:
    """Refuse recordings that together have fewer rows than :data:`LEAST_ROWS`.

    Raises:
        RecordingError: gives the number of rows and the number that is needed.
    """
    rows = sum(map(len, recordings))
    if rows < LEAST_ROWS:
        names = " and ".join(str(recording.source) for recording in recordings)
        raise RecordingError(f"{names}: {rows} rows; at least {LEAST_ROWS} are needed")


def refuse_repeated_sources(
    sources: Sequence[Recorded], others: Sequence[Recorded] = (), why: str = NO_COMMON_ROWS
) -> None:
    """Refuse a file or a table that is given twice, or also among the others, before any file is read.

    Raises:
        TypeError: a source is neither a file nor a table nor a recording.
        ValueError: gives the source that occurs twice, and the reason ``why``.
    """
    for source in (*sources, *others):
        if not isinstance(source, str | Path | Recording | pd.DataFrame):
            raise TypeError(
                "a recording is the path of a file, a pandas.DataFrame or a Recording, not "
                f"{type(source).__name__}"
            )
    known: set[object] = {_identity(source) for source in others}
    for source in sources:
        own = _identity(source)
        if own in known:
            name = source if isinstance(source, str | Path) else TABLE
            raise ValueError(f"{name} is given twice; {why}")
        known.add(own)


def _identity(source: Recorded) -> object:
    return os.path.realpath(source) if isinstance(source, str | Path) else id(source)


def load_each(
    ship: Ship,
    sources: Sequence[Recorded],
    columns: str | Path | None = None,
    tick: Tick = ignore_progress,
    signals: Mapping[str, str] = MappingProxyType({}),
    steady: bool = False,
) -> list[list[Recording]]:
    """Read and check recordings separately; a recording with long gaps is cut there into parts.

    The arguments are those of :func:`load_jointly` and :func:`.load.load_recording`.

    Returns:
        The parts of each source.

    Raises:
        RecordingError: a recording or the column map cannot be used, or a part has too few rows.
    """
    tables = [id(source) for source in sources if isinstance(source, pd.DataFrame)]
    loaded: list[list[Recording]] = []
    for done, source in enumerate(sources):
        tick("loading recordings", done, len(sources))
        if isinstance(source, Recording):
            found = [source]
        else:
            several = len(tables) > 1 and id(source) in tables
            name = f"{TABLE} {tables.index(id(source)) + 1}" if several else TABLE
            found = load_parts(source, ship, columns, signals, name, steady)
        for recording in found:
            if len(recording) < FEWEST_ROWS:
                raise RecordingError(
                    f"{recording.source}: {len(recording)} rows; at least {FEWEST_ROWS} are needed in "
                    "each recording"
                )
        loaded.append(found)
    tick("loading recordings", len(sources), len(sources))
    return loaded


def flatten(groups: Iterable[list[Recording]]) -> list[Recording]:
    """Return the parts of several sources in one list, in their order."""
    return list(chain.from_iterable(groups))


def _limits_and_warnings(
    fitted: list[Recording], loaded: list[Recording], ship: Ship
) -> tuple[list[str], list[str]]:
    """Return the limits and warnings of several recordings, each with the name of its recording.

    The lengths of the fitted recordings are added. Other limits remain limits only if every fitted
    recording has one; else they become warnings, because another recording may identify the effect.
    """
    if len(loaded) == 1:
        return list(loaded[0].limits), list(loaded[0].warnings)

    def others(recording: Recording) -> list[str]:
        other = [limit for limit in recording.limits if not limit.startswith(TOO_SHORT)]
        return [f"{recording.source.name}: {limit}" for limit in other]

    warnings = [f"{r.source.name}: {warning}" for r in loaded for warning in r.warnings]
    if any(r.over_ground for r in loaded) and has_several_courses(r.navigation for r in loaded):
        warnings.append(SEVERAL_COURSES)
    together = []
    if any(limit.startswith(TOO_SHORT) for r in fitted for limit in r.limits):
        together = length_limits([r.table for r in fitted], fitted[0].interval_s, ship)
    if all(map(others, fitted)):
        return [*together, *chain.from_iterable(map(others, fitted))], warnings
    return together, [*warnings, *chain.from_iterable(map(others, loaded))]
