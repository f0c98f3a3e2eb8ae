"""Confirm the effects that a search has chosen, find alternatives, and choose the corrected ship.

The catalogue may identify an effect that only resembles the missing physics: a resistance with the cube
of the speed resembles fouling. Formulas are therefore tried in place of the effects where these leave
more than noise, where a free shape over one signal fits clearly better, or where the recording has
signals that no effect depends on. The corrected ship fits the held-out data at least as well as the
nominal ship.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.statistics import covariance_of
from ...plant.columns import HEADING, YAW_RATE
from ...plant.ship import Ship
from ..search.fitting import Fit, Fitter, Whiteness
from ..search.formulas import Formula, search_formula
from ..search.selection import (
    INDISTINGUISHABLE,
    NEAR_SHARE,
    Candidate,
    Selection,
    are_confusable,
    threshold,
)
from ..simulate.joint_replay import JointReplay
from .held_out import HeldOut, Segments, rms_errors
from .shapes import best_shapes
from .verdict import Verdict, balance_rows

REMNANT_SHARE, ELSEWHERE_SHARE, REMOTE_SHARE = 0.15, 0.08, 0.02
"""Least gain of a later effect as a share of a stronger effect's gain: in the same or a confusable
balance, in another balance, and on the other side of the propeller. A smaller gain may come from the
approximate form of the stronger effect."""

EDGES = 9
"""Number of times tried for the start or end of an episode within a held-out segment."""

DRIVE, WATER = {"engine", "motor", "pitch-actuator"}, {"hull"}
"""Balances on either side of the propeller."""

SENSOR = "sensor"
"""Balance of the instrument effects, which act on any other balance."""

NOT_INSTEAD = 0.1
"""Largest gain of effects beside a formula, as a share of that without it, where it replaces them."""

REFUTED = 0.6
"""Share of a formula's gain below which the gain of the effects refutes them."""

WORSE = 0.02
"""Relative increase of a channel's open-loop error on the held-out data that counts as equal."""

OF_NOISE = 0.1
"""Increase of the error up to which it counts as equal, in rms of the channel's noise."""

SAME = 1.0
"""Expected difference in 2 log L of two models below which they are the same on these recordings."""


def settle_episode_edges(
    selection: Selection, fitter: Fitter, held: Segments, judge: Callable[[Fit], float]
) -> Selection:
    """Estimate the start and end of episodes within held-out segments by the likelihood there.

    The fitted data do not determine them. ``judge`` returns 2 log L of a model on the held-out data.
    """
    fit = selection.fit
    for i, edge in itertools.product(range(len(fit.effects)), (0, 1)):
        if others := list(_vary_edge(fit, i, edge, fitter, held)):
            fit = max([fit, *others], key=judge)
    return replace(selection, fit=fit)


def _vary_edge(fit: Fit, which: int, edge: int, fitter: Fitter, held: Segments) -> Iterator[Fit]:
    """Yield models with other times of an episode's start (edge 0) or end (1) in a held-out segment."""
    sized, interval = fit.effects[which], fitter.balances.replay.interval_s
    if sized.window is None:
        return
    models = []
    for a, b in held:
        if a * interval < sized.window[edge] < b * interval:
            for time in interval * np.linspace(a, b, EDGES):
                begin, end = sized.window
                window = (float(time), end) if edge == 0 else (begin, float(time))
                if window[0] < window[1]:
                    shifted = replace(sized, window=window)
                    models.append(shifted.replace_in(fit.effects, which))
    yield from fitter.evaluate_models(models)


def drop_unconfirmed(
    selection: Selection, fitter: Fitter, judge: Callable[[Fit], float]
) -> Selection:
    """Drop effects that the recording cannot resolve, and later effects that are not confirmed.

    An effect that fits as well at the smallest resolvable size was not measured: in a closed loop the
    command depends on the instruments' noise, for which a delay of one row compensates. The form of the
    first effect is an approximation, so that further effects fit its residual; these do not fit the
    held-out data, on which ``judge`` returns 2 log L of a model.
    """
    fit = selection.fit
    keep = [i for i in range(len(fit.effects)) if _is_resolved(fitter, fit, i)]
    for i in reversed(keep[1:]):
        rest = [k for k in keep if k != i]
        needed = max((selection.gains[k] * _least_share(fit, i, k) for k in rest), default=0.0)
        if selection.gains[i] >= needed:
            with_it, without = (_refit(fitter, fit, which) for which in (keep, rest))
            if judge(with_it) >= judge(without):
                continue
        keep = rest
    if len(keep) == len(fit.effects):
        return selection
    return keep_effects(selection, fitter, keep)


def _is_resolved(fitter: Fitter, fit: Fit, which: int) -> bool:
    """Return whether an effect exceeds the resolution of the recording, and fits better than at it."""
    ship, sized = fitter.trial_ship, fit.effects[which]
    parameter, size = sized.effect.parameters[0], sized.values[0]
    neutral, least = ship.neutral(parameter), ship.resolution(parameter)
    if math.isinf(neutral) or least == 0.0:
        return True
    if abs(size - neutral) <= least:
        return False
    least = math.copysign(least, size - neutral)
    small = sized.with_values((neutral + least, *sized.values[1:]))
    smaller = fitter.evaluate(small.replace_in(fit.effects, which))
    return smaller.score < fit.score - INDISTINGUISHABLE


