"""The plant's equations of motion, put together from the parts.

``loads`` gives the torques and forces at one instant, ``evaluate`` the state's derivative under them:
the only place where it is formed (thesis eq. 2-20). Both accept complex numbers, so that the
linearisation can take exact derivatives by complex steps.
"""

from __future__ import annotations

from typing import NamedTuple

from ..core.compiled import Real, Record, compiled
from .actuators import blade_pitch, pitch_rate
from .drives import driven, holding_torque
from .hull import resistance, wake_inflow, water_speed
from .propeller import propeller_load
from .shaft import brake_torque_of, drive_torque, gauge_torque, load_torque, shaft_inertia
from .state import LAGGING, Inputs, Outputs, State, moved, without_rates
from .term_kernel import Heard, added
from .unexplained import ENGINE, HULL, PITCH_ACTUATOR, PROPELLER, unexplained
from .ventilation import can_ventilate, ventilation_rate


class Loads(NamedTuple):
    """Torques and forces on shaft and hull at one instant, and the rates of what lags."""

    shaft_speed: Real  # omega, the state's or the one that is held [rad/s]
    advance_velocity: Real  # v_a [m/s]
    submergence: Real  # of the propeller's centre [m]
    thrust: Real  # of one propeller [N]
    thrust_coefficient: Real  # KT [-] without air
    propeller_torque: Real  # M_p [N m]
    brake_torque: Real  # M_b [N m]
    motor_current: Real  # [A]
    drive_torque: Real  # on the shaft before the gauge [N m]
    load_torque: Real  # on the shaft behind it [N m]
    push: Real  # of all propellers on the hull [N]
    resistance: Real  # R [N]
    inflow_rate: Real  # [m/s2]
    brake_torque_rate: Real  # [N m/s]
    motor_current_rate: Real  # [A/s]
    added_pitch_rate: Real  # by terms and of unknown origin [1/s]


