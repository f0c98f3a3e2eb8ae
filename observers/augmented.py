"""State-augmented extended Kalman filter of an arbitrary model.

The unknown parameters theta of a model are constant states, estimated together with the states x:

    dx/dt = f(x, theta, u) + w,   dtheta/dt = w_theta,   y = h(x, theta, u) + v

The filter is continuous-discrete. Between measurements x follows the model, and the covariance
P = E[dz dz'] of z = (x, theta) follows dP/dt = F P + P F' + Q. At a measurement z += K (y - h),
K = P H' / S, S = H P H' + R. Derivatives are exact, by complex steps (thesis on identification of ship
manoeuvring by extended Kalman filter, chapter 2, Table 2.1; Gelb 1974, Table 6.1-1).

The measurements of one instant are processed one after the other. If their noises are independent, the
result is that of processing them together, and no matrix has to be inverted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.compiled import compiled
from .records import Floats

Model = Callable[[Any, Any, Any], Any]
"""Function f or h of x (n,), theta (p,) and u that returns an array; it must accept complex numbers."""

STEP = 1e-30  # size of the complex step


@compiled
def propagate(p: Floats, f: Floats, states: int, process: Floats, dt: float, work: Floats) -> None:
    """Propagate a covariance over a step in place: P = Phi P Phi' + Q dt, Phi = I + F dt + (F dt)^2 / 2.

    With F at the middle of the step the error is of third order in dt [s]. F = dz'/dz and P have the
    shape (n, n); the rows of F from ``states`` on are 0, because they belong to parameters. ``process``
    is the diagonal of Q [unit^2/s], shape (n,); ``work`` is working memory, shape (2, n, n).
    """
    n = len(process)
    phi, product = work[0], work[1]
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
    z: Floats, p: Floats, slope: Floats, innovation: float, noise: float, work: Floats
) -> float:
    """Correct an estimate by one measurement in place, and return the variance S of the innovation.

    P = (I - K H) P (I - K H)' + K R K', Joseph's form, which remains a covariance for any rounding of K.
    z and H (``slope``) have the shape (n,), P (n, n); ``innovation`` is y - h, ``noise`` the variance R
    of the measurement; ``work`` is working memory, shape (3, n).
    """
    n = len(z)
    cross, gain, left = work[0], work[1], work[2]
    total = noise
    for i in range(n):
        cross[i] = 0.0
        for j in range(n):
            cross[i] += p[i, j] * slope[j]
        total += cross[i] * slope[i]
    for i in range(n):
        gain[i] = cross[i] / total
        z[i] += gain[i] * innovation
    # P becomes (I - K H) P, and left becomes (I - K H) P H'.
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
    """Estimate states and parameters of a model by an augmented extended Kalman filter.

    Args:
        rate: f, dx/dt of shape (n,).
        measurement: h, shape (m,).
        state: initial x, shape (n,).
        parameters: initial theta, shape (p,).
        covariance: initial P of both, shape (n + p, n + p), or its diagonal.
        noise: variances of the measurements, the diagonal of R, shape (m,).
        process: densities of w and w_theta, the diagonal of Q [unit^2/s], shape (n + p,) or one value.

    Attributes:
        z: estimate of the states, then of the parameters.
        p: covariance of the estimate.

    Raises:
        ValueError: the shapes do not agree, or a variance is negative, or one of R is not positive.

    Example:
        Estimate the decay rate of dx/dt = -theta x from exact measurements of x:

        >>> import math
        >>> decay = AugmentedFilter(lambda x, theta, u: -theta * x, lambda x, theta, u: x,
        ...                         [1.0], [0.2], covariance=[0.0, 1.0], noise=1e-6)
        >>> for k in range(1, 21):
        ...     decay.predict(None, dt=0.1)
        ...     _ = decay.update(math.exp(-0.5 * 0.1 * k))
        >>> round(float(decay.parameters[0]), 2)
        0.5
    """

    def __init__(
        self,
        rate: Model,
        measurement: Model,
        state: Any,
        parameters: Any,
        *,
        covariance: Any,
        noise: Any,
        process: Any = 0.0,
    ) -> None:
        self.rate, self.measurement = rate, measurement
        state = np.atleast_1d(np.asarray(state, dtype=np.float64))
        self.z = np.concatenate([state, np.atleast_1d(np.asarray(parameters, dtype=np.float64))])
        self._states, n = len(state), len(self.z)
        given = np.asarray(covariance, dtype=np.float64)
        self.p = np.array(np.diag(given) if given.ndim == 1 else given)
        if self.p.shape != (n, n):
            raise ValueError(f"covariance: shape must be ({n}, {n}) or ({n},), not {given.shape}")
        self.noise = np.atleast_1d(np.asarray(noise, dtype=np.float64))
        if not np.all(self.noise > 0.0):
            raise ValueError("noise: every variance must be positive")
        self.process = np.array(np.broadcast_to(np.asarray(process, dtype=np.float64), (n,)))
        if not (np.all(self.process >= 0.0) and np.all(np.diag(self.p) >= 0.0)):
            raise ValueError("covariance and process: no variance may be negative")
        self._work, self._row = np.empty((2, n, n)), np.empty((3, n))

    @property
    def state(self) -> Floats:
        """Return the estimate of x, shape (n,)."""
        return self.z[: self._states].copy()

    @property
    def parameters(self) -> Floats:
        """Return the estimate of theta, shape (p,)."""
        return self.z[self._states :].copy()

    @property
    def standard_errors(self) -> Floats:
        """Return the standard errors of states and parameters, shape (n + p,)."""
        return np.sqrt(np.maximum(np.diag(self.p), 0.0))

    def predict(self, u: Any, dt: float, steps: int = 1) -> None:
        """Propagate estimate and covariance by RK4 steps at a constant input.

        Args:
            u: input, passed to the model.
            dt: duration of all steps together [s].
            steps: number of equal steps.
        """
        h, theta = dt / steps, self.parameters
        for _ in range(steps):
            x = self.state
            k1 = np.asarray(self.rate(x, theta, u))
            k2 = np.asarray(self.rate(x + 0.5 * h * k1, theta, u))
            k3 = np.asarray(self.rate(x + 0.5 * h * k2, theta, u))
            k4 = np.asarray(self.rate(x + h * k3, theta, u))
            f = np.zeros_like(self.p)
            f[: self._states] = self._slopes(self.rate, x + 0.5 * h * k1, u)
            propagate(self.p, f, self._states, self.process, h, self._work)
            self.z[: self._states] = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def update(self, measured: Any, u: Any = None) -> Floats:
        """Correct the estimate by the measurements of one instant.

        Args:
            measured: y, shape (m,); NaN for a missing measurement.
            u: input, passed to the model.

        Returns:
            Innovations over their standard deviations, shape (m,), each given the measurements before
            it; white with variance 1 if the model is correct.
        """
        expected = np.atleast_1d(np.asarray(self.measurement(self.state, self.parameters, u)))
        errors = np.atleast_1d(np.asarray(measured, dtype=np.float64)) - expected
        slopes, before = self._slopes(self.measurement, self.state, u), self.z.copy()
        found = np.full(len(errors), np.nan)
        for i in np.flatnonzero(np.isfinite(errors)):
            innovation = errors[i] - slopes[i] @ (self.z - before)
            total = correct(self.z, self.p, slopes[i], innovation, self.noise[i], self._row)
            found[i] = innovation / np.sqrt(total)
        return found

    def _slopes(self, model: Model, x: Floats, u: Any) -> Floats:
        """Return the Jacobian of f or h with respect to x and theta, shape (outputs, n + p)."""
        z, columns = np.concatenate([x, self.parameters]), []
        for i in range(len(z)):
            shifted = z.astype(np.complex128)
            shifted[i] += 1j * STEP
            slope = model(shifted[: self._states], shifted[self._states :], u)
            columns.append(np.atleast_1d(np.asarray(slope)).imag / STEP)
        return np.column_stack(columns)
