"""Who lays the rudder: what steering controllers are told, what they answer, and what all do alike.

Cross-track controller: keeps the ship on a line by the rudder, its loop shaped around the ship.

    rudder = C (y_aim - y) / L_pp
    C = 20 (s + 0.5)^2 (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)^2)   on the destroyer's P / s

Taylor 2000, section 5.3, eq. 5.42; on another ship C is what gives the same loop. A new line is led
to smoothly, by a polynomial of fifth order whose ends have neither slope nor curvature: "smooth
trajectories are required" (section 5.3.3.1).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..plant.approach import approach
from ..plant.helm import refuse_to_steer
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from ..plant.steady_state import Equilibrium, equilibrium
from .loop_shaping import TRACK_LOOP, ShapedLaw, shaped, steered_at, track_plant

STEERED = (
    "heading_order",
    "heading",
    "yaw_rate",
    "rudder_angle",
    "cross_track_order",
    "cross_track",
)
"""Signals that steering adds to an observation, in order; ``plant/signals.py`` has their units."""

_USUAL_LOAD = 0.6  # of the drive, at which a helmsman is designed who is told no speed


class Course(NamedTuple):
    """What a helmsman sees, each of shape (n,)."""

    heading_order: NDArray[np.float64]  # to starboard of the first course [rad]
    heading: NDArray[np.float64]  # measured [rad]
    yaw_rate: NDArray[np.float64]  # measured, to starboard [rad/s]
    rudder_angle: NDArray[np.float64]  # as fed back [rad]
    track_order: NDArray[np.float64]  # to starboard of the first course [m]
    cross_track: NDArray[np.float64]  # measured [m]
    ship_speed: NDArray[np.float64]  # by the log [m/s]


class Helmsman(ABC):
    """Base class: rudder commands from what is seen, for any number of equal ships at once.

    Args:
        ship: that turns and has a rudder, or its name.
        interval_s: time between two commands [s].
        speed_m_s: ship speed at which he is designed; by default that of a usual load of the drive.

    Raises:
        ShipError: a ship that cannot be steered, or that sails that speed under no demand.
        ValueError: an interval that is not positive.
    """

    name: ClassVar[str]
    """By which he is chosen."""
    source: ClassVar[str] = ""
    """Where he is published."""
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Options that a search may set, with their ranges."""

    def __init__(
        self, ship: str | Ship, interval_s: float = 0.5, speed_m_s: float | None = None
    ) -> None:
        self.ship = load_ship(ship)
        refuse_to_steer(self.ship)
        if not interval_s > 0.0:
            raise ValueError(f"interval_s = {interval_s:g} (unit s; allowed: > 0)")
        self.interval_s = interval_s
        self.length = self.ship.manoeuvring.length_m
        self.most = self.ship.rudder.angle_max_rad
        self.point = _straight(self.ship, speed_m_s)

    @abstractmethod
    def fresh(self, seen: Course) -> NDArray[np.float64]:
        """Memory of one who sees something for the first time, shape (n, k).

        Args:
            seen: of n ships.
        """

    @abstractmethod
    def rudder(self, seen: Course, memory: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rudder commands [rad], shape (n,), within the end stops.

        Args:
            seen: of n ships.
            memory: of the last call or :meth:`fresh`; changed in place.
        """

    def way(self, seen: Course) -> NDArray[np.float64]:
        """Ship lengths sailed in an interval, shape (n,)."""
        speed = np.where(np.isfinite(seen.ship_speed), seen.ship_speed, self.point.state.ship_speed)
        return np.asarray(np.maximum(speed, 0.0) * self.interval_s / self.length)


class ShapedHelmsman(Helmsman):
    """One whose law is shaped around the ship: what he aims at, and the law on what is missing.

    Memory: what he is aiming at, then the law's.
    """

    law: ShapedLaw
    aims: ClassVar[int]
    """Numbers that tell what he aims at, the aim itself first."""

    @abstractmethod
    def begin_aim(self, seen: Course) -> NDArray[np.float64]:
        """What he aims at when he begins, shape (n, aims)."""

    @abstractmethod
    def move_aim(self, seen: Course, way: NDArray[np.float64], aim: NDArray[np.float64]) -> None:
        """Move what he aims at over an interval; ``aim`` of shape (n, aims) is changed in place."""

    @abstractmethod
    def error(self, seen: Course, aim: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is missing, in the law's unit, shape (n,)."""

    def fresh(self, seen: Course) -> NDArray[np.float64]:
        """An aim, and a law at rest."""
        aim = self.begin_aim(seen)
        return np.hstack([aim, self.law.begin(self._known(seen, aim, 0.0))])

    def rudder(self, seen: Course, memory: NDArray[np.float64]) -> NDArray[np.float64]:
        """The law's answer to what is missing."""
        way, aim = self.way(seen), memory[:, : self.aims]
        self.move_aim(seen, way, aim)
        own = memory[:, self.aims :]
        last = own[:, self.law.order]
        return self.law.command(self._known(seen, aim, last), way, own, self.most)

    def _known(self, seen: Course, aim: NDArray[np.float64], last: Any) -> NDArray[np.float64]:
        """The error, or the last one where a reading fails."""
        error = self.error(seen, aim)
        return np.where(np.isfinite(error), error, last)


def _straight(ship: Ship, speed_m_s: float | None) -> Equilibrium:
    if speed_m_s is not None:
        return approach(ship, speed_m_s)
    drive = _USUAL_LOAD * float(ship.record()["drive_max"])
    return equilibrium(ship, drive, ship.propeller.pitch_ratio_max)


def quintic(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """From 0 to 1 with no slope and no curvature at either end.

    Args:
        share: of the way, held in 0 to 1.
    """
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


class TrackKeeper(ShapedHelmsman):
    """Keeps the ordered line; see the module.

    Args:
        ship: that turns and holds her course, or its name.
        interval_s: time between two commands [s].
        speed_m_s: at which the loop is shaped [m/s].
        change_lengths: way over which he leads to a new line [ship lengths].
        gain: factor on C [-].
        reset_lengths: see :class:`~.loop_shaping.ShapedLaw`; [ship lengths]; by default
            infinite, as printed, for no integral.

    Raises:
        ShipError: a ship that cannot be steered, or does not hold her course.
        ValueError: an option out of range.
    """

    name = "track-keeper"
    source = "Taylor 2000, section 5.3"
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "gain": (0.2, 5.0), "reset_lengths": (2.0, 100.0), "change_lengths": (1.0, 60.0),
    }  # fmt: skip
    aims = 4  # the line aimed at, where the change began, the order that it leads to, how far it is

    def __init__(
        self,
        ship: str | Ship,
        interval_s: float = 0.5,
        speed_m_s: float | None = None,
        change_lengths: float = 38.0,
        gain: float = 1.0,
        reset_lengths: float = math.inf,
    ) -> None:
        super().__init__(ship, interval_s, speed_m_s)
        for name, value in (("change_lengths", change_lengths), ("gain", gain)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} (allowed: > 0)")
        self.change_lengths = change_lengths
        own = steered_at(self.ship, self.point)
        self.law = ShapedLaw(gain * shaped(TRACK_LOOP, track_plant(*own)), reset_lengths)

    def begin_aim(self, seen: Course) -> NDArray[np.float64]:
        """The line on which the ship is."""
        here = np.where(np.isfinite(seen.cross_track), seen.cross_track, 0.0)
        return np.column_stack([here, here, here, np.ones_like(here)])

    def move_aim(self, seen: Course, way: NDArray[np.float64], aim: NDArray[np.float64]) -> None:
        """Along the polynomial; a new order begins another one from where this one is."""
        fresh = seen.track_order != aim[:, 2]
        aim[:, 1] = np.where(fresh, aim[:, 0], aim[:, 1])
        aim[:, 2] = seen.track_order
        aim[:, 3] = np.where(fresh, 0.0, aim[:, 3]) + way / self.change_lengths
        aim[:, 0] = aim[:, 1] + (aim[:, 2] - aim[:, 1]) * quintic(aim[:, 3])

    def error(self, seen: Course, aim: NDArray[np.float64]) -> NDArray[np.float64]:
        """Line aimed at less cross track [ship lengths]."""
        return (aim[:, 0] - seen.cross_track) / self.length
