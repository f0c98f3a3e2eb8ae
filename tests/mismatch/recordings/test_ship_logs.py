"""Logs of ships in service: header lines, missing values, navigation, wind, draught and fuel."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.core.tables import LayoutError, read_text_table
from shaftline.mismatch import load_recording
from shaftline.mismatch.identification.parameters import Start
from shaftline.mismatch.options import Options
from shaftline.mismatch.pipeline import candidates
from shaftline.mismatch.recordings.columns import Source, load_map
from shaftline.mismatch.recordings.course import (
    estimate_current,
    speeds_remark,
    turn_remark,
    turning_rows,
)
from shaftline.mismatch.recordings.draft import draft_column_map
from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.recordings.load import EXTRA_SIGNALS, load_parts
from shaftline.mismatch.recordings.remarks import remarks
from shaftline.mismatch.recordings.survey import survey
from shaftline.performance import monitoring
from shaftline.plant import RecordingError, Ship, load_ship
from shaftline.plant.columns import BOUNDS, COLUMNS, LOG_COLUMNS
from shaftline.plant.recording import read_table

KNOT = 1852.0 / 3600.0


def layout_of(path: Path, text: str) -> tuple[int, int | None, int]:
    path.write_text(text, encoding="utf-8")
    found = read_text_table(path).attrs["layout"]
    return found.header_row, found.unit_row, found.data_row


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("Zeit;n;P\ndd.mm.yyyy hh:mm:ss;1/min;kW\n01.02.2024 10:00:00;90,5;1000,5\n", (1, 2, 3)),
        ("Time;n;P\nTT.MM.JJJJ hh:mm:ss,fff;U/min;kNm\n01.02.2024 10:00:00;90,5;1,5\n", (1, 2, 3)),
        ("Time;n;P\n[s];[rpm];[kN m]\n0;90.5;1.5\n", (1, 2, 3)),
        ("Run 17;ship;\nrate;0,5 s;\nt;n;P\ns;rpm;MW\n0;90,5;1,5\n", (3, 4, 5)),
        ("Logger\nTime;Shaft;Power\ns;rpm;kW\nCh1;Ch2;Ch3\n0;90.5;1.5\n", (2, 3, 5)),
        ("Logger\nStart: 10:00\n\nTime;Shaft;Power\n0;90.5;1.5\n1;90.5;1.5\n", (4, None, 5)),
        ("one;two;three\nt;n;P\n0;90.5;1.5\n1;90.5;1.5\n", (2, None, 3)),
        ("t;n;P\n10:00:00;---;1.5\n10:00:01;90.5;1.5\n", (1, None, 2)),
    ],
)
def test_names_and_units_are_found_below_other_lines(
    tmp_path: Path, text: str, rows: tuple[int, int | None, int]
) -> None:
    assert layout_of(tmp_path / "r.csv", text) == rows


def test_a_file_without_names_points_to_header_row(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("0,90.5,1.5\n1,91.5,1.5\n2,91.5,1.5\n")
    with pytest.raises(LayoutError, match=r"numbers \(0, 90.5, 1.5\) where .* set header_row"):
        read_text_table(tmp_path / "r.csv")


def test_unknown_names_point_to_header_row(tmp_path: Path, frigate: Ship) -> None:
    (tmp_path / "r.csv").write_text("xx,yy,zz\n0,90.5,1.5\n1,91.5,1.5\n2,91.5,1.5\n")
    found = survey(tmp_path / "r.csv", frigate)
    assert "by the names in line 1; if the names are elsewhere, set header_row" in found.refused


def test_signs_of_a_missing_value(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(
        "t;a;b;c\n0;1,5;-999;-2000\n1;---;3,5;-999\n2;n.a.;4,5;4000\n3;;5,5;5000\n"
    )
    table = read_table(tmp_path / "r.csv")
    assert table["a"].isna().tolist() == [False, True, True, True]
    assert table["b"].isna().tolist() == [True, False, False, False]
    assert table["c"].tolist() == [-2000, -999, 4000, 5000]  # This -999 is within the range.
    assert table.attrs["remarks"] == ["'b': 1 values are -999 and count as missing"]


def test_the_sheet_with_the_most_numbers_is_read(tmp_path: Path) -> None:
    with pd.ExcelWriter(tmp_path / "r.xlsx", engine="openpyxl") as book:
        pd.DataFrame({"Project": ["trial"], "No": [1]}).to_excel(
            book, sheet_name="Info", index=False
        )
        log = pd.DataFrame({"t": [0.0, 1.0, 2.0], "n": [90.0, "---", 92.0]})
        log.to_excel(book, sheet_name="Data", index=False, startrow=2)
    table = read_table(tmp_path / "r.xlsx")
    assert table.attrs["layout"].sheet == "Data"
    assert table["n"].isna().tolist() == [False, True, False]
    assert list(read_table(tmp_path / "r.xlsx", {"sheet": "Info"})) == ["Project", "No"]


def test_repeated_names_are_numbered_unless_they_are_canonical(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("t,SOG,SOG\n0,1,2\n1,3,4\n")
    table = read_table(tmp_path / "r.csv")
    assert list(table) == ["t", "SOG", "SOG (2)"]
    assert "'SOG' occurs again; this one is called 'SOG (2)'" in table.attrs["remarks"][0]
    (tmp_path / "r.csv").write_text("t,heading_rad,heading_rad\n0,1,2\n1,3,4\n")
    with pytest.raises(RecordingError, match="'heading_rad' occurs twice"):
        read_table(tmp_path / "r.csv")


def test_columns_of_logs_have_units_and_the_names_of_performance() -> None:
    assert set(LOG_COLUMNS) <= set(COLUMNS)
    for quantity, column in {
        "speed_over_ground": "speed_over_ground_m_s",
        "wind_speed": "wind_speed_m_s",
        "wind_angle": "wind_angle_rad",
        "depth": "water_depth_m",
        "water_temperature": "water_temperature_C",
        "heading": "heading_rad",
        "rudder": "rudder_rad",
    }.items():
        suffix = {"degC": "C"}.get(BOUNDS[column][2], BOUNDS[column][2].replace("/", "_"))
        assert column.removesuffix(f"_{suffix}") in monitoring.COLUMNS[quantity].names


@pytest.mark.parametrize(
    ("keys", "value", "canonical"),
    [
        ({"column": "fuel_flow_kg_s", "unit": "l/h", "density_kg_m3": 900.0}, 4000.0, 1.0),
        ({"column": "fuel_flow_kg_s", "unit": "t/day"}, 86.4, 1.0),
        ({"column": "fuel_flow_kg_s", "unit": "kg/h", "density_kg_m3": 900.0}, 3600.0, 1.0),
        ({"column": "water_temperature_C", "unit": "degF"}, 50.0, 10.0),
        ({"column": "water_temperature_C", "unit": "K"}, 283.15, 10.0),
        ({"column": "wind_angle_rad", "unit": "°"}, 180.0, math.pi),
        ({"column": "speed_over_ground_m_s", "unit": "kn"}, 1.0, KNOT),
    ],
)
def test_units_of_logs(keys: dict[str, Any], value: float, canonical: float) -> None:
    found = Source(**keys).convert(pd.Series([value]))
    assert found.iloc[0] == pytest.approx(canonical, rel=1e-9)


@pytest.mark.parametrize(
    ("column", "unit", "way"),
    [
        ("fuel_flow_kg_s", "l/h", "volume flow; add density_kg_m3 = 850"),
        ("shaft_torque_N_m", "kW", "it is a power; map it as shaft_power_W"),
        ("ship_speed_m_s", "kN", "use knot, km/h or m/s, or map the column as thrust_N"),
        ("wind_speed_m_s", "bar", "use knot, km/h or m/s, or give a formula"),
        ("pitch_ratio", "mm", '"percent of range", or deg'),
    ],
)
def test_a_unit_of_another_kind_is_refused_with_the_way_out(
    column: str, unit: str, way: str
) -> None:
    with pytest.raises(ValueError, match=f"{unit}.*{column}") as refused:
        Source(column=column, unit=unit)
    assert way in str(refused.value)


def test_a_density_is_for_fuel_only() -> None:
    with pytest.raises(ValueError, match="density_kg_m3 applies to fuel_flow_kg_s"):
        Source(column="ship_speed_m_s", unit="m/s", density_kg_m3=850.0)


NAMES = {
    "UTC": ["10:00:00", "10:00:01"], "Fuel rack (mm)": 20.0, "CPP order (%)": 80.0,
    "CPP feedback (deg)": 27.0, "Shaft RPM": 100.0, "Power_kW": 2000.0, "STW (kn)": 12.0,
    "SOG (kn)": 12.5, "COG": 200.0, "HDG (deg)": 190.0, "AWS (kn)": 20.0, "AWA (deg)": 30.0,
    "TWS (m/s)": 8.0, "TWA (deg)": 50.0, "Anemometer height (m)": 30.0, "Draft fwd (m)": 4.0,
    "Draft aft (m)": 5.0, "Rudder angle (deg)": 1.0, "Water depth (m)": 50.0,
    "Sea temp (°C)": 15.0, "FO cons (l/h)": 900.0, "Wind direction true": 300.0,
}  # fmt: skip


def test_a_draft_knows_the_channels_of_a_ships_log(frigate: Ship) -> None:
    table = pd.DataFrame(NAMES, index=[0, 1])
    lines = list(draft_column_map(frigate, table, {}, set()))
    found = tomllib.loads("\n".join(lines))["columns"]
    assert {name: (keys["column"], keys["unit"]) for name, keys in found.items()} == {
        "UTC": ("time_s", "datetime"),
        "Fuel rack (mm)": ("fuel_rack_mm", "mm"),
        "CPP order (%)": ("pitch_ratio_command", "percent of range"),
        "CPP feedback (deg)": ("pitch_ratio", "deg"),
        "Shaft RPM": ("shaft_speed_rad_s", "rpm"),
        "Power_kW": ("shaft_power_W", "kW"),
        "STW (kn)": ("ship_speed_m_s", "kn"),
        "SOG (kn)": ("speed_over_ground_m_s", "kn"),
        "COG": ("course_over_ground_rad", "deg"),
        "HDG (deg)": ("heading_rad", "deg"),
        "AWS (kn)": ("wind_speed_m_s", "kn"),
        "AWA (deg)": ("wind_angle_rad", "deg"),
        "TWS (m/s)": ("true_wind_speed_m_s", "m/s"),
        "TWA (deg)": ("true_wind_angle_rad", "deg"),
        "Anemometer height (m)": ("wind_height_m", "m"),
        "Draft fwd (m)": ("draught_fore_m", "m"),
        "Draft aft (m)": ("draught_aft_m", "m"),
        "Rudder angle (deg)": ("rudder_rad", "deg"),
        "Water depth (m)": ("water_depth_m", "m"),
        "Sea temp (°C)": ("water_temperature_C", "°C"),
        "FO cons (l/h)": ("fuel_flow_kg_s", "l/h"),
    }
    assert found["FO cons (l/h)"]["density_kg_m3"] == 850.0
    assert next(x for x in lines if "Power_kW" in x).endswith("shaft of the model")


def test_a_draft_knows_german_names_of_the_wind(frigate: Ship) -> None:
    names = (
        "Rel. Windgeschw. [m/s]",
        "Rel. Windwinkel [°]",
        "Wassertiefe [m]",
        "Wahrer Windwinkel [°]",
    )
    table = pd.DataFrame(dict.fromkeys(names, 5.0), index=[0, 1])
    lines = "\n".join(draft_column_map(frigate, table, {}, set()))
    found = {name: keys["column"] for name, keys in tomllib.loads(lines)["columns"].items()}
    assert list(found) == [names[0], names[1], names[3], names[2]]
    assert [*found.values()] == [
        "wind_speed_m_s",
        "wind_angle_rad",
        "true_wind_angle_rad",
        "water_depth_m",
    ]
    for other in ("Windwinkel (deg)", "Windrichtung (deg)"):
        lines = "\n".join(draft_column_map(frigate, table[[]].assign(**{other: 5.0}), {}, set()))
        assert tomllib.loads(lines)["columns"][other]["column"] == "wind_angle_rad"


def test_a_draft_keeps_the_given_map(tmp_path: Path, calm: pd.DataFrame, frigate: Ship) -> None:
    table = calm.rename(columns={"pitch_ratio_command": "CPP order", "fuel_rack_mm": "Load"})
    text = "a,b,c\n1,2,3\n" + table.to_csv(index=False)
    (tmp_path / "r.csv").write_text(text)
    (tmp_path / "map.toml").write_text(
        '[file]\nheader_row = 3\n[columns]\nLoad = { column = "fuel_rack_mm", unit = "mm" }\n'
    )
    found = survey(tmp_path / "r.csv", frigate, tmp_path / "map.toml")
    assert found.recording is not None
    assert found.recording.measured_pitch  # in the place of the order, which the draft finds
    (tmp_path / "draft.toml").write_text("\n".join(found.begin))
    drafted = load_map(tmp_path / "draft.toml")
    assert drafted.file.header_row == 3
    assert {*drafted.columns} == {"Load", "CPP order"}
    recording = load_recording(tmp_path / "r.csv", frigate, tmp_path / "draft.toml")
    np.testing.assert_allclose(recording["pitch_ratio_command"], calm["pitch_ratio_command"])
    assert not recording.measured_pitch


def logged(calm: pd.DataFrame, **columns: Any) -> pd.DataFrame:
    return calm.assign(**columns)


def test_log_columns_are_kept_beside_the_channels(calm: pd.DataFrame, frigate: Ship) -> None:
    rows = len(calm)
    depth = np.full(rows, 40.0)
    depth[100:400] = np.nan
    depth[500] = 1e6
    course = np.tile([0.05, 2.0 * math.pi - 0.05], rows // 2)
    course[10:20] = np.nan
    table = logged(calm, water_depth_m=depth, course_over_ground_rad=course, draught_fore_m=1e3)
    found = load_recording(table, frigate)
    assert found.channels == load_recording(calm, frigate).channels
    assert found["water_depth_m"].tolist() == [40.0] * rows
    assert any(
        "water_depth_m: 301 of 1800 values are missing, 1 of them outside 0.5 to 12000 m" in said
        for said in found.warnings
    )
    # The gap in the course is bridged over north, and not over south.
    assert np.cos(found["course_over_ground_rad"]).min() > 0.99
    assert found["course_over_ground_rad"].min() >= 0.0
    assert "draught_fore_m" not in found
    assert any("draught_fore_m" in said and "left out" in said for said in found.warnings)


def test_wind_reaches_terms(calm: pd.DataFrame, frigate: Ship) -> None:
    table = logged(calm, wind_speed_m_s=10.0, wind_angle_rad=math.radians(-60.0))
    found = load_recording(table, frigate, signals=EXTRA_SIGNALS)
    np.testing.assert_allclose(found["head_wind"], 5.0)
    np.testing.assert_allclose(found["side_wind"], 10.0 * math.sin(math.radians(60.0)))
    assert found.signals["head_wind"] == "m/s"
    true = logged(
        calm, true_wind_speed_m_s=10.0, true_wind_angle_rad=math.pi, speed_over_ground_m_s=8.0
    )
    found = load_recording(true, frigate, signals=EXTRA_SIGNALS)
    np.testing.assert_allclose(found["head_wind"], -2.0)
    assert "head_wind" not in load_recording(calm, frigate, signals=EXTRA_SIGNALS)


def test_the_heading_of_a_ship_that_turns_becomes_continuous() -> None:
    ship = load_ship("frigate-turning")
    time = 0.5 * np.arange(400)
    heading = 6.0 + 0.005 * time
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": 20.0 + 4.0 * (time // 40 % 2),
            "pitch_ratio_command": 1.2,
            "shaft_speed_rad_s": 10.0 + 0.01 * np.sin(time),
            "heading_rad": heading % (2.0 * math.pi),
        }
    )
    np.testing.assert_allclose(load_parts(table, ship)[0]["heading_rad"], heading)


@pytest.mark.parametrize(
    ("name", "expected"), [("Fahrt durchs Wasser", True), ("STW", True), ("Fahrt", False)]
)
def test_a_speed_through_the_water_has_no_current(
    frigate: Ship, calm: pd.DataFrame, tmp_path: Path, name: str, expected: bool
) -> None:
    calm.rename(columns={"ship_speed_m_s": name}).to_csv(tmp_path / "log.csv", index=False)
    column_map = tmp_path / "map.toml"
    column_map.write_text(
        f'[columns]\n"{name}" = {{ column = "ship_speed_m_s" }}\n', encoding="utf-8"
    )
    together = load_jointly(frigate, [tmp_path / "log.csv"], columns=column_map)
    assert together.through_water is expected
    ids = {effect.id for effect in candidates(Start(frigate, frigate), together, Options())}
    assert ("current" in ids) is not expected


def test_speed_over_ground_stands_for_a_missing_speed_log(
    calm: pd.DataFrame, frigate: Ship, tmp_path: Path
) -> None:
    table = calm.rename(columns={"ship_speed_m_s": "speed_over_ground_m_s"})
    found = load_recording(table, frigate)
    np.testing.assert_allclose(found["ship_speed_m_s"], calm["ship_speed_m_s"])
    (said,) = (w for w in found.warnings if "speed over ground" in w)
    assert "several courses" not in said
    half = np.where(np.arange(len(calm)) < len(calm) / 2, 0.2, 0.2 + math.pi)
    found = load_recording(table.assign(heading_rad=half), frigate)
    assert any("on each of several courses" in w for w in found.warnings)
    # A column with such a name is recognised as well, and a speed log is not.
    for name, over_ground in (("GPS_SOG", True), ("Log", False)):
        calm.rename(columns={"ship_speed_m_s": name}).to_csv(tmp_path / "r.csv", index=False)
        (tmp_path / "map.toml").write_text(f'[columns]\n{name} = "ship_speed_m_s"\n')
        found = load_recording(tmp_path / "r.csv", frigate, tmp_path / "map.toml")
        assert found.over_ground is over_ground


@pytest.mark.parametrize("courses", [(10.0, 190.0), (10.0, 100.0), (10.0, 130.0, 250.0)])
def test_current_and_log_error_are_estimated_on_several_courses(courses: tuple[float, ...]) -> None:
    rng = np.random.default_rng(4)
    heading = np.radians(np.repeat(courses, 600))
    rows = len(heading)
    through = 8.0 + 0.5 * np.sin(0.01 * np.arange(rows))
    north, east = 0.6 * math.cos(math.radians(40.0)), 0.6 * math.sin(math.radians(40.0))
    over = np.array([through * np.cos(heading) + north, through * np.sin(heading) + east])
    columns = {
        "heading_rad": heading,
        "course_over_ground_rad": np.arctan2(over[1], over[0]),
        "speed_over_ground_m_s": np.hypot(*over) + 0.02 * rng.standard_normal(rows),
        "ship_speed_m_s": 1.04 * through + 0.02 * rng.standard_normal(rows),
    }
    time = np.arange(float(rows))
    found = estimate_current(time, columns)
    assert found is not None
    assert found.gain == pytest.approx(1.04, abs=0.004)
    assert found.along is (courses == (10.0, 190.0))
    if found.along:
        size = 0.6 * math.cos(math.radians(30.0))
        assert math.hypot(found.north, found.east) == pytest.approx(size, abs=0.02)
    else:
        assert (found.north, found.east) == pytest.approx((north, east), abs=0.03)
    assert "m/s towards" in speeds_remark(time, columns)
    # Two courses at right angles hardly distinguish the gain from the current.
    assert ("scale = 0.96" in speeds_remark(time, columns)) is (courses != (10.0, 100.0))


def test_one_course_shows_that_the_speeds_differ() -> None:
    columns = {
        "heading_rad": np.zeros(600),
        "speed_over_ground_m_s": np.full(600, 9.0),
        "ship_speed_m_s": np.full(600, 8.0),
    }
    assert estimate_current(np.arange(600.0), columns) is None
    said = speeds_remark(np.arange(600.0), columns)
    assert "by +1.00 m/s" in said
    assert "which one course cannot distinguish" in said


def test_equal_speeds_need_no_remark() -> None:
    columns = {
        "heading_rad": np.repeat([0.0, math.pi], 300),
        "speed_over_ground_m_s": np.full(600, 8.0),
        "ship_speed_m_s": np.full(600, 8.0),
    }
    assert speeds_remark(np.arange(600.0), columns) == ""


def test_turns_are_found_by_heading_rudder_or_rate() -> None:
    time = np.arange(0.0, 600.0)
    rng = np.random.default_rng(2)
    yawing = 0.03 * np.sin(2.0 * math.pi * time / 9.0) + 0.005 * rng.standard_normal(600)
    assert not turning_rows(time, {"heading_rad": yawing}).any()
    turn = np.clip(0.02 * (time - 300.0), 0.0, 1.0)
    by_heading = turning_rows(time, {"heading_rad": (6.0 + yawing + turn) % (2.0 * math.pi)})
    assert by_heading[300:350].all()
    assert not by_heading[:270].any()
    assert not by_heading[385:].any()
    by_rate = turning_rows(time, {"yaw_rate_rad_s": np.gradient(turn)})
    assert by_rate[305:345].all()
    assert by_rate.sum() < 110
    rudder = 0.05 * rng.standard_normal(600)
    rudder[200:240] += 0.3
    by_rudder = turning_rows(time, {"rudder_rad": rudder})
    assert by_rudder[205:235].all()
    assert by_rudder.sum() < 75


def test_a_recording_of_turns_alone_is_not_left_out() -> None:
    time = np.arange(0.0, 600.0)
    turning = turn_remark(time, {"heading_rad": 0.02 * time})
    assert "in 100.0% of the rows" in turning
    assert turning.endswith(
        "Use a ship file with [manoeuvring] and [rudder], or record a straight course"
    )
    partly = turn_remark(time, {"heading_rad": np.clip(0.02 * (time - 300.0), 0.0, 1.0)})
    assert partly.endswith("Set leave_out_turns = true under [rows] in the column map")


def test_turns_can_be_left_out(calm: pd.DataFrame, frigate: Ship, tmp_path: Path) -> None:
    turn = np.clip(0.06 * (calm["time_s"] - 80.0), 0.0, math.pi)
    turned = calm.assign(HDG=np.degrees(0.5 + turn))
    turned.to_csv(tmp_path / "r.csv", index=False)
    line = '[columns]\nHDG = { column = "heading_rad", unit = "deg" }\n'
    (tmp_path / "map.toml").write_text(line)
    (whole,) = load_parts(tmp_path / "r.csv", frigate, tmp_path / "map.toml")
    assert any("leave_out_turns = true under [rows]" in said for said in remarks(whole, frigate))
    (tmp_path / "map.toml").write_text("[rows]\nleave_out_turns = true\n" + line)
    parts = load_parts(tmp_path / "r.csv", frigate, tmp_path / "map.toml")
    assert len(parts) == 2
    assert any("in which the ship turns" in said for said in parts[0].warnings)
    assert parts[0].time_s[-1] < 80.0
    assert parts[1].time_s[0] > 80.0 + math.pi / 0.06
    assert not any("leave_out_turns" in said for part in parts for said in remarks(part, frigate))
    (tmp_path / "map.toml").write_text("[rows]\nleave_out_turns = true\n")
    with pytest.raises(RecordingError, match="leave_out_turns needs a column that shows a turn"):
        load_parts(tmp_path / "r.csv", frigate, tmp_path / "map.toml")
