"""Helmsmen: steering controllers with their measurements, and the cross-track controller.

A helmsman commands the rudder. The cross-track controller keeps the ship on a line:

    rudder = C (y_set - y) / L_pp
    C = 20 (s + 0.5)^2 (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)^2)   on the destroyer's P / s

Taylor 2000, section 5.3, eq. 5.42; on another ship C is the controller that gives the same loop. The
set-point moves to a new line along a polynomial of fifth order without slope and curvature at both ends:
"smooth trajectories are required" (section 5.3.3.1).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..plant.approach import approach
from ..plant.helm import require_steering
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from ..plant.steady_state import Equilibrium, equilibrium
from .loop_shaping import (
    TRACK_LOOP,
    ShapedController,
    shape_controller,
    steering_dynamics,
    track_plant,
)

STEERED = (
    "heading_order",
    "heading",
    "yaw_rate",
    "rudder_angle",
    "cross_track_order",
    "cross_track",
)
"""Signals that steering adds to an observation, in order; ``plant/signals.py`` lists their units."""

_USUAL_LOAD = 0.6  # drive command over its highest value, for the default design speed


class SteeringMeasurements(NamedTuple):
    """Measurements of a helmsman, each of shape (n,)."""

    heading_order: NDArray[np.float64]  # to starboard of the first course [rad]
    heading: NDArray[np.float64]  # measured [rad]
    yaw_rate: NDArray[np.float64]  # measured, to starboard [rad/s]
    rudder_angle: NDArray[np.float64]  # measured [rad]
    track_order: NDArray[np.float64]  # to starboard of the first course [m]
    cross_track: NDArray[np.float64]  # measured [m]
    ship_speed: NDArray[np.float64]  # measured, through the water [m/s]


class Helmsman(ABC):
    """Compute rudder commands, for any number of equal ships at once (base class).

    Args:
        ship: ship that turns and has a rudder, or its name.
        interval_s: time between two commands [s].
        speed_m_s: design speed [m/s]; by default the ship speed at 60 % of the highest drive command.

    Raises:
        ShipError: the ship cannot be steered, or does not reach the design speed.
        ValueError: the interval is not positive.
    """

    name: ClassVar[str]
    """Registered name."""
    source: ClassVar[str] = ""
    """Publication."""
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {}
    """Options that can be tuned, with their ranges."""

    def __init__(
        self, ship: str | Ship, interval_s: float = 0.5, speed_m_s: float | None = None
    ) -> None:
        self.ship = load_ship(ship)
        require_steering(self.ship)
        if not interval_s > 0.0:
            raise ValueError(f"interval_s = {interval_s:g} (unit s; allowed: > 0)")
        self.interval_s = interval_s
        self.length = self.ship.manoeuvring.length_m
        self.rudder_max = self.ship.rudder.angle_max_rad
        self.point = _straight_course(self.ship, speed_m_s)

    @abstractmethod
    def initial_state(self, signals: SteeringMeasurements) -> NDArray[np.float64]:
        """Return the initial controller state, shape (n, k).

        Args:
            signals: first measurements of n ships.
        """

    @abstractmethod
    def rudder(
        self, signals: SteeringMeasurements, memory: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the rudder commands [rad], shape (n,), within the end stops.

        Args:
            signals: measurements of n ships.
            memory: controller state of the last call or :meth:`initial_state`; changed in place.
        """

    def lengths_travelled(self, signals: SteeringMeasurements) -> NDArray[np.float64]:
        """Return the distance travelled in an interval [ship lengths], shape (n,)."""
        speed = np.where(
            np.isfinite(signals.ship_speed), signals.ship_speed, self.point.state.ship_speed
        )
        return np.asarray(np.maximum(speed, 0.0) * self.interval_s / self.length)


