"""Observer of the torque that a propeller loses against bollard pull (Pivano et al. 2008, section 3).

The paper ("A four-quadrant thrust controller for marine propellers with loss estimation and
anti-spin", eqs. 1 to 13) puts a fixed-pitch propeller behind an electric motor whose torque is known.
The known torque is the shaft gauge's where there is one, so that the inertia is what turns behind the
gauge alone; else, as in the paper, it is the torque of an electric drive, which has the whole line and
its friction to bear. The propeller's torque at zero advance follows the measured pitch.

Detection of ventilation from the torque that is missing (Pivano et al. 2008, section 4.2).

The estimated propeller torque over the nominal one at the ship's speed is the torque reduction
coefficient beta_Q; ventilation is called below one threshold and called off above another.

Waves take torque too. Their orbital motion, though, adds to the inflow as often as it takes from it,
whereas air only takes torque. So the side on which torque is gained tells the sea's own share, and an
option beyond the paper (``sea_margin``) calls ventilation only where the loss is more than that: the
inflow at which a propeller without air would take the estimated torque must exceed the calm one by
some standard deviations of the sea's, a threshold of constant false-alarm rate as in a radar.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.compiled import Record, compiled
from ..observers.torque_curve import believed, model_torque, read_at_drive, velocity_from_torque
from ..plant.hull import wake_inflow
from ..plant.propeller import FOUR_QUADRANT
from ..plant.record import PLANT
from ..plant.shaft import arctangent_friction, by_direction, friction_torque, inertia_behind_gauge
from ..plant.ship import Ship

TORQUE_LOSS_OBSERVER = np.dtype(
    [
        ("dt", np.float64),  # [s]
        ("whole_line", np.int64),  # whether the torque is the drive's, for want of a gauge
        ("inertia", np.float64),  # J_m, behind the place where the torque is known [kg m2]
        ("viscous", np.float64),  # k_f2 there [N m s/rad]
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
        ("speed_reading", np.float64),  # of the last sample
        ("torque_reading", np.float64),
        ("pitch_reading", np.float64),
    ],
    align=True,
)


def observer_weights(
    speed_gain: float, loss_gain: float, time_constant: float, inertia: float, viscous: float
) -> tuple[float, float]:
    """Weights a11, a22 > 0 of the Lyapunov function that satisfy the paper's condition A2.

    With r = a11 / (J a22), A2 reads |r + l2| < 2 sqrt(r c), c = (k_f2 + l1) / tau. For l2 < 0 the
    left side vanishes at r = -l2. For l2 >= 0, r - 2 sqrt(c r) + l2 < 0 is easiest at r = c, where it
    says l2 < c: then and only then weights exist.

    Args:
        speed_gain: l1 [N m s/rad].
        loss_gain: l2 [N m/rad].
        time_constant: tau [s].
        inertia: J_m [kg m2].
        viscous: k_f2 [N m s/rad].

    Returns:
        a11 and a22 = 1; only their ratio matters.

    Raises:
        ValueError: a gain is not finite, tau or J is not positive, or A1 or A2 is violated; the
            message names the condition.
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
    """Tuning of the observer, per inertia, so that it carries over from ship to ship.

    The paper prints no gains. Ours place the poles of shaft and loss at -4 and -8 rad/s where the
    propeller gives no damping; it adds some. Faster ones gain little on readings 0.5 s apart. The time
    constant is long because in a steady state the estimate is tau |l2| / (tau |l2| + l1 + slope of psi)
    of the loss.
    """

    speed_rate: float = 12.0  # l1 / J [1/s]
    loss_rate: float = -32.0  # l2 / J [1/s2]
    time_constant_s: float = 500.0  # tau [s]

    def discretise(self, ship: Ship, dt: float) -> Any:
        """TORQUE_LOSS_OBSERVER record for a time step ``dt`` [s].

        Raises:
            ValueError: the step is not positive, or the gains violate A1 or A2.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f"torque-loss observer: time step {dt} s must be positive")
        plant = believed(ship)
        record = np.zeros(1, TORQUE_LOSS_OBSERVER)[0]
        inertia = inertia_behind_gauge(plant)
        record["dt"] = dt
        record["whole_line"] = read_at_drive(ship)
        record["inertia"] = inertia
        record["viscous"] = plant["viscous_propeller_side"]
        if read_at_drive(ship):
            record["viscous"] += plant["viscous_engine_side"]
        record["speed_gain"] = self.speed_rate * inertia
        record["loss_gain"] = self.loss_rate * inertia
        record["time_constant"] = self.time_constant_s
        record["ship"] = plant
        observer_weights(
            float(record["speed_gain"]),
            float(record["loss_gain"]),
            self.time_constant_s,
            inertia,
            float(record["viscous"]),
        )
        return record


@compiled
def direction_of(ship: Record, shaft_speed: float) -> float:
    """Direction of rotation by a shaft speed or torque: 1 ahead; -1 astern in four quadrants alone."""
    return -1.0 if shaft_speed < 0.0 and ship.propeller_model == FOUR_QUADRANT else 1.0


@compiled
def bollard_gain(ship: Record, pitch_ratio: float, direction: float = 1.0) -> float:
    """G_Q [N m s2/rad2] of the torque G_Q omega |omega| at zero advance speed (eqs. 3, 7 and 16).

    G_Qp ahead and G_Qn astern; one value for both where the ship has no curves of a shaft astern.
    """
    return direction * model_torque(ship, 0.0, direction, pitch_ratio)


@compiled
def dry_friction(observer: Record, shaft_speed: float) -> float:
    """Friction [N m] beside the viscous one, behind the place where the torque is known (eq. 2).

    Coulomb friction is the plant's tanh instead of the paper's arc tangent; both are monotone.
    """
    ship = observer.ship
    torque = friction_torque(ship, ship.coulomb_propeller_side, 0.0, shaft_speed)
    if observer.whole_line != 0:
        coulomb = by_direction(ship.coulomb_engine_side, ship.coulomb_asymmetry, shaft_speed)
        torque += friction_torque(ship, coulomb, 0.0, shaft_speed)
        torque += arctangent_friction(ship, shaft_speed)
    return float(torque)


@compiled
def shaft_load(observer: Record, pitch_ratio: float, shaft_speed: float) -> float:
    """Psi [N m]: propeller torque without losses plus dry friction (eq. 6).

    Args:
        observer: TORQUE_LOSS_OBSERVER record.
        pitch_ratio: P/D [-].
        shaft_speed: omega [rad/s].
    """
    gain = bollard_gain(observer.ship, pitch_ratio, direction_of(observer.ship, shaft_speed))
    return gain * abs(shaft_speed) * shaft_speed + dry_friction(observer, shaft_speed)


@compiled
def estimated_propeller_torque(ship: Record, estimate: Record) -> float:
    """Propeller torque Q_p-hat [N m] from the two estimates (eq. 13)."""
    omega = estimate.shaft_speed
    gain = bollard_gain(ship, estimate.pitch_reading, direction_of(ship, omega))
    return float(gain * abs(omega) * omega + estimate.torque_loss)


@compiled
def update_torque_loss(
    observer: Record, estimate: Record, shaft_speed: float, shaft_torque: float, pitch_ratio: float
) -> None:
    """Bring the estimate to this sample (eqs. 8 to 10); it changes in place.

    Args:
        observer: TORQUE_LOSS_OBSERVER record.
        estimate: TORQUE_LOSS record, all zeros before the first sample.
        shaft_speed: omega, measured [rad/s].
        shaft_torque: Q_m at the gauge, or of the drive and at the propeller shaft [N m].
        pitch_ratio: P/D, measured [-].

    Trapezoidal rule, implicit in both estimates: an explicit one is unstable at 0.5 s. The loss enters
    linearly and is eliminated; what is left, B omega + A |omega| omega = R with A >= 0 and (under A1
    and A2) B > 1, has one root, in closed form. Dry friction is taken at the measured speed.
    """
    ship = observer.ship
    viscous = observer.viscous
    l1, l2 = observer.speed_gain, observer.loss_gain
    friction = dry_friction(observer, shaft_speed)
    if estimate.started == 0:
        # as if this sample had stood for ever
        estimate.shaft_speed = shaft_speed
        load = shaft_load(observer, pitch_ratio, shaft_speed) + viscous * shaft_speed
        estimate.torque_loss = shaft_torque - load
    else:
        half = 0.5 * observer.dt
        share = half / observer.inertia
        omega, loss = estimate.shaft_speed, estimate.torque_loss
        error = estimate.speed_reading - omega
        gain = bollard_gain(ship, estimate.pitch_reading, direction_of(ship, omega))
        friction_before = dry_friction(observer, estimate.speed_reading)
        before = estimate.torque_reading - gain * abs(omega) * omega - friction_before
        before = before - viscous * omega - loss
        before += l1 * error
        # Delta_q+ = loss_free - follow omega+
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
    estimate.speed_reading = shaft_speed
    estimate.torque_reading = shaft_torque
    estimate.pitch_reading = pitch_ratio


@compiled
def update_torque_losses(
    observer: Record, estimates: Any, shaft_speed: Any, shaft_torque: Any, pitch_ratio: Any
) -> None:
    """The same for n ships: estimates of shape (n,), readings of shape (n,) each."""
    for i in range(len(estimates)):
        update_torque_loss(observer, estimates[i], shaft_speed[i], shaft_torque[i], pitch_ratio[i])


_LEAST_NOMINAL = 0.05
"""Share of the bollard torque below which the nominal torque says nothing: the propeller idles."""

DETECTOR = np.dtype(
    [
        ("dt", np.float64),  # [s]
        ("blend_gain", np.float64),  # k
        ("blend_power", np.float64),  # p
        ("on_below", np.float64),  # beta_v,on
        ("off_above", np.float64),  # beta_v,off
        ("hold", np.float64),  # T_hold [s]
        ("sea_margin", np.float64),  # 0: the paper's detection
        ("sea_memory", np.float64),  # [s]
    ],
    align=True,
)

DETECTION = np.dtype(
    [
        ("ventilating", np.int64),  # nu
        ("torque_ratio", np.float64),  # beta_Q-hat [-]
        ("since", np.float64),  # time since the last detection [s]
        ("excess_inflow", np.float64),  # that would explain the torque without air [m/s]
        ("sea_square", np.float64),  # mean square of the sea's inflow [m2/s2]
        ("samples", np.float64),
    ],
    align=True,
)


@dataclass(frozen=True)
class VentilationDetector:
    """Tuning of the detector.

    The paper prints none of these, and does not know the last two. The blend gives 0.85 at 2 rad/s
    and 0.08 at 5 rad/s, the frigate's idle speed. The thresholds lie below most of what the waves'
    orbital motion alone takes from the torque.
    """

    blend_gain: float = 0.02  # k [(s/rad)^p]
    blend_power: float = 3.0  # p [-]
    on_below: float = 0.65  # beta_v,on [-]
    off_above: float = 0.70  # beta_v,off [-]
    hold_s: float = 1.0  # T_hold [s]
    sea_margin: float = (
        0.0  # standard deviations of the sea's inflow; 0 as in the paper, else 3 [-]
    )
    sea_memory_s: float = 120.0  # over which the sea's inflow is averaged [s]

    def discretise(self, dt: float) -> Any:
        """DETECTOR record for a time step ``dt`` [s].

        Raises:
            ValueError: the blend or the sea's memory is not positive, the thresholds are not in
                order, or the hold time, sea margin or step is negative.
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
        record = np.zeros(1, DETECTOR)[0]
        record["dt"] = dt
        for name in ("blend_gain", "blend_power", "on_below", "off_above", "sea_margin"):
            record[name] = getattr(self, name)
        record["hold"], record["sea_memory"] = self.hold_s, self.sea_memory_s
        return record


