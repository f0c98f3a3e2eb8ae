"""User-defined observer, used by the package without changing its code.

    shaftline simulate --case jonswap --observer examples.own_observer:Slow --figure out/own.png

Its update is one function, compiled at its first call; ``estimate.x`` stores its states between samples.
In an installed package, an entry point in the group `shaftline.observers` registers it under a name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from shaftline.observers import Measurement, Observer
from shaftline.plant import Ship


@dataclass(frozen=True)
class Slow(Observer):
    """Advance velocity at a fixed advance ratio, from the shaft speed through a slow lag.

    Args:
        lag_s: time constant [s].
        advance_ratio: assumed advance ratio J of the propeller [-].
    """

    lag_s: float = 10.0
    advance_ratio: float = 0.9

    name = "slow"
    source = "an example"

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the observer record with the constants that the update needs."""
        record = super().discretise(ship, dt)
        record["gain"] = dt / self.lag_s
        record["parameter"] = self.advance_ratio * ship.propeller.diameter_m / 6.283185307179586
        return record

    @staticmethod
    def update(observer: Any, estimate: Any, m: Measurement) -> tuple[float, bool]:
        """Return the estimate V = J n D, where n is the shaft speed after the lag, and its validity."""
        if estimate.started == 0:
            estimate.x[0] = m.shaft_speed
        estimate.x[0] += observer.gain * (m.shaft_speed - estimate.x[0])
        return observer.parameter * estimate.x[0], True
