"""Loop shaping of steering controllers: the controller follows from a given loop and the ship.

    C = L / P                                             (Taylor 2000, eq. 5.30)
    P = K / (s (T s + 1)) / (T_sg s + 1)                  heading by rudder command (eqs. 5.27 to 5.29)
    P / s                                                 cross track [ship lengths] (eq. 5.39)

The time is counted in ship lengths travelled. K and T are Nomoto's parameters. In this time they do not
depend on the ship speed, nor does the controller, which needs only the distance travelled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..core.compiled import compiled
from ..core.lazy import control
from ..observers.records import Floats
from ..plant.ship import Ship, ShipError
from ..plant.steady_state import Equilibrium
from ..plant.steering import Nomoto, nomoto

_SAME = 1e-9  # largest relative difference of a pole and a zero that cancel


class Factors(NamedTuple):
    """Transfer function: gain, zeros, poles and number of integrators, in time by ship lengths."""

    gain: float
    zeros: tuple[complex, ...]
    poles: tuple[complex, ...]
    integrators: int

    @property
    def system(self) -> control.StateSpace:
        """Return the linear system, with time in ship lengths."""
        poles = [*self.poles, *([0.0] * self.integrators)]
        return control.ss(control.zpk(list(self.zeros), poles, self.gain))


_HALF, _SPREAD = 2.0 * math.sqrt(60.0), math.sqrt(180.0)
COURSE_LOOP = Factors(60.0, (), (-_HALF + _SPREAD, -_HALF - _SPREAD), 1)
"""60 / (s (s^2 + 2 2 sqrt(60) s + 60)), eq. 5.32, with the s of the middle term that is not printed."""

TAYLOR = Nomoto(2.04, 1.9287, (complex(math.nan), complex(math.nan)), math.nan)
"""Nomoto model of the destroyer at 22 knots, eqs. 5.25 and 5.26."""

TAYLOR_GEAR = (
    1.0 / 6.0
)  # time constant of the steering gear of the destroyer [ship lengths], eq. 5.28
TRACK_LOOP = Factors(
    20.0 * TAYLOR.gain / TAYLOR.time / TAYLOR_GEAR,
    (-0.5, -0.5, -1000.0),
    (-1.0 / TAYLOR.time, -11.0, -15.0, -30.0, -30.0),
    2,
)
"""20 (s + 0.5)^2 (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)^2), eq. 5.42, times P / s of the
destroyer."""


def heading_plant(steering: Nomoto, gear_lengths: float) -> Factors:
    """Return the transfer function from rudder command [rad] to heading [rad], with the steering gear.

    Raises:
        ShipError: the ship is not stable on a straight course; C = L / P would cancel an unstable pole.

    Example:
        >>> plant = heading_plant(TAYLOR, TAYLOR_GEAR)
        >>> [round(pole, 3) for pole in plant.poles], plant.integrators
        ([-0.518, -6.0], 1)
    """
    if not (steering.time > 0.0 and steering.gain > 0.0):
        raise ShipError(
            "loop shaping needs a ship that is stable on a straight course: "
            f"T = {steering.time:.4g} ship lengths (allowed: > 0), K = {steering.gain:.4g} "
            "(allowed: > 0); see manoeuvring.N_v, manoeuvring.N_r and rudder.area_m2"
        )
    poles = [-1.0 / steering.time]
    gain = steering.gain / steering.time
    if gear_lengths > 0.0:
        poles.append(-1.0 / gear_lengths)
        gain /= gear_lengths
    return Factors(gain, (), tuple(poles), 1)


def track_plant(steering: Nomoto, gear_lengths: float) -> Factors:
    """Return the transfer function from rudder command [rad] to cross track [ship lengths]."""
    return heading_plant(steering, gear_lengths)._replace(integrators=2)


def shape_controller(loop: Factors, plant: Factors) -> control.StateSpace:
    """Return C = L / P from error to command, with time in ship lengths; common factors cancel.

    Raises:
        ValueError: C would have more zeros than poles, or P has zeros or other integrators than L.

    Example:
        >>> controller = shape_controller(COURSE_LOOP, heading_plant(TAYLOR, TAYLOR_GEAR))
        >>> controller.nstates
        2
    """
    if loop.integrators != plant.integrators or plant.zeros:
        raise ValueError("the plant needs the integrators of the loop, and no zeros")
    zeros, poles = [*loop.zeros, *plant.poles], [*loop.poles]
    for zero in [*zeros]:
        near = [pole for pole in poles if abs(pole - zero) <= _SAME * abs(pole)]
        if near:
            zeros.remove(zero)
            poles.remove(near[0])
    if len(zeros) > len(poles):
        raise ValueError("the gain of the loop must fall at least as fast as that of the plant")
    return control.ss(control.zpk(zeros, poles, loop.gain / plant.gain))


class _Law(NamedTuple):
    """Matrices of a controller x' = a x + b e, u = c x + d e, and rate of its integral."""

    a: Floats
    b: Floats
    c: Floats
    d: float
    rest: float


