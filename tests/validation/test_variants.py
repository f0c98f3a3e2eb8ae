"""Variants of the validation: the same cases, recorded in another way."""

from __future__ import annotations

import dataclasses
import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import load_ship
from shaftline.plant.replay import simulate_recording
from shaftline.validation import run, variants
from shaftline.validation.cases import Case, draw_case
from shaftline.validation.recording import SimulatedCase, simulate_case
from shaftline.validation.variants import OFF, TITLES, VARIANTS

SEED = 3
PLAIN = [i for i in range(40) if draw_case(SEED, i).kind == "null-calm"]
FRIGATE = next(i for i in PLAIN if draw_case(SEED, i).ship == "frigate")
BENCH = next(i for i in PLAIN if draw_case(SEED, i).ship != "frigate")


def short(variant: str, index: int = FRIGATE) -> Case:
    lively = {"programme": "steps"}
    return dataclasses.replace(draw_case(SEED, index, variant), seconds=150.0, **lively)  # type: ignore[arg-type]


@functools.cache
def made(variant: str, index: int = FRIGATE) -> SimulatedCase:
    return simulate_case(short(variant, index))


def test_each_variant_has_a_title_of_its_own() -> None:
    assert set(TITLES) == set(VARIANTS)
    assert len(set(TITLES.values())) == len(VARIANTS)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_variant_conceals_what_the_plain_case_does(variant: str) -> None:
    same = ("kind", "ship", "effects", "programme", "programme_seed", "noise_seed", "wave_height")
    for index in range(12):
        plain, other = draw_case(SEED, index), draw_case(SEED, index, variant)
        assert all(getattr(plain, name) == getattr(other, name) for name in same)
        assert other == draw_case(SEED, index, variant)
        assert other.variant == variant


def test_a_log_keeps_one_row_of_ten() -> None:
    plain, slow = made("plain").recording, made("1-hz").recording
    pd.testing.assert_frame_equal(slow, plain[::10].reset_index(drop=True))
    assert len(made("1-hz").without) == len(slow)


def test_a_raw_recording_has_as_much_noise_in_each_hertz() -> None:
    plain, raw = made("plain"), made("100-hz")
    assert len(raw.recording) == len(raw.concealed) == 10 * (len(plain.recording) - 1) + 1
    for column in ("shaft_speed_rad_s", "shaft_torque_N_m"):
        clean = raw.concealed[column].to_numpy()[::10]
        np.testing.assert_allclose(clean, plain.concealed[column], rtol=2e-3)
        noise = [
            float(np.std(simulated.recording[column] - simulated.concealed[column]))
            for simulated in (plain, raw)
        ]
        assert noise[1] / noise[0] == pytest.approx(np.sqrt(10.0), rel=0.1)
    held = raw.recording["fuel_rack_mm"].to_numpy()
    assert (held[:-1].reshape(-1, 10) == held[:-1:10, None]).all()


def test_the_channel_that_is_missing_is_not_the_one_at_fault() -> None:
    drawn = [draw_case(SEED, i, "one-missing") for i in range(80)]
    frigates = [case for case in drawn if case.ship == "frigate"]
    assert {case.missing for case in frigates} == set(variants.MISSING)
    assert {case.missing for case in drawn if case.ship != "frigate"} == {"motor_current_A"}
    for case in frigates:
        fault = variants.MISSING[case.missing]
        assert not any(one.effect.id.startswith(fault) for one in case.effects)
    recording = made("one-missing").recording
    assert short("one-missing").missing not in recording
    others = set(made("plain").recording) - set(recording)
    assert others == {short("one-missing").missing}


@pytest.mark.parametrize("index", [FRIGATE, BENCH])
def test_a_realistic_file_is_off_as_it_says(index: int, tmp_path: Path) -> None:
    case = short("realistic", index)
    assert set(case.off) == set(OFF[case.ship])
    for name, off in OFF[case.ship].items():
        assert abs(case.off[name] - 1.0) == pytest.approx(off)
    text = variants.file_text(case)
    assert text is not None
    (tmp_path / "ship.toml").write_text(text, encoding="utf-8")
    file = load_ship(tmp_path / "ship.toml")
    put_right = {  # the file's keys, and what moves each
        "transmission.coulomb_friction_engine_side_N_m": ("rub", 1),
        **(
            {
                "transmission.inertia_engine_side_kg_m2": ("inertia_front", 1),
                "transmission.inertia_propeller_side_kg_m2": ("inertia_back", 1),
                "hull.resistance_coefficient_N_s2_m2": ("resistance", 1),
                "propeller.relative_rotative_efficiency": ("rotative", 1),
            }
            if case.ship == "frigate"
            else {
                "transmission.inertia_engine_side_kg_m2": ("inertia", 1),
                "transmission.inertia_propeller_side_kg_m2": ("inertia", 1),
                "propeller.torque_coefficient": ("kq", 1),
            }
        ),
    }
    values = {
        key: file.parameter(key).value * case.off[name] for key, (name, _) in put_right.items()
    }
    if case.ship == "frigate":  # KT and 1 - t act on the hull as their product
        values["hull.thrust_deduction"] = 1.0 - 0.93 * case.off["kt_scale"]
    simulated = simulate_case(dataclasses.replace(case, wave_height=0.0))
    plant = simulate_recording(file.with_values(values), simulated.without)
    wrong = simulate_recording(file, simulated.without)
    near, far = (
        float(np.std(p["shaft_speed_rad_s"] - simulated.without["shaft_speed_rad_s"]))
        for p in (plant, wrong)
    )
    assert near < 0.01 * float(np.std(simulated.without["shaft_speed_rad_s"]))
    assert far > 5.0 * near
    assert simulated.healthy is not None
    assert list(simulated.healthy) == list(simulated.recording)


def test_numbers_that_are_off_are_so_either_way() -> None:
    drawn = [draw_case(SEED, i, "realistic").off for i in range(40)]
    signs = {(k, v > 1.0) for off in drawn for k, v in off.items()}
    assert len(signs) == 2 * len({k for k, _ in signs})


def test_a_healthy_record_is_another_voyage_without_effects() -> None:
    index = next(i for i in range(40) if draw_case(SEED, i).kind == "single")
    case = draw_case(SEED, index, "realistic")
    healthy = variants.reference_case(case)
    assert healthy is not None
    assert healthy.effects == ()
    assert healthy.programme != case.programme
    assert healthy.noise_seed != case.noise_seed
    assert (healthy.off, healthy.instruments) == (case.off, case.instruments)
    assert variants.reference_case(draw_case(SEED, index)) is None


def test_the_tool_is_given_the_file_and_the_healthy_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tool(
        file: Path, ship: str, out: Path, exclude: tuple[str, ...], healthy: Path | None = None
    ) -> Mapping[str, Any]:
        assert healthy == file.parent / run.HEALTHY
        assert healthy.is_file()
        assert load_ship(ship).transmission.coulomb_friction_engine_side_N_m == 3000.0
        assert not (file.parent / "truth.json").exists()
        return {"verdict": "nothing-missing"}

    run.run_case(short("realistic", FRIGATE), tmp_path, tool)
    tables = run.scores(tmp_path)
    run.write_page(tables, tmp_path, "shaftline validate", "realistic")
    assert list(tables["cases"]["outcome"]) == ["nothing-missing"]
    page = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert page.startswith("# Validation with realistic ship files\n")
    assert "Variant `realistic`: inertia and friction of the ship file off by 10 %" in page
    (place,) = tmp_path.glob("case-*")
    truth = json.loads((place / "truth.json").read_text(encoding="utf-8"))
    assert truth["case"]["off"] == short("realistic").off
