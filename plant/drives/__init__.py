"""Prime movers: the parameters of each kind in a ship file, its command, and its equations.

A new kind needs its own module, an entry in each list and function of this module, and a test.
"""

from __future__ import annotations

from typing import NamedTuple

from ...core.compiled import Real, Record, compiled
from .dc_motor import DcMotor, drive_motor
from .diesel import Diesel, drive_diesel
from .prime_mover import add_torque_offset, supplied_power
from .speed_source import SpeedSource, holding_torque
from .torque_source import TorqueSource

Drive = Diesel | DcMotor | TorqueSource | SpeedSource

DRIVES: tuple[type[Drive], ...] = (Diesel, DcMotor, TorqueSource, SpeedSource)
"""All kinds of prime mover; ``plant.prime_mover`` holds the ``code`` of one."""

DIESEL, DC_MOTOR = Diesel.code, DcMotor.code


class DriveOutput(NamedTuple):
    """Outputs of a prime mover at one instant."""

    brake_torque: Real  # M_b [N m]
    brake_torque_rate: Real  # rate of a torque with a lag [N m/s]
    current: Real  # of a motor [A]
    current_rate: Real  # of a motor with inductance [A/s]
    voltage: Real  # at a motor's armature [V]
    charge_rate: Real  # rate of a diesel's charge air [1/s]
    warmth_rate: Real  # rate of a diesel's warmth [1/s]


class DriveStates(NamedTuple):
    """States of a prime mover; those of other kinds stay at 0."""

    brake_torque: Real  # torque with a lag [N m]
    motor_current: Real  # current of an armature with inductance [A]
    charge: Real  # a diesel's charge air / that at rated power [-]
    warmth: Real  # a diesel's warmth / that at rated power [-]


@compiled
def drive_output(
    plant: Record, engine_speed: Real, demand: Real, states: DriveStates
) -> DriveOutput:
    """Return torque, currents and rates of the prime mover at an engine speed omega_e [rad/s].

    ``demand`` is a fuel rack [mm], a voltage [V] or a torque [N m]. If the drive holds the speed, its
    torque follows from the load (:func:`holding_torque`) and is 0 here.
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
        torque = add_torque_offset(plant, demand)
    return DriveOutput(
        torque, torque_rate, current, current_rate, voltage, charge_rate, warmth_rate
    )


@compiled
def electric_power(
    plant: Record, mover: DriveOutput, brake_torque: Real, engine_speed: Real
) -> Real:
    """Return the electric power [W] that a drive takes from its supply; 0 for a diesel.

    That of a DC motor is voltage times current; other drives convert M_b [N m] at omega_e [rad/s].
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
    "DriveOutput",
    "DriveStates",
    "SpeedSource",
    "TorqueSource",
    "drive_output",
    "electric_power",
    "holding_torque",
]
