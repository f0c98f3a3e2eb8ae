"""Judge whether chosen effects hold and whether the residual is noise, and describe the effects.

Each balance has its own verdict, so that an effect in one balance is reported even if the residual of
another balance is not explained. A finding is an identified effect with its intervals, time windows and
operating regime.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...core.rows import true_runs
from ...core.statistics import covariance_of
from ...plant.ship import Ship, ShipError
from ..estimate import Estimate
from ..search.catalogue import Effect, SizedEffect, Window
from ..search.fitting import Colour, Fit, Fitter, Whiteness
from ..search.selection import (
    INDISTINGUISHABLE,
    Candidate,
    Selection,
    are_confusable,
    p_value,
)
from ..search.trial_ship import TrialShip
from ..simulate.balances import Balances
from ..simulate.joint_replay import Floats
from .shapes import signals_of

EXPLAINED, PARTLY = "explained", "partly-explained"
NOTHING, UNEXPLAINED = "nothing-missing", "unexplained"
"""Verdicts."""

MOST_LEFT = 100.0
"""Largest ratio of residual to noise power, in any frequency band, of an explained recording: ten times
the amplitude of the noise. A larger ratio is allowed if :data:`NEARLY_ALL` is explained."""

NEARLY_ALL = 0.99
"""Explained share of the power beyond noise that leaves a tenth of the amplitude of the difference."""

EXPLAINED_SHARE = 0.8
"""Least share of the power beyond noise that effects must explain if the residual is more than noise."""

LOST_SHARE = 0.05
"""Share by which effects may increase the power beyond noise, because this power is not known more
accurately. Effects that increase it by more explain nothing."""

SURE_SHARE, SURE_GAIN = 0.5, 10.0
"""Explained share, and gain in thresholds, from which an effect holds beside other missing physics."""

CLOSE_SHARE = 0.6
"""Share of the best effect's gain from which the second best is close to it."""

FORM_SHARE = 0.15
"""Smallest half-width of an effect's interval as a share of its size. It remains without noise, because
the forms of the catalogue are approximations: of concealed effects with other forms, one value in ten
had a larger error."""

AT_BOUND = 1e-6
"""Relative distance from a bound within which a value counts as at the bound."""

SENSOR_OF_BALANCE = {"hull": "speed log", "sway": "sway speed", "yaw": "rate of turn or a heading"}
"""Measurement without which a balance is not measured."""

GAP_S = 20.0
"""Windows with a smaller gap between them are joined [s]."""

ACTIVE_SHARE = 0.1
"""Share of the largest value of its trace above which an effect counts as active."""


@dataclass(frozen=True)
class BalanceVerdict:
    """Verdict on one balance with the reported model."""

    name: str  # name of the balance
    verdict: str  # verdict on this balance alone
    explained: float  # explained share of its residual's power beyond noise; 1 if there was none
    left: Colour | None  # frequency band in which its residual exceeds noise; None if it is noise


@dataclass(frozen=True)
class Verdict:
    """Verdict on recordings with its reasons."""

    name: str  # :data:`EXPLAINED`, :data:`PARTLY`, :data:`NOTHING` or :data:`UNEXPLAINED`
    explained: float  # share of the residual's power beyond noise that the effects explain
    colour: Colour | None  # band in which the residual without effects exceeds noise, if any
    left_over: Colour | None  # likewise of the residual with the effects
    balances: tuple[BalanceVerdict, ...]  # verdict on each balance


