"""The study of formulas: its cases, and what its page adds up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from reproductions.formulas.cases import NULLS, OUTSIDE, cases, make_recording, nominal_ship
from reproductions.formulas.page import body, split_nulls, summary_rows


def test_there_are_enough_cases_and_a_quarter_have_wrong_numbers() -> None:
    every = cases(7)
    truths = [case for case in every if case.truth is not None]
    assert len(truths) >= 20
    assert len(every) - len(truths) == sum(NULLS.values()) == 50
    assert len({case.seed for case in every}) == len({case.name for case in every}) == len(every)
    assert np.mean([case.wrong for case in truths]) == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize("case", [c for c in cases(7) if c.truth is not None], ids=lambda c: c.name)
def test_a_truth_changes_its_recording_and_hears_only_what_is_there(case: Any) -> None:
    ship = nominal_ship(case.rig)
    assert case.truth.external_signals == tuple(
        n for n in case.truth.external_signals if n in OUTSIDE[case.rig]
    )
    assert ship.with_term(case.truth).record() != ship.record()


def test_a_recording_holds_its_rig_s_signals_and_is_the_same_again() -> None:
    case = next(c for c in cases(7) if c.rig == "motor" and c.truth is None)
    found = make_recording(case)
    assert {*OUTSIDE["motor"], "motor_voltage_V", "shaft_speed_rad_s"} <= {*found}
    assert found.equals(make_recording(case))


def rows() -> pd.DataFrame:
    common = {"rig": "motor", "seconds": 2.0, "tried": 9, "threshold": 20.0, "coloured": "motor"}
    truth = common | {
        "case": "t1",
        "wrong_numbers": False,
        "truth": "drive: c * drive",
        "true_signals": ["drive"],
        "formula": "drive_torque: a * drive",
        "signals": ["drive"],
        "right_signals": True,
        "gain": 90.0,
        "possible": 100.0,
        "held_out": 9.0,
        "possible_held_out": 10.0,
        "rivals": [],
    }
    wrong = truth | {
        "case": "t2",
        "right_signals": False,
        "signals": ["shaft_speed"],
        "gain": 50.0,
        "formula": "drive_torque: a * shaft_speed",
        "rivals": ["drive_torque: a * abs(drive)"],
    }
    null = common | {
        "case": "n1",
        "wrong_numbers": True,
        "formula": "",
        "signals": [],
        "rivals": [],
        "gain": 0.0,
        "held_out": 0.0,
    }
    told = null | {"case": "n2", "formula": "drive_torque: a", "gain": 30.0, "coloured": ""}
    return pd.DataFrame([truth, wrong, null, told])


def test_figures_are_counted() -> None:
    found = {name: value for name, value, _ in summary_rows(*split_nulls(rows()))}
    assert found["right signals"] == "1 of 2 (50 %)"
    assert found["right signals, or in an indistinguishable formula"] == "2 of 2 (100 %)"
    assert found["gain at least 0.8 of the true form's"] == "1 of 2 (50 %)"
    assert found["median gain over the true form's"] == "0.70"
    assert found["null cases with a formula"] == "1 of 2 (50 %)"
    assert found["of these, with a residual above noise"] == "0 of 2 (0 %)"


def test_the_page_tells_nulls_with_a_formula_and_whole_diagnoses() -> None:
    told = {"acts_on": "drive_torque", "expression": "a * drive", "signals": ["drive"]}
    whole = pd.DataFrame(
        [
            {"case": "t1", "verdict": "unexplained", "named": [], "formula": told, "held_out": 8.0},
            {
                "case": "t2",
                "verdict": "explained",
                "named": ["x"],
                "formula": None,
                "held_out": 3.0,
            },
        ]
    )
    page = body(rows(), whole)
    assert "## Null cases with a formula" in page
    assert "1 of 1 has a formula, 1 with the right signals" in page
