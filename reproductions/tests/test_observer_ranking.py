"""The ranking of observers inside the law: what is compared with what, and the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reproductions import observer_ranking as study
from shaftline.observers import observer_names


def test_changes_are_against_the_law_without_an_estimate_in_the_same_condition() -> None:
    values = {}
    for k, condition in enumerate(study.CONDITIONS):
        for observer in ("none", "oracle"):
            factor = 1.0 if observer == "none" else 0.8 - 0.1 * k
            values[condition.words, observer] = factor * (k + 1.0) * np.array([9.0, 10.0, 11.0])
    table = study.table_of(values).set_index(["condition", "observer"])
    for k, condition in enumerate(study.CONDITIONS):
        row = table.loc[(condition.words, "oracle")]
        assert row[study.KPI] == pytest.approx((0.8 - 0.1 * k) * (k + 1.0) * 10.0)
        for name in ("change_percent", "change_low", "change_high"):  # episode by episode alike
            assert row[name] == pytest.approx(-20.0 - 10.0 * k)
    ranked = study.page_table(table.reset_index())
    assert list(ranked["observer"]) == ["oracle", "none"]


def test_every_observer_is_run_in_every_condition(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "observer_names", lambda: ["none", "oracle"])
    found = study.run_conditions(tmp_path, 2, 1)
    assert len(found) == 2 * len(study.CONDITIONS)
    clean, wrong = (found[study.CONDITIONS[k].words, "oracle"] for k in (0, 2))
    assert clean.shape == (2,)
    assert not np.array_equal(clean, wrong)  # the ship's torque is another
    for condition in study.CONDITIONS[:4]:  # what an estimate is for
        assert found[condition.words, "oracle"].mean() < 0.9 * found[condition.words, "none"].mean()
    assert len(observer_names()) >= 17
