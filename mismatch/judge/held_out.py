"""Hold data out before anything is fitted, and evaluate models on them: FitPercent, rms, likelihood."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from ...plant.columns import SHAFT_ANGLE, TURNING_COLUMNS
from ..search.fitting import SLOWER_THAN_SEA_HZ, Fit, Fitter
from ..search.spectra import Bands, Complex, Likelihood, is_divergent, make_bands
from ..search.spectra import Segments as Segments
from ..simulate.balances import Balances, Channels, tolerance_perturbations
from ..simulate.joint_replay import Floats, JointReplay

HELD_OUT_SHARE = 0.25
"""Share of the recordings, or of the longest of them, that is held out."""

SEVERAL = 3
"""Number of recordings from which whole recordings are held out. Two then remain for the fit, and only
whole recordings show how well a model predicts another day."""

MOST_WAYS = 3
"""Largest number of alternative selections of held-out recordings."""

LOST = 0.25
"""Error of a channel on the held-out data, as a share of its size, above which a model loses it."""

LEAST_RANGE = 0.3
"""Share of the commands' range that the rows beside a held-out quarter must cover, and that a held-out
recording must cover. Without a movement nothing can be estimated, and nothing judged."""

ROUNDING = 1e-12
"""Share of a channel's size within which it counts as constant, because means of equal values round."""


def split_held_out(replay: JointReplay, runs: int) -> list[tuple[Segments, Segments]]:
    """Return alternative splits of the recordings into fitted and held-out segments, the best first.

    - The last ``runs`` recordings are held out if the user says so.
    - Of :data:`SEVERAL` recordings or more, a quarter of them is held out, at least one: those without
      which the others cover most of the commands' range. None has more than half of all rows or covers
      less than :data:`LEAST_RANGE` of the range itself, if others do.
    - Otherwise the last quarter of the longest recording is held out, or another quarter of a recording
      that covers the commands' range clearly better. The other rows must still cover
      :data:`LEAST_RANGE` of the range, as they do not where the commands move in one quarter only.
    """
    if runs:
        return [(replay.segments[:-runs], replay.segments[-runs:])]
    if len(replay.segments) >= SEVERAL:
        return _split_whole(replay)
    longest = max(replay.segments, key=lambda segment: segment[1] - segment[0])
    quarters = []
    for first, last in (longest, *(s for s in replay.segments if s != longest)):
        length = round(HELD_OUT_SHARE * (last - first))
        starts = last - length, first, first + length, first + 2 * length
        quarters += [((first, last), (start, start + length)) for start in starts]
    covered = np.array([_coverage(replay, replay.segments, [held]) for _, held in quarters])
    covered[::4] /= 0.85  # the last quarters
    splits = []
    for k in np.argsort(-covered, kind="stable"):
        (first, last), (start, end) = quarters[k]
        others = [segment for segment in replay.segments if segment != (first, last)]
        kept = [(a, b) for a, b in ((first, start), (end, last)) if b - a > 20]
        splits.append(([*others, *kept], [(start, end)]))
    moving = [one for one in splits if _coverage(replay, replay.segments, one[0]) >= LEAST_RANGE]
    return moving or splits


def _split_whole(replay: JointReplay) -> list[tuple[Segments, Segments]]:
    """Return alternative splits that hold out whole recordings, the best first."""
    total = sum(b - a for a, b in replay.segments)
    wanted = max(1, round(HELD_OUT_SHARE * len(replay.segments)))

    def ranked(rest: Segments) -> Segments:
        """Return the recordings by how well the others cover the commands' range, the best first."""

        def merit(part: tuple[int, int]) -> tuple[float, float, int]:
            others = [s for s in rest if s != part]
            missed, own = (_coverage(replay, replay.segments, s) for s in (others, [part]))
            return -round(missed, 2), -round(own, 2), -part[0]

        small = [s for s in rest if s[1] - s[0] <= 0.5 * total]
        moving = [s for s in small if _coverage(replay, replay.segments, [s]) >= LEAST_RANGE]
        return sorted(moving or small, key=merit)

    splits = []
    for first in ranked(replay.segments)[:MOST_WAYS]:
        held = [first]
        while len(held) < wanted:
            held.append(ranked([s for s in replay.segments if s not in held])[0])
        splits.append(([s for s in replay.segments if s not in held], sorted(held)))
    return splits


def _coverage(replay: JointReplay, whole: Segments, parts: Segments) -> float:
    """Return the share of the commands' range in some segments that other segments cover."""
    shares = []
    for signal in (replay.drive_rows, replay.command, replay.rudder_rows):
        full = np.quantile(np.concatenate([signal[a:b] for a, b in whole]), [0.05, 0.95])
        if full[1] - full[0] > 1e-9:
            piece = np.quantile(np.concatenate([signal[a:b] for a, b in parts]), [0.05, 0.95])
            inside = min(full[1], piece[1]) - max(full[0], piece[0])
            shares.append(max(0.0, inside / (full[1] - full[0])))
    return float(np.mean(shares)) if shares else 1.0


def bands_of(balances: Balances, segments: Segments, highest_Hz: float = math.inf) -> Bands:
    """Return the frequency bands of segments, up to 80 % of the Nyquist frequency or a lower limit."""
    replay, interval = balances.replay, balances.replay.interval_s
    free = len(list(tolerance_perturbations(replay))) if replay.ship.turns else 0
    highest = min(0.4 / interval, highest_Hz)
    return make_bands(segments, interval, len(balances.names), highest, free)


