"""What a learned policy sees of an observation, and how its answers become commands.

The same in training and at sea. Residual policy learning (Silver et al. 2018, Johannink et al. 2019): a
classic controller, the base, holds the ship's speed slowly, and the policy adds to what it commands,

    P = P_base + r_P a_1
    X = X_base + r_X a_2,     X_min(w) to X_max(w) as of the speed pilot

at every control interval, so that single waves can be met. A policy that says nothing sails as its
base does. With a washout, a_1 and a_2 are the answers less their means over that time: the policy then
answers to waves alone, and speed and fuel stay the base's. With a lag they are those means: what is felt
over tens of seconds, such as a new order, is then tried out over seconds at a time, which the ship
answers to, and not interval by interval, which she does not. It has no memory of its own, so it is shown
the last few readings, as they depart from their means over 20 s: from those a wave can be foreseen for a
part of its period.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...baselines.actions import actions
from ...baselines.controller import Readings, readings, resumed
from ...baselines.registry import ControllerError, make_controller
from ...baselines.speed_pilot import Slowed, SpeedPilot
from ...plant import Ship

MEAN_S = 20.0
"""Time constant of the means [s]: two or three waves."""

RECENT = ("shaft_speed", "shaft_torque", "pitch_ratio", "fuel_rack", "advance_velocity")
"""Readings of which the last few are shown, each less its mean."""

ANSWERS = ("pitch_ratio", "fuel_rack")
"""What a policy answers, in order: how much is added to the base's command, over its reach."""

SLOWLY = (
    "speed_order", "speed_error", "integral",
    *(f"mean {name}" for name in RECENT),
    "base pitch_ratio", "base fuel_rack",
    *(f"mean answer {name}" for name in ANSWERS),
    "estimate_valid",
)  # fmt: skip
"""What is shown besides: the order, error over 2 s and integral of the base, the means, what the base
commands, the means of the answers."""

_MEANS = slice(0, len(RECENT))
_BASE = slice(len(RECENT), len(RECENT) + len(ANSWERS))
_ANSWERED = slice(len(RECENT) + len(ANSWERS), len(RECENT) + 2 * len(ANSWERS))
_FIRST = len(RECENT) + 2 * len(ANSWERS)


@dataclass(frozen=True)
class Form:
    """How a policy is tied to a ship.

    Args:
        base: speed pilot or one that is built on it, as ``NAME:option=number,...``.
        pitch_reach: what an answer of 1 adds to the pitch command, as a share of its range [-].
        rack_reach: likewise to the rack command [-].
        history: how many readings are shown, the present one among them.
        washout_s: time over which the mean of the answers is taken out [s]; 0 leaves it in.
        lag_s: time constant of a lag that the answers go through instead [s]; 0 for none.

    Raises:
        ValueError: a number out of its range.
    """

    base: str = "speed-pilot:torque_gain=0,shaft_gain=0,pitch_gain=0"
    pitch_reach: float = 0.4
    rack_reach: float = 0.3
    history: int = 8
    washout_s: float = 0.0
    lag_s: float = 0.0

    def __post_init__(self) -> None:  # noqa: D105 (pydantic's and dataclasses' hook)
        for name in ("pitch_reach", "rack_reach"):
            if not 0.0 <= getattr(self, name) <= 2.0:
                raise ValueError(f"form.{name} = {getattr(self, name)!r}: must be from 0 to 2")
        for name in ("washout_s", "lag_s"):
            if not 0.0 <= getattr(self, name) <= 1e4:
                raise ValueError(
                    f"form.{name} = {getattr(self, name)!r} s: must be from 0 to 10 000"
                )
        if self.washout_s and self.lag_s:
            raise ValueError("form: washout_s and lag_s: one of them must be 0")
        if not 1 <= self.history <= 64:
            raise ValueError(f"form.history = {self.history!r}: must be from 1 to 64 readings")

    @property
    def features(self) -> tuple[str, ...]:
        """What a policy sees, in order, in the units of the readings."""
        before = (f"{name} {k} ago" for k in range(self.history) for name in RECENT)
        return (*SLOWLY, *before)


