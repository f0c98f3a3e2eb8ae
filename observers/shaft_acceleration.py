"""Measured shaft acceleration observer, with an accelerometer or a derivative (thesis section 3-4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import (
    SHAFT_ACCELERATION,
    SHAFT_ACCELERATION_DERIVED,
    Measurement,
    blank_observer,
    velocity_from_torque,
)
from .linear import first_order_hold


@dataclass(frozen=True)
class ShaftAcceleration:
    """M_p = M_m - I_R omega' with a measured omega' (thesis eq. 3-10)."""

    name: ClassVar[str] = "shaft-acceleration"
    kind: ClassVar[int] = SHAFT_ACCELERATION
    tunings: ClassVar[dict[str, ShaftAcceleration]] = {}

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]."""
        return blank_observer(self.kind, ship.record(), dt)


@dataclass(frozen=True)
class ShaftAccelerationDerived:
    """The same with omega' from the filtered derivative s / (T s + 1) (thesis eq. 3-11)."""

    time_constant_s: float = 0.1

    name: ClassVar[str] = "shaft-acceleration-derived"
    kind: ClassVar[int] = SHAFT_ACCELERATION_DERIVED
    tunings: ClassVar[dict[str, ShaftAccelerationDerived]] = {}

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]: the filter is discretised exactly."""
        record = blank_observer(self.kind, ship.record(), dt)
        rate = 1.0 / self.time_constant_s
        f, before, now = first_order_hold(np.array([[-rate]]), np.array([[rate]]), dt)
        record["transition"][0, 0] = f[0, 0]
        record["before"][0, 0] = before[0, 0]
        record["now"][0, 0] = now[0, 0]
        record["gain"] = rate
        return record


@compiled
def update_shaft_acceleration(
    observer: Record, estimate: Record, m: Measurement
) -> tuple[float, bool]:
    """One sample; without an acceleration there is no valid estimate."""
    if not math.isfinite(m.shaft_acceleration):
        return estimate.advance_velocity, False
    torque = m.shaft_torque - observer.ship.inertia_propeller_side * m.shaft_acceleration
    return velocity_from_torque(
        observer.ship, torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
    )


@compiled
def update_shaft_acceleration_derived(
    observer: Record, estimate: Record, m: Measurement
) -> tuple[float, bool]:
    """One sample: x follows omega with the filter's lag, (omega - x) / T is the derivative."""
    if estimate.started == 0:
        estimate.x[0] = m.shaft_speed
    else:
        estimate.x[0] = (
            observer.transition[0, 0] * estimate.x[0]
            + observer.before[0, 0] * estimate.shaft_speed
            + observer.now[0, 0] * m.shaft_speed
        )
    acceleration = observer.gain * (m.shaft_speed - estimate.x[0])
    torque = m.shaft_torque - observer.ship.inertia_propeller_side * acceleration
    return velocity_from_torque(
        observer.ship, torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
    )
