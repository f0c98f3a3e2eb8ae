"""The verdict: whether the effects that were chosen hold, and whether more than noise is left.

It is given balance by balance first: what is sure in one is not thrown away for what is left in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..search.fitting import Fit
from ..search.selection import TELL_APART, Selection
from ..search.whiteness import Colour, Whiteness
from .findings import at_bound, implausible

EXPLAINED, PARTLY, NOTHING, UNEXPLAINED = (
    "explained", "partly-explained", "nothing-missing", "unexplained",
)  # fmt: skip
"""Verdicts."""

MOST_LEFT = 100.0
"""Times the noise's power, in the band where most is left, up to which a recording is explained: ten
times the noise's amplitude. Or else :data:`NEARLY_ALL` of the power beyond noise must be."""

NEARLY_ALL = 0.99
"""Share of the residual's power beyond the noise: a tenth of the difference's amplitude is left."""

EXPLAINED_SHARE = 0.8
"""Named effects must explain this share of the residual's power beyond the noise, where what is left is
more than noise; else they are not all of the truth."""

LOST_SHARE = 0.05
"""Share of the power beyond noise by which effects may add to it, which is measured no better. Effects
that add more explain nothing, however likely they make the rest."""

SURE_SHARE, SURE_GAIN = 0.5, 10.0
"""Where they do not, an effect still holds that explains this share of its own balance's power, and
whose gain is so many times its threshold."""

CLOSE_SHARE = 0.6
"""Share of the best name's gain from which the second comes near it."""


@dataclass(frozen=True)
class BalanceVerdict:
    """What was found in one balance.

    Args:
        name: of the balance.
        verdict: as of the whole, for this balance alone.
        explained: share of its residual's power beyond the noise that is explained; 1 where there was
            none.
        left: where what is left is more than noise; None where it is noise.
    """

    name: str
    verdict: str
    explained: float
    left: Colour | None


@dataclass(frozen=True)
class Verdict:
    """A verdict and what speaks for it.

    Args:
        name: :data:`EXPLAINED`, :data:`PARTLY`, :data:`NOTHING` or :data:`UNEXPLAINED`.
        explained: share of the residual's power beyond the noise that the effects explain.
        colour: where the residual without any effect is more than noise; None where it is noise.
        left_over: likewise of what the effects leave.
        balances: each for itself.
    """

    name: str
    explained: float
    colour: Colour | None
    left_over: Colour | None
    balances: tuple[BalanceVerdict, ...]


def too_little(excited: bool, limits: Sequence[str]) -> bool:
    """Whether recordings are too dull or too short to tell that nothing is missing.

    Args:
        excited: whether the demands move enough to tell effects apart.
        limits: why the recordings may not decide.
    """
    return bool(limits) and (not excited or any("too short" in said for said in limits))


def limited(name: str, undecidable: bool, biased: bool) -> str:
    """Return what a verdict comes to where the recordings or the ship file do not allow it.

    Args:
        name: of the verdict.
        undecidable: whether the recordings are too dull or too short.
        biased: whether a parameter lies far outside the ship file's tolerance.
    """
    if name == NOTHING and (undecidable or biased):
        return UNEXPLAINED
    return PARTLY if name == EXPLAINED and biased else name


