"""Observer of the torque loss, and detection of ventilation (Pivano et al. 2008, sections 3 and 4.2).

The paper ("A four-quadrant thrust controller for marine propellers with loss estimation and anti-spin",
eqs. 1 to 13) has a fixed-pitch propeller and an electric motor of known torque. Here the known torque is
that of the shaft torque meter, which acts on the inertia behind it; without a torque meter it is that of
an electric drive, as in the paper, which acts on the inertia and friction of the whole shaft line. The
propeller torque at zero advance speed depends on the measured pitch.

The torque reduction coefficient beta_Q is the ratio of the estimated propeller torque to the nominal
torque at the ship speed. Ventilation is detected below one threshold and ends above another.

Waves also change the torque. Their orbital motion increases the torque as often as it reduces it, but
air only reduces it. Increases of the torque therefore measure the effect of the sea. With the option
``sea_margin``, which is not in the paper, ventilation is detected only if the loss is larger than this
effect: the inflow that would explain the estimated torque without air must exceed the inflow in calm
water by a number of standard deviations of the sea's inflow. This is a threshold of constant false-alarm
rate, as in a radar.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, fields
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.torque_curve import (
    model_torque,
    observer_plant,
    uses_drive_torque,
    velocity_from_torque,
)
from ..plant.hull import wake_inflow
from ..plant.propeller import FOUR_QUADRANT
from ..plant.record import PLANT
from ..plant.shaft import (
    arctangent_friction,
    directional_value,
    friction_torque,
    inertia_behind_meter,
)
from ..plant.ship import Ship

TORQUE_LOSS_OBSERVER = np.dtype(
    [
        ("dt", np.float64),  # [s]
        ("whole_line", np.int64),  # 1 if the torque is that of the drive
        ("inertia", np.float64),  # J_m, on which the known torque acts [kg m2]
        ("viscous", np.float64),  # k_f2 of the same part of the line [N m s/rad]
        ("speed_gain", np.float64),  # l1 [N m s/rad]
        ("loss_gain", np.float64),  # l2 [N m/rad]
        ("time_constant", np.float64),  # tau [s]
        ("ship", PLANT),
    ],
    align=True,
)

TORQUE_LOSS = np.dtype(
    [
        ("started", np.int64),
        ("shaft_speed", np.float64),  # omega-hat [rad/s]
        ("torque_loss", np.float64),  # Delta_q-hat [N m]; negative where torque is lost
        ("measured_speed", np.float64),  # of the last sample
        ("measured_torque", np.float64),
        ("measured_pitch", np.float64),
    ],
    align=True,
)


def observer_weights(
    speed_gain: float, loss_gain: float, time_constant: float, inertia: float, viscous: float
) -> tuple[float, float]:
    """Return weights a11, a22 > 0 of the Lyapunov function that satisfy condition A2 of the paper.

    With r = a11 / (J a22), A2 is |r + l2| < 2 sqrt(r c), c = (k_f2 + l1) / tau. For l2 < 0 the left
    side is 0 at r = -l2. For l2 >= 0, r - 2 sqrt(c r) + l2 is least at r = c, where the condition is
    l2 < c; weights exist if and only if it holds. Only their ratio has a meaning. Units: l1 [N m
    s/rad], l2 [N m/rad], tau [s], J_m [kg m2], k_f2 [N m s/rad].

    Raises:
        ValueError: a gain is not finite, tau or J is not positive, or A1 or A2 is violated.

    Example:
        >>> observer_weights(12.0, -32.0, time_constant=500.0, inertia=1.0, viscous=0.0)
        (32.0, 1.0)
    """
    if not all(map(math.isfinite, (speed_gain, loss_gain, time_constant, inertia, viscous))):
        raise ValueError("torque-loss observer: every gain must be a finite number")
    if time_constant <= 0.0 or inertia <= 0.0:
        raise ValueError(
            f"torque-loss observer: time constant {time_constant:g} s and inertia {inertia:g} kg m2 "
            "must be positive"
        )
    if not speed_gain > -viscous:
        raise ValueError(
            f"torque-loss observer: condition A1 is violated: l1 = {speed_gain:g} N m s/rad must "
            f"exceed -k_f2 = {-viscous:g}"
        )
    bound = (viscous + speed_gain) / time_constant
    if not loss_gain < bound:
        raise ValueError(
            f"torque-loss observer: condition A2 is violated: l2 = {loss_gain:g} N m/rad must be "
            f"below (k_f2 + l1) / tau = {bound:g}, or no a11, a22 > 0 exist"
        )
    ratio = -loss_gain if loss_gain < 0.0 else bound
    return inertia * ratio, 1.0


@dataclass(frozen=True)
class TorqueLossObserver:
    """Tuning of the torque-loss observer; gains are per inertia and so suit ships of every size.

    The paper prints no gains. The defaults place the poles of shaft and loss at -4 and -8 rad/s without
    the damping of the propeller. Faster poles improve little with measurements every 0.5 s. The time
    constant is long because in a steady state the estimate is tau |l2| / (tau |l2| + l1 + slope of psi)
    times the loss.
    """

    speed_rate: float = 12.0  # l1 / J [1/s]
    loss_rate: float = -32.0  # l2 / J [1/s2]
    time_constant_s: float = 500.0  # tau [s]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """Return the TORQUE_LOSS_OBSERVER record for a sample time ``dt`` [s].

        Raises:
            ValueError: the step is not positive, or the gains violate A1 or A2.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f"torque-loss observer: time step {dt} s must be positive")
        plant = observer_plant(ship)
        electric, inertia = uses_drive_torque(ship), inertia_behind_meter(plant)
        viscous = float(plant["viscous_propeller_side"])
        if electric:
            viscous += float(plant["viscous_engine_side"])
        gains = (self.speed_rate * inertia, self.loss_rate * inertia, self.time_constant_s)
        observer_weights(*gains, inertia, viscous)
        values = (dt, electric, inertia, viscous, *gains, plant)
        return np.array(values, TORQUE_LOSS_OBSERVER)[()]


