"""The thrust law's arithmetic, compiled: one instant of one propeller (Pivano et al. 2008, section 4).

What drives the shaft enters nowhere: a diesel's controller and an electric drive's both begin here, the
one making a fuel rack of the torque that is asked for, the other a command of torque.
"""

from __future__ import annotations

import math

import numpy as np

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..plant.propeller_curves import advance_ratio_of, coefficients_along
from .torque_loss import (
    TORQUE_LOSS,
    TORQUE_LOSS_OBSERVER,
    bollard_gain,
    direction_of,
    estimated_propeller_torque,
    shaft_load,
    update_torque_loss,
)
from .ventilation_detection import (
    DETECTION,
    DETECTOR,
    excess_inflow,
    torque_ratio,
    update_detection,
)

THRUST_LAW = np.dtype(
    [
        ("observer", TORQUE_LOSS_OBSERVER),
        ("detector", DETECTOR),
        ("anti_spin", np.int64),
        ("inertia", np.float64),  # J_m of the whole shaft line [kg m2]
        ("gamma", np.float64),  # [1/s]
        ("proportional", np.float64),  # k_P [N m s/rad]
        ("integral", np.float64),  # k_I [N m/rad]
        ("highest_advance", np.float64, (2,)),  # highest J-hat over P/D, ahead and astern [-]
        ("speed_min", np.float64),  # of the shaft [rad/s]; negative where it turns astern too
        ("speed_max", np.float64),
        ("filter", np.float64, (2, 2)),  # transition of omega_d and its rate over a step
    ],
    align=True,
)

THRUST_LAW_MEMORY = [
    ("started", np.int64),
    ("estimate", TORQUE_LOSS),
    ("detection", DETECTION),
    ("reference", np.float64),  # omega_d [rad/s]
    ("reference_rate", np.float64),  # [rad/s2]
    ("error_integral", np.float64),  # e1 [rad]
    ("shaft_torque", np.float64),  # Q_m that the law asks for, before the drive's limits [N m]
]
"""Fields of a controller's memory; what it has read goes beside them."""


@compiled
def thrust_per_torque(law: Record, torque: float, shaft_speed: float, pitch: float) -> float:
    """G_QT(J-hat) = T / Q [1/m] at the advance ratio that an estimated torque tells (eq. 18).

    KT and KQ are those of the ship's own curves, in the direction of rotation. J-hat lies between 0 (the
    paper's zone 1, where KQ cannot be inverted) and the usual working range's end: beyond it thrust, and
    with it G_QT, goes to zero, and the desired torque would run away.
    """
    ship = law.observer.ship
    direction = direction_of(ship, shaft_speed)
    highest = law.highest_advance[0 if direction > 0.0 else 1] * pitch
    bollard = bollard_gain(ship, pitch, direction) * shaft_speed * shaft_speed
    if not bollard > 0.0:
        j = 0.0
    else:
        _, kq0 = coefficients_along(ship, 0.0, pitch, direction)
        kq = kq0 * (direction * torque) / bollard
        j, _ = advance_ratio_of(ship, kq, pitch, 0.5 * highest, direction)
        j = min(max(j, 0.0), highest)
    kt, kq = coefficients_along(ship, j, pitch, direction)
    return float(kt / (ship.diameter * (kq / ship.relative_rotative_efficiency)))


@compiled
def desired_speed(law: Record, estimate: Record, thrust: float, pitch: float) -> float:
    """Shaft speed [rad/s] that gives a thrust [N] despite the estimated loss (eqs. 17 and 19)."""
    ship = law.observer.ship
    torque = estimated_propeller_torque(ship, estimate)
    wanted = thrust / thrust_per_torque(law, torque, estimate.shaft_speed, pitch)
    beyond = wanted - estimate.torque_loss
    gain = bollard_gain(ship, pitch, direction_of(ship, beyond))
    speed = math.copysign(math.sqrt(abs(beyond) / gain), beyond)
    return float(min(max(speed, law.speed_min), law.speed_max))


@compiled
def torque_demand(
    law: Record,
    memory: Record,
    thrust: float,
    ventilated_ahead: float,
    ventilated_astern: float,
    shaft_speed: float,
    shaft_torque: float,
    pitch: float,
    ship_speed: float,
) -> float:
    """Torque Q_m [N m] that the law asks for at one instant; the memory changes in place.

    Args:
        law: THRUST_LAW record.
        memory: with the fields THRUST_LAW_MEMORY, all zeros at the first instant.
        thrust: T_pd, of one propeller [N].
        ventilated_ahead: omega_v,opt, which a shaft in air does not exceed [rad/s].
        ventilated_astern: the same of a shaft that turns astern, positive [rad/s].
        shaft_speed: omega, measured [rad/s].
        shaft_torque: Q_m, where the observer knows it [N m].
        pitch: P/D [-].
        ship_speed: v_s, measured [m/s].
    """
    ship = law.observer.ship
    estimate, detection = memory.estimate, memory.detection
    update_torque_loss(law.observer, estimate, shaft_speed, shaft_torque, pitch)
    torque = estimated_propeller_torque(ship, estimate)
    ratio = torque_ratio(law.detector, ship, torque, shaft_speed, pitch, ship_speed)
    inflow = excess_inflow(ship, torque, shaft_speed, pitch, ship_speed)
    update_detection(law.detector, detection, ratio, inflow)

    wanted = desired_speed(law, estimate, thrust, pitch)
    if law.anti_spin != 0 and detection.ventilating != 0:
        # limited before the filter, so that its output and the feed-forward stay smooth
        wanted = float(clip(wanted, -ventilated_astern, ventilated_ahead))
    if memory.started == 0:
        memory.reference = shaft_speed  # at rest there
        memory.started = 1
    else:
        away, rate = memory.reference - wanted, memory.reference_rate
        turn = law.filter
        memory.reference = wanted + turn[0, 0] * away + turn[0, 1] * rate
        memory.reference_rate = turn[1, 0] * away + turn[1, 1] * rate

    # eq. 21
    reference, e1, gamma = memory.reference, memory.error_integral, law.gamma
    e2 = shaft_speed - reference
    demand = law.inertia * memory.reference_rate + estimate.torque_loss
    demand += shaft_load(law.observer, pitch, reference - gamma * e1)
    demand += law.observer.viscous * reference
    demand -= (law.integral + gamma * law.proportional) * e1
    demand -= law.proportional * e2
    memory.shaft_torque = demand
    return float(demand)


@compiled
def integrate_error(
    law: Record, memory: Record, shaft_speed: float, starved: bool, closed: bool
) -> None:
    """Carry e1 over the interval, unless that pushes further against a limit of the drive.

    Args:
        law: THRUST_LAW record.
        memory: with the fields THRUST_LAW_MEMORY.
        shaft_speed: omega, measured [rad/s].
        starved: whether the drive gives all it has.
        closed: whether it gives the least it can.
    """
    e2 = shaft_speed - memory.reference
    if not ((starved and e2 < 0.0) or (closed and e2 > 0.0)):
        memory.error_integral += law.observer.dt * e2
