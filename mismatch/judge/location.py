"""When and under which conditions a mismatch acts: windows of time and regimes of operation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..search.placed import Window

GAP_S = 20.0
"""Stretches that are less than this apart are one [s]."""

ACTIVE_SHARE = 0.1
"""An effect acts where its trace is above this share of its largest."""


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
    gap = max(1, round(GAP_S / interval_s))
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
