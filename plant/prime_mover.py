"""Prime movers: diesel engine by its fuel rack map, DC motor by voltage, or a torque command."""

from __future__ import annotations

import math

from ..core.compiled import Real, Record, compiled
from .propeller import clip

DIESEL, DC_MOTOR, TORQUE = 0, 1, 2
"""Codes of ``plant.prime_mover``."""


@compiled
def rack_torque(plant: Record, engine_speed: Real, fuel_rack: Real) -> Real:
    """Brake torque M_b [N m] of the rack map (thesis eqs. 2-13 and 2-14), before its limits.

    Args:
        plant: ship record; ``torque_curvature`` bends the map's straight lines about
            ``torque_curvature_speed``, ``derating`` takes away a fraction of the torque.
        engine_speed: omega_e [rad/s].
        fuel_rack: X [mm].
    """
    torque = plant.torque_per_speed * engine_speed + plant.torque_per_rack * fuel_rack
    torque = torque + plant.torque_offset
    deviation = engine_speed - plant.torque_curvature_speed
    torque = torque + plant.torque_curvature * deviation * deviation
    return torque * (1.0 - plant.derating)


@compiled
def rack_of_torque(plant: Record, engine_speed: Real, brake_torque: Real) -> Real:
    """Fuel rack X [mm] at which the rack map gives a brake torque, before end stops and limits.

    Args:
        plant: ship record.
        engine_speed: omega_e [rad/s].
        brake_torque: M_b [N m].
    """
    at_no_rack = rack_torque(plant, engine_speed, 0.0)
    return (brake_torque - at_no_rack) / (plant.torque_per_rack * (1.0 - plant.derating))


@compiled
def torque_limit(plant: Record, engine_speed: Real) -> Real:
    """Upper edge of the engine's envelope [N m]: rising from idle speed, then flat."""
    return clip(
        plant.torque_limit_idle
        + plant.torque_limit_slope * (engine_speed - plant.engine_speed_min),
        -plant.torque_limit,
        plant.torque_limit,
    )


@compiled
def diesel_torque(plant: Record, engine_speed: Real, fuel_rack: Real) -> Real:
    """Brake torque M_b [N m] of the diesel engine inside its envelope."""
    torque = rack_torque(plant, engine_speed, fuel_rack)
    limit = torque_limit(plant, engine_speed)
    if torque.real > limit.real:
        return limit
    return torque


@compiled
def applied_voltage(plant: Record, demand: Real, motor_speed: Real) -> Real:
    """Voltage [V] at the armature for a demand [V] inside the end stops, at a motor speed [rad/s].

    Demands within ``command_dead_zone`` give none and short the armature; beyond it the dead zone is
    taken off. The supply gives no more than ``supply_limit``, and lets its voltage go as far as it takes
    to hold the current at ``supply_current_limit``.
    """
    voltage = demand
    if plant.command_dead_zone > 0.0:
        voltage = demand - clip(demand, -plant.command_dead_zone, plant.command_dead_zone)
    voltage = clip(voltage, -plant.supply_limit, plant.supply_limit)
    if plant.supply_current_limit < math.inf:
        back, span = (
            plant.motor_constant * motor_speed,
            plant.armature_resistance * plant.supply_current_limit,
        )
        voltage = clip(voltage, back - span, back + span)
    return voltage


@compiled
def motor_torque(plant: Record, current: Real) -> Real:
    """Torque [N m] of the motor: K_e i, and ``reverse_torque_fraction`` of it where i drives astern.

    By the sign of the current the torque has no jump; in steady running that is also the sign of
    rotation and demand. The back-EMF stays K_e omega, so a fraction below 1 is a loss.
    """
    torque = plant.motor_constant * current
    if current.real < 0.0:
        torque = torque * plant.reverse_torque_fraction
    return torque


@compiled
def motor_current_rate(plant: Record, voltage: Real, motor_speed: Real, current: Real) -> Real:
    """Di/dt [A/s] of the armature (Vrijdag & Martelli 2021, eq. 1)."""
    return (
        voltage - plant.motor_constant * motor_speed - plant.armature_resistance * current
    ) / plant.armature_inductance


@compiled
def steady_motor_current(plant: Record, voltage: Real, motor_speed: Real) -> Real:
    """Armature current [A] where the inductance is left out."""
    return (voltage - plant.motor_constant * motor_speed) / plant.armature_resistance
