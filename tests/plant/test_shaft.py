from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Equilibrium, Schedule, Ship, State, equilibrium, load_ship, simulate
from shaftline.plant.shaft import (
    brake_torque_of,
    drive_torque,
    friction_before_meter,
    friction_torque,
    inertia_behind_meter,
    load_friction,
    load_torque,
    quadratic_drag,
    shaft_inertia,
    shaft_meter_torque,
)
from shaftline.plant.ship_files import template

GEAR, EFFICIENCY = 7.38, 0.95
LEFT, RIGHT = 53697.0, 14411.0
"""Inertias before and behind the gauge, thesis Table B-1 [kg m2]."""
COULOMB = "transmission.coulomb_friction_engine_side_N_m"
STEP = 1e-30
PLANT = load_ship("frigate").record()


def friction_slope(coulomb: float, viscous: float, omega: float) -> float:
    return float(complex(friction_torque(PLANT, coulomb, viscous, omega + STEP * 1j)).imag / STEP)


@pytest.mark.parametrize("omega", [1.0, 1.000001, 5.0, 14.0])
def test_coulomb_friction_is_its_torque_beyond_creep(omega: float) -> None:
    assert friction_torque(PLANT, 5e3, 0.0, omega) == pytest.approx(5e3, rel=1e-15)
    assert friction_torque(PLANT, 5e3, 0.0, -omega) == pytest.approx(-5e3, rel=1e-15)


@pytest.mark.parametrize("omega", [0.01, 0.05, 0.1])
def test_creeping_shaft_feels_a_share_of_it(omega: float) -> None:
    """Tanh(omega / 0.05): 76 % of the torque at 0.05 rad/s."""
    assert friction_torque(PLANT, 5e3, 0.0, omega) == pytest.approx(5e3 * math.tanh(20.0 * omega))
    assert friction_torque(PLANT, 5e3, 0.0, -omega) == -friction_torque(PLANT, 5e3, 0.0, omega)
    assert friction_torque(PLANT, 1.0, 0.0, 0.05) == pytest.approx(0.7615942, rel=1e-7)


def test_the_speed_below_which_friction_sticks_is_a_number_of_the_ship(servo: Ship) -> None:
    assert servo.parameter("transmission.stiction_speed_rad_s").value == 0.05
    plant = servo.with_values({"transmission.stiction_speed_rad_s": 0.002}).record()
    assert friction_torque(plant, 20.0, 0.0, 0.001) == pytest.approx(20.0 * math.tanh(0.5))
    assert friction_torque(plant, 20.0, 0.0, -0.0401) == -20.0
    # a drive that is pushed with less than its friction creeps, at a share of that speed
    stuck = {"transmission.stiction_speed_rad_s": 0.002, COULOMB: 20.0}
    run = simulate(servo.with_values(stuck), Schedule(10.0, 1.0), 1.0, initial=State(1.0, 0.0, 0.0))
    creep = run["shaft_speed"][-1]
    assert 20.0 * math.tanh(creep / 0.002) + 190.0 * creep == pytest.approx(10.0, rel=1e-6)


def test_creeping_friction_has_the_slope_of_its_curve() -> None:
    assert friction_slope(5e3, 0.0, 0.0) == pytest.approx(1e5)
    assert friction_slope(5e3, 0.0, 0.3) == pytest.approx(1e5 / math.cosh(6.0) ** 2)
    assert friction_slope(5e3, 0.0, 1.01) == friction_slope(5e3, 0.0, -1.01) == 0.0


def test_viscous_friction_grows_with_speed() -> None:
    assert friction_torque(PLANT, 0.0, 300.0, 4.0) == 1200.0
    assert friction_torque(PLANT, 0.0, 300.0, -4.0) == -1200.0
    assert friction_torque(PLANT, 5e3, 300.0, 4.0) == 6200.0
    assert friction_slope(5e3, 300.0, 4.0) == pytest.approx(300.0)


def test_friction_vanishes_at_rest() -> None:
    assert friction_torque(PLANT, 5e3, 300.0, 0.0) == 0.0
    assert friction_torque(PLANT, 0.0, 0.0, 10.0) == 0.0


