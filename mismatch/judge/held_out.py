"""How closely a simulation follows the channels of a recording.

The part of a recording that is set aside before anything is fitted, and what it says of a model.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...plant.columns import IN_A_TURN, SHAFT_ANGLE
from ..search.fitting import Fit, Fitter
from ..search.spectra import Bands, Complex, Likelihood, make_bands, runs_away
from ..search.whiteness import SLOWER_THAN_SEA_HZ
from ..simulate.balances import Balances, Channels
from ..simulate.joint_replay import JointReplay
from ..simulate.tolerances import tolerance_moves

ROUNDING = 1e-12
"""Share of a channel's size within which it is constant: a mean of equal numbers rounds."""


def fit_percent(measured: Any, simulated: Any) -> float:
    """FitPercent = 100 (1 - ||y - y_sim|| / ||y - mean(y)||).

    Args:
        measured: y, shape (n,).
        simulated: likewise, in the same unit.

    Returns:
        100 is perfect, 0 no better than the mean. NaN of a channel that is constant, which has no
        spread to measure by.
    """
    measured = np.asarray(measured, dtype=np.float64)
    if np.ptp(measured) <= ROUNDING * np.abs(measured).max():
        return float("nan")
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    return 100.0 * (1.0 - float(np.linalg.norm(measured - simulated)) / spread)


def fits(
    measured: Mapping[str, NDArray[np.float64]],
    simulated: Mapping[str, NDArray[np.float64]],
    rows: NDArray[np.int64],
) -> dict[str, float]:
    """FitPercent by column, those left out that are constant.

    Args:
        measured: channels by column, each of shape (n,).
        simulated: likewise.
        rows: that are judged.
    """
    found = {c: fit_percent(y[rows], simulated[c][rows]) for c, y in measured.items()}
    return {c: value for c, value in found.items() if not np.isnan(value)}


def rms_errors(
    measured: Mapping[str, NDArray[np.float64]],
    simulated: Mapping[str, NDArray[np.float64]],
    rows: NDArray[Any],
) -> dict[str, float]:
    """Rms of measured minus simulated by column, in its unit.

    Args:
        measured: channels by column, each of shape (n,).
        simulated: likewise.
        rows: that are judged, as indices or as a mask.
    """
    return {
        c: float(np.sqrt(np.mean((y[rows] - simulated[c][rows]) ** 2))) for c, y in measured.items()
    }


HELD_OUT_SHARE = 0.25

SEVERAL = 3
"""Recordings from which on whole ones are set aside: two are then left, and whole ones alone tell
what a model is worth on another day."""

MOST_WAYS = 3
"""Ways to set whole recordings aside."""

LOST = 0.25
"""Share of a channel's size by which a model may be off on data set aside."""

Segments = list[tuple[int, int]]
"""First row of each stretch, and one past its last."""


def bands_of(balances: Balances, segments: Segments, highest_Hz: float = math.inf) -> Bands:
    """Bands of some segments, up to four fifths of the Nyquist frequency or a lower one."""
    replay, interval = balances.replay, balances.replay.interval_s
    free = len(list(tolerance_moves(replay))) if replay.ship.turns else 0
    highest = min(0.4 / interval, highest_Hz)
    return make_bands(segments, interval, len(balances.names), highest, free)


def set_aside(replay: JointReplay, runs: int) -> list[tuple[Segments, Segments]]:
    """Ways to part the recordings into what is fitted and what is judged, the best first.

    Whole recordings where the user says so. Of :data:`SEVERAL` or more, a quarter of them in number, one
    at least: those without which the rest covers most of the demands' range, none of more than half of
    all rows. Else the longest recording's last quarter, or, if another quarter covers the demands' range
    clearly better, that one: what comes next is what matters.
    """
    if runs:
        return [(replay.segments[:-runs], replay.segments[-runs:])]
    if len(replay.segments) >= SEVERAL:
        return _whole(replay)
    sizes = [b - a for a, b in replay.segments]
    longest = int(np.argmax(sizes))
    first, last = replay.segments[longest]
    length = round(HELD_OUT_SHARE * (last - first))
    starts = [last - length, first, first + length, first + 2 * length]
    covered = [_coverage(replay, [(first, last)], [(s, s + length)]) for s in starts]
    covered[0] /= 0.85
    rest = [s for i, s in enumerate(replay.segments) if i != longest]
    parted = []
    for start in (starts[i] for i in np.argsort(covered)[::-1]):
        pieces = [(first, start), (start + length, last)]
        kept = [(a, b) for a, b in pieces if b - a > 20]
        parted.append(([*rest, *kept], [(start, start + length)]))
    return parted


def _whole(replay: JointReplay) -> list[tuple[Segments, Segments]]:
    """Ways to set whole recordings aside, the best first."""
    total = sum(b - a for a, b in replay.segments)
    wanted = max(1, round(HELD_OUT_SHARE * len(replay.segments)))

    def ranked(rest: Segments) -> Segments:
        """What may go next, the most dispensable first; of equals the one that covers most itself."""

        def merit(part: tuple[int, int]) -> tuple[float, float, int]:
            others = [s for s in rest if s != part]
            missed = _coverage(replay, replay.segments, others)
            return (
                -round(missed, 2),
                -round(_coverage(replay, replay.segments, [part]), 2),
                -part[0],
            )

        small = [s for s in rest if s[1] - s[0] <= 0.5 * total]
        return sorted(small, key=merit)

    ways = []
    for first in ranked(replay.segments)[:MOST_WAYS]:
        held = [first]
        while len(held) < wanted:
            held.append(ranked([s for s in replay.segments if s not in held])[0])
        ways.append(([s for s in replay.segments if s not in held], sorted(held)))
    return ways


