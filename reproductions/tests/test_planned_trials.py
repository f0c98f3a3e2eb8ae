"""Planned trials: the second recording has the concealed effect, and the outcomes are counted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reproductions.planned_trials import (
    EVERY,
    LIMITS,
    NOTHING,
    STOPS,
    advised_programme,
    cells_of,
    discordant,
    outcome_of,
    second_recording,
    sooner,
    summarise,
    undecided,
)
from shaftline.validation.cases import case_kind, draw_case
from shaftline.validation.simulator.effects import CONFOUNDED
from shaftline.validation.simulator.voyage import StalledError


def test_cells_are_confounded_cases_with_each_effect_in_turn_and_nothing() -> None:
    cells = cells_of(6301, len(CONFOUNDED) + 3)
    assert [cell.key for cell in cells if cell.key != NOTHING] == [*CONFOUNDED, CONFOUNDED[0]]
    assert [k for k, cell in enumerate(cells) if cell.key == NOTHING] == [EVERY - 1, 2 * EVERY - 1]
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


def test_a_programme_at_which_the_true_engine_stops_has_no_recording() -> None:
    """At least rack and largest pitch, with 400 kN m of Coulomb friction in the engine."""
    index = cells_of(6301, 1)[0].number
    case = draw_case(6301, index, keys=("coulomb-friction/engine",))
    columns = {"fuel_rack_mm": 14.0, "pitch_ratio_command": 1.35}
    table = pd.DataFrame({"time_s": np.arange(60.0)}).assign(**columns)
    with pytest.raises(StalledError, match="the engine stops at the first demands"):
        second_recording(case, {"coulomb-friction/engine": 4e5}, table)


def diagnosis(named: list[str], others: list[str], verdict: str = "explained") -> Any:
    findings = [SimpleNamespace(effect=SimpleNamespace(id=name, label=name)) for name in named]
    return SimpleNamespace(findings=findings, alternatives=dict.fromkeys(others), verdict=verdict)


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


def test_nothing_is_right_only_if_the_verdict_says_so() -> None:
    assert outcome_of(diagnosis([], [], "nothing-missing"), NOTHING) == "right"
    assert outcome_of(diagnosis([], [], "unexplained"), NOTHING) == "not named"
    assert outcome_of(diagnosis(["a"], []), NOTHING) == "wrong"


def test_the_catalogue_advises_by_the_first_effect() -> None:
    """Two shaft speeds at the largest pitch for Coulomb friction; two staircases without an effect."""
    assert LIMITS.drive is not None
    table = advised_programme(diagnosis([], ["coulomb-friction (engine)"]), 10.0)
    assert len(table) == 600
    assert table["fuel_rack_mm"].unique() == pytest.approx([15.6, 28.4])
    assert table["pitch_ratio_command"].unique() == pytest.approx([1.35])
    table = advised_programme(diagnosis([], []), 10.0)
    assert table["fuel_rack_mm"].unique() == pytest.approx(
        [14.0, 14.0 + 16.0 / 3, 24.6667, 30.0, 22.0], abs=1e-3
    )
    assert len(table["pitch_ratio_command"].unique()) == 4


def test_cases_that_leave_nothing_open_do_not_count() -> None:
    one: dict[str, Any] = {
        "effect": "hull-fouling/hull",
        "open": "alternatives",
        "planned": "right",
        "random": "wrong",
        "catalogue": "among alternatives",
        "planned_minutes": 5.0,
        "random_minutes": None,
        "expected": 6.0,
    }
    nothing: dict[str, Any] = {
        "effect": NOTHING,
        "open": "anything",
        "planned": "wrong",
        "expected": 5.9,
    }
    stopped = one | {"catalogue": STOPS}
    results: list[dict[str, Any]] = [one, stopped, {"effect": "a", "open": ""}, nothing]
    assert discordant(results, "random") == (2, 0)
    assert discordant([one | {"planned": "wrong", "catalogue": "right"}], "catalogue") == (0, 1)
    assert undecided(results).to_numpy().tolist() == [[NOTHING, "wrong", 5.9]]
    assert sooner(results) == (2, 0)
    assert sooner([one | {"planned_minutes": 15.0, "random_minutes": 2.0}]) == (0, 1)
    table = summarise(results).set_index("programme")
    assert table["cases"].tolist() == [2, 2, 2]
    assert table["right alone"].tolist() == [2, 0, 0]
    assert table["among alternatives"].tolist() == [0, 0, 1]
    assert table[STOPS].tolist() == [0, 0, 1]
    assert table["a wrong name"].tolist() == [0, 2, 0]
    assert table["right from 2 min on"].tolist()[:2] == [0, 0]
    assert table["right from 5 min on"].tolist()[:2] == [2, 0]
    assert table.loc["planned", "minutes until right, median"] == 5.0
    assert np.isinf(table.loc["random", "minutes until right, median"])
    assert table["mean"].tolist()[:2] == [5.0, 15.0]
    assert np.isnan(table.loc["catalogue", "minutes until right, median"])
