"""Estimates of a chosen model for the report: effects, parameters, and remarks on both.

A parameter far from the ship file and an effect may be indistinguishable: fouling acts like a resistance
that is too low in the file. Where a parameter lies beyond its tolerance, an effect is therefore searched
that fits as well with the parameter near the file. If there is one, the report gives the effect, and the
biased parameter as an alternative.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...plant.ship import Ship
from ..estimate import Estimate
from ..identification.parameters import REPORTED, BiasedParameter, ParameterChange
from ..judge.findings import FORM_SHARE, Finding
from ..search.fitting import Fitter
from ..search.selection import INDISTINGUISHABLE
from .choice import Ranked
from .model import MOST_SKEW, Model, Prior
from .output_error import OutputError
from .search import StructureSearch

PLAUSIBLE = math.log(1.5)
"""Logarithm of the largest factor by which physics may change a parameter; beyond it the file is
wrong."""

TRIED = 5
"""Number of effects tried in place of a parameter, those with the largest predicted gain."""


def replace_far_parameters(
    search: StructureSearch, model: Model
) -> tuple[Model, dict[str, list[Prior]]]:
    """Return a model with effects in place of parameters far from the file, if the fit is as good.

    If a parameter is off by more than physics can explain, the file was guessed and the parameters keep
    their estimates.

    Args:
        search: search that found the model; it holds replaced parameters near the file afterwards.
        model: chosen model.

    Returns:
        The model; and for each effect that replaces parameters, by label, the priors of these parameters
        with the estimated values.
    """
    priors, replaced = search.problem.priors, {}
    far = search.problem.far_parameters(model)
    if any(priors[k].wrong == 1.0 for k in far):
        return model, {}
    if any(priors[k].ratio and abs(model.shifts[k]) > PLAUSIBLE for k in far):
        return model, {}
    together = [far] if len(far) > 1 else []
    for group in (*together, *([k] for k in far)):
        if not set(group) <= set(search.problem.far_parameters(model)):
            continue  # replaced already
        found = _replace_by_effect(search, model, group)
        if found is None:
            continue
        (label,) = found.labels - model.labels
        was = [replace(priors[k], value=priors[k].value_at(float(model.shifts[k]))) for k in group]
        model, replaced[label] = found, was
    return model, replaced


def _replace_by_effect(search: StructureSearch, model: Model, group: list[int]) -> Model | None:
    """Return the model with one more effect and some parameters near the file; None if it fits worse."""
    problem = search.problem
    before = list(problem.priors)
    price = sum(before[k].penalty(float(model.shifts[k])) for k in group)
    held = problem.fit_near_file(model, group)
    problem.hold(group)
    found = [
        problem.fit((*held.effects, one.starts[0][1]), held) for one in search.screen(held)[:TRIED]
    ]
    best = max(found, key=lambda one: one.score, default=held)
    # a far parameter costs no more than the probability that the file is wrong
    worse = best.score + INDISTINGUISHABLE < model.score + price
    if (
        worse
        or len(best.effects) == len(model.effects)
        or set(group) & set(problem.far_parameters(best))
    ):
        problem.priors[:] = before
        return None
    return best


REPORTED_SKEW, SURE_SKEW = 0.1, 3.0
"""Smallest clock skew of a channel that is reported, in rows and in standard errors."""

NOTABLE = 1.1
"""Multiple of the reported held-out error from which the error of the corrected ship file without clock
skews is reported as well."""

LOOSE = 0.3
"""Standard error of a parameter's logarithm without the file's tolerances, from which the recordings
determine only a combination with other parameters."""


def effect_estimates(
    problem: OutputError, model: Model, fitter: Fitter
) -> list[tuple[Estimate, ...]]:
    """Return the estimates of the effects; their standard errors include all other free values."""
    errors = problem.standard_errors(model)
    host = fitter.trial_ship.with_terms(model.effects)
    found, place = [], len(model.shifts) + len(model.nuisance)
    for placed in model.effects:
        own = []
        for parameter, value in placed.pairs:
            origin = problem.trial_ship.origin(parameter)
            own.append(
                Estimate.of(
                    host, parameter.key, value, float(errors[place]),
                    form_error=FORM_SHARE * abs(value - origin),
                    neutral=problem.trial_ship.neutral(parameter),
                )
            )  # fmt: skip
            place += 1
        found.append(tuple(own))
    return found


def parameter_estimates(
    file: Ship, problem: OutputError, model: Model, corrected: Ship
) -> list[ParameterChange]:
    """Return the parameters that the corrected ship or the model changes by a tolerance or more."""
    errors = problem.standard_errors(model)
    found = []
    for k, (prior, shift) in enumerate(zip(problem.priors, model.shifts, strict=True)):
        tolerances = float(shift) / prior.near
        number, now = file.parameter(prior.key), corrected.parameter(prior.key).value
        if abs(tolerances) < REPORTED and now == number.value:
            continue
        value = prior.value_at(float(shift))
        spread = float(errors[k]) * (value if prior.ratio else 1.0)
        found.append(
            ParameterChange(
                prior.key, number.info.unit, number.value, value, abs(spread), tolerances,
                "tolerance", now,
            )
        )  # fmt: skip
    return found


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


def plain_error_remarks(problem: OutputError, best: Ranked, corrected: Ship) -> list[str]:
    """Return a remark on the held-out errors of the corrected ship simulated from its file alone.

    Args:
        problem: output-error problem that fitted the model.
        best: model; its held-out errors include the clock skews and the estimated first states.
        corrected: ship with the model's effects and parameters.
    """
    simulated = problem.replay.simulated(problem.replay.simulate(corrected.record()))
    residual = problem.measured - np.array([simulated[c] for c in problem.names])
    errors = problem.likelihood.rms(residual[:, problem.held_rows])
    if np.all(errors <= NOTABLE * best.held):
        return []
    said = ", ".join(f"{c} {error:.4g}" for c, error in zip(problem.names, errors, strict=True))
    return [
        "without clock skews and estimated first states, as in shaftline simulate, the corrected ship "
        f"has these held-out rms errors: {said}"
    ]


def _skews(model: Model, problem: OutputError) -> list[str]:
    """Return remarks on channels whose clocks clearly differ from the commands' clock."""
    errors = problem.standard_errors(model)[len(model.shifts) :]
    clocks = len(problem.starts)
    said = []
    for k, column in enumerate(problem.names):
        rows = float(model.nuisance[clocks + k]) * problem.replay.every
        error = float(errors[clocks + k]) * problem.replay.every
        if abs(rows) < REPORTED_SKEW or abs(rows) < SURE_SKEW * error:
            continue
        milliseconds = 1e3 * abs(rows) * problem.replay.interval_s / problem.replay.every
        limit = ", the limit of the search," if abs(rows) > MOST_SKEW - 0.01 else ""
        cause = (
            "a delay of the sensor or of the command below a row" if rows < 0.0 else "time stamps"
        )
        said.append(
            f"{column} is {milliseconds:.3g} ms ({abs(rows):.2f} rows){limit} "
            f"{'late' if rows < 0.0 else 'early'} relative to the commands, from the logger's clocks or "
            f"{cause}; the held-out errors include it, the corrected ship does not"
        )
    return said
