"""What a study hands to ``shaftline reproduce``: one published table with ours beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

Tick = Callable[[], None]
"""Called once for each part of the work that is done."""


@dataclass(frozen=True)
class Reproduced:
    """One reproduced table: to print, and the numbers by row and column for JSON."""

    title: str
    shown: pd.DataFrame
    reasons: str
    numbers: dict[str, Any]
