"""What a correction changes in the ship's file."""

from __future__ import annotations

import re

from shaftline.mismatch.report.changes import changed_keys

from ..diagnoses import FRICTION, diagnosis_of


def told(verdict: str, **changes: object) -> list[tuple[str, str, str]]:
    return [
        (re.sub("<wbr>", "", key), old, new)
        for key, old, new in changed_keys(diagnosis_of(verdict, **changes))
    ]


def test_keys_that_differ_are_told_with_their_units() -> None:
    assert told("explained") == [(FRICTION, "0 N m", "8000.0 N m")]
    assert told("nothing-missing") == []


def test_a_curve_is_told_knot_by_knot() -> None:
    assert told("unexplained") == [
        ("unexplained.balance", "absent", "engine"),
        ("unexplained.signal", "absent", "shaft_speed"),
        ("unexplained.knots", "absent", "9.0000, 10.000, 11.000"),
        ("unexplained.values", "absent", "0, −12 000, 500.00"),
    ]


def test_what_is_no_number_is_told_as_it_is() -> None:
    ship = diagnosis_of("explained").ship
    bench = ship.with_values({"propeller.blades": 4, "description": "x"})
    assert ("description", ship.description, "x") in told("explained", corrected=bench)
    assert ("propeller.blades", "5.0000", "4.0000") in told("explained", corrected=bench)
