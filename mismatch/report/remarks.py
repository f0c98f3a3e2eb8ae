"""What a careful reader is told beside the verdict."""

from __future__ import annotations

import numpy as np

from ..outcome import Outcome
from .figures import interval
from .panels import block_rows, blocks
from .wording import channel_name, number

_WORSE = 1.0
"""Points of FitPercent that a channel may lose to the correction without a word."""

_ELSEWHERE = 3.0
"""Ratio of what is missing on the part set aside to elsewhere, from which it is said."""


def remarks(diagnosis: Outcome) -> list[str]:
    """Sentences on what the correction worsens, never fitted or leaves over; often none."""
    said = []
    worse = [
        channel_name(column)[0]
        for column, before in diagnosis.fit_before.items()
        if diagnosis.fit_after[column] < before - _WORSE
    ]
    if worse:
        said.append(
            f"On the part set aside the corrected ship follows {', '.join(worse)} worse than the "
            "nominal one: take the correction as a description of this recording, not as a model."
        )
    inside = np.zeros(len(diagnosis.time_s), bool)
    for a, b in diagnosis.held_out:
        inside |= (diagnosis.time_s >= a) & (diagnosis.time_s < b)
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    where = blocks(inside.astype(float), size) > 0.5
    for (name, _), residual in zip(diagnosis.balances, diagnosis.residual_after, strict=True):
        means = blocks(residual, size) - float(np.median(residual[~inside]))
        here, there = (float(np.sqrt(np.mean(means[part] ** 2))) for part in (where, ~where))
        if not worse and here > _ELSEWHERE * there > 0.0:
            said.append(
                f"In the {name} balance, {here / there:.0f} times as much is missing on the part set "
                "aside as elsewhere. What acts only there was never fitted: set another part aside "
                "and diagnose again."
            )
    colour = diagnosis.left_over
    if colour is not None and diagnosis.findings:
        name = diagnosis.balances[colour.balance][0]
        said.append(
            f"What is named leaves more than the instruments' noise: in the {name} balance, "
            f"{number(colour.ratio, 2)} times its power between {number(colour.low_Hz, 2)} and "
            f"{number(colour.high_Hz, 2)} Hz. The named form is close, not exact."
        )
    return said
