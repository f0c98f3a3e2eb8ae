"""Middles and intervals of key performance indicators over seeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from .kpis import KPIS

_RESAMPLES = 2000


def interquartile_mean(values: Any, axis: int = -1) -> Any:
    """Mean of the middle half (Agarwal et al. 2021) along an axis."""
    return scipy.stats.trim_mean(np.asarray(values, dtype=np.float64), 0.25, axis=axis)


def with_interval(
    values: Any, seed: int = 0, statistic: Callable[..., Any] = interquartile_mean
) -> tuple[float, float, float]:
    """Interquartile mean, or another statistic, with its 95 % percentile bootstrap interval."""
    sample = np.asarray(values, dtype=np.float64)
    middle = float(statistic(sample))
    if len(sample) < 3 or np.ptp(sample) == 0.0:
        return middle, middle, middle
    found = scipy.stats.bootstrap(
        (sample,),
        statistic,
        n_resamples=1000,
        method="percentile",
        rng=np.random.default_rng(seed),
        vectorized=True,
    ).confidence_interval
    return middle, float(found.low), float(found.high)


def _resampled(
    values: NDArray[np.float64], rng: np.random.Generator, chosen: NDArray[np.int64]
) -> float:
    """Mean over runs and episodes of a resample: some of the runs, with the episodes that are given."""
    runs = rng.integers(len(values), size=len(values))
    return float(np.mean(values[runs][:, chosen]))


def middle_of_runs(values: Any, seed: int = 0) -> tuple[float, float, float]:
    """Mean over runs and episodes with its 95 % interval over both (Agarwal et al. 2021, stratified).

    Args:
        values: shape (r, e): r trainings, or one controller, through the same e episodes.
        seed: of the resamples.
    """
    table = np.atleast_2d(np.asarray(values, dtype=np.float64))
    rng = np.random.default_rng(seed)
    count = table.shape[1]
    every = rng.integers(count, size=(_RESAMPLES, count))
    drawn = [_resampled(table, rng, chosen) for chosen in every]
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(table.mean()), float(low), float(high)


def relative_to(values: Any, baseline: Any, seed: int = 0) -> tuple[float, float, float]:
    """Mean of runs over that of a baseline, less one, in percent, with its 95 % interval.

    Args:
        values: shape (r, e).
        baseline: shape (e,), of the same episodes; they are resampled together.
        seed: of the resamples.

    Returns:
        nan where the baseline's mean is zero.
    """
    table = np.atleast_2d(np.asarray(values, dtype=np.float64))
    other = np.asarray(baseline, dtype=np.float64)
    rng = np.random.default_rng(seed)
    if other.mean() == 0.0:
        return math.nan, math.nan, math.nan
    drawn = []
    for _ in range(_RESAMPLES):
        chosen = rng.integers(len(other), size=len(other))
        base = float(other[chosen].mean())
        drawn.append(_resampled(table, rng, chosen) / base - 1.0 if base != 0.0 else math.nan)
    low, high = 100.0 * np.nanpercentile(drawn, [2.5, 97.5])
    return 100.0 * (float(table.mean()) / float(other.mean()) - 1.0), float(low), float(high)


def summary(kpis: pd.DataFrame) -> dict[str, tuple[float, float, float]]:
    """Each KPI's interquartile mean and 95 % interval; ``failed`` is a plain mean."""
    found = {name: with_interval(kpis[name]) for name in KPIS if name != "failed"}
    share = float(kpis["failed"].mean())
    return {**found, "failed": (share, share, share)}
