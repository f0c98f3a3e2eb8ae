"""Steering by loop shaping: the loop is chosen, the controller is what makes it out of the ship.

    C = L / P                                             (Taylor 2000, eq. 5.30)
    P = K / (s (T s + 1)) / (T_sg s + 1)                  heading by rudder command (eqs. 5.27 to 5.29)
    P / s                                                 cross track [ship lengths] (eq. 5.39)

Time is counted in ship lengths sailed. K and T are Nomoto's; of one hull they do not change with the
speed, so neither does the controller, which only has to know how far the ship has come.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from ..core.lazy import control
from ..plant.ship import Ship, ShipError
from ..plant.steady_state import Equilibrium
from ..plant.steering import Nomoto, nomoto

_SAME = 1e-9  # share by which a pole and a zero that cancel may differ


class Factors(NamedTuple):
    """A transfer function as gain, zeros and poles beside its integrators [per ship length]."""

    gain: float
    zeros: tuple[complex, ...]
    poles: tuple[complex, ...]
    integrators: int

    @property
    def system(self) -> control.StateSpace:
        """As a linear system, time in ship lengths."""
        poles = [*self.poles, *([0.0] * self.integrators)]
        return control.ss(control.zpk(list(self.zeros), poles, self.gain))


_HALF, _SPREAD = 2.0 * math.sqrt(60.0), math.sqrt(180.0)

COURSE_LOOP = Factors(60.0, (), (-_HALF + _SPREAD, -_HALF - _SPREAD), 1)
"""60 / (s (s^2 + 2 2 sqrt(60) s + 60)): eq. 5.32, where the middle term's s is not printed."""

TAYLOR = Nomoto(2.04, 1.9287, (complex(math.nan), complex(math.nan)), math.nan)
"""The destroyer at 22 knots, eqs. 5.25 and 5.26."""

TAYLOR_GEAR = 1.0 / 6.0
"""Her steering gear's time constant [ship lengths], eq. 5.28."""

TRACK_LOOP = Factors(
    20.0 * TAYLOR.gain / TAYLOR.time / TAYLOR_GEAR,
    (-0.5, -0.5, -1000.0),
    (-1.0 / TAYLOR.time, -11.0, -15.0, -30.0, -30.0),
    2,
)
"""20 (s + 0.5)^2 (s + 6) (s + 1000) / ((s + 11) (s + 15) (s + 30)^2), eq. 5.42, on her P / s."""


def heading_plant(steering: Nomoto, gear_lengths: float) -> Factors:
    """Heading [rad] by rudder command [rad].

    Args:
        steering: K and T of the ship.
        gear_lengths: time constant of her steering gear [ship lengths].

    Raises:
        ShipError: she does not hold her course, so that C = L / P would cancel an unstable pole.
    """
    if not (steering.time > 0.0 and steering.gain > 0.0):
        raise ShipError(
            f"a loop is shaped around a ship that holds her course: T = {steering.time:.4g} ship "
            f"lengths (allowed: > 0), K = {steering.gain:.4g} (allowed: > 0); see "
            "manoeuvring.N_v, manoeuvring.N_r and rudder.area_m2"
        )
    poles = [-1.0 / steering.time]
    gain = steering.gain / steering.time
    if gear_lengths > 0.0:
        poles.append(-1.0 / gear_lengths)
        gain /= gear_lengths
    return Factors(gain, (), tuple(poles), 1)


def track_plant(steering: Nomoto, gear_lengths: float) -> Factors:
    """Cross track [ship lengths] by rudder command [rad]; as of :func:`heading_plant`."""
    return heading_plant(steering, gear_lengths)._replace(integrators=2)


def shaped(loop: Factors, plant: Factors) -> control.StateSpace:
    """The controller that makes a loop of a plant; common poles, zeros and integrators cancel.

    Args:
        loop: L.
        plant: P, with as many integrators and no zeros.

    Returns:
        From error to command, time in ship lengths.

    Raises:
        ValueError: a controller that would have to differentiate.
    """
    if loop.integrators != plant.integrators or plant.zeros:
        raise ValueError("loop and plant need as many integrators, and the plant no zeros")
    zeros, poles = [*loop.zeros, *plant.poles], [*loop.poles]
    for zero in [*zeros]:
        near = [pole for pole in poles if abs(pole - zero) <= _SAME * abs(pole)]
        if near:
            zeros.remove(zero)
            poles.remove(near[0])
    if len(zeros) > len(poles):
        raise ValueError("the loop falls off more slowly than the plant, which C = L / P cannot do")
    return control.ss(control.zpk(zeros, poles, loop.gain / plant.gain))


