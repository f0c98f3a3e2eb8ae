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
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core.lazy import control
from ..observers.records import Floats
from ..plant.approach import approach
from ..plant.helm import require_steering
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from ..plant.steady_state import equilibrium
from . import loop_shaping
from .controller import Ranges

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

    heading_order: Floats  # to starboard of the first course [rad]
    heading: Floats  # measured [rad]
    yaw_rate: Floats  # measured, to starboard [rad/s]
    rudder_angle: Floats  # measured [rad]
    track_order: Floats  # to starboard of the first course [m]
    cross_track: Floats  # measured [m]
    ship_speed: Floats  # measured, through the water [m/s]


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

    name: ClassVar[str]  # registered name
    source: ClassVar[str] = ""  # publication
    tunable: ClassVar[Ranges] = {}

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
        if speed_m_s is not None:
            self.point = approach(self.ship, speed_m_s)
        else:
            drive = _USUAL_LOAD * float(self.ship.record()["drive_max"])
            self.point = equilibrium(self.ship, drive, self.ship.propeller.pitch_ratio_max)

    @abstractmethod
    def initial_state(self, signals: SteeringMeasurements) -> Floats:
        """Return the initial controller state at the first measurements of n ships, shape (n, k)."""

    @abstractmethod
    def rudder(self, signals: SteeringMeasurements, memory: Floats) -> Floats:
        """Return the rudder commands [rad], shape (n,), within the end stops.

        Args:
            signals: measurements of n ships.
            memory: controller state of the last call or :meth:`initial_state`; changed in place.
        """

    def lengths_travelled(self, signals: SteeringMeasurements) -> Floats:
        """Return the distance travelled in an interval [ship lengths], shape (n,)."""
        speed = _where_finite(signals.ship_speed, self.point.state.ship_speed)
        return np.asarray(np.maximum(speed, 0.0) * self.interval_s / self.length)


def _where_finite(values: Floats, other: Any) -> Floats:
    """Return values, or the other ones where they are not finite."""
    return np.where(np.isfinite(values), values, other)


class ShapedHelmsman(Helmsman):
    """Command the rudder by a set-point and a controller from loop shaping (base class).

    The controller state holds the set-point columns and then those of the controller.

    Args:
        ship: ship that turns and is stable on a straight course, or its name.
        interval_s: time between two commands [s].
        speed_m_s: design speed of the loop [m/s]; that at 60 % of the highest drive command by default.
        gain: factor on C [-].
        reset_lengths: reset distance of :class:`~.loop_shaping.ShapedController` [ship lengths];
            infinite by default, as printed, for no integral.
        positive: further options that must be positive, by name.
    """

    tunable: ClassVar[dict[str, tuple[float, float]]] = {
        "gain": (0.2, 5.0),
        "reset_lengths": (2.0, 100.0),
    }
    loop: ClassVar[loop_shaping.Factors]  # given loop L

    set_point_columns: ClassVar[int]  # of the controller state; the first is the set-point itself

    def __init__(
        self,
        ship: str | Ship,
        interval_s: float,
        speed_m_s: float | None,
        gain: float,
        reset_lengths: float,
        **positive: float,
    ) -> None:
        super().__init__(ship, interval_s, speed_m_s)
        for name, value in (positive | {"gain": gain}).items():
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} (allowed: > 0)")
        self.law = loop_shaping.ShapedController(gain * self.synthesise(), reset_lengths)

    def synthesise(self) -> control.StateSpace:
        """Return the controller from error to rudder command, with time in ship lengths."""
        plant = loop_shaping.heading_plant(*loop_shaping.steering_dynamics(self.ship, self.point))
        return loop_shaping.shape_controller(
            self.loop, plant._replace(integrators=self.loop.integrators)
        )

    @abstractmethod
    def initial_set_point(self, signals: SteeringMeasurements) -> Floats:
        """Return the initial set-point columns, shape (n, set_point_columns)."""

    @abstractmethod
    def update_set_point(
        self, signals: SteeringMeasurements, distance: Floats, set_point: Floats
    ) -> None:
        """Update the set-point columns, shape (n, set_point_columns), in place over an interval."""

    @abstractmethod
    def error(self, signals: SteeringMeasurements, set_point: Floats) -> Floats:
        """Return the control error in the unit of the controller, shape (n,)."""

    def initial_state(self, signals: SteeringMeasurements) -> Floats:
        """Return the initial set-point and a controller in steady state."""
        set_point = self.initial_set_point(signals)
        error = _where_finite(self.error(signals, set_point), 0.0)
        return np.hstack([set_point, self.law.begin(error)])

    def rudder(self, signals: SteeringMeasurements, memory: Floats) -> Floats:
        """Return the rudder commands of the controller at the present error."""
        distance, set_point = self.lengths_travelled(signals), memory[:, : self.set_point_columns]
        self.update_set_point(signals, distance, set_point)
        own = memory[:, self.set_point_columns :]
        error = _where_finite(self.error(signals, set_point), own[:, self.law.order])
        return self.law.command(error, distance, own, self.rudder_max)


def quintic(share: Floats) -> Floats:
    """Return the polynomial from 0 to 1 without slope and curvature at both ends.

    The share of the distance [-] is limited to 0 to 1.

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
        change_lengths: distance in which the set-point moves to a new line [ship lengths].

    The other arguments are those of every helmsman.

    Raises:
        ShipError: the ship cannot be steered, or is not stable on a straight course.
        ValueError: an option is out of range.
    """

    name = "track-keeper"
    source = "Taylor 2000, section 5.3"
    tunable = ShapedHelmsman.tunable | {"change_lengths": (1.0, 60.0)}
    loop = loop_shaping.TRACK_LOOP
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
        own = {"change_lengths": change_lengths}
        super().__init__(ship, interval_s, speed_m_s, gain, reset_lengths, **own)
        self.change_lengths = change_lengths

    def initial_set_point(self, signals: SteeringMeasurements) -> Floats:
        """Return the present line of the ship."""
        here = _where_finite(signals.cross_track, 0.0)
        return np.column_stack([here, here, here, np.ones_like(here)])

    def update_set_point(
        self, signals: SteeringMeasurements, distance: Floats, set_point: Floats
    ) -> None:
        """Move the set-point along the polynomial; a new order starts a new polynomial there."""
        now, start, end, share = set_point.T  # views of the columns
        changed = signals.track_order != end
        start[:] = np.where(changed, now, start)
        end[:] = signals.track_order
        share[:] = np.where(changed, 0.0, share) + distance / self.change_lengths
        now[:] = start + (end - start) * quintic(share)

    def error(self, signals: SteeringMeasurements, set_point: Floats) -> Floats:
        """Return set-point minus cross track [ship lengths]."""
        return (set_point[:, 0] - signals.cross_track) / self.length
