"""Shaft line: gearbox, friction on either side of the shaft torque meter, and its torque."""

from __future__ import annotations

import math

import numpy as np

from ..core.compiled import Real, Record, compiled
from ..core.lanes import everywhere, where
from ..core.numeric import modulus
from .keys import Section, effect, parameter

FREE = "turns_freely"
UNLESS_HELD = "unless the drive holds its speed"


class Transmission(Section):
    """Gearbox, shaft inertias on either side of the shaft torque meter, friction."""

    # fmt: off
    gear_ratio: float = parameter("engine speed / shaft speed", record="gear_ratio", needs=FREE,
        required=UNLESS_HELD, gt=0, le=100, default=1.0)
    efficiency: float = parameter("efficiency eta_trm of the transmission",
        record="transmission_efficiency", needs=FREE, required=UNLESS_HELD, gt=0.3, le=1, default=1.0)
    inertia_engine_side_kg_m2: float = parameter(
        "I_L, inertia of the engine side, at the propeller shaft", "kg m2", record="inertia_engine_side",
        needs=FREE, required=UNLESS_HELD, gt=0, le=1e9, default=0.0)
    inertia_propeller_side_kg_m2: float = parameter("I_R, inertia of the propeller side", "kg m2",
        record="inertia_propeller_side", required=UNLESS_HELD, ge=0, le=1e9, default=0.0)
    stiction_speed_rad_s: float = parameter(
        "speed below which Coulomb friction sticks: the friction is M tanh(omega / this); raised to "
        "M dt / I if it is lower", "rad/s", record="stiction_speed", gt=0, le=10, default=0.05)
    coulomb_friction_engine_side_N_m: float = effect(0.0,
        "Coulomb friction before the torque meter, at the propeller shaft", "N m",
        record="coulomb_engine_side", needs=FREE, ge=0, le=1e7)
    viscous_friction_engine_side_N_m_s_rad: float = effect(0.0,
        "viscous friction before the torque meter", "N m s/rad", record="viscous_engine_side",
        needs=FREE, ge=0, le=1e7)
    coulomb_asymmetry_fraction: float = effect(0.0,
        "a: Coulomb friction before the torque meter is (1 + a) of its value ahead, (1 - a) astern",
        record="coulomb_asymmetry", needs=FREE, ge=-1, le=1)
    viscous_asymmetry_fraction: float = effect(0.0,
        "a: viscous friction before the torque meter is (1 + a) of its value ahead, (1 - a) astern",
        record="viscous_asymmetry", needs=FREE, ge=-1, le=1)
    load_friction_fraction: float = effect(0.0,
        "friction of gears and bearings before the torque meter that grows with their load: "
        "Coulomb friction / load torque", record="load_friction", needs=FREE, ge=0, le=0.9)
    arctangent_friction_engine_side_N_m: float = effect(0.0,
        "k of the friction k atan(s omega) before the torque meter", "N m", record="arctangent_friction",
        needs=FREE, ge=0, le=1e7)
    arctangent_friction_slope_s_rad: float = parameter("s of the friction k atan(s omega)", "s/rad",
        record="arctangent_slope", needs=FREE, gt=0, le=1e4, default=1.0)
    coulomb_friction_propeller_side_N_m: float = effect(0.0, "Coulomb friction behind the torque meter",
        "N m", record="coulomb_propeller_side", ge=0, le=1e7)
    viscous_friction_propeller_side_N_m_s_rad: float = effect(0.0,
        "viscous friction behind the torque meter", "N m s/rad", record="viscous_propeller_side", ge=0,
        le=1e7)
    quadratic_drag_N_m_s2_rad2: float = effect(0.0,
        "c of the drag c omega |omega| behind the torque meter", "N m s2/rad2", record="quadratic_drag",
        ge=0, le=1e7)
    # fmt: on


@compiled
def friction_torque(plant: Record, coulomb: Real, viscous: Real, shaft_speed: Real) -> Real:
    """Return the Coulomb and viscous friction [N m] that oppose the rotation at omega [rad/s].

    ``coulomb`` [N m] is independent of speed, ``viscous`` is per speed [N m s/rad]. tanh(omega /
    stiction_speed) replaces the sign, so that a shaft can start from rest; above 20 times that speed the
    two are equal to the last bit. The speed is raised to ``coulomb dt / I`` if it is lower, the speed
    that this friction removes within a time step: below it the integration would chatter about
    standstill.
    """
    if coulomb == 0.0 and viscous == 0.0:
        return 0.0
    sticks = plant.stiction_speed
    inertia = shaft_inertia(plant)
    if inertia.real * sticks.real < coulomb.real * plant.time_step.real and plant.speed_held == 0:
        sticks = coulomb * plant.time_step / inertia
    slides = abs(shaft_speed.real) > 20.0 * sticks.real
    direction = math.copysign(1.0, shaft_speed.real)
    if not everywhere(slides):
        direction = where(slides, direction, np.tanh(shaft_speed / sticks))
    return coulomb * direction + viscous * shaft_speed


