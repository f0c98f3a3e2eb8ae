"""The plant's equations of motion, put together from the parts, and one Runge-Kutta step of them.

``evaluate`` is the only place where the state's derivative is formed (thesis eq. 2-20). It accepts
complex numbers, so that the linearisation can take exact derivatives by complex steps.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..core.compiled import Real, Record, compiled
from .actuators import blade_pitch, pitch_rate, rack_position
from .hull import resistance, wake_inflow, water_speed
from .prime_mover import (
    DC_MOTOR,
    DIESEL,
    applied_voltage,
    diesel_torque,
    motor_current_rate,
    motor_torque,
    steady_motor_current,
)
from .propeller import propeller_load
from .shaft import friction_torque, gauge_torque, quadratic_drag, shaft_inertia
from .ship import HISTORY
from .unexplained import ENGINE, HULL, PITCH_ACTUATOR, PROPELLER, unexplained
from .ventilation import can_ventilate, ventilation_rate, ventilation_state


class State(NamedTuple):
    """Continuous states of the plant. Those of absent effects stay at 0."""

    pitch_ratio: Real  # of the actuator [-]
    shaft_speed: Real  # omega [rad/s]
    ship_speed: Real  # v_s over ground [m/s]
    position: Real  # along the track [m]
    brake_torque: Real  # of a diesel with lag [N m]
    inflow: Real  # advance velocity where it lags [m/s]
    ventilation: Real  # degree of ventilation [-]
    motor_current: Real  # of a motor with inductance [A]


class Inputs(NamedTuple):
    """What acts on the plant at one instant."""

    drive: Real  # fuel rack [mm], voltage [V] or torque [N m]
    pitch_command: Real  # P/D [-]
    inflow: Real  # disturbance u_x of the advance velocity [m/s]
    inflow_slope: float  # of the wave field along the track [1/s]
    inflow_position: float  # where ``inflow`` holds [m]
    elevation: Real  # of the surface above the propeller [m]
    resistance_factor: Real  # d_c1 [-]
    time: Real  # since the start [s]


class Outputs(NamedTuple):
    """Algebraic quantities of the plant at one instant."""

    pitch_ratio: Real  # of the blades [-]
    advance_velocity: Real  # v_a [m/s]
    thrust: Real  # of one propeller [N]
    propeller_torque: Real  # M_p [N m]
    shaft_torque: Real  # M_m at the gauge [N m]
    brake_torque: Real  # M_b [N m]
    shaft_acceleration: Real  # [rad/s2]
    resistance: Real  # R [N]
    motor_current: Real  # [A]
    thrust_coefficient: Real  # KT [-] without air
    submergence: Real  # of the propeller's centre [m]


STATE = np.dtype([(name, np.float64) for name in State._fields], align=True)

MEMORY = np.dtype(
    [
        ("rack", np.float64),  # rack position, or drive command [mm | V | N m]
        ("blade_pitch", np.float64),  # of the backlash's play operator [-]
        ("ventilated", np.int64),
        ("speed_log", np.float64),  # reading of the speed log [m/s]
        ("shaft_torque", np.float64),  # reading of the torque gauge [N m]
        ("pitch_ratio", np.float64),  # reading of the pitch sensor [-]
        ("cursor", np.int64),
        ("demands", np.float64, (HISTORY,)),
        ("torques", np.float64, (HISTORY,)),
    ],
    align=True,
)
"""What the plant remembers between steps: actuators, instruments, delay lines."""


@compiled
def evaluate(
    plant: Record, state: State, inputs: Inputs, blade_before: float, ventilated: bool
) -> tuple[State, Outputs]:
    """The state's derivative and the outputs (thesis eq. 2-20 with the optional effects).

    Args:
        plant: ship record.
        state: continuous states; real or complex.
        inputs: what acts at this instant.
        blade_before: blade pitch at the last step (for backlash) [-].
        ventilated: on/off state of ventilation.

    Constant divisors are written as reciprocals so that one division serves all stages of a step.
    """
    # propeller in the wake
    blade = blade_pitch(plant, state.pitch_ratio, blade_before)
    speed = water_speed(plant, state.ship_speed)
    kinematic = wake_inflow(plant, speed) + inputs.inflow
    kinematic = kinematic + inputs.inflow_slope * (state.position - inputs.inflow_position)
    if plant.inflow_lag > 0.0:
        advance = state.inflow
        inflow_rate = (kinematic - state.inflow) / plant.inflow_lag
    else:
        advance = kinematic
        inflow_rate = 0.0
    submergence = plant.depth + inputs.elevation
    load = propeller_load(plant, advance, state.shaft_speed, blade, submergence, state.ventilation)
    propeller_torque = load.torque * (1.0 / plant.relative_rotative_efficiency)  # eq. 2-5

    # prime mover
    engine_speed = plant.gear_ratio * state.shaft_speed  # eq. 2-11
    torque_rate = 0.0
    current_rate = 0.0
    current = 0.0
    if plant.prime_mover == DIESEL:
        brake = diesel_torque(plant, engine_speed, inputs.drive)
        if plant.engine_lag > 0.0:
            torque_rate = (brake - state.brake_torque) / plant.engine_lag
            brake = state.brake_torque
    elif plant.prime_mover == DC_MOTOR:
        voltage = applied_voltage(plant, inputs.drive, engine_speed)
        if plant.armature_inductance > 0.0:
            current = state.motor_current
            current_rate = motor_current_rate(plant, voltage, engine_speed, current)
        else:
            current = steady_motor_current(plant, voltage, engine_speed)
        brake = motor_torque(plant, current)
    else:
        brake = inputs.drive

    # shaft
    drive_torque = brake * plant.gear_ratio * plant.transmission_efficiency  # eq. 2-15
    drive_torque = drive_torque - friction_torque(
        plant.coulomb_engine_side, plant.viscous_engine_side, state.shaft_speed
    )
    load_torque = propeller_torque + friction_torque(
        plant.coulomb_propeller_side, plant.viscous_propeller_side, state.shaft_speed
    )
    load_torque = load_torque + quadratic_drag(plant, state.shaft_speed)
    lacking = 0.0
    if plant.unexplained_balance != 0:
        lacking = unexplained(
            plant, state.shaft_speed, state.ship_speed, blade, inputs.drive, inputs.time
        )
        if plant.unexplained_balance == ENGINE:
            drive_torque = drive_torque + lacking
        elif plant.unexplained_balance == PROPELLER:
            load_torque = load_torque - lacking
    acceleration = (drive_torque - load_torque) * (1.0 / shaft_inertia(plant))  # eq. 2-1
    torque_at_gauge = gauge_torque(plant, drive_torque, acceleration)

    # hull
    drag = resistance(plant, speed, inputs.resistance_factor)
    push = plant.propellers * (1.0 - plant.thrust_deduction) * load.thrust  # eq. 2-6
    if plant.unexplained_balance == HULL:
        push = push + lacking
    ship_acceleration = (push - drag) * (1.0 / plant.mass)  # eq. 2-2
    if plant.hull_fixed != 0:
        ship_acceleration = 0.0

    blade_rate = pitch_rate(plant, inputs.pitch_command, state.pitch_ratio)
    if plant.unexplained_balance == PITCH_ACTUATOR:
        blade_rate = blade_rate + lacking

    air_rate = 0.0
    if can_ventilate(plant):
        air_rate = ventilation_rate(plant, state.ventilation, ventilated)
    return (
        State(
            blade_rate,
            acceleration,
            ship_acceleration,
            state.ship_speed,
            torque_rate,
            inflow_rate,
            air_rate,
            current_rate,
        ),
        Outputs(
            blade,
            advance,
            load.thrust,
            propeller_torque,
            torque_at_gauge,
            brake,
            acceleration,
            drag,
            current,
            load.thrust_coefficient,
            submergence,
        ),
    )


@compiled
def _moved(state: State, rate: State, h: float) -> State:
    return State(
        state.pitch_ratio + h * rate.pitch_ratio,
        state.shaft_speed + h * rate.shaft_speed,
        state.ship_speed + h * rate.ship_speed,
        state.position + h * rate.position,
        state.brake_torque + h * rate.brake_torque,
        state.inflow + h * rate.inflow,
        state.ventilation + h * rate.ventilation,
        state.motor_current + h * rate.motor_current,
    )


@compiled
def runge_kutta(
    plant: Record,
    state: State,
    k1: State,
    middle: Inputs,
    end: Inputs,
    blade_before: float,
    ventilated: bool,
    dt: float,
) -> State:
    """One classic fourth-order Runge-Kutta step of length ``dt`` [s] from the derivative ``k1``."""
    k2, _ = evaluate(plant, _moved(state, k1, 0.5 * dt), middle, blade_before, ventilated)
    k3, _ = evaluate(plant, _moved(state, k2, 0.5 * dt), middle, blade_before, ventilated)
    k4, _ = evaluate(plant, _moved(state, k3, dt), end, blade_before, ventilated)
    following = _moved(state, k1, dt / 6.0)
    following = _moved(following, k2, dt / 3.0)
    following = _moved(following, k3, dt / 3.0)
    return _moved(following, k4, dt / 6.0)


@compiled
def get_state(record: Record) -> State:
    """State of a STATE record."""
    return State(
        record.pitch_ratio,
        record.shaft_speed,
        record.ship_speed,
        record.position,
        record.brake_torque,
        record.inflow,
        record.ventilation,
        record.motor_current,
    )


@compiled
def set_state(record: Record, state: State) -> None:
    """Write a state into a STATE record."""
    record.pitch_ratio = state.pitch_ratio
    record.shaft_speed = state.shaft_speed
    record.ship_speed = state.ship_speed
    record.position = state.position
    record.brake_torque = state.brake_torque
    record.inflow = state.inflow
    record.ventilation = state.ventilation
    record.motor_current = state.motor_current


@compiled
def _delayed(line: Any, cursor: int, delay_steps: float) -> float:
    """Sample of a delay line, linear between samples: the mean of a held signal over a step."""
    whole = int(delay_steps)
    part = delay_steps - whole
    newer = line[(cursor - whole) % HISTORY]
    older = line[(cursor - whole - 1) % HISTORY]
    return float(newer + part * (older - newer))


@compiled
def begin_step(plant: Record, memory: Record, demand: float, dt: float) -> float:
    """Pass a drive demand through dead time, rate limit and end stops; gives the drive's input."""
    if plant.engine_dead_time > 0.0:
        memory.demands[memory.cursor % HISTORY] = demand
        demand = _delayed(memory.demands, memory.cursor, plant.engine_dead_time / dt)
    memory.rack = rack_position(plant, demand, memory.rack, dt)
    return float(memory.rack)


