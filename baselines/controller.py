"""Base class of the controllers, their measurements, and the conversion of commands to actions.

Controllers have the ``predict`` method of stable-baselines3, so one evaluator scores classic and learned
controllers. They receive only what the controller of a real ship can measure.
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
from ..observers.records import Floats
from ..plant.ship import Ship
from ..plant.ship_files import load_ship


@compiled
def decode(value: float, low: float, high: float) -> float:
    """Return the command in physical units of an action in [-1, 1].

    ``low`` and ``high`` are the commands of the actions -1 and 1.

    Example:
        >>> decode(0.5, 0.0, 20.0)
        15.0
    """
    return low + 0.5 * (value + 1.0) * (high - low)


@compiled
def encode(value: float, low: float, high: float) -> float:
    """Return the action in [-1, 1] of a command in physical units.

    ``low`` and ``high`` are the commands of the actions -1 and 1; a command beyond them is clipped. If
    they are equal, as for a fixed pitch, the action is 0.

    Example:
        >>> encode(15.0, 0.0, 20.0), encode(25.0, 0.0, 20.0)
        (0.5, 1.0)
    """
    half = 0.5 * (high - low)
    if not half > 0.0:
        return 0.0
    return float(clip((value - 0.5 * (low + high)) / half, -1.0, 1.0))


@compiled
def _encode_all(value: Floats, low: float, high: float) -> NDArray[np.float32]:
    action = np.empty(len(value), np.float32)
    for i in range(len(value)):
        action[i] = encode(value[i], low, high)
    return action


def encode_all(value: Any, low: float, high: float) -> NDArray[np.float32]:
    """Return the actions of n commands of shape (n,) over the same range, as :func:`encode`."""
    return _encode_all(np.ascontiguousarray(value, dtype=np.float64), float(low), float(high))


def actions(plant: Record, pitch_ratio: Any, fuel_rack: Any) -> NDArray[np.float32]:
    """Return the actions, shape (n, 2), of commanded P/D [-] and fuel rack [mm], each of shape (n,).

    Example:
        >>> from shaftline.plant import load_ship
        >>> frigate = load_ship("frigate").record()
        >>> actions(frigate, [1.0], [frigate["drive_max"]]).round(6).tolist()
        [[0.0, 1.0]]
    """
    pitch = encode_all(pitch_ratio, plant["pitch_ratio_min"], plant["pitch_ratio_max"])
    return np.column_stack([pitch, encode_all(fuel_rack, plant["drive_min"], plant["drive_max"])])


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
"""Signals of an observation, in order; ``plant/signals.py`` lists their units and bounds."""


PREVIEW_S = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)  # times ahead of a sensor of waves at the bow [s]
PREVIEW = tuple(f"wave_inflow_{ahead:.0f}_s" for ahead in PREVIEW_S)  # signals after OBSERVED


class Measurements(NamedTuple):
    """Columns of an observation by name, each of shape (n,)."""

    speed_order: Floats  # ordered ship speed [m/s]
    shaft_speed: Floats  # [rad/s]
    shaft_torque: Floats  # at the torque meter [N m]
    pitch_ratio: Floats  # [-]
    fuel_rack: Floats  # [mm]
    ship_speed: Floats  # [m/s]
    advance_velocity: Floats  # estimated [m/s]
    estimate_valid: Floats  # 1 or 0
    wave_inflow: Floats | None = None  # at PREVIEW_S ahead, shape (n, 7) [m/s]


NORMALISED_BOUND = 3.0  # of normalised signals; in physical units some signal is always larger


def measurements_of(observation: Any, preview: bool = False) -> Measurements:
    """Return the columns :data:`OBSERVED` of an observation; further columns are ignored.

    Args:
        observation: signals in physical units, shape (k,) or (n, k) with k of at least 8.
        preview: whether the columns :data:`PREVIEW` follow and are returned as ``wave_inflow``.

    Raises:
        ValueError: the observation has too few columns, or is normalised.

    Example:
        >>> signals = measurements_of([8.0, 10.0, 1.4e5, 1.3, 20.0, 7.9, 7.1, 1.0])
        >>> signals.fuel_rack.tolist()
        [20.0]
    """
    whole = np.atleast_2d(np.asarray(observation, dtype=np.float64))
    table = whole[:, : len(OBSERVED)]
    if table.shape[1] < len(OBSERVED):
        raise ValueError(
            f"the observation has {table.shape[1]} signals, but controllers need the {len(OBSERVED)} "
            f"signals {', '.join(OBSERVED)}"
        )
    if (np.abs(table) <= NORMALISED_BOUND).all():
        raise ValueError(
            "the observation is normalised, but classic controllers need physical units: make the "
            "environment with **shaftline.envs.CLASSIC"
        )
    signals = Measurements(*table.T)
    if preview:
        return signals._replace(wave_inflow=whole[:, len(OBSERVED) : len(OBSERVED) + len(PREVIEW)])
    return signals


def resume_state(state: Any, initial: NDArray[Any], episode_start: Any) -> NDArray[Any]:
    """Return a copy of the controller state with which a call of ``predict`` begins.

    It is ``initial`` at the first call (``state`` is None) and where an episode starts.
    """
    if state is None:
        return initial.copy()
    memory = np.array(state, dtype=initial.dtype)
    if episode_start is not None:
        begins = np.broadcast_to(np.asarray(episode_start, dtype=bool), len(memory))
        memory[begins] = initial[begins]
    return memory


Ranges = Mapping[str, tuple[float, float]]
"""Options that can be tuned (:mod:`shaftline.agents.learning.tuning`), with their ranges."""

Variants = Mapping[str, Mapping[str, Any]]
"""Names of variants of a controller, with the options that they set."""

Commands = tuple[Floats, Floats]
"""Commanded P/D [-] and fuel rack [mm], each of shape (n,)."""


class Predictor(Protocol):
    """Object with ``predict``: a :class:`Controller` or a model of stable-baselines3."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return actions and state, as :meth:`Controller.predict`."""


