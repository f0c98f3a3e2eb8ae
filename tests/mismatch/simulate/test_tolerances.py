"""How well a ship's numbers are known, as its file states it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.judge.held_out import bands_of
from shaftline.mismatch.search.catalogue import SizedEffect, catalogue
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.simulate.balances import (
    Balances,
    tolerance_perturbations,
    tolerance_records,
)
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship
from shaftline.plant.tolerances import Tolerances

from ..turning import quick_tanker, swinging
from ..voyages import bench_tug, frigate_voyage, tug_run

FOULING = SizedEffect(next(e for e in catalogue() if e.id == "hull-fouling"), (0.04,))
BY_NUMBER = ("default", "numbers", "correlations")
NUMBERS = [f"tolerances.{key}" for key in Tolerances.model_fields if key not in BY_NUMBER]


@pytest.fixture(scope="module")
def draggy() -> pd.DataFrame:
    """A voyage of a frigate whose resistance is 4 % above its file's."""
    return frigate_voyage(
        {"hull.resistance_coefficient_N_s2_m2": 1.04 * 3306.2}, seed=5, seconds=300.0
    )


def fitter_of(table: pd.DataFrame, values: dict[str, float], scale: float = 1.0) -> Fitter:
    balances = Balances(JointReplay(load_ship("frigate").with_values(values), table))
    return Fitter(balances, bands_of(balances, [(0, len(table))]), scale)


def gain(fitter: Fitter) -> float:
    """What naming the fouling gains over a ship whose numbers move inside their tolerances."""
    return fitter.evaluate((FOULING,)).score - fitter.null.score


def test_a_resistance_that_is_little_known_is_not_called_fouling(draggy: pd.DataFrame) -> None:
    assert gain(fitter_of(draggy, {})) > 15.0
    unsure = fitter_of(draggy, {"tolerances.resistance": 0.05})
    assert gain(unsure) < 3.0
    assert 0.05 * unsure.null.tolerances[0] == pytest.approx(0.04, abs=0.015)


def test_a_drive_without_a_propeller_has_the_tolerances_of_a_drive(servo: Ship) -> None:
    table = pd.DataFrame({"time_s": np.arange(50) * 0.01, "motor_torque_N_m": 10.0})
    replay = JointReplay(servo, table.assign(shaft_speed_rad_s=1.0))
    changed = [
        {f for f in record.dtype.names if (record[f] != servo.record()[f]).any()}
        for record, shift in tolerance_records(replay)
        if not any(shift)
    ]
    assert changed == [{"inertia_engine_side"}, set()]  # and none behind a gauge


def test_a_shaft_whose_speed_is_held_has_no_tolerance_of_its_own(held_frigate: Ship) -> None:
    replay = JointReplay(held_frigate, frigate_voyage(seconds=60.0))
    found = list(tolerance_records(replay))
    own = held_frigate.record()["inertia_engine_side"]
    assert all(r["inertia_engine_side"] == own for r, _ in found)
    assert all(shift[1] == 0.0 for _, shift in found)
    assert any((r["inertia_propeller_side"] != 14411.0) for r, _ in found)


def test_a_number_known_exactly_is_left_out(draggy: pd.DataFrame) -> None:
    usual, exact = fitter_of(draggy, {}), fitter_of(draggy, {"tolerances.resistance": 0.0})
    assert np.array_equal(exact.nuisance, usual.nuisance[1:])
    assert gain(exact) > gain(usual)


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_all_numbers_may_be_known_exactly(draggy: pd.DataFrame, scale: float) -> None:
    values = dict.fromkeys(NUMBERS, 0.0) if scale else {}
    fitter = fitter_of(draggy, values, scale)
    assert len(fitter.nuisance) == 3  # the first state's
    assert gain(fitter) > 15.0


def test_the_largest_tolerances_can_be_simulated(draggy: pd.DataFrame) -> None:
    fitter = fitter_of(draggy, dict.fromkeys(NUMBERS, 0.5), scale=5.0)
    assert np.isfinite(fitter.nuisance).all()
    assert np.isfinite(fitter.null.score)


def test_the_factor_multiplies_all_tolerances(draggy: pd.DataFrame) -> None:
    ship = load_ship("frigate")
    doubled = {
        f"tolerances.{key}": 2.0 * value for key, value in ship.tolerances if key not in BY_NUMBER
    }
    by_file = tolerance_records(JointReplay(ship.with_values(doubled), draggy))
    by_factor = tolerance_records(JointReplay(ship, draggy), 2.0)
    for (record, _), (other, _) in zip(by_file, by_factor, strict=True):
        assert record.tobytes() == other.tobytes()


KNOWN = {
    "resistance": 0.011,
    "mass": 0.012,
    "wake_fraction": 0.013,
    "thrust_curve": 0.014,
    "inertia": 0.015,
    "torque_curve": 0.016,
    "torque_per_rack": 0.017,
    "torque_offset": 0.018,
    "pitch_time_constant": 0.019,
    "motor_constant": 0.021,
    "armature_resistance": 0.022,
}


