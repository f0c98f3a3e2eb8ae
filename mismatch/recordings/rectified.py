"""Channels that are magnitudes, although what they measure reverses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, SHAFT_SPEED

_SIGNED = ("shaft_torque_N_m", "thrust_N", "ship_speed_m_s", "motor_current_A", SHAFT_SPEED)
_BOTH_WAYS = 0.1  # share of a signal's size that it must reach either way to reverse
_NEVER = 0.02  # share of a channel's size, and
_NOISES = 4.0  # multiple of its noise, by which a magnitude may lie below zero
_RECTIFIED = 0.6  # correlation with the magnitude, and
_CLEARLY = 0.2  # how much larger than that with the signed signal it must be


def rectified_remark(
    table: pd.DataFrame, simulated: pd.DataFrame | None, column: str, drive: str, noise: float
) -> str:
    """Return a remark on a channel that is a magnitude, though what it measures reverses; else "".

    Args:
        table: canonical columns.
        simulated: the nominal ship with the same commands; None where it cannot be simulated, and the
            drive's command stands for it.
        column: measured channel.
        drive: column of the drive's command.
        noise: rms of the channel's white noise.
    """
    if column not in _SIGNED:
        return ""
    source = f"simulated {column}"
    if simulated is not None and column in simulated:
        expected = simulated[column].to_numpy(dtype=float)
    else:
        source, expected = drive, table[drive].to_numpy(dtype=float)
    values = table[column].to_numpy(dtype=float)[: len(expected)]
    size, reach = float(np.abs(values).max()), float(np.abs(expected).max())
    if min(-expected.min(), expected.max()) < _BOTH_WAYS * reach or not size > 0.0:
        return ""
    if values.min() < -max(_NEVER * size, _NOISES * noise):
        return ""
    signed, magnitude = _correlation(values, expected), _correlation(values, np.abs(expected))
    if magnitude < max(_RECTIFIED, signed + _CLEARLY):
        return ""
    return (
        f"{column} looks rectified: it is never below {values.min():.3g} {BOUNDS[column][2]}, "
        f"although the {source} reverses ({np.mean(expected < 0.0):.0%} of the rows below zero); "
        f"its correlation with the magnitude is {magnitude:.2f}, with the signed values {signed:.2f}. "
        f"A column map cannot restore the sign: give the column that of {drive} (numpy.copysign), "
        "turned where the channel passes its minimum, or leave out the rows around reversals"
    )


def _correlation(a: NDArray[Any], b: NDArray[Any]) -> float:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
