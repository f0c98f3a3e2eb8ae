"""A column map to begin with: by names, by units that say it alone, by stamps; the rest is left open."""

from __future__ import annotations

import tomllib
from typing import Any

import pandas as pd
import pytest

from shaftline.mismatch.recordings.draft import draft_column_map
from shaftline.plant import load_ship

BENCH = {"Kanal 0": "", "Kanal 1": "V", "Kanal 2": "1/min", "Kanal 3": "N", "Kanal 4": "Nmm"}


def guessed(ship: str, units: dict[str, str], **cells: Any) -> tuple[dict[str, Any], list[str]]:
    table = pd.DataFrame({name: cells.get(name, [1.0, 2.0]) for name in units})
    lines = list(draft_column_map(load_ship(ship), table, units, set()))[1:]
    read: dict[str, Any] = tomllib.loads("\n".join(lines))
    return read["columns"], [line for line in lines if line.startswith("#")]


def test_names_that_say_nothing_are_found_by_their_units() -> None:
    columns, open_ones = guessed("rov-thruster", BENCH, **{"Kanal 0": ["23:59:59,9", "00:00:00,1"]})
    assert columns == {
        "Kanal 0": {"column": "time_s", "unit": "datetime"},
        "Kanal 1": {"column": "motor_voltage_V", "unit": "V"},
        "Kanal 2": {"column": "shaft_speed_rad_s", "unit": "rpm"},
        "Kanal 3": {"column": "thrust_N", "unit": "N"},
        "Kanal 4": {"column": "shaft_torque_N_m", "unit": "Nmm"},
    }
    assert open_ones == []


def test_what_may_be_two_things_is_left_to_be_filled_in() -> None:
    columns, open_ones = guessed("rov-thruster", BENCH | {"Kraft 2": "kN"})
    assert "Kanal 3" not in columns
    assert [line for line in open_ones if "Kanal 3" in line or "Kraft 2" in line] == [
        '# "Kanal 3" = { column = "?", unit = "N" }',
        '# "Kraft 2" = { column = "?", unit = "kN" }',
    ]
    assert "thrust_N [N]" in open_ones[0]


@pytest.mark.parametrize(
    ("ship", "name", "column", "unit"),
    [
        ("kvlcc2", "t [s]", "time_s", "s"),
        ("kvlcc2", "n_prop [rps]", "shaft_speed_rad_s", "rps"),
        ("frigate", "Vs (kn)", "ship_speed_m_s", "kn"),
    ],
)
def test_a_unit_may_stand_behind_the_name(ship: str, name: str, column: str, unit: str) -> None:
    columns, _ = guessed(ship, {name: "", "r [rad/s]": ""})
    assert columns[name] == {"column": column, "unit": unit}
