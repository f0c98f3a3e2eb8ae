"""Shaft Kalman filter: a linear observer with its gain from a Riccati equation (thesis section 3-2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ..plant.ship import Ship
from .linear import LinearObserver, shaft_model


@dataclass(frozen=True)
class ShaftKalman(LinearObserver):
    """Estimate propeller torque and advance velocity by a steady-state Kalman filter.

    Example:
        >>> from shaftline.plant import load_ship
        >>> ShaftKalman().poles(load_ship("frigate")).round(2)[0]
        np.complex128(-10.53+10.41j)
    """

    process: tuple[float, float] = (5.0, 1e13)  # densities of omega [(rad/s)^2/s], M_p [(N m)^2/s]
    measurement: float = 1.0  # density of omega [(rad/s)^2 s]

    name = "shaft-kalman"
    source = "thesis section 3-2"

    def gain(self, ship: Ship) -> NDArray[Any]:
        """Return the Kalman gain K, shape (2, 1)."""
        a, _, c = shaft_model(self.inertia(ship))
        # The torque in units of its noise keeps the Riccati equation well scaled.
        scale = np.diag([1.0, np.sqrt(self.process[1])])
        inverse = np.linalg.inv(scale)
        noise = inverse @ np.diag(self.process) @ inverse.T
        p = scipy.linalg.solve_continuous_are(
            (inverse @ a @ scale).T, (c @ scale).T, noise, [[self.measurement]]
        )
        return np.asarray(scale @ p @ (c @ scale).T / self.measurement)

    def poles(self, ship: Ship) -> NDArray[Any]:
        """Return the eigenvalues of A - K C [rad/s]."""
        a, _, c = shaft_model(self.inertia(ship))
        return np.linalg.eigvals(a - self.gain(ship) @ c)
