"""What speaks against the effects that a search has chosen, and what would have done as well.

A formula in place of names that are near the truth and not it.

A catalogue names what is nearest: a resistance with the cube of the speed is fouling to it. Where what
is named leaves more than noise, or a free shape over one signal does clearly better, or the recording
has signals that no name hears, formulas are tried in its place.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..search.fitting import Fit, Fitter
from ..search.formulas import Formula, formula_of
from ..search.selection import (
    NEAR_SHARE,
    TELL_APART,
    Candidate,
    Selection,
    confusable,
    threshold,
)
from ..search.whiteness import Whiteness
from .findings import shown_in
from .held_out import HeldOut
from .shapes import best_shapes
from .verdict import Verdict

REMNANT_SHARE, ELSEWHERE_SHARE, REMOTE_SHARE = 0.15, 0.08, 0.02
"""A later effect must bring this share of a stronger one's gain: in the same balance or one that it may
be taken for, elsewhere, and where the propeller lies between them. Less is what the stronger one's form,
never quite the truth's, leaves."""

EDGES = 9
"""Times in a stretch set aside at which an episode that begins or ends in it is tried."""

DRIVE, WATER = {"engine", "motor", "pitch-actuator"}, {"hull"}
"""Balances on either side of the propeller."""


def confirmed(selection: Selection, fitter: Fitter, judge: Callable[[Fit], float]) -> Selection:
    """Drop what the recording cannot resolve, and every later effect that the data set aside speak
    against or that looks like a remnant.

    An effect that would do as well at the least size that can be told from none is nothing that was
    measured: in a closed loop the demand answers to the instruments' noise, and a delay of one row takes
    that back. The first effect's form is never quite the truth's; what it leaves invites other names,
    which do not hold on data that they were not fitted to.

    Args:
        selection: what was chosen.
        fitter: of the part that was fitted.
        judge: 2 log L of a model on the data set aside.
    """
    fit = selection.fit
    keep = [i for i in range(len(fit.effects)) if _resolved(fitter, fit, i)]
    for i in reversed(keep[1:]):
        rest = [k for k in keep if k != i]
        needed = max((selection.gains[k] * _share(fit, i, k) for k in rest), default=0.0)
        if selection.gains[i] >= needed:
            with_it, without = (_refitted(fitter, fit, which) for which in (keep, rest))
            if judge(with_it) >= judge(without):
                continue
        keep = rest
    if len(keep) == len(fit.effects):
        return selection
    return only(selection, fitter, keep)


def _resolved(fitter: Fitter, fit: Fit, which: int) -> bool:
    """Whether an effect is larger than what the recording resolves, and fits better than there."""
    ship, placed = fitter.trial_ship, fit.effects[which]
    parameter, size = placed.effect.parameters[0], placed.values[0]
    neutral, least = ship.neutral(parameter), ship.resolution(parameter)
    if math.isinf(neutral) or least == 0.0:
        return True
    if abs(size - neutral) <= least:
        return False
    least = math.copysign(least, size - neutral)
    small = placed.with_values((neutral + least, *placed.values[1:]))
    other = fitter.fitted(small.in_place_of(fit.effects, which))
    return other.score < fit.score - TELL_APART


def settled_edges(
    selection: Selection,
    fitter: Fitter,
    held: Sequence[tuple[int, int]],
    judge: Callable[[Fit], float],
) -> Selection:
    """The selection with the edges of episodes that lie in data set aside where these have them.

    Nothing that was fitted tells where in such a stretch an episode begins or ends.

    Args:
        selection: what was chosen.
        fitter: of the part that was fitted.
        held: first row of each stretch that is set aside, and one past its last.
        judge: 2 log L of a model on the data set aside.
    """
    fit = selection.fit
    for i, edge in itertools.product(range(len(fit.effects)), (0, 1)):
        if others := list(_with_other_edges(fit, i, edge, fitter, held)):
            fit = max([fit, *others], key=judge)
    return replace(selection, fit=fit)


def _with_other_edges(
    fit: Fit, which: int, edge: int, fitter: Fitter, held: Sequence[tuple[int, int]]
) -> Iterator[Fit]:
    """A model whose episode begins (edge 0) or ends (1) elsewhere in the stretch in which it does."""
    placed, interval = fit.effects[which], fitter.balances.replay.interval_s
    if placed.window is None:
        return
    for a, b in held:
        if a * interval < placed.window[edge] < b * interval:
            for time in interval * np.linspace(a, b, EDGES):
                begin, end = placed.window
                window = (float(time), end) if edge == 0 else (begin, float(time))
                if window[0] < window[1]:
                    moved = replace(placed, window=window)
                    yield fitter.fitted(moved.in_place_of(fit.effects, which))


def only(selection: Selection, fitter: Fitter, keep: list[int]) -> Selection:
    """Some of the effects of a selection, fitted again.

    Args:
        selection: what was chosen.
        fitter: of the part that was fitted.
        keep: which of them.
    """
    return replace(
        selection, fit=_refitted(fitter, selection.fit, keep),
        gains=tuple(selection.gains[k] for k in keep),
        thresholds=tuple(selection.thresholds[k] for k in keep),
        rivals=tuple(selection.rivals[k] for k in keep),
    )  # fmt: skip


