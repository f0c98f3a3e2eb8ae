"""Diagnose recordings: where they differ from the simulation, and which physics the ship file lacks.

The stages of :func:`diagnose`:

1. Read the recordings and check their channels.
2. Begin: calibrate the ship on a reference period, or widen the tolerances of its free parameters.
3. Hold data out before anything is fitted.
4. Locate: form the residual of each balance, the parameters free within their tolerances.
5. Search the catalogue: screen effects on simulated trajectories under whitened noise and fit them by
   output error.
6. Judge the chosen effects on the held-out data.
7. Report the findings, the residual and the corrected ship.
8. Where a residual remains, estimate effects and parameters together (:mod:`.structure`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from threadpoolctl import threadpool_limits

from ..plant.ship import Ship
from .calibration import calibrate, calibrate_jointly, doubt_parameters
from .diagnosis import Diagnosis
from .estimate import Tick, ignore_progress
from .identification.parameters import (
    MOST_LINEARISATIONS,
    MovableParameters,
    Start,
    find_biased_parameters,
    start_at_recorded_speed,
    start_with_free_parameters,
)
from .judge import correction
from .judge.correction import FreeRunning
from .judge.held_out import HeldOut, Segments, fit_percents
from .judge.shapes import Shape, best_shapes, shape_to_show, signals_of, term_from_shape
from .judge.verdict import (
    EXPLAINED,
    PARTLY,
    SURE_GAIN,
    UNEXPLAINED,
    Verdict,
    active_windows,
    balance_rows,
    explained_shares,
    findings_of,
    is_far_from_noise,
    is_undecidable,
    judge_selection,
    limit_verdict,
    open_models,
    regime,
    sure_effects,
)
from .options import Options
from .recordings.excitation import course_changes, shaft_runs_one_way
from .recordings.joint import (
    JointRecordings,
    Recorded,
    flatten,
    load_each,
    load_jointly,
    refuse_common_rows,
    refuse_repeated_sources,
)
from .recordings.measured_pitch import (
    NOT_OF_THE_COMMAND,
    follow_measured_pitch,
    refuse_free_actuator,
    restore_pitch_actuator,
)
from .recordings.steady_rows import NoDriveCommandError, missing_drive_remark, restore_drive
from .search.catalogue import Effect, Window, applicable_effects, refuse_transient
from .search.fitting import Fit, Fitter, Whiteness
from .search.formulas import Formula, is_as_good, search_formula
from .search.selection import Selection, Selector
from .setting import Setting, Settings
from .simulate.joint_replay import START_STEPS
from .simulate.time_step import ABOUT, restore_time_step, with_longest_time_step
from .structure.diagnose import diagnose_structure

CURRENT = "current"
"""Effect that does not change a speed through the water."""

MOST_IN_REFERENCE = 4
"""Largest number of effects of a reference period by default, one more than of a later recording: what
the ship file lacks there must not appear as a change."""

FINER = 4.0
"""Ratio of the time step to the next shorter one that is tried where an effect acts faster."""

JUDGE = "judging on the held-out data"
"""Stage of the progress, in two steps: the verdict, then the findings and the corrected ship."""

ANOTHER_PERIOD = "calibrate on another period than is diagnosed"


def diagnose(
    ship: Ship | Start,
    *recordings: Recorded,
    hold_out: Sequence[Recorded] = (),
    options: Options = Options(),  # noqa: B008 (immutable)
    tick: Tick = ignore_progress,
) -> Diagnosis:
    """Diagnose recordings of a ship in one condition.

    Args:
        ship: nominal ship; or the result of :func:`begin`, to diagnose many recordings alike.
        recordings: recordings that are fitted together: files (CSV or Parquet), tables, or results of
            ``load_recording``. Files and tables pass the same checks.
        hold_out: recordings that are held out for validation; without any, a quarter of the longest
            recording is held out.
        options: column map, excluded effects, tolerances, reference period, free parameters.
        tick: progress callback ``tick(stage, done, total)``.

    Returns:
        The diagnosis, with ``summary()``, ``to_dict()`` and ``save(folder)``.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: no recording, recordings that do not go together, a recording that is given twice,
            an unknown id or key, or a ship whose simulation diverges under the recorded commands.
        FileNotFoundError: a recording of the reference period does not exist.
        ShipError: the ship cannot be simulated.
    """
    start = ship if isinstance(ship, Start) else Start(ship, ship)

    def run_stages(begun: Start) -> Diagnosis:
        driven = begun if isinstance(ship, Start) else begun.file
        return _run_stages(driven, recordings, hold_out, options, tick)[0]

    try:
        return run_stages(start)
    except NoDriveCommandError:
        diagnosis = run_stages(start_at_recorded_speed(start))
    corrected = restore_drive(diagnosis.corrected, start.file)
    warnings = [missing_drive_remark(start.file), *diagnosis.warnings]
    calibrated = diagnosis.calibrated
    if calibrated is not None:
        calibrated = restore_drive(calibrated, start.file)
    return replace(
        diagnosis,
        ship=start.ship,
        corrected=corrected,
        calibrated=calibrated,
        warnings=warnings,
    )


def _run_stages(
    ship: Ship | Start,
    recordings: Sequence[Recorded],
    hold_out: Sequence[Recorded],
    options: Options,
    tick: Tick,
) -> tuple[Diagnosis, Setting]:
    """Run the stages of a diagnosis with the ship's own prime mover; return its setting as well."""
    file = ship.file if isinstance(ship, Start) else ship
    options.check(file)
    together, reference = _read(file, recordings, hold_out, options, tick)
    options = replace(options, calibrate=reference)
    start = ship if isinstance(ship, Start) else begin(ship, options, tick)
    with threadpool_limits(1, "blas"):
        start = replace(start, ship=options.with_recorded_signals(start.ship, together.signals))
        following = start
        if together.measured_pitch:
            refuse_free_actuator(start.free)
            ship = follow_measured_pitch(start.ship, together.interval_s)
            following = replace(start, ship=ship)
        diagnosis, setting = _find_cause_in_time(following, together, options, tick)
        if together.measured_pitch:
            diagnosis = _with_ships(
                diagnosis, start.ship, lambda found: restore_pitch_actuator(found, start.ship)
            )
        return replace(diagnosis, calibrated=start.ship if start.calibrated else None), setting


