"""Combinator: one lever sets pitch and shaft speed together, a governor holds the shaft speed.

The curve is the usual one of ships with a controllable-pitch propeller: from lever 0 the pitch rises at
the lowest shaft speed; with the pitch at its full value the shaft speed rises to the engine's highest.
The speed order is turned into a lever through the ship's steady speeds in calm water, so nothing
corrects for waves, fouling or shallow water: that is what a combinator is. With its lever trimmed by the
watch until the log reads what is ordered, it sails at the speed of controllers that hold it, and can be
compared with them.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ..plant.ship import Ship
from .controller import Controller, Readings
from .governor import RESPONSE_S, Governor
from .steady_points import SteadyPoint, steady_point

FLOOR_SHARE = 0.5
"""Lowest shaft speed of the curve over the highest; never below the engine's lowest speed."""

FULL_PITCH_LEVER = 0.45
"""Lever at which the pitch is full."""

TORQUE_MARGIN = 0.97
"""Share of the torque limit that full pitch takes at full speed in calm water."""

_NEAR = 0.5  # [m/s]: a larger error, as after a new order, trims the lever no faster

_POINTS = 41  # of the table of steady states along the lever


class SetPoints(NamedTuple):
    """What a speed order means in calm water, each of shape (n,)."""

    pitch_ratio: NDArray[np.float64]  # [-]
    shaft_speed: NDArray[np.float64]  # [rad/s]
    thrust: NDArray[np.float64]  # of one propeller [N]


class Curve(NamedTuple):
    """A combinator curve and the ship's steady state on it, each of shape (m,), lever rising."""

    lever: NDArray[np.float64]  # 0 to 1
    pitch_ratio: NDArray[np.float64]  # [-]
    shaft_speed: NDArray[np.float64]  # [rad/s]
    ship_speed: NDArray[np.float64]  # in calm water [m/s], rising
    thrust: NDArray[np.float64]  # of one propeller in calm water [N]

    def at(self, speed_order: Any) -> SetPoints:
        """Set-points for ordered ship speeds [m/s], shape (n,); beyond the curve its ends hold."""
        columns = (self.pitch_ratio, self.shaft_speed, self.thrust)
        return SetPoints(
            *(np.asarray(np.interp(speed_order, self.ship_speed, column)) for column in columns)
        )


def full_pitch(ship: Ship, torque_share: float = TORQUE_MARGIN) -> float:
    """Highest P/D [-] at which the ship in calm water takes a share of the torque at full speed."""
    top = ship.shaft_speeds[1]
    low, high = _driving_pitch(ship), ship.propeller.pitch_ratio_max

    def excess(pitch: float) -> float:
        return steady_point(ship, top, pitch).torque_share - torque_share

    if excess(high) <= 0.0:
        return high
    if excess(low) > 0.0:
        raise ValueError(f"{ship.name}: even the lowest pitch overloads the engine at full speed")
    return float(scipy.optimize.brentq(excess, low, high, xtol=1e-6))


@functools.lru_cache(maxsize=64)
def combinator_curve(
    ship: Ship, floor_share: float = FLOOR_SHARE, full_pitch_lever: float = FULL_PITCH_LEVER
) -> Curve:
    """The standard curve of a ship; where its pitch is fixed, the lever sets the shaft speed alone.

    Args:
        ship: a ship with a diesel.
        floor_share: lowest shaft speed over the highest, 0 to 1.
        full_pitch_lever: lever at which the pitch becomes full, between 0 and 1.

    Raises:
        ShipError: the ship has no diesel or cannot move.
        ValueError: shares outside their range.
    """
    if not (0.0 <= floor_share < 1.0 and 0.0 < full_pitch_lever < 1.0):
        raise ValueError(f"shares out of range: {floor_share}, {full_pitch_lever}")
    lowest, highest = ship.shaft_speeds
    floor = max(lowest, floor_share * highest)
    lever = np.linspace(0.0, 1.0, _POINTS)
    full = full_pitch(ship)
    low = min(_driving_pitch(ship), full)
    bends = [0.0, full_pitch_lever if low < full else 0.0, 1.0]
    pitch = np.interp(lever, bends, [low, full, full])
    speed = np.interp(lever, bends, [floor, floor, highest])
    return curve_through(ship, lever, pitch, speed)