def judge_selection(
    selection: Selection, whiteness: Whiteness, gain: float, excited: bool, sure: bool = False
) -> Verdict:
    """Return the verdict on the effects that a search has chosen.

    Args:
        selection: chosen and confirmed effects.
        whiteness: whiteness test of the residuals.
        gain: gain of the effects in 2 log L on the held-out data; minus infinity if the ship with them
            loses a channel there.
        excited: whether the commands move enough to distinguish effects.
        sure: whether each effect holds independently of the residual.
    """
    null, fit = whiteness.fitter.null, selection.fit
    colour, left_over = whiteness.colour(null), whiteness.colour(fit)
    explained = float(explained_shares(whiteness, null, fit)[-1])
    several = len(fit.effects) > 1 or any(selection.rivals) or is_close_call(selection)
    undecided = bool(fit.effects) and not excited and several
    helps = gain >= -INDISTINGUISHABLE and explained >= -LOST_SHARE
    holds = bool(fit.effects) and helps and not undecided
    complete = left_over is None or explained >= EXPLAINED_SHARE
    if holds and complete and not doubts(whiteness.fitter.trial_ship, fit.effects):
        name = EXPLAINED
    elif holds and (sure or complete):
        name = PARTLY
    else:
        # No effect holds. The verdict nothing-missing requires that the residual is noise.
        remains = colour is not None or undecided or (holds and not complete)
        name = UNEXPLAINED if remains else NOTHING
    reported = fit if name in (EXPLAINED, PARTLY) else null
    return Verdict(name, explained, colour, left_over, balance_verdicts(whiteness, reported))


MOST_ALTERNATIVES = 3
"""Largest number of other models of which ships are kept."""

NEARLY = 0.5
"""Share of its threshold from which an effect that is not identified counts as an alternative."""


def alternative_ships(
    fitter: Fitter,
    selection: Selection,
    threshold: Callable[[Effect], float],
    verdict: str,
    named: bool,
) -> dict[str, Ship]:
    """Return ships of the models that the recordings cannot distinguish from the reported one.

    Each has a rival in place of an identified effect. Where no effect is identified, each has an effect
    that is nearly significant, in addition to the nominal ship. Where nothing is missing, there is none.

    Args:
        fitter: fitter of the recordings.
        selection: chosen effects with their rivals.
        threshold: function from an effect to the gain that it must exceed.
        verdict: name of the verdict.
        named: whether the chosen effects are reported.
    """
    if verdict == NOTHING:
        return {}
    effects = selection.fit.effects
    models: dict[str, tuple[SizedEffect, ...]] = {}
    if named:
        for i, rivals in enumerate(selection.rivals):
            rest = tuple(one for k, one in enumerate(effects) if k != i)
            models |= {c.effect.label: (*rest, c.sized_effect) for c in rivals}
    else:
        models = {
            c.effect.label: (c.sized_effect,)
            for c in selection.ranking
            if c.gain >= NEARLY * threshold(c.effect)
        }
    ships = {}
    for label, model in list(models.items())[:MOST_ALTERNATIVES]:
        with contextlib.suppress(ShipError):  # values that the time step does not resolve
            ships[label] = fitter.trial_ship.corrected(model)
    return ships


def limit_verdict(name: str, undecidable: bool, biased: bool, refuted: bool = False) -> str:
    """Return the verdict that the recordings, the parameters and the held-out data allow.

    Args:
        name: name of the verdict on the effects.
        undecidable: whether the recordings are too short or excite too little.
        biased: whether a parameter lies far outside the ship file's tolerance.
        refuted: whether no ship with the effects fits the held-out data better in open loop.

    >>> limit_verdict("explained", False, biased=True)
    'partly-explained'
    """
    if name == NOTHING and (undecidable or biased):
        return UNEXPLAINED
    return PARTLY if name == EXPLAINED and (biased or refuted) else name


def is_undecidable(excited: bool, limits: Sequence[str]) -> bool:
    """Return whether recordings are too short, or excite too little, for the verdict nothing-missing.

    Args:
        excited: whether the commands move enough to distinguish effects.
        limits: limits of the recordings, a sentence each.

    >>> is_undecidable(False, ["the commands are constant"]), is_undecidable(True, [])
    (True, False)
    """
    return bool(limits) and (not excited or any("too short" in said for said in limits))