class ShapedLaw:
    """A controller from :func:`shaped` as it acts on a ship: step by step, by the way sailed.

    Between two readings the error goes in a straight line (trapezoidal rule, Tustin).

    Args:
        controller: from error to rudder command [rad], time in ship lengths.
        reset_lengths: way in which a constant error makes the command grow by what the controller
            answers to it at rest [ship lengths]; infinite, as printed, for no such integral.
    """

    def __init__(self, controller: control.StateSpace, reset_lengths: float = math.inf) -> None:
        if not reset_lengths > 0.0:
            raise ValueError(f"reset_lengths = {reset_lengths:g} (unit L; allowed: > 0)")
        self.controller = controller
        self._a, self._b = np.array(controller.A), np.array(controller.B)[:, 0].copy()
        self._c, self._d = np.array(controller.C)[0].copy(), float(controller.D[0, 0])
        self._rest = float(np.real(controller.dcgain())) / reset_lengths

    @property
    def order(self) -> int:
        """Of the controller: so many states its memory holds, then the last error and the integral."""
        return len(self._a)

    def sampled(self, way: float) -> control.StateSpace:
        """The law as a discrete system, time in ship lengths, without its integral.

        Args:
            way: between two commands [ship lengths].
        """
        return control.sample_system(self.controller, way, method="bilinear")

    def begin(self, error: NDArray[np.float64]) -> NDArray[np.float64]:
        """Memory of shape (n, order + 2) where errors have stood as they are for ever.

        Args:
            error: shape (n,).
        """
        rest = -np.linalg.solve(self._a, self._b) if self.order else np.zeros(0)
        return np.column_stack([error[:, None] * rest, error, np.zeros_like(error)])

    def command(
        self,
        error: NDArray[np.float64],
        way: NDArray[np.float64],
        memory: NDArray[np.float64],
        most: float,
    ) -> NDArray[np.float64]:
        """Rudder commands [rad], shape (n,), within the end stops.

        Args:
            error: shape (n,).
            way: sailed since the last call [ship lengths], shape (n,).
            memory: from :meth:`begin` or the last call, changed in place.
            most: largest command [rad].
        """
        found = np.empty(len(memory))
        _command_all(
            self._a, self._b, self._c, self._d, self._rest, np.ascontiguousarray(error),
            np.ascontiguousarray(way), memory, most, found,
        )  # fmt: skip
        return found


@compiled
def _command_all(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    d: float,
    rest: float,
    error: NDArray[np.float64],
    way: NDArray[np.float64],
    memory: NDArray[np.float64],
    most: float,
    command: NDArray[np.float64],
) -> None:
    """The law of each ship for itself, so that many are as one."""
    order = len(a)
    for i in range(len(error)):
        row = memory[i]
        half, driven = 0.5 * way[i], row[order] + error[i]
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
        # the integral stands still where the rudder is at a stop towards which it pushes
        if not (abs(asked) > most and asked * error[i] > 0.0):
            row[order + 1] = integral
        row[order] = error[i]
        command[i] = min(max(asked, -most), most)


class Steered(NamedTuple):
    """A ship as a steering controller is designed for her."""

    steering: Nomoto
    gear_lengths: float  # time constant of the steering gear [ship lengths]


def steered_at(ship: Ship, point: Equilibrium) -> Steered:
    """What loop shaping needs of a ship.

    Args:
        ship: that turns.
        point: straight course at the speed at which she is steered.

    Raises:
        ShipError: a ship that cannot be steered or does not sail ahead.
    """
    found = nomoto(ship, point)
    lengths = ship.manoeuvring.length_m / point.state.ship_speed
    return Steered(found, ship.rudder.time_constant_s / lengths)
