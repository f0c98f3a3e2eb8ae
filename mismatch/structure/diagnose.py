"""Diagnose recordings by the structure search, and judge the chosen model on the held-out data.

A parameter far from the ship file and an effect may be indistinguishable: fouling acts like a resistance
that is too low in the file. Where a parameter lies beyond its tolerance, an effect is therefore searched
that fits as well with the parameter near the file. If there is one, the report gives the effect, and the
biased parameter as an alternative.

An identification uses the search as well: the change of its estimates by missing physics is added to
their uncertainty as model error.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ...plant.ship import Ship, ShipError
from ..diagnosis import Diagnosis
from ..estimate import Estimate, Tick
from ..identification.parameters import REPORTED, BiasedParameter, MethodResult, ParameterChange
from ..judge.held_out import HeldOut, Segments, bands_of, fit_percents
from ..judge.shapes import best_shapes, shape_to_show
from ..judge.verdict import (
    EXPLAINED,
    FORM_SHARE,
    NOTHING,
    PARTLY,
    UNEXPLAINED,
    Finding,
    balance_verdicts,
    doubts,
    explained_shares,
    findings_of,
    is_undecidable,
    open_models,
)
from ..recordings.joint import JointRecordings
from ..search.catalogue import Effect, SizedEffect
from ..search.fitting import Fit, Fitter, Whiteness, estimates_of
from ..search.selection import INDISTINGUISHABLE, Candidate, Selection
from ..setting import Setting
from ..simulate.balances import Balances, RunawayError
from ..simulate.joint_replay import Floats, JointReplay
from .model import MOST_SKEW, Model, Prior, guessed_prior
from .noise_model import MOST_ROWS, coarser, reason_to_skip
from .output_error import OutputError
from .search import Ranked, StructureSearch, choose, parameters_alone, total

PLAUSIBLE = math.log(1.5)
"""Logarithm of the largest factor by which physics changes a parameter; beyond, the file is wrong."""

TRIED = 5
"""Number of effects tried in place of a parameter, those with the largest predicted gain."""

REPORTED_SKEW, SURE_SKEW = 0.1, 3.0
"""Smallest clock skew of a channel that is reported, in rows and in standard errors."""

NOTABLE = 1.1
"""Multiple of the held-out error from which that of the file without clock skews is reported too."""

LOOSE = 0.3
"""Standard error of a parameter's logarithm from which only its combination with others is known."""

NEARLY_BEST = 1.1
"""Multiple of the least held-out error up to which a model with fewer values is preferred."""

OF_NOISE = 2.0
"""Multiple of a channel's noise up to which its held-out error counts as noise."""

CLOSER = 0.8
"""Largest held-out error of a model as a share of that of the first diagnosis (geometric mean of the
channels). Otherwise the first diagnosis stands, which includes effects that act for a limited time."""

AS_CLOSE = 1.05
"""The same share for a model without effects where the first diagnosis does not explain the recording,
and for any model where the first diagnosis uses a shape, or a formula since a reference period:
parameters and effects that fit as well are preferred."""

NO_CLOSER = "effects and parameters were also estimated together; the held-out data fit no better"
"""Remark where the first diagnosis stands."""

NO_BASE = (
    "effects and parameters were also estimated together: the likeliest model is not used, because the "
    "ship with its parameters cannot be simulated without its effects"
)
NO_MODEL = (
    "effects and parameters were also estimated together: models with many values fit the held-out data "
    "better, but no model all of whose effects are significant does"
)
"""Remark where the first diagnosis stands although it is incomplete."""