class Controller(ABC):
    """Compute actions from observations, for any number of equal ships at once (base class).

    A subclass defines :meth:`initial_state` and :meth:`act`. A file of this folder that defines one
    registers it by its ``name``; no list has to be extended. The constructor takes a ship, the control
    interval, and numbers as options. ``shaftline list`` prints the first sentence of its docstring.

    Args:
        ship: ship with a diesel, or its name.
        interval_s: time between two calls of :meth:`predict` [s].

    Raises:
        ValueError: the interval is not a positive number.
    """

    name: ClassVar[str]  # registered name
    source: ClassVar[str] = ""  # publication; controllers are listed by source, then by name
    variants: ClassVar[Variants] = {}
    tunable: ClassVar[Ranges] = {}
    preview: bool = (
        False  # whether it uses the inflow of the waves ahead, which only some tasks provide
    )

    def __init__(self, ship: str | Ship = "frigate", interval_s: float = 0.5) -> None:
        if not 0.0 < interval_s < math.inf:
            raise ValueError(f"control_interval_s = {interval_s} s: must be a positive number")
        self.ship = load_ship(ship)
        self.interval_s = interval_s
        self.plant = self.ship.record()

    @abstractmethod
    def initial_state(self, signals: Measurements) -> NDArray[Any]:
        """Return the initial controller state at the first measurements of n ships, shape (n, ...)."""

    @abstractmethod
    def act(self, signals: Measurements, memory: NDArray[Any]) -> Commands:
        """Return the commanded P/D [-] and fuel rack [mm], each of shape (n,).

        Args:
            signals: measurements of n ships.
            memory: controller state of the last call or :meth:`initial_state`; changed in place.
        """

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return the actions for one observation or a batch, and the controller state.

        Args:
            observation: signals :data:`OBSERVED` in physical units, shape (8,) or (n, 8).
            state: state that the last call returned, None at the first call; it is not changed.
            episode_start: true where an episode begins and the initial state applies, shape (n,).
            deterministic: without effect, because a classic controller draws no noise.

        Returns:
            Actions in [-1, 1], shape (2,) or (n, 2): pitch command and fuel rack command, each over the
            range of the ship; and the state for the next call.

        Example:
            >>> from shaftline.baselines import Combinator
            >>> controller = Combinator("frigate")
            >>> observation = [8.0, 10.0, 1.4e5, 1.3, 20.0, 7.9, 7.1, 1.0]
            >>> action, state = controller.predict(observation)
            >>> action.shape, state.shape
            ((2,), (1, 4))
            >>> action, state = controller.predict(observation, state)
        """
        signals = measurements_of(observation, self.preview)
        memory = resume_state(state, self.initial_state(signals), episode_start)
        pitch, rack = self.act(signals, memory)
        table = actions(self.plant, pitch, rack)
        return table if np.ndim(observation) > 1 else table[0], memory
