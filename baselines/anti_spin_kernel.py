"""The anti-spin controller's arithmetic, compiled: one instant of one ship (Pivano et al. 2008)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..plant.drives.diesel import diesel_torque, rack_of_torque, torque_limit
from ..plant.open_water import invert_torque_coefficient, open_water
from ..plant.shaft import brake_torque_of, drive_torque, inertia_behind_gauge, shaft_inertia
from .torque_loss import (
    TORQUE_LOSS,
    TORQUE_LOSS_OBSERVER,
    bollard_gain,
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

CONTROLLER = np.dtype(
    [
        ("observer", TORQUE_LOSS_OBSERVER),
        ("detector", DETECTOR),
        ("anti_spin", np.int64),
        ("inertia", np.float64),  # J_m of the whole shaft line [kg m2]
        ("gamma", np.float64),  # [1/s]
        ("proportional", np.float64),  # k_P [N m s/rad]
        ("integral", np.float64),  # k_I [N m/rad]
        ("highest_advance", np.float64),  # highest J-hat over P/D [-]
        ("ventilated_speed", np.float64),  # omega_v,opt over the calm-water speed [-]
        ("speed_min", np.float64),  # of the shaft [rad/s]
        ("speed_max", np.float64),
        ("filter", np.float64, (2, 2)),  # transition of omega_d and its rate over a step
    ],
    align=True,
)

ANTI_SPIN_MEMORY = np.dtype(
    [
        ("started", np.int64),
        ("estimate", TORQUE_LOSS),
        ("detection", DETECTION),
        ("reading", np.float64, (8,)),  # last good observation
        ("reference", np.float64),  # omega_d [rad/s]
        ("reference_rate", np.float64),  # [rad/s2]
        ("error_integral", np.float64),  # e1 [rad]
        ("shaft_torque", np.float64),  # Q_m that the law asks for, before the engine's limits [N m]
    ],
    align=True,
)


@compiled
def thrust_per_torque(controller: Record, torque: float, shaft_speed: float, pitch: float) -> float:
    """G_QT(J-hat) = T / Q [1/m] at the advance ratio that an estimated torque tells (eq. 18).

    KT and KQ are those of the ship's own curves. J-hat lies between 0 (the paper's zone 1, where KQ
    cannot be inverted) and the usual working range's end: beyond it thrust, and with it G_QT, goes to
    zero, and the desired torque would run away.
    """
    ship = controller.observer.ship
    highest = controller.highest_advance * pitch
    bollard = bollard_gain(ship, pitch) * shaft_speed * shaft_speed
    kq0 = open_water(ship.kq, 0.0, pitch)
    if not bollard > 0.0:
        j = 0.0
    else:
        j, _ = invert_torque_coefficient(ship.kq, kq0 * torque / bollard, pitch, 0.5 * highest)
        j = min(j, highest)
    kq = open_water(ship.kq, j, pitch) / ship.relative_rotative_efficiency
    return float(open_water(ship.kt, j, pitch) / (ship.diameter * kq))


@compiled
def desired_speed(controller: Record, estimate: Record, thrust: float, pitch: float) -> float:
    """Shaft speed [rad/s] that gives a thrust [N] despite the estimated loss (eqs. 17 and 19)."""
    ship = controller.observer.ship
    torque = estimated_propeller_torque(ship, estimate)
    wanted = thrust / thrust_per_torque(controller, torque, estimate.shaft_speed, pitch)
    beyond = wanted - estimate.torque_loss
    speed = math.copysign(math.sqrt(abs(beyond) / bollard_gain(ship, pitch)), beyond)
    return float(min(max(speed, controller.speed_min), controller.speed_max))


@compiled
def gauge_jump(ship: Record, engine_speed: float, rack_before: float, rack: float) -> float:
    """Step of the gauge's torque [N m] as the fuel changes between two racks [mm].

    The inertia behind the gauge takes its share of the drive torque's step. An engine with a lag or a
    dead time, or a slow rack, makes no step.
    """
    if ship.engine_lag > 0.0 or ship.engine_dead_time > 0.0 or math.isfinite(ship.rack_rate_limit):
        return 0.0
    before = diesel_torque(ship, engine_speed, rack_before)
    after = diesel_torque(ship, engine_speed, rack)
    shaft_speed = engine_speed / ship.gear_ratio
    rise = drive_torque(ship, after, shaft_speed) - drive_torque(ship, before, shaft_speed)
    return float(rise * inertia_behind_gauge(ship) / shaft_inertia(ship))


@compiled
def control(
    controller: Record,
    memory: Record,
    calm_speed: float,
    thrust: float,
    shaft_speed: float,
    shaft_torque: float,
    pitch: float,
    ship_speed: float,
    rack_before: float,
) -> float:
    """Fuel rack [mm] for one ship at one instant; the memory changes in place.

    Args:
        controller: CONTROLLER record.
        memory: ANTI_SPIN_MEMORY record, all zeros but the reading at the first instant.
        calm_speed: shaft speed of the order in calm water [rad/s].
        thrust: T_pd, of one propeller in calm water [N].
        shaft_speed: omega, measured [rad/s].
        shaft_torque: M_m at the gauge, measured [N m].
        pitch: P/D, measured [-].
        ship_speed: v_s, measured [m/s].
        rack_before: fuel rack in force until now [mm].
    """
    ship = controller.observer.ship
    pitch = min(max(pitch, ship.pitch_ratio_min), ship.pitch_ratio_max)
    estimate, detection = memory.estimate, memory.detection
    update_torque_loss(controller.observer, estimate, shaft_speed, shaft_torque, pitch)
    torque = estimated_propeller_torque(ship, estimate)
    ratio = torque_ratio(controller.detector, ship, torque, shaft_speed, pitch, ship_speed)
    inflow = excess_inflow(ship, torque, shaft_speed, pitch, ship_speed)
    update_detection(controller.detector, detection, ratio, inflow)

    wanted = desired_speed(controller, estimate, thrust, pitch)
    if controller.anti_spin != 0 and detection.ventilating != 0:
        # limited before the filter, so that its output and the feed-forward stay smooth
        wanted = min(wanted, max(controller.ventilated_speed * calm_speed, controller.speed_min))
    if memory.started == 0:
        memory.reference = shaft_speed  # at rest there
        memory.started = 1
    else:
        away, rate = memory.reference - wanted, memory.reference_rate
        turn = controller.filter
        memory.reference = wanted + turn[0, 0] * away + turn[0, 1] * rate
        memory.reference_rate = turn[1, 0] * away + turn[1, 1] * rate

    # eq. 21
    reference, e1, gamma = memory.reference, memory.error_integral, controller.gamma
    e2 = shaft_speed - reference
    demand = controller.inertia * memory.reference_rate + estimate.torque_loss
    demand += shaft_load(ship, pitch, reference - gamma * e1)
    demand += ship.viscous_propeller_side * reference
    demand -= (controller.integral + gamma * controller.proportional) * e1
    demand -= controller.proportional * e2
    memory.shaft_torque = demand

    # through the gearbox to the engine, inside its envelope
    brake = brake_torque_of(ship, demand, shaft_speed)
    engine_speed = ship.gear_ratio * shaft_speed
    limit = torque_limit(ship, engine_speed)
    rack = rack_of_torque(ship, engine_speed, min(brake, limit))
    rack = float(clip(rack, ship.drive_min, ship.drive_max))
    starved = brake > limit or rack >= ship.drive_max
    closed = rack <= ship.drive_min
    # anti-windup: the integral does not push further against a limit
    if not ((starved and e2 < 0.0) or (closed and e2 > 0.0)):
        memory.error_integral = e1 + controller.observer.dt * e2
    # the gauge was read before this fuel; what the observer integrates from here on begins after it
    estimate.torque_reading += gauge_jump(ship, engine_speed, rack_before, rack)
    return rack


@compiled
def control_all(
    controller: Record,
    memories: Any,
    calm_speed: Any,
    thrust: Any,
    shaft_speed: Any,
    shaft_torque: Any,
    pitch: Any,
    ship_speed: Any,
    rack_before: Any,
    rack: Any,
) -> None:
    """The same for n ships: memories and every reading of shape (n,); racks go into ``rack`` [mm]."""
    for i in range(len(memories)):
        rack[i] = control(
            controller,
            memories[i],
            calm_speed[i],
            thrust[i],
            shaft_speed[i],
            shaft_torque[i],
            pitch[i],
            ship_speed[i],
            rack_before[i],
        )
