"""What a controller is told, what it answers, and how both are laid out.

Controllers have stable-baselines3's ``predict``, so one evaluator scores classic and learned ones alike.
They see only what a real ship's controller can know.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship

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
    """A command in physical units as an action in [-1, 1]; beyond the range it is clipped.

    Where the range is a single value, as of a fixed pitch, the action is 0.
    """
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    away = np.asarray(value, dtype=np.float64) - middle
    return np.clip(away / half, -1.0, 1.0) if half > 0.0 else np.zeros_like(away)


def actions(ship: Ship, observation: Any, pitch: Any, rack: Any) -> NDArray[np.float32]:
    """Pitch [-] and rack [mm] commands as actions, shaped as the observation asks.

    Args:
        ship: a ship with a diesel.
        observation: shape (8,) gives shape (2,); shape (n, 8) gives shape (n, 2).
        pitch: commanded P/D [-], shape (n,).
        rack: commanded rack [mm], shape (n,).
    """
    plant = ship.record()
    columns = (
        scaled(pitch, float(plant["pitch_ratio_min"]), float(plant["pitch_ratio_max"])),
        scaled(rack, float(plant["drive_min"]), float(plant["drive_max"])),
    )
    table = np.stack(columns, axis=-1).astype(np.float32)
    return table if np.ndim(observation) > 1 else table[0]


def resumed(state: Any, fresh: NDArray[Any], episode_start: Any) -> NDArray[Any]:
    """The memory with which a call of ``predict`` begins; what is passed in stays untouched.

    Args:
        state: what the last call returned, None at first.
        fresh: memory of a controller that has seen nothing yet, shape (n, ...).
        episode_start: true where an episode begins, shape (n,), one for all, or None.
    """
    if state is None:
        return fresh.copy()
    memory = np.array(state, dtype=fresh.dtype)
    if episode_start is not None:
        begins = np.broadcast_to(np.asarray(episode_start, dtype=bool), len(memory))
        memory[begins] = fresh[begins]
    return memory


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
