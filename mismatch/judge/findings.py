"""When and under which conditions a mismatch acts: windows of time and regimes of operation.

What was found, with its intervals, windows and regime; and what could not have been found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..search.catalogue import Effect, Placed, Window
from ..search.fitting import Fit, Fitter
from ..search.selection import Candidate, Selection
from ..search.trial_ship import TrialShip
from ..simulate.balances import Balances
from .shapes import signals_of

GAP_S = 20.0
"""Stretches that are less than this apart are one [s]."""

ACTIVE_SHARE = 0.1
"""An effect acts where its trace is above this share of its largest."""


def active_windows(
    trace: NDArray[np.float64], interval_s: float, duration_s: float
) -> list[Window]:
    """Stretches in which an effect's trace is felt; the whole recording where they are most of it.

    Args:
        trace: what the effect changes in its balance, shape (rows,).
        interval_s: [s].
        duration_s: length of the recording [s].
    """
    size = max(1, round(5.0 / interval_s))
    strength = np.convolve(np.abs(trace), np.ones(size) / size, mode="same")
    top = float(np.quantile(strength, 0.98))
    if top <= 0.0:
        return []
    active = strength > ACTIVE_SHARE * top
    if active.mean() > 0.6:
        return [(0.0, duration_s)]
    gap = max(1, round(GAP_S / interval_s))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
    merged: list[list[int]] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if merged and a - merged[-1][1] < gap:
            merged[-1][1] = int(b)
        else:
            merged.append([int(a), int(b)])
    return [(a * interval_s, min(b * interval_s, duration_s)) for a, b in merged]


def regime(trace: NDArray[np.float64], signals: dict[str, tuple[Any, str]]) -> str:
    """The operating regime that holds most of an effect, in words; empty where there is none.

    Args:
        trace: what the effect changes in its balance, shape (rows,).
        signals: by name, the simulated signal and its unit; ``time`` is none, windows tell that.
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


FORM_SHARE = 0.15
"""Share of its size that an effect's interval has on either side whatever the noise: a catalogue's form
is never quite the truth's. Where concealed effects had other forms, one value in ten was off by more."""

_AT_BOUND = 1e-6
"""Share of a bound within which a value counts as the bound."""


@dataclass(frozen=True)
class Finding:
    """An effect that the recording shows.

    Args:
        effect: the catalogue's entry.
        estimates: its parameters, in its order.
        score: what it brings in 2 log L, the other effects present.
        threshold: that it had to pass, in 2 log L.
        rivals: names that the recording cannot tell from it.
        trace: what it changes in its balance, shape (rows,).
        row: index of that balance.
        windows: in which it acts [s].
        regime: in words; empty where it acts everywhere.
        unmeasured: what its balance lacks to be measured, or which parameter ended at the bound of its
            search, so that its size is a guess and has no interval; else empty.
        implausible: which parameter lies outside the range that physics allows, in words; else empty.
    """

    effect: Effect
    estimates: tuple[Estimate, ...]
    score: float
    threshold: float
    rivals: tuple[Candidate, ...]
    trace: NDArray[np.float64]
    row: int
    windows: list[Window]
    regime: str
    unmeasured: str = ""
    implausible: str = ""


@dataclass(frozen=True)
class Detectable:
    """The smallest value of an effect that this recording would have shown."""

    effect: Effect
    value: float  # distance from neutral, in the parameter's unit
    unit: str


def _row(balances: Balances, effect: Effect, traces: NDArray[np.float64], scale: Any) -> int:
    """Balance in which an effect is shown: its own, or the one that feels it most."""
    if effect.balance in balances.names:
        return balances.names.index(effect.balance)
    felt = np.sqrt(np.mean(traces**2, axis=1)) / scale
    return int(np.argmax(felt))


def unmeasured(effect: Effect, balances: Balances) -> str:
    """What the balance in which an effect acts lacks to be measured; empty where nothing is lacking."""
    replay = balances.replay
    if effect.balance == "hull" and not balances.moving:
        return "without a speed log the hull's balance is not measured"
    if effect.balance == "sway" and "sway" not in balances.names:
        return "without a sway speed the balance across is not measured"
    if effect.balance == "yaw" and "yaw" not in balances.names:
        return "without a rate of turn or a heading the balance of the turn is not measured"
    one_shaft = replay.ship.has_line_shaft and replay.ship.turns_freely
    if effect.balance in ("engine", "propeller") and one_shaft and not balances.gauged:
        return "without a torque gauge the engine's and the propeller's side are one balance"
    return ""


