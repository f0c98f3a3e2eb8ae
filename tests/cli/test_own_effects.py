"""``--effects``: user-defined physics, from its file to the corrected ship for every command."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import catalogue
from shaftline.mismatch.identify import SHIP as IDENTIFIED
from shaftline.mismatch.report.index import REPORT, SHIP
from shaftline.plant import Ship, load_ship, simulate_recording, write_ship
from shaftline.plant.terms import Term

from .conftest import Command
from .test_bad_input import nothing_written, refused

MY = """
[[term]]
id = "apparent-wind"
balance = "hull"
acts_on = "resistance"
expression = "k * wind_speed ** 2 * cos(wind_angle)"
parameters = { k = { unit = "N s2/m2", low = 0.0, high = 1e4, probes = [2.0, 20.0] } }
"""
MAP = """
[signals]
"AWS [kn]" = { signal = "wind_speed", unit = "knot" }
"AWA [deg]" = { signal = "wind_angle", unit = "deg" }
"""
KNOT = 1852.0 / 3600.0
TRUTH = 10.0
NOISE = {"shaft_speed_rad_s": 0.01, "ship_speed_m_s": 0.02}
ALONE = [word for name in {e.id for e in catalogue()} for word in ("--exclude", name)]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures take time and have tests of their own."""
    page = SimpleNamespace(report_html=lambda diagnosis: f"<p>{diagnosis.verdict}</p>")
    monkeypatch.setitem(sys.modules, "shaftline.mismatch.report.html", page)


def carrying(ship: Ship, k: float) -> Ship:
    """A ship that the wind holds."""
    tree: dict[str, Any] = {
        "id": "apparent-wind-hull",
        "acts_on": "resistance",
        "parameters": {"k": k},
        "expression": "k * wind_speed ** 2 * cos(wind_angle)",
    }
    units = {"wind_speed": "m/s", "wind_angle": "rad"}
    return ship.with_signals(units).with_term(Term.model_validate(tree))


def logged(seconds: float = 400.0) -> pd.DataFrame:
    """A ferry's log at 2 Hz, under its own names: the wind turns from ahead to astern and rises."""
    time = np.arange(0.0, seconds, 0.5)
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": 18.0 + 6.0 * (time // 40 % 2),
            "pitch_ratio_command": 1.0 - 0.1 * (time // 70 % 2),
            "wind_speed": 9.0 + 4.0 * np.sin(0.05 * time),
            "wind_angle": np.radians(30.0 + 120.0 * (time // 100 % 2)),
        }
    )
    log = simulate_recording(carrying(load_ship("ferry"), TRUTH), table)
    rng = np.random.default_rng(0)
    for column, rms in NOISE.items():
        log[column] += rms * rng.standard_normal(len(log))
    log["AWS [kn]"] = log.pop("wind_speed") / KNOT
    log["AWA [deg]"] = np.degrees(log.pop("wind_angle"))
    return log.drop(columns=["pitch_ratio", "shaft_torque_N_m"])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    logged().to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "MY.toml").write_text(MY, encoding="utf-8")
    (tmp_path / "map.toml").write_text(MAP, encoding="utf-8")
    return tmp_path


@pytest.mark.usefixtures("quick")
def test_from_the_file_to_a_ship_that_every_command_sails(shaftline: Command, folder: Path) -> None:
    result = shaftline(
        "diagnose",
        folder / "log.csv",
        "--columns",
        folder / "map.toml",
        "--effects",
        folder / "MY.toml",
        "--ship",
        "ferry",
        "--out",
        folder / "out",
        *ALONE,
    )
    assert result.exit_code == 0, result.output
    report = json.loads((folder / "out" / REPORT).read_text())
    assert report["verdict"] == "explained"
    (effect,) = report["effects"]
    assert effect["id"] == "apparent-wind"
    low, high = effect["parameters"]["k"]["ci95"]
    assert low < TRUTH < high
    assert high - low < 0.35 * TRUTH  # the form may be wrong by 15 % on either side

    # the corrected ship carries the term: simulate writes its signals through
    corrected = load_ship(folder / "out" / SHIP)
    assert [term.id for term in corrected.term] == ["apparent-wind-hull"]
    canonical = pd.read_csv(folder / "log.csv")
    canonical["wind_speed"] = canonical["AWS [kn]"] * KNOT
    canonical["wind_angle"] = np.radians(canonical["AWA [deg]"])
    canonical.to_csv(folder / "canonical.csv", index=False)
    result = shaftline(
        "simulate",
        "--ship",
        folder / "out" / SHIP,
        "--inputs",
        folder / "canonical.csv",
        "--out",
        folder / "sailed.csv",
    )
    assert result.exit_code == 0, result.output
    sailed = pd.read_csv(folder / "sailed.csv")
    np.testing.assert_allclose(sailed["wind_speed"], canonical["wind_speed"], rtol=1e-9)
    np.testing.assert_allclose(sailed["wind_angle"], canonical["wind_angle"], rtol=1e-9)
    error = sailed["ship_speed_m_s"] - canonical["ship_speed_m_s"]
    calm = simulate_recording(load_ship("ferry"), canonical)["ship_speed_m_s"]
    assert error.std() < 1.2 * NOISE["ship_speed_m_s"]
    assert error.std() < 0.2 * (calm - canonical["ship_speed_m_s"]).std()


