"""Prime movers: diesel engine by its fuel rack map, DC motor by voltage, or a torque command."""

from __future__ import annotations

from .compiled import Real, Record, compiled
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
def motor_current_rate(plant: Record, voltage: Real, motor_speed: Real, current: Real) -> Real:
    """Di/dt [A/s] of the armature (Vrijdag & Martelli 2021, eq. 1)."""
    return (
        voltage - plant.motor_constant * motor_speed - plant.armature_resistance * current
    ) / plant.armature_inductance


@compiled
def steady_motor_current(plant: Record, voltage: Real, motor_speed: Real) -> Real:
    """Armature current [A] where the inductance is left out."""
    return (voltage - plant.motor_constant * motor_speed) / plant.armature_resistance
