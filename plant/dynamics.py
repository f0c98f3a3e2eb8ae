"""Equations of motion of the plant, assembled from its models.

``loads`` returns the torques and forces at one instant. ``evaluate`` returns the derivative of the
state under these loads; the derivative is formed nowhere else (thesis eq. 2-20). Both accept complex
numbers, for exact linear models.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..core.compiled import Real, Record, compiled, compiled_apart
from ..core.lanes import one_by_one
from .actuators import blade_pitch, pitch_rate
from .drives import DriveOutput, DriveStates, drive_output, electric_power, holding_torque
from .expressions import InputSignals, LoadSignals, sum_input_terms, sum_load_terms
from .hull import resistance, wake_inflow, water_speed, wave_resistance
from .kinematics import over_ground
from .manoeuvring import (
    drift_inflow,
    hull_forces,
    planar_acceleration,
    reference_speed,
    through_water,
)
from .propeller import propeller_load
from .roll import heeled_hull_forces, roll_acceleration, slope_across
from .rudder import rudder_angle, rudder_forces, rudder_rate
from .shaft import (
    brake_torque_of,
    drive_torque,
    load_friction,
    load_torque,
    shaft_inertia,
    shaft_meter_torque,
)
from .state import (
    LAGGING,
    TERM_STATES,
    VENTILATION_DIRECTION,
    WAITING,
    Inputs,
    Outputs,
    State,
    directional_rate,
    shift_state,
    zero_lag_rates,
)
from .ventilation import can_ventilate, relative_submergence, suction_head, ventilation_rate
from .wind import wind_resistance


class Parts(NamedTuple):
    """Parts of the equations that a ship has; where they are constant, the compiler omits the others."""

    turns: bool  # sway, yaw and rudder
    rolls: bool
    has_terms: bool


@compiled
def parts_of(plant: Record) -> Parts:
    """Return the parts of a ship's equations."""
    return Parts(plant.turns != 0, plant.rolls != 0, plant.term_count > 0)


class Loads(NamedTuple):
    """Torques and forces on shaft and hull at one instant, and the rates of the lag states."""

    shaft_speed: Real  # omega, the state or the held speed [rad/s]
    advance_velocity: Real  # v_a [m/s]
    submergence: Real  # of the propeller's centre [m]
    thrust: Real  # of one propeller [N]
    thrust_coefficient: Real  # KT [-] without ventilation
    propeller_torque: Real  # M_p [N m]
    brake_torque: Real  # M_b [N m]
    mover: DriveOutput
    electric_power: Real  # of the drive [W]
    drive_torque: Real  # on the shaft before the torque meter [N m]
    load_torque: Real  # on the shaft behind the torque meter [N m]
    push: Real  # total propeller thrust on the hull, after thrust deduction [N]
    resistance: Real  # R [N]
    ahead: Real  # u through the water [m/s]
    across: Real  # v through the water [m/s]
    surge_force: Real  # of hull and rudder in a turn, without the resistance [N]
    side_force: Real  # Y [N]
    yaw_moment: Real  # N [N m]
    rudder_force: Real  # own side force of the rudder [N]
    inflow_rate: Real  # [m/s2]
    added_pitch_rate: Real  # from terms [1/s]
    term_rate_1: Real  # of the terms' states
    term_rate_2: Real
    term_rate_3: Real


@compiled
def loads(plant: Record, state: State, inputs: Inputs, blade: Real) -> Loads:
    """Return torques and forces at one instant, for a real or complex state.

    ``blade`` is the pitch ratio of the blades [-].
    """
    return _loads(plant, state, inputs, blade, parts_of(plant))


