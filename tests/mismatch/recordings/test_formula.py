"""Columns that a map works out from others."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch.recordings.columns import load_map
from shaftline.mismatch.recordings.survey import survey
from shaftline.plant import RecordingError

from .test_power import RIG, fast

LOG = Path("log.csv")


def mapped(tmp_path: Path, text: str, table: pd.DataFrame) -> pd.DataFrame:
    file = tmp_path / "map.toml"
    file.write_text(text)
    return load_map(file).apply(LOG, table)


def raw() -> pd.DataFrame:
    return pd.DataFrame(
        {
            "P": [0.5, 1.0, 2.0],
            "rpm": [60.0, 120.0, 240.0],
            "Wind [deg]": [0.0, 60.0, 90.0],
            "wind": [4.0, 4.0, 4.0],
            "i": [1.0, 2.0, np.nan],
        }
    )


def test_a_torque_is_power_over_speed(tmp_path: Path) -> None:
    """0.5 kW at 60 rpm are 500 / (2 pi) N m; ``unit`` is that of the result."""
    text = '[columns]\nshaft_torque_N_m = { formula = "P / (rpm * 0.104719755)", unit = "kN m" }'
    found = mapped(tmp_path, text, raw())
    np.testing.assert_allclose(
        found["shaft_torque_N_m"], 500.0 / (2.0 * math.pi) * np.ones(3), rtol=1e-8
    )
    assert {"P", "rpm"} <= set(found)


def test_canonical_columns_stand_in_canonical_units(tmp_path: Path) -> None:
    """Also those that the map gives, wherever their lines stand."""
    text = """[columns]
    shaft_torque_N_m = { formula = "shaft_power_W / shaft_speed_rad_s", sign = -1 }
    rpm = { column = "shaft_speed_rad_s", unit = "rpm" }
    P = { column = "shaft_power_W", unit = "kW" }
    """
    found = mapped(tmp_path, text, raw())
    np.testing.assert_allclose(found["shaft_torque_N_m"], -500.0 / (2.0 * math.pi))


def test_a_signal_and_names_with_blanks(tmp_path: Path) -> None:
    text = """[signals.head_wind]
    formula = "wind * cos(a * 0.017453292519943295)"
    names = { a = "Wind [deg]" }
    unit = "knot"
    """
    found = mapped(tmp_path, text, raw())
    np.testing.assert_allclose(
        found["head_wind"], np.array([4.0, 2.0, 0.0]) * 1852 / 3600, atol=1e-12
    )


def test_functions_tables_and_constants_are_those_of_terms(tmp_path: Path) -> None:
    text = (
        '[columns]\nthrust_N = { formula = "max(table(rpm, 0, 0, 120, 6), 4) - 2**3 + min(P, 1)" }'
    )
    found = mapped(tmp_path, text, raw())
    np.testing.assert_allclose(found["thrust_N"], [4.0 - 8.0 + 0.5, 6.0 - 8.0 + 1.0, -1.0])


def test_a_missing_value_stays_missing(tmp_path: Path) -> None:
    found = mapped(tmp_path, '[columns]\nthrust_N = { formula = "2 * i" }', raw())
    assert found["thrust_N"].isna().tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            '{ formula = "P / (rpm - 120)" }',
            r"log\.csv: 'thrust_N' as thrust_N: row 2: .* no finite value with P = 1, rpm = 120 "
            r"\(1 of 3 rows\): a division by 0.*max\(\.\.\., 0\.1\)",
        ),
        ('{ formula = "log(-P)" }', r"row 1: .*logarithm of a negative number"),
        (
            '{ formula = "power / rpm" }',
            r"uses 'power', which is no column \(found: P, rpm, .*names = \{ power = \"\.\.\.",
        ),
        ('{ formula = "p / rpm", names = { p = "Power" } }', r"uses 'Power', which is no column"),
        ('{ formula = "rpm *" }', r"map\.toml: columns\.thrust_N.*not a valid expression"),
        ('{ formula = "open(rpm)" }', r"function 'open' is unknown; known: abs, sign"),
        ('{ formula = "rpm.real" }', r"'rpm\.real' is not allowed in an expression"),
        ('{ formula = "2 + 3" }', r"uses no column"),
        ('{ formula = "rpm", names = { q = "P" } }', r"names\.q does not occur in 'rpm'"),
        ('{ column = "thrust_N", names = { q = "P" } }', r"names is allowed with formula only"),
        ('{ formula = "rpm", unit = "kg" }', r"unit 'kg' cannot be converted to N of thrust_N"),
        (
            '{ formula = "rpm", colour = 1 }',
            r"colour is not a known key \(allowed: .*formula, names",
        ),
    ],
)
def test_what_cannot_be_worked_out_is_refused(tmp_path: Path, line: str, words: str) -> None:
    with pytest.raises(RecordingError, match=words):
        mapped(tmp_path, f"[columns]\nthrust_N = {line}", raw())


def test_a_column_that_is_there_is_not_worked_out(tmp_path: Path) -> None:
    table = raw().assign(thrust_N=1.0)
    with pytest.raises(
        RecordingError, match="thrust_N is in the recording and also given by 'thrust_N'"
    ):
        mapped(tmp_path, '[columns]\nthrust_N = { formula = "rpm" }', table)


def test_a_survey_shows_formulas_and_what_they_use(tmp_path: Path) -> None:
    table = fast()
    table["volts"] = 15.0
    table["amps"] = table.pop("electric_power_W") / 15.0
    table.to_csv(tmp_path / "rig.csv", index=False)
    (tmp_path / "map.toml").write_text(
        '[columns]\nelectric_power_W = { formula = "volts * amps" }\n'
    )
    found = survey(tmp_path / "rig.csv", RIG, tmp_path / "map.toml")
    assert found.recording is not None
    assert {entry.name: entry.column for entry in found.entries} == {
        "time_s": "time_s",
        "shaft_speed_rad_s": "shaft_speed_rad_s",
        "volts": "in a formula",
        "amps": "in a formula",
        "= volts * amps": "electric_power_W",
    }
    assert not any(said.startswith("left out") for said in found.sentences())
