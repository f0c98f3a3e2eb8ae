"""Commands in physical units and actions in [-1, 1], over the ship's ranges of pitch and fuel rack.

What a controller is told, what it answers, and the base class that does what all do alike.

Controllers have stable-baselines3's ``predict``, so one evaluator scores classic and learned ones alike.
They see only what a real ship's controller can know.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..plant.ship import Ship
from ..plant.ship_files import load_ship


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


PREVIEW_S = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Times ahead for which a sensor at the bow tells the inflow of the waves [s]."""

PREVIEW = tuple(f"wave_inflow_{ahead:.0f}_s" for ahead in PREVIEW_S)
"""Signals that follow :data:`OBSERVED` in an observation of a task with a preview."""


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
    wave_inflow: NDArray[np.float64] | None = None  # at PREVIEW_S ahead, shape (n, 7) [m/s]


NORMALISED_BOUND = 3.0
"""Bound of every signal of a normalised observation; no ship in units lies within it in all signals."""


def readings(observation: Any, preview: bool = False) -> Readings:
    """Return the columns :data:`OBSERVED` of an observation; further columns are ignored.

    Args:
        observation: in physical units, shape (k,) or (n, k) with k of at least 8.
        preview: whether the columns :data:`PREVIEW` follow and are read too.

    Raises:
        ValueError: too few columns, or observations that are normalised.
    """
    whole = np.atleast_2d(np.asarray(observation, dtype=np.float64))
    table = whole[:, : len(OBSERVED)]
    if table.shape[1] < len(OBSERVED):
        raise ValueError(
            f"an observation of {table.shape[1]} signals: controllers need {', '.join(OBSERVED)}"
        )
    if (np.abs(table) <= NORMALISED_BOUND).all():
        raise ValueError(
            "the observation is normalised, and classic controllers need physical units: make the "
            "environment with **shaftline.envs.CLASSIC"
        )
    seen = Readings(*table.T)
    if preview:
        return seen._replace(wave_inflow=whole[:, len(OBSERVED) : len(OBSERVED) + len(PREVIEW)])
    return seen


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


class Predictor(Protocol):
    """Anything that answers observations with actions: a :class:`Controller`, or a model of
    stable-baselines3.
    """

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """See :meth:`Controller.predict`."""


class Controller(ABC):
    """Base class: turns observations into actions, for any number of equal ships at once.

    A subclass says what memory it begins with (:meth:`fresh`) and what it commands (:meth:`act`). One
    that stands in a file of this folder is found there by its ``name`` and needs to be listed nowhere
    else; it takes a ship, the control interval, and numbers as options.

    Args:
        ship: a ship with a diesel, or its name.
        interval_s: time between two calls of :meth:`predict` [s].

    Raises:
        ValueError: the interval is not a positive number.
    """

    name: ClassVar[str]
    """By which it is chosen."""
    source: ClassVar[str] = ""
    """Where it is published; controllers are listed by source, then by name."""
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    """The same with other options, by names of their own."""
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Options that a search may set (:mod:`shaftline.agents.learning.tuning`), with their ranges."""
    preview: bool = False
    """Whether it reads the inflow of the waves ahead, which only some tasks tell."""

    def __init__(self, ship: str | Ship = "frigate", interval_s: float = 0.5) -> None:
        if not 0.0 < interval_s < math.inf:
            raise ValueError(f"control_interval_s = {interval_s} s: must be a positive number")
        self.ship = load_ship(ship)
        self.interval_s = interval_s
        self.plant = self.ship.record()

    @abstractmethod
    def fresh(self, seen: Readings) -> NDArray[Any]:
        """Memory of a controller that sees something for the first time, shape (n, ...).

        Args:
            seen: readings of n ships.
        """

    @abstractmethod
    def act(
        self, seen: Readings, memory: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Commanded P/D [-] and fuel rack [mm], each of shape (n,).

        Args:
            seen: readings of n ships.
            memory: of the last call or :meth:`fresh`; changed in place.
        """

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Actions for one observation or a batch.

        Args:
            observation: shape (8,) or (n, 8), the signals :data:`OBSERVED` in physical units.
            state: what the last call returned, None at first; it stays untouched.
            episode_start: shape (n,), true where an episode begins and the memory must be forgotten.
            deterministic: without effect: a classic controller draws no noise.

        Returns:
            Action(s) in [-1, 1], shape (2,) or (n, 2): pitch command and fuel rack command, each over
            the ship's range; and the state to pass to the next call.
        """
        seen = readings(observation, self.preview)
        memory = resumed(state, self.fresh(seen), episode_start)
        pitch, rack = self.act(seen, memory)
        table = actions(self.plant, pitch, rack)
        return table if np.ndim(observation) > 1 else table[0], memory
