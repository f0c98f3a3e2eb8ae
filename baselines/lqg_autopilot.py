"""LQG autopilot: holds a heading by the rudder, with optimal feedback of estimated states.

    u = -K x_hat,   x_hat' = A x_hat + B u + L (psi - C x_hat)
    K minimises the mean of psi^2 + w delta^2                      (van Amerongen 1984, eq. 1)
    L for the process noise G + q B B' and heading noise of density 1    (Doyle and Stein 1981, eq. 11)

The states are sway speed, rate of turn, heading and rudder angle, with time in ship lengths travelled.
Only the heading is measured. The larger the recovery q, the closer the loop comes to the margins of
state feedback, and the more the rudder follows waves. Unlike :mod:`.autopilot`, the controller needs no
ship that is stable on a straight course.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from ..core.lazy import control
from ..observers.records import Floats
from ..plant.ship import Ship, ShipError
from ..plant.steady_state import Equilibrium
from ..plant.steering import sway_yaw_model
from .autopilot import Autopilot

DISTURBANCE = 0.01
"""Density of the disturbance of the rate of turn over that of the heading noise, in ship lengths."""

LEAST_GEAR = 1e-3
"""Shortest time constant of the steering gear in the model [ship lengths]."""


class LqgAutopilot(Autopilot):
    """Hold the ordered heading by the rudder, with a linear-quadratic-Gaussian controller.

    Args:
        rudder_weight: weight w of the rudder angle against the heading error [-].
        recovery: process noise q at the rudder, relative to the heading noise [-].

    The other arguments are those of :class:`.autopilot.Autopilot`.

    Raises:
        ShipError: the ship cannot be steered, or the rudder does not turn it.
        ValueError: an option is out of range.

    Examples:
        >>> pilot = LqgAutopilot("kvlcc2")  # unstable on a straight course
        >>> pilot.law.order
        4
    """

    name = "lqg-autopilot"
    source = "van Amerongen 1984; Doyle and Stein 1981"
    tunable: ClassVar[dict[str, tuple[float, float]]] = {
        "turn_deg": (2.0, 60.0),
        "reset_lengths": (2.0, 100.0),
        "rudder_weight": (0.05, 20.0),
        "recovery": (1.0, 1e5),
    }

    def __init__(
        self,
        ship: str | Ship,
        interval_s: float = 0.5,
        speed_m_s: float | None = None,
        turn_deg: float = 6.5,
        rudder_weight: float = 1.0,
        recovery: float = 100.0,
        reset_lengths: float = math.inf,
    ) -> None:
        for name, value in (("rudder_weight", rudder_weight), ("recovery", recovery)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} = {value:g} (allowed: > 0)")
        self.rudder_weight, self.recovery = rudder_weight, recovery
        super().__init__(ship, interval_s, speed_m_s, turn_deg, 1.0, reset_lengths)

    def synthesise(self) -> control.StateSpace:
        """Return the controller from heading error to rudder command, with time in ship lengths."""
        a, b, c = steering_states(self.ship, self.point)
        try:
            gain, _, _ = control.lqr(a, b, c.T @ c, np.array([[self.rudder_weight]]))
            noise = np.diag([0.0, DISTURBANCE, 0.0, 0.0]) + self.recovery * b @ b.T
            filter_gain, _, _ = control.lqe(a, np.eye(4), c, noise, np.eye(1))
        except (np.linalg.LinAlgError, ValueError) as error:
            raise ShipError(
                f"{self.ship.name}: no LQG controller, because the rudder does not turn the ship or the "
                f"heading does not show its states ({error})"
            ) from None
        return control.ss(a - b @ gain - filter_gain @ c, filter_gain, gain, np.zeros((1, 1)))


def steering_states(ship: Ship, point: Equilibrium) -> tuple[Floats, Floats, Floats]:
    """Return the linear model of heading by rudder command on a straight course: matrices A, B and C.

    The states are sway speed over ship speed, rate of turn [rad per ship length], heading and rudder
    angle [rad]; the time is counted in ship lengths travelled.

    Args:
        ship: ship that turns and has a rudder.
        point: steady state at the design speed.

    Raises:
        ShipError: the ship cannot be steered or does not move ahead.
    """
    speed = point.state.ship_speed
    if not speed > 0.0:
        raise ShipError(f"{ship.name}: steering needs a speed ahead, not {speed:g} m/s")
    model, lengths = sway_yaw_model(ship, point), ship.manoeuvring.length_m / speed
    scale = np.diag([1.0 / speed, lengths])
    gear = max(ship.rudder.time_constant_s / lengths, LEAST_GEAR)
    a, b = np.zeros((4, 4)), np.zeros((4, 1))
    a[:2, :2] = lengths * scale @ model.A @ np.linalg.inv(scale)
    a[:2, 3:] = lengths * scale @ model.B
    a[2, 1], a[3, 3], b[3, 0] = 1.0, -1.0 / gear, 1.0 / gear
    return a, b, np.array([[0.0, 0.0, 1.0, 0.0]])
