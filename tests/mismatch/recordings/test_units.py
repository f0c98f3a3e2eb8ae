"""Units by name: what a log may say, and what pint would work on for ever."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from shaftline.mismatch.recordings.columns import LONGEST_UNIT, load_map, parse_unit
from shaftline.mismatch.recordings.load import load_recording
from shaftline.plant import load_ship


@pytest.mark.parametrize(
    "name",
    ["m", "kN m", "m/s**2", "m/s^2", "kg m^2/s^2", "m³/h", "m s⁻¹", "m**-1", "s**(-2)", "m**0.5", "°",
     "%", "rpm", "knot", "deg/s"],
)  # fmt: skip
def test_a_unit_of_a_log_is_understood(name: str) -> None:
    assert parse_unit(name) is not None


@pytest.mark.parametrize(
    "name",
    [
        "m**9**9**9**9",
        "m**9**9**9**9/s",
        "m^9^9^9^9",
        "9**9**9**9 m",
        "m**(9**9**9**9)",
        "((((9**9)**9)**9)**9)**9",
        "m⁹**9**9**9",
        "9⁹⁹⁹⁹⁹⁹⁹",
        "m**99999999",
        "(m)**9**9**9**9",
        "m ** 9 ** 9 ** 9 ** 9",
        "m**9.9999999",
    ],
)
def test_a_tower_of_powers_is_refused_at_once(name: str) -> None:
    begun = time.monotonic()
    with pytest.raises(ValueError, match="an exponent is one number from -9 to 9"):
        parse_unit(name)
    assert time.monotonic() - begun < 5.0


def test_one_without_an_end_is_refused() -> None:
    parse_unit("m" + " s" * (LONGEST_UNIT // 2 - 1))
    with pytest.raises(ValueError, match=f"has 100000 characters; at most {LONGEST_UNIT}"):
        parse_unit("m" * 100_000)


def test_a_tower_in_a_column_map_is_refused_for_its_exponent(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    path.write_text(
        '[columns]\n"t" = { column = "time_s", unit = "m**9**9**9**9/s" }\n', encoding="utf-8"
    )
    with pytest.raises(ValueError, match=r"columns\.t.*an exponent is one number"):
        load_map(path)


def test_a_tower_in_the_unit_row_of_a_recording_is_refused_for_its_exponent(tmp_path: Path) -> None:
    path, columns = tmp_path / "log.csv", tmp_path / "map.toml"
    rows = "".join(f"{0.1 * k:.1f};20;1.2;9.8\n" for k in range(60))
    path.write_text(f"t;x;p;n\ns;mm;-;9**9**9**9\n{rows}", encoding="utf-8")
    columns.write_text(
        '[columns]\nt = "time_s"\nx = "fuel_rack_mm"\np = "pitch_ratio_command"\n'
        'n = "shaft_speed_rad_s"\n',
        encoding="utf-8",
    )
    with pytest.raises(ValueError, match="an exponent is one number"):
        load_recording(path, load_ship("frigate"), columns)
