"""Immersion-and-invariance observer (thesis section 3-5, after Ortega et al. 2013)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import (
    IMMERSION_INVARIANCE,
    Measurement,
    blank_observer,
    model_torque,
    torque_slopes,
    velocity_from_torque,
)


@dataclass(frozen=True)
class ImmersionInvariance:
    """zeta' = gamma (M_p(omega, v) - M_m) / I_R, v = zeta + gamma omega (thesis eq. 3-13).

    Tunings: thesis section 3-5-3. The torque curve is used forwards, inside the loop.
    """

    gain: float = 4.0  # gamma [m/rad]

    name: ClassVar[str] = "immersion-invariance"
    kind: ClassVar[int] = IMMERSION_INVARIANCE
    tunings: ClassVar[dict[str, ImmersionInvariance]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]; integrated by the trapezoidal rule."""
        record = blank_observer(self.kind, ship.record(), dt)
        record["gain"] = self.gain
        return record


ImmersionInvariance.tunings = {
    "low": ImmersionInvariance(1.0),
    "moderate": ImmersionInvariance(4.0),
    "high": ImmersionInvariance(20.0),
}


@compiled
def update_immersion_invariance(
    observer: Record, estimate: Record, m: Measurement
) -> tuple[float, bool]:
    """One sample.

    The trapezoidal rule is implicit in v (two to four Newton steps), which keeps the fast loop of a
    high gain stable at the plant's time step: an explicit rule diverges from gamma of about 10 on.
    """
    ship = observer.ship
    if estimate.started == 0:
        velocity, valid = velocity_from_torque(
            ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, 0.0
        )
        return velocity, valid
    if not m.shaft_speed > 1e-3:
        return estimate.advance_velocity, False
    half = 0.5 * observer.dt * observer.gain / ship.inertia_propeller_side
    before = (
        model_torque(ship, estimate.advance_velocity, estimate.shaft_speed, estimate.pitch_ratio)
        - estimate.shaft_torque
    )
    known = (
        estimate.advance_velocity
        + observer.gain * (m.shaft_speed - estimate.shaft_speed)
        + half * (before - m.shaft_torque)
    )
    v = estimate.advance_velocity
    for _ in range(8):
        # v - known - half M_p(v) = 0; M_p falls with v, so the slope is above 1
        error = v - known - half * model_torque(ship, v, m.shaft_speed, m.pitch_ratio)
        _, by_velocity = torque_slopes(ship, v, m.shaft_speed, m.pitch_ratio)
        change = error / (1.0 - half * min(by_velocity, 0.0))
        v -= change
        if abs(change) < 1e-10:
            break
    # beyond where any torque curve is known there is nothing to follow
    limit = 1.6 * ship.diameter * m.shaft_speed * (0.5 / math.pi)
    if not math.isfinite(v):
        return estimate.advance_velocity, False
    if v > limit:
        return limit, False
    if v < -0.25 * limit:
        return -0.25 * limit, False
    return v, v >= 0.0
