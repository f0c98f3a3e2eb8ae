"""The paper's drive train: its linear model, closed form, and the way to a ship's file and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from shaftline.mismatch.identification.drive_train import (
    SIX,
    DriveTrain,
    WorkingPoint,
    drive_train,
    from_poles,
    keys_of,
    needs_drive_train,
)
from shaftline.mismatch.identification.free_parameters import number_of
from shaftline.plant import equilibrium, linearise, load_ship

from .benches import poles_approximate, recorded, responses, step_responses, tug

POINT_C = WorkingPoint(5.89, 215.0, 1.29)
FULL = {
    "transmission.efficiency": 0.9,
    "transmission.inertia_propeller_side_kg_m2": 2e-5,
    "propeller.entrained_inertia_kg_m2": 3e-5,
    "propeller.relative_rotative_efficiency": 0.95,
    "transmission.coulomb_friction_propeller_side_N_m": 0.004,
    "transmission.viscous_friction_engine_side_N_m_s_rad": 2e-5,
    "transmission.viscous_friction_propeller_side_N_m_s_rad": 3e-5,
    "transmission.quadratic_drag_N_m_s2_rad2": 1e-7,
}


@pytest.mark.parametrize(
    ("name", "expected"),
    [  # remaining-systems.md 2.1: eta, tau_em, tau_we, C, s1, s2, z1, G_w(0), G_i(0)
        ("staircase", (0.3040, 2.108e-4, 0.3441, 2.626, -4739, -7.64, -2.91, 1.238, 0.753)),
        ("sine", (0.2799, 3.993e-4, 0.5174, 4.609, -2497, -8.93, -1.93, 1.172, 0.656)),
    ],
)
def test_linear_model_at_the_measured_point(name: str, expected: tuple[float, ...]) -> None:
    model = drive_train(tug(name)).linear(POINT_C)
    fast, slow = (pole.real for pole in model.poles)
    found = (
        0.5 * model.damping,
        model.electric_s,
        model.effective_s,
        model.c,
        fast,
        slow,
        model.zero,
        model.speed_gain,
        model.current_gain,
    )
    assert_allclose(found, expected, rtol=2e-3)
    assert_allclose(poles_approximate(model), (fast, slow), rtol=4e-3)


@pytest.mark.parametrize("values", [{}, FULL], ids=["published", "with all that may be beside"])
def test_linear_model_is_the_plant_s(values: dict[str, float]) -> None:
    """The house's exact derivatives, with everything that a file may add."""
    ship = tug().with_values(values)
    ratio = ship.transmission.gear_ratio
    steady = equilibrium(ship, 5.89, 1.0)
    train = drive_train(ship)
    point = train.equilibrium(5.89)
    assert_allclose(
        (point.motor_speed, point.current),
        (ratio * steady.state.shaft_speed, steady.state.motor_current),
        rtol=1e-9,
    )
    plant = linearise(ship, steady, ("shaft_speed", "motor_current"))
    model = train.linear(point)
    assert_allclose(sorted(model.poles, key=abs), sorted(plant.poles(), key=abs), rtol=1e-6)
    for frequency in (0.3, 8.0, 400.0, 5000.0):
        speed, current = (
            complex(plant[name, "drive"](1j * frequency)) * 5.89 / size
            for name, size in (
                ("shaft_speed", steady.state.shaft_speed),
                ("motor_current", steady.state.motor_current),
            )
        )
        assert_allclose(responses(model, frequency), (speed, current), rtol=1e-6)


def test_step_responses_are_the_simulation_s() -> None:
    """A step of 0.1 %, which is linear enough."""
    ship = tug()
    train = drive_train(ship)
    point = train.equilibrium(5.0)
    run = recorded(ship, np.r_[[5.0] * 10, [5.005] * 5000], 5e-5)
    time = run["time_s"].to_numpy()[10:] - 10 * 5e-5
    model = train.linear(point)
    speed = (3.0 * run["shaft_speed_rad_s"].to_numpy()[10:] / point.motor_speed - 1.0) / 1e-3
    current = (run["motor_current_A"].to_numpy()[10:] / point.current - 1.0) / 1e-3
    own_speed, own_current = step_responses(model, time)
    assert_allclose(own_speed, speed, atol=2e-3)
    assert_allclose(own_current, current, atol=8e-3)
    assert step_responses(model, 50.0) == pytest.approx((model.speed_gain, model.current_gain))


def test_closed_form_turns_the_linear_model_round() -> None:
    train = DriveTrain(5e-4, 0.016, 1.9, 2.4e-5, 0.0141, 1.3e-7, 1.5e-5)
    point = train.equilibrium(6.2)
    model = train.linear(point)
    fast, slow = poles_approximate(model)
    again = from_poles(
        fast, slow, model.zero, model.speed_gain, model.current_gain, point, train.viscous
    )
    assert_allclose(np.array(list(vars(again).values())), list(vars(train).values()), rtol=1e-9)


def test_closed_form_gives_column_four_of_table_five() -> None:
    """Printed poles, zero and gains; printed numbers within 2 %."""
    ship = tug()
    train = from_poles(-2500.0, -9.0, -2.0, 1.24, 0.71, POINT_C)
    printed = (6.03e-4, 0.0183, 1.51, 3.18e-5, 0.0170)
    found = (train.inductance, train.constant, train.resistance, train.inertia, train.friction)
    assert_allclose(found, printed, rtol=0.013)
    assert keys_of(ship, train)[SIX[-1]] == pytest.approx(0.136, rel=0.015)


@pytest.mark.parametrize("values", [{}, FULL], ids=["published", "with all that may be beside"])
def test_a_file_s_numbers_come_back(values: dict[str, float]) -> None:
    ship = tug().with_values(values)
    for key, value in keys_of(ship, drive_train(ship)).items():
        assert value == pytest.approx(number_of(ship, key).value, rel=1e-9), key


def test_numbers_at_the_motor_and_at_the_shaft() -> None:
    """Three to one: the paper's friction times 3, its inertia times 9."""
    train = drive_train(tug())
    assert train.friction == pytest.approx(0.0170)
    assert train.inertia == pytest.approx(3.18e-5)
    c = 1000.0 * 0.065**5 / (4.0 * math.pi**2 * 27.0)  # eq. 24 by omega^2
    assert train.load == pytest.approx(0.136 * c, rel=1e-9)


def test_without_propeller_load_the_speed_is_linear_in_the_voltage() -> None:
    train = DriveTrain(5e-4, 0.016, 2.0, 2.4e-5, 0.01, 0.0)
    point = train.equilibrium(5.0)
    assert point.motor_speed == pytest.approx((5.0 - 2.0 * 0.01 / 0.016) / 0.016)
    assert point.voltage == pytest.approx(5.0)
    with pytest.raises(ValueError, match=r"1 V does not overcome a friction of 0\.01 N m"):
        train.equilibrium(1.0)


def test_other_ships_are_refused_by_name() -> None:
    with pytest.raises(
        ValueError,
        match=r"step: frigate needs a motor .* has a drive of type 'diesel'",
    ):
        needs_drive_train(load_ship("frigate"), "step")
    with pytest.raises(ValueError, match="negative poles"):
        from_poles(-2500.0, 9.0, -2.0, 1.24, 0.71, POINT_C)