def is_far_from_noise(left_over: Colour | None, explained: float) -> bool:
    """Return whether a residual exceeds the noise too far, at its explained share, to be explained."""
    return left_over is not None and left_over.ratio > MOST_LEFT and explained < NEARLY_ALL


def is_close_call(selection: Selection) -> bool:
    """Return whether the gain of the second best effect is close to that of the best."""
    gains = [c.gain for c in selection.ranking[:2]]
    return len(gains) == 2 and gains[1] > CLOSE_SHARE * gains[0]


def sure_effects(selection: Selection, rows: list[int], whiteness: Whiteness) -> list[int]:
    """Return the indices of the effects that hold even if other physics is missing.

    ``rows`` has the row of each effect's balance.
    """
    shares = explained_shares(whiteness, whiteness.fitter.null, selection.fit)[rows]
    strong = np.array(selection.gains) >= SURE_GAIN * np.array(selection.thresholds)
    indices: list[int] = np.flatnonzero((shares >= SURE_SHARE) & strong).tolist()
    return indices


def balance_verdicts(
    whiteness: Whiteness, fit: Fit, file: Whiteness | None = None
) -> tuple[BalanceVerdict, ...]:
    """Return the verdict on each balance with the reported model; ``file`` is as in explained_shares."""
    file = whiteness if file is None else file
    null, verdicts = file.fitter.null, []
    shares = explained_shares(whiteness, null, fit, file)
    for row, balance in enumerate(whiteness.fitter.balances.names):
        before, left = file.colour(null, row), whiteness.colour(fit, row)
        share = float(shares[row])
        if before is None and left is None:
            verdict, share = NOTHING, 1.0
        elif left is None or share >= EXPLAINED_SHARE:
            verdict = EXPLAINED
        elif share >= SURE_SHARE:
            verdict = PARTLY
        else:
            verdict = UNEXPLAINED
        verdicts.append(BalanceVerdict(balance, verdict, share, left))
    return tuple(verdicts)


