"""How closely a simulation follows the channels of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROUNDING = 1e-12
"""Share of a channel's size within which it is constant: a mean of equal numbers rounds."""


def fit_percent(measured: Any, simulated: Any) -> float:
    """FitPercent = 100 (1 - ||y - y_sim|| / ||y - mean(y)||).

    Args:
        measured: y, shape (n,).
        simulated: likewise, in the same unit.

    Returns:
        100 is perfect, 0 no better than the mean. NaN of a channel that is constant, which has no
        spread to measure by.
    """
    measured = np.asarray(measured, dtype=np.float64)
    if np.ptp(measured) <= ROUNDING * np.abs(measured).max():
        return float("nan")
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    return 100.0 * (1.0 - float(np.linalg.norm(measured - simulated)) / spread)


def fits(
    measured: Mapping[str, NDArray[np.float64]],
    simulated: Mapping[str, NDArray[np.float64]],
    rows: NDArray[np.int64],
) -> dict[str, float]:
    """FitPercent by column, those left out that are constant.

    Args:
        measured: channels by column, each of shape (n,).
        simulated: likewise.
        rows: that are judged.
    """
    found = {c: fit_percent(y[rows], simulated[c][rows]) for c, y in measured.items()}
    return {c: value for c, value in found.items() if not np.isnan(value)}


def rms_errors(
    measured: Mapping[str, NDArray[np.float64]],
    simulated: Mapping[str, NDArray[np.float64]],
    rows: NDArray[Any],
) -> dict[str, float]:
    """Rms of measured minus simulated by column, in its unit.

    Args:
        measured: channels by column, each of shape (n,).
        simulated: likewise.
        rows: that are judged, as indices or as a mask.
    """
    return {
        c: float(np.sqrt(np.mean((y[rows] - simulated[c][rows]) ** 2))) for c, y in measured.items()
    }
