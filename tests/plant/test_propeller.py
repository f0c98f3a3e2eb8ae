from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.plant import Schedule, Ship, ShipError, State, equilibrium, load_ship, simulate
from shaftline.plant.open_water import b_series, open_water
from shaftline.plant.propeller import (
    FOUR_QUADRANT,
    PITCH_RANGES,
    cavitation_loss,
    cavitation_number,
    propeller_load,
)
from shaftline.plant.ventilation import lost_suction, suction_head

KT, KQ = b_series("KT", 0.9, 5), b_series("KQ", 0.9, 5)
FORCE = 1025.0 * 4.2**4
"""Density times the fourth power of the frigate's diameter [kg]."""


def load(plant: Any, velocity: float, omega: float, pitch: float, depth: float = 4.0) -> Any:
    return propeller_load(plant, velocity, omega, pitch, depth, 0.0)


@pytest.mark.parametrize(("velocity", "omega", "pitch"), [(7.0, 9.5, 1.15), (0.0, 5.0, 0.6)])
def test_load_scales_the_coefficients(
    plant: Any, velocity: float, omega: float, pitch: float
) -> None:
    n = omega / (2 * math.pi)
    j = velocity / (n * 4.2)
    found = load(plant, velocity, omega, pitch)
    kt, kq = open_water(KT, j, pitch), open_water(KQ, j, pitch)
    assert found.thrust == pytest.approx(FORCE * n**2 * kt, rel=1e-12)
    assert found.torque == pytest.approx(FORCE * 4.2 * n**2 * kq, rel=1e-12)
    assert found.thrust_coefficient == pytest.approx(kt, rel=1e-5)


@pytest.mark.parametrize(("edge", "sign"), [(1.6, 1.0), (-0.25, -1.0)])
def test_curves_are_held_beyond_their_range(plant: Any, edge: float, sign: float) -> None:
    omega = 2 * math.pi
    at, beyond, inside = (
        load(plant, (edge + sign * d) * 4.2, omega, 1.0) for d in (0.0, 1.0, -0.01)
    )
    assert beyond[:2] == pytest.approx(at[:2], rel=1e-12)
    assert abs(inside.torque / at.torque - 1.0) > 1e-3


def test_standstill_gives_no_load(plant: Any) -> None:
    assert load(plant, 5.0, 0.0, 1.0)[:2] == (0.0, 0.0)


def test_thrust_coefficient_is_finite_at_standstill(plant: Any) -> None:
    """It fades below a thousandth of a revolution a second; at that speed half of it is left."""
    slow = load(plant, 0.0, 1e-3 * 2 * math.pi, 1.0).thrust_coefficient
    assert slow == pytest.approx(0.5 * open_water(KT, 0.0, 1.0), rel=1e-12)
    assert load(plant, 0.0, 0.0, 1.0).thrust_coefficient == 0.0


def test_turned_astern_the_curves_act_with_the_rotation(plant: Any) -> None:
    """J is held at its lowest where the ship sails on, and thrust and torque turn round."""
    astern = load(plant, 3.0, -9.0, 1.2)
    n = 9.0 / (2 * math.pi)
    assert astern.thrust == pytest.approx(-FORCE * n**2 * open_water(KT, -0.25, 1.2), rel=1e-12)
    assert astern.torque == pytest.approx(-FORCE * 4.2 * n**2 * open_water(KQ, -0.25, 1.2))
    # in the direction of rotation: a shaft that pulls astern draws air like one that pushes ahead
    assert astern.thrust_coefficient == pytest.approx(open_water(KT, -0.25, 1.2), rel=1e-5)


def test_blades_made_for_one_direction_load_less_in_the_other(plant: Any) -> None:
    ahead, astern = (load(plant, 0.0, w, 1.0) for w in (9.0, -9.0))
    plant["astern_load_fraction"] = 0.8
    assert load(plant, 0.0, 9.0, 1.0) == ahead
    assert load(plant, 0.0, -9.0, 1.0)[:2] == pytest.approx(
        (0.8 * astern.thrust, 0.8 * astern.torque), rel=1e-14
    )


