"""The result of a study: the source's tables beside ours, and the cells that ``reproduce`` counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from .cells import Cell

Tick = Callable[[], None]
"""Called once for each part of the work that is done."""


@dataclass(frozen=True)
class Reproduced:
    """One reproduced source: its table for the console, and its numbers for files.

    Args:
        title: heading of the table.
        shown: the table.
        reasons: why numbers differ, one list item a reason.
        numbers: our numbers by row and column, for JSON.
        cells: every printed number of the source that the study compares.
    """

    title: str
    shown: pd.DataFrame
    reasons: str
    numbers: dict[str, Any]
    cells: Sequence[Cell]


Make: TypeAlias = Callable[[Path, Tick], Reproduced]
"""Makes a page in a folder."""