def verdict_of(
    selection: Selection, whiteness: Whiteness, gain: float, excited: bool, sure: bool = False
) -> Verdict:
    """Judge what a search has chosen.

    Args:
        selection: what was chosen, confirmed.
        whiteness: of the residuals.
        gain: of the chosen effects in 2 log L, on the data set aside; minus infinity where the ship with
            them loses a channel there.
        excited: whether the demands move enough to tell effects apart.
        sure: whether each effect holds for itself, whatever else is left.
    """
    null, fit = whiteness.fitter.null, selection.fit
    colour, left_over = whiteness.colour(null), whiteness.colour(fit)
    explained = float(explained_shares(whiteness, null, fit)[-1])
    several = len(fit.effects) > 1 or any(selection.rivals) or close_call(selection)
    undecided = bool(fit.effects) and not excited and several
    helps = gain >= -TELL_APART and explained >= -LOST_SHARE
    holds = bool(fit.effects) and helps and not undecided
    whole = left_over is None or explained >= EXPLAINED_SHARE
    # a value at the bound of its search, or outside what is plausible: the truth lies elsewhere
    trial_ship = whiteness.fitter.trial_ship
    doubted = any(at_bound(trial_ship, p) or implausible(trial_ship, p) for p in fit.effects)
    if holds and whole and not doubted:
        name = EXPLAINED
    elif holds and (sure or whole):
        name = PARTLY
    else:
        # what was named does not hold, or nothing was: is there more than noise at all?
        more = colour is not None or undecided or (holds and not whole)
        name = UNEXPLAINED if more else NOTHING
    told = fit if name in (EXPLAINED, PARTLY) else null
    return Verdict(name, explained, colour, left_over, balance_verdicts(whiteness, told))


def far_from_noise(left_over: Colour | None, explained: float) -> bool:
    """Whether what effects leave is too far from noise for a recording to be explained.

    Args:
        left_over: where most is left; None where it is noise.
        explained: share of the power beyond noise that they explain.
    """
    return left_over is not None and left_over.ratio > MOST_LEFT and explained < NEARLY_ALL


def balance_verdicts(
    whiteness: Whiteness, fit: Fit, file: Whiteness | None = None
) -> tuple[BalanceVerdict, ...]:
    """Each balance for itself, under the model that is told.

    Args:
        whiteness: of the residuals.
        fit: the model.
        file: whiteness of the ship file's residuals, where the model's other parameters differ from it.
    """
    file = whiteness if file is None else file
    null = file.fitter.null
    shares = explained_shares(whiteness, null, fit, file)
    found = []
    for row, balance in enumerate(whiteness.fitter.balances.names):
        before, left = file.colour(null, row), whiteness.colour(fit, row)
        share = float(shares[row])
        if before is None and left is None:
            verdict, share = NOTHING, 1.0
        elif left is None or share >= EXPLAINED_SHARE:
            verdict = EXPLAINED
        elif share >= SURE_SHARE:
            verdict = PARTLY
        else:
            verdict = UNEXPLAINED
        found.append(BalanceVerdict(balance, verdict, share, left))
    return tuple(found)


def explained_shares(
    whiteness: Whiteness, null: Fit, fit: Fit, file: Whiteness | None = None
) -> np.ndarray:
    """Share of the residual's power beyond the noise that a model explains, where it is judged.

    Args:
        whiteness: of the model's residuals.
        null: what it is compared with.
        fit: the model.
        file: whiteness of what it is compared with, if it is another.

    Returns:
        Of each balance, and of all together last; shape (balances + 1,).
    """
    pairs = ((whiteness if file is None else file, null), (whiteness, fit))
    before, after = (np.maximum(w.ratios(f) - 1.0, 0.0).sum(axis=0) for w, f in pairs)
    before, after = np.append(before, before.sum()), np.append(after, after.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = 1.0 - after / before
    return np.where(before > 0.0, shares, np.where(after > 0.0, 0.0, 1.0))


def sure_effects(selection: Selection, rows: list[int], whiteness: Whiteness) -> list[int]:
    """Effects that hold for themselves, whatever else is left.

    Args:
        selection: what was chosen, confirmed.
        rows: balance in which each effect is shown, by index.
        whiteness: of the residuals.

    Returns:
        Their indices.
    """
    shares = explained_shares(whiteness, whiteness.fitter.null, selection.fit)
    told = zip(rows, selection.gains, selection.thresholds, strict=True)
    return [
        i for i, (row, gain, threshold) in enumerate(told)
        if shares[row] >= SURE_SHARE and gain >= SURE_GAIN * threshold
    ]  # fmt: skip


def close_call(selection: Selection) -> bool:
    """Whether a second name comes near the first."""
    gains = [c.gain for c in selection.ranking[:2]]
    return len(gains) == 2 and gains[1] > CLOSE_SHARE * gains[0]
