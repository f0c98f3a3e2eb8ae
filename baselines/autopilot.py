"""Autopilot: holds a heading by the rudder, with a controller from loop shaping.

    rudder = C (psi_set - psi),   C = L / P,   L = 60 / (s (s^2 + 2 2 sqrt(60) s + 60))

Taylor 2000, section 5.2: crossover at 0.91, phase margin 64 deg and gain margin 30 dB on every ship. At
a new order the set-point moves at a constant rate of turn in the shorter direction, with time from the
ship lengths travelled (section 5.2.3.2).
"""

from __future__ import annotations

import math

import numpy as np

from ..observers.records import Floats
from ..plant.ship import Ship
from .helmsman import ShapedHelmsman, SteeringMeasurements
from .loop_shaping import COURSE_LOOP


class Autopilot(ShapedHelmsman):
    """Hold the ordered heading by the rudder, with a controller from loop shaping.

    Args:
        turn_deg: rate of turn of the set-point [deg per ship length].

    The other arguments are those of every helmsman.

    Raises:
        ShipError: the ship cannot be steered, or is not stable on a straight course.
        ValueError: an option is out of range.
    """

    name = "autopilot"
    source = "Taylor 2000, section 5.2"
    tunable = ShapedHelmsman.tunable | {"turn_deg": (2.0, 60.0)}
    loop = COURSE_LOOP
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
        super().__init__(ship, interval_s, speed_m_s, gain, reset_lengths, turn_deg=turn_deg)
        self.turn = math.radians(turn_deg)

    def initial_set_point(self, signals: SteeringMeasurements) -> Floats:
        """Return the present heading."""
        return np.array(np.where(np.isfinite(signals.heading), signals.heading, 0.0))[:, None]

    def update_set_point(
        self, signals: SteeringMeasurements, distance: Floats, set_point: Floats
    ) -> None:
        """Move the set-point towards the order, at most at the rate of turn."""
        error = _half_turn(signals.heading_order - set_point[:, 0])
        set_point[:, 0] += np.clip(error, -self.turn * distance, self.turn * distance)

    def error(self, signals: SteeringMeasurements, set_point: Floats) -> Floats:
        """Return set-point minus heading [rad], between -pi and pi."""
        return _half_turn(set_point[:, 0] - signals.heading)


def _half_turn(angle: Floats) -> Floats:
    """Return angles [rad] reduced to half a turn to either side."""
    return np.asarray(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)
