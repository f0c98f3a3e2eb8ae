"""Findings: identified effects with intervals, windows of time and operating regime."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..search.catalogue import Effect, SizedEffect, Window
from ..search.fitting import Fit, Fitter
from ..search.selection import Candidate, Selection
from ..search.trial_ship import TrialShip
from ..simulate.balances import Balances
from .shapes import signals_of

GAP_S = 20.0
"""Windows with a smaller gap between them are joined [s]."""

ACTIVE_SHARE = 0.1
"""Share of the largest value of its trace above which an effect counts as active."""


def active_windows(
    trace: NDArray[np.float64], interval_s: float, duration_s: float
) -> list[Window]:
    """Return the windows in which an effect is active; the whole recording if they are most of it.

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
    """Return the operating regime that contains most of an effect, in words; empty without one.

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


FORM_SHARE = 0.15
"""Half-width of an effect's interval without noise, as a share of its size, because the forms of the
catalogue are approximations. Of concealed effects with other forms, one value in ten was off by more."""

_AT_BOUND = 1e-6
"""Relative distance from a bound within which a value counts as at the bound."""


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
    trace: NDArray[np.float64]
    row: int
    windows: list[Window]
    regime: str
    unmeasured: str = ""
    implausible: str = ""


@dataclass(frozen=True)
class Detectable:
    """Smallest size of an effect that a recording would have shown."""

    effect: Effect
    value: float  # distance from neutral, in the parameter's unit
    unit: str


def _balance_row(
    balances: Balances, effect: Effect, traces: NDArray[np.float64], scale: Any
) -> int:
    """Return the row of an effect's own balance, or of the balance that it changes most."""
    if effect.balance in balances.names:
        return balances.names.index(effect.balance)
    return int(np.argmax(np.sqrt(np.mean(traces**2, axis=1)) / scale))


def missing_measurement(effect: Effect, balances: Balances) -> str:
    """Return which measurement the balance of an effect lacks; empty if it lacks none."""
    replay = balances.replay
    if effect.balance == "hull" and not balances.moving:
        return "without a speed log the hull balance is not measured"
    if effect.balance == "sway" and "sway" not in balances.names:
        return "without a sway speed the sway balance is not measured"
    if effect.balance == "yaw" and "yaw" not in balances.names:
        return "without a rate of turn or a heading the yaw balance is not measured"
    one_shaft = replay.ship.has_line_shaft and replay.ship.turns_freely
    if effect.balance in ("engine", "propeller") and one_shaft and not balances.has_torque:
        return "without a shaft torque meter the engine and propeller sides are one balance"
    return ""


def parameter_at_bound(trial_ship: TrialShip, placed: SizedEffect) -> str:
    """Return which parameter of an effect is at a bound of its search, in words; empty if none is.

    Such a value is no estimate. Bounds at which the effect is absent or complete do not count.
    """
    for parameter, value in placed.pairs:
        absent = trial_ship.origin(parameter)
        low, high = trial_ship.range_of(parameter)
        for bound in (low,) if parameter.whole else (low, high):
            if bound != absent and math.isclose(value, bound, rel_tol=_AT_BOUND):
                name = parameter.key.split(".")[-1]
                return f"{name} is at the bound of its search, {bound:.4g}"
    return ""


def implausible_parameter(trial_ship: TrialShip, placed: SizedEffect) -> str:
    """Return which parameter of an effect lies outside its plausible range; empty where none does."""
    for parameter, value in placed.pairs:
        low, high = trial_ship.plausible_range(parameter)
        if not low <= value <= high:
            unit = parameter.in_ship(trial_ship.ship).info.unit
            unit = "" if unit == "-" else f" {unit}"
            return (
                f"{parameter.name} lies outside its plausible range, {low:.4g} to {high:.4g}{unit}"
            )
    return ""


def balance_rows(fitter: Fitter, fit: Fit) -> list[int]:
    """Return the row of the balance of each effect of a model."""
    balances = fitter.balances
    lacking = balances.residuals_against(balances.nominal)
    scale = np.sqrt(np.mean(lacking**2, axis=1)) + 1e-300
    return [
        _balance_row(balances, placed.effect, traces, scale)
        for placed, traces in zip(fit.effects, _traces(fitter, fit), strict=True)
    ]


def _traces(fitter: Fitter, fit: Fit) -> list[NDArray[np.float64]]:
    """Return the change of the balances by each effect beside the others, shape (balances, rows)."""

    def of(effects: tuple[SizedEffect, ...]) -> NDArray[np.float64]:
        balances = fitter.balances
        return balances.residuals(
            balances.replay.simulate_channels(fitter.trial_ship.record(effects))
        )

    everything = of(fit.effects)
    return [
        everything - of(fit.effects[:i] + fit.effects[i + 1 :]) for i in range(len(fit.effects))
    ]


def findings_of(
    fitter: Fitter, selection: Selection, lacking: NDArray[np.float64]
) -> list[Finding]:
    """Return the chosen effects with intervals, traces, windows and regimes."""
    balances, replay = fitter.balances, fitter.balances.replay
    fit = selection.fit
    estimates = fitter.estimates(fit, FORM_SHARE)
    signals = signals_of(fitter, fit)
    duration = float(replay.time_s[-1])
    scale = np.sqrt(np.mean(lacking**2, axis=1)) + 1e-300
    found = []
    for i, (placed, traces) in enumerate(zip(fit.effects, _traces(fitter, fit), strict=True)):
        row = _balance_row(balances, placed.effect, traces, scale)
        windows = (
            [placed.window]
            if placed.window is not None
            else active_windows(traces[row], replay.interval_s, duration)
        )
        whole = windows == [(0.0, duration)] or placed.window is not None
        where = "" if whole else regime(traces[row], signals)
        found.append(
            Finding(
                placed.effect,
                estimates[i],
                selection.gains[i],
                selection.thresholds[i],
                selection.rivals[i],
                traces[row],
                row,
                windows,
                where,
                missing_measurement(placed.effect, balances)
                or parameter_at_bound(fitter.trial_ship, placed),
                implausible_parameter(fitter.trial_ship, placed),
            )
        )
    return found


def detectable_effects(
    fitter: Fitter, threshold: Callable[[Effect], float], fit: Fit, effects: list[Effect]
) -> list[Detectable]:
    """Return the smallest detectable size of each effect with one parameter.

    It follows from the curvature of the likelihood at the smallest probe of the effect.

    Args:
        fitter: fitter of the fitted data.
        threshold: function that returns the threshold of an effect in 2 log L.
        fit: model beside which the effects are tried.
        effects: the effects.
    """
    base = fitter.predict(fitter.trial_ship.record(fit.effects))
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
        probed = fitter.predict(
            fitter.trial_ship.record((*fit.effects, SizedEffect(effect, (probe,))))
        )
        information = fitter.likelihood.information(fit.weight, (probed - base)[None])
        variance = float(np.linalg.pinv(information)[0, 0])
        if variance > 0.0 and information[0, 0] > 1e-9:
            size = abs(probe - neutral) * np.sqrt(threshold(effect) * variance)
            unit = parameter.in_ship(fitter.trial_ship.ship).info.unit
            found.append(Detectable(effect, float(size), unit))
    return found
