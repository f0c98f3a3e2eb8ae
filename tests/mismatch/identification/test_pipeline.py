"""Whole identifications: what is set aside, what is refused, what the next step knows of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.core.statistics import half_95
from shaftline.mismatch import Identification, diagnose, identify
from shaftline.plant import Ship, load_ship, simulate_recording

from ..voyages import bench_tug, frigate_voyage, tug_run

RESISTANCE = "hull.resistance_coefficient_N_s2_m2"
INERTIA = "transmission.inertia_engine_side_kg_m2"
TRUTH = {RESISTANCE: 3306.2 * 1.12, INERTIA: 53697.0 * 0.85}
SECONDS = 300.0


@pytest.fixture(scope="module")
def voyage() -> pd.DataFrame:
    return frigate_voyage(TRUTH, seed=6, seconds=SECONDS)


@pytest.fixture(scope="module")
def found(voyage: pd.DataFrame) -> Identification:
    return identify(load_ship("frigate"), voyage, free=list(TRUTH))


def test_numbers_and_fit(found: Identification) -> None:
    for key, value in found.parameters.items():
        assert value == pytest.approx(TRUTH[key], rel=0.02)
    ((start, end),) = found.held_out
    assert end - start == pytest.approx(0.25 * SECONDS, abs=0.5)
    for column in ("shaft_speed_rad_s", "ship_speed_m_s"):
        assert found.fit_after[column] > found.fit_before[column] + 1.0
    assert found.identified.parameter(RESISTANCE).value == found.parameters[RESISTANCE]
    assert not found.warnings


def test_the_identified_ship_knows_how_well_it_is_known(found: Identification) -> None:
    for estimate in found.estimates:
        assert found.identified.tolerances.numbers[estimate.key] == estimate.standard_error
    tug = identify(bench_tug(), tug_run(), free=["propeller.torque_coefficient"])
    (estimate,) = tug.estimates
    assert tug.identified.tolerances.numbers[estimate.key] == estimate.standard_error


def test_what_was_a_wrong_number_is_then_no_missing_physics(found: Identification) -> None:
    other = frigate_voyage(TRUTH, seed=9, seconds=SECONDS)
    assert diagnose(load_ship("frigate"), other).verdict != "nothing-missing"
    assert diagnose(found.identified, other).verdict == "nothing-missing"


def test_a_whole_recording_may_be_set_aside(voyage: pd.DataFrame) -> None:
    other = frigate_voyage(TRUTH, seed=7, seconds=100.0)
    found = identify(load_ship("frigate"), voyage, free=[RESISTANCE], hold_out=[other])
    assert found.held_out == [pytest.approx((SECONDS + 0.2, SECONDS + 100.4))]


def test_numbers_wrong_in_the_rest_of_the_file_widen_the_intervals(voyage: pd.DataFrame) -> None:
    frigate = load_ship("frigate")
    sure, unsure = (
        identify(frigate, voyage, free=[RESISTANCE], tolerance=t).estimates[0].standard_error
        for t in (1.0, 5.0)
    )
    assert unsure > 1.5 * sure


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "guess"}, "unknown method 'guess'; known: output-error"),
        ({"free": "everything"}, "free = 'everything': expected a list of keys or 'auto'"),
        ({"free": ["hull.mas"]}, r"hull\.mas is no parameter of this ship that can be free"),
        ({"free": []}, "no parameter is free"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_read(
    frigate: Ship, options: dict[str, object], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        identify(frigate, Path("nowhere.csv"), **options)  # type: ignore[arg-type]


def test_it_is_saved_as_page_data_and_ship(found: Identification, tmp_path: Path) -> None:
    found.save(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "identified_ship.toml",
        "report.html",
        "report.json",
        "search.csv",
    ]
    assert load_ship(tmp_path / "identified_ship.toml") == found.identified
    report = json.loads((tmp_path / "report.json").read_text())
    own = report["parameters"][INERTIA]
    half = half_95(own["degrees_of_freedom"]) * own["se"]
    assert own["ci95"] == pytest.approx([own["value"] - half, own["value"] + half])
    assert 1.96 < half / own["se"] < 2.3  # Student's t: it says from how much data it is known
    assert report["fit"]["held_out"]["after"] == pytest.approx(found.fit_after)
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") >= 5
    assert "transmission.<wbr>inertia" in page
    assert "http" not in page.replace("http://www.w3.org", "")


def test_the_summary_tells_numbers_and_doubts(found: Identification) -> None:
    said = found.summary()
    assert f"{found.parameters[INERTIA]:.5g}" in said
    assert "strongest correlation: hull.resistance" in said
    assert "held out before anything was fitted" in said
    assert np.allclose(np.diag(found.correlation), 1.0)


SERVO = {
    INERTIA: 60.0,
    "transmission.viscous_friction_engine_side_N_m_s_rad": 300.0,
    "transmission.coulomb_friction_engine_side_N_m": 12.0,
    "prime_mover.torque_offset_N_m": 0.0,
}


def swung(servo: Ship, every: int) -> tuple[Ship, pd.DataFrame]:
    """A servo with friction and an offset, under a smooth torque; every so manieth row of 1 kHz."""
    truth = servo.with_values(
        {
            "transmission.coulomb_friction_engine_side_N_m": 20.0,
            "prime_mover.torque_offset_N_m": 3.0,
        }
    )
    time = 0.001 * np.arange(12_001)
    torque = 60.0 * np.sin(2.0 * time) + 40.0 * np.sin(0.8 * time**1.5)
    table = pd.DataFrame({"time_s": time, "motor_torque_N_m": torque, "shaft_speed_rad_s": 0.0})
    noise = 1e-4 * np.random.default_rng(2).standard_normal(len(time))
    table["shaft_speed_rad_s"] = simulate_recording(truth, table)["shaft_speed_rad_s"] + noise
    return truth, table.iloc[::every].reset_index(drop=True)


def test_of_a_force_of_which_few_rows_were_kept_lines_are_drawn(servo: Ship) -> None:
    """Held, it would be 20 ms late on average: a tenth of the shaft's response at its fastest."""
    truth, table = swung(servo, 40)
    start = servo.with_values(SERVO)
    found = identify(start, table, free=list(SERVO))
    for key, value in found.parameters.items():
        assert value == pytest.approx(truth.parameter(key).value, rel=0.02), key
    assert any(said.startswith("the commands are interpolated linearly") for said in found.warnings)
    assert {"highest_Hz", "2logL", *SERVO} == set(found.tables["search"])


