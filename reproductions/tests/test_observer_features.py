"""The study of observers as features: its power, what it says of intervals, and what it trains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from reproductions import observer_features as study
from reproductions.observer_features import ARMS, NONE, Arm
from shaftline.agents import load_policy


def test_the_power_is_what_a_simulation_of_the_design_finds() -> None:
    """Of arms that differ by the detectable difference four in five are distinguished."""
    rng = np.random.default_rng(0)
    shape = (20_000, study.RUNS)
    one, other = rng.standard_normal(shape), rng.standard_normal(shape) + study.detectable(1.0)
    found = stats.ttest_ind(one, other, axis=1).pvalue < study.LEVEL / study.FAMILY
    assert float(found.mean()) == pytest.approx(study.POWER, abs=0.02)
    assert study.detectable(2.0) == pytest.approx(2.0 * study.detectable(1.0))


def test_gains_are_of_the_same_history_and_their_intervals_are_welch_s() -> None:
    rng = np.random.default_rng(1)
    words = study.conditions()[0].words
    values = {(words, arm): rng.normal(-600.0, 3.0, study.RUNS) for arm in ARMS}
    better = Arm("luenberger", 8)
    values[words, better] = values[words, better] + 60.0
    table = study.table_of(values).set_index(list(Arm._fields))
    row = table.loc[tuple(better)]
    own, without = values[words, better], values[words, Arm(NONE, 8)]
    scale = 100.0 / abs(without.mean())
    level = 1.0 - study.LEVEL / study.FAMILY
    interval = stats.ttest_ind(own, without).confidence_interval(level)
    assert row["gain_percent"] == pytest.approx(scale * (own.mean() - without.mean()))
    assert (row["gain_low"], row["gain_high"]) == pytest.approx(
        (scale * interval.low, scale * interval.high)
    )
    assert row["said"] == "gain"
    assert table.loc[tuple(Arm(NONE, 1)), "said"] == ""
    assert len(study.page_table(study.table_of(values))) == len(ARMS)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.1, 3.0, "gain"),
        (-3.0, -0.1, "loss"),
        (-1.9, 1.9, "no gain"),
        (-2.1, 0.5, "not decided"),
        (-0.5, 2.1, "not decided"),
    ],
)
def test_what_is_said_of_an_interval(low: float, high: float, expected: str) -> None:
    assert study.decision(low, high) == expected


def test_arms_are_trained_and_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each arm sees its own observer and history; with a kept folder nothing is made again."""
    arms = (Arm(NONE, 1), Arm("oracle", 2))
    monkeypatch.setattr(study, "ARMS", arms)
    monkeypatch.setattr(study, "RUNS", 2)
    tiny = {"n_envs": 32, "n_timesteps": 4096, "evaluations": 1}  # one rollout
    policies = study.train_arms(tmp_path / "trained", 1, **tiny)
    assert {arm: len(paths) for arm, paths in policies.items()} == dict.fromkeys(arms, 2)
    stamps = [path.stat().st_mtime_ns for paths in policies.values() for path in paths]
    again = study.train_arms(tmp_path / "trained", 1, **tiny)
    assert stamps == [path.stat().st_mtime_ns for paths in again.values() for path in paths]
    recipe = load_policy(policies[arms[1]][0]).about["recipe"]
    assert recipe["env_kwargs"]["observer"] == "oracle"
    assert recipe["frame_stack"] == 2
    values = study.evaluate_arms(policies, tmp_path, 1, seeds=1)
    assert {key: found.shape for key, found in values.items()} == {
        (condition.words, arm): (2,) for condition in study.conditions() for arm in arms
    }
    usual, noisy, wrong = (values[c.words, arms[0]] for c in study.conditions())
    assert not np.array_equal(usual, noisy)
    assert not np.array_equal(usual, wrong)
