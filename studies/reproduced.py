"""What a study hands to ``shaftline reproduce``: one published table with ours beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pandas as pd

from .side_by_side import UNEXPLAINED

Tick = Callable[[], None]
"""Called once for each part of the work that is done."""


class Cells(NamedTuple):
    """How a table's printed numbers are met.

    Args:
        met: within the tolerance that the page states.
        differ: beyond it, each with its reason.
        unexplained: beyond it, without one.
    """

    met: int
    differ: int
    unexplained: int


def cells_of(comparison: pd.DataFrame) -> Cells:
    """Count a table whose column ``why`` is empty where a number is met.

    Args:
        comparison: a row a cell.
    """
    why = comparison["why"]
    if "thesis" in comparison:
        why = why[comparison["thesis"].notna()]
    open_ = int((why == UNEXPLAINED).sum())
    return Cells(int((why == "").sum()), int((why != "").sum()) - open_, open_)


@dataclass(frozen=True)
class Reproduced:
    """One reproduced table: to print, and the numbers by row and column for JSON."""

    title: str
    shown: pd.DataFrame
    reasons: str
    numbers: dict[str, Any]
    cells: Cells | None = None
    """How its numbers are met; None where the page tells it in words alone."""


Make: TypeAlias = Callable[[Path, Tick], Reproduced]
"""Makes a page in a folder."""
