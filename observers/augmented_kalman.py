"""Augmented Kalman filter: estimates the advance velocity and one ship parameter.

States: shaft speed omega, disturbance u of the inflow (waves), speed v of the ship through the water,
and the ship parameter theta. The measured shaft torque drives the shaft, so no engine model is needed;
the ship speed is not measured:

    I_R domega/dt = M_m - M_load(omega, v_a, theta),   v_a = (1 - w) v + u,   du/dt = -u / T + noise
    m dv/dt = k_p (1 - t) T(omega, v_a) - R(v, theta),   dtheta/dt = noise

The torque determines v_a at every sample. The slow part of v_a is the speed of the ship, and a speed
below the one expected at this thrust is resistance. Fouling is therefore identifiable within some
thousand seconds. Friction behind the torque meter is identifiable if the hull is known. Only one of the
two can be estimated at a time, and an error of the torque meter or of the torque curve biases it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Real, Record, compiled
from ..plant.hull import resistance, wake_inflow
from ..plant.propeller import propeller_load
from ..plant.shaft import inertia_behind_meter, load_torque
from ..plant.ship import Ship
from .augmented import STEP
from .base import Observer, ObserverError
from .records import TRACKED, Measurement
from .torque_curve import limit_to_curve, velocity_from_torque

_FOULING, _COULOMB, _VISCOUS = range(3)
_CODES = {
    "hull.fouling_fraction": _FOULING,
    "transmission.coulomb_friction_propeller_side_N_m": _COULOMB,
    "transmission.viscous_friction_propeller_side_N_m_s_rad": _VISCOUS,
}

_SHAFT, _INFLOW, _SHIP, _PARAMETER = 0, 1, 2, TRACKED
GATE = 25.0  # largest squared innovation, in variances, that waves and measurement noise explain


@compiled
def _propeller(
    observer: Record, shaft_speed: Real, advance: Real, parameter: float, pitch: float
) -> tuple[Real, Real]:
    """Return the load torque behind the torque meter [N m] and the net thrust of all propellers [N]."""
    ship = observer.ship
    screw = propeller_load(ship, advance, shaft_speed, pitch, ship.depth, 0.0)
    load = load_torque(ship, screw.torque / ship.relative_rotative_efficiency, shaft_speed)
    if observer.tracks != _FOULING:
        load = load + (parameter - observer.parameter) * _friction(observer, shaft_speed)
    return load, ship.propellers * (1.0 - ship.thrust_deduction) * screw.thrust


@compiled
def _friction(observer: Record, shaft_speed: Real) -> Real:
    """Return the friction torque [N m] per unit of the estimated friction parameter."""
    if observer.tracks == _COULOMB:
        return math.copysign(1.0, shaft_speed.real)
    return shaft_speed


@compiled
def _resistance(observer: Record, ship_speed: Real, parameter: float) -> Real:
    """Return the resistance [N] at a speed through the water [m/s]."""
    clean = resistance(observer.ship, ship_speed, 1.0)
    if observer.tracks != _FOULING:
        return clean
    return clean * (1.0 + parameter) / (1.0 + observer.parameter)


Row = tuple[float, float, float, float]  # row of a matrix over the four states


@compiled
def _propagate(p: Any, shaft: Row, ship: Row, fades: float, process: Any, dt: float) -> None:
    """Propagate the covariance of shape (4, 4) in place, as :func:`.augmented.propagate` does.

    The products are written out, because this runs at every step of an environment. The rows of F of
    shaft speed and ship speed are full, that of the inflow is diagonal (1 / T) and that of the parameter
    is 0; ``process`` is the diagonal of Q.
    """
    half = 0.5 * dt * dt
    s0 = 1.0 + dt * shaft[0] + half * (shaft[0] * shaft[0] + shaft[2] * ship[0])
    s1 = dt * shaft[1] + half * (shaft[0] * shaft[1] - shaft[1] * fades + shaft[2] * ship[1])
    s2 = dt * shaft[2] + half * (shaft[0] * shaft[2] + shaft[2] * ship[2])
    s3 = dt * shaft[3] + half * (shaft[0] * shaft[3] + shaft[2] * ship[3])
    v0 = dt * ship[0] + half * (ship[0] * shaft[0] + ship[2] * ship[0])
    v1 = dt * ship[1] + half * (ship[0] * shaft[1] - ship[1] * fades + ship[2] * ship[1])
    v2 = 1.0 + dt * ship[2] + half * (ship[0] * shaft[2] + ship[2] * ship[2])
    v3 = dt * ship[3] + half * (ship[0] * shaft[3] + ship[2] * ship[3])
    u1 = 1.0 - dt * fades + half * fades * fades
    a0 = s0 * p[0, 0] + s1 * p[1, 0] + s2 * p[2, 0] + s3 * p[3, 0]
    a1 = s0 * p[0, 1] + s1 * p[1, 1] + s2 * p[2, 1] + s3 * p[3, 1]
    a2 = s0 * p[0, 2] + s1 * p[1, 2] + s2 * p[2, 2] + s3 * p[3, 2]
    a3 = s0 * p[0, 3] + s1 * p[1, 3] + s2 * p[2, 3] + s3 * p[3, 3]
    c0 = v0 * p[0, 0] + v1 * p[1, 0] + v2 * p[2, 0] + v3 * p[3, 0]
    c1 = v0 * p[0, 1] + v1 * p[1, 1] + v2 * p[2, 1] + v3 * p[3, 1]
    c2 = v0 * p[0, 2] + v1 * p[1, 2] + v2 * p[2, 2] + v3 * p[3, 2]
    c3 = v0 * p[0, 3] + v1 * p[1, 3] + v2 * p[2, 3] + v3 * p[3, 3]
    p[0, 0] = a0 * s0 + a1 * s1 + a2 * s2 + a3 * s3 + process[0] * dt
    p[0, 1] = a1 * u1
    p[0, 2] = a0 * v0 + a1 * v1 + a2 * v2 + a3 * v3
    p[0, 3] = a3
    p[1, 1] = u1 * p[1, 1] * u1 + process[1] * dt
    p[1, 2] = u1 * c1
    p[1, 3] = u1 * p[1, 3]
    p[2, 2] = c0 * v0 + c1 * v1 + c2 * v2 + c3 * v3 + process[2] * dt
    p[2, 3] = c3
    p[3, 3] = p[3, 3] + process[3] * dt
    for i in range(4):
        for j in range(i):
            p[i, j] = p[j, i]


@compiled
def _correct(x: Any, p: Any, innovation: float, noise: float) -> None:
    """Correct the estimate by a measurement of the first state, in Joseph's form."""
    total = p[0, 0] + noise
    k0, k1, k2, k3 = p[0, 0] / total, p[1, 0] / total, p[2, 0] / total, p[3, 0] / total
    gains, crosses = (k0, k1, k2, k3), (p[0, 0], p[1, 0], p[2, 0], p[3, 0])
    for i in range(4):
        x[i] += gains[i] * innovation
        for j in range(i, 4):
            p[i, j] += gains[i] * gains[j] * total - gains[i] * crosses[j] - gains[j] * crosses[i]
            p[j, i] = p[i, j]


