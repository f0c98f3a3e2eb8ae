"""How well a ship's numbers are known, as its file states it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.judge.held_out import bands_of
from shaftline.mismatch.search.catalogue import catalogue
from shaftline.mismatch.search.fitting import Fitter
from shaftline.mismatch.search.placed import Placed
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.mismatch.simulate.tolerances import tolerance_records
from shaftline.plant import Ship, load_ship
from shaftline.plant.tolerances import Tolerances

from ..voyages import bench_tug, frigate_voyage, tug_run

FOULING = Placed(next(e for e in catalogue() if e.id == "hull-fouling"), (0.04,))
NUMBERS = [f"tolerances.{key}" for key in Tolerances.model_fields]


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
    return fitter.fitted((FOULING,)).score - fitter.null.score


def test_a_resistance_that_is_little_known_is_not_called_fouling(draggy: pd.DataFrame) -> None:
    assert gain(fitter_of(draggy, {})) > 15.0
    unsure = fitter_of(draggy, {"tolerances.resistance": 0.05})
    assert gain(unsure) < 3.0
    assert 0.05 * unsure.null.tolerances[0] == pytest.approx(0.04, abs=0.015)


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
    doubled = {f"tolerances.{key}": 2.0 * value for key, value in ship.tolerances}
    by_file = tolerance_records(JointReplay(ship.with_values(doubled), draggy))
    by_factor = tolerance_records(JointReplay(ship, draggy), 2.0)
    for (record, _), (other, _) in zip(by_file, by_factor, strict=True):
        assert record.tobytes() == other.tobytes()


def used_in(ship: Ship, table: pd.DataFrame) -> set[str]:
    """Tolerances without which a number less is moved."""
    usual = len(list(tolerance_records(JointReplay(ship, table))))
    exact = {key: JointReplay(ship.with_values({key: 0.0}), table) for key in NUMBERS}
    return {key for key, replay in exact.items() if len(list(tolerance_records(replay))) < usual}


def test_every_tolerance_of_a_part_that_acts_is_used(draggy: pd.DataFrame) -> None:
    motor = {"tolerances.motor_constant", "tolerances.armature_resistance"}
    assert used_in(load_ship("frigate"), draggy) == set(NUMBERS) - motor
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
