"""What the augmented filter shows over time, and what its innovations say against what it found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...observers.ship_filter import Followed, ShipFilter
from .filter_noises import size
from .filter_runs import FilterRuns

UNWHITE = 0.1
"""Correlation of innovations, and share by which their rms may differ from 1, that is told."""

CHANCE = 4.0
"""Standard deviations that either may differ by chance."""

UNSETTLED = 3.5
"""Standard deviations by which a number may move over the last quarter."""

LITTLE = 0.3
"""Share of its first standard error to which that of a number falls where something is told of it."""

LAGS = 20
"""Rows up to which innovations are correlated with those before."""

SHOWN_ROWS = 2000


def _joined(runs: FilterRuns, followed: list[Followed]) -> tuple[Any, Any]:
    """Estimates of the numbers over all rows and their standard errors, each (rows, numbers)."""
    count = len(runs.keys)
    values = np.concatenate([one.estimates[:, -count:] for one in followed])
    return values, np.concatenate([one.standard_errors[:, -count:] for one in followed])


def estimates_over_time(runs: FilterRuns, followed: list[Followed]) -> pd.DataFrame:
    """The numbers and their standard errors over time."""
    values, errors = _joined(runs, followed)
    columns = {"time_s": runs.replay.time_s}
    for i, key in enumerate(runs.keys):
        columns |= {key: values[:, i], f"{key} se": errors[:, i]}
    every = max(1, len(values) // SHOWN_ROWS)
    return pd.DataFrame(columns).iloc[::every].reset_index(drop=True)


def innovations(runs: FilterRuns, followed: list[Followed]) -> pd.DataFrame:
    """Of each channel: noise, rms of the innovations, and where they go together most."""
    rows = []
    for c, (column, noise) in enumerate(runs.noises.readings.items()):
        own = [one.innovations[len(one.innovations) // 20 :, c] for one in followed]
        found = np.concatenate(own)
        found = found[np.isfinite(found)]
        correlations = [
            float(np.mean(found[lag:] * found[:-lag]) / np.mean(found**2))
            for lag in range(1, 1 + min(LAGS, len(found) // 4))
        ]
        worst = int(np.argmax(np.abs(correlations)))
        rows.append(
            {
                "channel": column,
                "noise": noise,
                "rms": size(found),
                "correlation": correlations[worst],
                "lag_s": (1 + worst) * runs.replay.interval_s,
                "rows": len(found),
            }
        )
    return pd.DataFrame(rows)


def unwhite(runs: FilterRuns, followed: list[Followed]) -> list[str]:
    """What the innovations say against the standard errors."""
    return [
        f"the innovations of {row.channel} are not white: their rms is {row.rms:.2g} times the expected "
        f"one, and {row.lag_s:.3g} s apart they have a correlation of {row.correlation:.2f}. A sea that "
        "is no white noise does this, or physics that is missing; the standard errors may be wrong"
        for row in innovations(runs, followed).itertuples()
        if abs(row.rms - 1.0) > max(UNWHITE, CHANCE / np.sqrt(2.0 * row.rows))
        or abs(row.correlation) > max(UNWHITE, CHANCE / np.sqrt(row.rows))
    ]


def unsettled(runs: FilterRuns, followed: list[Followed]) -> list[str]:
    """Numbers that moved over the last quarter by more than their standard errors allow.

    An estimate of a constant moves from one time to a later one with the variance P(then) - P(later).
    """
    values, errors = _joined(runs, followed)
    then = 3 * len(values) // 4
    allowed = np.sqrt(np.maximum(errors[then] ** 2 - errors[-1] ** 2, 1e-300))
    moved = values[-1] - values[then]
    return [
        f"{key} had not settled: over the last quarter it moved by {moved[i]:.3g}, "
        f"{abs(moved[i]) / allowed[i]:.1f} times what its standard errors allow"
        for i, key in enumerate(runs.keys)
        if key not in runs.noises.number_walk and abs(moved[i]) > UNSETTLED * allowed[i]
    ]


def untold(runs: FilterRuns, own: ShipFilter) -> list[str]:
    """Numbers of which the recordings tell little."""
    errors = np.sqrt(np.diag(own.covariance))
    return [
        f"the recordings tell little of {key}: its standard error fell from {spread:.3g} to "
        f"{error:.3g} only"
        for key, spread, error in zip(
            runs.keys, (runs.noises.numbers[key] for key in runs.keys), errors, strict=True
        )
        if error > LITTLE * spread
    ]
