"""Diagnosis by the structure search: the chosen model, judged on held-out data."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np

from ...plant.ship import Ship
from ...plant.ship_errors import ShipError
from ..diagnosis import Diagnosis
from ..estimate import Estimate
from ..judge.findings import (
    FORM_SHARE,
    Finding,
    at_bound,
    detectable_effects,
    findings_of,
    implausible,
)
from ..judge.fit import fits
from ..judge.held_out import HeldOut, bands_of
from ..judge.verdict import (
    EXPLAINED,
    NOTHING,
    PARTLY,
    UNEXPLAINED,
    balance_verdicts,
    too_little,
)
from ..judge.whiteness import Whiteness
from ..numbers.moved import TOLD, MovedNumber
from ..numbers.wrong import WrongNumber
from ..progress import Tick
from ..recordings.joint import JointRecordings
from ..search.effect import Effect
from ..search.fitting import Fit, Fitter
from ..search.selection import Candidate, Selection
from ..setting import Setting
from ..simulate.balances import Balances
from ..simulate.joint_replay import JointReplay
from .choice import Ranked, choose, total
from .model import Floats, Model
from .naming import named
from .output_error import OutputError
from .priors import Prior
from .search import StructureSearch

OF_NOISE = 2.0
"""Times the noise of every channel up to which the error on data set aside counts as explained."""

CLOSER = 0.8
"""Share of the first diagnosis's held-out error that the model of this search must come below, as the
channels' geometric mean. Otherwise the first diagnosis stands: it knows effects that act for a time."""

MOST_VALUES = 120_000
"""Values of a recording, rows times channels, above which the search would take too long."""

BETTER = 0.9
"""Share of the error of the ship without effects, all numbers refitted, that effects must come below."""


