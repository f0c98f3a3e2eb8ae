"""Immersion-and-invariance observer (thesis section 3-5, after Ortega et al. 2013).

Immersion and invariance with a gain that goes by the noise and the sea at hand.

The thesis (sections 4-3 and 6-2) finds that each noise has a best gain of its own, and leaves it to
future work to set it by itself. Here the innovation e = (v+ - v) / gamma, what the shaft speed did
besides what the model makes it do, tells the noise, and the estimate tells the sea. From sample to
sample e changes by E (e+ - e)^2 = 6 R where the readings' noise R is white; the estimate strays from
its mean of the last second by E (v - mean)^2 = q / 2 per second where the inflow is a random walk of
density q. Two rules:

``optimal``, which is registered
    The error is x' = -gamma a x - v_a' + gamma n', with a = -(dM_p/dv_a) / I_R and the noise n of the
    shaft speed. Its variance q / (2 gamma a) + gamma^2 R is least at gamma = (q / (4 a R))^(1/3).

``covariance``, to be compared with
    gamma = gamma_0 sqrt(P_vv), with P from the Riccati recursion of the random-walk filter under q
    and R. For small steps P_vv = sqrt(2) q^(3/4) (R dt)^(1/4) / sqrt(a): the gain rises with the sea,
    but also, a little, with the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.shaft import inertia_behind_gauge
from ..plant.ship import Ship
from .base import Observer
from .random_walk_kalman import corrected, propagated
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


HORIZON_S = 1.0
"""Time over which the inflow is taken for a random walk."""
NOISE_MEMORY_S, SEA_MEMORY_S = 5.0, 30.0
"""Over which noise and sea are averaged."""
LEAST_NOISE = 1e-8
"""Variance of the shaft speed's reading that no encoder undercuts [(rad/s)^2]."""

_NOISE, _DENSITY, _MEAN, _INNOVATION = range(4)


@compiled
def _slopes(ship: Record, estimate: Record) -> tuple[float, float]:
    """Of the shaft's acceleration, by omega [1/s] and by v_a [rad/(s m)], where they last stood."""
    by_speed, by_velocity = torque_slopes(
        ship, estimate.advance_velocity, estimate.shaft_speed, estimate.pitch_ratio
    )
    inertia = inertia_behind_gauge(ship)
    return -by_speed / inertia, -by_velocity / inertia


@compiled
def _adapted(
    observer: Record, estimate: Record, m: Measurement, wanted: float
) -> tuple[float, bool]:
    """One sample at the gain that is wanted, within limits; learns noise and sea from it."""
    x, dt = estimate.x, observer.dt
    if estimate.started == 0:
        velocity, valid = followed(observer, estimate, m, observer.lowest)
        x[_NOISE], x[_DENSITY] = observer.measurement, observer.process[1]
        x[_MEAN], x[_INNOVATION] = velocity, 0.0
        return velocity, valid
    gain = observer.lowest
    if wanted > gain:  # and a number
        gain = min(wanted, observer.highest)
    velocity, valid = followed(observer, estimate, m, gain)
    innovation = (velocity - estimate.advance_velocity) / gain
    if valid and estimate.valid != 0:  # held at an end of the curve it says nothing
        change = innovation - x[_INNOVATION]
        away = velocity - x[_MEAN]
        x[_NOISE] += min(dt / NOISE_MEMORY_S, 1.0) * (change * change / 6.0 - x[_NOISE])
        x[_NOISE] = max(x[_NOISE], LEAST_NOISE)
        density = 2.0 * away * away / HORIZON_S
        x[_DENSITY] += min(dt / SEA_MEMORY_S, 1.0) * (density - x[_DENSITY])
        x[_MEAN] += min(dt / HORIZON_S, 1.0) * away
    x[_INNOVATION] = innovation
    return velocity, valid


@dataclass(frozen=True)
class AdaptiveImmersionInvariance(Observer):
    """Immersion and invariance whose gain has the least error for the noise and the sea at hand.

    It starts from those that the random-walk filter is made for, and forgets them within half a minute.
    """

    lowest: float = 0.1  # gamma [m/rad]
    highest: float = 20.0
    velocity_density: float = 0.25  # of the random walk at first [(m/s)^2/s]
    speed_noise: float = 0.02  # of the encoder at first, rms per sample [rad/s]

    name = "immersion-invariance-adaptive"
    source = "thesis section 6-2"

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]."""
        self.inertia(ship)  # there must be one
        record = super().discretise(ship, dt)
        record["lowest"], record["highest"] = self.lowest, self.highest
        record["process"][1] = self.velocity_density
        record["measurement"] = self.speed_noise**2
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """One sample by the rule ``optimal``."""
        _, by_velocity = _slopes(observer.ship, estimate)
        ratio = estimate.x[_DENSITY] / (4.0 * by_velocity * estimate.x[_NOISE])
        return _adapted(observer, estimate, m, ratio ** (1.0 / 3.0))


@dataclass(frozen=True)
class CovarianceImmersionInvariance(AdaptiveImmersionInvariance):
    """The same by the rule ``covariance``, which one would write first and which does not do."""

    scale: float = 8.0  # gamma_0 [s/rad]; the best of 1, 2, 4, 8 and 16 in the thesis's sea

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s]."""
        record = super().discretise(ship, dt)
        record["gain"] = self.scale
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """One sample."""
        p, x, dt = estimate.covariance, estimate.x, observer.dt
        if estimate.started == 0:
            p[0, 0], p[0, 1], p[1, 0], p[1, 1] = observer.measurement, 0.0, 0.0, 1.0
            return _adapted(observer, estimate, m, 0.0)
        by_speed, by_velocity = _slopes(observer.ship, estimate)
        velocity, valid = _adapted(observer, estimate, m, observer.gain * math.sqrt(p[1, 1]))
        propagated(
            estimate, 1.0 + dt * by_speed, dt * by_velocity, observer.process[0], x[_DENSITY] * dt
        )
        corrected(estimate, 0.0, x[_NOISE])
        return velocity, valid
