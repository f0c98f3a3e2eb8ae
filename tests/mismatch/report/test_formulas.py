"""A formula of what has no name, as data, as text and on the page."""

from __future__ import annotations

import json
from typing import Any

from shaftline.mismatch import Estimate
from shaftline.mismatch.report.data import diagnosis_as_dict
from shaftline.mismatch.report.html import report_html
from shaftline.mismatch.report.text import summary
from shaftline.mismatch.report.wording import formula_as_dict, formula_lines, formula_sentence
from shaftline.mismatch.search.blocks import Block, Factor
from shaftline.mismatch.search.formulas import Formula
from shaftline.plant.terms import Term

from ..diagnoses import diagnosis_of

BETA = Factor("drift_angle")


def formula() -> Formula:
    expression = "(a + b * abs(drift_angle)) * drift_angle"
    numbers = {"a": {"value": -1200.0, "unit": "N/rad"}, "b": {"value": 50.0, "unit": "N/rad2"}}
    term: dict[str, Any] = {"id": "formula", "acts_on": "thrust", "expression": expression}
    bounds = (-1e12, 1e12)
    return Formula(
        "hull",
        Term.model_validate(term | {"parameters": numbers}),
        (Block.of(BETA), Block.of(BETA, Factor("drift_angle", "size"))),
        (
            Estimate("term.formula.a", -1200.0, "N/rad", bounds, 0.0, 100.0),
            Estimate("term.formula.b", 50.0, "N/rad2", bounds, 0.0, 1.0),
        ),
        120.0,
        40.0,
        33.0,
        ("thrust: a * drift_angle * ship_speed",),
    )


def test_a_formula_as_data() -> None:
    told = formula_as_dict(formula())
    assert told is not None
    assert json.loads(json.dumps(told)) == told
    assert (told["balance"], told["acts_on"]) == ("hull", "thrust")
    assert told["expression"] == "(a + b * abs(drift_angle)) * drift_angle"
    assert told["signals"] == ["drift_angle"]
    assert told["coefficients"]["a"] == {
        "value": -1200.0,
        "ci95": [-1396.0, -1004.0],
        "key": "term.formula.a",
        "se": 100.0,
        "unit": "N/rad",
    }
    assert told["evidence"] == {"score": 120.0, "threshold": 40.0, "held_out": 33.0}
    assert told["or_equally"] == ["thrust: a * drift_angle * ship_speed"]
    assert told["sentence"] == formula_sentence(formula())
    assert formula_as_dict(None) is None


def test_a_sentence_says_place_form_and_sizes() -> None:
    said = formula_sentence(formula())
    assert said.startswith("In the hull balance the thrust changes as (a + b |drift angle|) drift")
    assert "a = −1200 N/rad (95 % interval: −1400 to −1000)" in said
    assert said.endswith("b = 50.0 N/rad² (95 % interval: 48.0 to 52.0).")


def test_report_text_and_page_hold_it() -> None:
    diagnosis = diagnosis_of("unexplained", formula=formula())
    assert diagnosis_as_dict(diagnosis)["formula"] == formula_as_dict(formula())
    assert diagnosis_as_dict(diagnosis_of("unexplained"))["formula"] is None
    assert diagnosis_as_dict(diagnosis_of("explained"))["formula"] is None
    text = summary(diagnosis)
    assert "Formula\n" + "\n".join(formula_lines(formula())) in text
    assert "indistinguishable from thrust: a * drift_angle * ship_speed" in text
    page = report_html(diagnosis)
    assert "A formula for the residual" in page
    assert "thrust: (a + b * abs(drift_angle)) * drift_angle" in page
    assert "A formula for the residual" not in report_html(diagnosis_of("unexplained"))
    assert diagnosis.sentence.endswith(formula_sentence(formula()))
