"""Prime movers, a file each: section of the ship's file, what drives it, and its equations.

A new one is its file, its places in this one, and its test.
"""

from __future__ import annotations

from typing import NamedTuple

from ...core.compiled import Real, Record, compiled
from .dc_motor import DcMotor, drive_motor
from .diesel import Diesel, drive_diesel
from .prime_mover import supplied_power
from .speed_source import SpeedSource, holding_torque
from .torque_source import TorqueSource, source_torque

Drive = Diesel | DcMotor | TorqueSource | SpeedSource

DRIVES: tuple[type[Drive], ...] = (Diesel, DcMotor, TorqueSource, SpeedSource)
"""Every kind; ``plant.prime_mover`` holds the ``code`` of one."""

DIESEL, DC_MOTOR = Diesel.code, DcMotor.code


class Driven(NamedTuple):
    """What a prime mover does at one instant."""

    brake_torque: Real  # M_b [N m]
    brake_torque_rate: Real  # of a torque that lags [N m/s]
    current: Real  # of a motor [A]
    current_rate: Real  # of a motor with inductance [A/s]
    voltage: Real  # at a motor's armature [V]
    charge_rate: Real  # of a diesel's charge air [1/s]
    warmth_rate: Real  # of a diesel's parts [1/s]


class Driving(NamedTuple):
    """States of a prime mover, of whichever kind."""

    brake_torque: Real  # that lags [N m]
    motor_current: Real  # of an armature with inductance [A]
    charge: Real  # share of a diesel's charge air at rated power [-]
    warmth: Real  # share of its parts' warmth at rated power [-]


@compiled
def driven(plant: Record, engine_speed: Real, demand: Real, states: Driving) -> Driven:
    """Torque of the prime mover, whatever it is.

    Args:
        plant: ship record.
        engine_speed: omega_e [rad/s].
        demand: fuel rack [mm], voltage [V] or torque [N m]. Of a speed that is held the torque is only
            known by its load (:func:`holding_torque`); it is 0 here.
        states: of whatever lags.
    """
    torque_rate = current = current_rate = voltage = charge_rate = warmth_rate = 0.0
    if plant.prime_mover == DIESEL:
        torque, torque_rate, charge_rate, warmth_rate = drive_diesel(
            plant, engine_speed, demand, states.brake_torque, states.charge, states.warmth
        )
    elif plant.prime_mover == DC_MOTOR:
        torque, current, current_rate, voltage = drive_motor(
            plant, engine_speed, demand, states.motor_current
        )
    elif plant.speed_held != 0:
        torque = 0.0
    else:
        torque = source_torque(plant, demand)
    return Driven(torque, torque_rate, current, current_rate, voltage, charge_rate, warmth_rate)


@compiled
def electric_power(plant: Record, mover: Driven, brake_torque: Real, engine_speed: Real) -> Real:
    """Electric power [W] that a drive takes from its supply; 0 of a diesel.

    Args:
        plant: ship record.
        mover: what the drive does; of a DC motor the power is its voltage times its current.
        brake_torque: M_b [N m].
        engine_speed: omega_e [rad/s].
    """
    if plant.prime_mover == DIESEL:
        return 0.0 * engine_speed
    if plant.prime_mover == DC_MOTOR:
        return mover.voltage * mover.current
    return supplied_power(plant, brake_torque * engine_speed)


__all__ = [
    "DRIVES",
    "DcMotor",
    "Diesel",
    "Drive",
    "Driven",
    "Driving",
    "SpeedSource",
    "TorqueSource",
    "driven",
    "electric_power",
    "holding_torque",
]