def diagnose_structure(
    first: Diagnosis,
    setting: Setting,
    together: JointRecordings,
    effects: list[Effect],
    tick: Tick,
    tolerance: float = 1.0,
    most: int | None = None,
    calibrated: Collection[str] = (),
) -> Diagnosis:
    """Diagnose recordings with effects and parameters estimated together.

    Args:
        first: diagnosis by the search that holds the parameters within their tolerances.
        setting: interpolation, frequency range and split of the recordings.
        together: recordings.
        effects: candidate effects.
        tick: progress callback ``tick(stage, done, total)``.
        tolerance: factor on the tolerances of the ship's parameters [-].
        most: largest number of reported effects; None for the default.
        calibrated: keys of parameters that were estimated from a reference period. They were right
            there, so that a change beyond their tolerances is physics and no wrong file.

    Returns:
        The diagnosis; the first one, with a remark, if it leaves noise or fits the held-out data as
        well.
    """
    if first.left_over is None and not any(n.is_biased for n in first.parameters):
        return first
    replay = coarser(setting.balances.replay, MOST_ROWS)
    if why := reason_to_skip(replay):
        return _add_remark(first, f"effects and parameters were not estimated together: {why}")
    split, highest = (setting.segments, setting.held), setting.fitter.bands.highest_Hz
    problem = OutputError(Balances(replay), *split, tolerance, highest)
    problem.hold(k for k, prior in enumerate(problem.priors) if prior.key in calibrated)
    rms, ships = problem.likelihood.rms, [first.corrected]
    if first.formula is not None:
        ships.append(first.ship.with_term(first.formula.term))
    residuals = [held_residual(ship, replay, *split) for ship in ships]
    residual = min(residuals, key=lambda one: float(np.sum(np.log(rms(one)))))
    before = rms(residual)
    if within_noise(problem, before) and first.verdict in (EXPLAINED, NOTHING):
        return first
    estimated = [f for f in first.findings if not f.effect.windowed]
    suggested = [finding.sized for finding in estimated]
    search = StructureSearch(problem, effects, tick, most, tuple(suggested))
    alone = CLOSER if first.verdict == EXPLAINED else AS_CLOSE
    shaped = first.verdict == PARTLY and first.shape is not None
    named = AS_CLOSE if shaped or (calibrated and first.formula is not None) else CLOSER

    def largest_error(model: Model) -> float:
        return named if model.effects else alone

    errors = [(total(problem.held_error(m), before), m) for m in search.quick_pass()]
    if all(error > largest_error(model) for error, model in errors):
        return _add_remark(first, NO_CLOSER)
    ranked = search.search()
    best, alike = choose(ranked, problem.held_error(problem.file_model()), noise_limit(problem))
    if (pruned := search.prune(best)) is not best:
        best, alike = pruned, []
    plain = parameters_alone(best, ranked, search.price(best.model.effects))
    # A parameter of a reference period is no wrong file, so that it must have a cause.
    if plain is not None and not any(
        problem.priors[k].wrong == 0.0 for k in problem.far_parameters(plain.model)
    ):
        best, alike = plain, []
    # Outliers of the held-out data may hide that a model is closer.
    clipped = total(best.compared, rms(residual, search.limit))
    if min(total(best.held, before), clipped) > largest_error(best.model):
        verdict = PARTLY if first.verdict == EXPLAINED else first.verdict
        return _add_remark(replace(first, verdict=verdict), NO_MODEL)
    model, replaced = replace_far_parameters(search, best.model)
    if replaced:
        best, alike = search.rank(model), []
    try:
        diagnosis = _update_diagnosis(first, search, setting, together, best, alike, ranked)
    except RunawayError:  # The parameters are stable with the effects of the model only.
        return _add_remark(first, NO_BASE)
    biased = [biased_parameter(first.ship, replaced, finding) for finding in diagnosis.findings]
    return replace(diagnosis, biased=biased)


def held_residual(ship: Ship, replay: JointReplay, fitted: Segments, held: Segments) -> Floats:
    """Return measured minus simulated channels of a ship on the held-out rows."""
    problem = OutputError(Balances(replay.with_ship(ship)), fitted, held, 0.0)
    return problem.held_residual(problem.file_model())


def _add_remark(first: Diagnosis, remark: str) -> Diagnosis:
    """Return a diagnosis with one more remark."""
    return replace(first, warnings=[*first.warnings, remark])