class Residual:
    """Between a policy and a ship; see the module.

    Args:
        ship: a ship with a diesel.
        interval_s: control interval of the environment [s].
        form: of the tie.

    A memory has shape (n, 9 + 5 h + k): means of :data:`RECENT`, the base's last commands, the means of
    the answers, the last h readings less their means, the newest first, and the base's own k columns.

    Raises:
        ControllerError: no such base, or one that is not built on the speed pilot.
    """

    def __init__(self, ship: Ship, interval_s: float, form: Form | None = None) -> None:
        self.ship, self.interval_s, self.form = ship, interval_s, form or Form()
        base = make_controller(self.form.base, ship, interval_s)
        if not isinstance(base, SpeedPilot):
            raise ControllerError(
                f"form.base = {self.form.base!r}: must be the speed pilot or built on it"
            )
        self.base = base
        self._own = slice(_FIRST + len(RECENT) * self.form.history, None)
        self._keep = float(np.exp(-interval_s / MEAN_S))
        mean_s = self.form.washout_s or self.form.lag_s
        self._taken = 1.0 - float(np.exp(-interval_s / mean_s)) if mean_s > 0.0 else 0.0
        plant = base.plant
        self._spans = (
            self.form.pitch_reach * float(plant["pitch_ratio_max"] - plant["pitch_ratio_min"]),
            self.form.rack_reach * float(plant["drive_max"] - plant["drive_min"]),
        )

    def see(
        self, observation: Any, memory: Any = None, starting: Any = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Features and the memory that has taken the observation in.

        Args:
            observation: shape (n, 8) or (8,), in physical units.
            memory: of the last call, or None; it is not changed.
            starting: true where an episode begins, shape (n,).

        Returns:
            Features of shape (n, f), in the order of :attr:`Form.features`, and the memory.
        """
        seen = readings(observation)
        after = resumed(memory, self.fresh(seen), starting)
        return self.take_in(seen, after), after

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """Memory of what is seen for the first time: as if it had stood for ever."""
        own = self.base.fresh(seen)
        now = _recent(seen, np.zeros(len(own)))
        before = np.zeros((len(own), 2 * len(ANSWERS) + len(RECENT) * self.form.history))
        return np.column_stack([now, before, own])

    def take_in(self, seen: Readings, memory: NDArray[np.float64]) -> NDArray[np.float32]:
        """Features; the memory takes the readings in, in place."""
        now = _recent(seen, memory[:, len(RECENT) - 1])
        means = memory[:, _MEANS]
        means += (1.0 - self._keep) * (now - means)
        own = memory[:, self._own]
        memory[:, _BASE] = np.column_stack(self.base.act(seen, own))
        last = memory[:, _FIRST : self._own.start]
        last[:, len(RECENT) :] = last[:, : -len(RECENT)].copy()
        last[:, : len(RECENT)] = now - means
        pilot = Slowed(*own[:, : len(Slowed._fields)].T)
        return np.column_stack(
            [seen.speed_order, pilot.error, pilot.integral, means, memory[:, _BASE],
             memory[:, _ANSWERED], seen.estimate_valid > 0.5, last]
        ).astype(np.float32)  # fmt: skip

    def command(self, answer: Any, seen: Any, memory: NDArray[np.float64]) -> NDArray[np.float32]:
        """Action of the environment, shape (n, 2).

        Args:
            answer: in [-1, 1], shape (n, 2).
            seen: the observation that was answered, shape (n, 8).
            memory: with the observation taken in.
        """
        pitch, rack = self.set_points(answer, readings(seen), memory)
        return actions(self.base.plant, pitch, rack)

    def set_points(
        self, answer: Any, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Commanded P/D [-] and fuel rack [mm], each of shape (n,); the memory takes the answers in."""
        said = np.clip(np.asarray(answer, dtype=np.float64), -1.0, 1.0)
        mean = memory[:, _ANSWERED]
        mean += self._taken * (said - mean)
        added = mean if self.form.lag_s else said - mean
        pitch, rack = (memory[:, _BASE] + self._spans * added).T
        return pitch, np.clip(rack, *self.base.limits(seen.shaft_speed))


def _recent(seen: Readings, estimate: NDArray[np.float64]) -> NDArray[np.float64]:
    """The readings :data:`RECENT`, shape (n, 5); without a valid estimate the one that is given."""
    valid = (seen.estimate_valid > 0.5) & np.isfinite(seen.advance_velocity)
    velocity = np.where(valid, seen.advance_velocity, estimate)
    return np.column_stack(
        [seen.shaft_speed, seen.shaft_torque, seen.pitch_ratio, seen.fuel_rack, velocity]
    )
