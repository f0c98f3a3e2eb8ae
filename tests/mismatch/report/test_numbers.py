"""Parameters of the ship in the reports."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from shaftline.mismatch import Diagnosis
from shaftline.mismatch.identification.parameters import BiasedParameter, ParameterChange
from shaftline.mismatch.report.html import report_html
from shaftline.mismatch.report.wording import source_words

from ..diagnoses import diagnosis_of

RESISTANCE, INERTIA = (
    "hull.resistance_coefficient_N_s2_m2",
    "transmission.inertia_engine_side_kg_m2",
)
NUMBERS = [
    ParameterChange(RESISTANCE, "N s2/m2", 3306.2, 3471.5, 6.125, -0.75, "calibrated", 3472.5),
    ParameterChange(INERTIA, "kg m2", 53697.0, 48000.0, math.nan, 3.0, "free", 53697.0),
]
WRONG = BiasedParameter("prime_mover.torque_offset_N_m", -7381.0, -6321.5, "N m", 345.0)


def told(**more: Any) -> Diagnosis:
    return diagnosis_of("explained", parameters=NUMBERS, biased=[WRONG], **more)


def test_they_stand_in_the_data() -> None:
    report = told().to_dict()
    assert report["numbers"] == {
        RESISTANCE: {
            "file": 3306.2,
            "value": 3471.5,
            "se": 6.125,
            "moved": -0.75,
            "source": "calibrated",
            "corrected": 3472.5,
        },
        INERTIA: {
            "file": 53697.0,
            "value": 48000.0,
            "se": None,
            "moved": 3.0,
            "source": "free",
            "corrected": 53697.0,
        },
    }
    assert report["effects"][0]["wrong_number"] == {
        "key": "prime_mover.torque_offset_N_m",
        "file": -7381.0,
        "value": -6321.5,
        "gain": 345.0,
    }
    json.dumps(report, allow_nan=False)
    assert diagnosis_of("nothing-missing").to_dict()["numbers"] == {}


def test_they_stand_in_the_text() -> None:
    said = told().summary()
    row = next(line for line in said.splitlines() if line.startswith(RESISTANCE))
    assert row.split()[1:4] == ["3306.2", "3471.5", "6.1"]
    assert "-0.8" in row
    assert "estimated from the reference period" in row
    assert (
        "coulomb-friction (engine): A biased prime_mover.torque_offset_N_m would explain the difference "
        "as well: −6322 N m in place of −7381 N m in the ship file."
    ) in said
    assert "Parameters of the ship" not in diagnosis_of("explained").summary()
    assert "biased" not in diagnosis_of("explained").summary()


def test_they_stand_on_the_page() -> None:
    page = report_html(told())
    assert "<h2>Parameters of the ship</h2>" in page
    assert "estimated from the reference period" in page
    assert "A biased prime_mover.torque_offset_N_m would explain the difference as well" in page
    assert "<h2>Parameters of the ship</h2>" not in report_html(diagnosis_of("explained"))


def test_numbers_that_explain_are_the_answer() -> None:
    right = ParameterChange(RESISTANCE, "N s2/m2", 3306.2, 3967.0, 6.0, 0.67, "free", 3967.0)
    found = diagnosis_of("nothing-missing", parameters=[right, NUMBERS[1]])
    assert found.sentence.startswith(
        "No physics is missing once the parameters are corrected: hull."
    )
    assert f"{RESISTANCE} is 3967 N s²/m² in place of 3306 N s²/m². The" in found.sentence
    assert INERTIA not in found.sentence  # the corrected ship has it as the file has
    plain = diagnosis_of("nothing-missing", parameters=NUMBERS)
    assert plain.sentence.startswith("No physics is missing: ")


SHIFTS = [
    (0.0, "inside its tolerance"),
    (1.9, "inside its tolerance"),
    (2.1, "2.1 times its tolerance"),
    (5.5, "5.5 times its tolerance"),
    (10.7, "10.7 times its tolerance"),
]


def shifted(shifts: float) -> ParameterChange:
    return ParameterChange(RESISTANCE, "N", 1.0, 2.0, 0.1, shifts, "tolerance", 1.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("shifts", "words"), SHIFTS)
def test_a_number_is_inside_its_tolerance_only_if_it_is(
    shifts: float, words: str, sign: float
) -> None:
    moved = shifted(sign * shifts)
    assert source_words(moved) == words
    assert words in diagnosis_of("explained", parameters=[moved]).summary()


def test_how_far_each_number_is_from_its_tolerance_stands_on_the_page() -> None:
    moved = [shifted(sign * shifts) for shifts, _ in SHIFTS for sign in (-1.0, 1.0)]
    page = report_html(diagnosis_of("explained", parameters=moved))
    assert [page.count(f">{words}<") for _, words in SHIFTS] == [4, 4, 2, 2, 2]
