"""Immersion-and-invariance observers with a constant and with an adaptive gain.

The observer with a constant gain is that of thesis section 3-5, after Ortega et al. 2013.

The thesis (sections 4-3 and 6-2) finds that each noise level has a best gain, and leaves an automatic
choice of the gain to future work. The adaptive observers estimate the noise from the innovation
e = (v+ - v) / gamma, the change of the shaft speed that the model does not explain, and the sea from the
fluctuation of the estimate. If the noise of the measured shaft speed is white with the variance R, then
E (e+ - e)^2 = 6 R from sample to sample. If the inflow is a random walk with the density q, then
E (v - mean)^2 = q / 2 per second, with the mean of the last second. There are two rules for the gain:

``optimal``, which is registered
    The error is x' = -gamma a x - v_a' + gamma n', with a = -(dM_p/dv_a) / I_R and the noise n of the
    shaft speed. Its variance q / (2 gamma a) + gamma^2 R is least at gamma = (q / (4 a R))^(1/3).

``covariance``, for comparison
    gamma = gamma_0 sqrt(P_vv), with P from the Riccati recursion of the random-walk filter with q and R.
    For small steps P_vv = sqrt(2) q^(3/4) (R dt)^(1/4) / sqrt(a): the gain rises with the sea, but also
    slightly with the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.shaft import inertia_behind_meter
from ..plant.ship import Ship
from . import torque_curve
from .base import Observer
from .random_walk_kalman import correct_states, propagate_covariance
from .records import Measurement

ASTERN_SHARE = 0.25  # largest estimate astern, as a share of the highest velocity ahead


@compiled
def update_at_gain(
    observer: Record, estimate: Record, m: Measurement, gain: float
) -> tuple[float, bool]:
    """Process one sample at a gain gamma [m/rad]; return the advance velocity [m/s] and its validity.

    The trapezoidal rule is implicit in v (two to four Newton steps), so that a high gain is stable at
    the time step of the plant; an explicit rule diverges from gamma of about 10 on. In four quadrants
    M_p falls with v in both directions of rotation. It rises in the ring vortex only, and there the
    estimate moves to the range in which M_p falls.
    """
    ship = observer.ship
    if estimate.started == 0:
        return torque_curve.velocity_from_torque(
            ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, 0.0
        )
    if not torque_curve.shaft_turns(ship, m.shaft_speed):
        return estimate.advance_velocity, False
    half = 0.5 * observer.dt * gain / inertia_behind_meter(ship)
    v = estimate.advance_velocity
    before = torque_curve.model_torque(ship, v, estimate.shaft_speed, estimate.pitch_ratio)
    before -= estimate.shaft_torque
    known = v + gain * (m.shaft_speed - estimate.shaft_speed) + half * (before - m.shaft_torque)
    for _ in range(8):
        # Solve v - known - half M_p(v) = 0. M_p falls with v, so the slope is above 1.
        error = v - known - half * torque_curve.model_torque(ship, v, m.shaft_speed, m.pitch_ratio)
        _, by_velocity = torque_curve.torque_slopes(ship, v, m.shaft_speed, m.pitch_ratio)
        change = error / (1.0 - half * min(by_velocity, 0.0))
        v -= change
        if abs(change) < 1e-10:
            break
    # The iteration may leave the range of the torque curve; then the last estimate is kept.
    if not math.isfinite(v):
        return estimate.advance_velocity, False
    return torque_curve.limit_to_curve(ship, v, m.shaft_speed, ASTERN_SHARE)


@dataclass(frozen=True)
class ImmersionInvariance(Observer):
    """Estimate the advance velocity by immersion and invariance with a constant gain.

    v = zeta + gamma omega, zeta' = gamma (M_p(omega, v) - M_m) / I_R (thesis eq. 3-13). Tunings: thesis
    section 3-5-3. The torque curve is not inverted.
    """

    gain: float = 4.0  # gamma [m/rad]

    name = "immersion-invariance"
    source = "thesis section 3-5"
    tunings: ClassVar[Mapping[str, ImmersionInvariance]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record for a sample time ``dt`` [s]."""
        self.inertia(ship)  # raises an error if it is 0
        record = super().discretise(ship, dt)
        record["gain"] = self.gain
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Process one sample at the constant gain."""
        return update_at_gain(observer, estimate, m, observer.gain)


ImmersionInvariance.tunings = {
    "low": ImmersionInvariance(1.0),
    "moderate": ImmersionInvariance(4.0),
    "high": ImmersionInvariance(20.0),
}


HORIZON_S = 1.0  # time over which the inflow is modelled as a random walk
NOISE_MEMORY_S, SEA_MEMORY_S = 5.0, 30.0  # time constants of the means of noise and sea
LEAST_NOISE = 1e-8  # variance of the shaft speed of a very good encoder [(rad/s)^2]
_NOISE, _DENSITY, _MEAN, _INNOVATION = range(4)


@compiled
def _slopes(ship: Record, estimate: Record) -> tuple[float, float]:
    """Return the derivatives of the shaft acceleration by omega [1/s] and by v_a [rad/(s m)]."""
    by_speed, by_velocity = torque_curve.torque_slopes(
        ship, estimate.advance_velocity, estimate.shaft_speed, estimate.pitch_ratio
    )
    inertia = inertia_behind_meter(ship)
    return -by_speed / inertia, -by_velocity / inertia


@compiled
def _update_adaptively(
    observer: Record, estimate: Record, m: Measurement, wanted: float
) -> tuple[float, bool]:
    """Process one sample at a gain within the limits, and update the estimates of noise and sea."""
    x, dt = estimate.x, observer.dt
    if estimate.started == 0:
        velocity, valid = update_at_gain(observer, estimate, m, observer.lowest)
        x[_NOISE], x[_DENSITY] = observer.measurement, observer.process[1]
        x[_MEAN], x[_INNOVATION] = velocity, 0.0
        return velocity, valid
    gain = observer.lowest
    if wanted > gain:  # false if it is NaN
        gain = min(wanted, observer.highest)
    velocity, valid = update_at_gain(observer, estimate, m, gain)
    innovation = (velocity - estimate.advance_velocity) / gain
    if valid and estimate.valid != 0:  # no information at an end of the curve
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
    """Estimate the advance velocity by immersion and invariance with the gain of least error variance.

    Noise and sea start from the values of the random-walk filter and adapt within half a minute.
    """

    lowest: float = 0.1  # gamma [m/rad]
    highest: float = 20.0
    velocity_density: float = 0.25  # initial, of the random walk [(m/s)^2/s]
    speed_noise: float = 0.02  # initial, of the encoder, rms per sample [rad/s]

    name = "immersion-invariance-adaptive"
    source = "thesis section 6-2"

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record for a sample time ``dt`` [s]."""
        self.inertia(ship)  # raises an error if it is 0
        record = super().discretise(ship, dt)
        record["lowest"], record["highest"] = self.lowest, self.highest
        record["process"][1] = self.velocity_density
        record["measurement"] = self.speed_noise**2
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Process one sample with the gain of the rule ``optimal``."""
        _, by_velocity = _slopes(observer.ship, estimate)
        ratio = estimate.x[_DENSITY] / (4.0 * by_velocity * estimate.x[_NOISE])
        return _update_adaptively(observer, estimate, m, ratio ** (1.0 / 3.0))


@dataclass(frozen=True)
class CovarianceImmersionInvariance(AdaptiveImmersionInvariance):
    """Estimate the advance velocity with the gain of the rule ``covariance``, for comparison only."""

    scale: float = 8.0  # gamma_0 [s/rad]; the best of 1, 2, 4, 8 and 16 in the sea of the thesis

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record for a sample time ``dt`` [s]."""
        record = super().discretise(ship, dt)
        record["gain"] = self.scale
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Process one sample with the gain of the rule ``covariance``."""
        p, x, dt = estimate.covariance, estimate.x, observer.dt
        if estimate.started == 0:
            p[0, 0], p[0, 1], p[1, 0], p[1, 1] = observer.measurement, 0.0, 0.0, 1.0
            return _update_adaptively(observer, estimate, m, 0.0)
        by_speed, by_velocity = _slopes(observer.ship, estimate)
        velocity, valid = _update_adaptively(
            observer, estimate, m, observer.gain * math.sqrt(p[1, 1])
        )
        propagate_covariance(
            estimate, 1.0 + dt * by_speed, dt * by_velocity, observer.process[0], x[_DENSITY] * dt
        )
        correct_states(estimate, 0.0, x[_NOISE])
        return velocity, valid
