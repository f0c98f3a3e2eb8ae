"""Whether a wrong number of the ship's file explains a difference as well as a named effect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..search.fitting import Fit, Fitter
from ..search.placed import Placed
from ..search.selection import TELL_APART, Selection
from .free import Free, doubtful

STEP = 1e-2
"""Share of a number over which its influence is felt."""

MOST_STEPS = 6
"""Of the search for its best value."""

SETTLED = 0.1
"""Gain in 2 log L below which that search ends."""

HOPELESS = 0.5
"""Share of an effect's gain that a number must bring at the first step to be searched further."""


@dataclass(frozen=True)
class WrongNumber:
    """A number of the ship's file that explains a difference as well as a named effect.

    Args:
        key: dotted key.
        file: value in the ship's file.
        value: that would explain the difference, likewise in ``unit``.
        unit: SI.
        gain: in 2 log L, in place of the effect.
    """

    key: str
    file: float
    value: float
    unit: str
    gain: float


def wrong_numbers(fitter: Fitter, selection: Selection) -> list[WrongNumber | None]:
    """For each named effect, the number that in its place does as well; None where there is none.

    A number whose own deviation the ship's file states is not asked: it moves in every model that is
    tried, and a calibrated one was right while the ship was healthy.
    """
    fit = selection.fit
    return [_instead(fitter, fit, i, gain) for i, gain in enumerate(selection.gains)]


def _instead(fitter: Fitter, fit: Fit, index: int, gain: float) -> WrongNumber | None:
    ship = fitter.trial_ship.ship
    rest = fit.effects[:index] + fit.effects[index + 1 :]
    base = fitter.fitted(rest)
    lost = fit.score - base.score
    best: WrongNumber | None = None
    for key in doubtful(ship):
        if key in ship.tolerances.numbers or not ship.has_key(key):
            continue
        value, score = _fitted(fitter, base, rest, key, HOPELESS * lost)
        if fit.score - score < TELL_APART and (
            best is None or gain - fit.score + score > best.gain
        ):
            number = ship.number(key)
            brought = gain - (fit.score - score)
            best = WrongNumber(key, number.value, value, number.info.unit, brought)
    return best


def _fitted(
    fitter: Fitter, base: Fit, rest: tuple[Placed, ...], key: str, least: float
) -> tuple[float, float]:
    """Best value of a number beside some effects, and the score there, by steps of least squares."""
    host = fitter.trial_ship.host(rest)
    number = host.number(key)
    (low,), (high,) = Free(host, (key,)).bounds

    def record(value: float) -> object:
        plant = fitter.trial_ship.record(rest)
        number.write(plant, value)
        return plant

    value, fit = number.value, base
    for step in range(MOST_STEPS):
        size = STEP * abs(value) if value + STEP * abs(value) < high else -STEP * abs(value)
        column = fitter.predicted(record(value + size)) - fitter.predicted(record(value))
        if not np.isfinite(column).all():
            break
        share, _ = fitter.likelihood.amount(fit.weight, fit.difference, column)
        wanted = float(np.clip(value + share * size, low, high))
        found = fitter.scored(record(wanted), rest)
        gained = found.score - fit.score
        if gained > 0.0:
            value, fit = wanted, found
        if gained < SETTLED or (step == 0 and fit.score - base.score < least):
            break
    return value, fit.score
