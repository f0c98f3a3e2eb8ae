"""A number that moved far, or physics that does the same: both are said.

Fouling and a resistance that the file has too low are one and the same to a recording. Where the joint
search has moved a number beyond its tolerance, the physics is sought that stands in its place with the
number held near the file. If it fits as well, the physics is named, and the number beside it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..search.selection import TELL_APART
from .model import Model
from .priors import Prior
from .search import StructureSearch

PLAUSIBLE = math.log(1.5)
"""Logarithm of the factor by which physics may change a number; beyond it the file is wrong."""

TRIED = 5
"""Effects that are tried in a number's stead, the best foretold first."""


def named(search: StructureSearch, model: Model) -> tuple[Model, dict[str, list[Prior]]]:
    """A model with physics in the stead of numbers that moved far, where that fits as well.

    A file of which a number is off by more than physics could be was guessed: its numbers stay numbers.

    Args:
        search: that has found the model; numbers that were replaced are held near the file from then on.
        model: the chosen one.

    Returns:
        The model, and by the label of each effect that stands for numbers, those numbers.
    """
    doubts, replaced = search.problem.priors, {}
    far = search.problem.moved_far(model)
    if any(doubts[k].wrong == 1.0 for k in far):
        return model, {}
    if any(doubts[k].ratio and abs(model.shifts[k]) > PLAUSIBLE for k in far):
        return model, {}
    together = [far] if len(far) > 1 else []
    for group in (*together, *([k] for k in far)):
        if not set(group) <= set(search.problem.moved_far(model)):
            continue  # replaced already
        found = _instead(search, model, group)
        if found is None:
            continue
        (label,) = found.labels - model.labels
        was = [replace(doubts[k], value=doubts[k].value_at(float(model.shifts[k]))) for k in group]
        model, replaced[label] = found, was
    return model, replaced


def _instead(search: StructureSearch, model: Model, group: list[int]) -> Model | None:
    """The model with one effect more and some numbers held near the file, if it fits as well."""
    problem = search.problem
    before = list(problem.priors)
    price = sum(before[k].penalty(float(model.shifts[k])) for k in group)
    held = problem.fit_near_file(model, group)
    problem.hold(group)
    found = [
        problem.fit((*held.effects, one.starts[0][1]), held) for one in search.screen(held)[:TRIED]
    ]
    best = max(found, key=lambda one: one.score, default=held)
    # the numbers' own price is the chance that the file is wrong
    worse = best.score + TELL_APART < model.score + price
    if worse or len(best.effects) == len(model.effects) or set(group) & set(problem.moved_far(best)):
        problem.priors[:] = before
        return None
    return best