@compiled
def read_instruments(plant: Record, memory: Record, outputs: Outputs, dt: float) -> None:
    """Let the instruments and the memories see the outputs of this instant.

    Seeing the same instant twice changes nothing.
    """
    memory.blade_pitch = outputs.pitch_ratio
    if can_ventilate(plant):
        memory.ventilated = ventilation_state(
            plant, memory.ventilated != 0, outputs.submergence, outputs.thrust_coefficient
        )
    memory.pitch_ratio = outputs.pitch_ratio + plant.pitch_sensor_offset
    torque = outputs.shaft_torque
    if plant.torque_sensor_delay > 0.0:
        memory.torques[memory.cursor % HISTORY] = torque
        torque = _delayed(memory.torques, memory.cursor, plant.torque_sensor_delay / dt)
    memory.shaft_torque = plant.torque_sensor_gain * torque + plant.torque_sensor_bias


@compiled
def end_step(plant: Record, memory: Record, ship_speed: float, dt: float) -> None:
    """Count the step and let the speed log follow."""
    memory.cursor += 1
    if plant.speed_log_lag > 0.0:
        share = 1.0 - math.exp(-dt / plant.speed_log_lag)
        memory.speed_log += share * (ship_speed - memory.speed_log)
    else:
        memory.speed_log = ship_speed


@compiled
def settle(
    plant: Record, memory: Record, state: State, outputs: Outputs, demand: float, dt: float
) -> None:
    """Fill the memories as if the plant had been in this state for ever."""
    memory.rack = demand
    memory.ventilated = 0
    memory.cursor = 0
    memory.demands[:] = demand
    memory.torques[:] = outputs.shaft_torque
    memory.speed_log = state.ship_speed
    read_instruments(plant, memory, outputs, dt)