class ShapedController:
    """Run a controller of :func:`shape_controller` on ships, in steps of the distance travelled.

    The error is interpolated linearly between two measurements (trapezoidal rule, Tustin). Over
    ``reset_lengths`` a constant error changes the integral by the steady response of the controller
    [ship lengths]; infinite, as printed, for no integral.
    """

    def __init__(self, controller: control.StateSpace, reset_lengths: float = math.inf) -> None:
        if not reset_lengths > 0.0:
            raise ValueError(f"reset_lengths = {reset_lengths:g} (unit L; allowed: > 0)")
        self.controller = controller
        b, c = np.array(controller.B)[:, 0].copy(), np.array(controller.C)[0].copy()
        rest = float(np.real(controller.dcgain())) / reset_lengths
        self._law = _Law(np.array(controller.A), b, c, float(controller.D[0, 0]), rest)

    @property
    def order(self) -> int:
        """Return the number of controller states; the last error and the integral follow them."""
        return len(self._law.a)

    def sampled(self, distance: float) -> control.StateSpace:
        """Return the controller, without its integral, as a discrete system at a distance [lengths]."""
        return control.sample_system(self.controller, distance, method="bilinear")

    def begin(self, error: Floats) -> Floats:
        """Return the controller state in steady state at errors of shape (n,), shape (n, order + 2)."""
        rest = -np.linalg.solve(self._law.a, self._law.b) if self.order else np.zeros(0)
        return np.column_stack([error[:, None] * rest, error, np.zeros_like(error)])

    def command(self, error: Floats, distance: Floats, memory: Floats, most: float) -> Floats:
        """Return the rudder commands [rad], shape (n,), at most ``most`` [rad] to either side.

        Errors and distances since the last call [ship lengths] have the shape (n,). The memory of
        :meth:`begin` or the last call is changed in place.
        """
        error, distance = np.ascontiguousarray(error), np.ascontiguousarray(distance)
        return _command_all(self._law, error, distance, memory, most)


@compiled
def _command_all(law: _Law, error: Floats, distance: Floats, memory: Floats, most: float) -> Floats:
    """Return the commands ship by ship, so that a batch gives the result of a single ship."""
    a, b, c, d, rest = law
    order, command = len(a), np.empty(len(error))
    for i in range(len(error)):
        row = memory[i]
        half, driven = 0.5 * distance[i], row[order] + error[i]
        left, right = np.zeros((order, order)), np.zeros(order)
        for j in range(order):
            right[j] = row[j] + half * b[j] * driven
            left[j, j] = 1.0
            for k in range(order):
                right[j] += half * a[j, k] * row[k]
                left[j, k] -= half * a[j, k]
        states = np.linalg.solve(left, right)
        integral = row[order + 1] + rest * half * driven
        asked = d * error[i] + integral
        for j in range(order):
            row[j] = states[j]
            asked += c[j] * states[j]
        # The integral is held while the error moves the rudder further against an end stop.
        if not (abs(asked) > most and asked * error[i] > 0.0):
            row[order + 1] = integral
        row[order] = error[i]
        command[i] = min(max(asked, -most), most)
    return command


class SteeringDynamics(NamedTuple):
    """Steering dynamics of a ship for the design of a steering controller."""

    steering: Nomoto
    gear_lengths: float  # time constant of the steering gear [ship lengths]


def steering_dynamics(ship: Ship, point: Equilibrium) -> SteeringDynamics:
    """Return the steering dynamics of a ship on a straight course.

    ``point`` is its steady state at the design speed.

    Raises:
        ShipError: the ship cannot be steered or does not move ahead.
    """
    found = nomoto(ship, point)
    lengths = ship.manoeuvring.length_m / point.state.ship_speed
    return SteeringDynamics(found, ship.rudder.time_constant_s / lengths)
