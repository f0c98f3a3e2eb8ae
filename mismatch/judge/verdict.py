"""The verdict: whether the effects that were chosen hold, and whether more than noise is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..search.fitting import Fit
from ..search.selection import TELL_APART, Selection
from .whiteness import Colour, Whiteness

EXPLAINED, NOTHING, UNEXPLAINED = "explained", "nothing-missing", "unexplained"
"""Verdicts."""

EXPLAINED_SHARE = 0.8
"""Named effects must explain this share of the residual's power beyond the noise, where what is left is
more than noise; else they are not the truth and the verdict is ``unexplained``."""

CLOSE_SHARE = 0.6
"""Share of the best name's gain from which the second comes near it."""


@dataclass(frozen=True)
class Verdict:
    """A verdict and what speaks for it.

    Args:
        name: :data:`EXPLAINED`, :data:`NOTHING` or :data:`UNEXPLAINED`.
        explained: share of the residual's power beyond the noise that the effects explain.
        colour: where the residual without any effect is more than noise; None where it is noise.
        left_over: likewise of what the effects leave.
    """

    name: str
    explained: float
    colour: Colour | None
    left_over: Colour | None


def verdict_of(selection: Selection, whiteness: Whiteness, gain: float, excited: bool) -> Verdict:
    """Judge what a search has chosen.

    Args:
        selection: what was chosen, confirmed.
        whiteness: of the residuals.
        gain: of the chosen effects in 2 log L, on the data set aside.
        excited: whether the demands move enough to tell effects apart.
    """
    null, fit = whiteness.fitter.null, selection.fit
    colour, left_over = whiteness.colour(null), whiteness.colour(fit)
    explained = explained_share(whiteness, null, fit)
    veto = bool(fit.effects) and gain < -TELL_APART
    several = len(fit.effects) > 1 or any(selection.rivals) or close_call(selection)
    undecided = bool(fit.effects) and not excited and several
    not_the_truth = left_over is not None and explained < EXPLAINED_SHARE
    name = EXPLAINED
    if veto or undecided or not_the_truth or not fit.effects:
        # what was named does not hold, or nothing was: is there more than noise at all?
        name = UNEXPLAINED if colour is not None or undecided or not_the_truth else NOTHING
    return Verdict(name, explained, colour, left_over)


def explained_share(whiteness: Whiteness, null: Fit, fit: Fit) -> float:
    """Share of the residual's power beyond the noise that the effects explain, where it is judged."""
    before, after = whiteness.ratios(null), whiteness.ratios(fit)
    excess = np.maximum(before - 1.0, 0.0).sum()
    return float(1.0 - np.maximum(after - 1.0, 0.0).sum() / excess) if excess > 0.0 else 1.0


def close_call(selection: Selection) -> bool:
    """Whether a second name comes near the first."""
    gains = [c.gain for c in selection.ranking[:2]]
    return len(gains) == 2 and gains[1] > CLOSE_SHARE * gains[0]
