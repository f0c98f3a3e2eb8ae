"""What a learned policy sees of an observation, and how its answers become commands.

The same in training and at sea. A policy without memory cannot tell a wave from a drift, so it is
given slow versions of the noisy readings beside them. It does not move rack and pitch by hand:
underneath acts the speed pilot of the baselines, and the policy answers with that pilot's settings. A
policy that says nothing sails; and what it tries in training is felt over many waves, which a nudge of
the rack is not.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...baselines.actions import actions
from ...baselines.controller import Readings, readings, resumed
from ...baselines.speed_pilot import ERROR_S, MEAN_S, PilotSettings, Slowed, SpeedPilot
from ...plant import Ship

SLOWED_SIGNALS = ("speed_error", "shaft_speed", "shaft_torque", "advance_velocity")
"""Readings that are also shown slowed down."""

SLOW_S = (ERROR_S, MEAN_S)
"""Time constants [s]. Slower ones lag so far behind the ship that policies which lean on them swing."""

ANSWERS = PilotSettings._fields
"""What a policy answers, in order: settings of the pilot."""

FEATURES = (
    "speed_order", "speed_error", "shaft_speed", "shaft_torque", "pitch_ratio", "fuel_rack",
    "advance_velocity", "estimate_valid",
    *(f"{signal} over {tau:g} s" for tau in SLOW_S for signal in SLOWED_SIGNALS),
    "integral",
    *ANSWERS,
)  # fmt: skip
"""What a policy sees, in order: readings in their units, slowed readings, the pilot's integral [mm], its
own followed answers."""

_COUNT = len(SLOWED_SIGNALS) * len(SLOW_S)
_INTEGRAL = _COUNT
_ANSWERS = slice(_COUNT + 1, None)
_MEAN_SPEED = len(SLOWED_SIGNALS) + SLOWED_SIGNALS.index("shaft_speed")
_MEAN_TORQUE = len(SLOWED_SIGNALS) + SLOWED_SIGNALS.index("shaft_torque")


@dataclass(frozen=True)
class Reach:
    """What an answer of 0 means, and how far one of 1 goes; units of the pilot's settings.

    Args:
        speed_offset: span [m/s] about 0.
        pitch_offset: span of P/D [-] about 0.
        torque_gain: at 0, and its span.
        shaft_gain: at 0, and its span.
        pitch_gain: at 0, and its span.
        speed_gain: the pilot's, which the policy does not change.
        slow_s: time constant with which answers are followed [s].
    """

    speed_offset: float = 0.5
    pitch_offset: float = 0.25
    torque_gain: tuple[float, float] = (1.0, 1.0)
    shaft_gain: tuple[float, float] = (0.15, 0.3)
    pitch_gain: tuple[float, float] = (0.7, 2.0)
    speed_gain: float = 2.0
    slow_s: float = 4.0

    def __post_init__(self) -> None:  # noqa: D105 (pydantic's and dataclasses' hook)
        for field in fields(self):
            for value in np.ravel(getattr(self, field.name)).tolist():
                if not 0.0 <= value <= 100.0 or (field.name == "slow_s" and value == 0.0):
                    raise ValueError(
                        f"reach.{field.name} = {value!r}: must be from 0 to 100, slow_s above 0"
                    )

    @property
    def middles(self) -> NDArray[np.float64]:
        """Settings at an answer of 0, in the order of :data:`ANSWERS`."""
        given = (np.ravel(getattr(self, name)) for name in ANSWERS)
        return np.array([value[0] if len(value) == 2 else 0.0 for value in given])

    @property
    def spans(self) -> NDArray[np.float64]:
        """How far an answer of 1 goes from there."""
        return np.array([np.ravel(getattr(self, name))[-1] for name in ANSWERS])


class PilotAdapter:
    """Between a policy and a ship.

    Args:
        ship: a ship with a diesel.
        interval_s: control interval of the environment [s].
        reach: of the answers.

    A memory has shape (n, 14): slowed readings, the pilot's integral, and the answers as they are
    followed.
    """

    def __init__(self, ship: Ship, interval_s: float, reach: Reach | None = None) -> None:
        self.ship = ship
        self.interval_s = interval_s
        self.reach = reach or Reach()
        self._keep = np.exp(-interval_s / np.repeat(SLOW_S, len(SLOWED_SIGNALS)))
        self._slow = float(np.exp(-interval_s / self.reach.slow_s))
        self._pilot = SpeedPilot(ship, interval_s, self.reach.speed_gain)

    def see(
        self, observation: Any, memory: Any = None, starting: Any = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Features and the memory that has taken the observation in.

        Args:
            observation: shape (n, 8) or (8,), in physical units.
            memory: of the last call, or None; it is not changed.
            starting: true where an episode begins, shape (n,).

        Returns:
            Features of shape (n, 22), and the memory.
        """
        seen = readings(observation)
        after = resumed(memory, self.fresh(seen), starting)
        return self.take_in(seen, after), after

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """Memory of what is seen for the first time: as if it had stood for ever."""
        often = np.tile(_heard(seen), len(SLOW_S))
        return np.column_stack([often, np.zeros((len(often), 1 + len(ANSWERS)))])

    def take_in(self, seen: Readings, memory: NDArray[np.float64]) -> NDArray[np.float32]:
        """Features, shape (n, 22); the memory takes the readings in, in place."""
        heard = _heard(seen)
        often = np.tile(heard, len(SLOW_S))
        memory[:, :_COUNT] = self._keep * memory[:, :_COUNT] + (1.0 - self._keep) * often
        error, _, _, estimate = heard.T
        features = np.column_stack(
            [seen.speed_order, error, seen.shaft_speed, seen.shaft_torque, seen.pitch_ratio,
             seen.fuel_rack, estimate, seen.estimate_valid > 0.5, memory]
        )  # fmt: skip
        return features.astype(np.float32)

    def command(
        self, answer: Any, memory: NDArray[np.float64], features: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Action of the environment, shape (n, 2); the memory takes the answers in.

        Args: as of :meth:`set_points`.
        """
        return actions(self._pilot.plant, *self.set_points(answer, memory, features))

    def set_points(
        self, answer: Any, memory: NDArray[np.float64], features: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Commanded P/D [-] and fuel rack [mm], each of shape (n,); the memory takes the answers in.

        Args:
            answer: in [-1, 1], shape (n, 5).
            memory: changed in place.
            features: of :meth:`see`, shape (n, 22).
        """
        said = np.clip(np.asarray(answer, dtype=np.float64), -1.0, 1.0)
        followed = self._slow * memory[:, _ANSWERS] + (1.0 - self._slow) * said
        memory[:, _ANSWERS] = followed
        settings = PilotSettings(*(self.reach.middles + self.reach.spans * followed).T)
        order, shaft_speed, torque = (
            features[:, FEATURES.index(name)].astype(np.float64)
            for name in ("speed_order", "shaft_speed", "shaft_torque")
        )
        slowed = Slowed(
            memory[:, SLOWED_SIGNALS.index("speed_error")],
            memory[:, _MEAN_SPEED],
            memory[:, _MEAN_TORQUE],
            memory[:, _INTEGRAL],
        )
        pitch, rack, integral = self._pilot.command(order, shaft_speed, torque, slowed, settings)
        memory[:, _INTEGRAL] = integral
        return pitch, rack


def _heard(seen: Readings) -> NDArray[np.float64]:
    """The :data:`SLOWED_SIGNALS` as they are now, shape (n, 4)."""
    error = seen.speed_order - seen.ship_speed
    estimate = np.where(seen.estimate_valid > 0.5, seen.advance_velocity, 0.0)
    return np.column_stack([error, seen.shaft_speed, seen.shaft_torque, estimate])
