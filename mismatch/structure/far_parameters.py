"""A parameter far from the ship file, or an effect that does the same: the report has both.

Fouling and a resistance that is too low in the file are indistinguishable in a recording. Where the
search has moved a parameter beyond its tolerance, the effect is sought that takes its place with the
parameter near the file. If the fit is as good, the effect is reported, and the parameter beside it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..search.selection import TELL_APART
from .model import Model
from .priors import Prior
from .search import StructureSearch

PLAUSIBLE = math.log(1.5)
"""Logarithm of the factor by which physics may change a parameter; beyond it the file is wrong."""

TRIED = 5
"""Effects that are tried instead of a parameter, those of the largest predicted gain."""


def replace_far_parameters(
    search: StructureSearch, model: Model
) -> tuple[Model, dict[str, list[Prior]]]:
    """Return a model with effects in place of parameters far from the file, where the fit is as good.

    A file with a parameter that is off by more than physics could explain was guessed: its parameters
    stay as estimated.

    Args:
        search: search that found the model; replaced parameters are held near the file from then on.
        model: the chosen model.

    Returns:
        The model; and by the label of each effect that replaces parameters, their priors with the
        estimated values.
    """
    priors, replaced = search.problem.priors, {}
    far = search.problem.moved_far(model)
    if any(priors[k].wrong == 1.0 for k in far):
        return model, {}
    if any(priors[k].ratio and abs(model.shifts[k]) > PLAUSIBLE for k in far):
        return model, {}
    together = [far] if len(far) > 1 else []
    for group in (*together, *([k] for k in far)):
        if not set(group) <= set(search.problem.moved_far(model)):
            continue  # replaced already
        found = _with_effect(search, model, group)
        if found is None:
            continue
        (label,) = found.labels - model.labels
        was = [replace(priors[k], value=priors[k].value_at(float(model.shifts[k]))) for k in group]
        model, replaced[label] = found, was
    return model, replaced


def _with_effect(search: StructureSearch, model: Model, group: list[int]) -> Model | None:
    """Return the model with one more effect and some parameters near the file; None if it fits worse."""
    problem = search.problem
    before = list(problem.priors)
    price = sum(before[k].penalty(float(model.shifts[k])) for k in group)
    held = problem.fit_near_file(model, group)
    problem.hold(group)
    found = [
        problem.fit((*held.effects, one.starts[0][1]), held) for one in search.screen(held)[:TRIED]
    ]
    best = max(found, key=lambda one: one.score, default=held)
    # a far parameter costs no more than the probability that the file is wrong
    worse = best.score + TELL_APART < model.score + price
    if (
        worse
        or len(best.effects) == len(model.effects)
        or set(group) & set(problem.moved_far(best))
    ):
        problem.priors[:] = before
        return None
    return best
