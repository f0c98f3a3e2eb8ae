"""Discrete linear observer, the base of the Luenberger observer and the shaft Kalman filter.

Both estimate shaft speed and propeller torque from x' = (A - K C) x + [K, B] (omega, M_m) with
A = [[0, -1/I_R], [0, 0]], B = [1/I_R, 0], C = [1, 0] (thesis eqs. 3-3 to 3-5). They differ in K.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import Observer
from .records import Measurement
from .torque_curve import velocity_from_torque

FAR_SHARE = 0.2  # largest error of the shaft speed over it in a valid estimate [-]


def shaft_model(inertia: float) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return A, B and C of thesis eq. 3-3 for the inertia I_R behind the torque meter [kg m2].

    Example:
        >>> a, b, c = shaft_model(20_000.0)
        >>> b.tolist()
        [[5e-05], [0.0]]
    """
    a = np.array([[0.0, -1.0 / inertia], [0.0, 0.0]])
    return a, np.array([[1.0 / inertia], [0.0]]), np.array([[1.0, 0.0]])


def first_order_hold(
    a: NDArray[Any], b: NDArray[Any], dt: float
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Discretise x' = A x + B u exactly for an input that is linear between samples, dt [s] apart.

    Returns ``transition``, ``before``, ``now`` with x+ = transition x + before u(t) + now u(t + dt)
    (Franklin, Powell & Workman 1998, section 6.3.2: triangle hold), by one matrix exponential.

    Example:
        An integrator adds the mean of both inputs times the sample time:

        >>> import numpy as np
        >>> transition, before, now = first_order_hold(np.zeros((1, 1)), np.eye(1), 0.5)
        >>> transition.item(), before.item(), now.item()
        (1.0, 0.25, 0.25)
    """
    n, m = b.shape
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n] = a * dt
    block[:n, n : n + m] = b * dt
    block[n : n + m, n + m :] = np.eye(m)
    exponential = scipy.linalg.expm(block)
    held = exponential[:n, n : n + m]
    ramp = exponential[:n, n + m :]
    return exponential[:n, :n], held - ramp, ramp


class LinearObserver(Observer):
    """Estimate shaft speed and propeller torque with a constant gain (base class)."""

    @abstractmethod
    def gain(self, ship: Ship) -> NDArray[Any]:
        """Return K = (k1 [1/s], k2 [N m/rad]) on the error of the shaft speed, shape (2, 1).

        Raises:
            ObserverError: the inertia behind the torque meter is 0.
        """

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record; the discretisation is exact, so stable for any gain and step."""
        record = super().discretise(ship, dt)
        a, b, c = shaft_model(self.inertia(ship))
        gain = self.gain(ship)
        record["transition"], record["before"], record["now"] = first_order_hold(
            a - gain @ c, np.hstack([gain, b]), dt
        )
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Estimate omega and M_p, then v_a by the inverse torque curve."""
        if estimate.started == 0:
            # The shaft is assumed in steady motion at the first sample: M_p = M_m.
            estimate.x[0] = m.shaft_speed
            estimate.x[1] = m.shaft_torque
        else:
            f, before, now = observer.transition, observer.before, observer.now
            x0, x1 = estimate.x[0], estimate.x[1]
            w0, w1 = estimate.shaft_speed, estimate.shaft_torque
            for i in range(2):
                known = f[i, 0] * x0 + f[i, 1] * x1 + before[i, 0] * w0 + before[i, 1] * w1
                estimate.x[i] = known + now[i, 0] * m.shaft_speed + now[i, 1] * m.shaft_torque
        velocity, valid = velocity_from_torque(
            observer.ship, estimate.x[1], estimate.x[0], m.pitch_ratio, estimate.advance_velocity
        )
        away = abs(estimate.x[0] - m.shaft_speed)
        return velocity, valid and away <= FAR_SHARE * abs(m.shaft_speed)