def test_quadratic_drag_opposes_the_rotation(plant: Any) -> None:
    assert quadratic_drag(plant, 3.0) == 0.0
    plant["quadratic_drag"] = 40.0
    assert [quadratic_drag(plant, w) for w in (-3.0, 0.0, 3.0)] == [-360.0, 0.0, 360.0]


def test_friction_by_load_opposes_the_rotation_whatever_drives(plant: Any) -> None:
    assert load_friction(plant, 5e4, 3.0) == 0.0
    plant["load_friction"] = 0.1
    assert [load_friction(plant, load, 3.0) for load in (5e4, -5e4)] == pytest.approx([5e3, 5e3])
    assert load_friction(plant, 5e4, -3.0) == pytest.approx(-5e3)
    slope = complex(load_friction(plant, -5e4 + 1e-30j, 3.0)).imag / 1e-30
    assert slope == pytest.approx(-0.1)


def test_a_shaft_that_carries_a_load_holds_it_by_its_friction(servo: Ship) -> None:
    """Of 10 N m at the load, 2 are friction's: 12 N m raise it, 8 let it fall, between it stands."""
    weight = {"id": "weight", "acts_on": "load_torque", "expression": "10"}
    rig = servo.with_values({"transmission.load_friction_fraction": 0.2, "term": [weight]})
    viscous = rig.parameter("transmission.viscous_friction_engine_side_N_m_s_rad").value
    for torque, left in ((13.0, 1.0), (11.0, 0.0), (9.0, 0.0), (7.0, -1.0)):
        run = simulate(rig, Schedule(torque, 1.0), 5.0, initial=State(1.0, 0.0, 0.0))
        assert run["shaft_speed"][-1] == pytest.approx(left / viscous, abs=0.01 / viscous + 0.03)


@pytest.fixture
def rubbing(plant: Any) -> Any:
    plant["coulomb_engine_side"], plant["viscous_engine_side"] = 5e3, 200.0
    plant["coulomb_propeller_side"], plant["viscous_propeller_side"] = 3e3, 100.0
    plant["quadratic_drag"], plant["entrained_inertia"] = 40.0, 8e3
    return plant


def test_drive_torque_is_the_brake_torque_less_friction(plant: Any, rubbing: Any) -> None:
    gear = 1e4 * GEAR * EFFICIENCY
    assert drive_torque(rubbing, 1e4, 10.0) == pytest.approx(gear - 5e3 - 2e3, rel=1e-14)
    assert drive_torque(rubbing, 1e4, -10.0) == pytest.approx(gear + 5e3 + 2e3, rel=1e-14)


def test_friction_before_the_gauge_has_its_own_size_in_each_direction(rubbing: Any) -> None:
    """Coulomb 5 kN m by 1.3 ahead and 0.7 astern, viscous 200 N m s/rad by 0.8 and 1.2."""
    rubbing["coulomb_asymmetry"], rubbing["viscous_asymmetry"] = 0.3, -0.2
    assert drive_torque(rubbing, 0.0, 10.0) == pytest.approx(-6.5e3 - 1.6e3, rel=1e-14)
    assert drive_torque(rubbing, 0.0, -10.0) == pytest.approx(3.5e3 + 2.4e3, rel=1e-14)
    assert drive_torque(rubbing, 0.0, 0.0) == 0.0
    assert load_torque(rubbing, 5e4, 10.0) == pytest.approx(5e4 + 3e3 + 1e3 + 4e3, rel=1e-14)


def test_brake_torque_of_a_drive_torque(rubbing: Any) -> None:
    for brake, omega in ((1e4, 10.0), (-2e3, 3.0), (5e3, -4.0)):
        torque = drive_torque(rubbing, brake, omega)
        assert brake_torque_of(rubbing, torque, omega) == pytest.approx(brake, rel=1e-12)


def test_load_torque_adds_friction_and_drag_behind_the_gauge(rubbing: Any) -> None:
    assert load_torque(rubbing, 5e4, 10.0) == pytest.approx(5e4 + 3e3 + 1e3 + 4e3, rel=1e-14)
    assert load_torque(rubbing, 5e4, -10.0) == pytest.approx(5e4 - 3e3 - 1e3 - 4e3, rel=1e-14)


def test_inertias_before_and_behind_the_gauge(rubbing: Any) -> None:
    assert inertia_behind_meter(rubbing) == RIGHT + 8e3
    assert shaft_inertia(rubbing) == LEFT + RIGHT + 8e3


