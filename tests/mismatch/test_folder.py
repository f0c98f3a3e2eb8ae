"""A folder of recordings: what is done, what is kept, what is done again."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from shaftline.core.sweep import SweepError
from shaftline.mismatch import Options, diagnose_folder, folder
from shaftline.mismatch.identification.parameters import Start
from shaftline.mismatch.report.index import PAGE, PDF, REPORT, SHIP
from shaftline.plant import Ship

from .diagnoses import diagnosis_of

Asked = list[tuple[str, str, Options]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """Every recording that is diagnosed: its name, its first line and the options."""
    told: Asked = []

    def diagnose(ship: Ship, path: Path, options: Options) -> Any:
        text = path.read_text()
        told.append((path.name, text, options))
        if "bad" in text:
            raise ValueError(f"{path}: time_s, row 3")
        if "broken" in text:
            raise RuntimeError("the tool itself")
        diagnosis = diagnosis_of("explained" if "fouled" in text else "nothing-missing")

        def save(self: Any, place: Path, pdf: bool = False) -> Path:
            place.mkdir(parents=True)
            (place / REPORT).write_text(json.dumps(self.to_dict()))
            (place / PAGE).write_text(text)
            (place / SHIP).write_text("ship")
            if pdf:
                (place / PDF).write_bytes(b"%PDF\xff" + text.encode())
            return place

        monkeypatch.setattr(type(diagnosis), "save", save)
        return diagnosis

    monkeypatch.setattr(folder, "diagnose", diagnose)
    return told


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    place = tmp_path / "runs"
    place.mkdir()
    files = {
        "a_20240503.csv": "fouled",
        "b 2024-06-01.csv": "calm",
        "c.parquet": "bad",
        ".d.csv": "x",
        "e.txt": "x",
    }
    for name, text in files.items():
        (place / name).write_text(text)
    (place / "within").mkdir()
    (place / "within" / "f.csv").write_text("calm")
    return place


def run(runs: Path, ship: Ship, options: Options = Options(), **more: Any) -> Any:  # noqa: B008
    return diagnose_folder(runs, ship, runs.parent / "out", options, jobs=1, **more)


def test_each_recording_has_its_folder_and_its_row(asked: Asked, runs: Path, frigate: Ship) -> None:
    ticks: list[int] = []
    index = run(runs, frigate, tick=lambda: ticks.append(1))
    assert [name for name, _, _ in asked] == ["a_20240503.csv", "b 2024-06-01.csv", "c.parquet"]
    assert len(ticks) == 3
    out = runs.parent / "out"
    for name in ("a_20240503", "b 2024-06-01"):
        assert {file.name for file in (out / name).iterdir()} == {REPORT, PAGE, SHIP}
    assert not (out / "c").exists()
    table = index.table.set_index("recording")
    assert list(table.index) == ["a_20240503.csv", "b 2024-06-01.csv", "c.parquet"]
    assert table["date"].iloc[0] == "2024-05-03"
    assert table["date"].iloc[1] == "2024-06-01"
    assert table["report"].iloc[0] == f"a_20240503/{PAGE}"
    assert table["error"].iloc[2] == "c.parquet: time_s, row 3"
    assert {"index.html", "index.csv", "cells"} <= {file.name for file in out.iterdir()}


def test_what_is_finished_is_not_done_again(asked: Asked, runs: Path, frigate: Ship) -> None:
    run(runs, frigate)
    asked.clear()
    lost = runs.parent / "out" / "a_20240503" / PAGE
    lost.unlink()
    run(runs, frigate)
    assert asked == []
    assert lost.read_text() == "fouled"  # and put back


def test_another_content_ship_option_or_map_is_done_anew(
    asked: Asked, runs: Path, frigate: Ship, tmp_path: Path
) -> None:
    run(runs, frigate)
    asked.clear()
    (runs / "b 2024-06-01.csv").write_text("calm too")
    run(runs, frigate)
    assert [name for name, _, _ in asked] == ["b 2024-06-01.csv"]
    (tmp_path / "map.toml").write_text('[columns]\nN = "shaft_speed_rad_s"\n')
    for changed in (
        Options(tolerance=2.0),
        Options(exclude=("current",)),
        Options(columns=tmp_path / "map.toml"),
    ):
        asked.clear()
        run(runs, frigate, changed)
        assert [options for _, _, options in asked] == [changed] * 3
    asked.clear()
    run(runs, frigate.with_values({"hull.fouling_fraction": 0.1}))
    assert len(asked) == 3
    (tmp_path / "map.toml").write_text('[columns]\nN = "ship_speed_m_s"\n')
    asked.clear()
    run(runs, frigate, Options(columns=tmp_path / "map.toml"))
    assert len(asked) == 3


def test_results_of_what_has_become_bad_are_removed(
    asked: Asked, runs: Path, frigate: Ship
) -> None:
    run(runs, frigate)
    (runs / "a_20240503.csv").write_text("bad")
    index = run(runs, frigate)
    assert len(index.failed) == 2
    assert list((runs.parent / "out" / "a_20240503").iterdir()) == []


def test_a_failure_of_the_tool_is_listed_and_raised(
    asked: Asked, runs: Path, frigate: Ship
) -> None:
    (runs / "c.parquet").write_text("broken")
    with pytest.raises(SweepError, match="1 of 3 cells failed"):
        run(runs, frigate)
    page = (runs.parent / "out" / "index.html").read_text()
    assert "internal error, see cells/c_" in page
    assert "a_20240503" in page


def test_names_that_differ_by_their_ending_have_folders_of_their_own(
    asked: Asked, runs: Path, frigate: Ship
) -> None:
    (runs / "a_20240503.parquet").write_text("calm")
    run(runs, frigate)
    out = runs.parent / "out"
    assert (out / "a_20240503.csv" / REPORT).is_file()
    assert (out / "a_20240503.parquet" / REPORT).is_file()


def test_a_folder_needs_recordings_and_another_folder_for_results(
    asked: Asked, runs: Path, frigate: Ship, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match="the results need another folder"):
        diagnose_folder(str(runs), frigate, str(runs / ".." / "runs"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        ValueError, match=r"no recording in this folder; .* \.csv, \.tsv, \.parquet"
    ):
        diagnose_folder(tmp_path / "empty", frigate, tmp_path / "out")
    with pytest.raises(ValueError, match="unknown effect 'rust'"):
        run(runs, frigate, Options(exclude=("rust",)))
    with pytest.raises(ValueError, match=r"map\.toml: cannot be read"):
        run(runs, frigate, Options(columns=tmp_path / "map.toml"))
    assert asked == []


def test_the_date_is_the_first_stamp_s_else_the_name_s_else_the_file_s(
    asked: Asked, runs: Path, frigate: Ship, tmp_path: Path
) -> None:
    (runs / "a_20240503.csv").write_text("when,N\n2023-01-02T23:30:00-02:00,fouled\n")
    (tmp_path / "map.toml").write_text(
        '[columns]\nwhen = { column = "time_s", unit = "datetime" }\n'
    )
    file = runs / "g_20249903.csv"
    file.write_text("calm")
    os.utime(file, (1.7e9, 1.7e9))
    found = run(runs, frigate).table.set_index("recording")["date"]
    assert found["g_20249903.csv"] == "2023-11-14"
    (runs / "g_20249903.csv").unlink()
    (runs / "b 2024-06-01.csv").write_text("when,N\n2023-01-05T00:30:00+02:00,calm\n")
    stamped = run(runs, frigate, Options(columns=tmp_path / "map.toml"))
    dates = stamped.table.set_index("recording")["date"]
    assert dates["a_20240503.csv"] == "2023-01-03"  # in UTC
    assert dates["b 2024-06-01.csv"] == "2023-01-04"


def test_reports_for_print_are_written_beside_the_pages(
    asked: Asked, runs: Path, frigate: Ship
) -> None:
    run(runs, frigate, pdf=True)
    out = runs.parent / "out"
    assert (out / "a_20240503" / PDF).read_bytes() == b"%PDF\xfffouled"
    assert (out / "b 2024-06-01" / PDF).read_bytes() == b"%PDF\xffcalm"
    run(runs, frigate, pdf=True)
    assert len(asked) == 3  # nothing is diagnosed again


def test_a_full_diagnosis_does_not_take_the_results_of_a_quick_one(
    asked: Asked, runs: Path, frigate: Ship
) -> None:
    run(runs, frigate, Options(quick=True))
    run(runs, frigate, Options())
    assert [options.quick for _, _, options in asked] == 3 * [True] + 3 * [False]


def test_where_no_disk_is_shared_content_and_map_travel(
    asked: Asked, runs: Path, frigate: Ship, tmp_path: Path
) -> None:
    (tmp_path / "map.toml").write_text('[columns]\nN = "shaft_speed_rad_s"\n')
    options = Options(columns=tmp_path / "map.toml", tolerance=3.0)
    cell = folder._make_cell(runs / "a_20240503.csv", options, True)
    (runs / "a_20240503.csv").unlink()
    (tmp_path / "map.toml").unlink()
    found = folder._diagnose_cell(frigate, options, False, cell)
    assert set(found["files"]) == {REPORT, PAGE, SHIP}
    ((name, text, used),) = asked
    assert (name, text, used.tolerance) == ("a_20240503.csv", "fouled", 3.0)
    here = folder._make_cell(runs / "b 2024-06-01.csv", options, False)
    assert (here.content, here.columns) == (None, None)


def test_a_folder_is_calibrated_once(
    asked: Asked, runs: Path, frigate: Ship, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[Options] = []

    def begin(ship: Ship, options: Options) -> Start:
        begun.append(options)
        return Start(ship, ship.with_values({"hull.mass_kg": 3.2e6 + 1e4 * len(begun)}))

    monkeypatch.setattr(folder, "begin", begin)
    healthy = runs / "within" / "f.csv"
    run(runs, frigate, Options(calibrate=(healthy,)))
    assert [options.calibrate for options in begun] == [(healthy,)]
    assert len(asked) == 3
    assert all(options.calibrate == () for _, _, options in asked)
    run(runs, frigate, Options(calibrate=(healthy,)))  # told other numbers this time
    assert len(asked) == 6
