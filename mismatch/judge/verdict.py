"""The verdict: whether the chosen effects hold, and whether the residual is noise.

Each balance has a verdict of its own, so that a sure effect in one balance is reported although another
balance has a residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..search.fitting import Fit
from ..search.selection import INDISTINGUISHABLE, Selection
from ..search.whiteness import Colour, Whiteness
from .findings import implausible_parameter, parameter_at_bound

EXPLAINED, PARTLY, NOTHING, UNEXPLAINED = (
    "explained", "partly-explained", "nothing-missing", "unexplained",
)  # fmt: skip
"""Verdicts."""

MOST_LEFT = 100.0
"""Largest ratio of residual to noise power of an explained recording, in the band where it is largest:
ten times the noise's amplitude. A larger ratio is allowed if :data:`NEARLY_ALL` is explained."""

NEARLY_ALL = 0.99
"""Explained share of the power beyond noise at which a tenth of the difference's amplitude remains."""

EXPLAINED_SHARE = 0.8
"""Least share of the power beyond noise that effects must explain if the residual is more than noise."""

LOST_SHARE = 0.05
"""Share by which effects may increase the power beyond noise, which is not measured more accurately.
Effects that increase it by more explain nothing."""

SURE_SHARE, SURE_GAIN = 0.5, 10.0
"""Explained share of its own balance's power, and gain as a multiple of its threshold, from which an
effect holds although other physics is missing."""

CLOSE_SHARE = 0.6
"""Share of the best effect's gain from which the second best is close to it."""


@dataclass(frozen=True)
class BalanceVerdict:
    """Verdict on one balance.

    Args:
        name: name of the balance.
        verdict: verdict on this balance alone.
        explained: explained share of its residual's power beyond noise; 1 if there was none.
        left: frequency band in which its residual exceeds noise; None if it is noise.
    """

    name: str
    verdict: str
    explained: float
    left: Colour | None


@dataclass(frozen=True)
class Verdict:
    """Verdict on recordings with its reasons.

    Args:
        name: :data:`EXPLAINED`, :data:`PARTLY`, :data:`NOTHING` or :data:`UNEXPLAINED`.
        explained: share of the residual's power beyond noise that the effects explain.
        colour: frequency band in which the residual without effects exceeds noise; None if it is noise.
        left_over: frequency band in which the residual with the effects exceeds noise, likewise.
        balances: verdict on each balance.
    """

    name: str
    explained: float
    colour: Colour | None
    left_over: Colour | None
    balances: tuple[BalanceVerdict, ...]


def is_undecidable(excited: bool, limits: Sequence[str]) -> bool:
    """Return whether recordings are too short, or excite too little, for the verdict nothing-missing.

    Args:
        excited: whether the commands move enough to distinguish effects.
        limits: limits of the recordings, a sentence each.

    >>> is_undecidable(False, ["the commands are constant"]), is_undecidable(True, [])
    (True, False)
    """
    return bool(limits) and (not excited or any("too short" in said for said in limits))


def limit_verdict(name: str, undecidable: bool, biased: bool) -> str:
    """Return the verdict that the recordings and the parameters allow.

    Args:
        name: name of the verdict on the effects.
        undecidable: whether the recordings are too short or excite too little.
        biased: whether a parameter lies far outside the ship file's tolerance.

    >>> limit_verdict("explained", False, biased=True)
    'partly-explained'
    """
    if name == NOTHING and (undecidable or biased):
        return UNEXPLAINED
    return PARTLY if name == EXPLAINED and biased else name