def _share(fit: Fit, later: int, other: int) -> float:
    """Of the other's gain that a later effect must bring."""
    one, two = fit.effects[later].effect, fit.effects[other].effect
    if one.balance == two.balance or confusable(one, two):
        return REMNANT_SHARE
    sides = ({one.balance}, {two.balance})
    apart = any(a <= DRIVE and b <= WATER for a, b in (sides, sides[::-1]))
    return REMOTE_SHARE if apart else ELSEWHERE_SHARE


def _refitted(fitter: Fitter, fit: Fit, which: list[int]) -> Fit:
    if len(which) == len(fit.effects):
        return fit
    rest = fitter.fitted(tuple(fit.effects[k] for k in which))
    return fitter.joint(rest) if rest.effects else rest


def with_rivals(selection: Selection, fitter: Fitter, explained: float) -> Selection:
    """The selection with what would have done as well as each effect, the others present.

    Where a model leaves a share of what it should explain, its form is off by as much, and a rival that
    is behind by less than that share of the gain is not refuted.

    Args:
        selection: what was chosen; its rivals are what came near each effect when it was chosen.
        fitter: of the part that was fitted.
        explained: share of the residual's power beyond the noise that the model explains.
    """
    fit, tried = selection.fit, max(len(selection.ranking), 1)
    found = []
    for i, (gain, rivals) in enumerate(zip(selection.gains, selection.rivals, strict=True)):
        own = fit.effects[i].effect
        near = max(TELL_APART, (NEAR_SHARE + max(1.0 - explained, 0.0)) * gain)
        alike = []
        for rival in rivals:
            # a rival of fewer parameters may gain less by what each must bring
            margin = near + threshold(own, tried) - threshold(rival.effect, tried)
            far = rival.gain < gain - 4.0 * margin and not confusable(own, rival.effect)
            if rival.effect.id == own.id or far:
                continue
            instead = fitter.fitted(rival.placed.in_place_of(fit.effects, i))
            if instead.score < fit.score - margin:
                instead = fitter.polished(instead)
            if instead.score >= fit.score - margin:
                alike.append(Candidate(rival.effect, instead, gain - fit.score + instead.score))
        found.append(tuple(sorted(alike, key=lambda c: -c.gain)))
    return replace(selection, rivals=tuple(found))


SENSOR = "sensor"
"""Where an instrument errs, which shows in any balance."""

NOT_INSTEAD = 0.1
"""Share of their gain that names may still bring on top of a formula that stands in their place."""

REFUTED = 0.6
"""Share of a formula's gain below which names that it does better than are not near the truth either."""


def formula_instead(
    selection: Selection, verdict: Verdict, whiteness: Whiteness, judge: HeldOut
) -> Formula | None:
    """The formula that follows the recordings clearly better than names do; None where none does.

    Args:
        selection: the names.
        verdict: on them.
        whiteness: of the residuals on the part that is fitted.
        judge: of the data set aside.
    """
    fitter, fit = whiteness.fitter, selection.fit
    if not _doubtful(selection, verdict, whiteness):
        return None
    formula = formula_of(whiteness, fitter.null, judge, judge.rows)
    if formula is None:
        return None
    record = fitter.trial_ship.record
    held = judge(record(fit.effects)) - judge(record(()))
    ahead = formula.gain - formula.threshold - _gain(selection, whiteness)
    ahead += sum(selection.thresholds)
    if ahead <= TELL_APART or formula.held_out <= held or _beside(formula, selection, whiteness):
        return None
    return replace(formula, better_than=tuple(p.effect.label for p in fit.effects), ahead=ahead)


def refuted(formula: Formula, selection: Selection, whiteness: Whiteness) -> bool:
    """Whether a formula does so much better than names that these are not near the truth.

    By a signal from outside, which makes the greater difference; or with less, one piece of physics
    instead of several; or in another balance than all of them. What does better by the ship's own
    signals alone is another form of what was named.
    """
    effects = [placed.effect for placed in selection.fit.effects]
    several = len(effects) > len(formula.blocks)
    balances = {effect.balance for effect in effects}
    elsewhere = SENSOR not in balances and formula.balance not in balances
    outside = set(formula.signals) & whiteness.fitter.balances.replay.outside.keys()
    far = bool(outside) and _gain(selection, whiteness) < REFUTED * formula.gain
    return several or elsewhere or far


def _beside(formula: Formula, selection: Selection, whiteness: Whiteness) -> bool:
    """Whether names still gain on top of a formula: it then tells of something else."""
    fitter, effects = whiteness.fitter, selection.fit.effects
    alone, both = (
        fitter.scored(ship.with_term(formula.term).record()).score
        for ship in (fitter.trial_ship.ship, fitter.trial_ship.corrected(effects))
    )
    return both - alone > NOT_INSTEAD * _gain(selection, whiteness)


def _gain(selection: Selection, whiteness: Whiteness) -> float:
    return selection.fit.score - whiteness.fitter.null.score


def _doubtful(selection: Selection, verdict: Verdict, whiteness: Whiteness) -> bool:
    """Whether there is any reason to try formulas in place of names."""
    fitter = whiteness.fitter
    terms = [placed.effect.term for placed in selection.fit.effects]
    heard = {name for term in terms if term is not None for name in term.hears}
    if verdict.left_over is not None or fitter.balances.replay.outside.keys() - heard:
        return True
    rows = {fitter.balances.names[row] for row in shown_in(fitter, selection.fit)}
    ahead = (s.gain - s.threshold for s in best_shapes(fitter, fitter.null) if s.balance in rows)
    return max(ahead, default=0.0) > _gain(selection, whiteness)
