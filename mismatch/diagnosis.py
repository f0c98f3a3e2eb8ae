"""Diagnose a recording: where it differs from the simulation, what physics is missing, and the proof.

The order follows what the evidence recommends: set data aside before anything is fitted; form the
residuals balance by balance; let nominal numbers move inside their tolerances first; screen the
catalogue on simulated trajectories under whitened noise; fit by output error; judge on the data set
aside.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..plant.ship import Ship
from .judge.confirmation import close_call, confirmed, explained_share, shape_to_show
from .judge.findings import Detectable, Finding, detectable_effects, findings_of
from .judge.held_out import Segments, bands_of, held_out_judge, set_aside
from .judge.location import active_windows, change_points, regime, windows_between
from .judge.shapes import Shape, best_shapes, signals_of
from .judge.whiteness import Colour, Whiteness
from .recordings.noise import describe
from .search.catalogue import applicable
from .search.fitting import Fitter
from .search.placed import Window
from .search.selection import TELL_APART, Candidate, Selector, Tick
from .simulate.balances import PART_OF, Balances
from .simulate.joint_replay import JointReplay

EXPLAINED_SHARE = 0.8
"""Named effects must explain this share of the residual's power beyond the noise, where what is left is
more than noise; else they are not the truth and the verdict is ``unexplained``."""


EXPLAINED, NOTHING, UNEXPLAINED = "explained", "nothing-missing", "unexplained"


@dataclass(frozen=True)
class Diagnosis:
    """Everything that the reports tell.

    Args:
        verdict: ``explained``, ``nothing-missing`` or ``unexplained``.
        ship: nominal.
        corrected: with the effects, or the shape, that were found.
        time_s: shape (rows,).
        held_out: windows set aside [s].
        drive: demand on the prime mover [mm | V | N m], shape (rows,).
        measured: channels by column, each of shape (rows,); likewise the next two.
        before: nominal open-loop simulation.
        after: corrected open-loop simulation.
        balances: names of the balances, and their units.
        residual_before: what each balance lacks, shape (balances, rows).
        residual_after: likewise with the corrected ship.
        findings: effects, in the order of discovery.
        shape: the missing quantity without a name, where the verdict is ``unexplained``; then the
            windows and the regime in which it acts.
        explained: share of the residual's power beyond the instruments' noise that the effects explain.
        left_over: where what they leave is more than noise; None where it is noise.
        ranking: the catalogue, best first, and each entry's threshold.
        detectable: smallest effects that the recording would have shown.
        fit_before: FitPercent by column on the held-out part; likewise ``fit_after``.
        held_out_gain: in 2 log L, on the held-out part alone.
        excited: whether the demands move enough to tell effects apart.
        limits: why the recording may not decide.
        warnings: what was noticed about the recording.
    """

    verdict: str
    ship: Ship
    corrected: Ship
    time_s: NDArray[np.float64]
    held_out: list[Window]
    drive: NDArray[np.float64]
    measured: dict[str, NDArray[np.float64]]
    before: dict[str, NDArray[np.float64]]
    after: dict[str, NDArray[np.float64]]
    balances: list[tuple[str, str]]
    residual_before: NDArray[np.float64]
    residual_after: NDArray[np.float64]
    findings: list[Finding]
    shape: Shape | None
    shape_windows: list[Window]
    shape_regime: str
    explained: float
    left_over: Colour | None
    ranking: list[tuple[Candidate, float]]
    detectable: list[Detectable]
    fit_before: dict[str, float]
    fit_after: dict[str, float]
    held_out_gain: float
    excited: bool
    limits: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def fit_percent(measured: Any, simulated: Any) -> float:
    """FitPercent = 100 (1 - ||y - y_sim|| / ||y - mean(y)||)."""
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    if spread == 0.0:
        return 0.0
    return 100.0 * (1.0 - float(np.linalg.norm(measured - simulated)) / spread)


def diagnose(
    ship: Ship,
    *tables: pd.DataFrame,
    exclude: Iterable[str] = (),
    held_out_runs: int = 0,
    tolerance: float = 1.0,
    limits: Iterable[str] = (),
    warnings: Iterable[str] = (),
    tick: Tick = lambda stage, done, total: None,
) -> Diagnosis:
    """Compare a ship with recordings of it.

    Args:
        ship: the nominal ship.
        tables: recordings with canonical columns at an even interval; all of one condition of the ship.
        exclude: ids of the catalogue to leave out.
        held_out_runs: how many of the last recordings are set aside; 0 sets aside a quarter of one.
        tolerance: factor on the tolerances of the nominal numbers.
        limits: why the recording may not decide, from its checks.
        warnings: from its checks.
        tick: told the stage, how much is done, and how much there is.

    Raises:
        ValueError: recordings that do not go together, or an unknown id.
        ShipError: a ship that cannot be simulated.
    """
    with threadpool_limits(1, "blas"):
        replay = JointReplay(ship, *tables)
        balances = Balances(replay)
        noise = {
            c: describe(tables[0][c].to_numpy(dtype=np.float64), replay.interval_s).white_rms
            for c in replay.channels
        }
        whiteness, held = _parted(balances, held_out_runs, tolerance, noise)
        effects = applicable(ship, set(tables[0].columns), exclude)
        selector = Selector(whiteness.fitter, effects, _episodes(balances), tick)
        return _judged(selector, whiteness, held, list(limits), list(warnings))


def _parted(
    balances: Balances, runs: int, tolerance: float, noise: dict[str, float]
) -> tuple[Whiteness, Segments]:
    """Set data aside; not a part that alone holds all that is missing, for nothing could be learnt."""
    parted = []
    for train, held in set_aside(balances.replay, runs):
        fitter = Fitter(balances, bands_of(balances, train), tolerance)
        parted.append((Whiteness(fitter, noise), held))
        if parted[-1][0].colour(fitter.null) is not None:
            return parted[-1]
    return parted[0]


def _episodes(balances: Balances) -> list[Window]:
    """Windows in which an episode of resistance may lie."""
    if "hull" not in balances.names or len(balances.replay.segments) > 1:
        return []
    row = balances.lacking(balances.nominal)[balances.names.index("hull")]
    interval = balances.replay.interval_s
    changes = change_points(row, interval)
    return windows_between(changes, float(balances.replay.time_s[-1]))


def _judged(
    selector: Selector,
    whiteness: Whiteness,
    held: Segments,
    limits: list[str],
    warnings: list[str],
) -> Diagnosis:
    fitter, tick = selector.fitter, selector.tick
    balances, replay = fitter.balances, fitter.balances.replay
    selection = selector.search()
    tick("judging on the data set aside", 0, 1)
    measured = replay.measured()
    lacking = balances.lacking(balances.nominal)
    judge = held_out_judge(fitter, held)
    selection = confirmed(selection, fitter, judge)
    fit = selection.fit
    nominal = judge(fitter.workshop.nominal)
    gain = judge(fitter.workshop.record(fit.effects)) - nominal
    colour, left_over = whiteness.colour(fitter.null), whiteness.colour(fit)
    explained = explained_share(whiteness, fitter.null, fit)
    veto = bool(fit.effects) and gain < -TELL_APART
    several = len(fit.effects) > 1 or any(selection.rivals) or close_call(selection)
    undecided = bool(fit.effects) and not replay.excited and several
    not_the_truth = left_over is not None and explained < EXPLAINED_SHARE
    shape: Shape | None = None
    verdict = EXPLAINED if fit.effects else NOTHING
    if veto or undecided or not_the_truth or not fit.effects:
        # what was named does not hold, or nothing was: is there more than noise at all?
        verdict = UNEXPLAINED if colour is not None or undecided or not_the_truth else NOTHING
    if verdict == UNEXPLAINED:
        shape = shape_to_show(best_shapes(fitter, fitter.null), balances, colour or left_over)
    misfit = math.sqrt(max(1.0 - explained, 0.0))
    findings = findings_of(fitter, selection, lacking, misfit) if verdict == EXPLAINED else []
    windows: list[Window] = []
    where = ""
    if shape is not None:
        windows = active_windows(shape.trace, replay.interval_s, float(replay.time_s[-1]))
        signals = signals_of(fitter, fitter.null)
        where = regime(shape.trace, {k: v for k, v in signals.items() if k != "time"})
    corrected = fitter.workshop.corrected(fit.effects if findings else ())
    if shape is not None and shape.balance not in PART_OF:
        shaped = _with_shape(corrected, shape)
        gain = judge(shaped.record()) - nominal
        if gain > 0.0:  # a shape that does not hold on data set aside is shown, not used
            corrected = shaped
    before = balances.nominal
    samples = replay.simulate(corrected.record())
    after = replay.simulated(samples)
    rows = np.concatenate([np.arange(a, b) for a, b in held])
    interval = replay.interval_s
    diagnosis = Diagnosis(
        verdict=verdict,
        ship=replay.ship,
        corrected=corrected,
        time_s=replay.time_s,
        held_out=[(a * interval, b * interval) for a, b in held],
        drive=replay.drive_rows,
        measured=measured,
        before=before,
        after=after,
        balances=list(zip(balances.names, balances.units, strict=True)),
        residual_before=lacking,
        residual_after=balances.lacking(after),
        findings=findings,
        shape=shape,
        shape_windows=windows,
        shape_regime=where,
        explained=explained,
        left_over=left_over,
        ranking=[(c, selector.threshold(c.effect)) for c in selection.ranking],
        detectable=detectable_effects(
            fitter, selector.threshold, fit if findings else fitter.null,
            [c.effect for c in selection.ranking],
        ),
        fit_before={c: fit_percent(measured[c][rows], before[c][rows]) for c in measured},
        fit_after={c: fit_percent(measured[c][rows], after[c][rows]) for c in measured},
        held_out_gain=float(gain),
        excited=replay.excited,
        limits=limits,
        warnings=warnings,
    )  # fmt: skip
    tick("judging on the data set aside", 1, 1)
    return diagnosis


def _with_shape(ship: Ship, shape: Shape) -> Ship:
    """The ship with the missing quantity switched on."""
    values = np.asarray(shape.values)
    balance = "engine" if shape.balance == "motor" else shape.balance
    if balance == "pitch-actuator":
        values = values / ship.pitch_actuator.time_constant_s
    return ship.with_values(
        {
            "unexplained.balance": balance,
            "unexplained.signal": shape.signal,
            "unexplained.knots": [float(x) for x in shape.knots],
            "unexplained.values": [float(x) for x in values],
        }
    )