def _with_ships(diagnosis: Diagnosis, ship: Ship, restore: Callable[[Ship], Ship]) -> Diagnosis:
    """Return a diagnosis with another nominal ship, and its corrected ships restored alike."""
    alternatives, hidden = (
        {name: restore(other) for name, other in ships.items()}
        for ships in (diagnosis.alternatives, diagnosis.hidden)
    )
    corrected = restore(diagnosis.corrected)
    return replace(
        diagnosis, ship=ship, corrected=corrected, alternatives=alternatives, hidden=hidden
    )


def _find_cause_in_time(
    start: Start, together: JointRecordings, options: Options, tick: Tick
) -> tuple[Diagnosis, Setting]:
    """Find the cause with the longest time step that simulates the recordings as the ship's own does."""
    effects = candidates(start, together, options)
    hosts = [effect.on for effect in effects]
    slower, longest_s = start.ship, math.inf
    while True:
        if not together.steady:
            slower = with_longest_time_step(start.ship, together.tables, hosts, longest_s)
        found = _find_cause(replace(start, ship=slower), together, effects, options, tick)
        if slower is start.ship:
            return found
        diagnosis, setting = found
        restored = _with_ships(
            diagnosis, start.ship, lambda ship: restore_time_step(ship, start.file)
        )
        step_s = slower.time_step_s
        exact = with_longest_time_step(restored.corrected, together.tables, (), step_s, ABOUT)
        longest_s = exact.time_step_s
        times = [e.value for f in restored.findings for e in f.estimates if e.unit == "s"]
        if any(value <= 1.01 * step_s for value in times):
            # An effect that acts faster than the longer time step, such as a short lag.
            longest_s = min(longest_s, step_s / FINER)
        if longest_s > 0.99 * step_s:
            return restored, setting


def _find_cause(
    start: Start, together: JointRecordings, effects: list[Effect], options: Options, tick: Tick
) -> tuple[Diagnosis, Setting]:
    """Locate the mismatch, search its cause, judge it, and report it; stages 3 to 8."""
    settings = _hold_out_and_locate(start, together, effects, options, tick)
    selection, selector = _search(settings, effects, options, tick)
    warnings = [*together.warnings, *settings.remarks()]
    together = replace(together, warnings=warnings)
    tick(JUDGE, 0, 2)
    evidence = _Evidence.of(settings.best, start)
    conclusion = _judge(selection, evidence)
    tick(JUDGE, 1, 2)
    diagnosis = _report(conclusion, evidence, selector, together)
    tick(JUDGE, 2, 2)
    if options.quick or start.free:
        return diagnosis, settings.best
    limits = options.tolerance, options.most_effects, start.calibrated
    diagnosis = diagnose_structure(diagnosis, settings.best, together, effects, tick, *limits)
    return diagnosis, settings.best