def diagnose_structure(
    first: Diagnosis,
    setting: Setting,
    together: JointRecordings,
    effects: list[Effect],
    tick: Tick,
    tolerance: float = 1.0,
    most: int | None = None,
) -> Diagnosis | None:
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
        The diagnosis; None where the first one is within the noise, or as close to the held-out data.
    """
    fitter, replay = setting.fitter, setting.balances.replay
    if replay.rows * len(replay.channels) > MOST_VALUES:
        return None
    segments = list(zip(fitter.bands.starts, fitter.bands.ends, strict=True))
    highest = fitter.bands.highest_Hz
    problem = OutputError(setting.balances, segments, setting.held, tolerance, highest)
    corrected = JointReplay(
        first.corrected, *together.tables, line=replay.line, every=replay.every
    )
    rival = OutputError(Balances(corrected), segments, setting.held, 0.0)
    residual = rival.held_residual(rival.file_model())
    noise = np.array([replay.noise_rms[c] for c in problem.names])
    if np.all(rival.likelihood.rms(residual) <= OF_NOISE * noise):
        return None
    search = StructureSearch(problem, effects, tick, most)
    quick = [problem.held_error(model) for model in search.quick_pass()]
    if min(total(error, rival.likelihood.rms(residual)) for error in quick) > CLOSER:
        return None
    ranked = search.search()
    nothing = problem.held_error(problem.file_model())
    best, alike = choose(ranked, nothing)
    if total(best.compared, rival.likelihood.rms(residual, search.limit)) > CLOSER:
        return None
    found = _diagnosed(first.ship, problem, search, ranked, best, alike, setting, together)
    return None if found.verdict == UNEXPLAINED else found


def _diagnosed(
    file: Ship,
    problem: OutputError,
    search: StructureSearch,
    ranked: list[Ranked],
    best: Ranked,
    alike: list[Ranked],
    setting: Setting,
    together: JointRecordings,
) -> Diagnosis:
    """Return the diagnosis that a chosen model amounts to."""
    nothing = problem.held_error(problem.file_model())
    fitter = setting.fitter
    segments = list(zip(fitter.bands.starts, fitter.bands.ends, strict=True))
    rows = problem.held_rows
    plain = next(one for one in ranked if not one.model.effects)
    model, replaced = named(search, best.model)
    if replaced:
        held = problem.held_error(model)
        best = Ranked(model, search.merit(model), held, held)
        alike = []

    ship = _with_numbers(file, problem, model)
    replay = setting.balances.replay
    own = Balances(JointReplay(ship, *together.tables, line=replay.line, every=replay.every))
    moved = Fitter(own, bands_of(own, segments, fitter.bands.highest_Hz), problem.tolerance)
    fit = moved.fitted(model.effects)
    whiteness = Whiteness(moved, replay.noise_rms, replay.quantisation)
    selection = _selection(moved, fit, best, alike, ranked, search)
    shares = [w.ratios(f) for w, f in ((setting.whiteness, fitter.null), (whiteness, fit))]
    before, after = (float(np.maximum(s - 1.0, 0.0).sum()) for s in shares)
    verdict = _verdict(best, nothing if replaced else plain.held, problem, whiteness, fit)

    undecidable = too_little(replay.excited, together.limits)
    if verdict == NOTHING and undecidable:  # which is not the same
        verdict = UNEXPLAINED
    holds = verdict in (EXPLAINED, PARTLY)
    carried = holds or verdict == NOTHING
    corrected = moved.trial_ship.corrected(fit.effects) if carried else file
    lacking = own.lacking(own.nominal)
    findings = findings_of(moved, selection, lacking) if holds else []
    findings = [
        replace(finding, estimates=estimates)
        for finding, estimates in zip(findings, _estimates(problem, model, moved), strict=False)
    ]
    judge = HeldOut(fitter, setting.held)
    gain = judge(corrected.record()) - judge(file.record())
    measured = replay.recorded
    sailed = replay.simulated(replay.simulate(file.record()))
    followed = dict(zip(problem.names, problem.simulate(model), strict=True))
    if corrected == file:
        followed = sailed
    interval = replay.interval_s
    return Diagnosis(
        verdict=verdict,
        ship=file,
        corrected=corrected,
        time_s=replay.time_s,
        held_out=[(a * interval, b * interval) for a, b in setting.held],
        drive=replay.drive_rows,
        measured=measured,
        before=sailed,
        after=followed,
        balances=list(zip(own.names, own.units, strict=True)),
        residual_before=setting.balances.lacking(sailed),
        residual_after=setting.balances.lacking(followed),
        findings=findings,
        shape=None,
        shape_windows=[],
        shape_regime="",
        balance_verdicts=balance_verdicts(whiteness, fit if holds else moved.null, verdict),
        explained=1.0 - after / before if before > 0.0 else 1.0,
        left_over=whiteness.colour(fit),
        ranking=[(c, search.threshold(c.effect)) for c in selection.ranking],
        detectable=detectable_effects(
            moved, search.threshold, fit, [c.effect for c in selection.ranking]
        ),
        fit_before=fits(measured, sailed, rows),
        fit_after=fits(measured, followed, rows),
        held_out_gain=float(gain),
        excited=replay.excited,
        line=replay.line,
        highest_Hz=fitter.bands.highest_Hz,
        rows_averaged=replay.every,
        limits=together.limits,
        undecidable=undecidable,
        warnings=[*together.warnings, *(_remarks(best, problem, nothing) if carried else [])],
        numbers=_numbers(file, problem, model, corrected) if carried else [],
        wrong=[_wrong(file, replaced, finding) for finding in findings],
    )


def _with_numbers(file: Ship, problem: OutputError, model: Model) -> Ship:
    """The ship of the file with the numbers that a model has moved."""
    values = {}
    for doubt, moved in zip(problem.priors, model.shifts, strict=True):
        if abs(moved) > 0.1 * doubt.near:
            number = file.number(doubt.key)
            value = float(np.clip(doubt.value_at(float(moved)), *number.searched))
            values[doubt.key] = number.info.inside(value)
    with contextlib.suppress(ShipError):  # two numbers that do not go together
        return file.with_values(values) if values else file
    return file


def _verdict(
    best: Ranked, plain: Floats, problem: OutputError, whiteness: Whiteness, fit: Fit
) -> str:
    """What may be said of the model that was chosen."""
    noise = np.array([problem.replay.noise_rms[c] for c in problem.names])
    quiet = bool(np.all(best.held <= OF_NOISE * np.maximum(noise, 1e-300)))
    white = whiteness.colour(fit) is None
    if not best.model.effects:
        return NOTHING if quiet or white else UNEXPLAINED
    if total(best.held, plain) > BETTER and not (quiet or white):
        return UNEXPLAINED
    ship = problem.trial_ship
    doubted = any(at_bound(ship, placed) or implausible(ship, placed) for placed in fit.effects)
    sound = not doubted and not problem.moved_far(best.model)
    return EXPLAINED if (quiet or white) and sound else PARTLY


def _selection(
    moved: Fitter,
    fit: Fit,
    best: Ranked,
    alike: list[Ranked],
    ranked: list[Ranked],
    search: StructureSearch,
) -> Selection:
    """A model in the words of the other search: each effect's gain, threshold and rivals."""
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
                instead.append(_candidate(moved, other[0].effect, one))
        rivals.append(tuple(instead))
    singles = [one for one in ranked if len(one.model.effects) == 1]
    return Selection(
        fit,
        tuple(gains),
        tuple(search.threshold(placed.effect) for placed in best.model.effects),
        tuple(rivals),
        tuple(_candidate(moved, one.model.effects[0].effect, one) for one in singles),
    )


