"""``shaftline diagnose``: what it writes and says, what it refuses, folders."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Options, diagnose
from shaftline.mismatch.report.index import PAGE, PDF, REPORT, SHIP
from shaftline.plant import equilibrium, load_ship
from shaftline.plant.replay import simulate_recording

from .conftest import Command
from .test_bad_input import nothing_written, refused

NOISE = {
    "pitch_ratio": 0.002,
    "shaft_speed_rad_s": 0.01,
    "shaft_torque_N_m": 1000.0,
    "ship_speed_m_s": 0.04,
}
WRITTEN = {PAGE, REPORT, SHIP}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures and the search for a second effect take time and have tests of their own."""
    monkeypatch.setattr("shaftline.mismatch.search.selection.MOST_EFFECTS", 1)
    page = SimpleNamespace(report_html=lambda diagnosis: f"<p>{diagnosis.verdict}</p>")
    monkeypatch.setitem(sys.modules, "shaftline.mismatch.report.html", page)


def trial(seconds: float = 300.0, seed: int = 0, **values: float) -> pd.DataFrame:
    """A frigate's trial at 5 Hz, its rack and pitch in steps; values by key with ``__`` for a dot."""
    nominal = load_ship("frigate")
    true = nominal.with_values({key.replace("__", "."): value for key, value in values.items()})
    time = np.arange(0.0, seconds, 0.2)
    part = (time + 100.0 * seed).astype(int)
    orders = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": np.choose(part // 30 % 4, [20.0, 25.0, 16.0, 22.0]),
            "pitch_ratio_command": np.choose(part // 70 % 3, [1.2, 1.35, 1.0]),
        }
    )
    first = equilibrium(true, orders["fuel_rack_mm"][0], orders["pitch_ratio_command"][0]).state
    begun = orders.assign(
        pitch_ratio=first.pitch_ratio,
        shaft_speed_rad_s=first.shaft_speed,
        ship_speed_m_s=first.ship_speed,
    )
    table = simulate_recording(true, begun)
    rng = np.random.default_rng(seed)
    for column, rms in NOISE.items():
        table[column] += rms * rng.standard_normal(len(table))
    return table[[*orders, *NOISE]]


FOULED = trial(hull__fouling_fraction=0.3)


def test_a_foreign_recording_is_explained(shaftline: Command, tmp_path: Path) -> None:
    log = FOULED.assign(N=FOULED["shaft_speed_rad_s"] * 30.0 / np.pi)
    log.drop(columns="shaft_speed_rad_s").to_parquet(tmp_path / "log.parquet")
    (tmp_path / "map.toml").write_text(
        '[columns]\nN = { column = "shaft_speed_rad_s", unit = "rpm" }\n', encoding="utf-8"
    )
    result = shaftline(
        "diagnose",
        tmp_path / "log.parquet",
        "--columns",
        tmp_path / "map.toml",
        "--ship",
        "frigate",
        "--out",
        tmp_path / "out",
    )
    assert result.exit_code == 0, result.output
    assert {file.name for file in (tmp_path / "out").iterdir()} == WRITTEN
    report = json.loads((tmp_path / "out" / REPORT).read_text())
    assert report["verdict"] == "explained"
    assert report["recording"]["rows"] == len(log)
    effect = report["effects"][0]
    assert effect["id"] == "hull-fouling"
    low, high = effect["parameters"]["fouling_fraction"]["ci95"]
    assert low < 0.3 < high
    fit = report["fit"]["held_out"]
    assert fit["after"]["ship_speed_m_s"] > fit["before"]["ship_speed_m_s"] + 20.0
    corrected = load_ship(tmp_path / "out" / SHIP)
    value = effect["parameters"]["fouling_fraction"]["value"]
    assert corrected.hull.fouling_fraction == pytest.approx(value)
    said = " ".join(result.output.split())
    for words in (report["sentence"], "95 % from", "FitPercent", "held out", str(PAGE)):
        assert words in said, said


