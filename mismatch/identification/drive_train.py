"""Drive train of a motor, a shaft and a propeller at bollard pull: six parameters and the linear model.

Vrijdag & Martelli, "Parameter Identification of a Model Scale Ship Drive Train", 2021: all parameters at
the motor's shaft, deviations normalised by a working point. A ship file has inertia and friction at the
propeller shaft; the gear ratio converts between the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...plant.drives import DRIVES
from ...plant.propeller import propeller_load
from ...plant.shaft import shaft_inertia
from ...plant.ship import Ship
from .free_parameters import Free

SIX = next(drive for drive in DRIVES if drive.demand.unit == "V").response_keys
"""Keys of the paper's six parameters, in the order of its Table 5."""

INDUCTANCE, CONSTANT, RESISTANCE, INERTIA, FRICTION, LOAD = SIX


@dataclass(frozen=True)
class WorkingPoint:
    """A steady state of the motor.

    Args:
        voltage: U_0 [V].
        motor_speed: omega_0 [rad/s], of the motor.
        current: i_0 [A].
    """

    voltage: float
    motor_speed: float
    current: float


@dataclass(frozen=True)
class DriveTrain:
    """Parameters of eq. 7, at the motor's shaft.

    Args:
        inductance: L_a [H].
        constant: K_e [V s/rad = N m/A].
        resistance: R_a [ohm].
        inertia: I_p [kg m2].
        friction: M_f [N m].
        load: propeller's torque at the motor by the motor's speed squared [N m s2/rad2]: c / omega^2
            of eq. 24, times KQ / eta_R.
        viscous: torque by speed [N m s/rad]; the paper has none.
    """

    inductance: float
    constant: float
    resistance: float
    inertia: float
    friction: float
    load: float
    viscous: float = 0.0

    def equilibrium(self, voltage: float) -> WorkingPoint:
        """Return the steady state ahead at a voltage [V] (eq. 22).

        Raises:
            ValueError: the voltage does not overcome the friction.
        """
        slope = self.constant**2 / self.resistance + self.viscous
        start = self.constant * voltage / self.resistance - self.friction
        if start <= 0.0:
            raise ValueError(f"{voltage:g} V does not overcome a friction of {self.friction:g} N m")
        speed = 2.0 * start / (slope + math.sqrt(slope**2 + 4.0 * self.load * start))
        torque = self.friction + (self.viscous + self.load * speed) * speed
        current = torque / self.constant
        return WorkingPoint(self.constant * speed + self.resistance * current, speed, current)

    def linear(self, point: WorkingPoint) -> LinearDrive:
        """Return the normalised linear model about a working point (eqs. 8 to 10).

        Args:
            point: working point of this drive train, or a measured one, at which its balances need not
                close.
        """
        torque = self.constant * point.current
        resistive = self.resistance * point.current
        linear = self.viscous * point.motor_speed
        quadratic = torque - self.friction - linear  # eta_trm K_e i_0, as in eq. 10
        return LinearDrive(
            electric_s=self.inductance / self.resistance,
            mechanical_s=self.inertia * point.motor_speed / torque,
            damping=(2.0 * quadratic + linear) / torque,
            drive=point.voltage / resistive,
            back=self.constant * point.motor_speed / resistive,
        )


@dataclass(frozen=True)
class LinearDrive:
    """Normalised linear drive train (eqs. 8 and 9).

    Args:
        electric_s: tau_em = L_a / R_a [s].
        mechanical_s: tau_omega = I_p omega_0 / (K_e i_0) [s].
        damping: 2 eta_trm [-]: relative change of the load's torque by that of the speed.
        drive: U_0 / (R_a i_0) [-].
        back: K_e omega_0 / (R_a i_0) [-].
    """

    electric_s: float
    mechanical_s: float
    damping: float
    drive: float
    back: float

    @property
    def effective_s(self) -> float:
        """Effective mechanical time constant tau_omega,e [s] (eq. A26)."""
        return self.mechanical_s / self.damping

    @property
    def c(self) -> float:
        """Constant C [-] of the characteristic equation (eq. A32)."""
        return 1.0 + self.back / self.damping

    @property
    def poles(self) -> tuple[complex, complex]:
        """Exact poles s_1 (fast) and s_2 [rad/s] (eq. A31); s_1 is at infinity without inductance."""
        if self.electric_s == 0.0:
            return complex(-math.inf), complex(-self.c / self.effective_s)
        product, total = self.electric_s * self.effective_s, self.electric_s + self.effective_s
        root = np.sqrt(complex(total**2 - 4.0 * product * self.c))
        fast = -(total + root) / (2.0 * product)
        return complex(fast), complex(self.c / (product * fast))

    @property
    def zero(self) -> float:
        """Zero z_1 [rad/s] of the current's response (eq. A35)."""
        return -1.0 / self.effective_s

    @property
    def speed_gain(self) -> float:
        """Steady gain from voltage to speed, both relative [-] (eq. A36)."""
        return self.drive / (self.damping + self.back)

    @property
    def current_gain(self) -> float:
        """Steady gain from voltage to current, both relative [-] (eq. A37)."""
        return self.damping * self.speed_gain


