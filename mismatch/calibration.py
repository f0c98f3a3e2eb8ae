"""Calibrate a ship on a reference period, before missing physics is searched in a later recording.

A model that lacks physics in both periods gets biased parameters from the first one, and then differs
from the second one although nothing has changed. The reference period is therefore diagnosed itself, and
its effects and the parameters are estimated together.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..core.statistics import covariance_of
from ..plant.ship import Ship, ShipError
from .diagnosis import Diagnosis
from .estimate import Tick, ignore_progress
from .identification.free_parameters import AUTO, LEAST_CERTAIN, UnidentifiableError, doubtful
from .identification.parameters import MethodResult, Start, widen_tolerances
from .identify import Identification, identified_ship, identify
from .recordings.joint import Recorded
from .recordings.time_base import FEWEST_ROWS
from .search.catalogue import SizedEffect
from .search.fitting import estimates_of
from .setting import Setting
from .simulate.balances import Balances
from .simulate.joint_replay import JointReplay
from .simulate.time_step import restore_time_step
from .structure.model import Model, parameter_priors
from .structure.noise_model import MOST_ROWS, coarser, reason_to_skip
from .structure.output_error import OutputError

NOISE_ESTIMATES = 2
"""Number of fits with the noise spectrum of the fit before."""

PARTS = 4
"""Number of parts of the reference period that are left out in turn."""

INFORMED = 0.999
"""Standard error of a parameter as a share of its tolerance above which it has no influence."""


def doubt_parameters(ship: Ship, tables: Sequence[pd.DataFrame], steady: bool = False) -> Ship:
    """Return the ship with a tolerance of at least 10 % on each uncertain parameter.

    A user who calibrates does not trust the ship file. Parameters with a standard deviation of their own
    in the file, such as those of an identified ship, keep it.
    """
    stated = {
        prior.key: prior.near * prior.unit_at(0.0)
        for prior in parameter_priors(JointReplay(ship, *tables, steady=steady))
    }
    known = ship.tolerances.numbers
    keys = [key for key in doubtful(ship) if ship.has_key(key) and key not in known]
    numbers = {
        key: max(LEAST_CERTAIN * abs(ship.parameter(key).value), stated.get(key, 0.0))
        for key in keys
    }
    return ship.with_values({"tolerances.numbers": known | numbers}) if numbers else ship


def calibrate_jointly(
    file: Ship, diagnosis: Diagnosis, setting: Setting, tolerance: float = 1.0
) -> Start | None:
    """Return the start of a diagnosis with the physics and the parameters of a reference period.

    All parameters with a tolerance and the effects that the diagnosis of the reference period found are
    estimated together, as in :mod:`.structure.output_error`. The tolerances of the ship are then the
    standard errors of the estimates, with their correlations: a reference period may determine the
    ratio of two parameters far better than either.

    Args:
        file: nominal ship.
        diagnosis: diagnosis of the reference period with the ship of :func:`doubt_parameters`.
        setting: setting of that diagnosis.
        tolerance: factor on the tolerances of the ship's parameters [-].

    Returns:
        The start; None if the recordings do not suit a joint estimation, such as those of a ship in
        waves under a governor.
    """
    replay = coarser(setting.balances.replay, MOST_ROWS)
    if reason_to_skip(replay):
        return None
    balances, rows = Balances(replay), replay.segments
    problem = OutputError(balances, rows, rows, tolerance, setting.fitter.bands.highest_Hz)
    lasting = [finding for finding in diagnosis.findings if not finding.effect.windowed]
    model = _fit(problem, tuple(finding.sized for finding in lasting))
    if not problem.priors or not math.isfinite(model.score):
        return None
    estimates = _estimates(problem, model, 1.0 / _scatter(problem, balances, model))
    try:
        ship = identified_ship(problem.trial_ship.corrected(model.effects), estimates)
    except ShipError:  # The ship file does not allow this combination of values.
        return None
    remarks = [f"calibration: {note}" for note in (*diagnosis.limits, *diagnosis.warnings)]
    if lasting:
        remarks.insert(0, _found_in_reference(problem, model))
    return Start(file, restore_time_step(ship, file), estimates.keys, remarks=tuple(remarks))


def _fit(problem: OutputError, effects: tuple[SizedEffect, ...]) -> Model:
    """Return the fit of effects and parameters to all rows, with the noise of its own residual."""
    model = problem.fit(effects, problem.file_model())
    for _ in range(NOISE_ESTIMATES):
        if not math.isfinite(model.score):
            break
        problem.likelihood.set_noise(problem.residual(model))
        model = problem.fit_from_far(problem.fit(model.effects, model))
    return model


def _scatter(problem: OutputError, balances: Balances, model: Model) -> float:
    """Return the variance of the estimates over parts of the rows, as a multiple of that by their noise.

    It is 1 or more. Physics that the model lacks makes estimates from different manoeuvres differ by
    more than noise does, and would make a difference between two voyages look like a change of the ship.
    The variance is that of the jackknife with :data:`PARTS` parts (Efron 1982), averaged over the
    parameters in the metric of their covariance.
    """
    count, estimates = len(model.shifts), []
    edges = np.linspace(0, problem.replay.rows, PARTS + 1).astype(int)
    for first, last in itertools.pairwise(edges.tolist()):
        kept = [(a, min(b, first)) for a, b in problem.replay.segments]
        kept += [(max(a, last), b) for a, b in problem.replay.segments]
        kept = [(a, b) for a, b in kept if b - a >= FEWEST_ROWS]
        if not kept:
            return 1.0
        part = OutputError(balances, kept, kept, problem.tolerance, problem.highest_Hz)
        part.likelihood.set_noise(part.residual(model))
        estimates.append(part.fit(model.effects, model).shifts)
    apart = np.array(estimates) - np.mean(estimates, axis=0)
    scatter = (PARTS - 1) / PARTS * apart.T @ apart
    precision = covariance_of(problem.covariance(model)[:count, :count])
    ratio = float(np.trace(precision @ scatter)) / count
    return max(1.0, ratio) if math.isfinite(ratio) else 1.0


def _estimates(problem: OutputError, model: Model, share: float) -> MethodResult:
    """Return the parameters about which the rows say anything, in the units of their keys."""
    ship, values, units = problem.replay.ship, [], []
    for prior, shift in zip(problem.priors, model.shifts.tolist(), strict=True):
        values.append(ship.parameter(prior.key).clipped(prior.value_at(shift)))
        units.append(prior.unit_at(shift))
    count, near = len(values), np.array([prior.near for prior in problem.priors])
    covariance = problem.covariance(model, share=share)[:count, :count]
    informed = np.flatnonzero(np.sqrt(np.diag(covariance)) < INFORMED * near)
    covariance = (covariance * np.outer(units, units))[np.ix_(informed, informed)]
    keys = tuple(problem.priors[k].key for k in informed)
    return MethodResult(keys, tuple(values[k] for k in informed), covariance)


def _found_in_reference(problem: OutputError, model: Model) -> str:
    """Return the remark on physics that the ship file lacks in the reference period already."""
    host = problem.trial_ship.with_terms(model.effects)
    unused = np.zeros(model.size)  # errors
    estimates = estimates_of(host, problem.trial_ship, model.effects, unused, 0.0)
    found = [
        f"{sized.effect.id} ({', '.join(f'{e.name} {e.value:.4g} {e.unit}' for e in own)})"
        for sized, own in zip(model.effects, estimates, strict=True)
    ]
    return (
        f"calibration: the ship file lacks physics in the reference period already: {', '.join(found)}; "
        "the calibrated ship has it, and this diagnosis reports changes since the reference period"
    )


def calibrate(
    ship: Ship,
    recordings: Sequence[Recorded],
    keys: Sequence[str] = (),
    columns: str | Path | None = None,
    tolerance: float = 1.0,
    tick: Tick = ignore_progress,
) -> Start:
    """Return the start of a diagnosis with parameters estimated from a reference period.

    It serves where the user has chosen the parameters, and where :func:`calibrate_jointly` cannot be
    used.

    The method is output error; arguments and errors are those of :func:`~.identify.identify`. Without
    keys, all identifiable parameters are estimated. A parameter that is not identifiable keeps its
    value, and the others are estimated without it. Where only a combination of parameters is
    identifiable, the one that was given last keeps its value.
    """

    def estimate(nominal: Ship, free: Sequence[str]) -> Identification:
        return identify(
            nominal, *recordings, free=free, columns=columns, tolerance=tolerance, tick=tick
        )

    left_out: dict[str, str] = {}
    wanted: list[str] = list(keys)
    while True:
        try:
            found = estimate(ship, wanted or AUTO)
        except UnidentifiableError as error:
            left_out |= error.worst
            wanted = error.rest
            if not wanted:
                remark = (
                    "calibration: no parameter is identifiable from the reference period; all keep the "
                    "values of the ship file"
                )
                return Start(ship, ship, left_out=left_out, remarks=(remark,))
        else:
            break
    left_out |= found.left_out
    remarks = [f"calibration: {note}" for note in (*found.limits, *found.warnings)]
    if keys:  # parameters that the user did not choose need no remark
        remarks += [
            f"calibration: {key} keeps the ship file's value: {why}"
            for key, why in left_out.items()
        ]
    # A user who calibrates does not trust the ship file. A parameter that is not identifiable may be off
    # by as much as the limit of identifiability, and would otherwise appear as missing physics. The
    # reference period may still determine its combination with another parameter far better than either,
    # such as that of resistance and thrust deduction. The estimates are therefore repeated while it is
    # uncertain: the correlation of the errors keeps one of both from explaining a later change.
    own, start = found.identified, found.joint or found.identified
    estimated = tuple(one.key for one in found.estimates)
    fixed = [own.parameter(key) for key in left_out if own.has_key(key)]
    if fixed:
        try:
            again = estimate(widen_tolerances(own, fixed, LEAST_CERTAIN), estimated)
            start = again.joint or again.identified
        except UnidentifiableError:
            start = widen_tolerances(start, fixed, LEAST_CERTAIN)
    return Start(ship, start, calibrated=estimated, left_out=left_out, remarks=tuple(remarks))
