"""When an episode of resistance may have been: stretches that a straight line gives a chance."""

from __future__ import annotations

import itertools

import numpy as np

from .fitting import Fit, Fitter
from .placed import Window

PIECES = 24
"""Equal pieces of a recording; a stretch begins and ends between two of them."""

STRETCHES = PIECES * (PIECES + 1) // 2 - 1
"""That are scanned: all but the whole."""

MOST_WINDOWS = 4
ALIKE = 0.6
"""Share of two stretches together that they have in common, from which on the better stands for both."""

LEAST_GAIN = 9.0
"""In 2 log L, below which a stretch is not tried: chance reaches it."""


def episodes(fitter: Fitter, fit: Fit) -> list[Window]:
    """The stretches [s] in which the hull lacks a share of its resistance most clearly, best first.

    All stretches of :data:`PIECES`, by generalised least squares: a change of the resistance shows in
    the hull's balance alone, as much of it as there is.

    Args:
        fitter: of one recording; of several, or without a speed log, nothing is told.
        fit: what is known to be missing beside.
    """
    balances, bands = fitter.balances, fitter.bands
    replay, names = balances.replay, balances.names
    if "hull" not in names or len(replay.segments) > 1:
        return []
    edges = np.linspace(0, replay.rows, PIECES + 1).astype(int)
    columns = []
    for a, b in itertools.pairwise(edges):
        piece = np.zeros((len(names), replay.rows))
        piece[names.index("hull"), a:b] = balances.nominal_samples["resistance"][a:b]
        columns.append(bands.transform(piece))
    columns.append(fit.difference)
    information = fitter.likelihood.information(fit.weight, np.array(columns))
    count = len(columns)
    across, regressors = information[:count, count:], information[count:, count:]
    own = information[:count, :count] - across @ np.linalg.solve(regressors, across.T)
    times = replay.interval_s * edges
    gains: dict[Window, float] = {}
    for a, b in itertools.combinations(range(PIECES + 1), 2):
        told = float(own[a:b, a:b].sum())
        if told > 0.0 and b - a < PIECES:
            gain = float(own[a:b, -1].sum()) ** 2 / told
            if gain > LEAST_GAIN:
                gains[(float(times[a]), float(times[b]))] = gain
    found: list[Window] = []
    for window in sorted(gains, key=lambda w: -gains[w]):
        if len(found) < MOST_WINDOWS and all(_common(window, other) < ALIKE for other in found):
            found.append(window)
    return found


def _common(one: Window, other: Window) -> float:
    """Share of two stretches together that they have in common."""
    shared = max(0.0, min(one[1], other[1]) - max(one[0], other[0]))
    return shared / (one[1] - one[0] + other[1] - other[0] - shared)
