"""Derivatives by complex steps, of a state and of every number of a ship's file."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Ship, equilibrium, linearise, load_ship, ship_names
from shaftline.plant.derivatives import (
    COMPLEX_WORD,
    STEP,
    as_words,
    complex_record,
    derivatives,
    parameter_slope,
)
from shaftline.plant.dynamics import evaluate
from shaftline.plant.keys import ShipParameter
from shaftline.plant.manoeuvring import Manoeuvring
from shaftline.plant.record import PLANT
from shaftline.plant.ship import ShipError
from shaftline.plant.state import LAGS, Inputs, Outputs, State, active_states
from shaftline.plant.terms import Term

BLADE_BEFORE = 1.0  # so far below the actuator that play drags the blades along
STILL = State(*(0.0 for _ in State._fields))
RICH = {
    "hull.fouling_fraction": 0.1,
    "hull.wake_slope_s_m": 0.01,
    "hull.wake_reference_speed_m_s": 5.0,
    "hull.current_m_s": 0.3,
    "propeller.roughness_drag": 0.002,
    "propeller.inflow_lag_s": 0.5,
    "propeller.cavitation_breakdown": 0.5,
    "propeller.cavitation_onset_number": 40.0,
    "ventilation.thrust_loss": 0.3,
    "ventilation.torque_loss": 0.2,
    "ventilation.surface_loss": 0.5,
    "ventilation.onset_submergence": 1.0,
    "ventilation.static_head_share": 0.1,
    "prime_mover.lag_s": 0.4,
    "prime_mover.torque_curvature_N_m_s2_rad2": -0.2,
    "transmission.coulomb_friction_engine_side_N_m": 5e3,
    "transmission.viscous_friction_propeller_side_N_m_s_rad": 300.0,
    "transmission.quadratic_drag_N_m_s2_rad2": 20.0,
    "pitch_actuator.dead_band": 0.01,
    "pitch_actuator.rate_limit_per_s": 0.5,
    "pitch_actuator.backlash": 0.02,
}
"""A frigate on which every effect acts at once."""


def numbers(ship: Ship) -> list[ShipParameter]:
    """All numbers of a ship that the kernels' record holds."""
    sections = {name: getattr(ship, name) for name in type(ship).model_fields}
    keys = [
        f"{name}.{key}"
        for name, section in sections.items()
        for key in getattr(type(section), "model_fields", ())
    ]
    return [ship.parameter(key) for key in keys if ship.has_key(key)]


def along(twin: Any, state: State, inputs: Inputs, blade: float, direction: State) -> Any:
    """Return ``derivatives`` with a complex inflow, as the filter calls it: then it compiles once."""
    acting: Any = inputs._replace(inflow=complex(inputs.inflow))
    return derivatives(twin, state, acting, blade, direction)


def along_number(ship: Ship, number: ShipParameter, state: State, inputs: Inputs) -> Any:
    twin = complex_record(ship.record())
    acts = parameter_slope(ship, number.key)
    as_words(twin)[COMPLEX_WORD[acts.words] + 1] = STEP * acts.slopes
    rate, outputs = along(twin, state, inputs, BLADE_BEFORE, STILL)
    return np.array([*rate, *outputs])


def by_differences(
    ship: Ship, number: ShipParameter, state: State, inputs: Inputs
) -> tuple[Any, Any]:
    """Differences of second order, one-sided at a lower bound, and how far rounding may spoil them."""
    step = 1e-6 * max(abs(number.value), 1e-3)
    at_bound = number.value == number.info.low
    weights = {0.0: -1.5, 1.0: 2.0, 2.0: -0.5} if at_bound else {1.0: 0.5, -1.0: -0.5}
    slope: Any = 0.0
    size: Any = 0.0
    for steps, weight in weights.items():
        record = ship.record()
        number.write(record, number.value + steps * step)
        rate, outputs = evaluate(record, state, inputs, BLADE_BEFORE)
        values = np.array([*rate, *outputs], dtype=float)
        slope, size = slope + weight * values / step, np.abs(values)
    return slope, size * 1e-13 / step


def somewhere(ship: Ship) -> tuple[State, Inputs]:
    """A state off any steady one, in which every part works."""
    drive = {"mm": 21.0, "V": 8.0, "N m": 5.0, "rad/s": 9.7}[ship.prime_mover.demand.unit]
    speed = 9.7 if ship.has_diesel or ship.turns else 60.0
    state = State(1.1, speed, 6.3 if ship.moves else 0.0, 0.0, 2.5e4, 5.5, 0.4, 3.0)
    if ship.turns:
        length = ship.manoeuvring.length_m
        state = state._replace(
            sway_speed=0.9, yaw_rate=-1.9 / length, heading=0.7, rudder_angle=0.2
        )
    return state, Inputs(
        drive, 1.25, 0.2, elevation=-1.0, resistance_factor=1.0, time=3.0, rudder_command=0.15
    )


SHIPS = [*ship_names(), "rich"]
BEGINS_A_STATE = {*LAGS.values(), "ventilation_thrust_loss", "ventilation_torque_loss"}
"""Fields that let a state begin where they leave 0."""


def ship_of(name: str) -> Ship:
    return load_ship("frigate").with_values(RICH) if name == "rich" else load_ship(name)


