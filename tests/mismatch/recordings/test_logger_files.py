"""Files as loggers write them hold the same voyage, whatever their form."""

from __future__ import annotations

import datetime
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Recording, load_recording
from shaftline.mismatch.recordings.columns import Source
from shaftline.mismatch.recordings.unit_errors import command_ranges
from shaftline.plant import RecordingError, Ship

from .conftest import Load
from .trials import RPM

UNITS = ["", "%", "%", "rpm", "-", "kN m", "kn"]
MAP = """[columns]
Zeit = { column = "time_s", unit = "datetime" }
"Füllung" = { column = "fuel_rack_mm", unit = "percent of range" }
Steigung = { column = "pitch_ratio_command", unit = "percent of range" }
n = { column = "shaft_speed_rad_s", unit = "rpm" }
"P/D" = "pitch_ratio"
Q = { column = "shaft_torque_N_m", unit = "kN m" }
v = { column = "ship_speed_m_s", unit = "knot" }
"""
TAKEN = (
    MAP.replace(', unit = "rpm"', "").replace(', unit = "kN m"', "").replace(', unit = "knot"', "")
)


@pytest.fixture(scope="module")
def logged(calm: pd.DataFrame, frigate: Ship) -> pd.DataFrame:
    """The calm voyage under a logger's names and in its units, beginning before midnight."""
    stamps = pd.Timestamp("2024-05-03 23:58:30") + pd.to_timedelta(calm["time_s"], unit="s")
    high = float(frigate.record()["pitch_ratio_max"])
    return pd.DataFrame(
        {
            "Zeit": stamps,
            "Füllung": calm["fuel_rack_mm"] / 0.4,
            "Steigung": 100.0 / high * calm["pitch_ratio_command"],
            "n": RPM * calm["shaft_speed_rad_s"],
            "P/D": calm["pitch_ratio"],
            "Q": 1e-3 * calm["shaft_torque_N_m"],
            "v": calm["ship_speed_m_s"] * 3600 / 1852,
        }
    )


def text(
    table: pd.DataFrame, separator: str, decimal: str, head: str = "", units: bool = False
) -> str:
    body: str = table.to_csv(sep=separator, decimal=decimal, header=False, index=False)
    names = separator.join(table) + "\n"
    return head + names + (separator.join(UNITS) + "\n" if units else "") + body


def write_text(encoding: str, stamp: str, *args: Any) -> Callable[[pd.DataFrame, Path], Path]:
    def write(table: pd.DataFrame, folder: Path) -> Path:
        table = table.assign(Zeit=table["Zeit"].dt.strftime(stamp))
        (folder / "r.txt").write_text(text(table, *args), encoding=encoding)
        return folder / "r.txt"

    return write


def write_sheet(table: pd.DataFrame, folder: Path) -> Path:
    with pd.ExcelWriter(folder / "r.xlsx", engine="openpyxl") as book:
        pd.DataFrame({"notes": ["none"]}).to_excel(book, sheet_name="Notes", index=False)
        table.to_excel(book, sheet_name="Log", index=False, startrow=2)
    return folder / "r.xlsx"


FORMS: dict[str, tuple[Callable[[pd.DataFrame, Path], Path], str, str]] = {
    "semicolon, comma, head, units, clock": (
        write_text("utf-8", "%H:%M:%S,%f", ";", ",", "Logger 3.1\nShip: Test\n", True),
        TAKEN,
        "separator semicolon, decimal comma, names in line 3, units in line 4",
    ),
    "tab, utf-16": (
        write_text("utf-16", "%d.%m.%Y %H:%M:%S.%f", "\t", "."),
        MAP,
        "encoding utf-16, separator tab",
    ),
    "cp1252": (
        write_text("cp1252", "%Y-%m-%d %H:%M:%S,%f", ";", ","),
        MAP,
        "encoding cp1252, separator semic",
    ),
    "marked utf-8": (
        write_text("utf-8-sig", "%m/%d/%Y %H:%M:%S.%f", "|", "."),
        MAP.replace('"datetime"', '"datetime %m/%d/%Y %H:%M:%S.%f"'),
        "encoding utf-8-sig, separator bar",
    ),
    "told": (
        write_text("cp850", "%H:%M:%S.%f", ";", ",", "a;b;c\n"),
        MAP + '[file]\nencoding = "cp850"\nseparator = ";"\ndecimal = ","\nheader_row = 2\n',
        "encoding cp850",
    ),
    "spreadsheet": (write_sheet, MAP + '[file]\nsheet = "Log"\n', "sheet 'Log', names in line 3"),
}


