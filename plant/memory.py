"""Memory of the plant between time steps: actuators, instruments with their errors, delay lines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..core.compiled import Real, Record, compiled
from .actuators import lagged_travel, rack_travel
from .keys import Section, effect
from .state import Outputs, State

HISTORY = 512
"""Number of samples that a delay line keeps."""


class Sensors(Section):
    """Systematic errors of the instruments (noise is added where measurements are used)."""

    pitch_offset: float = effect(
        0.0, "measured P/D minus P/D", record="pitch_sensor_offset", ge=-0.5, le=0.5
    )
    torque_bias_N_m: float = effect(
        0.0, "torque measured at no torque", "N m", record="torque_sensor_bias", ge=-1e7, le=1e7
    )
    torque_gain: float = effect(
        1.0, "measured torque / torque", record="torque_sensor_gain", gt=0, le=3
    )
    torque_delay_s: float = effect(
        0.0, "delay of the torque signal", "s", record="torque_sensor_delay", ge=0, le=6
    )
    torque_lag_s: float = effect(
        0.0, "first-order lag of the torque signal", "s", record="torque_sensor_lag", ge=0, le=60
    )
    speed_gain: float = effect(
        1.0, "measured shaft speed / shaft speed, as with a wrong pulse count",
        record="speed_sensor_gain", needs="turns_freely", gt=0, le=3,
    )  # fmt: skip
    speed_delay_s: float = effect(
        0.0, "delay of the shaft speed signal", "s", record="speed_sensor_delay", ge=0, le=6
    )
    speed_lag_s: float = effect(
        0.0, "first-order lag of the shaft speed signal", "s", record="speed_sensor_lag",
        ge=0, le=60,
    )  # fmt: skip
    thrust_gain: float = effect(
        1.0,
        "measured thrust / thrust",
        record="thrust_sensor_gain",
        needs="has_propeller",
        gt=0,
        le=3,
    )
    thrust_bias_N: float = effect(
        0.0, "thrust measured at no thrust", "N", record="thrust_sensor_bias", needs="has_propeller",
        ge=-1e7, le=1e7,
    )  # fmt: skip
    thrust_lag_s: float = effect(
        0.0, "first-order lag of the thrust signal", "s", record="thrust_sensor_lag",
        needs="has_propeller", ge=0, le=60,
    )  # fmt: skip
    current_gain: float = effect(
        1.0, "measured motor current / current", record="current_sensor_gain", needs="has_voltage",
        gt=0, le=3,
    )  # fmt: skip
    current_bias_A: float = effect(
        0.0, "motor current measured at no current", "A", record="current_sensor_bias",
        needs="has_voltage", ge=-1e4, le=1e4,
    )  # fmt: skip
    current_lag_s: float = effect(
        0.0, "first-order lag of the motor current signal", "s", record="current_sensor_lag",
        needs="has_voltage", ge=0, le=60,
    )  # fmt: skip
    power_lag_s: float = effect(
        0.0, "first-order lag of the electric power signal", "s", record="power_sensor_lag",
        needs="has_voltage", ge=0, le=60,
    )  # fmt: skip
    speed_log_lag_s: float = effect(
        0.0, "first-order lag of the speed log", "s", record="speed_log_lag", needs="moves",
        ge=0, le=600,
    )  # fmt: skip

    @property
    def delays(self) -> dict[str, float]:
        """Delays [s] by key; each needs a delay line."""
        return {
            "sensors.torque_delay_s": self.torque_delay_s,
            "sensors.speed_delay_s": self.speed_delay_s,
        }


MEMORY = np.dtype(
    [
        ("rack", np.float64),  # rack position, or drive command [mm | V | N m]
        ("rack_start", np.float64),  # rack at the start of the step that ends at ``rack``
        ("rack_middle", np.float64),  # rack at the middle of that step
        ("blade_pitch", np.float64),  # pitch ratio of the blades behind the backlash [-]
        ("speed_log", np.float64),  # measurement of the speed log [m/s]
        ("shaft_torque", np.float64),  # measurement of the shaft torque meter [N m]
        ("shaft_speed", np.float64),  # measurement of the shaft speed sensor [rad/s]
        ("thrust", np.float64),  # measurement of the thrust sensor [N]
        ("motor_current", np.float64),  # measurement of the current sensor [A]
        ("electric_power", np.float64),  # measurement of the electric power sensor [W]
        # Input and output of each instrument lag, at the start of this step and of the previous one.
        ("true_speed", np.float64, (2,)),  # of the shaft [rad/s]
        ("lagged_speed", np.float64, (2,)),
        ("true_torque", np.float64, (2,)),  # at the torque meter, delayed [N m]
        ("lagged_torque", np.float64, (2,)),
        ("true_thrust", np.float64, (2,)),  # [N]
        ("lagged_thrust", np.float64, (2,)),
        ("true_current", np.float64, (2,)),  # [A]
        ("lagged_current", np.float64, (2,)),
        ("true_power", np.float64, (2,)),  # [W]
        ("lagged_power", np.float64, (2,)),
        ("pitch_ratio", np.float64),  # measurement of the pitch sensor [-]
        ("cursor", np.int64),
        ("demands", np.float64, (HISTORY,)),
        ("torques", np.float64, (HISTORY,)),
        ("speeds", np.float64, (HISTORY,)),
    ],
    align=True,
)
"""Memory of the plant between time steps: actuators, instruments, delay lines."""


@compiled
def _delayed(line: Any, cursor: int, delay_steps: float) -> float:
    """Return a delayed value of a delay line, linear between samples."""
    whole = int(delay_steps)
    part = delay_steps - whole
    newer = line[(cursor - whole) % HISTORY]
    older = line[(cursor - whole - 1) % HISTORY]
    return float(newer + part * (older - newer))


@compiled
def _lagged(lagged: float, before: float, now: float, steps: float) -> float:
    """Return the output of a first-order lag after a step, exact for an input that changes linearly.

    Args:
        lagged: output at the start of the step.
        before: input at the start of the step.
        now: input at the end of the step.
        steps: length of the step in time constants.
    """
    stays = math.exp(-steps)
    mean = (1.0 - stays) / steps
    return stays * lagged + (mean - stays) * before + (1.0 - mean) * now


@compiled
def _lag_instrument(true: Any, lagged: Any, now: float, steps: float) -> float:
    """Return the output of an instrument's lag, and store its input and output.

    Args:
        true: inputs at the start of this step and of the previous one, shape (2,); the first is written.
        lagged: outputs, as ``true``.
        now: input.
        steps: length of a step in time constants.
    """
    true[0] = now
    lagged[0] = _lagged(lagged[1], true[1], now, steps)
    return float(lagged[0])


@compiled
def begin_step(plant: Record, memory: Record, demand: float, dt: float) -> float:
    """Apply dead time, lag or rate limit, and end stops to a drive command.

    Returns:
        The input of the drive at the end of the step; the memory also holds those at its start and
        middle.
    """
    if plant.command_dead_time > 0.0:
        memory.demands[memory.cursor % HISTORY] = demand
        demand = _delayed(memory.demands, memory.cursor, plant.command_dead_time / dt)
    if plant.command_lag > 0.0:
        travel = lagged_travel(plant, demand, memory.rack, dt)
    else:
        travel = rack_travel(plant, demand, memory.rack, dt)
    memory.rack_start, memory.rack_middle, memory.rack = travel
    return float(memory.rack)


@compiled
def measured_pitch_of(plant: Record, pitch_ratio: Real) -> Real:
    """Return the pitch ratio [-] that the sensor measures."""
    return pitch_ratio + plant.pitch_sensor_offset


@compiled
def measured_torque_of(plant: Record, torque: Real) -> Real:
    """Return the torque [N m] that the shaft torque meter measures, without its delay and lag."""
    return plant.torque_sensor_gain * torque + plant.torque_sensor_bias


@compiled
def measured_speed_of(plant: Record, shaft_speed: Real) -> Real:
    """Return the shaft speed [rad/s] that the sensor measures, without its lag and delay."""
    return plant.speed_sensor_gain * shaft_speed


@compiled
def measured_thrust_of(plant: Record, thrust: Real) -> Real:
    """Return the thrust [N] that the sensor measures, without its lag."""
    return plant.thrust_sensor_gain * thrust + plant.thrust_sensor_bias


@compiled
def measured_current_of(plant: Record, current: Real) -> Real:
    """Return the motor current [A] that the sensor measures, without its lag."""
    return plant.current_sensor_gain * current + plant.current_sensor_bias


@compiled
def read_instruments(
    plant: Record, memory: Record, shaft_speed: float, outputs: Outputs, dt: float
) -> None:
    """Update all measurements and delay lines from the shaft speed and the outputs of this instant.

    A second call at the same instant changes nothing.
    """
    memory.blade_pitch = outputs.pitch_ratio
    memory.pitch_ratio = measured_pitch_of(plant, outputs.pitch_ratio)
    torque = outputs.shaft_torque
    if plant.torque_sensor_delay > 0.0:
        memory.torques[memory.cursor % HISTORY] = torque
        torque = _delayed(memory.torques, memory.cursor, plant.torque_sensor_delay / dt)
    if plant.torque_sensor_lag > 0.0:
        steps = dt / plant.torque_sensor_lag
        torque = _lag_instrument(memory.true_torque, memory.lagged_torque, torque, steps)
    memory.shaft_torque = measured_torque_of(plant, torque)
    thrust = outputs.thrust
    if plant.thrust_sensor_lag > 0.0:
        steps = dt / plant.thrust_sensor_lag
        thrust = _lag_instrument(memory.true_thrust, memory.lagged_thrust, thrust, steps)
    memory.thrust = measured_thrust_of(plant, thrust)
    current = outputs.motor_current
    if plant.current_sensor_lag > 0.0:
        steps = dt / plant.current_sensor_lag
        current = _lag_instrument(memory.true_current, memory.lagged_current, current, steps)
    memory.motor_current = measured_current_of(plant, current)
    memory.electric_power = outputs.electric_power
    if plant.power_sensor_lag > 0.0:
        steps = dt / plant.power_sensor_lag
        memory.electric_power = _lag_instrument(
            memory.true_power, memory.lagged_power, outputs.electric_power, steps
        )
    if plant.speed_sensor_lag > 0.0:
        steps = dt / plant.speed_sensor_lag
        shaft_speed = _lag_instrument(memory.true_speed, memory.lagged_speed, shaft_speed, steps)
    if plant.speed_sensor_delay > 0.0:
        memory.speeds[memory.cursor % HISTORY] = shaft_speed
        shaft_speed = _delayed(memory.speeds, memory.cursor, plant.speed_sensor_delay / dt)
    memory.shaft_speed = measured_speed_of(plant, shaft_speed)


@compiled
def end_step(plant: Record, memory: Record, ship_speed: float, dt: float) -> None:
    """Complete a step: advance the delay lines, stop the rack, and update the speed log."""
    memory.rack_start = memory.rack_middle = memory.rack
    memory.cursor += 1
    memory.true_speed[1], memory.lagged_speed[1] = memory.true_speed[0], memory.lagged_speed[0]
    memory.true_torque[1], memory.lagged_torque[1] = memory.true_torque[0], memory.lagged_torque[0]
    memory.true_thrust[1], memory.lagged_thrust[1] = memory.true_thrust[0], memory.lagged_thrust[0]
    memory.true_current[1], memory.lagged_current[1] = (
        memory.true_current[0],
        memory.lagged_current[0],
    )
    memory.true_power[1], memory.lagged_power[1] = memory.true_power[0], memory.lagged_power[0]
    if plant.speed_log_lag > 0.0:
        share = 1.0 - math.exp(-dt / plant.speed_log_lag)
        memory.speed_log += share * (ship_speed - memory.speed_log)
    else:
        memory.speed_log = ship_speed


@compiled
def settle_memory(
    plant: Record, memory: Record, state: State, outputs: Outputs, demand: float, dt: float
) -> None:
    """Fill the memory as in a steady state that has lasted for ever."""
    memory.rack = memory.rack_start = memory.rack_middle = demand
    memory.cursor = 0
    memory.demands[:] = demand
    memory.torques[:] = outputs.shaft_torque
    memory.speeds[:] = state.shaft_speed
    memory.true_speed[:] = memory.lagged_speed[:] = state.shaft_speed
    memory.true_torque[:] = memory.lagged_torque[:] = outputs.shaft_torque
    memory.true_thrust[:] = memory.lagged_thrust[:] = outputs.thrust
    memory.true_current[:] = memory.lagged_current[:] = outputs.motor_current
    memory.true_power[:] = memory.lagged_power[:] = outputs.electric_power
    memory.speed_log = state.ship_speed
    read_instruments(plant, memory, state.shaft_speed, outputs, dt)
