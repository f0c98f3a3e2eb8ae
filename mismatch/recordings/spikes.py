"""Values that jump away and back again: dropouts and spikes of a sensor, its cable or its logger.

Told by their shape alone, so that no event of the voyage is taken for one: up to three rows far from
both neighbours, by many times what the channel moves from row to row, while the neighbours agree. A step
of an order, a reversal or an emerging propeller does not come back to where it was within so few rows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import BOUNDS
from ...plant.recording import RecordingError
from .time_base import LONGEST_GAP

_USUAL = 75.0  # per cent of the steps from row to row are no larger than the usual step
_FAR, _NEAR = 15.0, 4.0  # usual steps: away from the neighbours, and between those
_MOST = 0.05  # share of the rows; a channel with more is no measurement


def spikes(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Which samples stand far from both their neighbours, which agree.

    Args:
        values: (n,) samples, evenly spaced and finite.

    Returns:
        Shape (n,); none in a channel that hardly ever moves.
    """
    found = np.zeros(len(values), dtype=np.bool_)
    steps = np.diff(values)
    usual = float(np.percentile(np.abs(steps), _USUAL)) if len(steps) else 0.0
    if usual == 0.0:
        return found
    calm = np.abs(steps) <= _NEAR * usual
    for width in range(1, LONGEST_GAP + 1):
        # from the third row to the last but two: one of the neighbours must be at rest itself
        into, back = steps[1 : -width - 1], steps[width + 1 : -1]
        apart = values[width + 2 : -1] - values[1 : -width - 2]
        hit = ((into < 0.0) != (back < 0.0)) & (
            np.minimum(np.abs(into), np.abs(back)) > _FAR * usual
        )
        hit &= (np.abs(apart) <= _NEAR * usual) & (calm[: -width - 2] | calm[width + 2 :])
        for offset in range(width):
            found[2 + offset : 2 + offset + len(hit)] |= hit
    return found


def without_spikes(
    path: Path, table: pd.DataFrame, columns: list[str]
) -> tuple[pd.DataFrame, list[str]]:
    """The table with spikes of measured channels put on a line between their neighbours, and remarks.

    Args:
        path: for messages.
        table: finite, on an even time base.
        columns: that are looked at.

    Raises:
        RecordingError: a channel has too many to be a measurement.
    """
    mended, said = {}, []
    for column in columns:
        values = table[column].to_numpy()
        far = spikes(values)
        if not far.any():
            continue
        first, unit = int(np.argmax(far)), BOUNDS[column][2]
        what = (
            f"{column}: {far.sum()} of {len(far)} values are spikes that the next rows know nothing "
            f"of, first in row {first + 1} ({values[first]:.4g} {unit})"
        )
        if far.mean() > _MOST:
            raise RecordingError(
                f"{path}: {what}; more than {_MOST:.0%} of the rows: mend it or leave the column out"
            )
        rows = np.arange(len(values))
        mended[column] = np.interp(rows, rows[~far], values[~far])
        said.append(f"{what}; they were interpolated linearly")
    return table.assign(**mended), said