def _read(
    ship: Ship,
    recordings: Sequence[Recorded],
    hold_out: Sequence[Recorded],
    options: Options,
    tick: Tick,
) -> tuple[JointRecordings, tuple[Recorded, ...]]:
    """Read the recordings, and those of the reference period; refuse rows that are in both."""
    sources = (*recordings, *hold_out)
    refuse_repeated_sources(sources)
    refuse_repeated_sources(options.calibrate, sources, ANOTHER_PERIOD)
    form = options.columns, tick, options.signals, options.steady
    groups = load_each(ship, (*sources, *options.calibrate), *form)
    fitted, both = len(recordings), len(sources)
    to_fit, to_judge = flatten(groups[:fitted]), flatten(groups[fitted:both])
    reference = flatten(groups[both:])
    together = load_jointly(ship, to_fit, to_judge)
    for one, other in itertools.product(to_fit + to_judge, reference):
        refuse_common_rows(one, other, ANOTHER_PERIOD)
    return together, tuple(reference)


def begin(ship: Ship, options: Options, tick: Tick = ignore_progress) -> Start:
    """Return the ship as a diagnosis starts: calibrated on a reference period, or with free parameters.

    A reference period is diagnosed itself, because physics that the ship file lacks would bias the
    parameters. With keys of the user, these parameters alone are estimated from it.

    Args:
        ship: nominal ship.
        options: options of the diagnosis.
        tick: progress callback ``tick(stage, done, total)``.

    Raises:
        RecordingError: a recording of the reference period cannot be used; names file, column and row.
        ValueError: recordings that do not go together, or a ship whose simulation diverges under the
            recorded commands.
    """
    if not options.calibrate:
        return start_with_free_parameters(ship, options.free)

    def progress(stage: str, done: int, total: int) -> None:
        tick(f"calibrating, {stage}", done, total)

    form = options.columns, progress, options.signals, options.steady
    reference = flatten(load_each(ship, options.calibrate, *form))
    if not options.free:
        doubted = doubt_parameters(ship, [r.table for r in reference], reference[0].steady)
        most = options.most_effects or MOST_IN_REFERENCE
        alone = replace(options, calibrate=(), most_effects=most)
        diagnosis, setting = _run_stages(doubted, reference, (), alone, progress)
        start = calibrate_jointly(ship, diagnosis, setting, options.tolerance)
        if start is not None and reference[0].measured_pitch:
            return replace(start, ship=restore_pitch_actuator(start.ship, ship))
        if start is not None:
            return start
    return calibrate(ship, reference, options.free, options.columns, options.tolerance, progress)


def candidates(start: Start, together: JointRecordings, options: Options) -> list[Effect]:
    """Return the effects that the ship and the recordings allow."""
    tables, ship = together.tables, start.ship
    turning, one_way = course_changes(tables), shaft_runs_one_way(ship, tables)
    excluded = [*options.exclude]
    if together.through_water:
        excluded.append(CURRENT)
    if together.measured_pitch:
        excluded += NOT_OF_THE_COMMAND
    columns, choice = set(tables[0].columns), (tuple(excluded), options.own_effects)
    effects = applicable_effects(ship, columns, *choice, turning, one_way, together.steady)
    if together.steady:
        refuse_transient(ship, start.free)
    return effects


def _hold_out_and_locate(
    start: Start, together: JointRecordings, effects: list[Effect], options: Options, tick: Tick
) -> Settings:
    """Hold data out and form the residuals of the balances, linearised at the free parameters."""
    ship, alone = start.ship, [effect for effect in effects if not effect.together]
    over_s = START_STEPS * start.file.time_step_s
    for _ in range(MOST_LINEARISATIONS):
        settings = Settings(ship, together, alone, options.tolerance, over_s, tick)
        if not start.free:
            break
        nearer = MovableParameters(start, settings.best.fitter).relinearised_ship()
        if nearer is None:
            break
        ship = nearer
    return settings


def _search(
    settings: Settings, effects: list[Effect], options: Options, tick: Tick
) -> tuple[Selection, Selector]:
    """Search effects; once more if they make the other interpolation of the commands likelier."""
    alone = [effect for effect in effects if not effect.together]
    while True:
        selector = Selector(settings.best.fitter, alone, tick, options.most_effects)
        selection = selector.search()
        if not settings.exchange(selection):
            return selection, selector