def from_poles(
    fast: float,
    slow: float,
    zero: float,
    speed_gain: float,
    current_gain: float,
    point: WorkingPoint,
    viscous: float = 0.0,
) -> DriveTrain:
    """Return the six parameters from poles, zero and gains of a Bode plot and the working point.

    The paper prints only the result of this closed form, Table 5's column IV. The equations follow from
    eqs. A26 and A32 to A37 with U_0 = K_e omega_0 + R_a i_0 as the sixth equation.

    Args:
        fast: pole s_1 [rad/s], negative like the others.
        slow: pole s_2 [rad/s].
        zero: zero z_1 [rad/s].
        speed_gain: steady relative gain [-] from voltage to speed.
        current_gain: steady relative gain [-] from voltage to current.
        point: working point.
        viscous: known viscous friction [N m s/rad], which is not identifiable from a single point.

    Raises:
        ValueError: a pole or zero that is not negative, a gain that is not positive.
    """
    if max(fast, slow, zero) >= 0.0 or min(speed_gain, current_gain) <= 0.0:
        raise ValueError("a drive train has negative poles and zero, and positive steady gains")
    damping = current_gain / speed_gain
    c = slow / zero
    resistive = point.voltage / (1.0 + (c - 1.0) * damping)
    resistance = resistive / point.current
    constant = (point.voltage - resistive) / point.motor_speed
    torque = constant * point.current
    linear = viscous * point.motor_speed
    load = 0.5 * (damping * torque - linear)
    return DriveTrain(
        inductance=-resistance / fast,
        constant=constant,
        resistance=resistance,
        inertia=-damping / zero * torque / point.motor_speed,
        friction=torque - linear - load,
        load=load / point.motor_speed**2,
        viscous=viscous,
    )


def needs_drive_train(ship: Ship, method: str) -> None:
    """Raise a ValueError for a ship that is no direct-current motor with a propeller at bollard pull."""
    if not ship.has_voltage:
        raise ValueError(
            f"{method}: {ship.name} needs a motor with a voltage and has a drive of type "
            f"{ship.prime_mover.type!r}"
        )
    if ship.moves:
        raise ValueError(
            f"{method}: {ship.name} moves; the model of the drive train needs hull.fixed = true"
        )


def torque_factor(ship: Ship) -> float:
    """Return the torque at the propeller shaft [N m] per torque at the motor [N m]."""
    return ship.transmission.gear_ratio * ship.transmission.efficiency


def drive_train(ship: Ship) -> DriveTrain:
    """Return the six parameters of a ship, referred to the motor's shaft.

    Raises:
        ValueError: the ship has no direct-current motor, or a moving hull.
    """
    needs_drive_train(ship, "drive train")
    line, screw, plant = ship.transmission, ship.propeller, ship.record()
    ratio, factor = line.gear_ratio, torque_factor(ship)
    own = propeller_load(plant, 0.0, 1.0, screw.pitch_ratio_max, screw.depth_m, 0.0)
    load = own.torque / screw.relative_rotative_efficiency
    friction = line.coulomb_friction_engine_side_N_m + line.coulomb_friction_propeller_side_N_m
    viscous = (
        line.viscous_friction_engine_side_N_m_s_rad + line.viscous_friction_propeller_side_N_m_s_rad
    )
    return DriveTrain(
        inductance=ship.parameter(INDUCTANCE).value,
        constant=ship.parameter(CONSTANT).value,
        resistance=ship.parameter(RESISTANCE).value,
        inertia=float(shaft_inertia(plant)) / factor / ratio,
        friction=friction / factor,
        load=float(load + line.quadratic_drag_N_m_s2_rad2) / factor / ratio**2,
        viscous=viscous / factor / ratio,
    )


def keys_of(ship: Ship, train: DriveTrain) -> dict[str, float]:
    """Return the parameters of a drive train by keys of the ship file, referred to the propeller shaft.

    The ship gives inertia and friction on the propeller side of the shaft torque meter, eta_R and
    viscous friction. The last key of :data:`SIX`, KQ, is given for a propeller ``bollard`` only.
    """
    now = drive_train(ship)
    line, ratio, factor = ship.transmission, ship.transmission.gear_ratio, torque_factor(ship)
    values = {
        INDUCTANCE: train.inductance,
        CONSTANT: train.constant,
        RESISTANCE: train.resistance,
        INERTIA: line.inertia_engine_side_kg_m2 + (train.inertia - now.inertia) * factor * ratio,
        FRICTION: line.coulomb_friction_engine_side_N_m + (train.friction - now.friction) * factor,
    }
    if ship.propeller.model == "bollard":
        none, unit = (drive_train(Free(ship, [LOAD]).on([value])).load for value in (0.0, 1.0))
        values[LOAD] = (train.load - none) / (unit - none)
    return values
