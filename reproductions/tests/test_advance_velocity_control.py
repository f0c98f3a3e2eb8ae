"""Scheduling by the advance velocity: true ships, comparisons, and the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions import advance_velocity_control as study

CALM, WRONG = study.CONDITIONS[0], study.CONDITIONS[3]


def test_the_true_ship_has_another_wake_than_the_controller_knows() -> None:
    assert (CALM.words, WRONG.words) == ("calm", "calm, wake wrong")
    assert CALM.model.load_ship().hull.wake_fraction == pytest.approx(0.05)
    assert WRONG.model.load_ship().hull.wake_fraction == pytest.approx(0.15)
    settings = [c.setting("combinator", "none", 2) for c in (CALM, WRONG)]
    assert settings[0].name != settings[1].name
    assert float(study._load(settings[1]).plant["wake_fraction"]) == pytest.approx(0.05)  # type: ignore[attr-defined]
    storm = study.CONDITIONS[5]
    assert storm.words == "storm, wake wrong"
    assert storm.model.load_ship().propeller.depth_m == 3.0  # the changes of the task remain


def test_changes_are_against_the_nominal_wake_of_the_same_controller_and_condition() -> None:
    found = {}
    for controller, kpi in study.KPIS.items():
        for k, condition in enumerate(study.CONDITIONS):
            for i, name in enumerate(study.variants(controller)):
                values = np.array([9.0, 10.0, 11.0]) + 10.0 * k + i
                columns = {study.REWARD: values, kpi: -values, study.SHORT: values}
                found[controller, condition.words, name] = pd.DataFrame(columns)
    table = study.table_of(found).set_index(["controller", "condition", "schedule", "quantity"])
    for controller, kpi in study.KPIS.items():
        for condition in study.CONDITIONS:
            row = table.loc[(controller, condition.words, "oracle", study.REWARD)]
            assert row[["change", "change_low", "change_high"]].tolist() == pytest.approx([3.0] * 3)
            assert table.loc[(controller, condition.words, "oracle", kpi), "change"] == -3.0
    page = study.page_table(table.reset_index(), reward=True)
    assert len(page) == len(study.KPIS) * len(study.CONDITIONS)
    assert page.loc[0, "oracle"] == "+3.0 (+3.0 to +3.0)"
    assert page.loc[0, study.NOMINAL] == "11.0"


def test_an_observer_corrects_a_wrong_wake_in_the_optimiser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "KPIS", {"cpp-optimiser": "fuel_kg_nmi"})
    monkeypatch.setattr(study, "CONDITIONS", [WRONG])
    monkeypatch.setattr(study, "OBSERVERS", ("power-balance",))
    found = study.run_conditions(tmp_path, 2, 1)
    nominal, observed = (
        found["cpp-optimiser", WRONG.words, name]["fuel_kg_nmi"]
        for name in (study.NOMINAL, "power-balance")
    )
    assert (observed < 0.85 * nominal).all()
    deviations = study.deviation_table(2)
    assert deviations["median"].tolist() == pytest.approx([-10.5], abs=0.5)
    assert deviations["outside the band"].tolist() == [0.0]
