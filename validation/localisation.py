"""Score the time and the operating regime in which a tool reports an effect.

**Truth.** An effect acts noticeably at a row if it changes a measured channel by more than the standard
deviation of this channel's noise: the rms over ten seconds of the difference between the independent
simulator with and without the effect, both without noise. Ten seconds are longer than a period of
encounter, so that an effect in waves acts between the crests, too. An effect with a window acts inside
it only, because its traces outlast it in slow channels. These rules say when a single row can show an
effect, and do not depend on any tool.

**Regime.** Quartiles of two recorded channels divide the rows into bins, four by four. A bin is active
if more than half of its rows are.

A tool that marks every row has a high F1 if the effect acts nearly always. Its score is therefore stated
as a bound beside those of the tools.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ..core.rows import true_runs

Rows: TypeAlias = NDArray[np.bool_]
Windows: TypeAlias = list[list[float]]

NOTICED_S = 10.0
"""Interval over which the rms of a change is taken [s]."""

REGIME_CHANNELS = (
    "shaft_speed_rad_s",
    "ship_speed_m_s",
    "motor_current_A",
    "shaft_torque_N_m",
    "pitch_ratio",
)
"""Channels in order of preference; the first two that are recorded span the regime."""

QUARTILES = (0.25, 0.5, 0.75)
LEAST_SHARE = 0.01
"""Share of the rows below which a bin does not count."""

SELDOM = 0.5
"""Share of rows, or of bins, up to which an effect counts as one that acts seldom."""


SCORES = (
    "active_share",
    "time_f1",
    "time_f1_every_row",
    "active_bins_share",
    "regime_f1",
    "regime_f1_every_row",
)
"""Names of the scores of a case."""


def noticeable_rows(change: pd.DataFrame, noise: Mapping[str, float], period: float) -> Rows:
    """Return the rows at which a change exceeds the noise in at least one channel.

    Args:
        change: change of each channel by the effects, without noise.
        noise: standard deviation of the noise, by recorded channel.
        period: sampling interval [s].

    >>> change = pd.DataFrame({"shaft_speed_rad_s": np.repeat([0.0, 0.3, 0.0], 40)})
    >>> noticeable_rows(change, {"shaft_speed_rad_s": 0.2}, 1.0).sum()
    np.int64(40)
    """
    count = max(round(NOTICED_S / period), 1)
    found = np.zeros(len(change), dtype=bool)
    for channel, deviation in noise.items():
        squares = np.square(change[channel].to_numpy(dtype=np.float64))
        found |= scipy.ndimage.uniform_filter1d(squares, count, mode="nearest") > deviation**2
    return found


def rows_inside(windows: Windows, time: NDArray[np.float64]) -> Rows:
    """Return the rows inside any of some windows [s], ends included."""
    inside = np.zeros(len(time), dtype=bool)
    for begin, end in windows:
        inside |= (time >= begin) & (time <= end)
    return inside


def windows_of(rows: Rows, time: NDArray[np.float64]) -> Windows:
    """Return the first and the last time of each run of active rows [s].

    >>> windows_of(np.array([0, 1, 1, 0, 1], dtype=bool), np.arange(5.0))
    [[1.0, 2.0], [4.0, 4.0]]
    """
    runs = true_runs(rows)
    return [[round(float(time[a]), 4), round(float(time[b - 1]), 4)] for a, b in runs]


def f1(found: Rows, true: Rows) -> float:
    """Return the harmonic mean of precision and recall; NaN if nothing is true.

    >>> f1(np.array([True, True, False]), np.array([False, True, True]))
    0.5
    """
    hits, marked = int((found & true).sum()), int(found.sum()) + int(true.sum())
    return 2.0 * hits / marked if true.any() else math.nan


def regime_bins(recording: pd.DataFrame) -> NDArray[np.int64]:
    """Return the number of the regime bin of each row.

    Args:
        recording: fitted part, with measurements.
    """
    bins = np.zeros(len(recording), dtype=np.int64)
    for channel in [name for name in REGIME_CHANNELS if name in recording][:2]:
        values = recording[channel].to_numpy(dtype=np.float64)
        edges = np.quantile(values, QUARTILES)
        bins = bins * (len(QUARTILES) + 1) + np.searchsorted(edges, values, side="right")
    return bins


@dataclass(frozen=True)
class TrueLocation:
    """Rows and regime bins of the fitted part of a case in which its effects act noticeably.

    Args:
        time: time of each row [s].
        bins: number of the regime bin of each row.
        rows: whether the effects act at each row.
    """

    time: NDArray[np.float64]
    bins: NDArray[np.int64]
    rows: Rows

    @classmethod
    def of(cls, recording: pd.DataFrame, active_s: Windows) -> TrueLocation:
        """Return the location of effects that act in some windows [s] of a fitted part."""
        time = recording["time_s"].to_numpy(dtype=np.float64)
        return cls(time, regime_bins(recording), rows_inside(active_s, time))

    def active_bins(self, rows: Rows) -> Rows:
        """Return whether more than half of the rows of each bin are active, for bins that count."""
        counts = np.bincount(self.bins)
        active = np.bincount(self.bins, weights=rows.astype(np.float64))
        return np.asarray((2.0 * active > counts)[counts >= LEAST_SHARE * len(rows)])

    def scores(self, windows_s: Windows) -> dict[str, float]:
        """Return the F1 of reported windows in time and in regime, and those of marking every row.

        Args:
            windows_s: reported windows [s].

        Returns:
            Scores by name, with the share of rows and of bins in which the effects act. Empty if they
            act nowhere.
        """
        if not self.rows.any():
            return {}
        found = rows_inside(windows_s, self.time)
        true_bins = self.active_bins(self.rows)
        values = (
            float(self.rows.mean()),
            f1(found, self.rows),
            f1(np.ones_like(self.rows), self.rows),
            float(true_bins.mean()),
            f1(self.active_bins(found), true_bins),
            f1(np.ones_like(true_bins), true_bins),
        )
        return dict(zip(SCORES, values, strict=True))
