from __future__ import annotations

import math

import numpy as np
import pytest

from shaftline.plant import Schedule, Ship, equilibrium, linearise, load_ship, simulate
from shaftline.plant.drives.dc_motor import (
    DcMotor,
    applied_voltage,
    drive_motor,
    motor_current_rate,
    motor_torque,
    steady_motor_current,
)

CONSTANT, RESISTANCE, INDUCTANCE = 0.0183, 1.51, 0.000603
STEP = 1e-30


def tug(**values: float) -> Ship:
    keys = {f"prime_mover.{key}": value for key, value in values.items()}
    return load_ship("tito-neri-sine").with_values(keys)


@pytest.mark.parametrize(
    ("demand", "voltage"),
    [(0.4, 0.0), (-0.4, 0.0), (2.0, 1.5), (-2.0, -1.5), (9.0, 6.0), (-9.0, -6.0), (6.4, 5.9)],
)
def test_dead_zone_is_taken_off_before_the_supply_limits(demand: float, voltage: float) -> None:
    plant = tug(command_dead_zone_V=0.5, supply_limit_V=6.0).record()
    assert applied_voltage(plant, demand, 0.0) == pytest.approx(voltage, rel=1e-15)


@pytest.mark.parametrize(
    ("demand", "slope"), [(0.3, 0.0), (3.0, 1.0), (-3.0, 1.0), (8.0, 0.0), (-8.0, 0.0)]
)
def test_voltage_has_an_exact_slope(demand: float, slope: float) -> None:
    plant = tug(command_dead_zone_V=0.5, supply_limit_V=6.0).record()
    assert complex(applied_voltage(plant, demand + STEP * 1j, 0.0)).imag / STEP == slope


@pytest.mark.parametrize(
    ("demand", "voltage"), [(3.0, 3.0), (6.0, 1.83 + 3.02), (-6.0, 1.83 - 3.02), (1.0, 1.0)]
)
def test_supply_holds_the_current_at_its_limit(demand: float, voltage: float) -> None:
    """At 100 rad/s the motor gives 1.83 V back, and 2 A more or less take 3.02 V."""
    plant = tug(supply_current_limit_A=2.0).record()
    found = applied_voltage(plant, demand, 100.0)
    assert found == pytest.approx(voltage, rel=1e-12)
    current = steady_motor_current(plant, found, 100.0)
    assert abs(current) <= 2.0 * (1.0 + 1e-12)


@pytest.mark.parametrize(("demand", "current"), [(1.83, 0.0), (60.0, 2.0), (-60.0, -2.0)])
def test_a_soft_supply_gives_all_of_a_small_current_and_never_more_than_its_own(
    demand: float, current: float
) -> None:
    """At 100 rad/s the motor gives 1.83 V back."""
    plant = tug(supply_soft_current_A=2.0).record()
    found = steady_motor_current(plant, applied_voltage(plant, demand, 100.0), 100.0)
    assert found == pytest.approx(current, abs=1e-12)
    slope = complex(applied_voltage(plant, 1.83 + STEP * 1j, 100.0)).imag / STEP
    assert slope == pytest.approx(1.0)


def test_current_is_what_the_back_emf_leaves() -> None:
    plant = tug().record()
    assert steady_motor_current(plant, 6.0, 200.0) == pytest.approx((6.0 - 3.66) / RESISTANCE)
    found = motor_current_rate(plant, 6.0, 200.0, 0.5)
    assert found == pytest.approx((6.0 - 3.66 - 0.755) / INDUCTANCE, rel=1e-12)


def test_torque_astern_is_a_fraction_and_has_no_jump() -> None:
    plant = tug(reverse_torque_fraction=0.8).record()
    assert motor_torque(plant, 2.0, 100.0) == 2.0 * CONSTANT
    assert motor_torque(plant, -2.0, -100.0) == pytest.approx(-2.0 * 0.8 * CONSTANT, rel=1e-15)
    slope = complex(motor_torque(plant, -2.0 + STEP * 1j, -100.0)).imag / STEP
    assert slope == pytest.approx(0.8 * CONSTANT)


@pytest.mark.parametrize(("current", "turning"), [(1.2, -100.0), (-1.2, 100.0)])
def test_a_supply_that_takes_nothing_back_leaves_no_brake(current: float, turning: float) -> None:
    """The back-EMF is 1.83 V, of which 1.21 A take all."""
    plant = tug(braking_loss_fraction=0.7).record()
    assert motor_torque(plant, current, turning) == pytest.approx(0.3 * CONSTANT * current)
    assert motor_torque(plant, current, -turning) == CONSTANT * current
    # against a voltage the other way the supply gives the current
    assert motor_torque(plant, 1.02 * current, turning) == CONSTANT * 1.02 * current