def test_roughness_takes_the_ittc_corrections(plant: Any) -> None:
    n, pitch = 1.5, 1.2
    clean = load(plant, 6.0, 2 * math.pi * n, pitch)
    plant["propeller_roughness"] = 0.004
    dirty = load(plant, 6.0, 2 * math.pi * n, pitch)
    solidity = 2.073 * 0.9
    lost_kt = (clean.thrust - dirty.thrust) / (FORCE * n**2)
    added_kq = (dirty.torque - clean.torque) / (FORCE * 4.2 * n**2)
    assert lost_kt == pytest.approx(0.3 * pitch * solidity * 0.004, rel=1e-9)
    assert added_kq == pytest.approx(0.25 * solidity * 0.004, rel=1e-9)
    assert dirty.thrust_coefficient < clean.thrust_coefficient


def sigma(n: float, depth: float) -> float:
    return (101325.0 - 1671.0 + 1025.0 * 9.81 * depth) / (0.5 * 1025.0 * n**2 * 4.2**2)


@pytest.mark.parametrize(("n", "depth"), [(2.0, 4.0), (1.2, -3.0)])
def test_cavitation_number_by_hand(plant: Any, n: float, depth: float) -> None:
    assert cavitation_number(plant, n, depth) == pytest.approx(sigma(n, depth), rel=1e-14)


@pytest.mark.parametrize(("share", "loss"), [(2.0, 0.0), (1.01, 0.0), (0.5, 0.2), (-1.0, 0.4)])
def test_cavitation_loss_is_linear_below_the_onset(plant: Any, share: float, loss: float) -> None:
    """At a share of the onset number; all of it at no pressure and below."""
    plant["cavitation_breakdown"] = 0.4
    plant["cavitation_onset_number"] = sigma(2.0, 4.0) / abs(share)
    depth = 4.0 if share > 0.0 else -50.0
    assert cavitation_loss(plant, 2.0, depth) == pytest.approx(loss, rel=1e-12)


def test_cavitation_takes_thrust_and_a_share_of_that_from_torque(plant: Any) -> None:
    sound = load(plant, 8.0, 4 * math.pi, 1.4)
    plant["cavitation_breakdown"], plant["cavitation_torque_share"] = 0.4, 0.75
    plant["cavitation_onset_number"] = 2.0 * sigma(2.0, 4.0)
    broken = load(plant, 8.0, 4 * math.pi, 1.4)
    assert broken.thrust / sound.thrust == pytest.approx(1.0 - 0.4 * 0.5, rel=1e-9)
    assert broken.torque / sound.torque == pytest.approx(1.0 - 0.4 * 0.5 * 0.75, rel=1e-9)
    assert broken.thrust_coefficient == sound.thrust_coefficient
    plant["cavitation_onset_number"] = 0.99 * sigma(2.0, 4.0)
    assert load(plant, 8.0, 4 * math.pi, 1.4) == sound


def test_air_takes_its_share_of_thrust_and_torque(plant: Any) -> None:
    plant["ventilation_thrust_loss"], plant["ventilation_torque_loss"] = 0.7, 0.6
    deep, half = (propeller_load(plant, 8.0, 10.5, 1.4, 0.5, degree) for degree in (0.0, 0.5))
    suction = suction_head(plant, deep.thrust_coefficient, 10.5)
    lost = lost_suction(plant, 0.5 / 2.1, suction)
    assert 0.05 < lost < 0.9
    assert half.thrust / deep.thrust == pytest.approx(1.0 - 0.5 * 0.7 * lost)
    assert half.torque / deep.torque == pytest.approx(1.0 - 0.5 * 0.6 * lost)
    assert half.thrust_coefficient == deep.thrust_coefficient


@pytest.mark.parametrize("velocity", [0.0, 0.3])
def test_bollard_propeller_does_not_feel_the_inflow(velocity: float) -> None:
    tug = load_ship("tito-neri-sine").record()
    n = 20.0 / (2 * math.pi)
    found = load(tug, velocity, 20.0, 1.0)
    assert found.torque == pytest.approx(0.136 * 1000.0 * n**2 * 0.065**5, rel=1e-12)
    assert found.thrust == 0.0
    rov = load_ship("rov-thruster").record()
    pushed = 0.213214714 * 1027.0 * n**2 * 0.1151**4
    assert load(rov, velocity, 20.0, 1.0).thrust == pytest.approx(pushed, rel=1e-12)


def test_record_holds_area_solidity_and_curves(plant: Any) -> None:
    assert plant["expanded_area_ratio"] == 0.9
    assert plant["blade_solidity"] == pytest.approx(2.073 * 0.9, rel=1e-15)
    np.testing.assert_array_equal(plant["kt"], KT)
    np.testing.assert_array_equal(plant["kq"], KQ)
    np.testing.assert_array_equal(plant["four_quadrant_pitch"], [0.5, 0.6, 0.8, 1.0, 1.2, 1.4])
    assert plant["propeller_model"] == 0
    assert not plant["four_quadrant"].any()