def test_a_demand_that_holds_is_held(servo: Ship) -> None:
    rng = np.random.default_rng(3)
    table = pd.DataFrame({"time_s": 0.04 * np.arange(1000)})
    table["motor_torque_N_m"] = np.repeat(rng.uniform(-90.0, 90.0, 100), 10)
    table["shaft_speed_rad_s"] = 0.0
    noise = 1e-4 * rng.standard_normal(len(table))
    table["shaft_speed_rad_s"] = simulate_recording(servo, table)["shaft_speed_rad_s"] + noise
    found = identify(servo.with_values({INERTIA: 60.0}), table, free=[INERTIA])
    assert found.parameters[INERTIA] == pytest.approx(95.0, rel=2e-3)
    assert not found.warnings


def test_of_small_motions_the_linear_model_tells_the_numbers(frigate: Ship) -> None:
    time = np.arange(0.0, 200.0, 0.2)
    table = pd.DataFrame({"time_s": time, "pitch_ratio_command": 1.4})
    table["fuel_rack_mm"] = 22.0 + 0.4 * np.sign(np.sin(0.3 * time)) + 0.4 * np.sin(0.08 * time)
    sailed = simulate_recording(frigate.with_values(TRUTH), table)
    table["shaft_speed_rad_s"] = sailed["shaft_speed_rad_s"]
    table["ship_speed_m_s"] = sailed["ship_speed_m_s"]
    noise = np.random.default_rng(5).standard_normal((2, len(time)))
    table["shaft_speed_rad_s"] += 2e-3 * noise[0]
    table["ship_speed_m_s"] += 2e-3 * noise[1]
    found = identify(frigate, table, free=list(TRUTH), method="output-error-linear")
    for estimate in found.estimates:
        truth = TRUTH[estimate.key]
        assert estimate.value == pytest.approx(truth, rel=0.03), estimate.key
        assert estimate.neutral != pytest.approx(truth, rel=0.1)
