"""A recording with long gaps, cut there into several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import pandas as pd

from ...plant.ship import Ship
from .load import TABLE, Recording, checked, read_mapped, refuse_other_types
from .steady_rows import rows_are_steady
from .time_base import LEAST_OF_ONE, parts, times_of

CUT = "the recording was cut"
"""How the remark on the gaps begins."""

MOST_PARTS = 50
"""Parts into which a recording is cut at most; with more its time base is hardly one."""


def load_parts(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    signals: Mapping[str, str] = MappingProxyType({}),
    name: str = TABLE,
    steady: bool = False,
) -> list[Recording]:
    """Read a recording and cut it where more samples are missing than are filled in.

    Each part is checked, and later simulated from its own start. Parts of fewer than
    :data:`.time_base.LEAST_OF_ONE` rows are left out.

    Args:
        source: as of :func:`load_recording`, as are the others.
        ship: the nominal ship.
        columns: column map, or none.
        signals: units of further columns for terms.
        name: of a table, in messages.
        steady: as of :func:`load_recording`; rows that are equilibria need no cut.

    Returns:
        The parts in their order; the first one's warnings say where the recording was cut.

    Raises:
        RecordingError: as of :func:`load_recording`; also where the parts that are long enough hold
            less than half of the rows, or are too many.
    """
    refuse_other_types(source, ship, columns)
    path = Path(name) if isinstance(source, pd.DataFrame) else Path(source)
    raw, mapped = read_mapped(source, ship, columns, name)
    time = times_of(path, raw)
    if rows_are_steady(ship, raw, time, steady):
        return [checked(path, raw, mapped, ship, signals, steady)]
    found = parts(time)
    kept = [(a, b) for a, b in found if b - a >= LEAST_OF_ONE]
    rows = sum(b - a for a, b in kept)
    if len(found) == 1 or len(kept) > MOST_PARTS or 2 * rows < len(raw):
        return [checked(path, raw, mapped, ship, signals)]  # which refuses gaps
    cuts = [f"{time[a] - time[a - 1]:.4g} s before row {a + 1}" for a, _ in found[1:]]
    said = (
        f"{CUT} at {len(cuts)} gap{'s' * (len(cuts) > 1)} ({', '.join(cuts[:5])}"
        f"{', ...' if len(cuts) > 5 else ''}) into {len(kept)} parts, each simulated from its own start"
    )
    if rows < len(raw):
        said += f"; {len(raw) - rows} rows in parts of fewer than {LEAST_OF_ONE} rows were left out"
    result = []
    for number, (a, b) in enumerate(kept, 1):
        part = raw.iloc[a:b].reset_index(drop=True)
        part.attrs = raw.attrs if number == 1 else {}
        own = path.with_name(f"{path.name} part {number} (from row {a + 1})")
        result.append(checked(own, part, mapped, ship, signals))
    result[0] = replace(result[0], warnings=(said, *result[0].warnings))
    return result
