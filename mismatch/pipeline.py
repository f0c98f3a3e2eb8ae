"""Diagnose recordings: where they differ from the simulation, what physics is missing, and the proof.

The order follows what the evidence recommends: set data aside before anything is fitted; form the
residuals balance by balance; let nominal numbers move inside their tolerances first; screen the
catalogue on simulated trajectories under whitened noise; fit by output error; judge on the data set
aside.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from ..plant.ship import Ship
from .calibration import calibrated
from .diagnosis import Diagnosis
from .estimate import Tick, silent
from .identification.parameters import MOST_ROUNDS, Numbers, wrong_numbers
from .identification.start import Start, led_start, widened
from .judge.confirmation import (
    confirmed,
    formula_instead,
    only,
    refuted,
    settled_edges,
    with_rivals,
)
from .judge.correction import FreeRunning, corrected_ship, followed, not_carried
from .judge.findings import active_windows, detectable_effects, findings_of, regime, shown_in
from .judge.held_out import HeldOut, Segments, fits
from .judge.shapes import Shape, best_shapes, shape_to_show, signals_of, term_of
from .judge.verdict import (
    EXPLAINED,
    PARTLY,
    SURE_GAIN,
    UNEXPLAINED,
    Verdict,
    explained_shares,
    far_from_noise,
    limited,
    sure_effects,
    too_little,
    verdict_of,
)
from .options import Options
from .recordings.excitation import one_way, turned
from .recordings.joint import (
    JointRecordings,
    Recorded,
    load_each,
    load_jointly,
    parts_of,
    refuse_shared,
    refuse_twice,
)
from .recordings.steady_rows import NoDriveCommandError, remark_on, with_drive_of
from .search.catalogue import Window, applicable, refuse_transient
from .search.fitting import Fitter
from .search.formulas import Formula, as_well, formula_of
from .search.selection import Selection, Selector
from .search.whiteness import Whiteness
from .setting import Settings
from .structure.diagnose import diagnose_structure

ANOTHER_PERIOD = "calibrate on another period than is diagnosed"


def diagnose(
    ship: Ship | Start,
    *recordings: Recorded,
    hold_out: Sequence[Recorded] = (),
    options: Options = Options(),  # noqa: B008 (immutable)
    tick: Tick = silent,
) -> Diagnosis:
    """Compare a ship with recordings of one condition of it.

    Args:
        ship: the nominal ship; or what :func:`begin` made of it, where several are diagnosed alike.
        recordings: to be fitted, together: files (CSV or Parquet) or tables, which pass the same
            checks; or what ``load_recording`` made of them.
        hold_out: likewise, set aside to judge on; without any, a quarter of the longest is set aside.
        options: column map, ids to leave out, tolerance; a healthy period, numbers that are free.
        tick: told the stage, how much is done, and how much there is.

    Returns:
        The diagnosis, with ``summary()``, ``to_dict()`` and ``save(folder)``.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: no recording, recordings that do not go together, one that is given twice, an
            unknown id or key, or a ship that runs away under the recorded demands.
        FileNotFoundError: a recording of the healthy period that is not there.
        ShipError: a ship that cannot be simulated.
    """
    begun = ship if isinstance(ship, Start) else Start(ship, ship)
    try:
        return _read_and_diagnosed(ship, recordings, hold_out, options, tick)
    except NoDriveCommandError:
        led = led_start(begun)
        found = _read_and_diagnosed(
            led if isinstance(ship, Start) else led.file, recordings, hold_out, options, tick
        )
    return replace(
        found, ship=begun.ship, corrected=with_drive_of(found.corrected, begun.file),
        warnings=[remark_on(begun.file), *found.warnings],
    )  # fmt: skip


def _read_and_diagnosed(
    ship: Ship | Start,
    recordings: Sequence[Recorded],
    hold_out: Sequence[Recorded],
    options: Options,
    tick: Tick,
) -> Diagnosis:
    """Return the diagnosis of recordings that are read with a ship's own drive."""
    file = ship.file if isinstance(ship, Start) else ship
    options.check(file)
    refuse_twice((*recordings, *hold_out))
    refuse_twice(options.calibrate, (*recordings, *hold_out), ANOTHER_PERIOD)
    fitted, held = len(recordings), len(hold_out)
    sources = (*recordings, *hold_out, *options.calibrate)
    groups = load_each(file, sources, options.columns, tick, options.signals, options.steady)
    to_fit, aside = parts_of(groups[:fitted]), parts_of(groups[fitted : fitted + held])
    healthy = parts_of(groups[fitted + held :])
    together = load_jointly(file, to_fit, aside)
    for one, other in itertools.product(to_fit + aside, healthy):
        refuse_shared(one, other, ANOTHER_PERIOD)
    options = replace(options, calibrate=tuple(healthy))
    start = ship if isinstance(ship, Start) else begin(ship, options, tick)
    return _diagnosed(start, together, options, tick)


