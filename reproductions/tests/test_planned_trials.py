"""Planned trials: the second recording has the concealed effect, and the outcomes are counted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reproductions.planned_trials import cells_of, outcome_of, second_recording, summarise
from shaftline.validation.cases import case_kind, draw_case
from shaftline.validation.simulator.effects import CONFOUNDED


def test_cells_are_confounded_cases_with_each_effect_in_turn() -> None:
    cells = cells_of(6301, len(CONFOUNDED) + 1)
    assert [cell.key for cell in cells] == [*CONFOUNDED, CONFOUNDED[0]]
    assert all(case_kind(cell.seed, cell.number)[0] == "confounded" for cell in cells)
    assert len({cell.number for cell in cells}) == len(cells)


def test_the_second_recording_follows_the_programme_with_the_concealed_effect() -> None:
    index = cells_of(6301, 1)[0].number
    case = draw_case(6301, index, keys=("torque-sensor-gain/sensor",))
    seconds = np.arange(120.0)
    table = pd.DataFrame(
        {
            "time_s": seconds,
            "fuel_rack_mm": np.where(seconds < 60.0, 20.0, 24.0),
            "pitch_ratio_command": 1.2,
        }
    )
    plain = second_recording(case, {"torque-sensor-gain/sensor": 0.0}, table)
    found = second_recording(case, {"torque-sensor-gain/sensor": 0.05}, table)
    rows = round(1.0 / case.period)
    np.testing.assert_allclose(found["fuel_rack_mm"][::rows], table["fuel_rack_mm"], atol=1e-9)
    ratio = found["shaft_torque_N_m"].mean() / plain["shaft_torque_N_m"].mean()
    assert ratio == pytest.approx(1.0 + case.effects[0].sign * 0.05, abs=0.01)
    np.testing.assert_allclose(found["ship_speed_m_s"], plain["ship_speed_m_s"], atol=0.02)


def diagnosis(named: list[str], others: list[str]) -> Any:
    findings = [SimpleNamespace(effect=SimpleNamespace(id=name)) for name in named]
    return SimpleNamespace(findings=findings, alternatives=dict.fromkeys(others))


@pytest.mark.parametrize(
    ("named", "others", "outcome"),
    [
        (["a"], [], "right"),
        (["a"], ["b (hull)"], "among alternatives"),
        (["b"], ["a (hull)"], "among alternatives"),
        (["a", "b"], [], "among alternatives"),
        (["b"], [], "wrong"),
        ([], ["b (hull)"], "not named"),
    ],
)
def test_an_outcome_is_right_for_the_concealed_effect_alone(
    named: list[str], others: list[str], outcome: str
) -> None:
    assert outcome_of(diagnosis(named, others), "a") == outcome


def test_cases_without_alternatives_do_not_count() -> None:
    one = {
        "alternatives": 2,
        "planned": "right",
        "random": "wrong",
        "planned_minutes": 3.0,
        "random_minutes": None,
    }
    table = summarise([one, one, {"alternatives": 0}]).set_index("programme")
    assert table["cases"].tolist() == [2, 2]
    assert table["right alone"].tolist() == [2, 0]
    assert table["a wrong name"].tolist() == [0, 2]
    assert table.loc["planned", "expected minutes, median"] == 3.0
    assert np.isinf(table.loc["random", "expected minutes, median"])