@pytest.mark.parametrize("form", FORMS)
def test_the_same_voyage_comes_out(
    logged: pd.DataFrame, calm: pd.DataFrame, frigate: Ship, tmp_path: Path, form: str
) -> None:
    write, columns, said = FORMS[form]
    (tmp_path / "map.toml").write_text(columns, encoding="utf-8")
    found = load_recording(write(logged, tmp_path), frigate, tmp_path / "map.toml")
    assert said in found.warnings[0]
    for column in calm:
        np.testing.assert_allclose(found[column], calm[column], rtol=1e-6, atol=1e-6)


def spoiled(table: pd.DataFrame, folder: Path, rows: range) -> tuple[Path, Path]:
    """Write the voyage with decimal commas and a text in some rows of its torque, and its map."""
    form = write_text("utf-8", "%H:%M:%S,%f", ";", ",", "", True)
    file, column_map = form(table, folder), folder / "map.toml"
    lines = file.read_text().splitlines()
    for row in rows:
        cells = lines[row + 2].split(";")
        lines[row + 2] = ";".join([*cells[:5], "Sensorfehler", *cells[6:]])
    file.write_text("\n".join(lines) + "\n")
    column_map.write_text(TAKEN, encoding="utf-8")
    return file, column_map


def test_a_text_among_decimal_commas_is_named_and_costs_only_its_own_value(
    logged: pd.DataFrame, calm: pd.DataFrame, frigate: Ship, tmp_path: Path
) -> None:
    file, column_map = spoiled(logged, tmp_path, range(50, 51))
    found = load_recording(file, frigate, column_map)
    assert found.warnings[1] == (
        "column 'Q', line 53: 'Sensorfehler' is not a number; text counts as missing, correct the cell "
        "if it is a value"
    )
    other = np.arange(len(calm)) != 50
    torque = calm["shaft_torque_N_m"].to_numpy()
    np.testing.assert_allclose(found["shaft_torque_N_m"][other], torque[other], rtol=1e-6)


def test_a_text_in_too_many_rows_is_named_in_the_refusal(
    logged: pd.DataFrame, frigate: Ship, tmp_path: Path
) -> None:
    file, column_map = spoiled(logged, tmp_path, range(50, 55))
    with pytest.raises(
        RecordingError, match=r"row 51: 5 values in a row are missing .*'Q', line 53"
    ):
        load_recording(file, frigate, column_map)


def test_a_plain_file_is_read_without_a_word(load: Load, calm: pd.DataFrame) -> None:
    assert load(calm).warnings == ()


def test_percent_of_range_reaches_both_limits(frigate: Ship) -> None:
    source = Source(column="pitch_ratio_command", unit="percent of range")
    low, high = command_ranges(frigate)["pitch_ratio_command"]
    given = source.convert(pd.Series([-100.0, -50.0, 0.0, 50.0, 100.0]), command_ranges(frigate))
    half = -0.5 * abs(low)
    np.testing.assert_allclose(given, [-abs(low), half, 0.0, 0.5 * high, high])
    with pytest.raises(ValueError, match=r"needs a range .* ship_speed_m_s has none"):
        Source(column="ship_speed_m_s", unit="percent of range").convert(
            given, command_ranges(frigate)
        )


def through(load: Load, calm: pd.DataFrame, stamps: Any, unit: str = "datetime") -> Recording:
    table = calm.assign(time_s=np.asarray(stamps, dtype=object))
    return load(table, f'[columns]\ntime_s = {{ column = "time_s", unit = "{unit}" }}')


def test_a_clock_counts_on_over_midnight(load: Load, calm: pd.DataFrame) -> None:
    start = datetime.datetime(2024, 5, 3, 23, 59, 0)
    stamps = [
        (start + datetime.timedelta(seconds=s)).strftime("%H:%M:%S.%f") for s in calm["time_s"]
    ]
    np.testing.assert_allclose(through(load, calm, stamps).time_s, calm["time_s"], atol=1e-6)