def moved_in(ship: Ship, table: pd.DataFrame, scale: float) -> list[tuple[dict[str, Any], Any]]:
    """Factor on each field that a record moves, and the shift of the first state."""
    sure = ship.with_values({f"tolerances.{key}": value for key, value in KNOWN.items()})
    own, found = sure.record(), []
    for record, shift in tolerance_records(JointReplay(sure, table), scale):
        changed: dict[str, Any] = {}
        for name in own.dtype.names:
            if record[name].tobytes() != own[name].tobytes():
                before, after = np.asarray(own[name]), np.asarray(record[name])
                live = before != 0.0
                changed[name] = (
                    float(np.mean(after[live] / before[live])) if live.any() else float(after)
                )
        found.append((changed, shift))
    return found


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_each_number_is_one_standard_deviation_off(draggy: pd.DataFrame, scale: float) -> None:
    frigate = load_ship("frigate")
    plant = frigate.record()
    still = (0.0, 0.0, 0.0)
    top = min(plant["torque_limit"], plant["torque_per_rack"] * plant["drive_max"])
    shaft = JointReplay(frigate, draggy).start[1]
    expected = [
        ({"resistance_coefficient": 1.0 + 0.011 * scale}, still),
        ({"mass": 1.0 + 0.012 * scale}, still),
        ({"wake_fraction": 1.0 + 0.013 * scale / float(plant["wake_fraction"])}, still),
        ({"kt": 1.0 + 0.014 * scale}, still),
        ({"inertia_engine_side": 1.0 + 0.015 * scale}, still),
        ({"inertia_propeller_side": 1.0 + 0.015 * scale}, still),
        ({"relative_rotative_efficiency": 1.0 / (1.0 + 0.016 * scale)}, still),
        ({"torque_per_rack": 1.0 + 0.017 * scale}, still),
        ({"torque_offset": 1.0 + 0.018 * scale * top / float(plant["torque_offset"])}, still),
        ({"pitch_time_constant": 1.0 + 0.019 * scale}, still),
        ({}, (0.0, 0.02 * scale * shaft, 0.0)),
        ({}, (0.005 * scale, 0.0, 0.0)),
        ({}, (0.0, 0.0, 0.05 * scale)),
    ]
    found = moved_in(frigate, draggy, scale)
    assert len(found) == len(expected)
    for (fields, shift), (wanted, start) in zip(found, expected, strict=True):
        assert set(fields) == set(wanted)
        assert shift == pytest.approx(start)
        for name, factor in wanted.items():
            assert fields[name] == pytest.approx(factor)


def test_of_a_motor_its_constant_and_resistance_are_moved() -> None:
    found = moved_in(bench_tug(), tug_run().assign(shaft_speed_rad_s=-30.0), 1.0)
    assert found[-1][1] == pytest.approx((0.0, 0.02 * 30.0, 0.0))
    fields = [fields for fields, _ in found]
    assert fields[-3:] == [
        {"motor_constant": pytest.approx(1.021)},
        {"armature_resistance": pytest.approx(1.022)},
        {},
    ]
    slow = moved_in(bench_tug(), tug_run().assign(shaft_speed_rad_s=0.4), 1.0)
    assert slow[-1][1] == pytest.approx((0.0, 0.02, 0.0))  # near rest, of 1 rad/s


def test_thrust_alone_is_moved_in_four_quadrants(draggy: pd.DataFrame) -> None:
    ship = load_ship("frigate").with_values(
        {"propeller.model": "four-quadrant", "tolerances.thrust_curve": 0.1}
    )
    own = ship.record()["four_quadrant"]
    moved = next(
        record["four_quadrant"]
        for record, _ in tolerance_records(JointReplay(ship, draggy))
        if record["kt"].tobytes() != ship.record()["kt"].tobytes()
        or record["four_quadrant"].tobytes() != own.tobytes()
    )
    assert moved[..., :2] == pytest.approx(1.1 * own[..., :2])
    assert (moved[..., 2:] == own[..., 2:]).all()


def used_in(ship: Ship, table: pd.DataFrame) -> set[str]:
    """Tolerances without which a number less is moved."""
    usual = len(list(tolerance_records(JointReplay(ship, table))))
    exact = {key: JointReplay(ship.with_values({key: 0.0}), table) for key in NUMBERS}
    return {key for key, replay in exact.items() if len(list(tolerance_records(replay))) < usual}


def test_every_tolerance_of_a_part_that_acts_is_used(draggy: pd.DataFrame) -> None:
    motor = {"tolerances.motor_constant", "tolerances.armature_resistance"}
    turning = {"tolerances.hull_derivatives", "tolerances.rudder_force"}
    assert used_in(load_ship("frigate"), draggy) == set(NUMBERS) - motor - turning
    tanker = quick_tanker()
    assert turning < used_in(tanker, swinging(tanker, seconds=60.0))
    shaft = {"tolerances.inertia", "tolerances.torque_curve"}
    assert used_in(bench_tug(), tug_run()) == motor | shaft


