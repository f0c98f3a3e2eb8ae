"""Recordings of different sampling rates, brought to the slowest of them.

Recordings that repeat each other's rows: held-out data must not be among the fitted data.

Recordings of one condition of a ship, read to be diagnosed together.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ...plant.columns import HEADING, MEASURED, SHAFT_ANGLE, TIME
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from ..estimate import Tick, silent
from .checks import TOO_SHORT, too_short
from .load import TABLE, Recording, load_parts
from .noise import describe
from .time_base import LEAST_OF_ONE
from .unit_errors import demands

ALIKE = 0.01
"""Share by which sampling intervals may differ and still be the same."""

MOST_APART = 20.0
"""Ratio of sampling intervals up to which recordings are diagnosed together."""


def at_common_interval(ship: Ship, recordings: Sequence[Recording]) -> list[Recording]:
    """Bring recordings to the longest of their sampling intervals by linear interpolation.

    Measured channels of a recording that is much faster are averaged over one new interval first.

    Args:
        ship: the nominal ship.
        recordings: each on an even time base.

    Returns:
        The recordings; those that were changed say so in their warnings.

    Raises:
        RecordingError: the intervals differ by more than a factor of :data:`MOST_APART`.
    """
    slowest = max(recordings, key=lambda one: one.interval_s, default=None)
    if slowest is None:
        return []
    result = []
    for one in recordings:
        ratio = slowest.interval_s / one.interval_s
        if ratio > MOST_APART:
            raise RecordingError(
                f"{one.source}: a row every {one.interval_s:.4g} s, {slowest.source}: a row every "
                f"{slowest.interval_s:.4g} s; up to {MOST_APART:g} times apart they can be diagnosed "
                "together; leave one out or average the faster one"
            )
        result.append(one if ratio <= 1.0 + ALIKE else _slowed(ship, one, slowest.interval_s))
    return result


def _slowed(ship: Ship, one: Recording, interval_s: float) -> Recording:
    """Return a recording at a longer sampling interval."""
    time, width = one.time_s, round(interval_s / one.interval_s)
    even = time[0] + interval_s * np.arange(int((time[-1] - time[0]) / interval_s + 1e-9) + 1)
    ordered = demands(ship, one.table)

    def at(column: str) -> NDArray[np.float64]:
        values = one[column]
        if column not in ordered and width > 1:
            values = uniform_filter1d(values, width, mode="nearest")
        return np.asarray(np.interp(even, time, values))

    table = pd.DataFrame({c: even if c == TIME else at(str(c)) for c in one.table})
    noise = {c: describe(table[c].to_numpy(), interval_s) for c in one.noise}
    said = (
        f"its rows, one every {one.interval_s:.4g} s, were brought to one every {interval_s:.4g} s, the "
        "interval of the slowest recording"
    )
    return replace(
        one, table=table, interval_s=interval_s, noise=noise, warnings=(*one.warnings, said)
    )


LEAST_REPEATED = 10
"""Rows in a row, no two of them alike, from which on two recordings overlap. Fewer may agree by chance
where a ship rests and its instruments are coarse."""


def refuse_overlap(recordings: Sequence[Recording], why: str) -> None:
    """Refuse recordings two of which hold the same stretch of a voyage.

    Args:
        recordings: any number.
        why: they must not, as the end of the message.

    Raises:
        RecordingError: names two of them, the rows that are repeated, and the reason.
    """
    for one, other in combinations(recordings, 2):
        refuse_shared(one, other, why)


def refuse_shared(one: Recording, other: Recording, why: str) -> None:
    """Refuse two recordings that hold the same stretch of a voyage.

    Time stamps are not compared: a copy may count from elsewhere.

    Args:
        one: a recording.
        other: another.
        why: they must not share rows, as the end of the message.

    Raises:
        RecordingError: as of :func:`refuse_overlap`.
    """
    # a heading or an angle may have been counted from elsewhere too
    columns = [c for c in one.channels if c in other and c not in (SHAFT_ANGLE, HEADING, TIME)]
    if not columns:
        return
    first, length = _repeated(_rows(one, columns), _rows(other, columns))
    if length < LEAST_REPEATED:
        return
    # a command that is alike while nothing moves is no copy: two runs from rest begin alike
    measured = other.table[[c for c in columns if c in MEASURED]].to_numpy(dtype=np.float64)
    if np.any(np.ptp(measured[first : first + length], axis=0) > 0.0):
        raise RecordingError(
            f"{other.source}: rows {first + 1} to {first + length} stand in {one.source} as well; {why}"
        )


def _rows(recording: Recording, columns: Sequence[str]) -> NDArray[np.void]:
    values = np.ascontiguousarray(recording.table[list(columns)].to_numpy(dtype=np.float64)) + 0.0
    return values.view(np.dtype((np.void, values.itemsize * len(columns)))).ravel()


def _repeated(one: NDArray[np.void], other: NDArray[np.void]) -> tuple[int, int]:
    """First row and length of the longest stretch of the second that follows the first row by row.

    Rows that occur more than once in either are no mark of a moment and end a stretch.
    """
    places: dict[bytes, int] = {}
    counts: dict[bytes, int] = {}
    for rows, own in ((one, places), (other, counts)):
        for place, row in enumerate(rows.tolist()):
            own[row] = -1 if row in own else place
    best, begin, before = (0, 0), 0, -2
    for place, row in enumerate(other.tolist()):
        there = places.get(row, -1) if counts[row] >= 0 else -1
        if there < 0:
            before = -2
            continue
        if there != before + 1:
            begin = place
        before = there
        best = max(best, (place - begin + 1, begin))
    return best[1], best[0]


LEAST_ROWS = 40
"""Of all recordings that are fitted together, so that there is something to fit and to set aside."""

Recorded: TypeAlias = str | Path | Recording | pd.DataFrame
"""A CSV or Parquet file; a table, which passes the same checks; or what :func:`.load_recording` made of
either."""

NOT_TWICE = "held-out rows must not be fitted, and no row counts twice: give each stretch once"


@dataclass(frozen=True)
class JointRecordings:
    """Recordings that are diagnosed together.

    Args:
        tables: canonical columns at an even interval; those set aside come last.
        held_out: how many are set aside.
        limits: why they may not decide.
        warnings: what was noticed about them.
        signals: units of what terms may hear in all of them, by name.
        steady: whether each row is an equilibrium at the inputs of that row.
    """

    tables: tuple[pd.DataFrame, ...]
    held_out: int
    limits: list[str]
    warnings: list[str]
    signals: dict[str, str]
    steady: bool = False


def load_jointly(
    ship: Ship,
    fitted: Sequence[Recorded],
    held_out: Sequence[Recorded] = (),
    columns: str | Path | None = None,
    tick: Tick = silent,
    signals: Mapping[str, str] = MappingProxyType({}),
) -> JointRecordings:
    """Read and check recordings that are diagnosed together.

    Args:
        ship: the nominal ship.
        fitted: at least one.
        held_out: set aside to judge on.
        columns: column map of the files, or none.
        tick: told how many are read.
        signals: units of columns that terms may hear, by name, besides those of the ship and the map.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
            Or too few rows: of one of them, or of all that is fitted. Or two of them hold the same
            stretch of a voyage, be it under two names.
        ValueError: nothing to fit, or a file that is given twice.
    """
    sources = [*fitted, *held_out]
    if not fitted:
        raise ValueError("no recording to fit: give at least one that is not set aside")
    refuse_twice(sources)
    groups = load_each(ship, sources, columns, tick, signals)
    count = len(parts_of(groups[: len(fitted)]))
    loaded = parts_of(groups)
    _refuse_mixed(loaded)
    if not loaded[0].steady:
        loaded = at_common_interval(ship, loaded)
    to_fit, aside = loaded[:count], loaded[count:]
    refuse_few(to_fit)
    refuse_overlap(loaded, NOT_TWICE)
    limits, warnings = _said(to_fit, loaded, ship)
    heard = {n: u for n, u in loaded[0].signals.items() if all(n in r.signals for r in loaded)}
    tables = tuple(r.table for r in loaded)
    return JointRecordings(tables, len(aside), limits, warnings, heard, loaded[0].steady)


def _refuse_mixed(recordings: Sequence[Recording]) -> None:
    """Refuse recordings of which some have rows that are equilibria and some have not.

    Raises:
        RecordingError: names one of each.
    """
    kinds = {recording.steady: recording.source for recording in recordings}
    if len(kinds) > 1:
        raise RecordingError(
            f"{kinds[True]} has rows that are equilibria, {kinds[False]} has rows that follow the "
            "ship's motion; diagnose them apart, or say --steady where all rows are equilibria"
        )


def refuse_few(recordings: Sequence[Recording]) -> None:
    """Refuse recordings that have too few rows together.

    Raises:
        RecordingError: says how many are needed.
    """
    rows = sum(map(len, recordings))
    if rows < LEAST_ROWS:
        names = " and ".join(str(recording.source) for recording in recordings)
        raise RecordingError(f"{names}: {rows} rows; at least {LEAST_ROWS} are needed")


def refuse_twice(
    sources: Sequence[Recorded], others: Sequence[Recorded] = (), why: str = NOT_TWICE
) -> None:
    """Refuse a file or a table that is given twice, before any is read.

    Args:
        sources: none of which may stand among them, or among the others, again.
        others: any number.
        why: it must not, as the end of the message.

    Raises:
        TypeError: neither a file nor a table.
        ValueError: names it.
    """
    for source in (*sources, *others):
        if not isinstance(source, str | Path | Recording | pd.DataFrame):
            raise TypeError(
                f"a recording is the path of a file, a pandas.DataFrame or a Recording, not "
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
    tick: Tick = silent,
    signals: Mapping[str, str] = MappingProxyType({}),
    steady: bool = False,
) -> list[list[Recording]]:
    """Read and check recordings, each for itself; one with long gaps is cut there into several.

    Args:
        ship: the nominal ship.
        sources: files, tables and recordings that were checked before.
        columns: column map of the files, or none.
        tick: told how many are read.
        signals: as of :func:`load_jointly`.
        steady: whether each row is an equilibrium, as of :func:`.load.load_recording`.

    Returns:
        The parts of each source.

    Raises:
        RecordingError: as of :func:`load_jointly`.
    """
    tables = sum(isinstance(source, pd.DataFrame) for source in sources)
    loaded: list[list[Recording]] = []
    numbered = 0
    for done, source in enumerate(sources):
        tick("reading and checking", done, len(sources))
        if isinstance(source, Recording):
            found = [source]
        else:
            numbered += isinstance(source, pd.DataFrame)
            name = f"{TABLE} {numbered}" if tables > 1 else TABLE
            found = load_parts(source, ship, columns, signals, name, steady)
        for recording in found:
            if len(recording) < LEAST_OF_ONE:
                raise RecordingError(
                    f"{recording.source}: {len(recording)} rows; at least {LEAST_OF_ONE} are needed of "
                    "each"
                )
        loaded.append(found)
    tick("reading and checking", len(sources), len(sources))
    return loaded


def parts_of(groups: Iterable[list[Recording]]) -> list[Recording]:
    """Return the parts of several sources in one list, in their order."""
    return [recording for group in groups for recording in group]


def _said(
    fitted: list[Recording], loaded: list[Recording], ship: Ship
) -> tuple[list[str], list[str]]:
    """Limits and warnings of all recordings; several are named, and limit only where all do.

    Lengths of what is fitted are counted together.
    """
    if len(loaded) == 1:
        return list(loaded[0].limits), list(loaded[0].warnings)
    limits = {id(r): [said for said in r.limits if not said.startswith(TOO_SHORT)] for r in loaded}

    def named(part: Iterable[Recording]) -> list[str]:
        return [f"{r.source.name}: {said}" for r in part for said in limits[id(r)]]

    warnings = [f"{r.source.name}: {said}" for r in loaded for said in r.warnings]
    together = []
    if any(said.startswith(TOO_SHORT) for r in fitted for said in r.limits):
        together = too_short([r.table for r in fitted], fitted[0].interval_s, ship)
    if all(limits[id(recording)] for recording in fitted):
        return together + named(fitted), warnings
    return together, warnings + named(loaded)