def curve_through(ship: Ship, lever: Any, pitch_ratio: Any, shaft_speed: Any) -> Curve:
    """A curve of one's own, with the steady ship speeds and thrusts in calm water worked out.

    Args:
        ship: a ship with a diesel.
        lever: positions, rising, shape (m,).
        pitch_ratio: P/D [-], shape (m,).
        shaft_speed: [rad/s], shape (m,).

    Raises:
        ValueError: the ship would not sail faster at each next lever.
    """
    lever, pitch, speed = (
        np.asarray(x, dtype=np.float64) for x in (lever, pitch_ratio, shaft_speed)
    )
    points = [steady_point(ship, float(n), float(p)) for p, n in zip(pitch, speed, strict=True)]
    sailed = np.array([point.ship_speed for point in points])
    if np.any(np.diff(sailed) <= 0.0) or np.any(np.diff(lever) <= 0.0):
        raise ValueError("lever and ship speed must rise along the curve")
    return Curve(lever, pitch, speed, sailed, np.array([point.thrust for point in points]))


def _driving_pitch(ship: Ship) -> float:
    """Lowest pitch [-] of the range that surely drives the ship ahead."""
    return min(max(ship.propeller.pitch_ratio_min, 0.1), ship.propeller.pitch_ratio_max)


class Combinator(Controller):
    """Speed order -> lever -> pitch and shaft speed; the governor moves the rack.

    Args:
        ship: a ship with a diesel, or its name.
        interval_s: control interval of the environment [s].
        curve: combinator curve; :func:`combinator_curve` by default.
        response_s: time constant of the governed shaft [s].
        trim_s: time constant [s] with which the lever is trimmed until the log reads the ordered speed,
            as a watch does where waves, wind or a foul hull slow the ship; 0 leaves it alone.

    State: the governor's integral [mm] and the lever's trim [m/s], shape (n, 2).

    Raises:
        ValueError: ``trim_s`` is no time from 0 s on.
    """

    name = "combinator"
    source = "common practice"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"combinator-trimmed": {"trim_s": 30.0}}
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "response_s": (1.0, 20.0), "trim_s": (5.0, 100.0),
    }  # fmt: skip

    def __init__(
        self,
        ship: str | Ship = "frigate",
        interval_s: float = 0.5,
        curve: Curve | None = None,
        response_s: float = RESPONSE_S,
        trim_s: float = 0.0,
    ) -> None:
        super().__init__(ship, interval_s)
        if not (np.isfinite(trim_s) and trim_s >= 0.0):
            raise ValueError(f"combinator: trim_s = {trim_s!r} s: must be 0 or more")
        self.trim_s = trim_s
        self.curve = combinator_curve(self.ship) if curve is None else curve
        middle = float(np.interp(0.5, self.curve.lever, self.curve.pitch_ratio))
        self.governor = Governor(self.ship, interval_s, response_s, middle)

    def set_points(self, speed_order: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pitch [-] and shaft speed [rad/s] for an ordered ship speed [m/s], each of shape (n,)."""
        wanted = self.curve.at(speed_order)
        return wanted.pitch_ratio, wanted.shaft_speed

    def steady(self, speed_order: float, resistance_factor: float = 1.0) -> SteadyPoint:
        """Where the ship settles in calm water.

        Args:
            speed_order: ordered ship speed [m/s].
            resistance_factor: d_c1 [-].
        """
        pitch, speed = self.set_points(speed_order)
        return steady_point(self.ship, float(speed), float(pitch), resistance_factor)

    def fresh(self, seen: Readings) -> NDArray[np.float64]:
        """The integral with which the rack stays where it is, and no trim."""
        _, speed = self.set_points(seen.speed_order)
        integral = self.governor.settle(seen.shaft_speed, seen.fuel_rack, speed)
        return np.column_stack([integral, np.zeros_like(integral)])

    def act(
        self, seen: Readings, memory: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Pitch of the curve, and the governor's rack."""
        if self.trim_s > 0.0:
            short = np.clip(seen.speed_order - seen.ship_speed, -_NEAR, _NEAR)
            memory[:, 1] += self.interval_s / self.trim_s * short
        pitch, speed = self.set_points(seen.speed_order + memory[:, 1])
        rack, memory[:, 0] = self.governor.command(speed, seen.shaft_speed, memory[:, 0])
        return pitch, rack
