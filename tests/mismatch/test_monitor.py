"""Condition monitoring of recordings, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import monitor
from shaftline.mismatch.monitor import MonitorError
from shaftline.mismatch.report.monitor import monitoring_in_words, save_monitoring
from shaftline.plant import Ship
from shaftline.plant.replay import simulate_recording

KEY, OTHER = "hull.resistance_coefficient_N_s2_m2", "prime_mover.torque_per_rack_N_m_mm"
NOISE = {"shaft_speed_rad_s": 0.02, "shaft_torque_N_m": 800.0, "ship_speed_m_s": 0.03}


def recording(ship: Ship, seed: int) -> pd.DataFrame:
    """Recording of a ship under steps of rack and pitch, with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 600.0, 1.0)
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": np.repeat(rng.uniform(12.0, 24.0, 6), 100),
            "pitch_ratio_command": np.repeat(rng.uniform(1.0, 1.35, 4), 150),
        }
    )
    found = simulate_recording(ship, table)
    for column, sd in NOISE.items():
        found[column] += sd * rng.standard_normal(len(time))
    return found[[*table.columns, "pitch_ratio", *NOISE]]


@pytest.fixture(scope="module")
def ship(frigate: Ship) -> Ship:
    return frigate.with_values({"integration.time_step_s": 0.25})


@pytest.fixture(scope="module")
def folders(ship: Ship, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Three references, and three later recordings with 12 % more resistance."""
    place = tmp_path_factory.mktemp("monitor")
    worn = ship.with_values({KEY: 1.12 * ship.parameter(KEY).value})
    for name, own, seeds in (("normal", ship, (1, 2, 3)), ("later", worn, (11, 12, 13))):
        (place / name).mkdir()
        for k, seed in enumerate(seeds, 1):
            file = place / name / f"run_2026-0{k + (name == 'later') * 3}-01.csv"
            recording(own, seed).to_csv(file, index=False)
    return place / "normal", place / "later"


def test_grown_resistance_raises_an_alarm_and_nothing_else_does(
    ship: Ship, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    normal, later = folders
    (later / "empty.csv").write_text("time_s\n0\n")
    keys = [KEY, OTHER]
    done: list[int] = []
    found = monitor(
        ship, [normal], [later], tmp_path, free=keys, jobs=1, tick=lambda: done.append(1)
    )
    (later / "empty.csv").unlink()
    assert len(done) == 7
    assert set(found.alarms["key"]) == {KEY}
    assert len(found.alarms) == 3
    changed = found.changes[found.changes["key"] == KEY]
    true = 0.12 * ship.parameter(KEY).value
    assert ((changed["change"] - true).abs() < 1.5 * changed["half_95"]).all()
    assert found.changes["date"].tolist() == sorted(found.changes["date"])
    assert found.per == "day"
    assert set(found.trends) == set(keys)
    assert list(found.failed) == ["empty.csv"]
    words = monitoring_in_words(found)
    assert sum(text.startswith("alarm: run_2026-0") for text in words) == 3
    assert any(text.startswith("not used: empty.csv: ") for text in words)
    folder = save_monitoring(found, tmp_path)
    assert json.loads((folder / "monitor.json").read_text())["parameters"][0]["alarms"] == 3
    assert (folder / "monitor.png").stat().st_size > 10_000
    assert len(pd.read_csv(folder / "monitor.csv")) == 6


def test_files_of_one_name_are_told_apart_by_their_folder(
    ship: Ship, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    normal, later = folders
    for year, source in (("2025", "run_2026-04-01.csv"), ("2026", "run_2026-05-01.csv")):
        (tmp_path / year).mkdir()
        (tmp_path / year / "trial.csv").write_bytes((later / source).read_bytes())
    found = monitor(
        ship, [normal], [tmp_path / "2025", tmp_path / "2026"], tmp_path / "out", free=[KEY], jobs=1
    )
    assert sorted(found.changes["recording"]) == ["2025/trial.csv", "2026/trial.csv"]
    assert found.trends == {}


def test_a_comparison_without_usable_recordings_says_so(
    ship: Ship, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s\n0\n")
    found = monitor(ship, [folders[0]], [broken], tmp_path / "out", free=[KEY], jobs=1)
    assert not len(found.alarms)
    assert monitoring_in_words(found)[0].startswith("not used: broken.csv: ")
    save_monitoring(found, tmp_path / "out")


def test_what_cannot_be_monitored_is_refused(
    ship: Ship, folders: tuple[Path, Path], tmp_path: Path
) -> None:
    normal, later = folders
    first = normal / "run_2026-01-01.csv"
    for references, recordings, more, words in (
        ([normal], [first], {}, "run_2026-01-01.csv: is a reference and a later recording"),
        ([normal, first], [later], {}, "run_2026-01-01.csv: is given twice"),
        ([normal / "none.csv"], [later], {}, "none.csv: no such file or folder"),
        ([normal], [later], {"risk": 0.7}, "risk = 0.7: must lie between 0 and 0.5"),
        ([normal], [later], {"method": "guess"}, "unknown method 'guess'; known: output-error"),
        ([normal], [later], {"free": ["hull.colour"]}, "hull.colour is not a known key"),
        ([normal], [tmp_path], {}, "no recording in this folder"),
    ):
        with pytest.raises((MonitorError, ValueError), match=words):
            monitor(ship, references, recordings, tmp_path, **more)  # type: ignore[arg-type]
    broken = tmp_path / "broken.csv"
    broken.write_text("time_s\n0\n")
    with pytest.raises(MonitorError, match=r"broken\.csv: this reference cannot be used"):
        monitor(ship, [first, broken], [later], tmp_path / "out", free=[KEY], jobs=1)
