"""An observer of one's own beside the package's, without a line of the package changed.

    shaftline simulate --case jonswap --observer examples.own_observer:Slow --figure out/own.png

Its update is one function of numbers, compiled when it is first used; what it may keep from sample to
sample stands in ``estimate.x``. In an installed package, an entry point in the group
`shaftline.observers` gives it a name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from shaftline.observers import Measurement, Observer
from shaftline.plant import Ship


@dataclass(frozen=True)
class Slow(Observer):
    """The inflow at the propeller's usual advance ratio, through a slow lag: no torque is asked for.

    Args:
        lag_s: time constant [s].
        advance_ratio: J at which the propeller is taken to work [-].
    """

    lag_s: float = 10.0
    advance_ratio: float = 0.9

    name = "slow"
    source = "an example"

    def discretise(self, ship: Ship, dt: float) -> Any:
        """What the update needs, worked out once."""
        record = super().discretise(ship, dt)
        record["gain"] = dt / self.lag_s
        record["number"] = self.advance_ratio * ship.propeller.diameter_m / 6.283185307179586
        return record

    @staticmethod
    def update(observer: Any, estimate: Any, m: Measurement) -> tuple[float, bool]:
        """V = J n D, n being the shaft's speed through the lag."""
        if estimate.started == 0:
            estimate.x[0] = m.shaft_speed
        estimate.x[0] += observer.gain * (m.shaft_speed - estimate.x[0])
        return observer.number * estimate.x[0], True
