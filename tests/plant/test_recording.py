"""Recordings are read as they are, or refused with file, column, row and reason."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant.recording import (
    RecordingError,
    check_bounds,
    convert_numbers,
    read_recording,
    read_table,
)

NEEDED = ["time_s", "fuel_rack_mm"]


@pytest.fixture
def table() -> pd.DataFrame:
    rows = 40
    return pd.DataFrame(
        {
            "time_s": 0.05 * np.arange(rows),
            "fuel_rack_mm": np.linspace(20.0, 24.0, rows),
            "shaft_speed_rad_s": np.linspace(10.0, 11.0, rows),
            "remark": ["calm"] * rows,
        }
    )


def saved(table: pd.DataFrame, tmp_path: Path) -> Path:
    path = tmp_path / "r.csv"
    table.to_csv(path, index=False)
    return path


def test_a_recording_survives_its_file(table: pd.DataFrame, tmp_path: Path) -> None:
    found = read_recording(saved(table, tmp_path), NEEDED)
    pd.testing.assert_frame_equal(found, table, rtol=1e-14)
    assert found["fuel_rack_mm"].dtype == np.float64


@pytest.mark.parametrize("suffix", [".parquet", ".pq", ".PARQUET"])
def test_parquet_is_read_by_its_suffix(table: pd.DataFrame, tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("pyarrow")
    table.to_parquet(tmp_path / f"r{suffix}")
    pd.testing.assert_frame_equal(read_recording(str(tmp_path / f"r{suffix}"), NEEDED), table)
    (tmp_path / "broken.parquet").write_text("time_s\n0.0\n")
    with pytest.raises(RecordingError, match=r"broken\.parquet: cannot be read as Parquet"):
        read_table(tmp_path / "broken.parquet")


def test_parquet_without_its_reader_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_reader(*_: Any) -> Any:
        raise ImportError("pyarrow")

    monkeypatch.setattr(pd, "read_parquet", no_reader)
    (tmp_path / "r.pq").write_bytes(b"PAR1")
    with pytest.raises(RecordingError, match=r"r\.pq: a Parquet file needs pyarrow: pip install"):
        read_table(tmp_path / "r.pq")


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nowhere\.csv: cannot be read as CSV"):
        read_table(tmp_path / "nowhere.csv")


@pytest.mark.parametrize(
    ("column", "row", "value", "words"),
    [
        ("fuel_rack_mm", 7, math.nan, r"r\.csv: fuel_rack_mm, row 8: nan is not a finite"),
        ("fuel_rack_mm", 7, "full", r"fuel_rack_mm, row 8: 'full' is not a finite number"),
        ("fuel_rack_mm", 7, "full", r"\(1 of 40 rows; unit mm\)"),
        (
            "fuel_rack_mm",
            3,
            2200.0,
            r"fuel_rack_mm, row 4: 2200 mm lies outside the physical range of 0 to 200 mm",
        ),
        ("fuel_rack_mm", 39, -1.0, r"fuel_rack_mm, row 40: -1 mm lies outside"),
        ("shaft_speed_rad_s", 0, math.inf, r"shaft_speed_rad_s, row 1: .*inf"),
        ("time_s", 5, 0.1, r"time_s, row 6: the time does not rise"),
        ("time_s", 5, 0.2, r"time_s, row 6: the time does not rise"),
        ("time_s", 39, 30.0, r"time_s, row 40: the step is 28\.1 s instead of 0\.05 s; resample"),
        ("time_s", 1, 0.0508, r"time_s, row 2: the step is 0\.0508 s instead of 0\.05 s"),
    ],
)
def test_bad_value_is_named_with_column_and_row(
    table: pd.DataFrame, tmp_path: Path, column: str, row: int, value: object, words: str
) -> None:
    table = table.astype(object)
    table.loc[row, column] = value
    with pytest.raises(RecordingError, match=words):
        read_recording(saved(table, tmp_path), NEEDED)


def test_time_steps_within_a_percent_are_even(table: pd.DataFrame, tmp_path: Path) -> None:
    table.loc[20:, "time_s"] += 0.0004
    assert len(read_recording(saved(table, tmp_path), NEEDED)) == 40
    table.loc[20:, "time_s"] += 0.00015
    with pytest.raises(RecordingError, match=r"row 21: the step is 0\.05055 s"):
        read_recording(saved(table, tmp_path), NEEDED)


def test_values_at_their_bounds_are_taken(table: pd.DataFrame) -> None:
    table.loc[0, "fuel_rack_mm"], table.loc[1, "fuel_rack_mm"] = 0.0, 200.0
    check_bounds(Path("r.csv"), table)


def test_missing_column_is_named(table: pd.DataFrame, tmp_path: Path) -> None:
    words = (
        r"column 'fuel_rack_mm' is missing; required: time_s, fuel_rack_mm; found: time_s, shaft"
    )
    with pytest.raises(RecordingError, match=words):
        read_recording(saved(table.drop(columns="fuel_rack_mm"), tmp_path), NEEDED)


@pytest.mark.parametrize("text", ["", "time_s\n0.0\n"])
def test_recording_without_rows_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "r.csv").write_text(text)
    with pytest.raises(RecordingError, match=r"r\.csv: (it is empty|1 row\(s\); at least 2)"):
        read_recording(tmp_path / "r.csv", ["time_s"])


def test_two_rows_are_enough_and_stay_as_they_were() -> None:
    given = pd.DataFrame({"time_s": ["0", "0.1"], "remark": ["a", "b"]})
    found = convert_numbers(Path("r.csv"), given, ["time_s"])
    assert found["time_s"].tolist() == [0.0, 0.1]
    assert given["time_s"].tolist() == ["0", "0.1"]
    assert found["remark"].tolist() == ["a", "b"]
