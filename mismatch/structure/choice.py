"""Which of many fitted models is told: the simplest that holds on data set aside, and what equals it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .model import Floats, Model

TIED = 10.0
"""Evidence in 2 log L below which models are as good as each other (Kass and Raftery 1995): the
catalogue's order decides which of them is told first."""

FINALISTS = 24
"""Models that are judged on the data set aside, the most worth first."""

OPEN_TO = 1.2
"""Times that error up to which a model of no more values is open, if the fitted data prefer it."""

NEAR_BEST = 1.05
"""Times the least error on data set aside that a simpler model may have and still be chosen."""


@dataclass(frozen=True)
class Ranked:
    """A model of the search, and what it is worth.

    Args:
        model: fitted.
        merit: its 2 log L less what its effects and the search for them cost.
        held: its error on the data set aside, by channel, in the channels' units.
        compared: the same with rows that are far off counting no more than others that are.
        place: of its effects in the catalogue, all together.
    """

    model: Model
    merit: float
    held: Floats
    compared: Floats
    place: int = 0


def _pays(one: Ranked, ranked: list[Ranked]) -> bool:
    """Whether all of a model's effects pay their price: no part of them is worth more than the whole."""
    return not any(o.model.labels < one.model.labels and o.merit > one.merit for o in ranked)


def total(held: Floats, best: Floats) -> float:
    """Error on data set aside over a best one, the channels' geometric mean."""
    return float(np.exp(np.mean(np.log(held / best)))) if np.isfinite(held).all() else math.inf


def chosen(ranked: list[Ranked], before: Floats) -> tuple[Ranked, list[Ranked]]:
    """The simplest model that is within :data:`NEAR_BEST` of the best in every channel set aside.

    Args:
        ranked: by merit, best first; the :data:`FINALISTS` first and the best of each size run.
        before: error of the file's ship there, by channel. What follows a channel worse is left out.

    Returns:
        The model, and others as good and no larger, which the recordings cannot tell from it. One that
        the fitted data prefer and the data set aside do not, or the other way round, is among them.
    """
    runners = list(ranked[:FINALISTS])
    for size in {one.model.size for one in ranked}:
        best = next(one for one in ranked if one.model.size == size)
        if best not in runners:
            runners.append(best)
    runners = [one for one in runners if _pays(one, ranked)]
    runners = [one for one in runners if np.all(one.held <= NEAR_BEST * before)] or runners
    scale = runners[0].compared
    errors = [total(one.compared, scale) for one in runners]
    least = min(errors)
    leader = runners[errors.index(least)].compared
    near = [one for one in runners if np.all(one.compared <= NEAR_BEST * leader)]
    smallest = min(one.model.size for one in near)
    alike = [one for one in near if one.model.size == smallest]
    clear = max(one.merit for one in alike)
    # what the fitted data prefer and the others do not, or nearly as much: together they do not decide
    alike += [
        one
        for one, error in zip(runners, errors, strict=True)
        if one.model.size <= smallest
        and one not in near
        and error <= OPEN_TO * least
        and one.merit > clear - TIED
    ]
    top = max(one.merit for one in alike)
    best = min((one for one in alike if one.merit >= top - TIED), key=lambda one: one.place)
    return best, [one for one in alike if one is not best]
