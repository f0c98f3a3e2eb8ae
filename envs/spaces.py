"""Spaces of observations and actions, and the check of an action."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..baselines.controller import OBSERVED
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
    """Pitch command, fuel rack command and rudder command, each in [-1, 1] over the ship's range.

    Args:
        numbers: how many of them.
    """
    return spaces.Box(-1.0, 1.0, (numbers,), np.float32)


def space_of(batch: Batch) -> spaces.Box:
    """Of one observation as an agent gets it: physical units, or normalised and without bounds."""
    if batch.settings.normalised:
        return spaces.Box(-np.inf, np.inf, (len(batch.observed),), np.float32)
    return observation_space(batch.observed)


def check_action(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return an action, or one a ship, clipped to the action space.

    Args:
        action: numbers, in [-1, 1] where they are not to be clipped.
        shape: of what is needed.

    Raises:
        ValueError: no numbers, numbers of another shape, or one that is not finite.
    """
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
