"""Direct-current motor with a voltage command, and the limits of its supply."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import Field

from ...core.compiled import Real, Record, compiled
from ...core.numeric import clip
from ..keys import INF, effect, parameter
from ..signals import Signal
from .prime_mover import (
    COMMAND_DELAY,
    COMMAND_LAG,
    TORQUE_OFFSET,
    PrimeMover,
    add_torque_offset,
    end_stops,
)

SWITCHED_ON = 1e-3
"""Share of the end stop below which a voltage command counts as switched off."""


FED_BACK = 1.0 + 1e-9
"""Resistive voltage / back-EMF up to which a braking motor feeds its supply: at 1 the supply voltage is
zero."""


class DcMotor(PrimeMover):
    """Direct-current motor with a voltage command."""

    type: Literal["dc-motor"] = Field(description="kind of drive")

    code, balance, electric = 1, "motor", True
    demand = Signal(
        "motor_voltage_demand",
        "U",
        "V",
        -1e5,
        1e5,
        "demand",
        "motor_voltage_V",
        "voltage command to the motor's supply",
    )
    validity = (end_stops("motor voltage command", "V"),)
    steady_keys = (  # in the order of Vrijdag & Martelli 2021, eq. 23
        "transmission.coulomb_friction_engine_side_N_m",
        "prime_mover.motor_constant_V_s_rad",
        "prime_mover.armature_resistance_ohm",
        "propeller.torque_coefficient",
    )
    response_keys = (  # in the order of its Table 5
        "prime_mover.armature_inductance_H",
        "prime_mover.motor_constant_V_s_rad",
        "prime_mover.armature_resistance_ohm",
        "transmission.inertia_engine_side_kg_m2",
        "transmission.coulomb_friction_engine_side_N_m",
        "propeller.torque_coefficient",
    )

    # fmt: off
    motor_constant_V_s_rad: float = parameter("K_e, back-EMF and torque constant", "V s/rad = N m/A",
        record="motor_constant", gt=0, le=1e3)
    armature_resistance_ohm: float = parameter("armature resistance R_a", "ohm",
        record="armature_resistance", gt=0, le=1e4)
    armature_inductance_H: float = parameter("armature inductance L_a; 0: current without dynamics", "H",
        record="armature_inductance", ge=0, le=100, default=0.0)
    voltage_max_V: float = parameter("end stop of the command, in either direction", "V",
        record="drive_max", gt=0, le=1e5)
    command_dead_zone_V: float = effect(0.0,
        "half width of the dead zone, which is subtracted from the command", "V",
        record="command_dead_zone", ge=0, le=1e5)
    reverse_torque_fraction: float = effect(1.0,
        "torque constant at negative current / at positive current", record="reverse_torque_fraction",
        gt=0, le=2)
    open_circuit_fraction: float = effect(0.0,
        "share of the armature current that is lost at zero voltage command: 1 is an open switch, "
        "0 a short circuit that brakes", record="open_circuit_fraction", ge=0, le=1)
    braking_loss_fraction: float = effect(0.0,
        "share of the torque that is lost while the motor brakes: 1 is a supply that takes no "
        "current back", record="braking_loss_fraction", ge=0, le=1)
    torque_offset_N_m: float = TORQUE_OFFSET
    command_delay_s: float = COMMAND_DELAY
    command_lag_s: float = COMMAND_LAG
    supply_limit_V: float = effect(INF, "highest voltage of the supply, in either direction", "V",
        record="supply_limit", gt=0)
    supply_current_limit_A: float = effect(INF, "highest current of the supply, in either direction",
        "A", record="supply_current_limit", gt=0)
    supply_soft_current_A: float = effect(INF,
        "i_s of a supply that gives i_s tanh(i / i_s) instead of a current i", "A",
        record="supply_soft_current", gt=0)
    # fmt: on

    @property
    def time_constants(self) -> dict[str, float]:
        """L/R of the armature [s]; empty if the current has no dynamics."""
        if self.armature_inductance_H == 0.0:
            return {}
        ratio = self.armature_inductance_H / self.armature_resistance_ohm
        return {"armature_inductance_H / armature_resistance_ohm": ratio}

    @property
    def damping(self) -> float:
        """Slope of the torque from the back-EMF if the current has no dynamics [N m s/rad]."""
        if self.armature_inductance_H > 0.0:
            return 0.0
        return self.motor_constant_V_s_rad**2 / self.armature_resistance_ohm

    @property
    def idle_speed_rad_s(self) -> float:
        """Speed at which the back-EMF equals the highest voltage [rad/s]."""
        return self.voltage_max_V / self.motor_constant_V_s_rad

    def resolved_ranges(self, step_s: float) -> Mapping[str, tuple[float, float, float]]:
        """Return the ranges of inductance and resistance in which L/R is at least a time step."""
        least = step_s * self.armature_resistance_ohm
        if self.armature_inductance_H == 0.0:
            return {"armature_inductance_H": (0.0, INF, least)}
        most = self.armature_inductance_H / step_s
        return {
            "armature_inductance_H": (least, INF, 0.0),
            "armature_resistance_ohm": (0.0, most, 0.0),
        }


@compiled
def applied_voltage(plant: Record, demand: Real, motor_speed: Real) -> Real:
    """Return the voltage [V] at the armature for a command [V] inside the end stops, at a speed [rad/s].

    Commands within ``command_dead_zone`` give no voltage and short-circuit the armature; larger commands
    are reduced by the dead zone. The supply gives at most ``supply_limit``. It reduces its voltage to
    keep the current below ``supply_current_limit``, or gradually by ``supply_soft_current``. A command
    below :data:`SWITCHED_ON` of the end stop opens the circuit by ``open_circuit_fraction``, which moves
    the voltage to the back-EMF.
    """
    voltage = demand
    if plant.command_dead_zone != 0.0:
        voltage = demand - clip(demand, -plant.command_dead_zone, plant.command_dead_zone)
    voltage = clip(voltage, -plant.supply_limit, plant.supply_limit)
    back = plant.motor_constant * motor_speed
    if plant.supply_current_limit.real < math.inf:
        span = plant.armature_resistance * plant.supply_current_limit
        voltage = clip(voltage, back - span, back + span)
    if plant.supply_soft_current.real < math.inf:
        span = plant.armature_resistance * plant.supply_soft_current
        voltage = back + span * np.tanh((voltage - back) / span)
    off = abs(demand.real) < SWITCHED_ON * plant.drive_max.real
    if plant.open_circuit_fraction != 0.0 and off:
        voltage = voltage + plant.open_circuit_fraction * (back - voltage)
    return voltage


@compiled
def motor_torque(plant: Record, current: Real, motor_speed: Real) -> Real:
    """Return the torque [N m] of the motor: K_e i, times ``reverse_torque_fraction`` if i is negative.

    The sign of the current decides, so the torque is continuous; in a steady state it equals the sign of
    rotation and command. The back-EMF stays K_e omega, so a fraction below 1 is a loss. A braking torque
    that would feed the supply is reduced by ``braking_loss_fraction``; against a reversed voltage it is
    not.
    """
    torque = plant.motor_constant * current
    if current.real < 0.0:
        torque = torque * plant.reverse_torque_fraction
    if plant.braking_loss_fraction != 0.0 and current.real * motor_speed.real < 0.0:
        back = abs(plant.motor_constant.real * motor_speed.real)
        if plant.armature_resistance.real * abs(current.real) <= FED_BACK * back:
            torque = torque * (1.0 - plant.braking_loss_fraction)
    return torque


@compiled
def motor_current_rate(plant: Record, voltage: Real, motor_speed: Real, current: Real) -> Real:
    """Return di/dt [A/s] of the armature (Vrijdag & Martelli 2021, eq. 1)."""
    return (
        voltage - plant.motor_constant * motor_speed - plant.armature_resistance * current
    ) / plant.armature_inductance


@compiled
def steady_motor_current(plant: Record, voltage: Real, motor_speed: Real) -> Real:
    """Return the armature current [A] without inductance."""
    return (voltage - plant.motor_constant * motor_speed) / plant.armature_resistance


@compiled
def drive_motor(
    plant: Record, motor_speed: Real, demand: Real, current: Real
) -> tuple[Real, Real, Real, Real]:
    """Return torque [N m], current [A], di/dt [A/s] and voltage [V] of the motor.

    ``motor_speed`` is in rad/s, ``demand`` is the voltage command [V], ``current`` the state of the
    armature [A]. With ``armature_inductance`` 0 the current has no dynamics and di/dt is 0.
    """
    voltage = applied_voltage(plant, demand, motor_speed)
    rate = 0.0
    if plant.armature_inductance.real > 0.0:
        rate = motor_current_rate(plant, voltage, motor_speed, current)
    else:
        current = steady_motor_current(plant, voltage, motor_speed)
    torque = add_torque_offset(plant, motor_torque(plant, current, motor_speed))
    return torque, current, rate, voltage
