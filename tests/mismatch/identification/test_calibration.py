"""Numbers from a healthy period: what is told is found, what is not stays, with a word."""

from __future__ import annotations

import functools
from pathlib import Path

import pandas as pd
import pytest

from shaftline.mismatch import Options, diagnose
from shaftline.mismatch.calibration import calibrate, doubt_parameters
from shaftline.mismatch.identification.parameters import Start
from shaftline.mismatch.pipeline import begin
from shaftline.plant import Ship, load_ship

from ..voyages import frigate_voyage, quick_frigate

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
INERTIA = "transmission.inertia_engine_side_kg_m2"
TRUE = {RESISTANCE: 1.05 * 3306.2, INERTIA: 0.9 * 53697.0}


def true_ship() -> Ship:
    return quick_frigate().with_values(TRUE)


@functools.cache
def healthy() -> pd.DataFrame:
    return frigate_voyage(true_ship(), seed=21, seconds=400.0)


@functools.cache
def start() -> Start:
    return calibrate(quick_frigate(), [healthy()], (RESISTANCE, INERTIA))


def test_the_numbers_of_the_healthy_period_are_those_of_the_ship() -> None:
    found = start()
    assert found.calibrated == (RESISTANCE, INERTIA)
    assert found.file == quick_frigate()
    assert not found.left_out
    for key, value in TRUE.items():
        error = found.ship.tolerances.numbers[key]
        assert 0.0 < error < 0.01 * value
        assert abs(found.ship.parameter(key).value - value) < 4.0 * error
    assert 0.0 < abs(found.ship.tolerances.correlation(RESISTANCE, INERTIA)) < 1.0


def test_what_a_wrong_number_hid_or_feigned_is_then_told() -> None:
    """The file's resistance is 5 % low: alone it feigns fouling, and adds to a true one."""
    fouled = frigate_voyage(
        true_ship().with_values({"hull.fouling_fraction": 0.1}), seed=22, seconds=400.0
    )
    sound = frigate_voyage(true_ship(), seed=23, seconds=400.0)
    assert diagnose(quick_frigate(), sound).verdict != "nothing-missing"
    assert diagnose(start(), sound).verdict == "nothing-missing"
    found = diagnose(start(), fouled)
    assert [f.effect.id for f in found.findings] == ["hull-fouling"]
    assert found.findings[0].estimates[0].value == pytest.approx(0.1, abs=0.01)
    assert found.biased == [None]  # the resistance was right on the healthy period
    assert found.ship == start().ship
    numbers = found.to_dict()["numbers"]
    assert numbers[RESISTANCE]["file"] == 3306.2
    assert numbers[RESISTANCE]["source"] == "calibrated"
    assert numbers[RESISTANCE]["value"] == pytest.approx(TRUE[RESISTANCE], rel=0.01)


def test_a_number_that_is_not_told_stays_as_it_is() -> None:
    """Of resistance, mass and 1 - t only ratios act; the one named last is left."""
    keys = (RESISTANCE, "hull.mass_kg", "hull.thrust_deduction")
    found = calibrate(quick_frigate(), [healthy()], keys)
    assert found.calibrated == (RESISTANCE, "hull.mass_kg")
    assert found.ship.hull.thrust_deduction == pytest.approx(0.07, abs=1e-4)
    # whoever calibrates does not trust the file: it may be off by as much as a number that is told
    known = found.ship.tolerances
    assert known.numbers["hull.thrust_deduction"] == pytest.approx(0.1 * 0.07, rel=1e-3)
    # More thrust deduction with the same speeds is less resistance: (1 - t) / R is known.
    assert known.correlation(RESISTANCE, "hull.thrust_deduction") == pytest.approx(-0.87, abs=0.05)
    (said,) = (r for r in found.remarks if "keeps the ship file's value" in r)
    assert "calibration: hull.thrust_deduction keeps the ship file's value" in said
    assert "only its combination with hull.mass_kg" in said


def test_a_number_that_moves_nothing_stays_as_it_is() -> None:
    fuel = "prime_mover.fuel_base_g_kWh"
    found = calibrate(quick_frigate(), [healthy()], (fuel,))
    assert found.ship == quick_frigate()
    assert set(found.left_out) == {fuel}
    assert "no parameter is identifiable from the reference period" in found.remarks[0]


def test_physics_that_the_file_lacks_in_both_periods_is_no_change(tmp_path: Path) -> None:
    """Stern-tube friction is missing in the file all the time; only the fouling is new."""
    rubbing = true_ship().with_values({"transmission.coulomb_friction_propeller_side_N_m": 12000.0})
    before = frigate_voyage(rubbing, seed=31, seconds=400.0)
    fouled = rubbing.with_values({"hull.fouling_fraction": 0.12})
    after = frigate_voyage(fouled, seed=32, seconds=400.0)
    found = diagnose(quick_frigate(), after, options=Options(calibrate=(before,)))
    assert [f.effect.id for f in found.findings] == ["hull-fouling"]
    (fouling,) = found.findings[0].estimates
    assert fouling.ci95[0] < 0.12 < fouling.ci95[1]
    (said,) = (w for w in found.warnings if "in the reference period already" in w)
    assert "coulomb-friction (coulomb_friction_propeller_side_N_m 1" in said
    friction = found.corrected.transmission.coulomb_friction_propeller_side_N_m
    assert friction == pytest.approx(12000.0, rel=0.15)
    found.save(tmp_path, page=False)
    kept = load_ship(tmp_path / "calibrated_ship.toml")
    assert kept == found.calibrated
    again = diagnose(kept, after)
    assert [f.sized for f in again.findings] == [f.sized for f in found.findings]
    again.save(tmp_path, page=False)
    assert not (tmp_path / "calibrated_ship.toml").exists()  # It would not belong to this report.


def test_a_reference_period_without_missing_physics_gives_parameters_and_errors_alone() -> None:
    found = begin(quick_frigate(), Options(calibrate=(healthy(),)))
    assert {RESISTANCE, INERTIA} < set(found.calibrated)
    known = found.ship.tolerances
    for key, value in TRUE.items():
        assert abs(found.ship.parameter(key).value - value) < 4.0 * known.numbers[key]
        assert 0.0 < known.numbers[key] < 0.05 * value
    # More thrust deduction with the same speeds is less resistance: (1 - t) / R is known.
    assert known.correlation(RESISTANCE, "hull.thrust_deduction") < -0.5
    assert found.file == quick_frigate()


def test_tolerances_of_the_file_stay_where_it_states_more_than_a_tenth() -> None:
    wide = quick_frigate().with_values(
        {"tolerances.resistance": 0.3, "tolerances.numbers": {INERTIA: 100.0}}
    )
    found = doubt_parameters(wide, [healthy()]).tolerances.numbers
    assert found[RESISTANCE] == pytest.approx(0.3 * 3306.2, rel=0.05)
    assert found["hull.mass_kg"] == pytest.approx(0.1 * wide.hull.mass_kg)
    assert found[INERTIA] == 100.0


def test_one_recording_is_not_both(tmp_path: object) -> None:
    options = Options(calibrate=("trial.csv",))
    with pytest.raises(FileNotFoundError, match=r"trial\.csv: recording of the reference"):
        diagnose(quick_frigate(), "trial.csv", options=options)