def test_gauge_reads_what_is_left_after_accelerating_the_engine_side(plant: Any) -> None:
    assert shaft_meter_torque(plant, 1e5, 9e4, 0.25) == 1e5 - 0.25 * LEFT
    assert shaft_meter_torque(plant, 1e5, 9e4, -0.25) == 1e5 + 0.25 * LEFT


def test_gauge_reads_nothing_where_nothing_turns_behind_it() -> None:
    servo = template("drive-with-load").record()
    for drive in np.linspace(-150.0, 150.0, 301):
        assert shaft_meter_torque(servo, drive, 0.0, drive / shaft_inertia(servo)) == 0.0


def test_gauge_is_the_cut_seen_from_either_side(rubbing: Any) -> None:
    drive, load = drive_torque(rubbing, 2e4, 10.0), load_torque(rubbing, 9e4, 10.0)
    acceleration = (drive - load) / shaft_inertia(rubbing)
    behind = load + inertia_behind_meter(rubbing) * acceleration
    assert shaft_meter_torque(rubbing, drive, load, acceleration) == pytest.approx(
        behind, rel=1e-12
    )


@pytest.mark.parametrize("kind", ["coulomb_friction", "viscous_friction"])
@pytest.mark.parametrize("side", ["engine", "propeller"])
def test_friction_stands_on_its_side_of_the_gauge(frigate: Ship, kind: str, side: str) -> None:
    unit, value = ("N_m", 5e3) if kind == "coulomb_friction" else ("N_m_s_rad", 400.0)
    ship = frigate.with_values({f"transmission.{kind}_{side}_side_{unit}": value})
    found = equilibrium(ship, 22.0, 1.4)
    friction = value if unit == "N_m" else value * found.state.shaft_speed
    driving = found.outputs.brake_torque * GEAR * EFFICIENCY
    before, behind = (friction, 0.0) if side == "engine" else (0.0, friction)
    assert found.outputs.shaft_torque == pytest.approx(driving - before, rel=1e-9)
    assert found.outputs.shaft_torque == pytest.approx(
        found.outputs.propeller_torque + behind, rel=1e-9
    )


def test_entrained_water_slows_the_start_and_not_the_end(
    frigate: Ship, design_point: Equilibrium
) -> None:
    ship = frigate.with_values({"propeller.entrained_inertia_kg_m2": 8e3})
    dry, wet = (
        simulate(s, Schedule(25.0, 1.4), 20.0, initial=design_point.state) for s in (frigate, ship)
    )
    ratio = dry["shaft_acceleration"][0] / wet["shaft_acceleration"][0]
    assert ratio == pytest.approx((LEFT + RIGHT + 8e3) / (LEFT + RIGHT))
    behind = wet["propeller_torque"] + (RIGHT + 8e3) * wet["shaft_acceleration"]
    np.testing.assert_allclose(wet["shaft_torque"], behind, rtol=1e-12)
    assert equilibrium(ship, 25.0, 1.4).state == pytest.approx(
        equilibrium(frigate, 25.0, 1.4).state, rel=1e-9
    )


def test_friction_that_saturates() -> None:
    """k atan(s omega) beside Coulomb and viscous friction: odd, slope k s / (1 + (s omega)^2)."""
    plant = load_ship("towing-tank").record()
    by_hand = 0.262 * math.tanh(2.0 / 0.1) + 0.008 * 2.0 + 0.3 * math.atan(0.2 * 2.0)
    assert friction_before_meter(plant, 2.0) == pytest.approx(by_hand, rel=1e-12)
    assert friction_before_meter(plant, -2.0) == pytest.approx(-by_hand, rel=1e-12)
    slope = complex(friction_before_meter(plant, 30.0 + 1e-20j)).imag / 1e-20
    assert slope == pytest.approx(0.008 + 0.3 * 0.2 / (1.0 + 36.0), rel=1e-9)
    torque = drive_torque(plant, 5.0, 30.0)
    assert torque == pytest.approx(5.0 - friction_before_meter(plant, 30.0), rel=1e-12)
    assert brake_torque_of(plant, torque, 30.0) == pytest.approx(5.0, rel=1e-12)
