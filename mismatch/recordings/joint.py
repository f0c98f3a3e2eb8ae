"""Recordings of one condition of a ship, read to be diagnosed together."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import pandas as pd

from ...plant.recording import RecordingError
from ...plant.ship import Ship
from ..progress import Tick, silent
from .checks import TOO_SHORT, too_short
from .common_interval import at_common_interval
from .load import TABLE, Recording
from .overlap import refuse_overlap
from .parts import load_parts
from .time_base import LEAST_OF_ONE

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
