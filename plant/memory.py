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

_SPEED, _TORQUE, _THRUST, _CURRENT, _POWER = range(5)  # instruments with a lag


class Sensors(Section):
    """Systematic errors of the instruments (noise is added where measurements are used)."""

    # fmt: off
    pitch_offset: float = effect(0.0, "measured P/D minus P/D", record="pitch_sensor_offset", ge=-0.5,
        le=0.5)
    torque_bias_N_m: float = effect(0.0, "torque measured at no torque", "N m",
        record="torque_sensor_bias", ge=-1e7, le=1e7)
    torque_gain: float = effect(1.0, "measured torque / torque", record="torque_sensor_gain", gt=0, le=3)
    torque_delay_s: float = effect(0.0, "delay of the torque signal", "s", record="torque_sensor_delay",
        ge=0, le=6)
    torque_lag_s: float = effect(0.0, "first-order lag of the torque signal", "s",
        record="torque_sensor_lag", ge=0, le=60)
    speed_gain: float = effect(1.0, "measured shaft speed / shaft speed, as with a wrong pulse count",
        record="speed_sensor_gain", needs="turns_freely", gt=0, le=3)
    speed_delay_s: float = effect(0.0, "delay of the shaft speed signal", "s",
        record="speed_sensor_delay", ge=0, le=6)
    speed_lag_s: float = effect(0.0, "first-order lag of the shaft speed signal", "s",
        record="speed_sensor_lag", ge=0, le=60)
    thrust_gain: float = effect(1.0, "measured thrust / thrust", record="thrust_sensor_gain",
        needs="has_propeller", gt=0, le=3)
    thrust_bias_N: float = effect(0.0, "thrust measured at no thrust", "N", record="thrust_sensor_bias",
        needs="has_propeller", ge=-1e7, le=1e7)
    thrust_lag_s: float = effect(0.0, "first-order lag of the thrust signal", "s",
        record="thrust_sensor_lag", needs="has_propeller", ge=0, le=60)
    current_gain: float = effect(1.0, "measured motor current / current", record="current_sensor_gain",
        needs="has_voltage", gt=0, le=3)
    current_bias_A: float = effect(0.0, "motor current measured at no current", "A",
        record="current_sensor_bias", needs="has_voltage", ge=-1e4, le=1e4)
    current_lag_s: float = effect(0.0, "first-order lag of the motor current signal", "s",
        record="current_sensor_lag", needs="has_voltage", ge=0, le=60)
    power_lag_s: float = effect(0.0, "first-order lag of the electric power signal", "s",
        record="power_sensor_lag", needs="has_voltage", ge=0, le=60)
    speed_log_gain: float = effect(1.0, "measured ship speed / ship speed", record="speed_log_gain",
        needs="moves", gt=0, le=3)
    speed_log_lag_s: float = effect(0.0, "first-order lag of the speed log", "s", record="speed_log_lag",
        needs="moves", ge=0, le=600)
    # fmt: on

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
        # Input and output of each instrument lag, at the start of this step and of the previous one:
        # shaft speed [rad/s], delayed shaft torque [N m], thrust [N], motor current [A], power [W].
        ("true", np.float64, (5, 2)),
        ("lagged", np.float64, (5, 2)),
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
def _lagged(memory: Record, instrument: int, now: float, lag: float, dt: float) -> float:
    """Return the output of an instrument's first-order lag, exact for an input that changes linearly.

    Its input ``now`` and its output are stored; a ``lag`` [s] of 0 returns the input.
    """
    if lag <= 0.0:
        return now
    true, lagged = memory.true[instrument], memory.lagged[instrument]
    steps = dt / lag
    stays = math.exp(-steps)
    mean = (1.0 - stays) / steps
    true[0] = now
    lagged[0] = stays * lagged[1] + (mean - stays) * true[1] + (1.0 - mean) * now
    return float(lagged[0])


@compiled
def begin_step(plant: Record, memory: Record, demand: float, dt: float) -> float:
    """Apply dead time, lag or rate limit, and end stops to a drive command; return its end value.

    The memory also holds the inputs of the drive at the start and the middle of the step.
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
def measured_ship_speed_of(plant: Record, ship_speed: Real) -> Real:
    """Return the ship speed [m/s] that the speed log measures, without its lag."""
    return plant.speed_log_gain * ship_speed


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
    torque = _lagged(memory, _TORQUE, torque, plant.torque_sensor_lag, dt)
    memory.shaft_torque = measured_torque_of(plant, torque)
    thrust = _lagged(memory, _THRUST, outputs.thrust, plant.thrust_sensor_lag, dt)
    memory.thrust = measured_thrust_of(plant, thrust)
    current = _lagged(memory, _CURRENT, outputs.motor_current, plant.current_sensor_lag, dt)
    memory.motor_current = measured_current_of(plant, current)
    power = outputs.electric_power
    memory.electric_power = _lagged(memory, _POWER, power, plant.power_sensor_lag, dt)
    shaft_speed = _lagged(memory, _SPEED, shaft_speed, plant.speed_sensor_lag, dt)
    if plant.speed_sensor_delay > 0.0:
        memory.speeds[memory.cursor % HISTORY] = shaft_speed
        shaft_speed = _delayed(memory.speeds, memory.cursor, plant.speed_sensor_delay / dt)
    memory.shaft_speed = measured_speed_of(plant, shaft_speed)


@compiled
def end_step(plant: Record, memory: Record, ship_speed: float, dt: float) -> None:
    """Complete a step: advance the delay lines, stop the rack, and update the speed log."""
    memory.rack_start = memory.rack_middle = memory.rack
    memory.cursor += 1
    for k in range(5):
        memory.true[k, 1], memory.lagged[k, 1] = memory.true[k, 0], memory.lagged[k, 0]
    log = measured_ship_speed_of(plant, ship_speed)
    if plant.speed_log_lag > 0.0:
        share = 1.0 - math.exp(-dt / plant.speed_log_lag)
        memory.speed_log += share * (log - memory.speed_log)
    else:
        memory.speed_log = log


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
    for k, value in enumerate(
        (
            state.shaft_speed,
            outputs.shaft_torque,
            outputs.thrust,
            outputs.motor_current,
            outputs.electric_power,
        )
    ):
        for now in range(2):
            memory.true[k, now] = memory.lagged[k, now] = value
    memory.speed_log = measured_ship_speed_of(plant, state.ship_speed)
    read_instruments(plant, memory, state.shaft_speed, outputs, dt)