@dataclass(frozen=True)
class _Evidence:
    """Fitted and held-out data on which a selection of effects is judged."""

    whiteness: Whiteness
    judge: HeldOut
    held: Segments
    free_running: FreeRunning
    parameters: MovableParameters

    @classmethod
    def of(cls, setting: Setting, start: Start) -> _Evidence:
        judge = HeldOut(setting.fitter, setting.held)
        free_running = FreeRunning(setting.balances.replay, judge.rows)
        parameters = MovableParameters(start, setting.fitter)
        return cls(setting.whiteness, judge, setting.held, free_running, parameters)

    @property
    def fitter(self) -> Fitter:
        """Fitter of the fitted data."""
        return self.whiteness.fitter

    @property
    def ship(self) -> Ship:
        """Ship at the start of the diagnosis."""
        return self.parameters.start.ship


class _Conclusion(NamedTuple):
    """Judged effects with their verdict, and the models of the residual that they leave."""

    selection: Selection
    verdict: Verdict
    shape: Shape | None
    formula: Formula | None

    @property
    def is_named(self) -> bool:
        """Whether the verdict reports effects."""
        return self.verdict.name in (EXPLAINED, PARTLY)

    def reported_fit(self, fitter: Fitter) -> Fit:
        """Return the fit with the reported effects."""
        return self.selection.fit if self.is_named else fitter.null


def _judge(selection: Selection, evidence: _Evidence) -> _Conclusion:
    """Judge a selection on the held-out data, and describe the residual that it leaves."""
    fitter, judge, whiteness = evidence.fitter, evidence.judge, evidence.whiteness
    excited = fitter.balances.replay.excited
    selection = correction.settle_episode_edges(selection, fitter, evidence.held, judge.score)
    selection = correction.drop_unconfirmed(selection, fitter, judge.score)
    selection, verdict = _verdict(selection, evidence)
    formula: Formula | None = None
    if verdict.name == EXPLAINED:
        formula = correction.find_better_formula(selection, verdict, whiteness, judge)
        if formula is not None and correction.refutes_effects(formula, selection, whiteness):
            verdict = judge_selection(selection, whiteness, -math.inf, excited)
        elif formula is not None or is_far_from_noise(verdict.left_over, verdict.explained):
            verdict = replace(verdict, name=PARTLY)
    conclusion = _Conclusion(selection, verdict, None, formula)
    if verdict.name not in (PARTLY, UNEXPLAINED) or not (verdict.colour or verdict.left_over):
        return conclusion
    fit = conclusion.reported_fit(fitter)
    colour = verdict.left_over if conclusion.is_named else verdict.colour or verdict.left_over
    shape = shape_to_show(best_shapes(fitter, fit), fitter.balances, colour)
    formula = formula or search_formula(whiteness, fit, judge, judge.rows)
    return conclusion._replace(shape=shape, formula=formula)


def _verdict(selection: Selection, evidence: _Evidence) -> tuple[Selection, Verdict]:
    """Return the verdict, and the effects to which it applies with their alternatives."""
    fitter, judge, whiteness = evidence.fitter, evidence.judge, evidence.whiteness
    excited, names = fitter.balances.replay.excited, fitter.balances.names

    def verdict_on(chosen: Selection, sure: bool) -> tuple[Selection, Verdict]:
        # A residual that is noise leaves nothing unexplained; its share would be one of noise.
        share = 1.0
        if whiteness.colour(chosen.fit) is not None:
            share = float(explained_shares(whiteness, fitter.null, chosen.fit)[-1])
        chosen = correction.add_rivals(chosen, fitter, share)
        gain = judge.score(chosen.fit) - judge.score(fitter.null) if chosen.fit.effects else 0.0
        # Correlated values may be far from the truth in an open-loop simulation, which does not
        # refute an effect with strong evidence.
        weak = sum(chosen.gains) < SURE_GAIN * sum(chosen.thresholds)
        if weak and judge.covers(chosen.fit):
            ships = evidence.parameters.corrected_ships(chosen.fit, judge, judge.rows)
            if not correction.is_any_confirmed(evidence.ship, ships, judge, evidence.free_running):
                gain = -math.inf
        return chosen, judge_selection(chosen, whiteness, gain, excited, sure)

    whole = verdict_on(selection, False)
    if whole[1].name != UNEXPLAINED or not selection.fit.effects or not excited:
        return whole
    rows = balance_rows(fitter, selection.fit)
    shapes = {shape.balance: shape.gain for shape in best_shapes(fitter, fitter.null)}
    # An effect is not the missing physics where a free shape over one signal fits better.
    gains, least = selection.gains, [shapes.get(names[row], 0.0) for row in rows]
    sure = [i for i in sure_effects(selection, rows, whiteness) if gains[i] >= least[i]]
    if not sure:
        return whole
    part = verdict_on(correction.keep_effects(selection, fitter, sure), True)
    return part if part[1].name == PARTLY else whole