def begin(ship: Ship, options: Options, tick: Tick = silent) -> Start:
    """The ship with which a diagnosis begins: calibrated on a healthy period, or with numbers free.

    Args:
        ship: the nominal ship.
        options: of the diagnosis.
        tick: told the stage, how much is done, and how much there is.

    Raises:
        RecordingError: a recording of the healthy period cannot be used; names file, column and row.
        ValueError: recordings that do not go together, or a ship that runs away under their demands.
    """
    if not options.calibrate:
        return widened(ship, options.free)
    sources, tolerance = options.calibrate, options.tolerance
    healthy = parts_of(
        load_each(ship, sources, options.columns, tick, options.signals, options.steady)
    )
    return calibrated(ship, healthy, options.free, options.columns, tolerance, tick)


def _diagnosed(start: Start, together: JointRecordings, options: Options, tick: Tick) -> Diagnosis:
    """Recordings that were read, with a ship whose numbers are as :func:`begin` has them."""
    with threadpool_limits(1, "blas"):
        start = replace(start, ship=options.hearing(start.ship, together.signals))
        columns = set(together.tables[0].columns)
        tables = together.tables
        every = applicable(
            start.ship, columns, options.exclude, options.own_effects,
            turned(tables), one_way(start.ship, tables), together.steady,
        )  # fmt: skip
        effects = [effect for effect in every if not effect.together]
        if together.steady:
            refuse_transient(start.ship, start.free)
        ship = start.ship
        for _ in range(MOST_ROUNDS):
            settings = Settings(ship, together, effects, options.tolerance)
            nearer = Numbers(start, settings.best.fitter).relinearised() if start.free else None
            if nearer is None:
                break
            ship = nearer
        while True:
            whiteness, held = settings.best.whiteness, settings.best.held
            selector = Selector(whiteness.fitter, effects, tick, options.most_effects)
            selection = selector.search()
            if not settings.corrected(selection):
                break
        numbers = Numbers(start, whiteness.fitter)
        together.warnings.extend(settings.remarks())
        tick("judging on the data set aside", 0, 1)
        diagnosis = _judged(selection, selector, whiteness, held, together, numbers)
        tick("judging on the data set aside", 1, 1)
        if options.quick or start.free:
            return diagnosis
        return diagnose_structure(
            diagnosis, settings.best, together, every, tick, options.tolerance,
            options.most_effects,
        )  # fmt: skip


