"""What a controller is told, what it answers, and how both are laid out.

Controllers have stable-baselines3's ``predict``, so one evaluator scores classic and learned ones alike.
They see only what a real ship's controller can know.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

OBSERVED = (
    "speed_order",
    "shaft_speed",
    "measured_shaft_torque",
    "measured_pitch_ratio",
    "fuel_rack",
    "measured_ship_speed",
    "estimated_advance_velocity",
    "estimate_valid",
)
"""Signals of an observation, in order; units and bounds stand in ``plant/signals.py``."""


class Readings(NamedTuple):
    """An observation's columns by name, each of shape (n,)."""

    speed_order: NDArray[np.float64]  # ordered ship speed [m/s]
    shaft_speed: NDArray[np.float64]  # [rad/s]
    shaft_torque: NDArray[np.float64]  # at the gauge [N m]
    pitch_ratio: NDArray[np.float64]  # [-]
    fuel_rack: NDArray[np.float64]  # [mm]
    ship_speed: NDArray[np.float64]  # [m/s]
    advance_velocity: NDArray[np.float64]  # estimated [m/s]
    estimate_valid: NDArray[np.float64]  # 1 or 0


def readings(observation: Any) -> Readings:
    """Columns of an observation of shape (8,) or (n, 8)."""
    table = np.atleast_2d(np.asarray(observation, dtype=np.float64))
    return Readings(*table.T)


def scaled(value: Any, low: float, high: float) -> NDArray[np.float64]:
    """A command in physical units as an action in [-1, 1]; beyond the range it is clipped."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return np.clip((np.asarray(value, dtype=np.float64) - middle) / half, -1.0, 1.0)


class Controller(Protocol):
    """Anything that turns observations into actions."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Actions for one observation or a batch.

        Args:
            observation: shape (8,) or (n, 8), in physical units.
            state: what the last call returned, None at first.
            episode_start: shape (n,), true where an episode begins and the memory must be forgotten.
            deterministic: classic controllers have no other way.

        Returns:
            Action(s) in [-1, 1], shape (2,) or (n, 2): pitch command and fuel rack command, each over
            the ship's range; and the state to pass to the next call.
        """