@compiled
def direction_of(ship: Record, shaft_speed: float) -> float:
    """Return the direction of rotation: 1 ahead; -1 astern, with four-quadrant curves only."""
    return -1.0 if shaft_speed < 0.0 and ship.propeller_model == FOUR_QUADRANT else 1.0


@compiled
def bollard_gain(ship: Record, pitch_ratio: float, direction: float = 1.0) -> float:
    """Return G_Q [N m s2/rad2] of the torque G_Q omega |omega| at zero advance speed (eqs. 3, 7, 16).

    It is G_Qp ahead and G_Qn astern; both are equal without four-quadrant curves.
    """
    return direction * model_torque(ship, 0.0, direction, pitch_ratio)


@compiled
def dry_friction(observer: Record, shaft_speed: float) -> float:
    """Return the dry friction [N m] on the part of the shaft line that the known torque drives (eq. 2).

    The Coulomb friction has the tanh of the plant in place of the arc tangent of the paper.
    """
    ship = observer.ship
    torque = friction_torque(ship, ship.coulomb_propeller_side, 0.0, shaft_speed)
    if observer.whole_line != 0:
        coulomb = directional_value(ship.coulomb_engine_side, ship.coulomb_asymmetry, shaft_speed)
        torque += friction_torque(ship, coulomb, 0.0, shaft_speed)
        torque += arctangent_friction(ship, shaft_speed)
    return float(torque)


@compiled
def shaft_load(observer: Record, pitch_ratio: float, shaft_speed: float) -> float:
    """Return psi [N m], propeller torque without losses plus dry friction, at omega [rad/s] (eq. 6)."""
    gain = bollard_gain(observer.ship, pitch_ratio, direction_of(observer.ship, shaft_speed))
    return gain * abs(shaft_speed) * shaft_speed + dry_friction(observer, shaft_speed)


@compiled
def estimated_propeller_torque(ship: Record, estimate: Record) -> float:
    """Return the propeller torque Q_p-hat [N m] from the two estimates (eq. 13)."""
    omega = estimate.shaft_speed
    gain = bollard_gain(ship, estimate.measured_pitch, direction_of(ship, omega))
    return float(gain * abs(omega) * omega + estimate.torque_loss)


