"""A formula in place of names that are near the truth and not it.

A catalogue names what is nearest: a resistance with the cube of the speed is fouling to it. Where what
is named leaves more than noise, or a free shape over one signal does clearly better, or the recording
has signals that no name hears, formulas are tried in its place.
"""

from __future__ import annotations

from dataclasses import replace

from ..search.formulas import Formula, formula_of
from ..search.selection import TELL_APART, Selection
from .findings import shown_in
from .held_out import HeldOut
from .shapes import best_shapes
from .verdict import Verdict
from .whiteness import Whiteness

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