@pytest.mark.parametrize(
    ("demand", "share"), [(0.0, 0.25), (0.009, 0.25), (0.011, 1.0), (-6.0, 1.0)]
)
def test_a_switch_that_is_off_opens_the_armature(demand: float, share: float) -> None:
    """The end stop is 10 V; of the current that a short circuit would carry a quarter is left."""
    ship = tug(open_circuit_fraction=0.75, voltage_max_V=10.0)
    plant, closed = ship.record(), ship.with_values({"prime_mover.open_circuit_fraction": 0.0})
    found, short = (
        steady_motor_current(p, applied_voltage(p, demand, 200.0), 200.0)
        for p in (plant, closed.record())
    )
    assert found == pytest.approx(share * short, rel=1e-12)


@pytest.mark.parametrize("current", [-2.0, 0.0, 3.0])
def test_an_offset_adds_to_the_torque_and_not_to_the_current(current: float) -> None:
    tug = load_ship("tito-neri-sine")
    plant = tug.with_values({"prime_mover.torque_offset_N_m": -0.004}).record()
    speed = 150.0
    voltage = CONSTANT * speed + float(plant["armature_resistance"]) * current
    plant["armature_inductance"] = 0.0
    torque, found, *_ = drive_motor(plant, speed, voltage, 0.0)
    assert found == pytest.approx(current, abs=1e-12)
    assert torque == pytest.approx(CONSTANT * current - 0.004, abs=1e-14)


def test_a_motor_with_inductance_has_a_current_of_its_own() -> None:
    plant = tug(supply_limit_V=6.0).record()
    torque, current, rate, voltage = drive_motor(plant, 200.0, 9.0, 0.5)
    assert voltage == 6.0
    assert (torque, current) == (pytest.approx(0.5 * CONSTANT), 0.5)
    assert rate == pytest.approx((6.0 - 3.66 - 0.755) / INDUCTANCE, rel=1e-12)


def test_a_motor_without_inductance_has_its_steady_current() -> None:
    plant = tug(armature_inductance_H=0.0, supply_limit_V=6.0).record()
    torque, current, rate, _ = drive_motor(plant, 200.0, 9.0, 99.0)
    assert current == pytest.approx((6.0 - 3.66) / RESISTANCE)
    assert torque == pytest.approx(CONSTANT * (6.0 - 3.66) / RESISTANCE)
    assert rate == 0.0


def test_record_has_end_stops_either_way_and_no_rack() -> None:
    plant = tug(voltage_max_V=11.0).record()
    assert (plant["drive_min"], plant["drive_max"]) == (-11.0, 11.0)
    assert plant["rack_rate_limit"] == math.inf
    assert plant["prime_mover"] == DcMotor.code == 1
    assert (plant["motor_constant"], plant["armature_resistance"]) == (CONSTANT, RESISTANCE)


def test_it_is_driven_by_a_voltage() -> None:
    assert DcMotor.balance == "motor"
    assert DcMotor.demand.column == "motor_voltage_V"
    assert (DcMotor.demand.low, DcMotor.demand.high, DcMotor.demand.unit) == (-1e5, 1e5, "V")


def test_motor_under_a_dead_zone_runs_as_one_with_less_voltage() -> None:
    plain = equilibrium(tug(), 4.0, 1.0)
    found = equilibrium(tug(command_dead_zone_V=1.0), 5.0, 1.0)
    assert found.state.shaft_speed == pytest.approx(plain.state.shaft_speed, rel=1e-9)
    shifted = linearise(tug(command_dead_zone_V=1.0), found).B
    np.testing.assert_allclose(shifted, linearise(tug(), plain).B, rtol=1e-6, atol=1e-9)


def test_supply_limit_lies_below_the_end_stop() -> None:
    start = equilibrium(tug(), 4.0, 1.0).state
    runs = [
        simulate(tug(supply_limit_V=limit), Schedule(drive, 1.0), 1.0, initial=start)
        for limit, drive in ((6.0, 11.0), (6.0, 20.0), (np.inf, 6.0))
    ]
    for run in runs[1:]:
        np.testing.assert_array_equal(run["shaft_speed"], runs[0]["shaft_speed"])


@pytest.mark.parametrize("fraction", [1.0, 0.8])
def test_tug_turns_astern_as_fast_as_its_torque_lets_it(fraction: float) -> None:
    ship = tug(reverse_torque_fraction=fraction)
    start = equilibrium(ship, 6.0, 1.0).state
    ahead, astern = (
        simulate(ship, Schedule(drive, 1.0), 2.0, initial=start)[-1] for drive in (6.0, -6.0)
    )
    if fraction == 1.0:
        assert astern["shaft_speed"] == pytest.approx(-ahead["shaft_speed"], rel=1e-6)
        assert astern["propeller_torque"] == pytest.approx(-ahead["propeller_torque"], rel=1e-6)
    else:
        assert -0.98 * ahead["shaft_speed"] < astern["shaft_speed"] < -0.5 * ahead["shaft_speed"]
