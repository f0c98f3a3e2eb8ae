"""Luenberger observer of shaft speed and propeller torque (thesis section 3-1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..plant.ship import Ship
from .base import LUENBERGER
from .linear import linear_observer


@dataclass(frozen=True)
class Luenberger:
    """Observer with its two poles placed.

    The propeller torque is modelled as a Wiener process; the advance velocity follows from it by the
    inverse torque curve. Poles and tunings: thesis section 3-1-3.
    """

    poles: tuple[float, float] = (-100.0, -10.0)  # [rad/s]

    name: ClassVar[str] = "luenberger"
    kind: ClassVar[int] = LUENBERGER
    tunings: ClassVar[dict[str, Luenberger]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]; exact, so stable for any pole and step."""
        inertia = float(ship.record()["inertia_propeller_side"])
        first, second = self.poles
        # s^2 + k1 s - k2 / I_R = (s - p1)(s - p2)
        gain = np.array([-(first + second), -first * second * inertia])
        return linear_observer(self.kind, gain, ship, dt)


Luenberger.tunings = {
    "low": Luenberger((-10.0, -1.0)),
    "moderate": Luenberger((-100.0, -10.0)),
    "high": Luenberger((-1e5, -1e4)),
}