@compiled
def update_torque_loss(
    observer: Record, estimate: Record, shaft_speed: float, shaft_torque: float, pitch_ratio: float
) -> None:
    """Update the estimate by one sample (eqs. 8 to 10); it changes in place.

    The trapezoidal rule is implicit in both estimates, because an explicit rule is unstable at 0.5
    s. The loss enters linearly and is eliminated. The remaining equation B omega + A |omega| omega =
    R has A >= 0 and, under A1 and A2, B > 1, so it has one root, in closed form. The dry friction is
    that at the measured speed [rad/s]. The torque Q_m [N m] is that of the torque meter or of the
    drive, at the propeller shaft. The TORQUE_LOSS record is zero before the first sample.
    """
    ship = observer.ship
    viscous = observer.viscous
    l1, l2 = observer.speed_gain, observer.loss_gain
    friction = dry_friction(observer, shaft_speed)
    if estimate.started == 0:
        # Start in steady state at this sample.
        estimate.shaft_speed = shaft_speed
        load = shaft_load(observer, pitch_ratio, shaft_speed) + viscous * shaft_speed
        estimate.torque_loss = shaft_torque - load
    else:
        half = 0.5 * observer.dt
        share = half / observer.inertia
        omega, loss = estimate.shaft_speed, estimate.torque_loss
        error = estimate.measured_speed - omega
        gain = bollard_gain(ship, estimate.measured_pitch, direction_of(ship, omega))
        friction_before = dry_friction(observer, estimate.measured_speed)
        before = estimate.measured_torque - gain * abs(omega) * omega - friction_before
        before = before - viscous * omega - loss
        before += l1 * error
        # Delta_q+ = loss_free - follow omega+.
        damping = 1.0 / (1.0 + half / observer.time_constant)
        loss_free = loss + half * (-loss / observer.time_constant + l2 * (error + shaft_speed))
        loss_free *= damping
        follow = damping * half * l2
        linear = 1.0 + share * (viscous + l1 - follow)
        right = omega + share * (before + shaft_torque - friction + l1 * shaft_speed - loss_free)
        square = share * bollard_gain(ship, pitch_ratio, direction_of(ship, right))
        root = math.sqrt(linear * linear + 4.0 * square * abs(right))
        following = 2.0 * right / (linear + root)
        estimate.shaft_speed = following
        estimate.torque_loss = loss_free - follow * following
    estimate.started = 1
    estimate.measured_speed = shaft_speed
    estimate.measured_torque = shaft_torque
    estimate.measured_pitch = pitch_ratio


@compiled
def update_torque_losses(
    observer: Record, estimates: Any, shaft_speed: Any, shaft_torque: Any, pitch_ratio: Any
) -> None:
    """Update the estimates of n ships, shape (n,), by measurements of shape (n,) each."""
    for i in range(len(estimates)):
        update_torque_loss(observer, estimates[i], shaft_speed[i], shaft_torque[i], pitch_ratio[i])


_LEAST_NOMINAL = 0.05  # least ratio of nominal to bollard torque at which a loss is detectable [-]
DETECTION = np.dtype(
    [
        ("ventilating", np.int64),  # nu
        ("torque_ratio", np.float64),  # beta_Q-hat [-]
        ("since", np.float64),  # time since the last detection [s]
        ("excess_inflow", np.float64),  # inflow that explains the torque without air [m/s]
        ("sea_square", np.float64),  # mean square of the inflow of the sea [m2/s2]
        ("samples", np.float64),
    ],
    align=True,
)


