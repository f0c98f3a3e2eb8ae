"""What stands in report.json."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from shaftline.mismatch.report.data import diagnosis_as_dict, merge_windows, replace_non_finite

from ..diagnoses import ROWS, candidate, diagnosis_of, entry


def test_a_finding_has_its_place_numbers_and_evidence() -> None:
    diagnosis = diagnosis_of("explained", warnings=["w"], limits=["l"])
    report = diagnosis_as_dict(diagnosis)
    effect = entry("coulomb-friction (engine)")
    (found,) = report["effects"]
    (estimate,) = diagnosis.findings[0].estimates
    assert found == {
        "id": "coulomb-friction",
        "balance": "engine",
        "form": "",
        "unmeasured": "",
        "implausible": "",
        "equivalent_ids": ["viscous-friction"],
        "equation": effect.equation,
        "sentence": diagnosis.sentence,
        "parameters": {
            "coulomb_friction_engine_side_N_m": {
                "value": 8000.0,
                "ci95": list(estimate.ci95),
                "key": "transmission.coulomb_friction_engine_side_N_m",
                "se": estimate.standard_error,
            }
        },
        "evidence": {
            "score": 347.0,
            "threshold": 10.5,
            "p_value": diagnosis.findings[0].p_value,
        },
        "windows_s": [[60.0, 120.0]],
        "split_by": effect.split_by,
        "wrong_number": None,
    }
    assert report["location"] == {
        "balances": ["engine"],
        "windows_s": [[60.0, 120.0]],
        "regime": "shaft_speed above 11 rad/s",
    }
    assert (report["verdict"], report["ship"]) == ("explained", "frigate")
    assert report["recording"] == {
        "rows": ROWS,
        "seconds": pytest.approx(239.8),
        "held_out": [[180.0, 240.0]],
    }
    held = report["fit"]["held_out"]
    assert held["before"] == {"pitch_ratio": 84.5, "shaft_speed_rad_s": 84.5}
    assert held["after"] == {"pitch_ratio": 99.4, "shaft_speed_rad_s": 99.4}
    assert (held["gain_2logL"], report["explained_power"]) == (285.0, 0.98)
    assert report["detectable"] == [
        {
            "id": "coulomb-friction",
            "balance": "engine",
            "parameter": "coulomb_friction_engine_side_N_m",
            "smallest": 324.0,
        }
    ]
    assert (report["limits"], report["warnings"]) == (["l"], ["w"])
    assert "unexplained" not in report
    json.dumps(report, allow_nan=False)


def test_rivals_of_the_same_id_are_no_other_name() -> None:
    found = diagnosis_of("explained")
    rivals = (
        "coulomb-friction (propeller)",
        "viscous-friction (engine)",
        "viscous-friction (propeller)",
    )
    finding = replace(found.findings[0], rivals=tuple(candidate(r, 9.0, 1.0) for r in rivals))
    (told,) = diagnosis_as_dict(replace(found, findings=[finding]))["effects"]
    assert told["equivalent_ids"] == ["viscous-friction"]


def test_places_of_several_findings_are_joined() -> None:
    found = diagnosis_of("explained")
    first = found.findings[0]
    other = replace(first, effect=entry("hull-fouling (hull)"), windows=[(100.0, 150.0)], regime="")
    third = replace(first, regime="drive above 20 mm", windows=[(10.0, 20.0)])
    location = diagnosis_as_dict(replace(found, findings=[first, other, third]))["location"]
    assert location == {
        "balances": ["engine", "hull"],
        "windows_s": [[10.0, 20.0], [60.0, 150.0]],
        "regime": "shaft_speed above 11 rad/s; drive above 20 mm",
    }


def test_what_has_no_name_has_place_and_curve() -> None:
    report = diagnosis_as_dict(diagnosis_of("unexplained", shape_regime="r"))
    assert report["location"] == {
        "balances": ["engine"],
        "windows_s": [[20.0, 50.0]],
        "regime": "r",
    }
    assert report["unexplained"] == {
        "balance": "engine",
        "signal": "shaft_speed",
        "signal_unit": "rad/s",
        "knots": [9.0, 10.0, 11.0],
        "values": [0.0, -12000.0, 500.0],
        "unit": "N m",
        "evidence": {"score": 300.0, "threshold": 40.0},
    }
    assert report["effects"] == []
    everywhere = diagnosis_as_dict(diagnosis_of("unexplained", shape_windows=[]))
    assert everywhere["location"]["windows_s"] == [[0.0, pytest.approx(239.8)]]
    shape = replace(diagnosis_of("unexplained").shape, balance="thrust")  # type: ignore[type-var]
    assert diagnosis_as_dict(diagnosis_of("unexplained", shape=shape))["location"]["balances"] == [
        "propeller"
    ]


def test_where_nothing_is_missing_there_is_no_place() -> None:
    report = diagnosis_as_dict(diagnosis_of("nothing-missing"))
    assert report["location"] == {"balances": [], "windows_s": [], "regime": ""}


def test_windows_that_touch_are_one() -> None:
    assert merge_windows([(5.0, 9.0), (1.0, 5.0), (9.1, 10.0), (2.0, 3.0)]) == [
        [1.0, 9.0],
        [9.1, 10.0],
    ]
    assert merge_windows([]) == []


def test_a_number_that_is_not_finite_is_null() -> None:
    assert replace_non_finite({"a": [1.0, -math.inf], "b": (math.nan, "x", 3)}) == {
        "a": [1.0, None],
        "b": [None, "x", 3],
    }
    found = diagnosis_of("explained")
    wild = replace(found.findings[0].estimates[0], standard_error=math.inf)
    (told,) = diagnosis_as_dict(
        replace(found, findings=[replace(found.findings[0], estimates=(wild,))])
    )["effects"]
    assert told["parameters"]["coulomb_friction_engine_side_N_m"]["ci95"] == [None, None]