@compiled
def _loads(plant: Record, state: State, inputs: Inputs, blade: Real, parts: Parts) -> Loads:
    """Return the loads of a ship with some parts.

    Constant divisors are written as reciprocals so that one division serves all stages of a step.
    """
    omega = state.shaft_speed
    if plant.speed_held != 0:
        omega = inputs.drive
    speed, across = water_speed(plant, state.ship_speed), 0.0
    if parts.turns:
        speed, across = through_water(plant, state.ship_speed, state.sway_speed, state.heading)
    kinematic = wake_inflow(plant, speed)
    reference = speed
    if parts.turns:
        reference = reference_speed(plant, speed, across, state.yaw_rate)
        kinematic = kinematic * drift_inflow(plant, reference, across, state.yaw_rate)
    kinematic = kinematic + inputs.inflow
    place = state.position * inputs.wave_along + state.cross_track * inputs.wave_across
    departed = place - inputs.inflow_place
    kinematic = kinematic + inputs.inflow_slope * departed
    submergence = plant.depth + inputs.elevation + inputs.elevation_slope * departed
    demand = inputs.drive
    states = (state.term_1, state.term_2, state.term_3)
    rudder = 0.0
    if parts.turns:
        rudder = rudder_angle(plant, state.rudder_angle, inputs.rudder_command)
    input_signals = InputSignals(
        omega,
        state.ship_speed,
        blade,
        inputs.pitch_command,
        demand,
        kinematic,
        submergence,
        inputs.time,
        state.sway_speed,
        state.yaw_rate,
        state.heading,
        rudder,
        state.shaft_angle,
    )
    if parts.has_terms and plant.term_early > 0:
        before = sum_input_terms(plant, input_signals, states, inputs.outside)
        kinematic = kinematic + before.inflow_velocity
        demand = demand + before.drive
    inflow_rate = 0.0
    advance = kinematic
    if plant.inflow_lag.real > 0.0:
        advance = state.inflow
        inflow_rate = (kinematic - state.inflow) / plant.inflow_lag
    load = propeller_load(plant, advance, omega, blade, submergence, state.ventilation)
    propeller_torque = load.torque * (1.0 / plant.relative_rotative_efficiency)  # eq. 2-5

    engine_speed = plant.gear_ratio * omega  # eq. 2-11
    driving = DriveStates(state.brake_torque, state.motor_current, state.charge, state.warmth)
    mover = drive_output(plant, engine_speed, demand, driving)

    drive = drive_torque(plant, mover.brake_torque, omega)
    load_behind = load_torque(plant, propeller_torque, omega)
    drag = resistance(plant, speed, inputs.resistance_factor)
    if plant.wave_drag_length.real > 0.0:
        drag = drag + wave_resistance(plant, inputs.head_sea, speed)
    if plant.wind_area.real > 0.0 and inputs.wind.real != 0.0:
        drag = drag + wind_resistance(
            plant,
            inputs.wind,
            inputs.wave_along,
            inputs.wave_across,
            state.ship_speed,
            state.sway_speed,
            state.heading,
        )
    thrust = load.thrust
    surge_force = side_force = yaw_moment = rudder_force = 0.0
    if parts.turns:
        surge_force, side_force, yaw_moment = hull_forces(plant, reference, across, state.yaw_rate)
        x, y, n, rudder_force = rudder_forces(
            plant, rudder, kinematic, thrust, across, state.yaw_rate
        )
        surge_force, side_force, yaw_moment = surge_force + x, side_force + y, yaw_moment + n
    if parts.rolls:
        y, n = heeled_hull_forces(plant, reference, state.roll_angle)
        side_force, yaw_moment = side_force + y, yaw_moment + n
    added_pitch_rate = term_rate_1 = term_rate_2 = term_rate_3 = 0.0
    if parts.has_terms:
        load_signals = LoadSignals(
            thrust,
            propeller_torque,
            mover.brake_torque,
            drag,
            pitch_rate(plant, inputs.pitch_command, state.pitch_ratio),
        )
        more = sum_load_terms(plant, input_signals, load_signals, states, inputs.outside)
        thrust = thrust + more.thrust
        drive = drive + more.drive_torque
        load_behind = load_behind + more.load_torque
        drag = drag + more.resistance
        side_force = side_force + more.side_force
        yaw_moment = yaw_moment + more.yaw_moment
        added_pitch_rate = more.pitch_rate
        term_rate_1, term_rate_2, term_rate_3 = more.rate_1, more.rate_2, more.rate_3
    if plant.load_friction != 0.0:
        drive = drive - load_friction(plant, load_behind, omega)
    push = plant.propellers * (1.0 - plant.thrust_deduction) * thrust  # eq. 2-6
    brake_torque = mover.brake_torque
    if plant.speed_held != 0:
        drive = holding_torque(plant, load_behind, inputs.drive_rate)
        brake_torque = brake_torque_of(plant, drive, omega)
    return Loads(
        shaft_speed=omega, advance_velocity=advance, submergence=submergence, thrust=thrust,
        thrust_coefficient=load.thrust_coefficient, propeller_torque=propeller_torque,
        brake_torque=brake_torque, mover=mover,
        electric_power=electric_power(plant, mover, brake_torque, engine_speed), drive_torque=drive,
        load_torque=load_behind, push=push, resistance=drag, ahead=speed, across=across,
        surge_force=surge_force, side_force=side_force, yaw_moment=yaw_moment,
        rudder_force=rudder_force, inflow_rate=inflow_rate, added_pitch_rate=added_pitch_rate,
        term_rate_1=term_rate_1, term_rate_2=term_rate_2, term_rate_3=term_rate_3,
    )  # fmt: skip