@pytest.mark.parametrize("name", SHIPS)
def test_derivative_to_every_number_of_a_file(name: str) -> None:
    ship = ship_of(name)
    state, inputs = somewhere(ship)
    felt = set()
    for number in numbers(ship):
        begins = number.value == 0.0 and number.field in BEGINS_A_STATE
        if begins or not math.isfinite(number.value):
            continue
        exact = along_number(ship, number, state, inputs)
        found, rounding = by_differences(ship, number, state, inputs)
        assert np.all(np.abs(exact - found) <= 2e-6 * np.abs(exact) + rounding), number.key
        if np.any(exact):
            felt.add(number.key)
    expected = {
        "water.density_kg_m3",
        "propeller.diameter_m",
        "propeller.roughness_drag",
        "transmission.coulomb_friction_engine_side_N_m",
        "transmission.quadratic_drag_N_m_s2_rad2",
        "transmission.inertia_engine_side_kg_m2",
        "transmission.gear_ratio",
    }
    if ship.turns:
        own = {f"manoeuvring.{name}" for name in Manoeuvring.model_fields}
        expected = {key for key in own if ship.has_key(key) and "_drift" not in key}
        expected -= {"manoeuvring.propeller_position_m"} if name != "kvlcc2" else set()
        expected -= {"manoeuvring.draught_m"} if name != "kvlcc2" else set()
        expected |= {f"rudder.{key}" for key in ("area_m2", "position_m", "yaw_lever_m")}
    assert expected <= felt, expected - felt
    if name == "rich":
        assert set(RICH) - {"pitch_actuator.rate_limit_per_s"} <= felt


@pytest.mark.parametrize("name", ["frigate", "rich", "tito-neri-sine"])
def test_derivatives_to_the_states_are_those_of_the_linear_model(name: str) -> None:
    ship = ship_of(name)
    drive = 22.0 if ship.has_diesel else 6.0
    point = equilibrium(ship, drive, ship.propeller.pitch_ratio_max)
    names = active_states(ship.record())
    model = linearise(ship, point, ("shaft_torque", "thrust"))
    twin = complex_record(ship.record())
    state = State(*map(float, point.state))
    acting = point.inputs
    blade = float(point.outputs.pitch_ratio)
    for column, moves in enumerate(names):
        direction = STILL._replace(**{moves: 1.0})
        rate, outputs = along(twin, state, acting, blade, direction)
        found = [getattr(rate, own) for own in names]
        np.testing.assert_allclose(found, model.A[:, column], rtol=1e-12, atol=1e-15)
        found = [outputs.shaft_torque, outputs.thrust]
        np.testing.assert_allclose(found, model.C[:, column], rtol=1e-12, atol=1e-9)


def test_a_number_of_a_term_has_its_derivative_too() -> None:
    term = Term(
        id="drag",
        acts_on="load_torque",
        expression="a * shaft_speed + b * shaft_speed ** 2",
        parameters={"a": 100.0, "b": 7.0},  # type: ignore[dict-item]
    )
    ship = load_ship("frigate").with_term(term)
    state, inputs = somewhere(ship)
    own = Outputs._fields.index("shaft_acceleration") + len(State._fields)
    inertia = 53697.0 + 14411.0
    for key, power in (("term.drag.a", 1), ("term.drag.b", 2)):
        exact = along_number(ship, ship.parameter(key), state, inputs)
        assert exact[own] == pytest.approx(-(state.shaft_speed**power) / inertia, rel=1e-12)


def test_the_complex_record_holds_the_same_ship() -> None:
    ship = ship_of("rich")
    record, twin = ship.record(), complex_record(ship.record())
    for name in PLANT.names or ():
        np.testing.assert_array_equal(np.asarray(twin[name]), np.asarray(record[name]))
    for number in numbers(ship):
        acts = parameter_slope(ship, number.key)
        assert (acts.value, acts.info) == (number.value, number.info)
        assert (
            as_words(record)[acts.words] == as_words(twin)[COMPLEX_WORD[acts.words]] == number.value
        )
        assert as_words(twin)[COMPLEX_WORD[acts.words] + 1] == 0.0


def test_a_coefficient_that_stands_in_a_table_has_its_derivative_too() -> None:
    """Thrust and torque of a bollard propeller are multiples of KT and KQ."""
    ship = load_ship("rov-thruster")
    state, inputs = somewhere(ship)
    _, outputs = evaluate(ship.record(), state, inputs, BLADE_BEFORE)
    for key, output in (
        ("thrust_coefficient", "thrust"),
        ("torque_coefficient", "propeller_torque"),
    ):
        acts = parameter_slope(ship, f"propeller.{key}")
        assert acts.value == getattr(ship.propeller, key)
        twin = complex_record(ship.record())
        as_words(twin)[COMPLEX_WORD[acts.words] + 1] = STEP * acts.slopes
        _, found = along(twin, state, inputs, BLADE_BEFORE, STILL)
        expected = getattr(outputs, output) / acts.value
        assert getattr(found, output) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("key", "why"),
    [
        ("hull.nonsense", "frigate: hull.nonsense is not a known key"),
        ("diesel.lag_s", "frigate: diesel is not a known key"),  # the kind, not the section
        ("prime_mover.armature_resistance_ohm", "belongs to another type of prime_mover"),
        ("hull.propellers", "hull.propellers has no field of its own"),
        ("propeller.expanded_area_ratio", "the equations use tables computed from it"),
        ("tolerances.mass", "tolerances.mass has no derivative"),
    ],
)
def test_a_number_without_derivative_is_named(key: str, why: str) -> None:
    with pytest.raises(ShipError, match=re.escape(why)):
        parameter_slope(load_ship("frigate"), key)
