"""Whether the effects that a search has chosen are the truth: what speaks against them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..search.fitting import Fit, Fitter
from ..search.selection import Selection
from ..simulate.balances import Balances
from .shapes import Shape
from .whiteness import Colour, Whiteness

FORM_SHARE = 0.15
"""A later effect in the same balance must bring this share of a stronger one's gain: less is what the
stronger one's form, never quite the truth's, leaves behind."""


def explained_share(whiteness: Whiteness, null: Fit, fit: Fit) -> float:
    """Share of the residual's power beyond the noise that the effects explain, where it is judged."""
    before, after = whiteness.ratios(null), whiteness.ratios(fit)
    excess = np.maximum(before - 1.0, 0.0).sum()
    return float(1.0 - np.maximum(after - 1.0, 0.0).sum() / excess) if excess > 0.0 else 1.0


def close_call(selection: Selection) -> bool:
    """Whether a second name comes near the first."""
    gains = [c.gain for c in selection.ranking[:2]]
    return len(gains) == 2 and gains[1] > 0.6 * gains[0]


def shape_to_show(shapes: list[Shape], balances: Balances, colour: Colour | None) -> Shape | None:
    """The shape to show: the best that is beyond chance, else that of the coloured balance."""
    if not shapes or shapes[0].excess > 0.0 or colour is None:
        return shapes[0] if shapes else None
    return next((s for s in shapes if s.balance == balances.names[colour.balance]), shapes[0])


def confirmed(selection: Selection, fitter: Fitter, judge: Any) -> Selection:
    """Drop every later effect that the data set aside speak against, or that looks like a remnant.

    The first effect's form is never quite the truth's; what it leaves invites other names, which do not
    hold on data that they were not fitted to.
    """
    fit = selection.fit
    keep = list(range(len(fit.effects)))
    for i in reversed(range(1, len(fit.effects))):
        rest = [k for k in keep if k != i]
        beside = [
            selection.gains[k]
            for k in rest
            if fit.effects[k].effect.balance == fit.effects[i].effect.balance
        ]
        a_form_error = selection.gains[i] < FORM_SHARE * max(beside, default=0.0)
        record = fitter.workshop.record
        with_it = judge(record(tuple(fit.effects[k] for k in keep)))
        refuted = with_it < judge(record(tuple(fit.effects[k] for k in rest)))
        if a_form_error or refuted:
            keep = rest
    if len(keep) == len(fit.effects):
        return selection
    fit = fitter.joint(fitter.fitted(tuple(fit.effects[k] for k in keep)))
    return replace(
        selection, fit=fit, gains=tuple(selection.gains[k] for k in keep),
        thresholds=tuple(selection.thresholds[k] for k in keep),
        rivals=tuple(selection.rivals[k] for k in keep),
    )  # fmt: skip
