"""Observers that use the shaft acceleration, measured or derived (thesis section 3-4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled
from ..plant.shaft import inertia_behind_meter
from ..plant.ship import Ship
from .base import Observer
from .linear import first_order_hold
from .records import Measurement
from .torque_curve import velocity_from_torque


@compiled
def _velocity(
    observer: Record, estimate: Record, m: Measurement, acceleration: float
) -> tuple[float, bool]:
    """Return the advance velocity [m/s] at M_p = M_m - I_R omega', and whether it is valid."""
    torque = m.shaft_torque - inertia_behind_meter(observer.ship) * acceleration
    return velocity_from_torque(
        observer.ship, torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
    )


@dataclass(frozen=True)
class ShaftAcceleration(Observer):
    """Estimate the advance velocity from the shaft torque and a measured shaft acceleration.

    M_p = M_m - I_R omega' (thesis eq. 3-10).
    """

    name = "shaft-acceleration"
    source = "thesis section 3-4"

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Return the estimate; without a measured acceleration it is not valid."""
        if not math.isfinite(m.shaft_acceleration):
            return estimate.advance_velocity, False
        return _velocity(observer, estimate, m, m.shaft_acceleration)


@dataclass(frozen=True)
class ShaftAccelerationDerived(Observer):
    """Estimate the advance velocity from the shaft torque and the derivative of the shaft speed.

    M_p = M_m - I_R omega', with omega' from the filter s / (T s + 1) (thesis eq. 3-11).
    """

    time_constant_s: float = 0.1

    name = "shaft-acceleration-derived"
    source = "thesis section 3-4"

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record; the filter is discretised exactly."""
        record = super().discretise(ship, dt)
        rate = 1.0 / self.time_constant_s
        held = first_order_hold(np.array([[-rate]]), np.array([[rate]]), dt)
        for name, value in zip(("transition", "before", "now"), held, strict=True):
            record[name][0, 0] = value[0, 0]
        record["gain"] = rate
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Update x, the omega of the low-pass filter; (omega - x) / T is the derivative."""
        if estimate.started == 0:
            estimate.x[0] = m.shaft_speed
        else:
            f, before, now = observer.transition, observer.before, observer.now
            known = f[0, 0] * estimate.x[0] + before[0, 0] * estimate.shaft_speed
            estimate.x[0] = known + now[0, 0] * m.shaft_speed
        return _velocity(observer, estimate, m, observer.gain * (m.shaft_speed - estimate.x[0]))
