"""When and under which conditions a mismatch acts: windows of time and regimes of operation."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..search.placed import Window

BLOCK_S = 20.0
"""Residuals are averaged over blocks this long before change points are sought [s]."""

MOST_CHANGES = 5
ACTIVE_SHARE = 0.1
"""An effect acts where its trace is above this share of its largest."""


def change_points(residual: NDArray[np.float64], interval_s: float) -> list[float]:
    """Times [s] at which the mean of a balance's residual changes.

    Optimal segmentation of block means (:func:`segmented`), with a penalty on the
    long-run variance of the blocks, so that a coloured residual is not cut where it merely wanders.

    Args:
        residual: of one balance, shape (rows,).
        interval_s: [s].
    """
    size = max(1, round(BLOCK_S / interval_s))
    count = len(residual) // size
    if count < 6:
        return []
    blocks = residual[: count * size].reshape(count, size).mean(axis=1)
    steps = np.diff(blocks)
    # the median of the steps is blind to the few that are changes
    variance = (1.4826 * float(np.median(np.abs(steps)))) ** 2 / 2.0
    if variance <= 0.0:
        return []
    correlation = float(np.clip(1.0 + 2.0 * _correlation(steps), 1.0, 4.0))
    penalty = 3.0 * math.log(count) * variance * correlation
    while True:
        found = segmented(blocks, penalty)
        if len(found) <= MOST_CHANGES:
            return [i * size * interval_s for i in found]
        penalty *= 1.5


def segmented(values: NDArray[np.float64], penalty: float) -> list[int]:
    """First values of all stretches but the first, each of a mean of its own.

    The least sum of squared distances from the means plus a penalty for every stretch, found exactly by
    dynamic programming over the last stretch (Jackson et al. 2005); stretches have two values at least.

    Args:
        values: shape (n,), n at least 2.
        penalty: in the values' unit squared.
    """
    n = len(values)
    centred = values - np.mean(values)
    total = np.concatenate([[0.0], np.cumsum(centred)])
    square = np.concatenate([[0.0], np.cumsum(centred**2)])
    least, before = np.full(n + 1, np.inf), np.zeros(n + 1, np.int64)
    least[0] = 0.0
    for end in range(2, n + 1):
        begin = np.arange(end - 1)
        cost = square[end] - square[begin] - (total[end] - total[begin]) ** 2 / (end - begin)
        whole = least[begin] + cost + penalty
        before[end] = int(np.argmin(whole))
        least[end] = whole[before[end]]
    found: list[int] = []
    end = int(before[n])
    while end > 0:
        found.insert(0, end)
        end = int(before[end])
    return found


def _correlation(steps: NDArray[np.float64]) -> float:
    """Lag-one correlation of the blocks behind their steps (-1/2 for white blocks)."""
    square = float(np.median(steps**2))
    lagged = float(np.median(steps[1:] * steps[:-1]))
    return lagged / square + 0.5 if square > 0.0 else 0.0


def windows_between(changes: list[float], duration_s: float) -> list[Window]:
    """All stretches that begin or end at a change point, the whole recording excepted."""
    edges = [0.0, *changes, duration_s]
    return [
        (a, b) for a, b in itertools.combinations(edges, 2) if b - a < duration_s - 1e-9 and b > a
    ]


def active_windows(
    trace: NDArray[np.float64], interval_s: float, duration_s: float
) -> list[Window]:
    """Stretches in which an effect's trace is felt; the whole recording where they are most of it.

    Args:
        trace: what the effect changes in its balance, shape (rows,).
        interval_s: [s].
        duration_s: length of the recording [s].
    """
    size = max(1, round(5.0 / interval_s))
    strength = np.convolve(np.abs(trace), np.ones(size) / size, mode="same")
    top = float(np.quantile(strength, 0.98))
    if top <= 0.0:
        return []
    active = strength > ACTIVE_SHARE * top
    if active.mean() > 0.6:
        return [(0.0, duration_s)]
    gap = max(1, round(BLOCK_S / interval_s))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
    merged: list[list[int]] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if merged and a - merged[-1][1] < gap:
            merged[-1][1] = int(b)
        else:
            merged.append([int(a), int(b)])
    return [(a * interval_s, min(b * interval_s, duration_s)) for a, b in merged]


def regime(trace: NDArray[np.float64], signals: dict[str, tuple[Any, str]]) -> str:
    """The operating regime that holds most of an effect, in words; empty where there is none.

    Args:
        trace: what the effect changes in its balance, shape (rows,).
        signals: by name, the simulated signal and its unit; ``time`` is none, windows tell that.
    """
    energy = np.square(trace)
    total = float(energy.sum())
    if total <= 0.0:
        return ""
    best, words = 0.0, ""
    for name, (signal, unit) in signals.items():
        values = np.asarray(signal, dtype=np.float64)
        if name == "time" or np.ptp(values) < 1e-3 * (np.abs(values).max() + 1e-12):
            continue
        for share in (0.2, 0.35, 0.5):
            for above in (True, False):
                edge = float(np.quantile(values, 1.0 - share if above else share))
                inside = values >= edge if above else values <= edge
                held = float(energy[inside].sum()) / total
                merit = held - float(inside.mean())
                if held > 0.8 and merit > max(best, 0.35):
                    side = "above" if above else "below"
                    best, words = merit, f"{name} {side} {edge:.3g} {unit}".strip()
    return words
