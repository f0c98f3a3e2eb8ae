"""Power balance estimator: the measured torque equals the propeller torque (thesis section 3-3)."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.compiled import Record, compiled
from .base import Observer
from .records import Measurement
from .torque_curve import velocity_from_torque


@dataclass(frozen=True)
class PowerBalance(Observer):
    """Estimate the advance velocity with the measured torque as propeller torque, without dynamics.

    M_p = M_m (thesis eq. 3-9).
    """

    name = "power-balance"
    source = "thesis section 3-3"

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Invert the torque curve at the measured torque."""
        return velocity_from_torque(
            observer.ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
        )
