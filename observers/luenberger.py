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
    """Observer with its two poles placed.

    The propeller torque is modelled as a Wiener process; the advance velocity follows from it by the
    inverse torque curve. Poles and tunings: thesis section 3-1-3.
    """

    poles: tuple[float, float] = (-100.0, -10.0)  # [rad/s]

    name = "luenberger"
    source = "thesis section 3-1"
    tunings: ClassVar[Mapping[str, Luenberger]]

    def gain(self, ship: Ship) -> NDArray[Any]:
        """K with which A - K C has the poles, shape (2, 1)."""
        first, second = self.poles
        # s^2 + k1 s - k2 / I_R = (s - p1)(s - p2)
        return np.array([[-(first + second)], [-first * second * self.inertia(ship)]])


Luenberger.tunings = {
    "low": Luenberger((-10.0, -1.0)),
    "moderate": Luenberger((-100.0, -10.0)),
    "high": Luenberger((-1e5, -1e4)),
}