def _judged(
    selection: Selection,
    selector: Selector,
    whiteness: Whiteness,
    held: Segments,
    together: JointRecordings,
    numbers: Numbers,
) -> Diagnosis:
    """What the search has found, judged on the data set aside and located."""
    fitter = selector.fitter
    balances, replay = fitter.balances, fitter.balances.replay
    measured = replay.recorded
    lacking = balances.lacking(balances.nominal)  # with the free numbers where they are
    judge = HeldOut(fitter, held)
    selection = settled_edges(selection, fitter, held, judge.score)
    selection = confirmed(selection, fitter, judge.score)
    free = FreeRunning(replay, judge.rows)
    selection, verdict = _verdict(selection, fitter, whiteness, judge, numbers, free)
    formula: Formula | None = None
    if verdict.name == EXPLAINED:
        formula = formula_instead(selection, verdict, whiteness, judge)
        if formula is not None and refuted(formula, selection, whiteness):
            verdict = verdict_of(selection, whiteness, -math.inf, replay.excited)
        elif formula is not None or far_from_noise(verdict.left_over, verdict.explained):
            verdict = replace(verdict, name=PARTLY)
    undecidable = too_little(replay.excited, together.limits)
    fit = selection.fit
    named = verdict.name in (EXPLAINED, PARTLY)
    told = fit if named else fitter.null
    findings = findings_of(fitter, selection, lacking) if named else []
    shape: Shape | None = None
    windows: list[Window] = []
    where = ""
    ship, rows = numbers.start.ship, judge.rows
    if verdict.name in (PARTLY, UNEXPLAINED) and (verdict.colour or verdict.left_over):
        shapes = best_shapes(fitter, told)
        colour = verdict.left_over if named else verdict.colour or verdict.left_over
        shape = shape_to_show(shapes, balances, colour)
        formula = formula or formula_of(whiteness, told, judge, rows)
    if shape is not None:
        windows, where = _located(shape, fitter)
    candidates = numbers.candidates(told, judge, rows)
    carried = candidates[0]
    # a shape or formula that does not hold on data set aside is shown, not used
    if shape is not None and (term := term_of(shape, ship)) is not None:
        candidates.insert(0, carried.with_term(term))
    if formula is not None and verdict.name != EXPLAINED:
        spelled = carried.with_term(formula.term)
        start, other = judge(ship.record()), judge(candidates[0].record())
        first = as_well(judge(spelled.record()) - start, other - start)
        candidates.insert(0 if first else 1, spelled)
    corrected, gain, spoilt = corrected_ship(ship, candidates, judge, free)
    warnings = not_carried(spoilt) if findings and corrected == ship else []
    # with all signals of the replay, for a record hears them by their place
    before, after = (replay.simulated(replay.simulate(s.record())) for s in (ship, corrected))
    parameters = numbers.told(told, corrected)
    biased = any(n.is_biased for n in parameters)
    verdict = replace(verdict, name=limited(verdict.name, undecidable, biased))
    if corrected.signals:
        corrected = corrected.with_signals({n: ship.signals[n] for n in corrected.hears})
    fit_before = fits(measured, before, rows)
    constant = [
        f"{column} is constant on the part set aside: no FitPercent"
        for column in measured
        if column not in fit_before
    ]
    return Diagnosis(
        verdict=verdict.name,
        ship=ship,
        corrected=corrected,
        time_s=replay.time_s,
        held_out=[(a * replay.interval_s, b * replay.interval_s) for a, b in held],
        drive=replay.drive_rows,
        measured=measured,
        before=before,
        after=after,
        balances=list(zip(balances.names, balances.units, strict=True)),
        residual_before=balances.lacking(before),
        residual_after=balances.lacking(after),
        findings=findings,
        shape=shape,
        shape_windows=windows,
        shape_regime=where,
        balance_verdicts=verdict.balances,
        undecidable=undecidable,
        explained=verdict.explained,
        left_over=verdict.left_over,
        ranking=[(c, selector.threshold(c.effect)) for c in selection.ranking],
        detectable=detectable_effects(
            fitter, selector.threshold, fit if findings else fitter.null,
            [c.effect for c in selection.ranking],
        ),
        fit_before=fit_before,
        fit_after=fits(measured, after, rows),
        held_out_gain=float(gain),
        excited=replay.excited,
        line=replay.line,
        highest_Hz=fitter.bands.highest_Hz,
        rows_averaged=replay.every,
        limits=together.limits,
        warnings=together.warnings + constant + list(numbers.start.remarks) + warnings,
        numbers=parameters,
        wrong=wrong_numbers(fitter, selection) if named else [],
        formula=formula,
    )  # fmt: skip


def _verdict(
    selection: Selection,
    fitter: Fitter,
    whiteness: Whiteness,
    judge: HeldOut,
    numbers: Numbers,
    free: FreeRunning,
) -> tuple[Selection, Verdict]:
    """The verdict, and what of the selection it speaks of, with what would have done as well."""
    replay, ship = fitter.balances.replay, numbers.start.ship

    def said(chosen: Selection, sure: bool) -> tuple[Selection, Verdict]:
        share = float(explained_shares(whiteness, fitter.null, chosen.fit)[-1])
        chosen = with_rivals(chosen, fitter, share)
        gain = judge.score(chosen.fit) - judge.score(fitter.null) if chosen.fit.effects else 0.0
        # values on a ridge run freely far from the truth: what is sure is not refuted by that
        weak = sum(chosen.gains) < SURE_GAIN * sum(chosen.thresholds)
        if weak and judge.covers(chosen.fit):
            ships = numbers.candidates(chosen.fit, judge, judge.rows)
            if not followed(ship, ships, judge, free):
                gain = -math.inf
        return chosen, verdict_of(chosen, whiteness, gain, replay.excited, sure)

    told = said(selection, False)
    if told[1].name != UNEXPLAINED or not selection.fit.effects or not replay.excited:
        return told
    rows = shown_in(fitter, selection.fit)
    nameless = {s.balance: s.gain for s in best_shapes(fitter, fitter.null)}
    names = fitter.balances.names
    # where a free shape over one signal does better, the name is not the truth's
    sure = [
        i
        for i in sure_effects(selection, rows, whiteness)
        if selection.gains[i] >= nameless.get(names[rows[i]], 0.0)
    ]
    if not sure:
        return told
    held = said(only(selection, fitter, sure), True)
    return held if held[1].name == PARTLY else told


def _located(shape: Shape, fitter: Fitter) -> tuple[list[Window], str]:
    """Windows and regime in which a shape acts."""
    replay = fitter.balances.replay
    windows = active_windows(shape.trace, replay.interval_s, float(replay.time_s[-1]))
    return windows, regime(shape.trace, signals_of(fitter, fitter.null))