def at_bound(trial_ship: TrialShip, placed: Placed) -> str:
    """Which parameter of an effect ended at a bound of its search, in words; empty where none did.

    Such a value is where the search stopped, not an estimate. The value at which the effect is absent
    may itself be a bound, and is not counted; nor is that at which it is whole.
    """
    for parameter, value in placed.pairs:
        absent = trial_ship.origin(parameter)
        low, high = trial_ship.range_of(parameter)
        for bound in (low,) if parameter.whole else (low, high):
            if bound != absent and math.isclose(value, bound, rel_tol=_AT_BOUND):
                name = parameter.key.split(".")[-1]
                return f"{name} ended at the bound of its search, {bound:.4g}"
    return ""


def implausible(trial_ship: TrialShip, placed: Placed) -> str:
    """Return which parameter of an effect lies outside its plausible range; empty where none does."""
    for parameter, value in placed.pairs:
        low, high = trial_ship.plausible_range(parameter)
        if not low <= value <= high:
            unit = parameter.number(trial_ship.ship).info.unit
            unit = "" if unit == "-" else f" {unit}"
            return (
                f"{parameter.name} lies outside its plausible range, {low:.4g} to {high:.4g}{unit}"
            )
    return ""


def shown_in(fitter: Fitter, fit: Fit) -> list[int]:
    """Balance in which each effect of a model is shown, by index."""
    balances = fitter.balances
    lacking = balances.lacking(balances.nominal)
    scale = np.sqrt(np.mean(lacking**2, axis=1)) + 1e-300
    return [
        _row(balances, placed.effect, traces, scale)
        for placed, traces in zip(fit.effects, _traces(fitter, fit), strict=True)
    ]


def _traces(fitter: Fitter, fit: Fit) -> list[NDArray[np.float64]]:
    """What each effect of a model changes in the balances, the others present, shape (m, rows)."""

    def of(effects: tuple[Placed, ...]) -> NDArray[np.float64]:
        balances = fitter.balances
        return balances.residuals(balances.replay.channels_of(fitter.trial_ship.record(effects)))

    everything = of(fit.effects)
    return [
        everything - of(fit.effects[:i] + fit.effects[i + 1 :]) for i in range(len(fit.effects))
    ]


def findings_of(
    fitter: Fitter, selection: Selection, lacking: NDArray[np.float64]
) -> list[Finding]:
    """The chosen effects with intervals, traces, windows and regimes."""
    balances, replay = fitter.balances, fitter.balances.replay
    fit = selection.fit
    estimates = fitter.estimates(fit, FORM_SHARE)
    signals = signals_of(fitter, fit)
    duration = float(replay.time_s[-1])
    scale = np.sqrt(np.mean(lacking**2, axis=1)) + 1e-300
    found = []
    for i, (placed, traces) in enumerate(zip(fit.effects, _traces(fitter, fit), strict=True)):
        row = _row(balances, placed.effect, traces, scale)
        windows = (
            [placed.window]
            if placed.window is not None
            else active_windows(traces[row], replay.interval_s, duration)
        )
        whole = windows == [(0.0, duration)] or placed.window is not None
        where = "" if whole else regime(traces[row], signals)
        found.append(
            Finding(placed.effect, estimates[i], selection.gains[i], selection.thresholds[i],
                    selection.rivals[i], traces[row], row, windows, where,
                    unmeasured(placed.effect, balances) or at_bound(fitter.trial_ship, placed),
                    implausible(fitter.trial_ship, placed))
        )  # fmt: skip
    return found


def detectable_effects(
    fitter: Fitter, threshold: Callable[[Effect], float], fit: Fit, effects: list[Effect]
) -> list[Detectable]:
    """From the curvature of the likelihood at the smallest probe of each effect of one parameter."""
    base = fitter.predicted(fitter.trial_ship.record(fit.effects))
    found = []
    for effect in effects:
        if len(effect.parameters) != 1 or effect.windowed:
            continue
        parameter = effect.parameters[0]
        probes = fitter.trial_ship.probes(parameter)
        neutral = fitter.trial_ship.neutral(parameter)
        if not probes or not np.isfinite(neutral):
            continue
        probe = min(probes, key=lambda p: abs(p - neutral))
        moved = fitter.predicted(fitter.trial_ship.record((*fit.effects, Placed(effect, (probe,)))))
        information = fitter.likelihood.information(fit.weight, (moved - base)[None])
        variance = float(np.linalg.pinv(information)[0, 0])
        if variance > 0.0 and information[0, 0] > 1e-9:
            size = abs(probe - neutral) * np.sqrt(threshold(effect) * variance)
            unit = parameter.number(fitter.trial_ship.ship).info.unit
            found.append(Detectable(effect, float(size), unit))
    return found
