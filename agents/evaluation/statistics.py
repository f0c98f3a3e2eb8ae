"""Middles and intervals of key performance indicators over seeds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from .kpis import KPIS


def interquartile_mean(values: Any, axis: int = -1) -> Any:
    """Mean of the middle half (Agarwal et al. 2021) along an axis."""
    return stats.trim_mean(np.asarray(values, dtype=np.float64), 0.25, axis=axis)


def with_interval(
    values: Any, seed: int = 0, statistic: Callable[..., Any] = interquartile_mean
) -> tuple[float, float, float]:
    """Interquartile mean, or another statistic, with its 95 % percentile bootstrap interval."""
    sample = np.asarray(values, dtype=np.float64)
    middle = float(statistic(sample))
    if len(sample) < 3 or np.ptp(sample) == 0.0:
        return middle, middle, middle
    found = stats.bootstrap(
        (sample,),
        statistic,
        n_resamples=1000,
        method="percentile",
        rng=np.random.default_rng(seed),
        vectorized=True,
    ).confidence_interval
    return middle, float(found.low), float(found.high)


def summary(kpis: pd.DataFrame) -> dict[str, tuple[float, float, float]]:
    """Each KPI's interquartile mean and 95 % interval; ``failed`` is a plain mean."""
    found = {name: with_interval(kpis[name]) for name in KPIS if name != "failed"}
    share = float(kpis["failed"].mean())
    return {**found, "failed": (share, share, share)}