@compiled
def evaluate(
    plant: Record, state: State, inputs: Inputs, blade_before: float
) -> tuple[State, Outputs]:
    """Return the derivative of the state and the outputs (thesis eq. 2-20 with the optional effects).

    The state is real or complex; ``blade_before`` is the blades' pitch ratio after the previous step
    [-], for the backlash.
    """
    return _evaluate(plant, state, inputs, blade_before, parts_of(plant))


@compiled
def evaluate_without_roll(
    plant: Record, state: State, inputs: Inputs, blade_before: float
) -> tuple[State, Outputs]:
    """Return what :func:`evaluate` returns, for a ship without roll, whose steps so lose no time."""
    parts = Parts(plant.turns != 0, False, plant.term_count > 0)
    return _evaluate(plant, state, inputs, blade_before, parts)


@compiled
def evaluate_straight(
    plant: Record, state: State, inputs: Inputs, blade_before: Real
) -> tuple[State, Outputs]:
    """Return what :func:`evaluate` returns, for ships that keep their course and have no terms."""
    return _evaluate(plant, state, inputs, blade_before, Parts(False, False, False))


@compiled
def _evaluate(
    plant: Record, state: State, inputs: Inputs, blade_before: float, parts: Parts
) -> tuple[State, Outputs]:
    blade = blade_pitch(plant, state.pitch_ratio, blade_before)
    acting = _loads(plant, state, inputs, blade, parts)
    acceleration = inputs.drive_rate
    if plant.speed_held == 0:  # eq. 2-1
        acceleration = (acting.drive_torque - acting.load_torque) * (1.0 / shaft_inertia(plant))
    ship_acceleration = (acting.push - acting.resistance) * (1.0 / plant.mass)  # eq. 2-2
    if plant.hull_fixed != 0:
        ship_acceleration = 0.0
    track_rate, cross_rate = state.ship_speed, 0.0
    sway_acceleration = yaw_acceleration = turning_rate = helm_rate = 0.0
    rolling_rate = rolling_acceleration = 0.0
    if parts.turns:
        track_rate, cross_rate = over_ground(state)
        turning_rate = state.yaw_rate
        ship_acceleration, sway_acceleration, yaw_acceleration = planar_acceleration(
            plant,
            acting.ahead,
            acting.across,
            state.yaw_rate,
            state.heading,
            acting.push - acting.resistance + acting.surge_force,
            acting.side_force,
            acting.yaw_moment,
        )
        if plant.rudder_lag.real > 0.0:
            helm_rate = rudder_rate(plant, inputs.rudder_command, state.rudder_angle)
    if parts.rolls:
        rolling_rate = state.roll_rate
        lateral = sway_acceleration + state.yaw_rate * state.ship_speed  # over ground
        rolling_acceleration = roll_acceleration(
            plant,
            state.roll_angle,
            state.roll_rate,
            acting.ahead,
            lateral + plant.centre_of_gravity * yaw_acceleration,
            acting.rudder_force,
            slope_across(
                inputs.elevation_slope, inputs.wave_along, inputs.wave_across, state.heading
            ),
        )
    torque = shaft_meter_torque(plant, acting.drive_torque, acting.load_torque, acceleration)
    blade_rate = pitch_rate(plant, inputs.pitch_command, state.pitch_ratio)
    if parts.has_terms:
        blade_rate = blade_rate + acting.added_pitch_rate
    air_rate = 0.0
    if can_ventilate(plant):
        relative = relative_submergence(plant, acting.submergence)
        suction = suction_head(plant, acting.thrust_coefficient, acting.shaft_speed)
        air_rate = ventilation_rate(plant, state.ventilation, relative, suction)
    rates = State(
        pitch_ratio=blade_rate,
        shaft_speed=acceleration,
        ship_speed=ship_acceleration,
        position=track_rate,
        brake_torque=acting.mover.brake_torque_rate,
        charge=acting.mover.charge_rate,
        warmth=acting.mover.warmth_rate,
        inflow=acting.inflow_rate,
        ventilation=air_rate,
        motor_current=acting.mover.current_rate,
        shaft_angle=acting.shaft_speed,
        sway_speed=sway_acceleration,
        yaw_rate=yaw_acceleration,
        heading=turning_rate,
        cross_track=cross_rate,
        rudder_angle=helm_rate,
        roll_angle=rolling_rate,
        roll_rate=rolling_acceleration,
        term_1=acting.term_rate_1,
        term_2=acting.term_rate_2,
        term_3=acting.term_rate_3,
    )
    return rates, Outputs(
        pitch_ratio=blade,
        advance_velocity=acting.advance_velocity,
        thrust=acting.thrust,
        propeller_torque=acting.propeller_torque,
        shaft_torque=torque,
        brake_torque=acting.brake_torque,
        shaft_acceleration=acceleration,
        resistance=acting.resistance,
        motor_current=acting.mover.current,
        thrust_coefficient=acting.thrust_coefficient,
        submergence=acting.submergence,
        shaft_power=torque * acting.shaft_speed,
        electric_power=acting.electric_power,
    )


