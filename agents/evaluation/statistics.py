"""Means of KPIs over seeds and trainings, with intervals that are valid for few values.

A percentile bootstrap of few values is too narrow: with 4 values a nominal 95 % interval covers 84 to
88 %, because no resample leaves their range. Here every interval is widened by Student's quantile.
``docs/results/intervals.md`` reports the measured coverage.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...core.statistics import HALF_95, half_95, wilson_interval
from .kpis import KPIS, SIGNED

LEAST_SEEDS = 4
"""Fewest episodes with an interval: with 3 the coverage falls to 90 % for bimodal values."""

_RESAMPLES = 1000


def interquartile_mean(values: Any, axis: int = -1) -> Any:
    """Return the mean of the middle half (Agarwal et al. 2021) along an axis; nan if a value is nan.

    Examples:
        >>> float(interquartile_mean([0.0, 1.0, 2.0, 100.0]))
        1.5
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64), axis)  # nan is last
    count = ordered.shape[axis]
    middle = np.take(ordered, range(count // 4, count - count // 4), axis).mean(axis)
    return np.where(np.isnan(np.take(ordered, -1, axis)), np.nan, middle)[()]


def estimate_with_interval(
    values: Any, seed: int = 0, statistic: Callable[..., Any] = interquartile_mean
) -> tuple[float, float, float]:
    """Return a statistic of a sample with its 95 % interval.

    The interval is that of the percentile bootstrap, stretched about the statistic by
    sqrt(n / (n - 1)) t(n - 1) / z. The first factor corrects the variance of resamples, the second
    accounts for the unknown variance of few values (Hesterberg's expanded percentile interval, 2015).

    Args:
        values: one value for each episode, shape (n,).
        seed: seed of the resamples.
        statistic: function of an array along ``axis``; the interquartile mean by default.

    Returns:
        The statistic, and the lower and upper end of its interval; both ends are nan with fewer than
        :data:`LEAST_SEEDS` values.

    Examples:
        >>> middle, low, high = estimate_with_interval([1.0, 2.0, 3.0, 4.0, 5.0])
        >>> middle, low < middle < high
        (3.0, True)
    """
    sample = np.asarray(values, dtype=np.float64)
    count = len(sample)
    middle = float(statistic(sample))
    if count < LEAST_SEEDS:
        return middle, math.nan, math.nan
    if np.ptp(sample) == 0.0:
        return middle, middle, middle
    resamples = np.random.default_rng(seed).choice(sample, (_RESAMPLES, count))
    ends = np.percentile(statistic(resamples, axis=-1), (2.5, 97.5))
    stretch = math.sqrt(count / (count - 1)) * half_95(count - 1) / HALF_95
    low, high = middle - float(ends[0]), float(ends[1]) - middle
    return middle, middle - stretch * low, middle + stretch * high


def _half_width(table: NDArray[np.float64]) -> float:
    """Return half the 95 % interval of the mean of a table of trainings (rows) and episodes (columns).

    Every training is evaluated in every episode. The variance of the mean is (MS_rows + MS_columns -
    MS_rest) / (r e), with the degrees of freedom of Satterthwaite (1946). A single row is a fixed
    controller, with random episodes only. The result is nan with a single episode.
    """
    runs, episodes = table.shape
    if episodes < 2:
        return math.nan
    by_run, by_episode, mean = table.mean(axis=1), table.mean(axis=0), table.mean()
    of_episodes = runs * by_episode.var(ddof=1)
    if runs == 1:
        return half_95(episodes - 1) * math.sqrt(of_episodes / episodes)
    of_runs = episodes * by_run.var(ddof=1)
    rest = table - by_run[:, None] - by_episode + mean
    of_rest = float((rest**2).sum()) / ((runs - 1) * (episodes - 1))
    together = max(of_runs + of_episodes - of_rest, of_runs, of_episodes)
    parts = of_runs**2 / (runs - 1) + of_episodes**2 / (episodes - 1)
    if parts == 0.0:
        return 0.0
    degrees = (of_runs + of_episodes) ** 2 / parts
    return half_95(degrees) * math.sqrt(together / (runs * episodes))


def mean_with_interval(values: Any) -> tuple[float, float, float]:
    """Return the mean over trainings and episodes with its 95 % interval over both.

    Args:
        values: r trainings, or one controller, in the same e episodes, shape (r, e).

    Examples:
        >>> mean, low, high = mean_with_interval([[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]])
        >>> mean, low < mean < high
        (2.5, True)
    """
    table = np.atleast_2d(np.asarray(values, dtype=np.float64))
    mean, half = float(table.mean()), _half_width(table)
    return mean, mean - half, mean + half


def relative_change(values: Any, baseline: Any) -> tuple[float, float, float]:
    """Return the change of the mean relative to a baseline in percent, with its interval.

    The interval is that of the ratio R of the means, linearised about its estimate: the interval of the
    mean of (values - R baseline) / mean(baseline). The part of an episode that both share cancels.

    Args:
        values: values of trainings, shape (r, e).
        baseline: values of the baseline in the same episodes, shape (e,).

    Returns:
        Change, lower and upper end [percent]; nan where the mean of the baseline is zero.

    Examples:
        >>> change, low, high = relative_change([[1.1, 2.2, 3.3]], [1.0, 2.0, 3.0])
        >>> round(change, 6)
        10.0
    """
    table = np.atleast_2d(np.asarray(values, dtype=np.float64))
    other = np.asarray(baseline, dtype=np.float64)
    if other.mean() == 0.0:
        return math.nan, math.nan, math.nan
    ratio = float(table.mean() / other.mean())
    half = _half_width((table - ratio * other) / abs(other.mean()))
    change = 100.0 * (ratio - 1.0)
    return change, change - 100.0 * half, change + 100.0 * half


def summary(kpis: pd.DataFrame) -> dict[str, tuple[float, float, float]]:
    """Return the interquartile mean and the 95 % interval of each KPI.

    The stretched interval of a quantity that cannot be negative begins at 0 or above.
    ``failed`` is the share of failed episodes with the interval of Wilson (1927), which is also valid
    for shares of 0 and 1.

    Args:
        kpis: KPIs, one row for each episode.

    Examples:
        >>> kpis = pd.DataFrame({name: [1.0, 1.0, 1.0, 1.0] for name in KPIS})
        >>> summary(kpis)["reward"]
        (1.0, 1.0, 1.0)
    """
    found = {name: estimate_with_interval(kpis[name]) for name in KPIS if name != "failed"}
    for name in found.keys() - set(SIGNED):
        middle, low, high = found[name]
        found[name] = middle, float(np.maximum(low, 0.0)), high  # nan stays nan
    count, failures = len(kpis), int(kpis["failed"].sum())
    return {**found, "failed": (failures / count, *wilson_interval(failures, count))}
