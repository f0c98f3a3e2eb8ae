"""Random-walk Kalman filter of the advance velocity (thesis section 3-6, after Selvam et al. 2009).

Two filters share the covariances and the Riccati recursion:

``printed``
    The filter of the thesis. The shaft equation is linearised about the *measured* speed at every
    sample. The measured deviation is then 0 by definition, and the change of the working point, omega',
    is neglected. With the printed covariances the filter makes M_m - M_p zero at every sample, which is
    a power balance; its column of Table 4-1 is close to that of the power balance.

``extended``, the default
    An extended Kalman filter whose first state is the shaft speed, compared with the measured one. It
    includes the acceleration, so it follows a fast inflow. Its covariances are those of real
    instruments, so measurement noise has little effect on the estimated inflow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Record, compiled
from ..plant.shaft import inertia_behind_meter, shaft_inertia
from ..plant.ship import Ship
from .base import Observer
from .records import Measurement
from .torque_curve import limit_to_curve, model_torque, torque_slopes, velocity_from_torque


@compiled
def correct_states(estimate: Record, innovation: float, measurement: float) -> tuple[float, float]:
    """Return the corrections of both states for an innovation of the first; update the covariance."""
    p = estimate.covariance
    total = p[0, 0] + measurement
    k0 = p[0, 0] / total
    k1 = p[1, 0] / total
    p[1, 1] = max(p[1, 1] - k1 * p[0, 1], 0.0)
    p[0, 0] = (1.0 - k0) * p[0, 0]
    p[0, 1] = p[1, 0] = (1.0 - k0) * p[0, 1]
    return k0 * innovation, k1 * innovation


@compiled
def propagate_covariance(estimate: Record, f00: float, f01: float, q0: float, q1: float) -> None:
    """Propagate the covariance: P+ = F P F' + Q, F = [[f00, f01], [0, 1]], Q = diag(q0, q1)."""
    p = estimate.covariance
    a00 = f00 * p[0, 0] + f01 * p[1, 0]
    a01 = f00 * p[0, 1] + f01 * p[1, 1]
    p[0, 0] = a00 * f00 + a01 * f01 + q0
    p[0, 1] = p[1, 0] = a01
    p[1, 1] += q1


@compiled
def _begin(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
    velocity, valid = velocity_from_torque(
        observer.ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, 0.0
    )
    estimate.x[0], estimate.x[1], p = m.shaft_speed, velocity, estimate.covariance
    p[0, 0], p[0, 1], p[1, 0], p[1, 1] = observer.measurement, 0.0, 0.0, 1.0
    return velocity, valid


@compiled
def _correct_by_speed(
    observer: Record, estimate: Record, m: Measurement, predicted: float, measured: float
) -> tuple[float, bool]:
    """Correct both states by the measured shaft speed; limit the velocity to the torque curve."""
    dw, dv = correct_states(estimate, measured - predicted, observer.measurement)
    estimate.x[0] = predicted + dw
    estimate.x[1], valid = limit_to_curve(observer.ship, estimate.x[1] + dv, m.shaft_speed)
    return estimate.x[1], valid


@dataclass(frozen=True)
class RandomWalkKalman(Observer):
    """Estimate the advance velocity by a Kalman filter that models it as a random walk.

    The default covariances are those of an encoder of 0.02 rad/s and a strain gauge of 2 kN m (1 % of
    the frigate's rated shaft torque), both rms at 20 Hz, and of an inflow that changes by about 0.5 m/s
    within a second, as in sea state 5.
    """

    velocity_density: float = 0.25  # of the random walk [(m/s)^2/s]
    speed_density: float = 0.0  # of the shaft speed, apart from torque noise [(rad/s)^2/s]
    torque_noise: float = 2e3  # of the torque meter, rms per sample [N m]
    speed_noise: float = 0.02  # of the encoder, rms per sample [rad/s]

    name = "random-walk-kalman"
    source = "thesis section 3-6"
    tunings: ClassVar[Mapping[str, RandomWalkKalman]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record for a sample time ``dt`` [s]."""
        record = super().discretise(ship, dt)
        torque = (dt * self.torque_noise / self.inertia(ship)) ** 2  # acts on omega'
        record["process"][:2] = (self.speed_density * dt + torque, self.velocity_density * dt)
        record["measurement"] = self.speed_noise**2
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Process one sample by the extended Kalman filter."""
        ship = observer.ship
        if estimate.started == 0:
            return _begin(observer, estimate, m)
        dt = observer.dt
        w, v = estimate.x[0], estimate.x[1]
        inertia = inertia_behind_meter(ship)
        # Predict by the explicit midpoint rule, with the mean of the two torques.
        torque = 0.5 * (estimate.shaft_torque + m.shaft_torque)
        pitch = 0.5 * (estimate.pitch_ratio + m.pitch_ratio)
        middle = w + 0.5 * dt * (torque - model_torque(ship, v, w, pitch)) / inertia
        by_speed, by_velocity = torque_slopes(ship, v, middle, pitch)
        predicted = w + dt * (torque - model_torque(ship, v, middle, pitch)) / inertia
        propagate_covariance(
            estimate,
            1.0 - dt * by_speed / inertia,
            -dt * by_velocity / inertia,
            observer.process[0],
            observer.process[1],
        )
        return _correct_by_speed(observer, estimate, m, predicted, m.shaft_speed)


@dataclass(frozen=True)
class PrintedRandomWalkKalman(RandomWalkKalman):
    """Estimate the advance velocity by the random-walk filter with the printed covariances.

    Q = diag(1e4, 1e11) and R = 1 (thesis section 3-6-3).
    """

    velocity_density: float = 1e11
    speed_density: float = 1e4
    torque_noise: float = 0.0
    speed_noise: float = 1.0

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """Process one sample by thesis eq. 3-24, with 0 in place of the misprinted 1."""
        ship = observer.ship
        if estimate.started == 0:
            start = _begin(observer, estimate, m)
            estimate.x[0] = 0.0  # deviation from the measured speed
            return start
        dt = observer.dt
        v = estimate.x[1]
        inertia = inertia_behind_meter(ship)
        # Eq. 3-17 gives the derivative by omega, eq. 3-15 all other terms.
        by_speed, by_velocity = torque_slopes(ship, v, m.shaft_speed, m.pitch_ratio)
        engine = ship.torque_per_speed * ship.gear_ratio**2 * ship.transmission_efficiency
        a11 = (engine - by_speed) / shaft_inertia(ship)
        a12 = -by_velocity / inertia
        drift = m.shaft_torque - model_torque(ship, v, m.shaft_speed, m.pitch_ratio)
        predicted = estimate.x[0] + dt * (a11 * estimate.x[0] + drift / inertia)
        propagate_covariance(
            estimate, 1.0 + dt * a11, dt * a12, observer.process[0], observer.process[1]
        )
        return _correct_by_speed(observer, estimate, m, predicted, 0.0)


RandomWalkKalman.tunings = {"extended": RandomWalkKalman(), "printed": PrintedRandomWalkKalman()}
