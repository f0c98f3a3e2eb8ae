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

_SINGLE = np.dtype(np.float32)
_FAR = 1e9  # bound of a signal without a physical bound [rad, m]


def observation_space(observed: Sequence[str] = OBSERVED) -> spaces.Box:
    """Return the space of an observation in physical units, with the bounds of the signal registry.

    Examples:
        >>> observation_space(("speed_order", "fuel_rack")).high.tolist()
        [40.0, 200.0]
    """
    signals = [get_signal(name) for name in observed]
    # A heading that is not wrapped has no bound; a finite one keeps the space usable for sampling.
    low = np.array([max(signal.low, -_FAR) for signal in signals], np.float32)
    high = np.array([min(signal.high, _FAR) for signal in signals], np.float32)
    return spaces.Box(low, high, dtype=np.float32)


def action_space(numbers: int = 2) -> spaces.Box:
    """Return the space of an action: pitch, drive and rudder, each in [-1, 1].

    Examples:
        >>> action_space(3)
        Box(-1.0, 1.0, (3,), float32)
    """
    return spaces.Box(-1.0, 1.0, (numbers,), np.float32)


def batch_observation_space(batch: Batch) -> spaces.Box:
    """Return the space of one observation of a batch, normalised or in physical units."""
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
    """Return an action as a float32 array clipped to the action space.

    Raises:
        ValueError: the action does not consist of numbers, has another shape, or is not finite.

    Examples:
        >>> check_action([0.5, -3.0], (2,)).tolist()
        [0.5, -1.0]
    """
    if type(action) is np.ndarray and action.dtype is _SINGLE and action.shape == shape:
        ready = np.empty(shape, np.float32)
        one = len(shape) == 1
        if _clip(action, ready) if one else _clip(action.reshape(-1), ready.reshape(-1)):
            return ready
    try:
        array = np.array(action)
        if np.iscomplexobj(array):
            raise TypeError(array.dtype)
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"action {action!r}: must be finite numbers of shape {shape}") from None
    if array.shape != shape:
        raise ValueError(f"action has shape {array.shape}; expected is shape {shape}")
    if not np.isfinite(array).all():
        wrong = np.argwhere(~np.isfinite(array))[0].tolist()
        raise ValueError(
            f"action{wrong} = {array[tuple(wrong)]}: must be finite; expected is -1 to 1"
        )
    # Clip in double precision: 1e300 is finite, but not in single precision.
    return np.asarray(np.clip(array, -1.0, 1.0), np.float32)