def _correct(conclusion: _Conclusion, evidence: _Evidence) -> tuple[Ship, float, list[str]]:
    """Return the corrected ship, its gain in 2 log L, and channels that the first candidate worsens."""
    ship, judge, (_, verdict, shape, formula) = evidence.ship, evidence.judge, conclusion
    fit = conclusion.reported_fit(evidence.fitter)
    candidates = evidence.parameters.corrected_ships(fit, judge, judge.rows)
    with_effects = candidates[0]
    # A shape or formula that the held-out data do not confirm is reported and not used.
    if shape is not None and (term := term_from_shape(shape, ship)) is not None:
        candidates.insert(0, with_effects.with_term(term))
    if formula is not None and verdict.name != EXPLAINED:
        with_formula = with_effects.with_term(formula.term)
        start, other = judge(ship.record()), judge(candidates[0].record())
        first = is_as_good(judge(with_formula.record()) - start, other - start)
        candidates.insert(0 if first else 1, with_formula)
    return correction.corrected_ship(ship, candidates, judge, evidence.free_running)


def _report(
    conclusion: _Conclusion, evidence: _Evidence, selector: Selector, together: JointRecordings
) -> Diagnosis:
    """Return the diagnosis of a conclusion, with the simulations before and after the correction."""
    selection, verdict, shape, formula = conclusion
    fitter, parameters, ship = evidence.fitter, evidence.parameters, evidence.ship
    balances, replay, rows = fitter.balances, fitter.balances.replay, evidence.judge.rows
    measured, fit = replay.recorded, conclusion.reported_fit(fitter)
    # The free parameters are at their linearised values.
    lacking = balances.residuals_against(balances.nominal)
    findings = findings_of(fitter, selection, lacking) if conclusion.is_named else []
    corrected, gain, worse = _correct(conclusion, evidence)
    uncorrected = bool(findings) and corrected == ship
    warnings = correction.uncorrected_remarks(worse) if uncorrected else []
    # A record refers to signals by position, so the simulations need all signals of the replay.
    before, after = (replay.simulate_channels(s.record()) for s in (ship, corrected))
    changes = parameters.changes(fit, corrected)
    undecidable = is_undecidable(replay.excited, together.limits)
    biased, refuted = any(c.is_biased for c in changes), uncorrected and evidence.judge.covers(fit)
    name = limit_verdict(verdict.name, undecidable, biased, refuted)
    if corrected.signals:
        corrected = corrected.with_signals({n: ship.signals[n] for n in corrected.external_signals})
    fit_before = fit_percents(measured, before, rows)
    constant = [c for c in measured if c not in fit_before]
    lost = [f"{c} is constant on the held-out data: no FitPercent" for c in constant]
    windows: list[Window] = []
    where, interval = "", replay.interval_s
    if shape is not None:
        windows = active_windows(shape.trace, interval, float(replay.time_s[-1]))
        where = regime(shape.trace, signals_of(fitter, fitter.null))
    left = open_models(fitter, selection, selector.threshold, name, bool(findings), undecidable)
    return Diagnosis(
        verdict=name, ship=ship, corrected=corrected, time_s=replay.time_s,
        held_out=[(a * interval, b * interval) for a, b in evidence.held],
        drive=replay.drive_rows, measured=measured, before=before, after=after,
        balances=list(zip(balances.names, balances.units, strict=True)),
        residual_before=balances.residuals_against(before),
        residual_after=balances.residuals_against(after),
        findings=findings, shape=shape, shape_windows=windows, shape_regime=where,
        balance_verdicts=verdict.balances, undecidable=undecidable, explained=verdict.explained,
        left_over=verdict.left_over,
        ranking=[(c, selector.threshold(c.effect)) for c in selection.ranking],
        tried=tuple(c.effect.label for c in selection.ranking),
        detectable=left.detectable,
        fit_before=fit_before, fit_after=fit_percents(measured, after, rows),
        held_out_gain=float(gain), excited=replay.excited, line=replay.line,
        highest_Hz=fitter.bands.highest_Hz, rows_averaged=replay.every, limits=together.limits,
        warnings=[*together.warnings, *lost, *parameters.start.remarks, *warnings],
        parameters=changes, formula=formula,
        inputs={
            "pitch_ratio_command": replay.command, "inflow": replay.inflow_rows, **replay.outside,
        },
        biased=find_biased_parameters(fitter, selection) if conclusion.is_named else [],
        alternatives=left.alternatives,
        hidden=left.hidden,
    )  # fmt: skip
