"""Runs of rows."""

from __future__ import annotations

from typing import Any

import numpy as np


def true_runs(flags: Any) -> list[tuple[int, int]]:
    """Return the first row of each run of true rows, and the row after its last.

    >>> true_runs([False, True, True, False, True])
    [(1, 3), (4, 5)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