def replace_far_parameters(
    search: StructureSearch, model: Model
) -> tuple[Model, dict[str, list[Prior]]]:
    """Return a model with effects in place of parameters far from the file, if the fit is as good.

    If a parameter is off by more than physics can explain, the file was guessed and the parameters keep
    their estimates; those of a reference period are not guessed. The search holds replaced parameters
    near the file afterwards. Also return, by label of each effect that replaces parameters, the priors
    of these with the estimated values.
    """
    priors, replaced = search.problem.priors, {}
    far = search.problem.far_parameters(model)
    for k in far:
        guessed = priors[k].ratio and abs(model.shifts[k]) > PLAUSIBLE
        if (guessed and priors[k].wrong > 0.0) or priors[k].wrong == 1.0:
            return model, {}
    together = [far] if len(far) > 1 else []
    for group in (*together, *([k] for k in far)):
        if not set(group) <= set(search.problem.far_parameters(model)):
            continue  # replaced already
        other = _replace_by_effect(search, model, group)
        if other is None:
            continue
        (label,) = other.labels - model.labels
        was = [replace(priors[k], value=priors[k].value_at(float(model.shifts[k]))) for k in group]
        model, replaced[label] = other, was
    return model, replaced


def _replace_by_effect(search: StructureSearch, model: Model, group: list[int]) -> Model | None:
    """Return the model with one more effect and some parameters near the file; None if it fits worse."""
    problem = search.problem
    before = list(problem.priors)
    doubted = [k for k in group if before[k].wrong > 0.0]
    price = sum(before[k].penalty(float(model.shifts[k])) for k in doubted)
    held = problem.fit_near_file(model, group)
    problem.hold(group)
    starts = [one.starts[0][1] for one in search.screen(held)[:TRIED]]
    fits = [problem.fit((*held.effects, start), held) for start in starts]
    best = max(fits, key=lambda one: one.score, default=held)
    # A far parameter costs no more than the probability that the file is wrong. That of a reference
    # period costs its whole distance, which is in the score of both models.
    as_good = best.score + INDISTINGUISHABLE >= model.score + price
    near = not set(group) & set(problem.far_parameters(best))
    if as_good and near and len(best.effects) > len(model.effects):
        return best
    problem.priors[:] = before
    return None


def _update_diagnosis(
    first: Diagnosis,
    search: StructureSearch,
    setting: Setting,
    together: JointRecordings,
    best: Ranked,
    alike: list[Ranked],
    ranked: list[Ranked],
) -> Diagnosis:
    """Return the first diagnosis with the results of the best model of a structure search.

    The models ``alike`` are those of the search that the recordings cannot distinguish from it. A search
    may have visited none of them, or the best model is not one of the search. Then effects are tried in
    place of each of its own. If the residual is more than noise, effects that are not significant on the
    fitted rows are left out.
    """
    rests = search.without_each(best.model)
    best, rests = _strongest_first(best, rests)
    alike = alike or search.alternatives(best, rests)
    problem, model, replay = search.problem, best.model, setting.balances.replay
    ship = _with_parameters(first.ship, problem, model)
    tables = _correct_clocks(together.tables, problem, model)
    balances = Balances(replay.with_ship(ship, *tables))
    bands = bands_of(balances, setting.segments, setting.fitter.bands.highest_Hz)
    fitter = Fitter(balances, bands, problem.tolerance)
    fit = fitter.evaluate(model.effects)
    whiteness = Whiteness(fitter, replay.noise_rms, replay.quantisation)
    colour = whiteness.colour(fit)
    if colour is not None and (rest := search.without_weakest(model, rests)) is not None:
        return _update_diagnosis(first, search, setting, together, search.rank(rest), [], ranked)
    corrected = fitter.trial_ship.corrected(fit.effects)
    judge = HeldOut(setting.fitter, setting.held)
    gain = float(judge(corrected.record()) - judge(first.ship.record()))
    verdict, why = verdict_on(best, problem, whiteness, fit, gain)
    if verdict == NOTHING and is_undecidable(replay.excited, together.limits):
        verdict = UNEXPLAINED
    shape = None
    if verdict == UNEXPLAINED and colour is not None:
        shape = shape_to_show(best_shapes(fitter, fit), balances, colour)
    selection = _selection(fitter, fit, best, rests, alike, ranked, search)
    findings = findings_of(fitter, selection, balances.residuals_against(balances.nominal))
    pairs = zip(findings, effect_estimates(problem, model, fitter), strict=True)
    after = dict(zip(problem.names, problem.simulate(model), strict=True))
    shares = explained_shares(whiteness, setting.fitter.null, fit, setting.whiteness)
    said = [*why, *remarks(best, problem), *plain_error_remarks(problem, best, corrected)]
    left = open_models(
        fitter, selection, search.threshold, verdict, bool(findings), first.undecidable
    )
    return replace(
        first,
        verdict=verdict,
        corrected=corrected,
        after=after,
        residual_after=setting.balances.residuals_against(after),
        findings=[replace(finding, estimates=estimates) for finding, estimates in pairs],
        shape=shape,
        shape_windows=[],
        shape_regime="",
        formula=None,
        balance_verdicts=balance_verdicts(whiteness, fit, setting.whiteness),
        explained=float(shares[-1]),
        left_over=colour,
        ranking=[(c, search.threshold(c.effect)) for c in selection.ranking],
        tried=tuple(dict.fromkeys([*first.tried, *(effect.label for effect in search.effects)])),
        detectable=left.detectable,
        fit_after=fit_percents(first.measured, after, problem.held_rows),
        held_out_gain=gain,
        warnings=[*together.warnings, *said],
        parameters=parameter_estimates(first.ship, problem, model, corrected),
        alternatives=left.alternatives,
        hidden=left.hidden,
    )