@compiled
def torque_ratio(
    detector: Record,
    ship: Record,
    propeller_torque: float,
    shaft_speed: float,
    pitch_ratio: float,
    ship_speed: float,
) -> float:
    """Torque reduction coefficient beta_Q-hat [-] (eqs. 23 to 26).

    Args:
        detector: DETECTOR record.
        ship: PLANT record of the ship as believed.
        propeller_torque: Q_p-hat [N m].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        ship_speed: v_s [m/s]; the nominal advance velocity is (1 - w) v_s.

    Returns:
        1 where nothing is missing; also 1 where the nominal torque is too small to compare with.
    """
    blend = math.exp(-detector.blend_gain * abs(shaft_speed) ** detector.blend_power)
    direction = direction_of(ship, shaft_speed)
    nominal = model_torque(ship, wake_inflow(ship, ship_speed), shaft_speed, pitch_ratio)
    bollard = bollard_gain(ship, pitch_ratio, direction) * shaft_speed * shaft_speed
    if not direction * nominal > _LEAST_NOMINAL * bollard:
        return 1.0
    return float(blend + (1.0 - blend) * propeller_torque / nominal)


@compiled
def excess_inflow(
    ship: Record, propeller_torque: float, shaft_speed: float, pitch_ratio: float, ship_speed: float
) -> float:
    """Inflow beyond the calm one (1 - w) v_s [m/s] that would explain a torque without air.

    Positive where it takes torque: of a shaft that turns astern, as the flow goes astern.

    Args:
        ship: PLANT record of the ship as believed.
        propeller_torque: Q_p-hat [N m].
        shaft_speed: omega [rad/s].
        pitch_ratio: P/D [-].
        ship_speed: v_s [m/s].
    """
    calm = wake_inflow(ship, ship_speed)
    told, _ = velocity_from_torque(ship, propeller_torque, shaft_speed, pitch_ratio, calm)
    return float(direction_of(ship, shaft_speed) * (told - calm))


@compiled
def update_detection(detector: Record, detection: Record, ratio: float, inflow: float) -> None:
    """Bring the ventilation state nu to this sample; it changes in place.

    Args:
        detector: DETECTOR record.
        detection: DETECTION record, all zeros at first.
        ratio: beta_Q-hat [-].
        inflow: from :func:`excess_inflow` [m/s].
    """
    detection.torque_ratio = ratio
    detection.excess_inflow = inflow
    detection.since += detector.dt
    limit = detector.sea_margin * math.sqrt(detection.sea_square)
    beyond = detector.sea_margin == 0.0 or inflow > limit
    # a mean over all samples at first, later over the memory; twice the half that gains torque
    detection.samples += 1.0
    share = max(1.0 / detection.samples, min(detector.dt / detector.sea_memory, 1.0))
    gained = min(inflow, 0.0)
    detection.sea_square += share * (2.0 * gained * gained - detection.sea_square)
    if ratio < detector.on_below and beyond:
        if detection.ventilating == 0:
            detection.since = 0.0
        detection.ventilating = 1
    # half a step of slack: sums of dt are not exact
    elif (ratio >= detector.off_above or not beyond) and (
        detection.since >= detector.hold - 0.5 * detector.dt
    ):
        detection.ventilating = 0
