"""What a correction changes in the ship's file."""

from __future__ import annotations

import re

from shaftline.mismatch.report.html import changed_keys

from ..diagnoses import FRICTION, diagnosis_of


def told(verdict: str, **changes: object) -> list[tuple[str, str, str]]:
    return [
        (re.sub("<wbr>", "", key), old, new)
        for key, old, new in changed_keys(diagnosis_of(verdict, **changes))
    ]


def test_keys_that_differ_are_told_with_their_units() -> None:
    assert told("explained") == [(FRICTION, "0 N m", "8000.0 N m")]
    assert told("nothing-missing") == []


def test_a_term_is_told_in_a_line_and_its_numbers_with_their_units() -> None:
    curve = "table(shaft_speed, 9, 0, 10, -12000, 11, 500)"
    assert told("unexplained") == [("term.unnamed-engine", "absent", f"drive_torque: {curve}")]
    drag = {
        "id": "drag",
        "acts_on": "load_torque",
        "expression": "k * z",
        "state": "z",
        "rate": "shaft_speed - z",
        "parameters": {"k": {"value": 3.0, "unit": "N m s/rad"}},
    }
    ship = diagnosis_of("explained").ship.with_values({"term": [drag]})
    assert told("explained", corrected=ship) == [
        ("term.drag", "absent", "load_torque: k * z; rate: shaft_speed - z"),
        ("term.drag.k", "absent", "3.0000 N m s/rad"),
    ]


def test_what_is_no_number_is_told_as_it_is() -> None:
    ship = diagnosis_of("explained").ship
    bench = ship.with_values({"propeller.blades": 4, "description": "x"})
    assert ("description", ship.description, "x") in told("explained", corrected=bench)
    assert ("propeller.blades", "5.0000", "4.0000") in told("explained", corrected=bench)
