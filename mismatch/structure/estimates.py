"""Estimates of a chosen model as a diagnosis reports them: effects, parameters, and remarks on both."""

from __future__ import annotations

import numpy as np

from ...plant.ship import Ship
from ..estimate import Estimate
from ..judge.findings import FORM_SHARE, Finding
from ..numbers.moved import TOLD, MovedNumber
from ..numbers.wrong import WrongNumber
from ..search.fitting import Fitter
from .choice import Ranked
from .coordinates import MOST_SKEW
from .model import Model
from .output_error import OutputError
from .priors import Prior

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
