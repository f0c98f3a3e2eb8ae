"""What speaks against the later of the effects that a search has chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..search.fitting import Fitter
from ..search.selection import Selection

REMNANT_SHARE = 0.15
"""A later effect in the same balance must bring this share of a stronger one's gain: less is what the
stronger one's form, never quite the truth's, leaves behind."""


def confirmed(selection: Selection, fitter: Fitter, judge: Callable[[Any], float]) -> Selection:
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
        a_form_error = selection.gains[i] < REMNANT_SHARE * max(beside, default=0.0)
        record = fitter.trial_ship.record
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