def test_four_quadrant_model_has_the_ships_bollard_pull(frigate: Ship, plant: Any) -> None:
    four = frigate.with_values({"propeller.model": "four-quadrant"}).record()
    assert four["propeller_model"] == FOUR_QUADRANT == 1
    for pitch in (0.6, 0.8, 1.0, 1.2, 1.4):
        found, expected = (load(p, 0.0, 9.0, pitch) for p in (four, plant))
        assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("key", "model"), [("torque_coefficient", "bollard"), ("pitch_ratio_min", "b-series")]
)
def test_each_model_asks_for_its_numbers(key: str, model: str) -> None:
    name = "tito-neri-sine" if model == "bollard" else "frigate"
    tree = load_ship(name).model_dump(exclude_unset=True)
    del tree["propeller"][key]
    with pytest.raises(ValueError, match=f"{key} is missing.*propeller.model = '{model}'"):
        Ship.model_validate(tree)


def test_no_propeller_asks_for_nothing_and_loads_nothing(servo: Ship) -> None:
    plant = servo.record()
    for turning in (-30.0, 0.0, 30.0):
        found = propeller_load(plant, 2.0, turning, 1.0, 0.1, 0.0)
        assert (found.thrust, found.torque, found.thrust_coefficient) == (0.0, 0.0, 0.0)
    start = State(1.0, 0.0, 0.0)
    run = simulate(servo, Schedule(100.0, 1.0), 1.0, initial=start)
    speed = 100.0 / 190.0 * -np.expm1(-2.0 * run["time"])  # I / d = 0.5 s
    assert run["shaft_speed"] == pytest.approx(speed, abs=1e-12)


def test_keys_of_a_propeller_that_is_not_there_are_refused(servo: Ship) -> None:
    with pytest.raises(ShipError, match=r"diameter_m has no effect with propeller\.model = 'none'"):
        servo.with_values({"propeller.diameter_m": 0.2})


def test_lowest_pitch_may_equal_the_highest(frigate: Ship) -> None:
    assert not frigate.with_values({"propeller.pitch_ratio_min": 1.4}).has_variable_pitch
    with pytest.raises(ValueError, match=r"pitch_ratio_min = .* must not exceed pitch_ratio_max"):
        frigate.with_values({"propeller.pitch_ratio_min": 1.41})


@pytest.mark.parametrize("model", ["b-series", "four-quadrant"])
@pytest.mark.parametrize(("key", "value"), [("pitch_ratio_min", -1.0), ("pitch_ratio_min", 0.3)])
def test_blades_that_the_curves_do_not_know_are_refused(
    frigate: Ship, model: str, key: str, value: float
) -> None:
    with pytest.raises(
        ShipError, match=rf"{key} = {value:g} lies outside .* the range of the curves of"
    ):
        frigate.with_values({"propeller.model": model, f"propeller.{key}": value})


@pytest.mark.parametrize("model", ["b-series", "four-quadrant"])
def test_lowest_pitch_that_is_allowed_pushes_less_and_never_the_other_way(
    frigate: Ship, model: str
) -> None:
    low, high = PITCH_RANGES[model]
    changes = {"propeller.pitch_ratio_min": low, "propeller.pitch_ratio_max": high}
    plant = frigate.with_values({"propeller.model": model, **changes}).record()
    thrusts = [load(plant, 0.0, 9.0, pitch).thrust for pitch in np.linspace(low, high, 40)]
    assert thrusts[0] > 0.0
    assert np.all(np.diff(thrusts) > 0.0)


def test_losses_slow_the_ship(frigate: Ship) -> None:
    rough = frigate.with_values({"propeller.roughness_drag": 0.004})
    broken = {"propeller.cavitation_breakdown": 0.3, "propeller.cavitation_onset_number": 5.0}
    sound, dirty, racing = (
        equilibrium(ship, 30.0, 1.4).state for ship in (frigate, rough, frigate.with_values(broken))
    )
    assert dirty.ship_speed < sound.ship_speed
    assert dirty.shaft_speed < sound.shaft_speed
    assert racing.ship_speed < sound.ship_speed
    assert racing.shaft_speed > sound.shaft_speed