@compiled
def loads(plant: Record, state: State, inputs: Inputs, blade: Real) -> Loads:
    """Torques and forces at one instant.

    Args:
        plant: ship record.
        state: continuous states; real or complex.
        inputs: what acts at this instant.
        blade: pitch ratio of the blades [-].

    Constant divisors are written as reciprocals so that one division serves all stages of a step.
    """
    omega = state.shaft_speed
    if plant.speed_held != 0:
        omega = inputs.drive
    # propeller in the wake
    speed = water_speed(plant, state.ship_speed)
    kinematic = wake_inflow(plant, speed) + inputs.inflow
    kinematic = kinematic + inputs.inflow_slope * (state.position - inputs.inflow_position)
    submergence = plant.depth + inputs.elevation
    demand = inputs.drive
    heard = Heard(
        omega, state.ship_speed, blade, inputs.pitch_command, demand, kinematic,
        submergence, inputs.time,
    )  # fmt: skip
    more_thrust = more_drive_torque = more_load_torque = more_resistance = added_pitch_rate = 0.0
    if plant.term_count > 0:
        more = added(plant, heard)
        kinematic = kinematic + more.inflow_velocity
        demand = demand + more.drive
        more_thrust = more.thrust
        more_drive_torque = more.drive_torque
        more_load_torque = more.load_torque
        more_resistance = more.resistance
        added_pitch_rate = more.pitch_rate
    inflow_rate = 0.0
    advance = kinematic
    if plant.inflow_lag.real > 0.0:
        advance = state.inflow
        inflow_rate = (kinematic - state.inflow) / plant.inflow_lag
    load = propeller_load(plant, advance, omega, blade, submergence, state.ventilation)
    propeller_torque = load.torque * (1.0 / plant.relative_rotative_efficiency)  # eq. 2-5

    engine_speed = plant.gear_ratio * omega  # eq. 2-11
    mover = driven(plant, engine_speed, demand, state.brake_torque, state.motor_current)

    drive = drive_torque(plant, mover.brake_torque, omega)
    load_behind = load_torque(plant, propeller_torque, omega)
    drag = resistance(plant, speed, inputs.resistance_factor)
    thrust = load.thrust
    if plant.term_count > 0:
        thrust = thrust + more_thrust
        drive = drive + more_drive_torque
        load_behind = load_behind + more_load_torque
        drag = drag + more_resistance
    push = plant.propellers * (1.0 - plant.thrust_deduction) * thrust  # eq. 2-6
    if plant.unexplained_balance != 0:
        lacking = unexplained(plant, omega, state.ship_speed, blade, inputs.drive, inputs.time)
        if plant.unexplained_balance == ENGINE:
            drive = drive + lacking
        elif plant.unexplained_balance == PROPELLER:
            load_behind = load_behind - lacking
        elif plant.unexplained_balance == HULL:
            push = push + lacking
        elif plant.unexplained_balance == PITCH_ACTUATOR:
            added_pitch_rate = added_pitch_rate + lacking
    brake_torque = mover.brake_torque
    if plant.speed_held != 0:
        drive = holding_torque(plant, load_behind, inputs.drive_rate)
        brake_torque = brake_torque_of(plant, drive, omega)
    return Loads(
        omega,
        advance,
        submergence,
        thrust,
        load.thrust_coefficient,
        propeller_torque,
        brake_torque,
        mover.current,
        drive,
        load_behind,
        push,
        drag,
        inflow_rate,
        mover.brake_torque_rate,
        mover.current_rate,
        added_pitch_rate,
    )


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
    """
    blade = blade_pitch(plant, state.pitch_ratio, blade_before)
    acting = loads(plant, state, inputs, blade)
    acceleration = (acting.drive_torque - acting.load_torque) * (1.0 / shaft_inertia(plant))  # 2-1
    if plant.speed_held != 0:
        acceleration = inputs.drive_rate
    ship_acceleration = (acting.push - acting.resistance) * (1.0 / plant.mass)  # eq. 2-2
    if plant.hull_fixed != 0:
        ship_acceleration = 0.0
    blade_rate = pitch_rate(plant, inputs.pitch_command, state.pitch_ratio)
    if plant.unexplained_balance == PITCH_ACTUATOR or plant.term_count > 0:
        blade_rate = blade_rate + acting.added_pitch_rate
    air_rate = 0.0
    if can_ventilate(plant):
        air_rate = ventilation_rate(plant, state.ventilation, ventilated)
    return (
        State(
            pitch_ratio=blade_rate,
            shaft_speed=acceleration,
            ship_speed=ship_acceleration,
            position=state.ship_speed,
            brake_torque=acting.brake_torque_rate,
            inflow=acting.inflow_rate,
            ventilation=air_rate,
            motor_current=acting.motor_current_rate,
            shaft_angle=acting.shaft_speed,
        ),
        Outputs(
            pitch_ratio=blade,
            advance_velocity=acting.advance_velocity,
            thrust=acting.thrust,
            propeller_torque=acting.propeller_torque,
            shaft_torque=gauge_torque(plant, acting.drive_torque, acceleration),
            brake_torque=acting.brake_torque,
            shaft_acceleration=acceleration,
            resistance=acting.resistance,
            motor_current=acting.motor_current,
            thrust_coefficient=acting.thrust_coefficient,
            submergence=acting.submergence,
        ),
    )


@compiled
def settled(plant: Record, state: State, inputs: Inputs) -> State:
    """The same state with all that lags where its lag leads it: as if it had been there for ever.

    Args:
        plant: ship record.
        state: pitch, shaft speed, ship speed and position; lags are sought from the values given.
        inputs: what acts.

    Each lag is linear in its own state and no lag acts on another's, so one Newton step finds them; the
    others take away what rounding leaves.
    """
    for _ in range(3):
        rate, _ = evaluate(plant, state, inputs, state.pitch_ratio, False)
        beside, _ = evaluate(plant, moved(state, LAGGING, 1.0), inputs, state.pitch_ratio, False)
        state = without_rates(state, rate, beside)
    return state