def test_identify_hears_the_signals_of_the_ship(shaftline: Command, folder: Path) -> None:
    write_ship(carrying(load_ship("ferry"), 6.0), folder / "mine.toml")
    said = ("--ship", folder / "mine.toml", "--free", "term.apparent-wind-hull.k")
    result = shaftline(
        "identify",
        folder / "log.csv",
        *said,
        "--columns",
        folder / "map.toml",
        "--out",
        folder / "out",
    )
    assert result.exit_code == 0, result.output
    found = load_ship(folder / "out" / IDENTIFIED).parameter("term.apparent-wind-hull.k").value
    assert found == pytest.approx(TRUTH, rel=0.03)

    # without the map the log has no such columns
    result = shaftline("identify", folder / "log.csv", *said, "--out", folder / "again")
    refused(result, "log.csv", "'wind_angle' is missing", "AWA [deg]")
    assert not (folder / "again").exists()


def test_a_simulation_without_the_signal_is_refused(shaftline: Command, folder: Path) -> None:
    write_ship(carrying(load_ship("ferry"), 6.0), folder / "mine.toml")
    result = shaftline(
        "simulate",
        "--ship",
        folder / "mine.toml",
        "--inputs",
        folder / "log.csv",
        "--out",
        folder / "sailed.csv",
    )
    refused(result, "log.csv", "'wind_angle' is missing")
    assert not (folder / "sailed.csv").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[[term]]", "[[term"), ("not valid TOML",)),
        (("probes", "probs"), ("term apparent-wind", "parameters.k.probs is not a known key")),
        (('balance = "hull"\n', ""), ("term apparent-wind", "balance is missing")),
        (('"hull"', '"sail"'), ("term apparent-wind", "balance", "'hull'")),
        (("cos(", "cosine("), ("term apparent-wind", "function 'cosine' is unknown", "cos")),
        (("* cos", "cos"), ("term apparent-wind", "not a valid expression (SyntaxError)")),
        (('"resistance"', '"sail"'), ("term apparent-wind", "acts_on", "'resistance'")),
        (('"apparent-wind"', '"wind"'), ("wind (hull) is already defined in the catalogue",)),
        ((MY, "# nothing"), ("the file has no [[term]] and no [[effect]]",)),
    ],
)
def test_a_file_that_cannot_be_used_is_named_before_work_begins(
    shaftline: Command, tmp_path: Path, change: tuple[str, str], words: tuple[str, ...]
) -> None:
    (tmp_path / "MY.toml").write_text(MY.replace(*change), encoding="utf-8")
    result = shaftline(
        "diagnose",
        tmp_path / "nowhere.csv",
        "--effects",
        tmp_path / "MY.toml",
        "--ship",
        "ferry",
        "--out",
        tmp_path / "out",
    )
    refused(result, "MY.toml", *words)
    assert "nowhere.csv" not in result.output
    nothing_written(tmp_path, "MY.toml")


def test_what_the_ship_or_the_recording_does_not_have_is_named(
    shaftline: Command, folder: Path
) -> None:
    said = ("diagnose", folder / "log.csv", "--out", folder / "out", "--effects")
    result = shaftline(*said, folder / "none.toml", "--ship", "ferry")
    refused(result, "none.toml", "cannot be read")
    result = shaftline(*said, folder / "MY.toml", "--ship", "rov-thruster")
    refused(result, "apparent-wind (hull) cannot act on rov-thruster", "motor, propeller")
    result = shaftline(*said, folder / "MY.toml", "--ship", "ferry")
    refused(result, "apparent-wind (hull) needs the signal wind_speed", "[signals]")
    result = shaftline(
        *said, folder / "MY.toml", "--effects", folder / "MY.toml", "--ship", "ferry"
    )
    refused(
        result,
        "MY.toml: apparent-wind (hull) is already defined in",
        "MY.toml; give your effect another id",
    )
    nothing_written(folder, "MY.toml", "log.csv", "map.toml")


@pytest.mark.usefixtures("quick")
def test_a_folder_is_diagnosed_anew_where_the_effects_changed(
    shaftline: Command, folder: Path
) -> None:
    logs, out = folder / "logs", folder / "out"
    logs.mkdir()
    (folder / "log.csv").rename(logs / "log.csv")
    said = (
        "diagnose",
        logs,
        "--columns",
        folder / "map.toml",
        "--effects",
        folder / "MY.toml",
        "--ship",
        "ferry",
        "--out",
        out,
        "--jobs",
        1,
        *ALONE,
    )
    for k, cells in (("2.0, 20.0", 1), ("2.0, 20.0", 1), ("3.0, 20.0", 2)):
        (folder / "MY.toml").write_text(MY.replace("2.0, 20.0", k), encoding="utf-8")
        result = shaftline(*said)
        assert result.exit_code == 0, result.output
        assert "apparent-wind" in pd.read_csv(out / "index.csv")["found"][0]
        assert len(list((out / "cells").glob("*.json"))) == cells