@one_by_one
@compiled_apart
def evaluate_apart(
    plant: Record, state: State, inputs: Inputs, blade_before: float
) -> tuple[State, Outputs]:
    """Return what :func:`evaluate` returns; callers that are not called often compile faster with it."""
    return evaluate(plant, state, inputs, blade_before)


@compiled_apart
def settle_lags(plant: Record, state: State, inputs: Inputs) -> State:
    """Return a state in which all lag states are at rest for the present speeds and inputs.

    Each lag is linear in its own state and independent of the other lags, so one Newton step solves it;
    further steps remove rounding errors. The torque of a diesel and its charge air or warmth depend on
    each other and converge by iteration. Ventilation and the states of terms are solved one at a time,
    first in the direction in which they move. A state whose rate has no root stays unchanged.
    """
    waits = plant.charge_lag.real > 0.0 or plant.warmth_lag.real > 0.0
    for _ in range(60 if waits else 3):
        before = state
        state = _without_rates(plant, state, inputs, LAGGING)
        if waits:
            state = _without_rates(plant, state, inputs, WAITING)
        if can_ventilate(plant):
            rest = _distance_to_rest(plant, state, inputs, VENTILATION_DIRECTION)
            state = shift_state(state, VENTILATION_DIRECTION, rest)
        for k in range(plant.term_states):
            rest = _distance_to_rest(plant, state, inputs, TERM_STATES[k])
            state = shift_state(state, TERM_STATES[k], rest)
        if state == before:  # Equal to the last bit: further iterations would change nothing.
            break
    return state


@compiled
def _without_rates(plant: Record, state: State, inputs: Inputs, probe: State) -> State:
    rate, _ = evaluate_apart(plant, state, inputs, state.pitch_ratio)
    beside, _ = evaluate_apart(plant, shift_state(state, probe, 1.0), inputs, state.pitch_ratio)
    return zero_lag_rates(state, rate, beside, probe)


@compiled
def _distance_to_rest(plant: Record, state: State, inputs: Inputs, direction: State) -> float:
    """Return the distance along a direction to the point where the rate vanishes; 0 if there is none.

    The search doubles its steps until the rate changes sign, then bisects: first in the direction in
    which the state moves, then in the opposite one.
    """
    rate, _ = evaluate_apart(plant, state, inputs, state.pitch_ratio)
    begins = directional_rate(rate, direction)
    if begins == 0.0:
        return 0.0
    near = far = 0.0
    for side in (1.0, -1.0):
        near, far = 0.0, math.copysign(1e-6, side * begins)
        for _ in range(80):
            rate, _ = evaluate_apart(
                plant, shift_state(state, direction, far), inputs, state.pitch_ratio
            )
            if directional_rate(rate, direction) * begins <= 0.0:
                break
            near, far = far, 2.0 * far
        else:
            continue
        break
    else:
        return 0.0
    for _ in range(60):
        middle = 0.5 * (near + far)
        rate, _ = evaluate_apart(
            plant, shift_state(state, direction, middle), inputs, state.pitch_ratio
        )
        if directional_rate(rate, direction) * begins > 0.0:
            near = middle
        else:
            far = middle
    return 0.5 * (near + far)