def test_a_pdf_is_written_on_request_for_each_recording(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pages = SimpleNamespace(report_pdf=lambda diagnosis: diagnosis.verdict.encode())
    monkeypatch.setitem(sys.modules, "shaftline.mismatch.report.pdf", pages)
    (tmp_path / "logs").mkdir()
    trial(60.0).to_csv(tmp_path / "logs" / "log.csv", index=False)
    given = "--ship", "frigate", "--out", tmp_path / "out", "--quick", "--pdf"
    result = shaftline("diagnose", tmp_path / "logs", *given, "--jobs", 1)
    assert result.exit_code == 0, result.output
    one = json.loads((tmp_path / "out" / "log" / REPORT).read_text())
    assert (tmp_path / "out" / "log" / PDF).read_text() == one["verdict"]
    shutil.rmtree(tmp_path / "out")
    result = shaftline("diagnose", tmp_path / "logs" / "log.csv", *given)
    assert result.exit_code == 0, result.output
    written = {file.name for file in (tmp_path / "out").iterdir() if file.is_file()}
    assert written == {*WRITTEN, PDF}
    verdict = json.loads((tmp_path / "out" / REPORT).read_text())["verdict"]
    assert (tmp_path / "out" / PDF).read_text() == verdict
    assert PDF in " ".join(result.output.split())


def test_whole_recordings_are_set_aside_and_ids_left_out(
    shaftline: Command, tmp_path: Path
) -> None:
    for name, seed in (("one", 1), ("two", 2)):
        table = trial(200.0, seed, hull__fouling_fraction=0.3)
        table.to_csv(tmp_path / f"{name}.csv", index=False)
    result = shaftline(
        "diagnose",
        tmp_path / "one.csv",
        "--hold-out",
        tmp_path / "two.csv",
        "--ship",
        "frigate",
        "--out",
        tmp_path / "out",
        "--exclude",
        "hull-fouling",
    )
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "out" / REPORT).read_text())
    assert report["recording"]["rows"] == 2000
    ((begin, end),) = report["recording"]["held_out"]
    assert begin == pytest.approx(200.0)
    assert end == pytest.approx(400.0)
    assert "hull-fouling" not in [effect["id"] for effect in report["effects"]]


def test_the_tolerance_s_factor_is_that_of_the_python_call(
    shaftline: Command, tmp_path: Path
) -> None:
    trial(200.0, 1, hull__fouling_fraction=0.06).to_csv(tmp_path / "one.csv", index=False)
    said = {}
    for factor in (1.0, 8.0):
        options = Options(tolerance=factor)
        found = diagnose(load_ship("frigate"), tmp_path / "one.csv", options=options)
        result = shaftline(
            "diagnose",
            tmp_path / "one.csv",
            "--ship",
            "frigate",
            "--out",
            tmp_path / f"{factor:g}",
            "--tolerance",
            f"{factor:g}",
        )
        assert result.exit_code == 0, result.output
        said[factor] = json.loads((tmp_path / f"{factor:g}" / REPORT).read_text())
        assert said[factor] == json.loads(json.dumps(found.to_dict()))
    assert said[1.0]["detectable"] != said[8.0]["detectable"]


