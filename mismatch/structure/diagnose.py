"""The verdict on a model of the structure search, and why a recording is explained in part only.

Diagnosis by the structure search: the chosen model, judged on held-out data.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ...plant.ship import Ship, ShipError
from ..diagnosis import Diagnosis
from ..estimate import Tick
from ..judge.findings import at_bound, detectable_effects, findings_of, implausible
from ..judge.held_out import HeldOut, Segments, bands_of, fits
from ..judge.shapes import best_shapes, shape_to_show
from ..judge.verdict import (
    EXPLAINED,
    NOTHING,
    PARTLY,
    UNEXPLAINED,
    balance_verdicts,
    explained_shares,
    too_little,
)
from ..recordings.joint import JointRecordings
from ..search.catalogue import Effect, Placed
from ..search.fitting import Fit, Fitter
from ..search.selection import Candidate, Selection
from ..search.whiteness import Whiteness
from ..setting import Setting
from ..simulate.balances import Balances
from ..simulate.joint_replay import JointReplay
from .choice import Ranked, choose, total
from .estimates import (
    biased_parameter,
    effect_estimates,
    parameter_estimates,
    plain_errors,
    remarks,
    replace_far_parameters,
)
from .model import Floats, Model
from .noise_model import MOST_ROWS, coarser, left_out
from .output_error import OutputError
from .search import StructureSearch

OF_NOISE = 2.0
"""Times the noise of every channel up to which a held-out error is noise."""


def noise_limit(problem: OutputError) -> Floats:
    """Return the rms error of each channel up to which it is noise, in the channels' units."""
    return OF_NOISE * np.array([problem.replay.noise_rms[c] for c in problem.names])


def within_noise(problem: OutputError, error: Floats) -> bool:
    """Return whether the rms error of every channel is noise."""
    return bool(np.all(error <= noise_limit(problem)))


def verdict_on(
    best: Ranked, problem: OutputError, whiteness: Whiteness, fit: Fit, gain: float
) -> tuple[str, list[str]]:
    """Return the verdict on a chosen model, and remarks on why it is explained in part only.

    Args:
        best: the model.
        problem: that fitted it.
        whiteness: of its residuals.
        fit: its effects as the balances have them.
        gain: of the corrected ship, without clock skews, on the held-out data in 2 log L.
    """
    quiet = within_noise(problem, best.held) or whiteness.colour(fit) is None
    far = problem.moved_far(best.model)
    if not best.model.effects:
        return (NOTHING if quiet and not far else UNEXPLAINED), []
    ship = problem.trial_ship
    limits = (limit(ship, placed) for placed in fit.effects for limit in (at_bound, implausible))
    reasons = [said for said in limits if said]
    if not quiet:
        reasons.append("more than noise is left on the held-out data")
    if far:
        reasons.append(
            f"{', '.join(problem.priors[k].key for k in far)} moved far from the ship file"
        )
    if gain < 0.0:
        reasons.append(
            "the corrected ship, which has no clock skews, is less likely on the held-out data than "
            f"the ship file by {-gain:.0f} in 2 log L"
        )
    if not reasons:
        return EXPLAINED, []
    return PARTLY, [f"explained in part only, because {'; '.join(reasons)}"]


CLOSER = 0.8
"""Share of the first diagnosis's held-out error that the model of this search must come below, as the
channels' geometric mean. Otherwise the first diagnosis stands: it knows effects that act for a time."""

AS_CLOSE = 1.05
"""The same where the first diagnosis does not explain the recording, of a model without effects; and of
any model where the first one is close by a shape or a formula beside its effects. Wrong parameters and
effects that come as close are preferred to what has no name."""

NO_CLOSER = (
    "effects and parameters were also estimated together, which came no closer to the held-out data"
)
"""Remark where the first diagnosis stands."""

NO_MODEL = (
    "effects and parameters were also estimated together: models of many values come closer to the "
    "held-out data, but no model whose effects all pay does"
)
"""Remark where the first diagnosis stands and is not the whole truth."""

BETTER = 0.95
"""Share of the held-out error of the ship without effects, its parameters refitted, that effects must
come below; otherwise the parameters alone are reported."""