def _candidate(moved: Fitter, effect: Effect, one: Ranked) -> Candidate:
    """An effect of another model, with that model's merit."""
    placed = next(p for p in one.model.effects if p.effect is effect)
    return Candidate(effect, replace(moved.null, effects=(placed,)), one.merit)


def _estimates(problem: OutputError, model: Model, moved: Fitter) -> list[tuple[Estimate, ...]]:
    """Every effect's values with their errors, all other free values unsure as well."""
    errors = problem.standard_errors(model)
    host = moved.trial_ship.host(model.effects)
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


def _numbers(file: Ship, problem: OutputError, model: Model, corrected: Ship) -> list[MovedNumber]:
    """The numbers that the model has moved."""
    errors = problem.standard_errors(model)
    found = []
    for k, (doubt, moved) in enumerate(zip(problem.priors, model.shifts, strict=True)):
        shifts = float(moved) / doubt.near
        if abs(shifts) < TOLD:
            continue
        number = file.number(doubt.key)
        value = doubt.value_at(float(moved))
        spread = float(errors[k]) * (value if doubt.ratio else 1.0)
        found.append(
            MovedNumber(
                doubt.key, number.info.unit, number.value, value, abs(spread), shifts, "tolerance",
                corrected.number(doubt.key).value,
            )
        )  # fmt: skip
    return found


def _wrong(file: Ship, replaced: dict[str, list[Prior]], finding: Finding) -> WrongNumber | None:
    """The number of the file that would explain a finding as well."""
    doubts = replaced.get(finding.effect.label, [])
    if len(doubts) != 1:
        return None
    doubt = doubts[0]
    number = file.number(doubt.key)
    return WrongNumber(doubt.key, number.value, doubt.value, number.info.unit, finding.score)


def _remarks(best: Ranked, problem: OutputError, nothing: np.ndarray) -> list[str]:
    """What a reader must know of the error on data set aside and of numbers that moved far."""
    said = [
        f"{column}: error on the data set aside {before:.4g} as the file has it, {after:.4g} now"
        for column, before, after in zip(problem.names, nothing, best.held, strict=True)
    ]
    for k in sorted(problem.moved_far(best.model)):
        doubt, moved = problem.priors[k], float(best.model.shifts[k])
        said.append(
            f"{doubt.key} moved from {doubt.value:.4g} to {doubt.value_at(moved):.4g}, "
            f"{abs(moved) / doubt.near:.0f} tolerances: the file's tolerance or its number is wrong"
        )
    return said