def replaced(column: str, row: int, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table[column] = table[column].astype(object)
        table.loc[row, column] = value
        return table

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda t: t.drop(columns="fuel_rack_mm"),
            ("'fuel_rack_mm' is missing", "required: time_s"),
        ),
        (replaced("shaft_torque_N_m", 17, "dead"), ("shaft_torque_N_m", "row 18", "dead")),
        (replaced("time_s", 50, 0.5), ("time_s", "row 51", "must rise")),
        (lambda t: t[t.index % 12 < 6], ("time_s", "gap", "at least 10 rows")),
        (lambda t: t.iloc[:20], ("20 rows", "at least 40")),
        (lambda t: t.assign(shaft_speed_rad_s=t["shaft_speed_rad_s"] * 9.549), ("rpm",)),
        (lambda t: t.assign(shaft_torque_N_m=5.0), ("shaft_torque_N_m", "constant")),
        (
            lambda t: t.rename(
                columns={
                    "ship_speed_m_s": "shaft_speed_rad_s",
                    "shaft_speed_rad_s": "ship_speed_m_s",
                }
            ),
            ("ship_speed_m_s", "shaft_speed_rad_s", "swapped"),
        ),
    ],
)
def test_bad_recordings(
    shaftline: Command,
    tmp_path: Path,
    change: Callable[[pd.DataFrame], pd.DataFrame],
    words: tuple[str, ...],
) -> None:
    change(FOULED.copy()).to_csv(tmp_path / "trial.csv", index=False)
    out = tmp_path / "out"
    result = shaftline("diagnose", tmp_path / "trial.csv", "--ship", "frigate", "--out", out)
    refused(result, "trial.csv", *words)
    nothing_written(tmp_path, "trial.csv")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere.csv", "--ship", "frigate"), ("nowhere.csv", "cannot be read")),
        (("{trial}", "--ship", "fregate"), ("unknown ship 'fregate'", "frigate")),
        (
            ("{trial}", "--ship", "frigate", "--exclude", "rust"),
            ("unknown effect 'rust'", "hull-fouling"),
        ),
        (("{trial}", "--ship", "frigate", "--tolerance", "nan"), ("--tolerance",)),
        (("{trial}", "--ship", "frigate", "--columns", "no.toml"), ("no.toml", "cannot be read")),
        (("{trial}", "--ship", "frigate", "--hold-out", "{trial}"), ("trial.csv", "given twice")),
        (("{trial}", "--ship", "frigate", "--jobs", "2"), ("--jobs", "FOLDER")),
        (("{trial}", "--ship", "rov-thruster"), ("trial.csv", "'motor_voltage_V' is missing")),
        (("{folder}", "--ship", "frigate"), ("no recording in this folder", ".csv")),
        (("{folder}", "{trial}", "--ship", "frigate"), ("give a folder alone",)),
        (("{folder}", "--ship", "frigate", "--backend", "dask"), ("--scheduler",)),
        (("{trial}",), ("--ship",)),
    ],
)
def test_bad_arguments(
    shaftline: Command, tmp_path: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    places = {"trial": tmp_path / "trial.csv", "folder": tmp_path / "empty"}
    places["folder"].mkdir()
    FOULED.to_csv(places["trial"], index=False)
    given = [argument.format(**places) for argument in arguments]
    refused(shaftline("diagnose", *given, "--out", tmp_path / "out"), *words)
    nothing_written(tmp_path, "empty", "trial.csv")


def test_results_need_a_folder_of_their_own(shaftline: Command, tmp_path: Path) -> None:
    FOULED.to_csv(tmp_path / "trial.csv", index=False)
    for out, words in ((tmp_path / "trial.csv", "is a file"), (tmp_path, "another folder")):
        refused(shaftline("diagnose", tmp_path, "--ship", "frigate", "--out", out), words)
    nothing_written(tmp_path, "trial.csv")


def test_a_folder_is_diagnosed_and_goes_on_where_it_stopped(
    shaftline: Command, tmp_path: Path
) -> None:
    folder, out = tmp_path / "trials", tmp_path / "out"
    folder.mkdir()
    FOULED.to_csv(folder / "2024-05-03 fouled.csv", index=False)
    trial(200.0).to_csv(folder / "clean_20240601.csv", index=False)
    FOULED.drop(columns="time_s").to_csv(folder / "broken.csv", index=False)
    arguments = ("diagnose", folder, "--ship", "frigate", "--out", out, "--jobs", 1)
    result = shaftline(*arguments)
    assert result.exit_code == 0, result.output
    assert "broken.csv: column 'time_s' is missing" in result.output
    index = pd.read_csv(out / "index.csv", keep_default_na=False)
    assert list(index["recording"]) == ["2024-05-03 fouled.csv", "clean_20240601.csv", "broken.csv"]
    assert list(index["date"][:2]) == ["2024-05-03", "2024-06-01"]
    assert list(index["verdict"]) == ["explained", "nothing-missing", ""]
    assert "hull-fouling" in index["found"][0]
    page = (out / "index.html").read_text(encoding="utf-8")
    assert 'href="2024-05-03%20fouled/report.html"' in page
    assert "time_s" in page
    assert "http" not in page
    for name in ("2024-05-03 fouled", "clean_20240601"):
        assert {file.name for file in (out / name).iterdir()} == WRITTEN
    assert not (out / "broken").exists()

    # again: nothing is worked on, and what was lost is put back
    kept = {file: file.stat().st_mtime_ns for file in (out / "cells").glob("*.json")}
    (out / "clean_20240601" / REPORT).unlink()
    assert shaftline(*arguments).exit_code == 0
    assert {file: file.stat().st_mtime_ns for file in (out / "cells").glob("*.json")} == kept
    assert (out / "clean_20240601" / REPORT).is_file()

    # a recording that changed is diagnosed anew
    FOULED.assign(time_s=1.0).to_csv(folder / "clean_20240601.csv", index=False)
    assert shaftline(*arguments).exit_code == 0
    assert len(list((out / "cells").glob("*.json"))) == 4
    index = pd.read_csv(out / "index.csv", keep_default_na=False)
    assert (
        "must rise"
        in dict(zip(index["recording"], index["error"], strict=True))["clean_20240601.csv"]
    )
    assert not (out / "clean_20240601" / REPORT).exists()


def test_a_folder_without_one_good_recording_is_bad_input(
    shaftline: Command, tmp_path: Path
) -> None:
    (tmp_path / "trials").mkdir()
    (tmp_path / "trials" / "empty.csv").write_text("", encoding="utf-8")
    result = shaftline(
        "diagnose", tmp_path / "trials", "--ship", "frigate", "--out", tmp_path / "out", "--jobs", 1
    )
    refused(result, "none of its 1 recordings", "empty.csv")
    assert "empty.csv" in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


RESISTANCE = "hull.resistance_coefficient_N_s2_m2"


def test_a_healthy_period_tells_the_numbers_first(shaftline: Command, tmp_path: Path) -> None:
    """The file's resistance is 10 % low, and nothing is missing."""
    wrong = {"hull__resistance_coefficient_N_s2_m2": 1.1 * 3306.2}
    trial(300.0, 3, **wrong).to_csv(tmp_path / "healthy.csv", index=False)
    trial(300.0, 4, **wrong).to_csv(tmp_path / "now.csv", index=False)
    arguments = ("diagnose", tmp_path / "now.csv", "--ship", "frigate", "--out")
    healthy = ("--calibrate", tmp_path / "healthy.csv", "--free", RESISTANCE)
    result = shaftline(*arguments, tmp_path / "out", *healthy)
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "out" / REPORT).read_text())
    assert report["verdict"] == "nothing-missing"
    number = report["numbers"][RESISTANCE]
    assert number["source"] == "calibrated"
    assert number["file"] == 3306.2
    assert number["value"] == pytest.approx(1.1 * 3306.2, abs=4.0 * number["se"])
    assert abs(number["moved"]) < 4.0
    corrected = load_ship(tmp_path / "out" / SHIP)
    assert corrected.hull.resistance_coefficient_N_s2_m2 == number["corrected"]
    assert RESISTANCE in result.output
    assert "estimated from the reference period" in result.output