def test_whole_second_stamps_are_spread(load: Load, calm: pd.DataFrame) -> None:
    late = calm["time_s"] + 0.33  # the first second is cut off
    stamps = [
        f"2024-05-03T12:00:{int(s):02d}"
        if s < 60
        else f"2024-05-03T12:{int(s) // 60:02d}:{int(s) % 60:02d}"
        for s in late
    ]
    found = through(load, calm, stamps)
    assert "repeats each time for 10 rows and then steps by 1 s" in found.warnings[0]
    np.testing.assert_allclose(found.time_s, calm["time_s"], atol=1e-6)


def test_the_order_of_day_and_month_is_not_guessed_where_it_matters(
    load: Load, calm: pd.DataFrame
) -> None:
    start = datetime.datetime(2024, 5, 3, 23, 59, 0)
    moments = [start + datetime.timedelta(seconds=s) for s in calm["time_s"]]
    slashes = [m.strftime("%d/%m/%Y %H:%M:%S.%f") for m in moments]
    with pytest.raises(RecordingError, match=r"day or its month first.*unit = .datetime %d/%m/%Y"):
        through(load, calm, slashes)
    for unit, stamps in (
        ("datetime %d/%m/%Y %H:%M:%S.%f", slashes),
        ("datetime", [m.strftime("%d.%m.%Y %H:%M:%S.%f") for m in moments]),  # dots: day first
        ("datetime", [(m.replace(day=13)).strftime("%m/%d/%Y %H:%M:%S.%f") for m in moments[:500]]),
    ):
        found = through(load, calm[: len(stamps)], stamps, unit)
        np.testing.assert_allclose(found.time_s, calm["time_s"][: len(stamps)], atol=1e-6)
    with pytest.raises(RecordingError, match=r"'time_s' as time_s: .*does.* match"):
        through(load, calm, slashes, "datetime %Y")


@pytest.mark.parametrize("missing", [1, 3])
def test_short_runs_of_missing_values_are_filled(
    load: Load, calm: pd.DataFrame, missing: int
) -> None:
    table = calm.copy()
    table.loc[700 : 699 + missing, "ship_speed_m_s"] = np.nan
    found = load(table)
    assert f"ship_speed_m_s: {missing} of 1800 values were missing" in found.warnings[0]
    straight = np.interp(
        range(700, 700 + missing),
        [699, 700 + missing],
        calm["ship_speed_m_s"][[699, 700 + missing]],
    )
    np.testing.assert_allclose(found["ship_speed_m_s"][700 : 700 + missing], straight)


def test_a_long_run_of_missing_values_is_refused(load: Load, calm: pd.DataFrame) -> None:
    table = calm.copy()
    table.loc[700:703, "ship_speed_m_s"] = np.nan
    with pytest.raises(
        RecordingError, match=r"ship_speed_m_s, row 701: 4 values in a row are miss"
    ):
        load(table)


def test_a_slow_channel_keeps_each_value(load: Load, calm: pd.DataFrame) -> None:
    table = calm.copy()
    table.loc[table.index % 10 != 0, "ship_speed_m_s"] = np.nan
    found = load(table)
    assert "ship_speed_m_s has a value in every 10 rows" in found.warnings[0]
    assert found.noise["ship_speed_m_s"].update_s == pytest.approx(1.0)
    held = calm["ship_speed_m_s"][np.arange(len(calm)) // 10 * 10]
    np.testing.assert_array_equal(found["ship_speed_m_s"], held)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ('separator = "ab"', r"file\.separator: 'ab' \(allowed: one character such as"),
        ('decimal = "x"', r"file\.decimal: .*'.' or ','"),
        ('encoding = "klingon"', r"file\.encoding: 'klingon' is no known encoding"),
        (
            'encoding = "rot13"',
            r"file\.encoding: 'rot13' is no known encoding",
        ),  # turns text into text
        ('encoding = "zip"', r"file\.encoding: 'zip' is no known encoding"),  # and bytes into bytes
        ('separator = ","\ndecimal = ","', r"file: separator and decimal are both ','"),
        ("header_row = 0", r"file\.header_row: .*greater than or equal to 1"),
        ("names = 3", r"file\.names is not a known key \(allowed: separator, decimal, encoding"),
    ],
)
def test_a_bad_layout_is_named(load: Load, calm: pd.DataFrame, said: str, words: str) -> None:
    with pytest.raises(RecordingError, match=rf"map\.toml: {words}"):
        load(calm, f"[file]\n{said}\n")


