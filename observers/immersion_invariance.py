"""Immersion-and-invariance observer (thesis section 3-5, after Ortega et al. 2013)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.shaft import inertia_behind_gauge
from ..plant.ship import Ship
from .base import Observer
from .records import Measurement
from .torque_curve import (
    held_on_curve,
    model_torque,
    torque_slopes,
    turns,
    velocity_from_torque,
)

ASTERN_SHARE = 0.25
"""How far astern the estimate may go, as a share of the highest velocity ahead."""


@compiled
def followed(observer: Record, estimate: Record, m: Measurement, gain: float) -> tuple[float, bool]:
    """One sample at a gain gamma [m/rad]: advance velocity [m/s] and whether to trust it.

    The trapezoidal rule is implicit in v (two to four Newton steps), which keeps the fast loop of a high
    gain stable at the plant's time step: an explicit rule diverges from gamma of about 10 on. In four
    quadrants too M_p falls with v, whichever way the shaft turns; only in the ring vortex it rises, and
    the estimate leaves it for where it falls.
    """
    ship = observer.ship
    if estimate.started == 0:
        return velocity_from_torque(ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, 0.0)
    if not turns(ship, m.shaft_speed):
        return estimate.advance_velocity, False
    half = 0.5 * observer.dt * gain / inertia_behind_gauge(ship)
    v = estimate.advance_velocity
    before = model_torque(ship, v, estimate.shaft_speed, estimate.pitch_ratio)
    before -= estimate.shaft_torque
    known = v + gain * (m.shaft_speed - estimate.shaft_speed) + half * (before - m.shaft_torque)
    for _ in range(8):
        # v - known - half M_p(v) = 0; M_p falls with v, so the slope is above 1
        error = v - known - half * model_torque(ship, v, m.shaft_speed, m.pitch_ratio)
        _, by_velocity = torque_slopes(ship, v, m.shaft_speed, m.pitch_ratio)
        change = error / (1.0 - half * min(by_velocity, 0.0))
        v -= change
        if abs(change) < 1e-10:
            break
    # beyond where any torque curve is known there is nothing to follow
    if not math.isfinite(v):
        return estimate.advance_velocity, False
    return held_on_curve(ship, v, m.shaft_speed, ASTERN_SHARE)


@dataclass(frozen=True)
class ImmersionInvariance(Observer):
    """zeta' = gamma (M_p(omega, v) - M_m) / I_R, v = zeta + gamma omega (thesis eq. 3-13).

    Tunings: thesis section 3-5-3. The torque curve is used forwards, inside the loop.
    """

    gain: float = 4.0  # gamma [m/rad]

    name = "immersion-invariance"
    source = "thesis section 3-5"
    tunings: ClassVar[Mapping[str, ImmersionInvariance]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]; integrated by the trapezoidal rule."""
        self.inertia(ship)  # there must be one
        record = super().discretise(ship, dt)
        record["gain"] = self.gain
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """One sample."""
        return followed(observer, estimate, m, observer.gain)


ImmersionInvariance.tunings = {
    "low": ImmersionInvariance(1.0),
    "moderate": ImmersionInvariance(4.0),
    "high": ImmersionInvariance(20.0),
}