class ShapedHelmsman(Helmsman):
    """Command the rudder by a set-point and a controller from loop shaping (base class).

    The controller state holds the set-point columns and then those of the controller.
    """

    law: ShapedController
    set_point_columns: ClassVar[int]
    """Number of set-point columns of the controller state; the first is the set-point itself."""

    @abstractmethod
    def initial_set_point(self, signals: SteeringMeasurements) -> NDArray[np.float64]:
        """Return the initial set-point columns, shape (n, set_point_columns)."""

    @abstractmethod
    def update_set_point(
        self,
        signals: SteeringMeasurements,
        distance: NDArray[np.float64],
        set_point: NDArray[np.float64],
    ) -> None:
        """Update the set-point columns, shape (n, set_point_columns), in place over an interval."""

    @abstractmethod
    def error(
        self, signals: SteeringMeasurements, set_point: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the control error in the unit of the controller, shape (n,)."""

    def initial_state(self, signals: SteeringMeasurements) -> NDArray[np.float64]:
        """Return the initial set-point and a controller in steady state."""
        set_point = self.initial_set_point(signals)
        return np.hstack([set_point, self.law.begin(self._finite_error(signals, set_point, 0.0))])

    def rudder(
        self, signals: SteeringMeasurements, memory: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the rudder commands of the controller at the present error."""
        distance, set_point = self.lengths_travelled(signals), memory[:, : self.set_point_columns]
        self.update_set_point(signals, distance, set_point)
        own = memory[:, self.set_point_columns :]
        last = own[:, self.law.order]
        return self.law.command(
            self._finite_error(signals, set_point, last), distance, own, self.rudder_max
        )

    def _finite_error(
        self, signals: SteeringMeasurements, set_point: NDArray[np.float64], last: Any
    ) -> NDArray[np.float64]:
        """Return the error, or the last one where a measurement is not finite."""
        error = self.error(signals, set_point)
        return np.where(np.isfinite(error), error, last)


def _straight_course(ship: Ship, speed_m_s: float | None) -> Equilibrium:
    if speed_m_s is not None:
        return approach(ship, speed_m_s)
    drive = _USUAL_LOAD * float(ship.record()["drive_max"])
    return equilibrium(ship, drive, ship.propeller.pitch_ratio_max)


def quintic(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the polynomial from 0 to 1 without slope and curvature at both ends.

    Args:
        share: share of the distance, limited to 0 to 1 [-].

    Example:
        >>> import numpy as np
        >>> quintic(np.array([-1.0, 0.0, 0.5, 1.0])).tolist()
        [0.0, 0.0, 0.5, 1.0]
    """
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


class TrackKeeper(ShapedHelmsman):
    """Keep the ship on the ordered line by the rudder, with a controller from loop shaping.

    Args:
        ship: ship that turns and is stable on a straight course, or its name.
        interval_s: time between two commands [s].
        speed_m_s: design speed of the loop [m/s].
        change_lengths: distance in which the set-point moves to a new line [ship lengths].
        gain: factor on C [-].
        reset_lengths: reset distance of :class:`~.loop_shaping.ShapedController` [ship lengths];
            infinite by default, as printed, for no integral.

    Raises:
        ShipError: the ship cannot be steered, or is not stable on a straight course.
        ValueError: an option is out of range.
    """

    name = "track-keeper"
    source = "Taylor 2000, section 5.3"
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "gain": (0.2, 5.0), "reset_lengths": (2.0, 100.0), "change_lengths": (1.0, 60.0),
    }  # fmt: skip
    set_point_columns = 4  # set-point, its start and its end at the last order, share of the change

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
        own = steering_dynamics(self.ship, self.point)
        self.law = ShapedController(
            gain * shape_controller(TRACK_LOOP, track_plant(*own)), reset_lengths
        )

    def initial_set_point(self, signals: SteeringMeasurements) -> NDArray[np.float64]:
        """Return the present line of the ship."""
        here = np.where(np.isfinite(signals.cross_track), signals.cross_track, 0.0)
        return np.column_stack([here, here, here, np.ones_like(here)])

    def update_set_point(
        self,
        signals: SteeringMeasurements,
        distance: NDArray[np.float64],
        set_point: NDArray[np.float64],
    ) -> None:
        """Move the set-point along the polynomial; a new order starts a new polynomial there."""
        changed = signals.track_order != set_point[:, 2]
        set_point[:, 1] = np.where(changed, set_point[:, 0], set_point[:, 1])
        set_point[:, 2] = signals.track_order
        set_point[:, 3] = np.where(changed, 0.0, set_point[:, 3]) + distance / self.change_lengths
        set_point[:, 0] = set_point[:, 1] + (set_point[:, 2] - set_point[:, 1]) * quintic(
            set_point[:, 3]
        )

    def error(
        self, signals: SteeringMeasurements, set_point: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return set-point minus cross track [ship lengths]."""
        return (set_point[:, 0] - signals.cross_track) / self.length
