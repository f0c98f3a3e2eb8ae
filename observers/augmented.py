"""The state-augmented extended Kalman filter, which knows no ship.

Unknown numbers theta of a model are states that do not change, and are estimated with the states x:

    dx/dt = f(x, theta, u) + w,   dtheta/dt = w_theta,   y = h(x, theta, u) + v

Continuous-discrete: between measurements x follows the model and the covariance P = E[dz dz'] of
z = (x, theta) follows dP/dt = F P + P F' + Q; at a measurement z += K (y - h), K = P H' / S,
S = H P H' + R. Derivatives are exact, by complex steps (thesis on identification of ship manoeuvring
by extended Kalman filter, chapter 2, Table 2.1; Gelb 1974, Table 6.1-1).

Measurements are taken in one after the other, which is the same as all at once where their noises are
independent, and needs no inverse.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled

Floats = NDArray[np.float64]
Model = Callable[[Any, Any, Any], Any]
"""f or h: of x (n,), theta (p,) and u; gives an array. It must let complex numbers pass."""

STEP = 1e-30
"""Of the complex step."""


@compiled
def propagate(p: Floats, f: Floats, states: int, process: Floats, dt: float, room: Floats) -> None:
    """Carry a covariance over a step: P = Phi P Phi' + Q dt, Phi = I + F dt + (F dt)^2 / 2.

    With F taken in the middle of the step this is right to second order.

    Args:
        p: covariance, shape (n, n); changed in place.
        f: dz'/dz, shape (n, n); rows from ``states`` on are 0.
        states: how many of z move by themselves; the others are numbers.
        process: diagonal of Q, densities [unit^2/s], shape (n,).
        dt: [s].
        room: shape (2, n, n), for what is worked out on the way.
    """
    n = len(process)
    phi, product = room[0], room[1]
    for i in range(states):
        for j in range(n):
            square = 0.0
            for k in range(states):
                square += f[i, k] * f[k, j]
            phi[i, j] = dt * f[i, j] + 0.5 * dt * dt * square
        phi[i, i] += 1.0
    for i in range(states):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += phi[i, k] * p[k, j]
            product[i, j] = total
    for i in range(states):
        for j in range(i, states):
            total = 0.0
            for k in range(n):
                total += product[i, k] * phi[j, k]
            p[i, j] = total
            p[j, i] = total
        for j in range(states, n):
            p[i, j] = product[i, j]
            p[j, i] = product[i, j]
    for i in range(n):
        p[i, i] += process[i] * dt


@compiled
def correct(
    z: Floats, p: Floats, slope: Floats, innovation: float, noise: float, room: Floats
) -> float:
    """Take in one measurement; z and P are changed in place.

    P = (I - K H) P (I - K H)' + K R K', Joseph's form, which stays a covariance for any rounding of K.

    Args:
        z: estimate, shape (n,).
        p: its covariance, shape (n, n).
        slope: H, derivative of the measurement to z, shape (n,).
        innovation: y - h.
        noise: R, the measurement's variance.
        room: shape (3, n), for what is worked out on the way.

    Returns:
        Variance S of the innovation.
    """
    n = len(z)
    cross, gain, left = room[0], room[1], room[2]
    total = noise
    for i in range(n):
        cross[i] = 0.0
        for j in range(n):
            cross[i] += p[i, j] * slope[j]
        total += cross[i] * slope[i]
    for i in range(n):
        gain[i] = cross[i] / total
        z[i] += gain[i] * innovation
    # (I - K H) P, and what is left there of P H'
    for i in range(n):
        left[i] = 0.0
        for j in range(n):
            p[i, j] -= gain[i] * cross[j]
            left[i] += p[i, j] * slope[j]
    for i in range(n):
        for j in range(i, n):
            p[i, j] += noise * gain[i] * gain[j] - left[i] * gain[j]
            p[j, i] = p[i, j]
    return total


class AugmentedFilter:
    """The filter of any model.

    Args:
        rate: f, dx/dt of shape (n,).
        reading: h, shape (m,).
        state: x at the start, shape (n,).
        numbers: theta at the start, shape (p,).
        covariance: P of both at the start, shape (n + p, n + p), or its diagonal.
        noise: variances of the measurements, the diagonal of R, shape (m,).
        process: densities of the noises w and w_theta, the diagonal of Q [unit^2/s], shape (n + p,) or
            one for all; 0 where model and numbers are believed altogether.

    Attributes:
        z: estimate of states, then numbers.
        p: its covariance.

    Raises:
        ValueError: shapes that do not go together, or a variance that is none.
    """

    def __init__(
        self,
        rate: Model,
        reading: Model,
        state: Any,
        numbers: Any,
        *,
        covariance: Any,
        noise: Any,
        process: Any = 0.0,
    ) -> None:
        self.rate, self.reading = rate, reading
        state = np.atleast_1d(np.asarray(state, dtype=np.float64))
        self.z = np.concatenate([state, np.atleast_1d(np.asarray(numbers, dtype=np.float64))])
        self._states, n = len(state), len(self.z)
        given = np.asarray(covariance, dtype=np.float64)
        self.p = np.array(np.diag(given) if given.ndim == 1 else given)
        if self.p.shape != (n, n):
            raise ValueError(f"covariance: shape ({n}, {n}) or ({n},) is needed, not {given.shape}")
        self.noise = np.atleast_1d(np.asarray(noise, dtype=np.float64))
        if not np.all(self.noise > 0.0):
            raise ValueError("noise: every variance must be positive")
        self.process = np.array(np.broadcast_to(np.asarray(process, dtype=np.float64), (n,)))
        if not (np.all(self.process >= 0.0) and np.all(np.diag(self.p) >= 0.0)):
            raise ValueError("covariance and process: no variance may be negative")
        self._room, self._row = np.empty((2, n, n)), np.empty((3, n))

    @property
    def state(self) -> Floats:
        """Estimate of x, shape (n,)."""
        return self.z[: self._states].copy()

    @property
    def numbers(self) -> Floats:
        """Estimate of theta, shape (p,)."""
        return self.z[self._states :].copy()

    @property
    def standard_errors(self) -> Floats:
        """Of states and numbers as the filter believes them, shape (n + p,)."""
        return np.sqrt(np.maximum(np.diag(self.p), 0.0))

    def predict(self, u: Any, dt: float, steps: int = 1) -> None:
        """Carry estimate and covariance on by RK4 steps, u being held.

        Args:
            u: input, handed to the model as it is.
            dt: whole time [s].
            steps: in how many equal steps.
        """
        h, theta = dt / steps, self.numbers
        for _ in range(steps):
            x = self.state
            k1 = np.asarray(self.rate(x, theta, u))
            k2 = np.asarray(self.rate(x + 0.5 * h * k1, theta, u))
            k3 = np.asarray(self.rate(x + 0.5 * h * k2, theta, u))
            k4 = np.asarray(self.rate(x + h * k3, theta, u))
            f = np.zeros_like(self.p)
            f[: self._states] = self._slopes(self.rate, x + 0.5 * h * k1, u)
            propagate(self.p, f, self._states, self.process, h, self._room)
            self.z[: self._states] = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def update(self, measured: Any, u: Any = None) -> Floats:
        """Take in the measurements of one instant.

        Args:
            measured: y, shape (m,); a NaN is one that is missing.
            u: input.

        Returns:
            Innovations over their standard deviations, in the order in which they are taken in, shape
            (m,); white and of variance 1 where the model is right.
        """
        expected = np.atleast_1d(np.asarray(self.reading(self.state, self.numbers, u)))
        errors = np.atleast_1d(np.asarray(measured, dtype=np.float64)) - expected
        slopes, before = self._slopes(self.reading, self.state, u), self.z.copy()
        found = np.full(len(errors), np.nan)
        for i in np.flatnonzero(np.isfinite(errors)):
            innovation = errors[i] - slopes[i] @ (self.z - before)
            total = correct(self.z, self.p, slopes[i], innovation, self.noise[i], self._row)
            found[i] = innovation / np.sqrt(total)
        return found

    def _slopes(self, model: Model, x: Floats, u: Any) -> Floats:
        """Jacobian of f or h to x and theta, shape (outputs, n + p)."""
        z, columns = np.concatenate([x, self.numbers]), []
        for i in range(len(z)):
            moved = z.astype(np.complex128)
            moved[i] += 1j * STEP
            slope = model(moved[: self._states], moved[self._states :], u)
            columns.append(np.atleast_1d(np.asarray(slope)).imag / STEP)
        return np.column_stack(columns)
