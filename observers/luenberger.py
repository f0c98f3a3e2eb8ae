"""Luenberger observer of shaft speed and propeller torque (thesis section 3-1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..plant.ship import Ship
from .linear import LinearObserver


@dataclass(frozen=True)
class Luenberger(LinearObserver):
    """Estimate propeller torque and advance velocity by an observer with two given poles.

    The propeller torque is modelled as a Wiener process. The inverse torque curve gives the advance
    velocity. Poles and tunings: thesis section 3-1-3.

    Example:
        >>> from shaftline.plant import load_ship
        >>> k1, k2 = Luenberger((-100.0, -10.0)).gain(load_ship("frigate")).ravel()
        >>> float(k1)
        110.0
    """

    poles: tuple[float, float] = (-100.0, -10.0)  # [rad/s]

    name = "luenberger"
    source = "thesis section 3-1"
    tunings: ClassVar[Mapping[str, Luenberger]]

    def gain(self, ship: Ship) -> NDArray[Any]:
        """Return the gain K for which A - K C has the poles, shape (2, 1)."""
        first, second = self.poles
        # s^2 + k1 s - k2 / I_R = (s - p1)(s - p2)
        return np.array([[-(first + second)], [-first * second * self.inertia(ship)]])


Luenberger.tunings = {
    "low": Luenberger((-10.0, -1.0)),
    "moderate": Luenberger((-100.0, -10.0)),
    "high": Luenberger((-1e5, -1e4)),
}