def test_thrust_is_moved_in_four_quadrants_too(draggy: pd.DataFrame) -> None:
    ship = load_ship("frigate").with_values({"propeller.model": "four-quadrant"})
    only = {key: 0.0 for key in NUMBERS if key != "tolerances.thrust_curve"}
    replay = JointReplay(ship.with_values(only), draggy)
    record, start = next(tolerance_records(replay))
    thrust = [replay.simulate(plant, start)["thrust"][0] for plant in (ship.record(), record)]
    assert thrust[1] / thrust[0] == pytest.approx(1.002, abs=1e-4)


def test_the_corrected_ship_keeps_its_tolerances(draggy: pd.DataFrame) -> None:
    fitter = fitter_of(draggy, {"tolerances.resistance": 0.05})
    assert fitter.trial_ship.corrected((FOULING,)).tolerances == Tolerances(resistance=0.05)


def test_thrust_is_moved_in_a_table_too(frigate: Ship) -> None:
    only = {key: 0.0 for key in NUMBERS if key != "tolerances.thrust_curve"}
    table = {
        "advance_ratio": [0.0, 0.5, 1.2],
        "thrust_coefficient": [0.5, 0.3, 0.0],
        "torque_coefficient": [0.08, 0.05, 0.01],
    }
    ship = frigate.with_values(
        {
            "propeller.model": "table",
            "propeller.pitch_ratio_min": 1.4,
            "propeller.open_water": table,
            "tolerances.thrust_curve": 0.1,
        }
        | only
    )
    record, _ = next(tolerance_records(JointReplay(ship, frigate_voyage(seconds=60.0))))
    own = ship.record()
    np.testing.assert_allclose(record["table_kt"], 1.1 * own["table_kt"], rtol=1e-12)
    assert (record["table_kq"] == own["table_kq"]).all()


def moved_together(correlation: float, table: pd.DataFrame) -> np.ndarray[Any, Any]:
    """Covariance of what resistance and mass are moved by, the file saying how sure it is of them."""
    keys = ("hull.resistance_coefficient_N_s2_m2", "hull.mass_kg")
    ship = load_ship("frigate").with_values(
        {
            "tolerances.numbers": dict(zip(keys, (100.0, 5e4), strict=True)),
            "tolerances.correlations": {keys[1]: {keys[0]: correlation}},
        }
    )
    own = [
        move.numbers
        for move in tolerance_perturbations(JointReplay(ship, table))
        if set(move.numbers) & {*keys}
    ]
    changes = np.array([[numbers.get(key, 0.0) for numbers in own] for key in keys])
    return np.asarray(changes @ changes.T)


@pytest.mark.parametrize("correlation", [0.0, 0.9, -0.5, 1.0])
def test_numbers_whose_errors_go_together_are_moved_together(
    draggy: pd.DataFrame, correlation: float
) -> None:
    crossed = correlation * 100.0 * 5e4
    expected = [[100.0**2, crossed], [crossed, 5e4**2]]
    np.testing.assert_allclose(moved_together(correlation, draggy), expected, atol=1e-6)


def test_a_ratio_that_is_known_well_is_no_missing_physics_less(draggy: pd.DataFrame) -> None:
    """Resistance and mass each known to 5 %, their ratio to 0.5 %: 4 % more resistance is fouling."""
    key, mass = "hull.resistance_coefficient_N_s2_m2", "hull.mass_kg"
    known = {"tolerances.numbers": {key: 0.05 * 3306.2, mass: 0.05 * 3.3e6}}
    together: Any = known | {"tolerances.correlations": {key: {mass: 0.995}}}
    assert gain(fitter_of(draggy, known)) < 3.0  # type: ignore[arg-type]
    assert gain(fitter_of(draggy, together)) > gain(fitter_of(draggy, known)) + 1.0  # type: ignore[arg-type]


def test_a_wide_tolerance_is_felt_over_a_small_step(draggy: pd.DataFrame) -> None:
    key = "hull.resistance_coefficient_N_s2_m2"
    ship = load_ship("frigate").with_values({"tolerances.numbers": {key: 0.3 * 3306.2}})
    replay = JointReplay(ship, draggy)
    (near,) = (m for m in tolerance_perturbations(replay, near=0.05) if key in m.numbers)
    assert near.numbers == {key: 0.3 * 3306.2}
    assert near.share == pytest.approx(0.05 / 0.3)
    assert near.record["resistance_coefficient"] == pytest.approx(1.05 * 3306.2)
    (whole,) = (m for m in tolerance_perturbations(replay) if key in m.numbers)
    assert (whole.share, whole.record["resistance_coefficient"]) == (1.0, 1.3 * 3306.2)


def test_a_move_names_what_it_moves(draggy: pd.DataFrame) -> None:
    replay = JointReplay(load_ship("frigate"), draggy)
    moved = {
        key: change for m in tolerance_perturbations(replay) for key, change in m.numbers.items()
    }
    assert moved["hull.resistance_coefficient_N_s2_m2"] == pytest.approx(0.004 * 3306.2)
    assert moved["hull.wake_fraction"] == pytest.approx(0.0015)
    assert moved["propeller.relative_rotative_efficiency"] == pytest.approx(1.0 / 1.002 - 1.0)
    assert not any(key.endswith("thrust_coefficient") for key in moved)  # a file has no such key
