"""Augmented Kalman filter of the advance velocity: a number of the ship is tracked beside it.

States: shaft speed omega, disturbance u of the inflow (what a sea does), speed v of the ship through the
water, and the number theta. The torque at the gauge drives the shaft, so nothing need be known of the
engine; nor is the speed of the ship measured:

    I_R domega/dt = M_m - M_load(omega, v_a, theta),   v_a = (1 - w) v + u,   du/dt = -u / T + noise
    m dv/dt = k_p (1 - t) T(omega, v_a) - R(v, theta),   dtheta/dt = noise

What the torque tells is v_a, at once. Its slow part is the ship's own speed, and what a ship does not
reach at its thrust it has in resistance: so fouling is told, within some thousand seconds. Friction
behind the gauge is told likewise, where the hull is known. Only one of them can be told at a time, and
an error of the gauge or of the torque curve is taken for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..core.compiled import Real, Record, compiled
from ..plant.hull import resistance, wake_inflow
from ..plant.propeller import propeller_load
from ..plant.shaft import inertia_behind_gauge, load_torque
from ..plant.ship import Ship
from .augmented import STEP
from .base import Observer, ObserverError
from .records import TRACKED, Measurement
from .torque_curve import held_on_curve, velocity_from_torque

_FOULING, _COULOMB, _VISCOUS = range(3)
_CODES = {
    "hull.fouling_fraction": _FOULING,
    "transmission.coulomb_friction_propeller_side_N_m": _COULOMB,
    "transmission.viscous_friction_propeller_side_N_m_s_rad": _VISCOUS,
}

_SHAFT, _INFLOW, _SHIP, _NUMBER = 0, 1, 2, TRACKED

GATE = 25.0
"""Square of the standard deviations up to which an innovation is one of the sea or the instruments."""


@compiled
def _screw(
    observer: Record, shaft_speed: Real, advance: Real, number: float, pitch: float
) -> tuple[Real, Real]:
    """Torque that the shaft bears behind the gauge [N m], and push of all propellers [N]."""
    ship = observer.ship
    screw = propeller_load(ship, advance, shaft_speed, pitch, ship.depth, 0.0)
    load = load_torque(ship, screw.torque / ship.relative_rotative_efficiency, shaft_speed)
    if observer.tracks != _FOULING:
        load = load + (number - observer.number) * _friction(observer, shaft_speed)
    return load, ship.propellers * (1.0 - ship.thrust_deduction) * screw.thrust


@compiled
def _friction(observer: Record, shaft_speed: Real) -> Real:
    """Torque [N m] per unit of a friction that is tracked."""
    if observer.tracks == _COULOMB:
        return math.copysign(1.0, shaft_speed.real)
    return shaft_speed


@compiled
def _drag(observer: Record, ship_speed: Real, number: float) -> Real:
    """Resistance [N] at a speed through the water [m/s]."""
    clean = resistance(observer.ship, ship_speed, 1.0)
    if observer.tracks != _FOULING:
        return clean
    return clean * (1.0 + number) / (1.0 + observer.number)


Row = tuple[float, float, float, float]
"""Of a matrix over the four states."""


@compiled
def _carried(p: Any, shaft: Row, ship: Row, fades: float, process: Any, dt: float) -> None:
    """P = Phi P Phi' + Q dt, as :func:`shaftline.observers.augmented.propagate` has it.

    Written out, for it runs at every step of an environment: two rows of F are full, the inflow's has
    its diagonal alone and the number's is 0.

    Args:
        p: covariance, shape (4, 4); changed in place.
        shaft: row of F of the shaft speed.
        ship: of the ship speed.
        fades: 1 / T of the inflow [1/s].
        process: densities.
        dt: [s].
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
def _corrected(x: Any, p: Any, innovation: float, noise: float) -> None:
    """Take in a reading of the first state, by Joseph's form."""
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
    """By the torque at hand: in calm water at the very first reading, else beside the ship as known."""
    ship, x, p = observer.ship, estimate.x, estimate.covariance
    velocity, valid = velocity_from_torque(
        ship, m.shaft_torque, m.shaft_speed, m.pitch_ratio, estimate.advance_velocity
    )
    first = p[_SHIP, _SHIP] == 0.0
    if first:
        x[_SHIP] = velocity / wake_inflow(ship, 1.0)
        x[_NUMBER] = observer.number
        p[_NUMBER, _NUMBER] = observer.spread[_NUMBER] ** 2
    if valid and (first or estimate.started == 0):
        # nobody knows how long the readings were lost
        p[_SHIP, _SHIP] = observer.spread[_SHIP] ** 2
        p[_SHIP, _NUMBER] = 0.0
        p[_NUMBER, _SHIP] = 0.0
    for i in range(_SHIP):
        for j in range(4):
            p[i, j] = 0.0
            p[j, i] = 0.0
        p[i, i] = observer.spread[i] ** 2
    x[_SHAFT], x[_INFLOW] = m.shaft_speed, velocity - wake_inflow(ship, x[_SHIP])
    return velocity, valid


