"""Commands in physical units and actions in [-1, 1], over the ship's ranges of pitch and fuel rack."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip


@compiled
def decode(value: float, low: float, high: float) -> float:
    """Command in physical units of an action.

    Args:
        value: action in [-1, 1].
        low: command of an action of -1.
        high: command of an action of 1.
    """
    return low + 0.5 * (value + 1.0) * (high - low)


@compiled
def encode(value: float, low: float, high: float) -> float:
    """Action in [-1, 1] of a command in physical units.

    Args:
        value: command; beyond the range it is clipped.
        low: command of an action of -1.
        high: command of an action of 1. Where it equals the lowest, as of a fixed pitch, the action
            is 0.
    """
    half = 0.5 * (high - low)
    if not half > 0.0:
        return 0.0
    return float(clip((value - 0.5 * (low + high)) / half, -1.0, 1.0))


@compiled
def _encode_all(
    value: NDArray[np.float64], low: float, high: float, action: NDArray[np.float32]
) -> None:
    for i in range(len(action)):
        action[i] = encode(value[i], low, high)


def encode_all(value: Any, low: float, high: float) -> NDArray[np.float32]:
    """Actions in [-1, 1] of many commands over one range; as :func:`encode`.

    Args:
        value: commands, shape (n,).
        low: command of an action of -1.
        high: command of an action of 1.
    """
    action = np.empty(np.size(value), np.float32)
    _encode_all(np.ascontiguousarray(value, dtype=np.float64), float(low), float(high), action)
    return action


def actions(plant: Record, pitch_ratio: Any, fuel_rack: Any) -> NDArray[np.float32]:
    """Actions of n ships, shape (n, 2).

    Args:
        plant: PLANT record of a ship with a diesel.
        pitch_ratio: commanded P/D [-], shape (n,).
        fuel_rack: commanded rack [mm], shape (n,).
    """
    return np.column_stack(
        [
            encode_all(pitch_ratio, plant["pitch_ratio_min"], plant["pitch_ratio_max"]),
            encode_all(fuel_rack, plant["drive_min"], plant["drive_max"]),
        ]
    )
