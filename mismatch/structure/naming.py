"""A number that moved far, or physics that does the same: both are said.

Fouling and a resistance that the file has too low are one and the same to a recording. Where the joint
search has moved a number beyond its tolerance, the physics is sought that stands in its place with the
number held near the file. If it fits as well, the physics is named, and the number beside it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..search.selection import TELL_APART
from .doubts import Doubt
from .model import Model
from .search import StructureSearch

FAR = 3.0
"""Tolerances beyond which a number has moved far."""

PLAUSIBLE = math.log(1.5)
"""Logarithm of the factor by which physics may change a number; beyond it the file is wrong."""

TRIED = 5
"""Effects that are tried in a number's stead, the best foretold first."""


def named(search: StructureSearch, model: Model) -> tuple[Model, dict[str, Doubt]]:
    """A model with physics in the stead of numbers that moved far, where that fits as well.

    Args:
        search: that has found the model; numbers that were replaced are held near the file from then on.
        model: the chosen one.

    Returns:
        The model, and by the label of each effect that stands for a number, that number.
    """
    problem, replaced = search.problem, {}
    far = sorted(
        range(len(problem.doubts)), key=lambda k: -abs(_shift(problem.doubts[k], model, k))
    )
    for k in far:
        doubt = problem.doubts[k]
        moved = float(model.numbers[k])
        if abs(_shift(doubt, model, k)) <= FAR or doubt.wrong == 1.0:
            continue
        if doubt.share and abs(moved) > PLAUSIBLE:
            continue
        problem.doubts[k] = replace(doubt, wrong=0.0)
        numbers = model.numbers.copy()
        numbers[k] = 0.0
        held = problem.fit(model.effects, replace(model, numbers=numbers))
        found = [
            problem.fit((*held.effects, one.starts[0][1]), held)
            for one in search.screen(held)[:TRIED]
        ]
        best = max(found, key=lambda one: one.score, default=held)
        # the number's own price is the chance that the file is wrong
        if best.score + TELL_APART < model.score + doubt.penalty(moved):
            problem.doubts[k] = doubt
            continue
        label = next(iter(best.labels - model.labels), "")
        if not label or abs(_shift(doubt, best, k)) > FAR:
            problem.doubts[k] = doubt
            continue
        model, replaced[label] = best, replace(doubt, value=doubt.at(moved))
    return model, replaced


def _shift(doubt: Doubt, model: Model, k: int) -> float:
    return float(model.numbers[k]) / doubt.near