def judge_selection(
    selection: Selection, whiteness: Whiteness, gain: float, excited: bool, sure: bool = False
) -> Verdict:
    """Return the verdict on the effects that a search has chosen.

    Args:
        selection: chosen and confirmed effects.
        whiteness: whiteness test of the residuals.
        gain: gain of the effects in 2 log L on the held-out data; minus infinity if the ship with them
            loses a channel there.
        excited: whether the commands move enough to distinguish effects.
        sure: whether each effect holds independently of the residual.
    """
    null, fit = whiteness.fitter.null, selection.fit
    colour, left_over = whiteness.colour(null), whiteness.colour(fit)
    explained = float(explained_shares(whiteness, null, fit)[-1])
    several = len(fit.effects) > 1 or any(selection.rivals) or is_close_call(selection)
    undecided = bool(fit.effects) and not excited and several
    helps = gain >= -INDISTINGUISHABLE and explained >= -LOST_SHARE
    holds = bool(fit.effects) and helps and not undecided
    whole = left_over is None or explained >= EXPLAINED_SHARE
    # A value at a bound or outside its plausible range indicates another cause.
    trial_ship = whiteness.fitter.trial_ship
    doubted = any(
        parameter_at_bound(trial_ship, p) or implausible_parameter(trial_ship, p)
        for p in fit.effects
    )
    if holds and whole and not doubted:
        name = EXPLAINED
    elif holds and (sure or whole):
        name = PARTLY
    else:
        # No effect holds: nothing is missing only if the residual is noise.
        more = colour is not None or undecided or (holds and not whole)
        name = UNEXPLAINED if more else NOTHING
    reported = fit if name in (EXPLAINED, PARTLY) else null
    return Verdict(name, explained, colour, left_over, balance_verdicts(whiteness, reported))


def is_far_from_noise(left_over: Colour | None, explained: float) -> bool:
    """Return whether the residual is too far from noise for the verdict explained.

    Args:
        left_over: frequency band with the largest residual; None if it is noise.
        explained: explained share of the power beyond noise.
    """
    return left_over is not None and left_over.ratio > MOST_LEFT and explained < NEARLY_ALL


def balance_verdicts(
    whiteness: Whiteness, fit: Fit, file: Whiteness | None = None
) -> tuple[BalanceVerdict, ...]:
    """Return the verdict on each balance with the reported model.

    Args:
        whiteness: whiteness test of the residuals.
        fit: reported model.
        file: whiteness test of the ship file's residuals, if the model has other parameters.
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
    whiteness: Whiteness, without: Fit, fit: Fit, file: Whiteness | None = None
) -> np.ndarray:
    """Return the share of the residual's power beyond noise that a model explains.

    Args:
        whiteness: whiteness test of the model's residuals.
        without: model without effects, to which the model is compared.
        fit: the model.
        file: whiteness test of the model of comparison, if it has other parameters.

    Returns:
        Share in each balance, and in all balances together last, shape (balances + 1,).
    """
    pairs = ((whiteness if file is None else file, without), (whiteness, fit))
    before, after = (np.maximum(w.ratios(f) - 1.0, 0.0).sum(axis=0) for w, f in pairs)
    before, after = np.append(before, before.sum()), np.append(after, after.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = 1.0 - after / before
    return np.where(before > 0.0, shares, np.where(after > 0.0, 0.0, 1.0))


def sure_effects(selection: Selection, rows: list[int], whiteness: Whiteness) -> list[int]:
    """Return the indices of effects that hold although other physics is missing.

    Args:
        selection: chosen and confirmed effects.
        rows: row of each effect's balance.
        whiteness: whiteness test of the residuals.
    """
    shares = explained_shares(whiteness, whiteness.fitter.null, selection.fit)
    effects = zip(rows, selection.gains, selection.thresholds, strict=True)
    return [
        i for i, (row, gain, threshold) in enumerate(effects)
        if shares[row] >= SURE_SHARE and gain >= SURE_GAIN * threshold
    ]  # fmt: skip


def is_close_call(selection: Selection) -> bool:
    """Return whether the gain of the second best effect is close to that of the best."""
    gains = [c.gain for c in selection.ranking[:2]]
    return len(gains) == 2 and gains[1] > CLOSE_SHARE * gains[0]