@dataclass(frozen=True)
class AugmentedKalman(Observer):
    """Kalman filter of shaft speed, inflow, ship speed and one number of the ship.

    The number stands at ``TRACKED`` in an estimate's ``x`` and ``covariance``, and
    :func:`shaftline.observers.follow_number` gives it; a reading that is lost does not lose it. Noises
    are shares of what the ship is made for: an encoder of 0.2 % of the highest shaft speed and a gauge
    of 0.75 % of the engine's highest torque, both rms per sample; an inflow as of the random-walk
    filter; fouling that may change by 0.06 in an hour.

    Args:
        tracks: dotted key of the number.
        spread: standard deviation of the number at first: of fouling [-], of friction as a share of the
            engine's highest torque.
        walk: root of the density of its drift, in the same unit per s^0.5.
        inflow_density: of the noise that drives u [(m/s)^2/s].
        inflow_time_s: correlation time T of u.
        torque_noise_share: rms of the gauge's noise over the engine's highest torque at the shaft.
        speed_noise_share: rms of the encoder's noise over the highest shaft speed.
    """

    tracks: str = "hull.fouling_fraction"
    spread: float = 0.2
    walk: float = 1e-3
    inflow_density: float = 0.25
    inflow_time_s: float = 3.0
    torque_noise_share: float = 0.0075
    speed_noise_share: float = 0.002

    name = "augmented-kalman"
    source = "Taylor 2000, chapter 2"
    tunings: ClassVar[Mapping[str, AugmentedKalman]]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """OBSERVER record for a time step ``dt`` [s].

        Raises:
            ObserverError: a number that it cannot track, a ship that does not move, is not driven by a
                diesel, or has no inertia behind the gauge.
        """
        record = super().discretise(ship, dt)
        inertia = self.inertia(ship)
        if self.tracks not in _CODES:
            raise ObserverError(
                f"{self.name} cannot track {self.tracks}; it can: {', '.join(_CODES)}"
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
        record["tracks"] = _CODES[self.tracks]
        number = ship.number(self.tracks)
        record["number"] = number.value
        record["lowest"], record["highest"] = number.searched
        record["gain"] = 1.0 / self.inflow_time_s
        unit = {_FOULING: 1.0, _COULOMB: torque, _VISCOUS: torque / speed}[_CODES[self.tracks]]
        gauge = dt * (torque * self.torque_noise_share / inertia) ** 2  # it drives omega' directly
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
        inertia = inertia_behind_gauge(ship)
        w, v, number = x[_SHAFT], x[_SHIP], x[_NUMBER]
        torque = 0.5 * (estimate.shaft_torque + m.shaft_torque)
        pitch = 0.5 * (estimate.pitch_ratio + m.pitch_ratio)
        # by the explicit midpoint rule, with the mean of the two torques
        advance = wake_inflow(ship, v) + x[_INFLOW]
        start, _ = _screw(observer, w, advance, number, pitch)
        middle = w + 0.5 * dt * (torque - start) / inertia
        # one step along each of what they depend on gives their slopes with their values
        along = 1j * STEP
        load, push = _screw(observer, middle + along, advance, number, pitch)
        drag = _drag(observer, v + along, number)
        x[_SHAFT] = w + dt * (torque - load.real) / inertia
        x[_INFLOW] *= 1.0 - dt * observer.gain
        x[_SHIP] = v + dt * (push.real - drag.real) / ship.mass
        shaft_by_speed, ship_by_speed = -load.imag / STEP / inertia, push.imag / STEP / ship.mass
        load, push = _screw(observer, middle, advance + along, number, pitch)
        shaft_by_inflow, ship_by_inflow = -load.imag / STEP / inertia, push.imag / STEP / ship.mass
        wake = wake_inflow(ship, v + along).imag / STEP
        damping = -drag.imag / STEP / ship.mass
        shaft_by_number, ship_by_number = 0.0, 0.0
        if observer.tracks == _FOULING:
            ship_by_number = -drag.real / (1.0 + number) / ship.mass
        else:
            shaft_by_number = -_friction(observer, middle) / inertia
        _carried(
            p,
            (shaft_by_speed, shaft_by_inflow, wake * shaft_by_inflow, shaft_by_number),
            (ship_by_speed, ship_by_inflow, wake * ship_by_inflow + damping, ship_by_number),
            observer.gain, observer.process, dt,
        )  # fmt: skip
        innovation = m.shaft_speed - x[_SHAFT]
        explained = innovation * innovation < GATE * (p[_SHAFT, _SHAFT] + observer.measurement)
        _corrected(x, p, innovation, observer.measurement)
        x[_NUMBER] = min(max(x[_NUMBER], observer.lowest), observer.highest)
        found = wake_inflow(ship, x[_SHIP]) + x[_INFLOW]
        velocity, known = held_on_curve(ship, found, m.shaft_speed)
        if explained and known:
            return velocity, True
        # off the torque curve, or where no inflow does this, nothing is learned of ship and number
        x[_SHIP], x[_NUMBER] = v, number
        return velocity, False


AugmentedKalman.tunings = {
    "fouling": AugmentedKalman(),
    "friction": AugmentedKalman(
        "transmission.coulomb_friction_propeller_side_N_m", spread=0.02, walk=5e-5
    ),
}