def diagnose_structure(
    first: Diagnosis,
    setting: Setting,
    together: JointRecordings,
    effects: list[Effect],
    tick: Tick,
    tolerance: float = 1.0,
    most: int | None = None,
) -> Diagnosis:
    """Diagnose recordings with effects and parameters estimated together.

    Args:
        first: diagnosis by the search that holds the parameters within their tolerances.
        setting: how the recordings are looked at.
        together: the recordings.
        effects: candidates.
        tick: called with the stage, how much is done, and how much there is.
        tolerance: factor on the tolerances of the ship's parameters.
        most: effects that are reported, at most.

    Returns:
        The diagnosis; the first one, with a remark, where it leaves noise or is as close to the held-out
        data.
    """
    if first.left_over is None and not any(n.is_biased for n in first.numbers):
        return first
    replay = coarser(setting.balances.replay, MOST_ROWS)
    if why := left_out(replay):
        return _with_remark(first, f"effects and parameters were not estimated together: {why}")
    fitted, held_out, highest = setting.segments, setting.held, setting.fitter.bands.highest_Hz
    problem = OutputError(Balances(replay), fitted, held_out, tolerance, highest)
    residual = min(
        (held_residual(ship, replay, fitted, held_out) for ship in _corrected(first)),
        key=lambda one: float(np.sum(np.log(problem.likelihood.rms(one)))),
    )
    before = problem.likelihood.rms(residual)
    if within_noise(problem, before) and first.verdict in (EXPLAINED, NOTHING):
        return first
    search = StructureSearch(problem, effects, tick, most, _effects_of(first))
    alone = CLOSER if first.verdict == EXPLAINED else AS_CLOSE
    named = AS_CLOSE if first.verdict == PARTLY and first.shape is not None else CLOSER
    if all(
        total(problem.held_error(quick), before) > (named if quick.effects else alone)
        for quick in search.quick_pass()
    ):
        return _with_remark(first, NO_CLOSER)
    ranked = search.search()
    clipped = problem.likelihood.rms(residual, search.limit)

    def closer(one: Ranked) -> bool:
        """Whether a model is closer to the held-out data, with or without their outliers."""
        error = min(total(one.held, before), total(one.compared, clipped))
        return error <= (named if one.model.effects else alone)

    best, alike = choose(ranked, problem.held_error(problem.file_model()), noise_limit(problem))
    if (pruned := search.pruned(best)) is not best:
        best, alike = pruned, []
    plain = next(one for one in ranked if not one.model.effects)
    if best.model.effects and total(best.held, plain.held) > BETTER:
        best, alike = plain, []
    if not closer(best):
        return _doubted(first)
    model, replaced = replace_far_parameters(search, best.model)
    if replaced:
        best, alike = search.ranked(model), []
    found = _diagnosed(first, search, setting, together, best, alike, ranked)
    wrong = [biased_parameter(first.ship, replaced, finding) for finding in found.findings]
    return replace(found, wrong=wrong)


def _corrected(first: Diagnosis) -> list[Ship]:
    """Return the corrected ship of a diagnosis, and the ship with a formula in place of its effects."""
    if first.formula is None:
        return [first.corrected]
    return [first.corrected, first.ship.with_term(first.formula.term)]


def held_residual(ship: Ship, replay: JointReplay, fitted: Segments, held: Segments) -> Floats:
    """Return measured minus simulated channels of a ship on the held-out rows."""
    problem = OutputError(Balances(replay.with_ship(ship)), fitted, held, 0.0)
    return problem.held_residual(problem.file_model())


def _doubted(first: Diagnosis) -> Diagnosis:
    """Return a diagnosis that stands although richer models are closer: explained in part at most."""
    verdict = PARTLY if first.verdict == EXPLAINED else first.verdict
    return _with_remark(replace(first, verdict=verdict), NO_MODEL)


def _with_remark(first: Diagnosis, remark: str) -> Diagnosis:
    """Return a diagnosis with one more remark."""
    return replace(first, warnings=[*first.warnings, remark])


def _effects_of(first: Diagnosis) -> tuple[Placed, ...]:
    """Return the effects of a diagnosis with their values, except those that act for a time."""
    return tuple(
        Placed(finding.effect, tuple(estimate.value for estimate in finding.estimates))
        for finding in first.findings
        if not finding.effect.windowed
    )