def _strongest_first(best: Ranked, rests: list[Model]) -> tuple[Ranked, list[Model]]:
    """Return a model with its effects by their gain, the largest first, and it without each of them."""
    order = sorted(range(len(rests)), key=lambda k: rests[k].score)
    effects = tuple(best.model.effects[k] for k in order)
    return replace(best, model=replace(best.model, effects=effects)), [rests[k] for k in order]


def _with_parameters(file: Ship, problem: OutputError, model: Model) -> Ship:
    """Return the ship with the parameters that a model has shifted."""
    values = {}
    for prior, shift in zip(problem.priors, model.shifts.tolist(), strict=True):
        if abs(shift) > 0.1 * prior.near:
            values[prior.key] = file.parameter(prior.key).clipped(prior.value_at(shift))
    with contextlib.suppress(ShipError):  # two parameters that do not go together
        return file.with_values(values) if values else file
    return file


def _correct_clocks(
    tables: Sequence[pd.DataFrame], problem: OutputError, model: Model
) -> list[pd.DataFrame]:
    """Return recordings with the measured channels shifted onto the commands' clock."""
    skews = model.nuisance[len(problem.starts) :] * problem.replay.every  # rows as recorded
    shifted = []
    for table in tables:
        rows = np.arange(len(table))
        pairs = zip(problem.names, skews, strict=True)
        on_time = {c: np.interp(rows - skew, rows, table[c]) for c, skew in pairs if c in table}
        shifted.append(table.assign(**on_time))
    return shifted


def _selection(
    fitter: Fitter,
    fit: Fit,
    best: Ranked,
    rests: list[Model],
    alike: list[Ranked],
    ranked: list[Ranked],
    search: StructureSearch,
) -> Selection:
    """Return a model as a selection of the first search: gain, threshold and rivals of each effect.

    ``rests`` has the model without each of its effects. The ranking has the effects that were fitted
    alone, with their gain over the ship with refitted parameters.
    """

    def candidate(sized: SizedEffect, one: Ranked, without: Model) -> Candidate:
        """Return an effect of another model with its gain over a model without it."""
        gain = one.model.score - without.score
        return Candidate(sized.effect, replace(fitter.null, effects=(sized,)), gain)

    labels, effects = best.model.labels, best.model.effects
    gains, rivals = [], []
    for sized, rest in zip(effects, rests, strict=True):
        gains.append(best.model.score - rest.score)
        own = []
        for one in alike:
            others = [other for other in one.model.effects if other.effect.label not in labels]
            if len(others) == 1 and labels - one.model.labels == {sized.effect.label}:
                own.append(candidate(others[0], one, rest))
        rivals.append(tuple(own))
    thresholds = tuple(search.threshold(sized.effect) for sized in effects)
    bare = search.pool[frozenset()]
    alone = [
        candidate(*one.model.effects, one, bare) for one in ranked if len(one.model.effects) == 1
    ]
    ranking = tuple(sorted(alone, key=lambda one: -one.gain))
    return Selection(fit, tuple(gains), thresholds, tuple(rivals), ranking)