class HeldOut:
    """Likelihood of ships and models on the held-out segments of a fitter's recordings."""

    def __init__(self, fitter: Fitter, held: Segments) -> None:
        self.fitter = fitter
        self.rows = np.concatenate([np.arange(a, b) for a, b in held])
        self._bands = bands_of(fitter.balances, held, fitter.bands.highest_Hz)
        self._measured = self._transformed(fitter.balances.replay.measured)
        nothing = np.zeros((1, *self._measured.shape), np.complex128)
        self._plain = Likelihood(self._bands, nothing)

    def _transformed(self, channels: Channels) -> Complex:
        return self._bands.transform(self.fitter.balances.residuals(channels))

    def __call__(self, record: Any) -> float:
        """Return 2 log L of a ship's record; minus infinity if its simulation diverges."""
        simulated = self.fitter.balances.replay.simulate_channels(record)
        difference = self._measured - self._transformed(simulated)
        return -math.inf if is_divergent(difference) else self._plain(difference).score

    def covers(self, fit: Fit) -> bool:
        """Return whether all effects of a model act in the held-out data, as an episode may not."""
        time_s = self.fitter.balances.replay.time_s[self.rows]
        windows = [sized.window for sized in fit.effects if sized.window is not None]
        return all(bool(np.any((time_s > a) & (time_s < b))) for a, b in windows)

    def lost_channels(self, fit: Fit) -> list[str]:
        """Return the channels that an open-loop simulation with a model's effects loses.

        Averaged over the waves, the FitPercent of such a channel is negative and its error is more than
        :data:`LOST` of its size. Shaft angle and heading integrate errors, and the sway speed and the
        rate of turn oscillate about zero; these channels do not count.
        """
        replay = self.fitter.balances.replay
        simulated = replay.simulate_channels(self.fitter.trial_ship.record(fit.effects))
        width = max(1, round(1.0 / (SLOWER_THAN_SEA_HZ * replay.interval_s)))
        lost = []
        for column in replay.recorded:
            if column in (SHAFT_ANGLE, *TURNING_COLUMNS):
                continue
            measured = replay.recorded[column][self.rows]
            error = _means(measured - simulated[column][self.rows], width)
            size, off = (float(np.sqrt(np.mean(np.square(x)))) for x in (measured, error))
            if not off <= max(LOST * size, float(np.std(_means(measured, width)))):
                lost.append(column)
        return lost

    @functools.cached_property
    def _nuisance(self) -> Complex:
        """Change of the held-out balances by each regressor of the fitter."""
        responses = self.fitter.regressors(self._transformed)
        return np.array(responses).reshape(-1, *self._measured.shape)

    def score(self, fit: Fit) -> float:
        """Return 2 log L of a model, with its values as uncertain as the fitted data leave them.

        A value that the fitted data hardly determine may differ here without refuting the model: it has
        a normal prior about its estimate with the covariance of the fit. Minus infinity if the
        simulation diverges or loses a channel.
        """
        fitter = self.fitter
        if fit.effects and self.lost_channels(fit):
            return -math.inf
        predicted, columns = fitter.sensitivities(fit, self._transformed)
        if is_divergent(predicted):
            return -math.inf
        own = fitter.sensitivities(fit)[1]
        values, vectors = np.linalg.eigh(fitter.likelihood.information(fit.weight, own))
        # Each direction is one standard deviation of the values and parameters.
        axes = vectors / np.sqrt(np.maximum(values, 1e-12 * values.max()))
        everything = np.concatenate([columns, self._nuisance])
        responses = np.einsum("ik,imf->kmf", axes, everything)
        residual = self._measured - predicted
        residual = residual - np.einsum("k,kmf->mf", fit.tolerances, self._nuisance)
        return Likelihood(self._bands, responses)(residual).score


def _means(values: Floats, width: int) -> Floats:
    """Return means over blocks of rows; the values themselves if there are fewer than two blocks."""
    count = len(values) // width
    if count < 2:
        return values
    return np.asarray(values[: count * width].reshape(count, width).mean(axis=1))


def fit_percents(measured: Channels, simulated: Channels, rows: Any) -> dict[str, float]:
    """Return FitPercent by column, without constant channels; arguments as in :func:`rms_errors`."""
    percents = {c: fit_percent(y[rows], simulated[c][rows]) for c, y in measured.items()}
    return {c: value for c, value in percents.items() if not np.isnan(value)}


def fit_percent(measured: Any, simulated: Any) -> float:
    """Return FitPercent = 100 (1 - ||y - y_sim|| / ||y - mean(y)||).

    Args:
        measured: measured channel y, shape (n,).
        simulated: simulated channel y_sim, likewise, in the same unit.

    Returns:
        100 is perfect, 0 is no better than the mean. NaN for a constant channel.

    >>> fit_percent([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), fit_percent([1.0, 2.0, 3.0], [2.0, 2.0, 2.0])
    (100.0, 0.0)
    """
    measured = np.asarray(measured, dtype=np.float64)
    if np.ptp(measured) <= ROUNDING * np.abs(measured).max():
        return float("nan")
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    return 100.0 * (1.0 - float(np.linalg.norm(measured - simulated)) / spread)


def rms_errors(measured: Channels, simulated: Channels, rows: Any) -> dict[str, float]:
    """Return the rms of measured minus simulated by column, in the column's unit.

    Args:
        measured: measured channels by column, each of shape (n,).
        simulated: simulated channels, likewise.
        rows: rows that count, as indices or as a mask.

    >>> measured = {"speed": np.array([3.0, 4.0])}
    >>> rms_errors(measured, {"speed": np.array([4.0, 5.0])}, slice(None))
    {'speed': 1.0}
    """
    return {
        c: float(np.sqrt(np.mean((y[rows] - simulated[c][rows]) ** 2))) for c, y in measured.items()
    }