@dataclass(frozen=True)
class VentilationDetector:
    """Tuning of the ventilation detector.

    The paper prints no values, and the last two are not in the paper. The blend is 0.85 at 2 rad/s and
    0.08 at 5 rad/s, the idle speed of the frigate. The thresholds lie below most of the torque ratios
    that the orbital motion of the waves causes.
    """

    blend_gain: float = 0.02  # k [(s/rad)^p]
    blend_power: float = 3.0  # p [-]
    on_below: float = 0.65  # beta_v,on [-]
    off_above: float = 0.70  # beta_v,off [-]
    hold_s: float = 1.0  # T_hold [s]
    sea_margin: float = 0.0  # standard deviations of the sea; 0 as in the paper, otherwise 3 [-]
    sea_memory_s: float = 120.0  # time constant of the mean inflow of the sea [s]

    def discretise(self, dt: float) -> Any:
        """Return the DETECTOR record for a sample time ``dt`` [s].

        Raises:
            ValueError: blend, sea memory or step is not positive, the thresholds are not in order, or
                hold time or sea margin is negative.
        """
        if not (self.blend_gain > 0.0 and self.blend_power > 0.0):
            raise ValueError("ventilation detector: k and p of the blend must be positive")
        if not 0.0 < self.on_below <= self.off_above < 1.0:
            raise ValueError(
                "ventilation detector: thresholds must satisfy 0 < beta_v,on <= beta_v,off < 1, "
                f"got {self.on_below:g} and {self.off_above:g}"
            )
        if not (self.hold_s >= 0.0 and dt > 0.0):
            raise ValueError("ventilation detector: hold time must be >= 0 s and time step > 0 s")
        if not (self.sea_margin >= 0.0 and self.sea_memory_s > 0.0):
            raise ValueError("ventilation detector: sea margin must be >= 0, sea memory > 0 s")
        return np.array((dt, *astuple(self)), DETECTOR)[()]


DETECTOR = np.dtype(
    [(name, np.float64) for name in ("dt", *(f.name for f in fields(VentilationDetector)))]
)
"""Sample time [s] and the tuning."""


@compiled
def torque_ratio(
    detector: Record, ship: Record, torque: float, omega: float, pitch: float, ship_speed: float
) -> float:
    """Return the torque reduction coefficient beta_Q-hat [-] (eqs. 23 to 26).

    It is 1 without a torque loss. It is also 1 if the nominal torque at the ship speed v_s [m/s] is too
    small to be compared with Q_p-hat [N m]. omega is in rad/s.
    """
    blend = math.exp(-detector.blend_gain * abs(omega) ** detector.blend_power)
    direction = direction_of(ship, omega)
    nominal = model_torque(ship, wake_inflow(ship, ship_speed), omega, pitch)
    bollard = bollard_gain(ship, pitch, direction) * omega * omega
    if not direction * nominal > _LEAST_NOMINAL * bollard:
        return 1.0
    return float(blend + (1.0 - blend) * torque / nominal)


@compiled
def excess_inflow(
    ship: Record, torque: float, omega: float, pitch: float, ship_speed: float
) -> float:
    """Return the inflow [m/s], less (1 - w) v_s in calm water, that explains Q_p-hat without air.

    It is positive if it reduces the torque, in both directions of rotation.
    """
    calm = wake_inflow(ship, ship_speed)
    velocity, _ = velocity_from_torque(ship, torque, omega, pitch, calm)
    return float(direction_of(ship, omega) * (velocity - calm))


@compiled
def update_detection(detector: Record, detection: Record, ratio: float, inflow: float) -> None:
    """Update the ventilation state nu by one sample; the DETECTION record is zero before the first.

    ``ratio`` is beta_Q-hat [-], ``inflow`` that of :func:`excess_inflow` [m/s].
    """
    detection.torque_ratio = ratio
    detection.excess_inflow = inflow
    detection.since += detector.dt
    limit = detector.sea_margin * math.sqrt(detection.sea_square)
    beyond = detector.sea_margin == 0.0 or inflow > limit
    # The mean covers all samples at first, and the memory later. Samples in which the torque increases
    # count twice, because air reduces the torque in the others.
    detection.samples += 1.0
    share = max(1.0 / detection.samples, min(detector.dt / detector.sea_memory_s, 1.0))
    gained = min(inflow, 0.0)
    detection.sea_square += share * (2.0 * gained * gained - detection.sea_square)
    if ratio < detector.on_below and beyond:
        if detection.ventilating == 0:
            detection.since = 0.0
        detection.ventilating = 1
    # The tolerance of half a step allows for rounding in the sum of dt.
    elif (ratio >= detector.off_above or not beyond) and (
        detection.since >= detector.hold_s - 0.5 * detector.dt
    ):
        detection.ventilating = 0