def verdict_on(
    best: Ranked, problem: OutputError, whiteness: Whiteness, fit: Fit, gain: float
) -> tuple[str, list[str]]:
    """Return the verdict on a chosen model, and remarks on why it is explained in part only.

    The fit has the model's effects in the balances; the gain is that of the corrected ship without
    clock skews on the held-out data, in 2 log L.
    """
    quiet = within_noise(problem, best.held) or whiteness.colour(fit) is None
    far = problem.far_parameters(best.model)
    if not best.model.effects:
        return (NOTHING if quiet and not far else UNEXPLAINED), []
    reasons = doubts(problem.trial_ship, fit.effects)
    if not quiet:
        reasons.append("the residual on the held-out data is more than noise")
    if far:
        moved = ", ".join(problem.priors[k].key for k in far)
        reasons.append(f"{moved} moved far from the ship file")
    if gain < 0.0:
        reasons.append(
            "the corrected ship, which has no clock skews, is less likely on the held-out data than "
            f"the ship file by {-gain:.0f} in 2 log L"
        )
    if not reasons:
        return EXPLAINED, []
    return PARTLY, [f"explained in part only, because {'; '.join(reasons)}"]


def noise_limit(problem: OutputError) -> Floats:
    """Return the rms error of each channel up to which it is noise, in the channels' units."""
    return OF_NOISE * np.array([problem.replay.noise_rms[c] for c in problem.names])


def within_noise(problem: OutputError, error: Floats) -> bool:
    """Return whether the rms error of every channel is noise."""
    return bool(np.all(error <= noise_limit(problem)))


def effect_estimates(
    problem: OutputError, model: Model, fitter: Fitter
) -> list[tuple[Estimate, ...]]:
    """Return the estimates of the effects; their standard errors include all other free values."""
    errors = problem.standard_errors(model)[len(model.shifts) + len(model.nuisance) :]
    host = fitter.trial_ship.with_terms(model.effects)
    return estimates_of(host, problem.trial_ship, model.effects, errors, FORM_SHARE)


def parameter_estimates(
    file: Ship, problem: OutputError, model: Model, corrected: Ship
) -> list[ParameterChange]:
    """Return the parameters that the corrected ship or the model changes by a tolerance or more."""
    errors = problem.standard_errors(model)[: len(model.shifts)].tolist()
    changes = []
    for prior, shift, error in zip(problem.priors, model.shifts.tolist(), errors, strict=True):
        tolerances, value = shift / prior.near, prior.value_at(shift)
        number, now = file.parameter(prior.key), corrected.parameter(prior.key).value
        if abs(tolerances) >= REPORTED or now != number.value:
            spread = abs(error * prior.unit_at(shift))
            given = prior.key, number.info.unit, number.value
            changes.append(ParameterChange(*given, value, spread, tolerances, "tolerance", now))
    return changes


def biased_parameter(
    file: Ship, replaced: dict[str, list[Prior]], finding: Finding
) -> BiasedParameter | None:
    """Return the parameter of the ship file that would explain a finding as well."""
    priors = replaced.get(finding.effect.label, [])
    if len(priors) != 1:
        return None
    (prior,) = priors
    number = file.parameter(prior.key)
    return BiasedParameter(prior.key, number.value, prior.value, number.info.unit, finding.score)


def remarks(best: Ranked, problem: OutputError) -> list[str]:
    """Return remarks on clocks, and on parameters far from the file."""
    said = _skews(best.model, problem)
    far = sorted(problem.far_parameters(best.model))
    for k in far:
        prior, shift = problem.priors[k], float(best.model.shifts[k])
        said.append(
            f"{prior.key} is estimated as {prior.value_at(shift):.4g} and is {prior.value:.4g} in the "
            f"ship file, {abs(shift) / prior.near:.0f} tolerances away: the value or its tolerance in "
            "the ship file is wrong"
        )
    errors = problem.standard_errors(best.model, guessed=True)
    loose = [problem.priors[k].key for k in far if problem.priors[k].ratio and errors[k] > LOOSE]
    if loose:
        said.append(
            f"{', '.join(loose)}: these recordings determine only a combination with other parameters; "
            "the estimate is as accurate as the tolerances of the others in the ship file"
        )
    return said


