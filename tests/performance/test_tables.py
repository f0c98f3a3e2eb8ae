"""Tables of the trade: units of names and of a row of units, and what is not used."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.performance.monitoring import COLUMNS
from shaftline.performance.monitoring import read_log as read
from shaftline.performance.speed_trial import COLUMNS as RUN_COLUMNS
from shaftline.performance.speed_trial import read_runs
from shaftline.performance.tables import Column, TableError, canonical, read_table

HEADER = "Date/Time;STW;Shaft power;Wind_speed;Wind_angle;Lub oil\n"
VALUES = (
    "01.03.2026 00:00:00;12,0;4,5;8,0;0;40\n"
    "13.03.2026 00:00:00;12,1;4,6;8,1;0;40\n"
    "14.03.2026 00:00:00;12,2;4,7;8,2;0;40\n"
)


def log(tmp_path: Path, units: str, header: str = HEADER) -> Path:
    path = tmp_path / "log.csv"
    path.write_text(header + (f"{units}\n" if units else "") + VALUES)
    return path


def test_a_row_of_units_is_used(tmp_path: Path) -> None:
    found = read(log(tmp_path, "dd.mm.yyyy hh:mm:ss;kn;MW;m/s;deg;bar"))
    assert found["shaft_power"].tolist() == [4.5e6, 4.6e6, 4.7e6]
    assert found["wind_speed"].tolist() == [8.0, 8.1, 8.2]
    assert found["speed_through_water"][0] == pytest.approx(12.0 * 1852.0 / 3600.0)
    assert found["time"].tolist() == [0.0, 12.0 * 86400.0, 13.0 * 86400.0]
    assert found.attrs["remarks"] == ["columns that are not understood or not used: Lub oil"]
    knots = read(log(tmp_path, "dd.mm.yyyy hh:mm:ss;kn;MW;kn;deg;bar"))
    assert knots["wind_speed"][0] == pytest.approx(8.0 * 1852.0 / 3600.0)


def test_assumed_units_are_stated(tmp_path: Path) -> None:
    path = log(tmp_path, "", "time;STW [kn];power [MW];Wind speed;Rel. wind dir [deg];x\n")
    found = canonical(read_table(path), COLUMNS, "log", gaps=True)
    assert found["wind_speed"][0] == 8.0
    assert found["wind_angle"].tolist() == [0.0, 0.0, 0.0]
    assert found.attrs["remarks"][0] == "no unit is stated, taken: Wind speed as m/s"
    assert "wind_angle" not in found.attrs["absent"]
    assert "draught" in found.attrs["absent"]


def test_two_units_of_a_column_are_refused(tmp_path: Path) -> None:
    path = log(tmp_path, "dd.mm.yyyy;m/s;MW;m/s;deg;bar", HEADER.replace("STW", "STW_kn"))
    with pytest.raises(TableError, match=r"'STW_kn': its name has the unit 'kn' and .* 'm/s'"):
        read(path)
    with pytest.raises(TableError, match=r"unit 'mbar' of shaft_power is not known; use kW, MW"):
        read(log(tmp_path, "dd.mm.yyyy;m/s;mbar;m/s;deg;bar"))


def test_a_folder_needs_one_row_of_units(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    for name, units in (
        ("a.csv", "dd.mm.yyyy;kn;MW;m/s;deg;bar"),
        ("b.csv", "dd.mm.yyyy;kn;kW;m/s;deg;bar"),
    ):
        (folder / name).write_text(HEADER + units + "\n" + VALUES)
    with pytest.raises(TableError, match=r"b\.csv: another row of units than a\.csv"):
        read_table(folder)
    (folder / "b.csv").write_text((folder / "a.csv").read_text().replace("2026", "2027"))
    assert read(folder)["shaft_power"].max() == 4.7e6
    assert math.isclose(read(folder)["wind_speed"].max(), 8.2)


def test_a_text_in_a_column_of_numbers_is_named_with_its_line(tmp_path: Path) -> None:
    path = log(tmp_path, "dd.mm.yyyy hh:mm:ss;kn;MW;m/s;deg;bar")
    path.write_text(path.read_text().replace(";4,6;", ";defekt;"))
    found = read(path)
    assert found["shaft_power"].iloc[[0, 2]].tolist() == [4.5e6, 4.7e6]
    assert math.isnan(found["shaft_power"][1])
    assert found.attrs["remarks"][0] == (
        "column 'Shaft power', line 4: 'defekt' is not a number; text counts as missing, correct the "
        "cell if it is a value"
    )
    refused = (
        r"log: column 'Shaft power', line 4: 'defekt' is not a number; correct this cell or remove"
    )
    with pytest.raises(TableError, match=refused):
        canonical(read_table(path), COLUMNS, "log")


def test_a_text_in_a_folder_is_named_with_its_file(tmp_path: Path) -> None:
    path = log(tmp_path, "dd.mm.yyyy hh:mm:ss;kn;MW;m/s;deg;bar")
    later = path.read_text().replace("2026", "2027").replace(";4,6;", ";defekt;")
    (tmp_path / "next.csv").write_text(later)
    assert (
        read(tmp_path)
        .attrs["remarks"][0]
        .startswith("column 'Shaft power', next.csv line 4: 'defekt' is not a number; text counts")
    )


@pytest.mark.parametrize("columns", [RUN_COLUMNS, COLUMNS], ids=["trial", "service"])
def test_the_heading_is_read_where_a_file_has_the_course_as_well(
    columns: Mapping[str, Column],
) -> None:
    values = {"time_h": [0.0], "stw_kn": [12.0], "sog_kn": [12.0], "power_kW": [5000.0]}
    table = pd.DataFrame(values | {"COG [deg]": [24.0], "HDG [deg]": [20.0]})
    found = canonical(table, columns, "log", gaps=True)
    assert math.degrees(found["heading"][0]) == pytest.approx(20.0)
    assert "COG [deg]" in found.attrs["remarks"][-1]
    course = canonical(table.drop(columns="HDG [deg]"), columns, "log", gaps=True)
    assert math.degrees(course["heading"][0]) == pytest.approx(24.0)


GERMAN = (
    "Lauf;Beginn;Kurs;SOG;Wellenleistung;Rel. Windgeschw.;Rel. Windwinkel;Wassertiefe;Wellenrichtung\n"
    ";tt.mm.jjjj hh:mm:ss;°;kn;kW;m/s;°;m;°\n"
    "1;18.02.2026 09:30:10;40;11,159;1703,6;12,63;19,8;80;75\n"
    "2;18.02.2026 10:05:30;220;10,911;1657,9;4,35;263,1;80;75\n"
)


def test_german_names_are_read_by_their_words_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(GERMAN)
    found = read_runs(path)
    assert found["shaft_power"].tolist() == [1703.6e3, 1657.9e3]
    assert np.degrees(found["heading"]).tolist() == pytest.approx([40.0, 220.0])
    assert np.degrees(found["wind_angle"]).tolist() == pytest.approx([19.8, 263.1])
    assert found["wind_speed"].tolist() == [12.63, 4.35]
    assert found["depth"].tolist() == [80.0, 80.0]
    assert found["time"].tolist() == [0.0, 2120.0]
    assert found.attrs["remarks"] == [
        "read by the words of their names, check them: 'Kurs' as heading, 'Wellenleistung' as "
        "shaft_power, 'Rel. Windgeschw.' as wind_speed, 'Rel. Windwinkel' as wind_angle, 'Wassertiefe' "
        "as depth",
        "columns that are not understood or not used: Lauf, Wellenrichtung",
    ]


def test_a_name_is_read_by_its_words_only_with_a_unit_of_the_quantity(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(GERMAN.replace(";kW;", ";m;"))
    with pytest.raises(
        TableError, match=r"no column is read as shaft_power; name it shaft_power or"
    ):
        read_runs(path)