def _coverage(replay: JointReplay, whole: Segments, parts: Segments) -> float:
    """Share of the demands' range in some stretches that others of them cover."""
    shares = []
    for signal in (replay.drive_rows, replay.command, replay.rudder_rows):
        full = np.quantile(np.concatenate([signal[a:b] for a, b in whole]), [0.05, 0.95])
        if full[1] - full[0] > 1e-9:
            piece = np.quantile(np.concatenate([signal[a:b] for a, b in parts]), [0.05, 0.95])
            inside = min(full[1], piece[1]) - max(full[0], piece[0])
            shares.append(max(0.0, inside / (full[1] - full[0])))
    return float(np.mean(shares)) if shares else 1.0


class HeldOut:
    """What the part set aside says of ships and of models.

    Args:
        fitter: of the part that was fitted.
        held: the part set aside.
    """

    def __init__(self, fitter: Fitter, held: Segments) -> None:
        self.fitter = fitter
        self.rows = np.concatenate([np.arange(a, b) for a, b in held])
        self._bands = bands_of(fitter.balances, held, fitter.bands.highest_Hz)
        self._measured = self._transformed(fitter.balances.replay.measured)
        nothing = np.zeros((1, *self._measured.shape), np.complex128)
        self._plain = Likelihood(self._bands, nothing)

    def _transformed(self, channels: Channels) -> Complex:
        return self._bands.transform(self.fitter.balances.residuals(channels))

    def _predicted(self, record: Any) -> Complex:
        return self._transformed(self.fitter.balances.replay.channels_of(record))

    def __call__(self, record: Any) -> float:
        """2 log L of a ship's record; minus infinity where it runs away."""
        lacking = self._measured - self._predicted(record)
        return -math.inf if runs_away(lacking) else self._plain(lacking).score

    def covers(self, fit: Fit) -> bool:
        """Whether all effects of a model act here: an episode may lie elsewhere."""
        time_s = self.fitter.balances.replay.time_s[self.rows]
        windows = [placed.window for placed in fit.effects if placed.window is not None]
        return all(bool(np.any((time_s > a) & (time_s < b))) for a, b in windows)

    def lost(self, fit: Fit) -> list[str]:
        """Channels that the ship with a model's effects loses when it is simulated freely here.

        Averaged over the waves, which no simulation follows, their FitPercent is negative and the error
        is more than :data:`LOST` of their size. What adds up errors, an angle or a heading, and the
        speeds across and of the turn, which swing about zero, are not judged.
        """
        replay = self.fitter.balances.replay
        simulated = replay.channels_of(self.fitter.trial_ship.record(fit.effects))
        width = max(1, round(1.0 / (SLOWER_THAN_SEA_HZ * replay.interval_s)))
        found = []
        for column, measured in replay.recorded.items():
            if column == SHAFT_ANGLE or column in IN_A_TURN:
                continue
            means, error = (
                _means(values[self.rows], width)
                for values in (measured, measured - simulated[column])
            )
            size = float(np.sqrt(np.mean(np.square(measured[self.rows]))))
            off = float(np.sqrt(np.mean(np.square(error))))
            if not off <= max(LOST * size, float(np.std(means))):
                found.append(column)
        return found

    @functools.cached_property
    def _nuisance(self) -> Complex:
        """What each of the fitter's regressors moves here."""
        moved = self.fitter.regressors(self._transformed)
        return np.array(moved).reshape(-1, *self._measured.shape)

    def score(self, fit: Fit) -> float:
        """2 log L of a model, its values as unsure as the part that was fitted leaves them.

        A value that the fitted part hardly tells may come out otherwise here without speaking against
        the model: it is free about its own, with the covariance that the fit gives it, and pays for it.
        Minus infinity where its simulation runs away or loses a channel.
        """
        fitter = self.fitter
        if fit.effects and self.lost(fit):
            return -math.inf
        there, columns = fitter.sensitivities(fit, self._transformed)
        if runs_away(there):
            return -math.inf
        own = fitter.sensitivities(fit)[1]
        information = fitter.likelihood.information(fit.weight, own)
        values, vectors = np.linalg.eigh(information)
        # directions in which the values and numbers are unsure, each by one standard deviation
        axes = vectors / np.sqrt(np.maximum(values, 1e-12 * values.max()))
        everything = np.concatenate([columns, self._nuisance])
        moved = np.einsum("ik,imf->kmf", axes, everything)
        lacking = self._measured - there
        lacking = lacking - np.einsum("k,kmf->mf", fit.tolerances, self._nuisance)
        return Likelihood(self._bands, moved)(lacking).score


def _means(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Means of so many rows each; the values themselves where they are fewer than two such blocks."""
    count = len(values) // width
    if count < 2:
        return values
    return np.asarray(values[: count * width].reshape(count, width).mean(axis=1))