def _skews(model: Model, problem: OutputError) -> list[str]:
    """Return remarks on channels whose clocks clearly differ from the commands' clock."""
    replay, clocks, said = problem.replay, len(problem.starts), []
    skews = (model.nuisance[clocks:] * replay.every).tolist()
    first = len(model.shifts) + clocks
    errors = problem.standard_errors(model)[first : first + len(skews)] * replay.every
    for column, rows, error in zip(problem.names, skews, errors.tolist(), strict=True):
        if abs(rows) < REPORTED_SKEW or abs(rows) < SURE_SKEW * error:
            continue
        milliseconds = 1e3 * abs(rows) * replay.interval_s / replay.every
        limit = ", the limit of the search," if abs(rows) > MOST_SKEW - 0.01 else ""
        side, cause = "early", "time stamps"
        if rows < 0.0:
            side, cause = "late", "a delay of the sensor or of the command below a row"
        said.append(
            f"{column} is {milliseconds:.3g} ms ({abs(rows):.2f} rows){limit} {side} relative to the "
            f"commands, from the logger's clocks or {cause}; the held-out errors include it, the "
            "corrected ship does not"
        )
    return said


def plain_error_remarks(problem: OutputError, best: Ranked, corrected: Ship) -> list[str]:
    """Return a remark on larger held-out errors of the corrected ship simulated from its file alone."""
    simulated = problem.replay.simulate_channels(corrected.record())
    residual = problem.measured - np.array([simulated[c] for c in problem.names])
    errors = problem.likelihood.rms(residual[:, problem.held_rows])
    if np.all(errors <= NOTABLE * best.held):
        return []
    said = ", ".join(f"{c} {error:.4g}" for c, error in zip(problem.names, errors, strict=True))
    return [
        "without clock skews and estimated first states, as in shaftline simulate, the corrected ship "
        f"has these held-out rms errors: {said}"
    ]


def add_model_error(
    found: MethodResult,
    identified: Ship,
    balances: Balances,
    fitted: Segments,
    held: Segments,
    effects: Sequence[Effect],
    tick: Tick,
) -> MethodResult:
    """Return estimated parameters with wider intervals if effects that the ship lacks change them.

    The parameters, which the identified ship has, are estimated again together with effects of the
    catalogue. If that comes clearly closer to the held-out data, the difference is added to their
    covariance, and a remark names the effects. The segments are rows of the nominal balances.
    """
    replay = coarser(balances.replay, MOST_ROWS)
    if not held or reason_to_skip(replay):
        return found
    problem = OutputError(Balances(replay), fitted, held)
    before = problem.likelihood.rms(held_residual(identified, replay, fitted, held))
    if within_noise(problem, before):
        return found
    numbers = [replay.ship.parameter(key) for key in found.keys if replay.ship.has_key(key)]
    guessed = {n.key: guessed_prior(n) for n in numbers if n.value != 0.0}
    problem.priors[:] = ({prior.key: prior for prior in problem.priors} | guessed).values()
    free = set(found.keys)
    rest = [e for e in effects if not free & {parameter.key for parameter in e.parameters}]
    models = StructureSearch(problem, rest, tick).quick_pass()
    errors = [total(problem.held_error(model), before) for model in models]
    least = min(errors)
    close = [k for k, error in enumerate(errors) if error <= NEARLY_BEST * least]
    best = min(close, key=lambda k: models[k].size)
    if least > CLOSER or not models[best].effects:
        return found
    return _widen(found, problem, models[best], errors[best])


def _widen(found: MethodResult, problem: OutputError, model: Model, error: float) -> MethodResult:
    """Return parameters with the squared difference from those of a model in their covariance."""
    pairs = zip(problem.priors, model.shifts.tolist(), strict=True)
    values = dict(zip(found.keys, found.values, strict=True))
    fitted = {prior.key: prior.value_at(shift) for prior, shift in pairs}
    values |= {key: value for key, value in fitted.items() if key in values}
    apart = np.array([*values.values()]) - np.array(found.values)
    changes = ", ".join(f"{key} to {value:.4g}" for key, value in values.items())
    effects = ", ".join(sorted(model.labels))
    said = (
        f"physics is missing from the ship: with {effects} the held-out error is {error:.2g} times this "
        f"one, and the estimates change ({changes}); the intervals are widened accordingly. Run "
        "`shaftline diagnose` before relying on these values"
    )
    covariance = found.covariance + np.outer(apart, apart)
    return replace(found, covariance=covariance, remarks=(*found.remarks, said))