def _least_share(fit: Fit, later: int, other: int) -> float:
    """Return the least gain of a later effect as a share of another effect's gain."""
    one, two = fit.effects[later].effect, fit.effects[other].effect
    if one.balance == two.balance or are_confusable(one, two):
        return REMNANT_SHARE
    sides = ({one.balance}, {two.balance})
    apart = any(a <= DRIVE and b <= WATER for a, b in (sides, sides[::-1]))
    return REMOTE_SHARE if apart else ELSEWHERE_SHARE


def keep_effects(selection: Selection, fitter: Fitter, keep: list[int]) -> Selection:
    """Return a selection with the effects of some indices, fitted again."""
    fit, rivals = _refit(fitter, selection.fit, keep), tuple(selection.rivals[k] for k in keep)
    gains = tuple(selection.gains[k] for k in keep)
    thresholds = tuple(selection.thresholds[k] for k in keep)
    return replace(selection, fit=fit, gains=gains, thresholds=thresholds, rivals=rivals)


def _refit(fitter: Fitter, fit: Fit, which: list[int]) -> Fit:
    if len(which) == len(fit.effects):
        return fit
    rest = fitter.evaluate(tuple(fit.effects[k] for k in which))
    return fitter.refine_effects(rest) if rest.effects else rest


def add_rivals(selection: Selection, fitter: Fitter, explained: float) -> Selection:
    """Return the selection with the effects that fit as well in place of each of its effects.

    Where a model leaves a share of the power unexplained, its form is wrong by as much; an alternative
    whose gain is lower by less than this share is not refuted. A form with more values that predicts the
    same is no alternative.

    Args:
        selection: chosen effects; their rivals came close when each was chosen.
        fitter: fitter of the fitted data.
        explained: share of the residual's power beyond noise that the model explains.
    """
    fit, tried = selection.fit, max(len(selection.ranking), 1)
    rivals_of_effects = []
    for i, (gain, rivals) in enumerate(zip(selection.gains, selection.rivals, strict=True)):
        own = fit.effects[i].effect
        near = max(INDISTINGUISHABLE, (NEAR_SHARE + max(1.0 - explained, 0.0)) * gain)
        alike = []
        for rival in rivals:
            # A rival with fewer parameters has a lower threshold and may gain less by the difference.
            margin = near + threshold(own, tried) - threshold(rival.effect, tried)
            far = rival.gain < gain - 4.0 * margin and not are_confusable(own, rival.effect)
            if rival.effect.id == own.id or far:
                continue
            other = fitter.evaluate(rival.sized_effect.replace_in(fit.effects, i))
            if other.score < fit.score - margin:
                other = fitter.polish(other)
            more = len(rival.effect.parameters) > len(own.parameters)
            near_enough = other.score >= fit.score - margin
            if near_enough and not (more and _is_same_model(fitter, fit, other)):
                alike.append(Candidate(rival.effect, other, gain - fit.score + other.score))
        rivals_of_effects.append(tuple(sorted(alike, key=lambda c: -c.gain)))
    return replace(selection, rivals=tuple(rivals_of_effects))


def _is_same_model(fitter: Fitter, fit: Fit, other: Fit) -> bool:
    """Return whether two models predict the same, as a bend at speed 0 predicts viscous friction.

    A difference that the parameters within their tolerances make up for does not count.
    """
    here, there = (fitter.predict(fitter.trial_ship.record(one.effects)) for one in (fit, other))
    information = fitter.likelihood.information(fit.weight, (there - here)[None])
    if information[0, 0] < SAME:
        return True
    return float(covariance_of(information)[0, 0]) > 1.0 / SAME


def find_better_formula(
    selection: Selection, verdict: Verdict, whiteness: Whiteness, judge: HeldOut
) -> Formula | None:
    """Return the formula that fits the recordings clearly better than the effects; None without one."""
    fitter, fit = whiteness.fitter, selection.fit
    if not _is_doubtful(selection, verdict, whiteness):
        return None
    formula = search_formula(whiteness, fitter.null, judge, judge.rows)
    if formula is None:
        return None
    record = fitter.trial_ship.record
    held = judge(record(fit.effects)) - judge(record(()))
    ahead = formula.gain - formula.threshold - _gain(selection, whiteness)
    ahead += sum(selection.thresholds)
    clear = ahead > INDISTINGUISHABLE and formula.held_out > held
    if not clear or _adds_to_formula(formula, selection, whiteness):
        return None
    return replace(formula, better_than=tuple(p.effect.label for p in fit.effects), ahead=ahead)


