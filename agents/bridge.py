"""What a learned policy sees of an observation, and how its answers become commands.

The same in training and at sea. A policy without memory cannot tell a wave from a drift, so it is
given slow versions of the noisy readings beside them. It does not move rack and pitch by hand:
underneath acts a plain controller, the steady point of the combinator's curve with proportional
feedbacks, and the policy answers with offsets and gains of that. A policy that says nothing sails; and
what it tries in training is felt over many waves, which a nudge of the rack is not.

    rack  = X(v_order) + k_v e + offset + k_M (M_8s - M) + k_w (w_8s - w)
    pitch = P(v_order) + offset + k_P (M_8s - M)

X and P are rack and pitch of the curve in calm water, e the speed error over 2 s, M and w torque and
speed of the shaft, with their means over the last 8 s.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..baselines.combinator import combinator_curve
from ..baselines.interface import actions, readings, resumed
from ..baselines.steady_points import steady_point
from ..plant import Ship

SIGNALS = ("speed_error", "shaft_speed", "shaft_torque", "advance_velocity")
"""Readings that are also shown slowed down."""

SLOW_S = (2.0, 8.0)
"""Time constants [s]: within a wave, and as long as one. Slower ones lag so far behind the ship that
policies which lean on them swing."""

ANSWERS = ("pitch offset", "rack offset", "torque gain", "shaft speed gain", "pitch gain")
"""What a policy answers, in order."""

FEATURES = (
    "speed_order", "speed_error", "shaft_speed", "shaft_torque", "pitch_ratio", "fuel_rack",
    "advance_velocity", "estimate_valid",
    *(f"{signal} over {tau:g} s" for tau in SLOW_S for signal in SIGNALS),
    *ANSWERS,
)  # fmt: skip
"""What a policy sees, in order: readings in their units, slowed readings, its own followed answers."""

_COUNT = len(SIGNALS) * len(SLOW_S)
_MEAN_SPEED = len(SIGNALS) + SIGNALS.index("shaft_speed")
_MEAN_TORQUE = len(SIGNALS) + SIGNALS.index("shaft_torque")


@dataclass(frozen=True)
class Reach:
    """What an answer of 0 means, and how far one of 1 goes.

    Args:
        pitch: offset of P/D [-].
        rack_mm: offset of the rack [mm].
        speed_gain: k_v [mm s/m], which the policy does not change.
        torque_gain: k_M at 0, and its span [mm/(kN m)].
        shaft_gain: k_w at 0, and its span [mm s/rad].
        pitch_gain: k_P at 0, and its span [1/(kN m)].
        slow_s: time constant with which answers are followed [s].
    """

    pitch: float = 0.25
    rack_mm: float = 8.0
    speed_gain: float = 6.0
    torque_gain: tuple[float, float] = (0.1, 0.12)
    shaft_gain: tuple[float, float] = (2.0, 4.0)
    pitch_gain: tuple[float, float] = (0.002, 0.006)
    slow_s: float = 4.0

    def __post_init__(self) -> None:  # noqa: D105 (pydantic's and dataclasses' hook)
        for field in fields(self):
            for value in np.ravel(getattr(self, field.name)).tolist():
                if not 0.0 <= value <= 100.0 or (field.name == "slow_s" and value == 0.0):
                    raise ValueError(
                        f"reach.{field.name} = {value!r}: must be from 0 to 100, slow_s above 0"
                    )

    def as_dict(self) -> dict[str, Any]:
        """By field."""
        return asdict(self)

    @property
    def middles(self) -> NDArray[np.float64]:
        """Offsets and gains at an answer of 0, in the order of :data:`ANSWERS`."""
        return np.array([0.0, 0.0, self.torque_gain[0], self.shaft_gain[0], self.pitch_gain[0]])

    @property
    def spans(self) -> NDArray[np.float64]:
        """How far an answer of 1 goes from there."""
        return np.array(
            [self.pitch, self.rack_mm, self.torque_gain[1], self.shaft_gain[1], self.pitch_gain[1]]
        )


class Bridge:
    """Between a policy and a ship.

    Args:
        ship: a ship with a diesel.
        interval_s: control interval of the environment [s].
        reach: of the answers.

    A memory has shape (n, 13): the slowed readings, and the answers as they are followed.
    """

    def __init__(self, ship: Ship, interval_s: float, reach: Reach | None = None) -> None:
        self.ship = ship
        self.interval_s = interval_s
        self.reach = reach or Reach()
        self._keep = np.exp(-interval_s / np.repeat(SLOW_S, len(SIGNALS)))
        self._slow = float(np.exp(-interval_s / self.reach.slow_s))
        curve = combinator_curve(ship)
        self._speeds, self._pitch = curve.ship_speed, curve.pitch_ratio
        points = zip(curve.shaft_speed, curve.pitch_ratio, strict=True)
        self._rack = np.array([steady_point(ship, float(n), float(p)).fuel_rack for n, p in points])

    def see(
        self, observation: Any, memory: Any = None, starting: Any = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Features and the memory that has taken the observation in.

        Args:
            observation: shape (n, 8) or (8,), in physical units.
            memory: of the last call, or None; it is not changed.
            starting: true where an episode begins, shape (n,).

        Returns:
            Features of shape (n, 21), and the memory.
        """
        seen = readings(observation)
        valid = seen.estimate_valid > 0.5
        error = seen.speed_order - seen.ship_speed
        estimate = np.where(valid, seen.advance_velocity, 0.0)
        heard = np.column_stack([error, seen.shaft_speed, seen.shaft_torque, estimate])
        often = np.tile(heard, len(SLOW_S))
        fresh = np.column_stack([often, np.zeros((len(often), len(ANSWERS)))])
        after = resumed(memory, fresh, starting)
        after[:, :_COUNT] = self._keep * after[:, :_COUNT] + (1.0 - self._keep) * often
        features = np.column_stack(
            [seen.speed_order, error, seen.shaft_speed, seen.shaft_torque, seen.pitch_ratio,
             seen.fuel_rack, estimate, valid, after]
        )  # fmt: skip
        return features.astype(np.float32), after

    def command(
        self, answer: Any, memory: NDArray[np.float64], features: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Action of the environment, shape (n, 2); the memory takes the answers in.

        Args:
            answer: in [-1, 1], shape (n, 5).
            memory: changed in place.
            features: of :meth:`see`, shape (n, 21).
        """
        said = np.clip(np.asarray(answer, dtype=np.float64), -1.0, 1.0)
        followed = self._slow * memory[:, _COUNT:] + (1.0 - self._slow) * said
        memory[:, _COUNT:] = followed
        values = self.reach.middles + self.reach.spans * followed
        pitch_offset, rack_offset, torque_gain, shaft_gain, pitch_gain = values.T
        order, shaft_speed, torque = (features[:, i].astype(np.float64) for i in (0, 2, 3))
        error = memory[:, SIGNALS.index("speed_error")]
        mean_speed, mean_torque = memory[:, _MEAN_SPEED], memory[:, _MEAN_TORQUE]
        light = 1e-3 * (mean_torque - torque)  # kN m below the mean
        return actions(
            self.ship,
            memory,
            np.interp(order, self._speeds, self._pitch) + pitch_offset + pitch_gain * light,
            np.interp(order, self._speeds, self._rack)
            + self.reach.speed_gain * error
            + rack_offset
            + torque_gain * light
            + shaft_gain * (mean_speed - shaft_speed),
        )
