"""What was found, with its intervals, windows and regime; and what could not have been found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..search.effect import Effect
from ..search.fitting import Fit, Fitter
from ..search.placed import Placed, Window
from ..search.selection import Candidate, Selection
from ..search.trial_ship import TrialShip
from ..simulate.balances import Balances
from .location import active_windows, regime
from .shapes import signals_of

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
