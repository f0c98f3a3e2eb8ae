"""Column maps: foreign names, units and signs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.columns import Source, load_map
from shaftline.plant import RecordingError

from .conftest import Load
from .trials import RPM, degrees


def test_foreign_names_units_and_signs_are_carried_over(load: Load, calm: pd.DataFrame) -> None:
    foreign = pd.DataFrame(
        {
            "Date": pd.Timestamp("2024-05-01T12:00:00Z")
            + pd.to_timedelta(calm["time_s"], unit="s"),
            "Index": calm["fuel_rack_mm"] / 0.4,
            "Pitch set": degrees(calm["pitch_ratio_command"]),
            "P/D": calm["pitch_ratio"],
            "N": -RPM * calm["shaft_speed_rad_s"],
            "Q": 1e-3 * calm["shaft_torque_N_m"] + 2.0,
            "STW": calm["ship_speed_m_s"] * 3600 / 1852,
        }
    )
    found = load(
        foreign,
        """[columns]
        Date = { column = "time_s", unit = "datetime" }
        Index = { column = "fuel_rack_mm", scale = 0.4 }
        "Pitch set" = { column = "pitch_ratio_command", unit = "deg" }
        "P/D" = "pitch_ratio"
        N = { column = "shaft_speed_rad_s", unit = "RPM", sign = -1 }
        Q = { column = "shaft_torque_N_m", unit = "kNm", offset = -2.0 }
        STW = { column = "ship_speed_m_s", unit = "kn" }
        """,
    )
    for column in calm:
        np.testing.assert_allclose(found[column], calm[column], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("columns = ", r"not valid TOML"),
        ("", r"the map is empty: \[columns\], \[signals\]"),
        ("[columns]", r"the map is empty: \[columns\], \[signals\]"),
        ("[columns]\nN = {}", r"columns\.N\.column is missing"),
        ("[columns]\nN = 3", r"columns\.N: "),
        ('[columns]\nN = "speed"', r"columns\.N\.column: 'speed' is not canonical \(allowed: time_s"),
        ('[columns]\nN = "guel_rack_mm"', r"'guel_rack_mm' is not canonical \(similar: fuel_rack_mm\)"),
        ('[columns]\nN = { column = "time_s", units = "s" }',
         r"columns\.N\.units is not a known key \(allowed: column, unit, sign, scale, offset, rad"),
        ('[columns]\nN = { column = "thrust_N", sign = 2 }', r"columns\.N\.sign: .* 1 or -1"),
        ('[columns]\nN = { column = "thrust_N", scale = 0 }',
         r"columns\.N\.scale: 0 would make every value 0"),
        ('[columns]\nN = { column = "thrust_N", scale = inf }', r"columns\.N\.scale: .*finite"),
        ('[columns]\nN = { column = "thrust_N", unit = "kp m" }', r"columns\.N: unit 'kp m' is not"),
        ('[columns]\nN = { column = "thrust_N", unit = "kg" }', r"'kg' cannot be converted to N"),
        ('[columns]\nN = { column = "shaft_speed_rad_s", unit = "Hz" }', r"is ambiguous for an angle"),
        ('[columns]\nN = { column = "shaft_angle_rad", unit = "percent" }',
         r"is ambiguous for an angle"),
        ('[columns]\nN = { column = "shaft_angle_rad", unit = "m" }', r"'m' cannot be converted to rad"),
        ('[columns]\nN = { column = "shaft_angle_rad", unit = "rad", radius_m = 1.0 }',
         r"'rad' cannot be converted to m"),
        ('[columns]\nN = { column = "thrust_N", radius_m = 1.0 }',
         r"radius_m applies to torques, angles"),
        ('[columns]\nN = { column = "shaft_angle_rad", radius_m = 0.0 }', r"radius_m: .*greater than 0"),
        ('[columns]\nN = { column = "thrust_N", unit = "datetime" }', r"is allowed for time_s only"),
        ('[columns]\nN = "thrust_N"\nM = "thrust_N"', r"thrust_N is given by more than one"),
        ("[column]\nN = 1", r"column is not a known key \(allowed: columns, signals, file, rows\)"),
    ],
)  # fmt: skip
def test_bad_map_is_named(load: Load, calm: pd.DataFrame, text: str, words: str) -> None:
    with pytest.raises(RecordingError, match=rf"map\.toml: .*{words}"):
        load(calm, text or "\n")


def test_a_linear_axis_is_a_shaft_by_its_radius() -> None:
    """Force times radius is torque, way and speed over radius are angle and speed of rotation."""
    values = pd.Series([1.0, -2.0])
    for column, unit, expected in (
        ("motor_torque_N_m", "kN", 250.0),
        ("motor_torque_N_m", None, 0.25),
        ("shaft_angle_rad", "mm", 0.004),
        ("shaft_angle_rad", None, 4.0),
        ("shaft_speed_rad_s", "m/s", 4.0),
    ):
        source = Source(column=column, unit=unit, radius_m=0.25)
        assert list(source.convert(values)) == pytest.approx([expected, -2.0 * expected])
    turned = Source(column="shaft_angle_rad", unit="turn", sign=-1, offset=0.5)
    assert list(turned.convert(values)) == pytest.approx([-3.0 * math.pi, 3.0 * math.pi])


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('Thrust = "thrust_N"', r"column 'Thrust' of the column map is missing; found: time_s"),
        ('extra = "pitch_ratio"', r"pitch_ratio is in the recording and also given by 'extra'"),
        ('time_s = { column = "time_s", unit = "datetime" }', r"'time_s' as time_s"),
    ],
)
def test_map_that_does_not_fit_is_named(
    load: Load, calm: pd.DataFrame, line: str, words: str
) -> None:
    table = calm.assign(extra=1.0).astype({"time_s": str}).assign(time_s="tomorrow or so")
    with pytest.raises(RecordingError, match=rf"r\.csv: {words}"):
        load(table, f"[columns]\n{line}")


def test_signals_are_carried_over_to_si(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text(
        '[signals]\n"Beta" = { signal = "drift_angle", unit = "deg", sign = -1 }\n'
        '"Wind" = { signal = "head_wind", unit = "knot", offset = 1.0 }\n"Days" = "days_in_water"\n'
    )
    given = load_map(path)
    table = pd.DataFrame({"Beta": [10.0, -5.0], "Wind": [9.0, 19.0], "Days": ["3", "x"]})
    found = given.apply(path, table)
    np.testing.assert_allclose(found["drift_angle"], np.deg2rad([-10.0, 5.0]))
    np.testing.assert_allclose(found["head_wind"], np.array([10.0, 20.0]) * 1852.0 / 3600.0)
    assert found["days_in_water"][0] == 3.0
    assert np.isnan(found["days_in_water"][1])  # the recording's own checks name the row
    units = {source.signal: source.unit_in_expressions for source in given.signals.values()}
    assert units == {"drift_angle": "rad", "head_wind": "m/s", "days_in_water": "-"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[signals]\nA = "drive"', "'drive' is a reserved name"),
        ('[signals]\nA = "time_s"', "'time_s' is a reserved name"),
        ('[signals]\nA = "Wind"', "signals.A.signal"),
        ('[signals]\nA = { signal = "wind", unit = "beaufort" }', "'beaufort' is not understood"),
        ('[signals]\nA = "wind"\nB = "wind"', "wind is given by more than one"),
        ('[columns]\nA = "thrust_N"\n[signals]\nA = "wind"', "'A' is in \\[columns\\] and in"),
        ('[signals]\nA = { signal = "wind", column = "x" }', "allowed: signal, unit"),
    ],
)
def test_a_bad_signal_is_named(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text)
    with pytest.raises(RecordingError, match=words):
        load_map(path)
