"""Model error of estimated parameters: how far missing physics would change them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...plant.ship import Ship
from ..estimate import Tick
from ..identification.results import Found
from ..judge.held_out import Segments
from ..search.catalogue import Effect
from ..simulate.balances import Balances
from .choice import total
from .diagnose import CLOSER, held_residual, within_noise
from .model import Model, guessed_prior
from .noise_model import MOST_ROWS, coarser, left_out
from .output_error import OutputError
from .search import StructureSearch

AS_CLOSE = 1.1
"""Times the least held-out error up to which a model of fewer values is preferred."""


def with_model_error(
    found: Found,
    identified: Ship,
    balances: Balances,
    fitted: Segments,
    held: Segments,
    effects: Sequence[Effect],
    tick: Tick,
) -> Found:
    """Return estimated parameters, less certain where effects that the ship lacks change them.

    The parameters are estimated again together with effects of the catalogue. If that comes clearly
    closer to the held-out data, the difference of the estimates is added to their covariance, and a
    remark names the effects.

    Args:
        found: the parameters as estimated alone.
        identified: the ship with them.
        balances: balances of the nominal ship and the recordings.
        fitted: rows that were fitted.
        held: held-out rows.
        effects: candidates.
        tick: called with the stage, how much is done, and how much there is.
    """
    replay = coarser(balances.replay, MOST_ROWS)
    if not held or left_out(replay):
        return found
    problem = OutputError(Balances(replay), fitted, held)
    before = problem.likelihood.rms(held_residual(identified, replay, fitted, held))
    if within_noise(problem, before):
        return found
    known = {prior.key: prior for prior in problem.priors} | {
        key: guessed_prior(replay.ship.number(key))
        for key in found.keys
        if replay.ship.has_key(key) and replay.ship.number(key).value != 0.0
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
    return _widened(found, problem, best, total(problem.held_error(best), before))


def _widened(found: Found, problem: OutputError, model: Model, error: float) -> Found:
    """Return parameters with their distance from a model's in their covariance."""
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
        f"one, and the estimates change ({changes}); the intervals are widened by as much. Run "
        "`shaftline diagnose` before relying on these values"
    )
    covariance = found.covariance + np.outer(apart, apart)
    return replace(found, covariance=covariance, remarks=(*found.remarks, said))
