"""Steady states given as a table of points: a row each, without a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from ...plant.columns import COLUMNS, SHAFT_SPEED, TIME, drive_column
from ...plant.recording import RecordingError, as_numbers, check_bounds
from ...plant.ship import Ship
from ..recordings.joint import Recorded
from ..recordings.load import TABLE, Recording, read_mapped


def points_of(
    ship: Ship, sources: Sequence[Recorded], columns: str | Path | None = None
) -> list[pd.DataFrame] | None:
    """Tables of points, where that is what was given.

    Args:
        ship: that was measured.
        sources: files or tables.
        columns: column map of the files, or none.

    Returns:
        Canonical columns, a row each steady state; None where every source has a time.

    Raises:
        RecordingError: a file that cannot be used; names file, column and row.
        ValueError: points beside recordings.
    """
    tables = [_table(ship, source, columns) for source in sources]
    timeless = [TIME not in table for table in tables]
    if not any(timeless):
        return None
    if not all(timeless):
        raise ValueError(
            f"tables of points (without {TIME}) and recordings do not go together; "
            "give one kind or the other"
        )
    return tables


def _table(ship: Ship, source: Recorded, columns: str | Path | None) -> pd.DataFrame:
    if isinstance(source, Recording):
        return source.table
    path = Path(TABLE) if isinstance(source, pd.DataFrame) else Path(source)
    raw, _ = read_mapped(source, ship, columns)
    if TIME in raw:
        return raw
    if not set(raw) & set(COLUMNS):  # then it is no table of points either
        raise RecordingError(
            f"{path}: column {TIME!r} is missing; found: {', '.join(map(str, raw))}"
        )
    table = as_numbers(path, raw, [drive_column(ship), SHAFT_SPEED])[
        [c for c in COLUMNS if c in raw]
    ]
    check_bounds(path, table)
    return table
