"""A parameter far from the ship file, or an effect that does the same: the report has both.

Fouling and a resistance that is too low in the file are indistinguishable in a recording. Where the
search has moved a parameter beyond its tolerance, the effect is sought that takes its place with the
parameter near the file. If the fit is as good, the effect is reported, and the parameter beside it.

Estimates of a chosen model as a diagnosis reports them: effects, parameters, and remarks on both.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...plant.ship import Ship
from ..estimate import Estimate
from ..identification.parameters import TOLD, MovedNumber, WrongNumber
from ..judge.findings import FORM_SHARE, Finding
from ..search.fitting import Fitter
from ..search.selection import TELL_APART
from .choice import Ranked
from .model import MOST_SKEW, Model, Prior
from .output_error import OutputError
from .search import StructureSearch

PLAUSIBLE = math.log(1.5)
"""Logarithm of the factor by which physics may change a parameter; beyond it the file is wrong."""

TRIED = 5
"""Effects that are tried instead of a parameter, those of the largest predicted gain."""


def replace_far_parameters(
    search: StructureSearch, model: Model
) -> tuple[Model, dict[str, list[Prior]]]:
    """Return a model with effects in place of parameters far from the file, where the fit is as good.

    A file with a parameter that is off by more than physics could explain was guessed: its parameters
    stay as estimated.

    Args:
        search: search that found the model; replaced parameters are held near the file from then on.
        model: the chosen model.

    Returns:
        The model; and by the label of each effect that replaces parameters, their priors with the
        estimated values.
    """
    priors, replaced = search.problem.priors, {}
    far = search.problem.moved_far(model)
    if any(priors[k].wrong == 1.0 for k in far):
        return model, {}
    if any(priors[k].ratio and abs(model.shifts[k]) > PLAUSIBLE for k in far):
        return model, {}
    together = [far] if len(far) > 1 else []
    for group in (*together, *([k] for k in far)):
        if not set(group) <= set(search.problem.moved_far(model)):
            continue  # replaced already
        found = _with_effect(search, model, group)
        if found is None:
            continue
        (label,) = found.labels - model.labels
        was = [replace(priors[k], value=priors[k].value_at(float(model.shifts[k]))) for k in group]
        model, replaced[label] = found, was
    return model, replaced


def _with_effect(search: StructureSearch, model: Model, group: list[int]) -> Model | None:
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
    worse = best.score + TELL_APART < model.score + price
    if (
        worse
        or len(best.effects) == len(model.effects)
        or set(group) & set(problem.moved_far(best))
    ):
        problem.priors[:] = before
        return None
    return best


TOLD_SKEW, SURE_SKEW = 0.1, 3.0
"""Rows by which a channel's clock is told to be off, and standard errors that this must be."""

NOTABLE = 1.1
"""Times the reported held-out error from which the error of the corrected ship's file alone is reported
too."""

LOOSE = 0.3
"""Standard error of a parameter's logarithm, the file's tolerances ignored, from which on the recordings
determine it only together with other parameters."""


def effect_estimates(
    problem: OutputError, model: Model, fitter: Fitter
) -> list[tuple[Estimate, ...]]:
    """Return the values of the effects with standard errors, all other free values uncertain as well."""
    errors = problem.standard_errors(model)
    host = fitter.trial_ship.host(model.effects)
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
) -> list[MovedNumber]:
    """Return the parameters that the corrected ship changes or the model has shifted by a tolerance."""
    errors = problem.standard_errors(model)
    found = []
    for k, (prior, shift) in enumerate(zip(problem.priors, model.shifts, strict=True)):
        tolerances = float(shift) / prior.near
        number, now = file.number(prior.key), corrected.number(prior.key).value
        if abs(tolerances) < TOLD and now == number.value:
            continue
        value = prior.value_at(float(shift))
        spread = float(errors[k]) * (value if prior.ratio else 1.0)
        found.append(
            MovedNumber(
                prior.key, number.info.unit, number.value, value, abs(spread), tolerances,
                "tolerance", now,
            )
        )  # fmt: skip
    return found


def biased_parameter(
    file: Ship, replaced: dict[str, list[Prior]], finding: Finding
) -> WrongNumber | None:
    """Return the parameter of the ship file that would explain a finding as well."""
    priors = replaced.get(finding.effect.label, [])
    if len(priors) != 1:
        return None
    (prior,) = priors
    number = file.number(prior.key)
    return WrongNumber(prior.key, number.value, prior.value, number.info.unit, finding.score)


def remarks(best: Ranked, problem: OutputError) -> list[str]:
    """Return remarks on clocks, and on parameters far from the file."""
    said = _skews(best.model, problem)
    far = sorted(problem.moved_far(best.model))
    for k in far:
        prior, shift = problem.priors[k], float(best.model.shifts[k])
        said.append(
            f"{prior.key} is estimated as {prior.value_at(shift):.4g} and is {prior.value:.4g} in the "
            f"ship file, {abs(shift) / prior.near:.0f} tolerances away: the value or its tolerance in "
            "the file is wrong"
        )
    errors = problem.standard_errors(best.model, guessed=True)
    loose = [problem.priors[k].key for k in far if problem.priors[k].ratio and errors[k] > LOOSE]
    if loose:
        said.append(
            f"{', '.join(loose)}: these recordings determine only a combination with other parameters; "
            "the value holds as far as the tolerances of the others in the ship file do"
        )
    return said


def plain_errors(problem: OutputError, best: Ranked, corrected: Ship) -> list[str]:
    """Return a remark on the held-out errors of the corrected ship simulated from its file alone.

    Args:
        problem: that fitted the model.
        best: the model, whose held-out errors count the clock skews and the estimated first states.
        corrected: the ship with the model's effects and parameters.
    """
    simulated = problem.replay.simulated(problem.replay.simulate(corrected.record()))
    residual = problem.measured - np.array([simulated[c] for c in problem.names])
    errors = problem.likelihood.rms(residual[:, problem.held_rows])
    if np.all(errors <= NOTABLE * best.held):
        return []
    said = ", ".join(f"{c} {error:.4g}" for c, error in zip(problem.names, errors, strict=True))
    return [
        "simulated from its file alone, as shaftline simulate does, without clock skews and estimated "
        f"first states, the corrected ship has these held-out rms errors: {said}"
    ]


def _skews(model: Model, problem: OutputError) -> list[str]:
    """Return remarks on channels whose clocks are clearly apart from the commands' clock."""
    errors = problem.standard_errors(model)[len(model.shifts) :]
    clocks = len(problem.starts)
    said = []
    for k, column in enumerate(problem.names):
        rows = float(model.nuisance[clocks + k]) * problem.replay.every
        error = float(errors[clocks + k]) * problem.replay.every
        if abs(rows) < TOLD_SKEW or abs(rows) < SURE_SKEW * error:
            continue
        milliseconds = 1e3 * abs(rows) * problem.replay.interval_s / problem.replay.every
        limit = ", the limit of the search," if abs(rows) > MOST_SKEW - 0.01 else ""
        cause = (
            "a delay of the sensor or of the command below a row" if rows < 0.0 else "time stamps"
        )
        said.append(
            f"{column} is {milliseconds:.3g} ms ({abs(rows):.2f} rows){limit} "
            f"{'late' if rows < 0.0 else 'early'} against the commands: the logger's clocks or {cause}; "
            "held-out errors are with it, the corrected ship has no such delay"
        )
    return said
