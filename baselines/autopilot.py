"""Autopilot: holds a heading by the rudder, with a controller from loop shaping.

    rudder = C (psi_set - psi),   C = L / P,   L = 60 / (s (s^2 + 2 2 sqrt(60) s + 60))

Taylor 2000, section 5.2: crossover at 0.91, phase margin 64 deg and gain margin 30 dB on every ship. At
a new order the set-point moves at a constant rate of turn in the shorter direction, with time from the
ship lengths travelled (section 5.2.3.2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from .helmsman import ShapedHelmsman, SteeringMeasurements
from .loop_shaping import (
    COURSE_LOOP,
    ShapedController,
    heading_plant,
    shape_controller,
    steering_dynamics,
)


class Autopilot(ShapedHelmsman):
    """Hold the ordered heading by the rudder, with a controller from loop shaping.

    Args:
        ship: ship that turns and is stable on a straight course, or its name.
        interval_s: time between two commands [s].
        speed_m_s: design speed of the loop [m/s].
        turn_deg: rate of turn of the set-point [deg per ship length].
        gain: factor on C [-].
        reset_lengths: reset distance of :class:`~.loop_shaping.ShapedController` [ship lengths];
            infinite by default, as printed, for no integral.

    Raises:
        ShipError: the ship cannot be steered, or is not stable on a straight course.
        ValueError: an option is out of range.
    """

    name = "autopilot"
    source = "Taylor 2000, section 5.2"
    tunable: ClassVar[Mapping[str, tuple[float, float]]] = {
        "gain": (0.2, 5.0), "reset_lengths": (2.0, 100.0), "turn_deg": (2.0, 60.0),
    }  # fmt: skip
    set_point_columns = 1

    def __init__(
        self,
        ship: str | Ship,
        interval_s: float = 0.5,
        speed_m_s: float | None = None,
        turn_deg: float = 6.5,
        gain: float = 1.0,
        reset_lengths: float = math.inf,
    ) -> None:
        super().__init__(ship, interval_s, speed_m_s)
        for name, value in (("turn_deg", turn_deg), ("gain", gain)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} (allowed: > 0)")
        self.turn = math.radians(turn_deg)
        own = steering_dynamics(self.ship, self.point)
        self.law = ShapedController(
            gain * shape_controller(COURSE_LOOP, heading_plant(*own)), reset_lengths
        )

    def initial_set_point(self, signals: SteeringMeasurements) -> NDArray[np.float64]:
        """Return the present heading."""
        return np.array(np.where(np.isfinite(signals.heading), signals.heading, 0.0))[:, None]

    def update_set_point(
        self,
        signals: SteeringMeasurements,
        distance: NDArray[np.float64],
        set_point: NDArray[np.float64],
    ) -> None:
        """Move the set-point towards the order, at most at the rate of turn."""
        error = np.remainder(signals.heading_order - set_point[:, 0] + np.pi, 2.0 * np.pi) - np.pi
        set_point[:, 0] += np.clip(error, -self.turn * distance, self.turn * distance)

    def error(
        self, signals: SteeringMeasurements, set_point: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return set-point minus heading [rad], between -pi and pi."""
        return np.asarray(
            np.remainder(set_point[:, 0] - signals.heading + np.pi, 2.0 * np.pi) - np.pi
        )
