"""Recordings of one condition of a ship, read to be diagnosed together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

import pandas as pd

from ...plant.columns import TIME
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from ..progress import Tick, silent
from .checks import TOO_SHORT, too_short
from .load import Recording, load_recording

LEAST_ROWS = 40
"""Of all recordings that are fitted together, so that there is something to fit and to set aside."""

LEAST_OF_ONE = 10
"""Of each: parts of a voyage in which the ship sails straight may be as short as this."""

Recorded: TypeAlias = str | Path | Recording | pd.DataFrame
"""A CSV or Parquet file; what :func:`.load_recording` made of one; or a table with canonical columns at
an even interval, all finite, which is taken as it is."""


@dataclass(frozen=True)
class JointRecordings:
    """Recordings that are diagnosed together.

    Args:
        tables: canonical columns at an even interval; those set aside come last.
        held_out: how many are set aside.
        limits: why they may not decide.
        warnings: what was noticed about them.
        signals: units of what terms may hear in all of them, by name.
    """

    tables: tuple[pd.DataFrame, ...]
    held_out: int
    limits: list[str]
    warnings: list[str]
    signals: dict[str, str]


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
            Or too few rows: of one of them, or of all that is fitted.
        ValueError: nothing to fit, or a file that is given twice.
    """
    sources = [*fitted, *held_out]
    if not fitted:
        raise ValueError("no recording to fit: give at least one that is not set aside")
    paths = [Path(source) for source in sources if isinstance(source, str | Path)]
    twice = [path for i, path in enumerate(paths) if path in paths[:i]]
    if twice:
        raise ValueError(f"{twice[0]} is given twice; what is set aside must not be fitted")
    loaded = []
    for done, source in enumerate(sources):
        tick("reading and checking", done, len(sources))
        loaded.append(_loaded(source, ship, columns, signals))
    tick("reading and checking", len(sources), len(sources))
    refuse_few(loaded[: len(fitted)])
    limits, warnings = _said(loaded[: len(fitted)], loaded, ship)
    heard = {n: u for n, u in loaded[0].signals.items() if all(n in r.signals for r in loaded)}
    tables = tuple(r.table for r in loaded)
    return JointRecordings(tables, len(held_out), limits, warnings, heard)


def refuse_few(recordings: Sequence[Recording]) -> None:
    """Refuse recordings that have too few rows together.

    Raises:
        RecordingError: says how many are needed.
    """
    rows = sum(map(len, recordings))
    if rows < LEAST_ROWS:
        names = " and ".join(str(recording.source) for recording in recordings)
        raise RecordingError(f"{names}: {rows} rows; at least {LEAST_ROWS} are needed")


def _loaded(
    source: Recorded, ship: Ship, columns: str | Path | None, signals: Mapping[str, str]
) -> Recording:
    if isinstance(source, Recording):
        recording = source
    elif isinstance(source, pd.DataFrame):
        interval = float(source[TIME].diff().mean())
        heard = {n: unit for n, unit in {**signals, **ship.signals}.items() if n in source}
        recording = Recording(Path("table"), source, interval, {}, signals=heard)
    else:
        recording = load_recording(source, ship, columns, signals)
    if len(recording) < LEAST_OF_ONE:
        raise RecordingError(
            f"{recording.source}: {len(recording)} rows; at least {LEAST_OF_ONE} are needed of each"
        )
    return recording


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