def _diagnosed(
    first: Diagnosis,
    search: StructureSearch,
    setting: Setting,
    together: JointRecordings,
    best: Ranked,
    alike: list[Ranked],
    ranked: list[Ranked],
) -> Diagnosis:
    """Return the first diagnosis with what a chosen model changes in it.

    Args:
        first: diagnosis by the other search.
        search: search that found the model.
        setting: how the recordings are looked at.
        together: the recordings.
        best: the chosen model.
        alike: models that the recordings cannot distinguish from it.
        ranked: all models.
    """
    problem, model, replay = search.problem, best.model, setting.balances.replay
    ship = _with_parameters(first.ship, problem, model)
    tables = _in_time(together.tables, problem, model)
    balances = Balances(replay.with_ship(ship, *tables))
    bands = bands_of(balances, setting.segments, setting.fitter.bands.highest_Hz)
    fitter = Fitter(balances, bands, problem.tolerance)
    fit = fitter.fitted(model.effects)
    whiteness = Whiteness(fitter, replay.noise_rms, replay.quantisation)
    corrected = fitter.trial_ship.corrected(fit.effects)
    judge = HeldOut(setting.fitter, setting.held)
    gain = float(judge(corrected.record()) - judge(first.ship.record()))
    verdict, why = verdict_on(best, problem, whiteness, fit, gain)
    if verdict == NOTHING and too_little(replay.excited, together.limits):
        verdict = UNEXPLAINED
    colour = whiteness.colour(fit)
    shape = None
    if verdict == UNEXPLAINED and colour is not None:
        shape = shape_to_show(best_shapes(fitter, fit), balances, colour)
    selection = _selection(fitter, fit, best, alike, ranked, search)
    findings = findings_of(fitter, selection, balances.lacking(balances.nominal))
    findings = [
        replace(finding, estimates=estimates)
        for finding, estimates in zip(
            findings, effect_estimates(problem, model, fitter), strict=True
        )
    ]
    after = dict(zip(problem.names, problem.simulate(model), strict=True))
    shares = explained_shares(whiteness, setting.fitter.null, fit, setting.whiteness)
    return replace(
        first,
        verdict=verdict,
        corrected=corrected,
        after=after,
        residual_after=setting.balances.lacking(after),
        findings=findings,
        shape=shape,
        shape_windows=[],
        shape_regime="",
        formula=None,
        balance_verdicts=balance_verdicts(whiteness, fit, setting.whiteness),
        explained=float(shares[-1]),
        left_over=colour,
        ranking=[(c, search.threshold(c.effect)) for c in selection.ranking],
        detectable=detectable_effects(
            fitter, search.threshold, fit, [c.effect for c in selection.ranking]
        ),
        fit_after=fits(first.measured, after, problem.held_rows),
        held_out_gain=gain,
        warnings=[
            *together.warnings,
            *why,
            *remarks(best, problem),
            *plain_errors(problem, best, corrected),
        ],
        numbers=parameter_estimates(first.ship, problem, model, corrected),
    )


def _in_time(
    tables: Sequence[pd.DataFrame], problem: OutputError, model: Model
) -> list[pd.DataFrame]:
    """Return recordings with the measured channels moved onto the commands' clock."""
    skews = model.nuisance[len(problem.starts) :] * problem.replay.every  # rows as recorded
    moved = []
    for table in tables:
        rows = np.arange(len(table))
        pairs = zip(problem.names, skews, strict=True)
        on_time = {c: np.interp(rows - skew, rows, table[c]) for c, skew in pairs if c in table}
        moved.append(table.assign(**on_time))
    return moved


def _with_parameters(file: Ship, problem: OutputError, model: Model) -> Ship:
    """Return the ship with the parameters that a model has shifted."""
    values = {}
    for prior, shift in zip(problem.priors, model.shifts, strict=True):
        if abs(shift) > 0.1 * prior.near:
            number = file.number(prior.key)
            value = float(np.clip(prior.value_at(float(shift)), *number.searched))
            values[prior.key] = number.info.inside(value)
    with contextlib.suppress(ShipError):  # two parameters that do not go together
        return file.with_values(values) if values else file
    return file


def _selection(
    fitter: Fitter,
    fit: Fit,
    best: Ranked,
    alike: list[Ranked],
    ranked: list[Ranked],
    search: StructureSearch,
) -> Selection:
    """Return a model as the other search has it: each effect's gain, threshold and rivals."""
    labels = best.model.labels
    gains, rivals = [], []
    for placed in best.model.effects:
        rest = tuple(p for p in best.model.effects if p is not placed)
        gains.append(best.model.score - search.problem.fit(rest, best.model).score)
        instead = []
        for one in alike:
            other = [p for p in one.model.effects if p.effect.label not in labels]
            shared = labels & one.model.labels
            if len(other) == 1 and shared == labels - {placed.effect.label}:
                instead.append(_candidate(fitter, other[0].effect, one))
        rivals.append(tuple(instead))
    singles = [one for one in ranked if len(one.model.effects) == 1]
    return Selection(
        fit,
        tuple(gains),
        tuple(search.threshold(placed.effect) for placed in best.model.effects),
        tuple(rivals),
        tuple(_candidate(fitter, one.model.effects[0].effect, one) for one in singles),
    )


def _candidate(fitter: Fitter, effect: Effect, one: Ranked) -> Candidate:
    """Return an effect of another model with that model's merit."""
    placed = next(p for p in one.model.effects if p.effect is effect)
    return Candidate(effect, replace(fitter.null, effects=(placed,)), one.merit)
