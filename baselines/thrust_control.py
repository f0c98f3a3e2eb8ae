"""Thrust controller with torque-loss compensation and anti-spin (Pivano et al. 2008, section 4).

The paper is "A four-quadrant thrust controller for marine propellers with loss estimation and
anti-spin". The compiled thrust controller computes a torque set-point from a thrust set-point and does
not depend on the drive: :class:`~.anti_spin.AntiSpin` converts the torque to a fuel rack of a diesel,
and :class:`ThrustControl` commands the torque of an electric drive with a fixed pitch, as in the paper,
in both directions of rotation. The tuning is checked against the conditions of the paper.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..core.numeric import clip
from ..observers.records import Floats
from ..plant.propeller import advance_ratio_of, coefficients_along
from ..plant.shaft import shaft_inertia
from ..plant.ship import Ship
from ..plant.ship_files import load_ship
from . import ventilation
from .ventilation import TorqueLossObserver, VentilationDetector

THRUST_LAW = np.dtype(
    [
        ("observer", ventilation.TORQUE_LOSS_OBSERVER),
        ("detector", ventilation.DETECTOR),
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
    ("estimate", ventilation.TORQUE_LOSS),
    ("detection", ventilation.DETECTION),
    ("reference", np.float64),  # omega_d [rad/s]
    ("reference_rate", np.float64),  # [rad/s2]
    ("error_integral", np.float64),  # e1 [rad]
    ("shaft_torque", np.float64),  # Q_m, before the limits of the drive [N m]
]
"""Fields of a controller state; the controllers add their measurements."""


@compiled
def thrust_per_torque(law: Record, torque: float, shaft_speed: float, pitch: float) -> float:
    """Return G_QT(J-hat) = T / Q [1/m] at the advance ratio of the estimated torque (eq. 18).

    KT and KQ are those of the curves of the ship in the direction of rotation. J-hat is limited to the
    range from 0 (zone 1 of the paper, where KQ cannot be inverted) to the end of the usual working
    range. Beyond it the thrust and G_QT go to zero, and the desired torque would grow without bound.
    """
    ship = law.observer.ship
    direction = ventilation.direction_of(ship, shaft_speed)
    highest = law.highest_advance[0 if direction > 0.0 else 1] * pitch
    bollard = ventilation.bollard_gain(ship, pitch, direction) * shaft_speed * shaft_speed
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
    """Return the shaft speed [rad/s] for a thrust [N] with the estimated torque loss (eqs. 17, 19)."""
    ship = law.observer.ship
    torque = ventilation.estimated_propeller_torque(ship, estimate)
    wanted = thrust / thrust_per_torque(law, torque, estimate.shaft_speed, pitch)
    beyond = wanted - estimate.torque_loss
    gain = ventilation.bollard_gain(ship, pitch, ventilation.direction_of(ship, beyond))
    speed = math.copysign(math.sqrt(abs(beyond) / gain), beyond)
    return float(min(max(speed, law.speed_min), law.speed_max))


class Instant(NamedTuple):
    """Set-point, limits and measurements of the thrust controller at one instant."""

    thrust: float  # T_pd, thrust set-point of one propeller [N]
    ventilated_ahead: float  # omega_v,opt, limit of the shaft speed in ventilation [rad/s]
    ventilated_astern: float  # the limit astern, positive [rad/s]
    shaft_speed: float  # omega, measured [rad/s]
    shaft_torque: float  # Q_m at the place where the torque is known [N m]
    pitch: float  # P/D [-]
    ship_speed: float  # v_s, measured [m/s]


@compiled
def torque_demand(law: Record, memory: Record, now: Instant) -> float:
    """Return the torque set-point Q_m [N m] of a THRUST_LAW; the memory changes in place."""
    ship, shaft_speed, pitch = law.observer.ship, now.shaft_speed, now.pitch
    estimate, detection = memory.estimate, memory.detection
    ventilation.update_torque_loss(law.observer, estimate, shaft_speed, now.shaft_torque, pitch)
    torque = ventilation.estimated_propeller_torque(ship, estimate)
    ratio = ventilation.torque_ratio(law.detector, ship, torque, shaft_speed, pitch, now.ship_speed)
    inflow = ventilation.excess_inflow(ship, torque, shaft_speed, pitch, now.ship_speed)
    ventilation.update_detection(law.detector, detection, ratio, inflow)

    wanted = desired_speed(law, estimate, now.thrust, pitch)
    if law.anti_spin != 0 and detection.ventilating != 0:
        # The limit acts before the filter, so that its output and the feed-forward are smooth.
        wanted = float(clip(wanted, -now.ventilated_astern, now.ventilated_ahead))
    if memory.started == 0:
        memory.reference = shaft_speed  # start in steady state
        memory.started = 1
    else:
        away, rate = memory.reference - wanted, memory.reference_rate
        turn = law.filter
        memory.reference = wanted + turn[0, 0] * away + turn[0, 1] * rate
        memory.reference_rate = turn[1, 0] * away + turn[1, 1] * rate

    # Eq. 21.
    reference, e1, gamma = memory.reference, memory.error_integral, law.gamma
    e2 = shaft_speed - reference
    demand = law.inertia * memory.reference_rate + estimate.torque_loss
    demand += ventilation.shaft_load(law.observer, pitch, reference - gamma * e1)
    demand += law.observer.viscous * reference
    demand -= (law.integral + gamma * law.proportional) * e1
    demand -= law.proportional * e2
    memory.shaft_torque = demand
    return float(demand)


@compiled
def integrate_error(
    law: Record, memory: Record, shaft_speed: float, starved: bool, closed: bool
) -> None:
    """Integrate the error e1 over an interval, unless it acts further against a limit of the drive.

    The drive is ``starved`` at its highest torque and ``closed`` at its lowest.
    """
    e2 = shaft_speed - memory.reference
    if not ((starved and e2 < 0.0) or (closed and e2 > 0.0)):
        memory.error_integral += law.observer.dt * e2


def check_gains(
    gamma: float, proportional: float, integral: float, inertia: float, viscous: float
) -> None:
    """Refuse gains (eq. 21) that are not finite or violate the conditions B1 to B3 of the paper.

    They are gamma [1/s], k_P [N m s/rad] and k_I [N m/rad], on a shaft line of the inertia J_m [kg m2]
    and the viscous friction k_f2 [N m s/rad].
    """
    if not all(map(math.isfinite, (gamma, proportional, integral))):
        raise ValueError("thrust control: every gain must be a finite number")
    if not gamma > 0.0:
        raise ValueError(
            f"thrust control: condition B1 is violated: gamma = {gamma:g} 1/s must be > 0"
        )
    least = max(0.0, gamma * inertia - viscous)
    if not proportional > least:
        raise ValueError(
            f"thrust control: condition B2 is violated: k_P = {proportional:g} N m s/rad must exceed "
            f"{least:g}, the larger of 0 and gamma J_m - k_f2"
        )
    least = max(0.0, -inertia * gamma * gamma + gamma * viscous)
    if not integral > least:
        raise ValueError(
            f"thrust control: condition B3 is violated: k_I = {integral:g} N m/rad must exceed "
            f"{least:g}, the larger of 0 and -J_m gamma^2 + gamma k_f2"
        )


def _thrust_ends(ship: Ship) -> tuple[float, float]:
    """Return J over P/D [-] of zero thrust, ahead and astern; 1 is close enough for the B-series."""
    if ship.propeller.model != "four-quadrant":
        return 1.0, 1.0
    plant, pitch = ship.record(), ship.propeller.pitch_ratio_max

    def thrust(j: float, direction: float) -> float:
        return float(coefficients_along(plant, j, pitch, direction)[0])

    ahead, astern = (scipy.optimize.brentq(thrust, 0.0, 3.0, args=(way,)) for way in (1.0, -1.0))
    return ahead / pitch, astern / pitch


@dataclass(frozen=True)
class ThrustLaw:
    """Parameters of the thrust controller; the paper prints none of them.

    The defaults are those of the diesel frigate at a control interval of 0.5 s.
    """

    gamma: float = 0.1  # [1/s]
    proportional_rate: float = 0.6  # k_P / J_m [1/s]
    integral_rate: float = 0.05  # k_I / J_m [1/s2]
    cutoff_rad_s: float = 1.5  # omega_c of the reference filter [rad/s]
    damping: float = 1.0  # xi of the reference filter [-]
    highest_advance: float = 0.9  # highest J-hat in G_QT over J of zero thrust [-]
    observer: TorqueLossObserver = field(default_factory=TorqueLossObserver)  # of the torque loss
    detector: VentilationDetector = field(default_factory=VentilationDetector)  # of ventilation

    def with_values(self, numbers: dict[str, float]) -> Self:
        """Return a tuning with other values, its own or those of its observer and detector, by name.

        Raises:
            TypeError: the tuning has no value of that name.
        """
        rest, parts = dict(numbers), {}
        for name in ("observer", "detector"):
            part = getattr(self, name)
            own = {f.name: rest.pop(f.name) for f in fields(part) if f.name in rest}
            parts[name] = replace(part, **own)
        return replace(self, **parts, **rest)  # type: ignore[arg-type]

    def settings(
        self, ship: Ship, interval_s: float, anti_spin: bool, speeds: tuple[float, float]
    ) -> Any:
        """Return the THRUST_LAW record, with the lowest and highest desired shaft speed [rad/s].

        Raises:
            ValueError: the tuning violates a condition of the paper.
        """
        if not (self.cutoff_rad_s > 0.0 and self.damping > 0.0):
            raise ValueError(
                f"thrust control: cutoff_rad_s = {self.cutoff_rad_s:g} and damping = {self.damping:g} "
                "must be above 0"
            )
        observer = self.observer.discretise(ship, interval_s)
        detector = self.detector.discretise(interval_s)
        inertia = float(shaft_inertia(ship.record()))
        gains = (self.gamma, self.proportional_rate * inertia, self.integral_rate * inertia)
        check_gains(*gains, inertia, float(observer["viscous"]))
        highest = self.highest_advance * np.array(_thrust_ends(ship))
        # Eq. 20, exact for a constant input over the step.
        cutoff = self.cutoff_rad_s
        turn = scipy.linalg.expm(
            interval_s * np.array([[0.0, 1.0], [-(cutoff**2), -2.0 * cutoff * self.damping]])
        )
        values = (observer, detector, anti_spin, inertia, *gains, highest, *speeds, turn)
        return np.array(values, THRUST_LAW)[()]


THRUST_CONTROL = np.dtype(
    [
        ("law", THRUST_LAW),
        ("ventilated_ahead", np.float64),  # omega_v,opt [rad/s]
        ("ventilated_astern", np.float64),  # of a shaft that turns astern, positive [rad/s]
        ("pitch_ratio", np.float64),  # [-]
    ],
    align=True,
)

THRUST_CONTROL_MEMORY = np.dtype(
    [
        *THRUST_LAW_MEMORY,
        ("command", np.float64),  # last torque command [N m]
        ("shaft_speed", np.float64),  # last finite measurements [rad/s]
        ("water_speed", np.float64),  # [m/s]
    ],
    align=True,
)

_RIG_OBSERVER = TorqueLossObserver(40.0, -400.0, 10.0)
_RIG_DETECTOR = VentilationDetector(0.02, 1.5, 0.6, 0.8, 0.8)


@dataclass(frozen=True)
class ThrustControlTuning(ThrustLaw):
    """Parameters of the thrust controller for a rig with a propeller of 0.25 m.

    The limits of the shaft speed are those of the paper, which prints no other values.
    """

    gamma: float = 0.5
    proportional_rate: float = 10.0
    integral_rate: float = 10.0
    cutoff_rad_s: float = 20.0
    observer: TorqueLossObserver = _RIG_OBSERVER
    detector: VentilationDetector = _RIG_DETECTOR
    ventilated_ahead_rad_s: float = 45.0  # omega_v,opt; printed
    ventilated_astern_rad_s: float = 54.0  # printed
    top_speed_rad_s: float = 75.0  # highest desired shaft speed, either way; printed


@compiled
def command_torque(
    controller: Record, memory: Record, thrust: float, shaft_speed: float, water_speed: float
) -> float:
    """Return the torque command [N m] of one drive at one instant; the memory changes in place.

    The thrust set-point T_pd [N] is negative astern; omega is in rad/s and the speed of ship or carriage
    through the water in m/s.
    """
    law = controller.law
    ship = law.observer.ship
    if np.isfinite(shaft_speed):
        memory.shaft_speed = shaft_speed
    if np.isfinite(water_speed):
        memory.water_speed = water_speed
    shaft_speed = memory.shaft_speed
    through = ship.gear_ratio * ship.transmission_efficiency
    ahead, astern = controller.ventilated_ahead, controller.ventilated_astern
    torque, pitch, water = through * memory.command, controller.pitch_ratio, memory.water_speed
    now = Instant(thrust, ahead, astern, shaft_speed, torque, pitch, water)
    demand = torque_demand(law, memory, now)
    command = float(clip(demand / through, ship.drive_min, ship.drive_max))
    integrate_error(law, memory, shaft_speed, command >= ship.drive_max, command <= ship.drive_min)
    memory.command = command
    # The drive has no lag, so the observer integrates from here on with this torque.
    memory.estimate.measured_torque = through * command
    return command


@compiled
def _command_all(controller: Record, memories: Any, thrust: Any, speed: Any, water: Any) -> Floats:
    found = np.empty(len(memories))
    for i in range(len(memories)):
        found[i] = command_torque(controller, memories[i], thrust[i], speed[i], water[i])
    return found


class ThrustControl:
    """Hold a thrust by the torque of an electric drive, and limit the shaft speed in ventilation.

    The controller measures the shaft speed and the speed through the water; the torque is the last
    command. A measurement that is not finite is replaced by the last finite one.

    Args:
        ship: ship or rig with a torque-controlled drive and a fixed pitch, or its name. With
            four-quadrant curves the shaft turns in both directions, otherwise ahead only.
        interval_s: control interval [s]; the time step of the ship by default.
        anti_spin: whether ventilation limits the shaft speed; False for the comparison in the paper.
        tuning: gains and thresholds.
        numbers: values of the tuning, its observer or its detector by name, for example
            ``ventilated_ahead_rad_s=40.0``.

    Raises:
        TypeError: the tuning has no value of that name.
        ValueError: the drive is of another kind, the pitch is controllable, or the tuning violates a
            condition of the paper.

    Example:
        >>> controller = ThrustControl("towing-tank")
        >>> memory = controller.initial_state()
        >>> torque = controller.act(80.0, shaft_speed=45.0, water_speed=0.6, memory=memory)
        >>> torque.shape
        (1,)
    """

    source = "Pivano et al. 2008"

    def __init__(
        self,
        ship: str | Ship = "towing-tank",
        interval_s: float | None = None,
        *,
        anti_spin: bool = True,
        tuning: ThrustControlTuning | None = None,
        **numbers: float,
    ) -> None:
        self.ship = load_ship(ship)
        self.interval_s = self.ship.time_step_s if interval_s is None else interval_s
        tuning = (ThrustControlTuning() if tuning is None else tuning).with_values(numbers)
        propeller = self.ship.propeller
        if not (self.ship.prime_mover.gives_torque and self.ship.has_propeller):
            raise ValueError(
                f"{self.ship.name}: thrust control needs a propeller and a torque-controlled drive "
                f"(prime_mover.type 'torque-command'), not {self.ship.prime_mover.type!r}"
            )
        if propeller.pitch_ratio_min != propeller.pitch_ratio_max:
            raise ValueError(
                f"{self.ship.name}: thrust control needs a fixed pitch: propeller.pitch_ratio_min must "
                "equal pitch_ratio_max"
            )
        ahead, astern = tuning.ventilated_ahead_rad_s, tuning.ventilated_astern_rad_s
        top = tuning.top_speed_rad_s
        if not min(ahead, astern, top) > 0.0:
            raise ValueError(
                "thrust control: ventilated_ahead_rad_s, ventilated_astern_rad_s and top_speed_rad_s "
                "must be positive"
            )
        lowest = -top if propeller.model == "four-quadrant" else 0.0
        law = tuning.settings(self.ship, self.interval_s, anti_spin, (lowest, top))
        values = (law, ahead, astern, propeller.pitch_ratio_max)
        self.tuning, self.settings = tuning, np.array(values, THRUST_CONTROL)[()]

    def initial_state(self, ships: int = 1) -> NDArray[Any]:
        """Return the initial controller state of a number of propellers, shape (ships,)."""
        return np.zeros(ships, THRUST_CONTROL_MEMORY)

    def act(self, thrust: Any, shaft_speed: Any, water_speed: Any, memory: NDArray[Any]) -> Floats:
        """Return the torque commands of the drives [N m], shape (n,).

        Args:
            thrust: thrust set-point [N], shape (n,) or one value for all.
            shaft_speed: omega, measured [rad/s], shape (n,) or one value for all.
            water_speed: speed of ship or carriage through the water [m/s], shape (n,) or one value.
            memory: controller state of :meth:`initial_state`, shape (n,); changed in place.

        Raises:
            ValueError: a set-point is not finite.
        """
        order, turned, water = (
            np.array(np.broadcast_to(np.asarray(x, np.float64), memory.shape), order="C")
            for x in (thrust, shaft_speed, water_speed)
        )
        if not np.all(np.isfinite(order)):
            raise ValueError("thrust control: the thrust set-point [N] must be finite")
        return _command_all(self.settings, memory, order, turned, water)