@compiled
def quadratic_drag(plant: Record, shaft_speed: Real) -> Real:
    """Return the torque c omega |omega| [N m] behind the torque meter that opposes the rotation."""
    if plant.quadratic_drag == 0.0:
        return 0.0
    sign = where(shaft_speed.real >= 0.0, 1.0, -1.0)
    return sign * plant.quadratic_drag * shaft_speed * shaft_speed


@compiled
def arctangent_friction(plant: Record, shaft_speed: Real) -> Real:
    """Return the torque k atan(s omega) [N m] of seals and bearings whose friction saturates with speed.

    It is the last term of eq. 2 of Pivano et al. 2008, whose first term is Coulomb friction here.
    """
    return plant.arctangent_friction * np.arctan(plant.arctangent_slope * shaft_speed)


@compiled
def load_friction(plant: Record, load: Real, shaft_speed: Real) -> Real:
    """Return the friction [N m] of gears and bearings in proportion to the torque that they carry.

    Torque-dependent friction of drive trains, as in the extended models of Duclusaud et al. 2025 (arXiv
    2410.08650): ``load_friction |load|`` against the rotation, with the torque [N m] behind the torque
    meter without inertia.
    """
    return friction_torque(plant, plant.load_friction * modulus(load), 0.0, shaft_speed)


@compiled
def directional_value(size: Real, asymmetry: Real, shaft_speed: Real) -> Real:
    """Return (1 + asymmetry) times a value for rotation ahead, (1 - asymmetry) times it astern."""
    if asymmetry != 0.0:
        size = size * where(shaft_speed.real >= 0.0, 1.0 + asymmetry, 1.0 - asymmetry)
    return size


@compiled
def friction_before_meter(plant: Record, shaft_speed: Real) -> Real:
    """Return the friction [N m] between prime mover and torque meter, at the propeller shaft."""
    torque = friction_torque(
        plant,
        directional_value(plant.coulomb_engine_side, plant.coulomb_asymmetry, shaft_speed),
        directional_value(plant.viscous_engine_side, plant.viscous_asymmetry, shaft_speed),
        shaft_speed,
    )
    if plant.arctangent_friction != 0.0:
        torque = torque + arctangent_friction(plant, shaft_speed)
    return torque


@compiled
def drive_torque(plant: Record, brake_torque: Real, shaft_speed: Real) -> Real:
    """Return the torque [N m] that drives the shaft (thesis eq. 2-15).

    It is the brake torque through the gearbox minus the friction before the torque meter.
    """
    torque = brake_torque * plant.gear_ratio * plant.transmission_efficiency
    return torque - friction_before_meter(plant, shaft_speed)


@compiled
def brake_torque_of(plant: Record, torque: Real, shaft_speed: Real) -> Real:
    """Return the brake torque [N m] that gives a :func:`drive_torque`."""
    friction = friction_before_meter(plant, shaft_speed)
    return (torque + friction) / (plant.gear_ratio * plant.transmission_efficiency)


@compiled
def load_torque(plant: Record, propeller_torque: Real, shaft_speed: Real) -> Real:
    """Return the load torque [N m] behind the torque meter: propeller, friction and drag."""
    torque = propeller_torque + friction_torque(
        plant, plant.coulomb_propeller_side, plant.viscous_propeller_side, shaft_speed
    )
    return torque + quadratic_drag(plant, shaft_speed)


@compiled
def inertia_behind_meter(plant: Record) -> Real:
    """Return the inertia [kg m2] behind the torque meter: I_R and entrained water."""
    return plant.inertia_propeller_side + plant.entrained_inertia


@compiled
def shaft_inertia(plant: Record) -> Real:
    """Return the inertia I [kg m2] of the whole line at the propeller shaft, with entrained water."""
    rotating = plant.inertia_engine_side + plant.inertia_propeller_side
    return rotating + plant.entrained_inertia


@compiled
def shaft_meter_torque(
    plant: Record, drive_torque: Real, load_torque: Real, shaft_acceleration: Real
) -> Real:
    """Return the torque M_m [N m] at the torque meter between I_L and I_R (thesis eq. 2-17).

    It is exactly 0, without rounding errors, if nothing turns behind the torque meter.
    """
    behind = inertia_behind_meter(plant)
    if behind.real == 0.0 and load_torque.real == 0.0:
        return load_torque + behind * shaft_acceleration
    return drive_torque - plant.inertia_engine_side * shaft_acceleration