@pytest.mark.parametrize(
    ("unit", "why"), [("%", "percent of range"), ("fathom", "cannot be converted")]
)
def test_a_unit_of_the_file_that_may_mislead_is_refused(
    load: Load, tmp_path: Path, frigate: Ship, calm: pd.DataFrame, unit: str, why: str
) -> None:
    names = list(calm)
    units = ["s", unit, *[""] * (len(names) - 2)]
    body = calm.to_csv(header=False, index=False)
    (tmp_path / "u.csv").write_text(",".join(names) + "\n" + ",".join(units) + "\n" + body)
    (tmp_path / "map.toml").write_text(f'[columns]\n{names[1]} = "{names[1]}"\n')
    if unit == "fathom":
        (tmp_path / "u.csv").write_text((tmp_path / "u.csv").read_text().replace("fathom", "kN"))
    with pytest.raises(
        RecordingError, match=rf"the unit .* in the file .*{why}.*set unit = in the column map"
    ):
        load_recording(tmp_path / "u.csv", frigate, tmp_path / "map.toml")


def test_what_is_no_spreadsheet_is_refused(tmp_path: Path, frigate: Ship) -> None:
    (tmp_path / "a.xlsx").write_text("hello")
    with pytest.raises(RecordingError, match=r"a\.xlsx: it is no spreadsheet"):
        load_recording(tmp_path / "a.xlsx", frigate)
    with zipfile.ZipFile(tmp_path / "b.xlsx", "w", zipfile.ZIP_DEFLATED) as bomb:
        for part in range(3):
            with bomb.open(f"xl/worksheets/sheet{part}.xml", "w", force_zip64=True) as member:
                for _ in range(300):
                    member.write(bytes(1_000_000))
    with pytest.raises(RecordingError, match=r"b\.xlsx: the spreadsheet unpacks to 900 MB"):
        load_recording(tmp_path / "b.xlsx", frigate)


def test_a_sheet_that_is_not_there_is_named(
    logged: pd.DataFrame, tmp_path: Path, frigate: Ship
) -> None:
    path = write_sheet(logged, tmp_path)
    (tmp_path / "map.toml").write_text(MAP + '[file]\nsheet = "Voyage"\n', encoding="utf-8")
    with pytest.raises(RecordingError, match=r"no sheet 'Voyage'; it has: Notes, Log"):
        load_recording(path, frigate, tmp_path / "map.toml")


@pytest.mark.parametrize(
    ("encoding", "stated"),
    [
        *(
            (f"utf-{wide}", stated)
            for wide in ("16", "16-be", "16-le", "32", "32-be", "32-le")
            for stated in (False, True)
        ),
        ("cp500", True),  # of a mainframe, which nobody guesses
    ],
)
def test_wide_letters_are_read_with_and_without_a_mark(
    frigate: Ship, calm: pd.DataFrame, tmp_path: Path, encoding: str, stated: bool
) -> None:
    (tmp_path / "r.csv").write_bytes(calm.to_csv(index=False).encode(encoding))
    (tmp_path / "map.toml").write_text(f'[file]\nencoding = "{encoding}"\n')
    found = load_recording(tmp_path / "r.csv", frigate, tmp_path / "map.toml" if stated else None)
    np.testing.assert_allclose(found["shaft_torque_N_m"], calm["shaft_torque_N_m"], rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "begins", "words"),
    [
        ("r.csv.gz", b"\x1f\x8b\x08\x00", r"compressed \(gzip\); unpack it first"),
        ("r.csv.zip", b"PK\x03\x04", "a zip archive or a spreadsheet"),
        ("r.mat", b"MATLAB 5.0 MAT-file", "a MATLAB file; save the table as CSV"),
        ("r.mat", b"\x89HDF\r\n", "an HDF5 or a MATLAB file"),
        ("r.csv", b"PAR1", r"a Parquet file; give it the ending \.parquet"),
        ("r.csv", b"time_s,fuel\x00rack\n1,2\n", "bytes that are no text"),
    ],
)
def test_what_is_no_text_is_named_for_what_it_is(
    frigate: Ship, tmp_path: Path, name: str, begins: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(begins + bytes(200))
    with pytest.raises(RecordingError, match=words):
        load_recording(tmp_path / name, frigate)
