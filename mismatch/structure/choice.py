"""Choose the likeliest fitted model whose effects all improve the fit enough, and its alternatives."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..judge.findings import FORM_SHARE
from .model import Floats, Model

TIED = 10.0
"""2 log L below which models are as good as each other (Kass and Raftery 1995): the catalogue's order
decides which of them is reported first."""

FINALISTS = 24
"""Number of models that are compared, the best first."""

VETO = 1.5
"""Times the least held-out rms error from which on a model is not chosen, however likely it is."""

NO_WORSE = 1.05
"""Largest held-out rms error of a channel, as a multiple of that of the ship file; and of an
alternative, as a multiple of that of the chosen model."""

NEARLY = 0.95
"""Share of the best model's gain in 2 log L from which a model that is as close to the held-out data is
an alternative, because approximate forms of models make differences of log L appear too certain."""


@dataclass(frozen=True)
class Ranked:
    """Fitted model with the measures by which it is ranked.

    Args:
        model: fitted model.
        merit: 2 log L on the fitted data less the price of its effects and of the search for them.
        held: rms error on the held-out data by channel, in the channels' units.
        compared: rms error on the held-out data with clipped outliers, likewise.
        likelihood: 2 log L of the held-out data with the noise model.
        place: sum of the positions of its effects in the catalogue.
        at_bound: whether a value of an effect is at the bound of its search.
    """

    model: Model
    merit: float
    held: Floats
    compared: Floats
    likelihood: float = 0.0
    place: int = 0
    at_bound: bool = False

    @property
    def evidence(self) -> float:
        """2 log L of all data less the price."""
        return self.merit + self.likelihood


def _pays(one: Ranked, ranked: list[Ranked]) -> bool:
    """Return whether all effects of a model pay: no part of them is nearly as good as the whole.

    A part is a model with some of the effects, or with the same effects in forms of fewer values. The
    approximate forms of its effects leave :data:`FORM_SHARE` squared of their gain, which is no evidence
    of a further effect.
    """
    plain = min((o for o in ranked if not o.model.labels), key=lambda o: o.merit, default=None)
    for other in ranked:
        part = other.model.labels < one.model.labels
        simpler = other.model.kinds == one.model.kinds and other.model.size < one.model.size
        if part or simpler:
            gained = other.evidence - plain.evidence if plain is not None else 0.0
            if one.evidence <= other.evidence + FORM_SHARE**2 * max(gained, 0.0):
                return False
    return True


def total(held: Floats, best: Floats) -> float:
    """Return the geometric mean over the channels of held-out errors relative to the best errors."""
    return float(np.exp(np.mean(np.log(held / best)))) if np.isfinite(held).all() else math.inf


def choose(
    ranked: list[Ranked], before: Floats, noise: Floats | float = math.inf
) -> tuple[Ranked, list[Ranked]]:
    """Return the likeliest model whose effects all pay, and the models that are as good.

    Models with a value at the bound of its search are chosen only if there are no others.

    Args:
        ranked: models by merit, the best first.
        before: held-out rms error of the ship file by channel, in the channels' units. A model with a
            larger error in a channel is not chosen.
        noise: held-out rms error by channel up to which it is noise. Where the chosen model leaves more,
            a model that is nearly as likely is an alternative.

    Returns:
        The model; and the models of no more values that the recordings cannot distinguish from it: as
        likely, or nearly so with no larger held-out error, or likelier with a clearly larger one.
    """
    runners = sorted(ranked, key=lambda one: one.evidence, reverse=True)
    runners = [one for one in runners if np.isfinite(one.evidence)] or ranked
    runners = [one for one in runners if _pays(one, ranked)][:FINALISTS] or runners[:1]
    runners = [one for one in runners if not one.at_bound] or runners
    runners = [one for one in runners if np.all(one.held <= NO_WORSE * before)] or runners
    scale = runners[0].compared
    errors = [total(one.compared, scale) for one in runners]
    least = min(errors)
    held = [o for o, error in zip(runners, errors, strict=True) if error <= VETO * least]
    top = max(one.evidence for one in held)
    alike = [one for one in held if one.evidence > top - TIED]
    best = min(alike, key=lambda one: one.place)
    vetoed = [one for one in runners if one not in held and one.evidence > top]
    leaves_more = bool(np.any(best.held > noise))
    plain = next((one.evidence for one in ranked if not one.model.labels), top)

    def is_alternative(one: Ranked) -> bool:
        """Whether a model is as likely as the best, or nearly so and as close to the held-out data."""
        nearly = leaves_more and one.evidence - plain >= NEARLY * (top - plain)
        close = total(one.compared, best.compared) <= NO_WORSE
        return one.evidence > top - TIED or (nearly and close)

    others = [*(one for one in held if is_alternative(one)), *vetoed]
    return best, [o for o in others if o is not best and o.model.size <= best.model.size]
