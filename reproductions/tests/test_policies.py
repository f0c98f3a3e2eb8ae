"""The page of the package's policies, from made-up trainings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reproductions.policies import page
from reproductions.policies.trainings import BLOCKS
from shaftline.agents.evaluation.scores import Bound
from shaftline.agents.policy.policy import packaged_policies

KPIS = dict.fromkeys(page._FIGURES, 2.0)


def cell(mean: float, held_out: float) -> dict[str, Any]:
    """Return a cell whose episodes scatter by one about its means."""
    scatter = np.resize([-1.0, 1.0], 48)
    means = {"training": mean, "second block": mean, "held-out": held_out}
    return {
        part: {"values": (means[part] + scatter).tolist(), "failed": 0.0, "kpis": KPIS}
        for part in BLOCKS
    }


def found(gain: float, held_out: float = 380.0) -> dict[str, Any]:
    return {
        "classic_storm_combinator": cell(300.0, 280.0),
        "classic_storm_va-pitch": cell(360.0, 340.0),
        "classic_storm_tuned-controller": cell(380.0, 350.0),
        "policy_storm_1": cell(380.0 + gain - 2.0, held_out),
        "policy_storm_2": cell(380.0 + gain + 2.0, held_out),
    }


@pytest.fixture(autouse=True)
def bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Combinator 300 and bound 500 of 600: a tenth of the score is 20."""
    one = Bound(combinator=0.5, tuned=0.63, best=5.0 / 6.0, spread=0.0)
    monkeypatch.setattr(page, "bounds", lambda: {"storm": one})


def test_the_gain_is_over_the_tuned_controller_and_in_the_unit_of_the_score() -> None:
    table = page.table_of(found(30.0)).set_index("seas")
    row = table.loc["training"]
    assert (row["policy"], row["tuned controller"], row["gain"]) == pytest.approx(
        (410.0, 380.0, 30.0)
    )
    assert row["score_unit"] == pytest.approx(200.0)
    assert row["gain_low"] < 30.0 < row["gain_high"]  # between the trainings
    assert table.loc["held-out", "gain"] == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("gain", "held_out", "expected"),
    [(60.0, 380.0, ["storm"]), (15.0, 380.0, []), (60.0, 360.0, [])],
    ids=["wins", "below a tenth", "not on held-out seas"],
)
def test_a_task_is_won_by_a_tenth_of_the_score_in_every_part(
    gain: float, held_out: float, expected: list[str]
) -> None:
    assert page.won(page.table_of(found(gain, held_out))) == expected


@pytest.mark.parametrize(("gain", "expected"), [(60.0, ["storm"]), (30.0, [])])
def test_the_whole_interval_counts_where_it_is_asked_for(gain: float, expected: list[str]) -> None:
    table = page.table_of(found(gain))  # two trainings that differ by 4 leave +-25
    assert page.won(table) == ["storm"]
    assert page.won_wholly(table) == expected


def test_the_page_stands_with_every_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = packaged_policies()
    monkeypatch.setattr(
        page, "packaged_policies", lambda: {name: here[name] for name in ("flank", "rough-sea")}
    )
    text = page.write(tmp_path, found(60.0)).read_text(encoding="utf-8")
    assert "| flank | none | none |" in text
    assert "| rough-sea | pitch, 25%, 1.0 s at 5.7 m/s | none |" in text
    for title in ("Training seas", "Training seas, second block of seeds", "Held-out seas"):
        assert f"## {title}" in text
    assert "Reached in: `storm`." in text
    assert "exceeds a tenth of the score in: `storm`." in text
    assert "| storm | residual, 32 plans | 2 | 300.0 | 360.0 | 380.0 | 440.0 | +60.0 (" in text
    assert "2 / 2 / 2" in text