def test_a_free_number_is_no_missing_physics(shaftline: Command, tmp_path: Path) -> None:
    FOULED.to_csv(tmp_path / "trial.csv", index=False)
    result = shaftline(
        "diagnose",
        tmp_path / "trial.csv",
        "--ship",
        "frigate",
        "--out",
        tmp_path / "out",
        "--free",
        f"{RESISTANCE},",
    )
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "out" / REPORT).read_text())
    assert report["verdict"] == "nothing-missing"
    assert f"once the parameters are corrected: {RESISTANCE} is" in report["sentence"]
    number = report["numbers"][RESISTANCE]
    assert number["source"] == "free"
    assert number["corrected"] == pytest.approx(1.3 * 3306.2, rel=0.01)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            ("--calibrate", "nowhere.csv"),
            ("nowhere.csv", "recording of the reference period not found"),
        ),
        (("--free", "hull.rust"), ("hull.rust is no parameter of this ship", "hull.mass_kg")),
        (("--free", f"{RESISTANCE},{RESISTANCE}"), (RESISTANCE, "given twice")),
        (
            ("--free", "transmission.coulomb_friction_engine_side_N_m"),
            ("coulomb_friction_engine_side_N_m is 0", "[N m]", "[tolerances.numbers]"),
        ),
        (("--calibrate", "{trial}"), ("trial.csv is given twice", "another period")),
        (("--calibrate", "{text}"), ("text.csv",)),
    ],
)
def test_what_cannot_be_calibrated_is_refused_before_work_begins(
    shaftline: Command,
    tmp_path: Path,
    more: tuple[str, str],
    words: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    FOULED.to_csv(tmp_path / "trial.csv", index=False)
    (tmp_path / "text.csv").write_text("no recording at all", encoding="utf-8")
    monkeypatch.setattr("shaftline.mismatch.pipeline.Settings", None)  # no work
    places = {"trial": tmp_path / "trial.csv", "text": tmp_path / "text.csv"}
    result = shaftline(
        "diagnose",
        tmp_path / "trial.csv",
        "--ship",
        "frigate",
        "--out",
        tmp_path / "out",
        *(word.format(**places) for word in more),
    )
    refused(result, *words)
    assert not (tmp_path / "out").exists()
