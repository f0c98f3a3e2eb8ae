"""Power balance estimator: the gauge's torque taken for the propeller's (thesis section 3-3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import POWER_BALANCE, Measurement, blank_observer, velocity_from_torque


@dataclass(frozen=True)
class PowerBalance:
    """M_p = M_m: no dynamics, nothing to tune (thesis eq. 3-9)."""

    name: ClassVar[str] = "power-balance"
    kind: ClassVar[int] = POWER_BALANCE
    tunings: ClassVar[dict[str, PowerBalance]] = {}

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]."""
        return blank_observer(self.kind, ship.record(), dt)


@compiled
def update_power_balance(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
    """One sample."""
    return velocity_from_torque(
        observer.ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
    )
