"""Spaces of observations and actions, and the check of an action."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..baselines.controller import NORMALISED_BOUND, OBSERVED
from ..core.compiled import compiled
from ..plant.signals import get_signal
from .batch import Batch

_FAR = 1e9  # bound of what has none [rad, m]


def observation_space(observed: Sequence[str] = OBSERVED) -> spaces.Box:
    """An observation in physical units, with the registry's bounds.

    Args:
        observed: its signals, in order.
    """
    signals = [get_signal(name) for name in observed]
    # a heading that is not wrapped has no bound, but a space without one is of little use
    low = np.array([max(signal.low, -_FAR) for signal in signals], np.float32)
    high = np.array([min(signal.high, _FAR) for signal in signals], np.float32)
    return spaces.Box(low, high, dtype=np.float32)


def action_space(numbers: int = 2) -> spaces.Box:
    """Return the space of an action: pitch, drive and rudder, each in [-1, 1].

    Args:
        numbers: 2, or 3 with the rudder.
    """
    return spaces.Box(-1.0, 1.0, (numbers,), np.float32)


def space_of(batch: Batch) -> spaces.Box:
    """Return the space of one observation: normalised, or in physical units."""
    if batch.settings.normalised:
        bound = NORMALISED_BOUND
        return spaces.Box(-bound, bound, (len(batch.observed),), np.float32)
    return observation_space(batch.observed)


@compiled
def _clip(action: NDArray[np.float32], clipped: NDArray[np.float32]) -> bool:
    """Fill actions clipped to [-1, 1], and return whether all of them are finite."""
    for i in range(len(action)):
        if not math.isfinite(action[i]):
            return False
        clipped[i] = min(max(action[i], np.float32(-1.0)), np.float32(1.0))
    return True


def check_action(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return an action, or one a ship, clipped to the action space.

    Args:
        action: numbers, in [-1, 1] where they are not to be clipped.
        shape: of what is needed.

    Raises:
        ValueError: no numbers, numbers of another shape, or one that is not finite.
    """
    if type(action) is np.ndarray and action.dtype == np.float32 and action.shape == shape:
        ready = np.empty(shape, np.float32)
        if _clip(action.reshape(-1), ready.reshape(-1)):
            return ready
    try:
        array = np.array(action)
        if np.iscomplexobj(array):
            raise TypeError(array.dtype)
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"action {action!r}: must be finite numbers of shape {shape}") from None
    if array.shape != shape:
        raise ValueError(f"action has shape {array.shape}, {shape} is needed")
    if not np.isfinite(array).all():
        raise ValueError(f"action {array.tolist()} holds a value that is not finite")
    # clipped as double: 1e300 is finite, but single precision does not hold it
    clipped: NDArray[np.float32] = np.clip(array, -1.0, 1.0).astype(np.float32)
    return clipped