def _is_doubtful(selection: Selection, verdict: Verdict, whiteness: Whiteness) -> bool:
    """Return whether there is a reason to try formulas in place of effects."""
    fitter = whiteness.fitter
    terms = [sized.effect.term for sized in selection.fit.effects]
    used = {name for term in terms if term is not None for name in term.external_signals}
    if verdict.left_over is not None or fitter.balances.replay.outside.keys() - used:
        return True
    rows = {fitter.balances.names[row] for row in balance_rows(fitter, selection.fit)}
    ahead = (s.gain - s.threshold for s in best_shapes(fitter, fitter.null) if s.balance in rows)
    return max(ahead, default=0.0) > _gain(selection, whiteness)


def _adds_to_formula(formula: Formula, selection: Selection, whiteness: Whiteness) -> bool:
    """Return whether effects still gain beside a formula, which then describes other physics."""
    fitter, effects = whiteness.fitter, selection.fit.effects
    alone, both = (
        fitter.evaluate_record(ship.with_term(formula.term).record()).score
        for ship in (fitter.trial_ship.ship, fitter.trial_ship.corrected(effects))
    )
    return both - alone > NOT_INSTEAD * _gain(selection, whiteness)


def refutes_effects(formula: Formula, selection: Selection, whiteness: Whiteness) -> bool:
    """Return whether a formula fits so much better than the effects that these are refuted.

    It refutes them if it depends on an external signal and gains much more, if it has fewer parts than
    there are effects, or if it acts in another balance. A formula of the ship's own signals in the same
    balance is another form of the same physics.
    """
    several = len(selection.fit.effects) > len(formula.blocks)
    balances = {sized.effect.balance for sized in selection.fit.effects}
    elsewhere = SENSOR not in balances and formula.balance not in balances
    outside = set(formula.signals) & whiteness.fitter.balances.replay.outside.keys()
    far = bool(outside) and _gain(selection, whiteness) < REFUTED * formula.gain
    return several or elsewhere or far


def _gain(selection: Selection, whiteness: Whiteness) -> float:
    return selection.fit.score - whiteness.fitter.null.score


def corrected_ship(
    nominal: Ship, candidates: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> tuple[Ship, float, list[str]]:
    """Return the first ship that is likelier than the nominal one without a larger error in a channel.

    Args:
        nominal: ship at the start of the diagnosis.
        candidates: corrected ships, the one with the most corrections first.
        judge: function that returns 2 log L of a ship's record on the held-out data.
        free: open-loop simulation errors there.

    Returns:
        The ship, or the nominal one; its gain in 2 log L; and the channels that the first candidate
        worsens.
    """
    spoilt: list[str] | None = None
    for ship, gain, worse in _compare(nominal, candidates, judge, free):
        spoilt = worse if spoilt is None else spoilt
        if gain > 0.0 and not worse:
            return ship, gain, spoilt
    return nominal, 0.0, spoilt or []


def is_any_confirmed(
    nominal: Ship, candidates: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> bool:
    """Return whether a ship is likelier than the nominal one, or as likely without a larger error.

    The complete missing physics would be likelier; an intermittent effect need not gain on the held-out
    data. The arguments are those of :func:`corrected_ship`.
    """
    return any(
        gain > INDISTINGUISHABLE or (gain > -INDISTINGUISHABLE and not worse)
        for _, gain, worse in _compare(nominal, candidates, judge, free)
    )


def _compare(
    nominal: Ship, ships: Iterable[Ship], judge: Callable[[Any], float], free: FreeRunning
) -> Iterator[tuple[Ship, float, list[str]]]:
    """Yield each ship with its gain in 2 log L and the channels that it worsens."""
    before, start = free.errors(nominal), judge(nominal.record())
    for ship in ships:
        yield ship, judge(ship.record()) - start, free.worse(free.errors(ship), before)


class FreeRunning:
    """Open-loop simulation errors of ships on the held-out rows of a replay.

    The heading is left out where the rate of turn is measured: it integrates the errors of the rate
    since the start, also those on the fitted data, and is right or wrong by chance.
    """

    def __init__(self, replay: JointReplay, rows: NDArray[np.int64]) -> None:
        self._replay, self._rows = replay, rows
        self._measured = dict(replay.recorded)
        if YAW_RATE in self._measured:
            self._measured.pop(HEADING, None)

    def errors(self, ship: Ship) -> dict[str, float]:
        """Return the rms error of each channel, in its unit."""
        return rms_errors(self._measured, self._replay.simulate_channels(ship.record()), self._rows)

    def worse(self, errors: Mapping[str, float], than: Mapping[str, float]) -> list[str]:
        """Return the channels with a larger error, or with a simulation that diverges."""
        noise = self._replay.noise_rms
        limits = {c: (1.0 + WORSE) * error + OF_NOISE * noise[c] for c, error in than.items()}
        return [c for c, limit in limits.items() if not errors[c] <= limit]


def uncorrected_remarks(spoilt: list[str]) -> list[str]:
    """Return the remark that the corrected ship lacks the effects, which spoil channels in open loop."""
    why = f"fits {', '.join(spoilt)} worse" if spoilt else "does not fit better"
    return [
        "the corrected ship is the nominal ship, because the ship with the identified effects, "
        f"simulated open loop, {why}"
    ]
