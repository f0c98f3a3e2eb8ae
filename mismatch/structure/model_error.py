"""Add the model error to estimated parameters: the change of the estimates by missing physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...plant.ship import Ship
from ..estimate import Tick
from ..identification.results import MethodResult
from ..judge.held_out import Segments
from ..search.catalogue import Effect
from ..simulate.balances import Balances
from .choice import total
from .diagnose import CLOSER, held_residual, within_noise
from .model import Model, guessed_prior
from .noise_model import MOST_ROWS, coarser, reason_to_skip
from .output_error import OutputError
from .search import StructureSearch

AS_CLOSE = 1.1
"""Multiple of the least held-out error up to which a model with fewer values is preferred."""


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

    The parameters are estimated again together with effects of the catalogue. If that comes clearly
    closer to the held-out data, the difference of the estimates is added to their covariance, and a
    remark names the effects.

    Args:
        found: parameters estimated without effects.
        identified: ship with these parameters.
        balances: balances of the nominal ship and the recordings.
        fitted: fitted rows, as segments.
        held: held-out rows, as segments.
        effects: candidate effects.
        tick: progress callback ``tick(stage, done, total)``.
    """
    replay = coarser(balances.replay, MOST_ROWS)
    if not held or reason_to_skip(replay):
        return found
    problem = OutputError(Balances(replay), fitted, held)
    before = problem.likelihood.rms(held_residual(identified, replay, fitted, held))
    if within_noise(problem, before):
        return found
    known = {prior.key: prior for prior in problem.priors} | {
        key: guessed_prior(replay.ship.parameter(key))
        for key in found.keys
        if replay.ship.has_key(key) and replay.ship.parameter(key).value != 0.0
    }
    problem.priors[:] = known.values()
    free = set(found.keys)
    rest = [e for e in effects if not free & {parameter.key for parameter in e.parameters}]
    models = StructureSearch(problem, rest, tick).quick_pass()
    errors = [total(problem.held_error(model), before) for model in models]
    close = [m for m, error in zip(models, errors, strict=True) if error <= AS_CLOSE * min(errors)]
    best = min(close, key=lambda model: model.size)
    if min(errors) > CLOSER or not best.effects:
        return found
    return _widen(found, problem, best, total(problem.held_error(best), before))


def _widen(found: MethodResult, problem: OutputError, model: Model, error: float) -> MethodResult:
    """Return parameters with the squared difference from those of a model in their covariance."""
    shifts = {
        prior.key: prior.value_at(float(shift))
        for prior, shift in zip(problem.priors, model.shifts, strict=True)
    }
    values = [shifts.get(key, value) for key, value in zip(found.keys, found.values, strict=True)]
    apart = np.array(values) - np.array(found.values)
    changes = ", ".join(
        f"{key} to {value:.4g}" for key, value in zip(found.keys, values, strict=True)
    )
    effects = ", ".join(sorted(model.labels))
    said = (
        f"physics is missing from the ship: with {effects} the held-out error is {error:.2g} times this "
        f"one, and the estimates change ({changes}); the intervals are widened accordingly. Run "
        "`shaftline diagnose` before relying on these values"
    )
    covariance = found.covariance + np.outer(apart, apart)
    return replace(found, covariance=covariance, remarks=(*found.remarks, said))
