"""Middles and intervals: by hand, and as often right as they claim."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.agents import KPIS, summary
from shaftline.agents.evaluation.statistics import (
    interquartile_mean,
    middle_of_runs,
    relative_to,
    with_interval,
)


def test_interquartile_mean_leaves_the_outer_quarters_out() -> None:
    assert interquartile_mean([100.0, 0.0, 3.0, 1.0]) == 2.0
    assert interquartile_mean([9.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 99.0]) == 4.5
    assert interquartile_mean([1.0, 2.0, 6.0]) == 3.0  # no quarter to leave out
    squares = np.arange(40.0) ** 2
    assert interquartile_mean(squares) == squares[10:30].mean()
    table = np.array([[0.0, 1.0, 3.0, 100.0], [5.0, 5.0, 7.0, -9.0]])
    assert interquartile_mean(table).tolist() == [2.0, 5.0]
    assert interquartile_mean(table.T, axis=0).tolist() == [2.0, 5.0]


def test_an_interval_is_a_percentile_bootstrap() -> None:
    sample = np.random.default_rng(5).gamma(2.0, 1.0, 30)
    for seed in (0, 1):
        rng = np.random.default_rng(seed)
        draws = interquartile_mean(sample[rng.integers(0, 30, (1000, 30))])
        middle, low, high = with_interval(sample, seed)
        assert middle == interquartile_mean(sample)
        assert (low, high) == pytest.approx(tuple(np.percentile(draws, [2.5, 97.5])))


@pytest.mark.parametrize("n", [50, 200])
def test_an_interval_is_two_standard_errors_to_either_side(n: int) -> None:
    sample = np.random.default_rng(n).normal(5.0, 2.0, n)
    middle, low, high = with_interval(sample, statistic=np.mean)
    error = np.std(sample) / np.sqrt(n)
    assert middle == np.mean(sample)
    assert (middle - low) / error == pytest.approx(1.96, rel=0.1)
    assert (high - middle) / error == pytest.approx(1.96, rel=0.1)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(0)
    intervals = [with_interval(rng.normal(5.0, 1.0, 30))[1:] for _ in range(200)]
    share = np.mean([low < 5.0 < high for low, high in intervals])
    assert 0.89 < share < 0.98


def test_an_interval_over_runs_covers_what_runs_and_episodes_spread() -> None:
    """Runs that differ widen it, be the episodes ever so many; so do episodes, be the runs alike."""
    rng = np.random.default_rng(1)
    runs, episodes = 3.0 * rng.standard_normal((10, 1)), rng.standard_normal((1, 400))
    for values, error in (
        (10.0 + runs + 0.0 * episodes, runs.std() / np.sqrt(10.0)),
        (10.0 + 0.0 * runs + episodes, episodes.std() / np.sqrt(400.0)),
    ):
        middle, low, high = middle_of_runs(values)
        assert middle == pytest.approx(values.mean())
        assert high - low == pytest.approx(2.0 * 1.96 * error, rel=0.1)


def test_a_change_is_against_the_same_episodes() -> None:
    """What both share of the sea takes no part in the interval; what the runs differ by does."""
    rng = np.random.default_rng(2)
    sea = np.exp(rng.standard_normal(60))
    alike = np.tile(0.7 * sea, (5, 1))
    for change in relative_to(alike, sea):
        assert change == pytest.approx(-30.0)
    middle, low, high = relative_to(alike * np.linspace(0.9, 1.1, 5)[:, None], sea)
    assert middle == pytest.approx(-30.0)
    assert high - low == pytest.approx(
        100.0 * 2.0 * 1.96 * 0.7 * np.linspace(-0.1, 0.1, 5).std() / 5**0.5, rel=0.15
    )
    assert np.isnan(relative_to(alike, 0.0 * sea)).all()


def test_few_or_equal_values_have_no_interval() -> None:
    assert with_interval([2.0, 2.0, 2.0]) == (2.0, 2.0, 2.0)
    assert with_interval([1.0, 4.0]) == (2.5, 2.5, 2.5)
    middle, low, high = with_interval([1.0, 4.0, 7.0])
    assert low < middle == 4.0 < high


def test_a_summary_has_every_kpi_and_failures_as_a_plain_share() -> None:
    rng = np.random.default_rng(2)
    table = pd.DataFrame({name: rng.normal(9.0, 1.0, 8) for name in KPIS})
    table["failed"] = [0.0] * 7 + [1.0]
    found = summary(table)
    assert set(found) == set(KPIS)
    assert found["failed"] == (0.125, 0.125, 0.125)
    assert found["reward"] == with_interval(table["reward"])