@compiled
def _begin(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
    """Initialise the states from the measured torque, assuming calm water at the first sample.

    After an interruption the ship speed and the parameter keep their estimates.
    """
    ship, x, p = observer.ship, estimate.x, estimate.covariance
    velocity, valid = velocity_from_torque(
        ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
    )
    first = p[_SHIP, _SHIP] == 0.0
    if first:
        x[_SHIP] = velocity / wake_inflow(ship, 1.0)
        x[_PARAMETER] = observer.parameter
        p[_PARAMETER, _PARAMETER] = observer.spread[_PARAMETER] ** 2
    if valid and (first or estimate.started == 0):
        # The length of an interruption is unknown, so the ship speed is uncertain again.
        p[_SHIP, _SHIP] = observer.spread[_SHIP] ** 2
        p[_SHIP, _PARAMETER] = p[_PARAMETER, _SHIP] = 0.0
    p[:_SHIP, :] = p[:, :_SHIP] = 0.0
    for i in range(_SHIP):
        p[i, i] = observer.spread[i] ** 2
    x[_SHAFT], x[_INFLOW] = m.shaft_speed, velocity - wake_inflow(ship, x[_SHIP])
    return velocity, valid


@dataclass(frozen=True)
class AugmentedKalman(Observer):
    """Estimate advance velocity, ship speed and one ship parameter by an augmented Kalman filter.

    The parameter has the index ``TRACKED`` in ``x`` and ``covariance`` of an estimate;
    :func:`shaftline.observers.follow_parameter` returns it. It survives an interruption of the
    measurements. The default noises scale with the ship: an encoder noise of 0.2 % of the highest
    shaft speed and a torque meter noise of 0.75 % of the highest engine torque, both rms per sample;
    the inflow of the random-walk filter; a fouling that may change by 0.06 in an hour.

    The standard deviation of friction is a share of the highest engine torque.
    """

    tracks: str = "hull.fouling_fraction"  # dotted key of the parameter
    spread: float = 0.2  # initial standard deviation of the parameter [-]
    walk: float = 1e-3  # root of the density of its drift [1/s^0.5]
    inflow_density: float = 0.25  # of the noise that drives u [(m/s)^2/s]
    inflow_time_s: float = 3.0  # correlation time T of u [s]
    torque_noise_share: float = 0.0075  # rms of the torque meter over the highest engine torque [-]
    speed_noise_share: float = 0.002  # rms of the encoder over the highest shaft speed [-]

    name = "augmented-kalman"
    source = "Taylor 2000, chapter 2"
    tunings: ClassVar[Mapping[str, AugmentedKalman]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the OBSERVER record for a sample time ``dt`` [s].

        Raises:
            ObserverError: ``tracks`` is no parameter that can be estimated, the ship does not move, has
                no diesel, or has no inertia behind the torque meter.
        """
        record = super().discretise(ship, dt)
        inertia = self.inertia(ship)
        if self.tracks not in _CODES:
            raise ObserverError(
                f"{self.name} cannot estimate {self.tracks!r}; allowed: {', '.join(_CODES)}"
            )
        if not (ship.has_diesel and ship.moves):
            raise ObserverError(
                f"{ship.name}: {self.name} needs a diesel ship that moves; prime_mover.type is "
                f"{ship.prime_mover.type!r}, hull.fixed is {str(ship.hull.fixed).lower()}"
            )
        plant = ship.record()
        torque = min(plant["torque_limit"], plant["torque_per_rack"] * plant["drive_max"])
        torque *= plant["gear_ratio"] * plant["transmission_efficiency"]
        speed = ship.shaft_speeds[1]
        record["tracks"], parameter = _CODES[self.tracks], ship.parameter(self.tracks)
        record["parameter"] = parameter.value
        record["lowest"], record["highest"] = parameter.search_range
        record["gain"] = 1.0 / self.inflow_time_s
        unit = {_FOULING: 1.0, _COULOMB: torque, _VISCOUS: torque / speed}[_CODES[self.tracks]]
        gauge = dt * (torque * self.torque_noise_share / inertia) ** 2  # The noise acts on omega'.
        record["process"] = (gauge, self.inflow_density, 0.0, (self.walk * unit) ** 2)
        record["measurement"] = (self.speed_noise_share * speed) ** 2
        settled = math.sqrt(0.5 * self.inflow_density * self.inflow_time_s)
        record["spread"] = (self.speed_noise_share * speed, settled, settled, self.spread * unit)
        return record

    @staticmethod
    @compiled
    def update(observer: Record, estimate: Record, m: Measurement) -> tuple[float, bool]:
        """One sample of the extended Kalman filter."""
        if estimate.valid == 0:
            return _begin(observer, estimate, m)
        ship, x, p, dt = observer.ship, estimate.x, estimate.covariance, observer.dt
        inertia = inertia_behind_meter(ship)
        w, v, parameter = x[_SHAFT], x[_SHIP], x[_PARAMETER]
        torque = 0.5 * (estimate.shaft_torque + m.shaft_torque)
        pitch = 0.5 * (estimate.pitch_ratio + m.pitch_ratio)
        # Predict by the explicit midpoint rule, with the mean of the two torques.
        advance = wake_inflow(ship, v) + x[_INFLOW]
        start, _ = _propeller(observer, w, advance, parameter, pitch)
        middle = w + 0.5 * dt * (torque - start) / inertia
        # A complex step in each argument gives value and derivative together.
        along = 1j * STEP
        load, push = _propeller(observer, middle + along, advance, parameter, pitch)
        drag = _resistance(observer, v + along, parameter)
        x[_SHAFT] = w + dt * (torque - load.real) / inertia
        x[_INFLOW] *= 1.0 - dt * observer.gain
        x[_SHIP] = v + dt * (push.real - drag.real) / ship.mass
        shaft_by_speed, ship_by_speed = -load.imag / STEP / inertia, push.imag / STEP / ship.mass
        load, push = _propeller(observer, middle, advance + along, parameter, pitch)
        shaft_by_inflow, ship_by_inflow = -load.imag / STEP / inertia, push.imag / STEP / ship.mass
        wake = wake_inflow(ship, v + along).imag / STEP
        damping = -drag.imag / STEP / ship.mass
        shaft_by_parameter, ship_by_parameter = 0.0, 0.0
        if observer.tracks == _FOULING:
            ship_by_parameter = -drag.real / (1.0 + parameter) / ship.mass
        else:
            shaft_by_parameter = -_friction(observer, middle) / inertia
        _propagate(
            p,
            (shaft_by_speed, shaft_by_inflow, wake * shaft_by_inflow, shaft_by_parameter),
            (ship_by_speed, ship_by_inflow, wake * ship_by_inflow + damping, ship_by_parameter),
            observer.gain,
            observer.process,
            dt,
        )
        innovation = m.shaft_speed - x[_SHAFT]
        explained = innovation * innovation < GATE * (p[_SHAFT, _SHAFT] + observer.measurement)
        _correct(x, p, innovation, observer.measurement)
        x[_PARAMETER] = min(max(x[_PARAMETER], observer.lowest), observer.highest)
        found = wake_inflow(ship, x[_SHIP]) + x[_INFLOW]
        velocity, known = limit_to_curve(ship, found, m.shaft_speed)
        if explained and known:
            return velocity, True
        # Off the torque curve or with an unexplained innovation, v and theta are not corrected.
        x[_SHIP], x[_PARAMETER] = v, parameter
        return velocity, False


AugmentedKalman.tunings = {
    "fouling": AugmentedKalman(),
    "friction": AugmentedKalman(
        "transmission.coulomb_friction_propeller_side_N_m", spread=0.02, walk=5e-5
    ),
}