def explained_shares(
    whiteness: Whiteness, without: Fit, fit: Fit, file: Whiteness | None = None
) -> np.ndarray:
    """Return the share of the residual's power beyond noise that a model explains.

    The shape is (balances + 1,); the last value is that of all balances together. ``without`` is the
    model without effects, and ``file`` its whiteness test if its parameters differ.
    """
    pairs = ((whiteness if file is None else file, without), (whiteness, fit))
    before, after = (np.maximum(w.ratios(f) - 1.0, 0.0).sum(axis=0) for w, f in pairs)
    before, after = np.append(before, before.sum()), np.append(after, after.sum())
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = 1.0 - after / before
    return np.where(before > 0.0, shares, np.where(after > 0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Finding:
    """Effect that was identified in a recording.

    Args:
        effect: entry of the catalogue.
        estimates: estimates of its parameters, in the entry's order.
        score: gain in 2 log L beside the other effects.
        threshold: gain in 2 log L that the effect had to exceed.
        rivals: effects that the recording cannot distinguish from it.
        trace: change of its balance by the effect, shape (rows,).
        row: index of the balance.
        windows: windows in which it acts [s].
        regime: operating regime in which it acts, in words; empty if it acts everywhere.
        unmeasured: why its size has no interval: a missing measurement, or a parameter at the bound of
            its search; else empty.
        implausible: parameter outside its plausible range, in words; else empty.
    """

    effect: Effect
    estimates: tuple[Estimate, ...]
    score: float
    threshold: float
    rivals: tuple[Candidate, ...]
    trace: Floats
    row: int
    windows: list[Window]
    regime: str
    unmeasured: str = ""
    implausible: str = ""

    @property
    def p_value(self) -> float:
        """Probability that any candidate gains as much by chance where nothing is missing."""
        return p_value(self.effect, self.score, self.threshold)

    @property
    def sized(self) -> SizedEffect:
        """The effect with its estimates as values."""
        return SizedEffect(self.effect, tuple(estimate.value for estimate in self.estimates))


def findings_of(fitter: Fitter, selection: Selection, lacking: Floats) -> list[Finding]:
    """Return the chosen effects with intervals, traces, windows and regimes.

    ``lacking`` are the residuals of the nominal ship, shape (balances, rows).
    """
    replay, trial_ship, fit = fitter.balances.replay, fitter.trial_ship, selection.fit
    estimates, signals = fitter.estimates(fit, FORM_SHARE), signals_of(fitter, fit)
    duration, findings = float(replay.time_s[-1]), []
    for i, (row, trace) in enumerate(_rows_and_traces(fitter, fit, lacking)):
        sized = fit.effects[i]
        windows, where = [sized.window] if sized.window is not None else [], ""
        if sized.window is None:
            windows = active_windows(trace, replay.interval_s, duration)
            where = "" if windows == [(0.0, duration)] else regime(trace, signals)
        lacking_sensor = missing_measurement(sized.effect, fitter.balances)
        unmeasured = lacking_sensor or parameter_at_bound(trial_ship, sized)
        implausible = implausible_parameter(trial_ship, sized)
        evidence = selection.gains[i], selection.thresholds[i], selection.rivals[i]
        finding = Finding(
            sized.effect,
            estimates[i],
            *evidence,
            trace,
            row,
            windows,
            where,
            unmeasured,
            implausible,
        )
        findings.append(finding)
    return findings


def balance_rows(fitter: Fitter, fit: Fit) -> list[int]:
    """Return the row of the balance of each effect of a model."""
    lacking = fitter.balances.residuals_against(fitter.balances.nominal)
    return [row for row, _ in _rows_and_traces(fitter, fit, lacking)]


def _rows_and_traces(fitter: Fitter, fit: Fit, lacking: Floats) -> Iterator[tuple[int, Floats]]:
    """Yield the row of each effect's balance, and how the effect changes this balance, shape (rows,).

    The balance is that of the catalogue. If this balance is not measured, it is the balance with the
    largest change relative to its residual.
    """
    balances = fitter.balances
    scale = np.sqrt(np.mean(lacking**2, axis=1)) + 1e-300

    def residuals(effects: tuple[SizedEffect, ...]) -> Floats:
        record = fitter.trial_ship.record(effects)
        return balances.residuals(balances.replay.simulate_channels(record))

    everything = residuals(fit.effects)
    for i, sized in enumerate(fit.effects):
        traces = everything - residuals(fit.effects[:i] + fit.effects[i + 1 :])
        if sized.effect.balance in balances.names:
            row = balances.names.index(sized.effect.balance)
        else:
            row = int(np.argmax(np.sqrt(np.mean(traces**2, axis=1)) / scale))
        yield row, traces[row]


def active_windows(trace: Floats, interval_s: float, duration_s: float) -> list[Window]:
    """Return the time windows in which an effect is active; the whole recording if it mostly is.

    Args:
        trace: change of the balance by the effect, shape (rows,).
        interval_s: sampling interval [s].
        duration_s: length of the recording [s].

    >>> active_windows(np.repeat([0.0, 1.0, 0.0, 0.0], 100), 1.0, 400.0)
    [(98.0, 202.0)]
    """
    size = max(1, round(5.0 / interval_s))
    strength = np.convolve(np.abs(trace), np.ones(size) / size, mode="same")
    top = float(np.quantile(strength, 0.98))
    if top <= 0.0:
        return []
    active = strength > ACTIVE_SHARE * top
    if active.mean() > 0.6:
        return [(0.0, duration_s)]
    for first, end in true_runs(~active):
        inside = first > 0 and end < len(active)
        if inside and end - first < max(1, round(GAP_S / interval_s)):
            active[first:end] = True
    return [(a * interval_s, min(b * interval_s, duration_s)) for a, b in true_runs(active)]


def regime(trace: Floats, signals: dict[str, tuple[Any, str]]) -> str:
    """Return the operating regime in which an effect acts, in words; empty if it is not limited to one.

    Args:
        trace: change of the balance by the effect, shape (rows,).
        signals: simulated signals with their units by name; ``time`` is ignored.

    >>> speed = np.linspace(5.0, 12.0, 200)
    >>> regime(np.where(speed > 10.6, 1.0, 0.0), {"shaft_speed": (speed, "rad/s")})
    'shaft_speed above 10.6 rad/s'
    """
    energy = np.square(trace)
    total = float(energy.sum())
    if total <= 0.0:
        return ""
    best, words = 0.0, ""
    for name, (signal, unit) in signals.items():
        values = np.asarray(signal, dtype=np.float64)
        if name == "time" or np.ptp(values) < 1e-3 * (np.abs(values).max() + 1e-12):
            continue
        for share in (0.2, 0.35, 0.5):
            for above in (True, False):
                edge = float(np.quantile(values, 1.0 - share if above else share))
                inside = values >= edge if above else values <= edge
                held = float(energy[inside].sum()) / total
                merit = held - float(inside.mean())
                if held > 0.8 and merit > max(best, 0.35):
                    side = "above" if above else "below"
                    best, words = merit, f"{name} {side} {edge:.3g} {unit}".strip()
    return words


def missing_measurement(effect: Effect, balances: Balances) -> str:
    """Return, in words, the measurement that the balance of an effect lacks; empty if there is none."""
    ship, name = balances.replay.ship, effect.balance
    if name in SENSOR_OF_BALANCE and name not in balances.names:
        return f"without a {SENSOR_OF_BALANCE[name]} the {name} balance is not measured"
    one_shaft = ship.has_line_shaft and ship.turns_freely
    if name in ("engine", "propeller") and one_shaft and not balances.has_torque:
        return "without a shaft torque meter the engine and propeller sides are one balance"
    return ""


def doubts(trial_ship: TrialShip, effects: Iterable[SizedEffect]) -> list[str]:
    """Return, in words, the parameters at a bound or implausible; they indicate another cause."""
    checks = (parameter_at_bound, implausible_parameter)
    return [text for effect in effects for check in checks if (text := check(trial_ship, effect))]


def parameter_at_bound(trial_ship: TrialShip, effect: SizedEffect) -> str:
    """Return, in words, the parameter of an effect at a bound of its search; empty if there is none.

    A value at a bound is no estimate. Bounds at which the effect is absent or complete do not count.
    """
    for parameter, value in effect.pairs:
        absent = trial_ship.origin(parameter)
        low, high = trial_ship.range_of(parameter)
        for bound in (low,) if parameter.whole else (low, high):
            if bound != absent and math.isclose(value, bound, rel_tol=AT_BOUND):
                return f"{parameter.name} is at the bound of its search, {bound:.4g}"
    return ""


def implausible_parameter(trial_ship: TrialShip, effect: SizedEffect) -> str:
    """Return, in words, the parameter outside its plausible range; empty if there is none."""
    for parameter, value in effect.pairs:
        low, high = trial_ship.plausible_range(parameter)
        if not low <= value <= high:
            unit = parameter.in_ship(trial_ship.ship).info.unit
            ends = f"{low:.4g} to {high:.4g}" + ("" if unit == "-" else f" {unit}")
            return f"{parameter.name} lies outside its plausible range, {ends}"
    return ""


@dataclass(frozen=True)
class Detectable:
    """Smallest size of an effect at which a diagnosis of the recording would report it."""

    sized: SizedEffect  # with this size of its first parameter, within what the ship file allows
    value: float  # distance of the first parameter from neutral, in its unit
    unit: str

    @property
    def effect(self) -> Effect:
        """Entry of the catalogue."""
        return self.sized.effect


def detectable_effects(
    fitter: Fitter, threshold: Callable[[Effect], float], fit: Fit, effects: Iterable[Effect]
) -> list[Detectable]:
    """Return the smallest detectable size of each effect, added to a model.

    The size is that of the first parameter, with the others at their smallest probes. It follows from
    the curvature of the likelihood at the smallest probe of the effect, and from ``threshold``, which
    returns the threshold of an effect in 2 log L.
    """
    trial_ship, detectable = fitter.trial_ship, []
    probes = []
    for effect in effects:
        probe = next(trial_ship.smallest_trials(effect, []), None)
        finite = np.isfinite(trial_ship.neutral(effect.parameters[0]))
        if probe is not None and not effect.windowed and finite:
            probes.append(probe)
    models = [fit.effects, *((*fit.effects, probe) for probe in probes)]
    predictions = fitter.predictions(list(map(trial_ship.record, models)))
    base = next(predictions)
    for probe, prediction in zip(probes, predictions, strict=True):
        parameter = probe.effect.parameters[0]
        neutral, change = trial_ship.neutral(parameter), prediction - base
        if not np.isfinite(change).all():  # The simulation diverges.
            continue
        information = fitter.likelihood.information(fit.weight, change[None])
        variance = float(covariance_of(information)[0, 0])
        if variance > 0.0 and information[0, 0] > 1e-9:
            side = (probe.values[0] - neutral) * math.sqrt(threshold(probe.effect) * variance)
            plausible, bounds = (
                trial_ship.plausible_range(parameter),
                trial_ship.range_of(parameter),
            )
            value = float(np.clip(np.clip(neutral + side, *plausible), *bounds))
            sized = probe.with_values((value, *probe.values[1:]))
            unit = parameter.in_ship(trial_ship.ship).info.unit
            detectable.append(Detectable(sized, abs(side), unit))
    return detectable


class OpenModels(NamedTuple):
    """Models that recordings leave open."""

    detectable: list[Detectable]  # smallest detectable effects of one parameter
    alternatives: dict[str, Ship]  # ships of :func:`alternative_ships`
    hidden: dict[str, Ship]  # ships of :func:`hidden_ships`


def open_models(
    fitter: Fitter,
    selection: Selection,
    threshold: Callable[[Effect], float],
    verdict: str,
    named: bool,
    undecidable: bool,
) -> OpenModels:
    """Return the models that recordings leave open.

    The first five arguments are those of :func:`alternative_ships`. Recordings without an identified
    effect may hide those that can be confused with an alternative. Undecidable recordings without an
    alternative may hide any effect.
    """
    alternatives = alternative_ships(fitter, selection, threshold, verdict, named)
    tried = [candidate.effect for candidate in selection.ranking]
    hides = [] if named else _hideable(tried, alternatives, undecidable)
    base = selection.fit if named else fitter.null
    sought = [effect for effect in tried if len(effect.parameters) == 1 or effect in hides]
    found = detectable_effects(fitter, threshold, base, sought)
    hidden = hidden_ships(fitter.trial_ship, (one for one in found if one.effect in hides))
    found = [one for one in found if len(one.effect.parameters) == 1]
    return OpenModels(found, alternatives, hidden)


def _hideable(
    tried: Sequence[Effect], alternatives: Collection[str], undecidable: bool
) -> list[Effect]:
    """Return the effects that recordings without an identified effect may hide."""
    others = [effect for effect in tried if effect.label in alternatives]
    if not others:
        return [*tried] if undecidable else []
    return [
        effect
        for effect in tried
        if effect not in others and any(are_confusable(effect, other) for other in others)
    ]


def hidden_ships(trial_ship: TrialShip, detectable: Iterable[Detectable]) -> dict[str, Ship]:
    """Return ships with one effect each of the size that the recordings would just have shown.

    A recording with too little excitation may hide any of them.
    """
    ships = {}
    for one in detectable:
        with contextlib.suppress(ShipError):  # values that the time step does not resolve
            ships[one.effect.label] = trial_ship.corrected((one.sized,))
    return ships
