"""Middles and intervals: by hand, and as often right as they claim."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.agents import KPIS, summary
from shaftline.agents.evaluation.statistics import (
    estimate_with_interval,
    interquartile_mean,
    mean_with_interval,
    relative_change,
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
    table[1, 0] = np.nan
    assert interquartile_mean(table) == pytest.approx([2.0, np.nan], nan_ok=True)


def test_an_interval_is_a_bootstrap_widened_by_students_quantile() -> None:
    sample = np.random.default_rng(5).gamma(2.0, 1.0, 6)
    stretch = np.sqrt(6.0 / 5.0) * 2.570582 / 1.96  # t with 5 degrees of freedom over z
    for seed in (0, 1):
        rng = np.random.default_rng(seed)
        draws = interquartile_mean(sample[rng.integers(0, 6, (1000, 6))])
        middle, low, high = estimate_with_interval(sample, seed)
        assert middle == interquartile_mean(sample)
        ends = np.percentile(draws, [2.5, 97.5])
        assert (low, high) == pytest.approx(tuple(middle + stretch * (ends - middle)), rel=1e-6)


@pytest.mark.parametrize("n", [50, 200])
def test_an_interval_is_two_standard_errors_to_either_side(n: int) -> None:
    sample = np.random.default_rng(n).normal(5.0, 2.0, n)
    middle, low, high = estimate_with_interval(sample, statistic=np.mean)
    error = np.std(sample) / np.sqrt(n)
    assert middle == np.mean(sample)
    assert (middle - low) / error == pytest.approx(1.96, rel=0.1)
    assert (high - middle) / error == pytest.approx(1.96, rel=0.1)


@pytest.mark.parametrize("n", [4, 6, 30])
@pytest.mark.parametrize("draw", ["normal", "exponential"])
def test_intervals_cover_the_truth_as_often_as_they_claim(n: int, draw: str) -> None:
    """The plain percentile bootstrap covers 84 to 88 % with 4 values: below the bound here."""
    rng = np.random.default_rng(n)
    truth = interquartile_mean(getattr(rng, draw)(size=1_000_000))
    intervals = [estimate_with_interval(getattr(rng, draw)(size=n))[1:] for _ in range(400)]
    share = np.mean([low < truth < high for low, high in intervals])
    assert 0.92 < share < 0.99  # three standard errors of 400 samples about 95 %


def test_an_interval_over_runs_covers_what_runs_and_episodes_spread() -> None:
    """Runs that differ widen it, be the episodes ever so many; so do episodes, be the runs alike."""
    rng = np.random.default_rng(1)
    runs, episodes = 3.0 * rng.standard_normal((10, 1)), rng.standard_normal((1, 400))
    for values, error, quantile in (
        (10.0 + runs + 0.0 * episodes, runs.std(ddof=1) / np.sqrt(10.0), 2.262157),
        (10.0 + 0.0 * runs + episodes, episodes.std(ddof=1) / np.sqrt(400.0), 1.965927),
    ):
        middle, low, high = mean_with_interval(values)
        assert middle == pytest.approx(values.mean())
        assert high - low == pytest.approx(2.0 * quantile * error, rel=1e-5)
    single = rng.standard_normal(9)
    middle, low, high = mean_with_interval(single)
    assert high - middle == pytest.approx(2.306004 * single.std(ddof=1) / 3.0, rel=1e-5)
    assert middle - low == pytest.approx(high - middle)
    assert mean_with_interval([[2.0], [3.0]])[0] == 2.5
    assert np.isnan(mean_with_interval([[2.0], [3.0]])[1:]).all()  # one episode has no spread
    assert mean_with_interval(np.full((3, 4), 7.0)) == (7.0, 7.0, 7.0)


@pytest.mark.parametrize("between", [0.0, 0.3, 3.0])
def test_intervals_of_few_trainings_cover_as_often_as_they_claim(between: float) -> None:
    """With noise of trainings, of episodes and of both together."""
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(400):
        table = 1.0 + between * rng.standard_normal((5, 1)) + rng.standard_normal((1, 20))
        _, low, high = mean_with_interval(table + 0.5 * rng.standard_normal((5, 20)))
        held += low < 1.0 < high
    assert 0.92 < held / 400 < 0.99


def test_a_change_is_against_the_same_episodes() -> None:
    """What both share of the sea takes no part in the interval; what the runs differ by does."""
    rng = np.random.default_rng(2)
    sea = np.exp(rng.standard_normal(60))
    alike = np.tile(0.7 * sea, (5, 1))
    for change in relative_change(alike, sea):
        assert change == pytest.approx(-30.0)
    factors = np.linspace(0.9, 1.1, 5)
    middle, low, high = relative_change(alike * factors[:, None], sea)
    assert middle == pytest.approx(-30.0)
    # t with about 4 degrees of freedom: the runs alone differ
    assert high - low == pytest.approx(
        100.0 * 2.0 * 2.776 * 0.7 * factors.std(ddof=1) / 5**0.5, rel=0.02
    )
    assert relative_change(-alike, -sea)[0] == pytest.approx(-30.0)
    less = relative_change(-alike * factors[:, None], -sea)  # rewards are negative
    assert less == pytest.approx((middle, low, high))
    assert np.isnan(relative_change(alike, 0.0 * sea)).all()


def test_few_values_have_no_interval_and_equal_ones_a_point() -> None:
    assert estimate_with_interval([2.0, 2.0, 2.0, 2.0]) == (2.0, 2.0, 2.0)
    for few in ([1.0, 4.0], [1.0, 4.0, 7.0], [2.0, 2.0, 2.0]):
        middle, low, high = estimate_with_interval(few)
        assert middle == np.mean(few)
        assert np.isnan([low, high]).all()
    middle, low, high = estimate_with_interval([1.0, 4.0, 4.0, 7.0])
    assert low < middle == 4.0 < high


def test_a_summary_has_every_kpi_and_failures_as_a_share_with_wilsons_interval() -> None:
    rng = np.random.default_rng(2)
    table = pd.DataFrame({name: rng.normal(9.0, 1.0, 8) for name in KPIS})
    table["failed"] = [0.0] * 7 + [1.0]
    found = summary(table)
    assert set(found) == set(KPIS)
    share, low, high = found["failed"]
    assert share == 0.125
    # Wilson (1927) by hand for 1 of 8: (p + z2/16 -+ z sqrt(p q / 8 + z2 / 256)) / (1 + z2 / 8)
    assert (low, high) == pytest.approx((0.0224, 0.4709), abs=2e-4)
    table["failed"] = 0.0
    assert summary(table)["failed"][2] > 0.3  # none of 8 does not show that none can fail
    assert found["reward"] == estimate_with_interval(table["reward"])


def test_no_interval_of_a_quantity_that_cannot_be_negative_extends_below_0() -> None:
    """Stretched about its middle of 7.5 s, the interval of these overspeeds would begin below 0."""
    values = [0.0, 5.0, 10.0, 30.0]
    table = pd.DataFrame(dict.fromkeys(KPIS, values) | {"failed": [0.0] * 4})
    middle, low, high = estimate_with_interval(values)
    assert low < -2.0
    found = summary(table)
    assert found["overspeed_s"] == (middle, 0.0, high)
    assert found["speed_short_m_s"] == (middle, low, high)
    assert np.isnan(summary(table.head(3))["overspeed_s"][1])
