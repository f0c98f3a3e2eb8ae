"""Noise model, likelihood and first states for the structure search, and its limits of application.

Residuals of real machines are coloured by waves, drift and integrated model errors. In a sum of squares
over raw rows the largest frequency band would dominate. The spectrum of the residual of the richest
model gives its size at each frequency and the correlation between channels. Division by the root of
this spectrum makes the residual independent values of variance 1 (prediction errors, Ljung 1999,
section 7.2; Whittle 1953). A model that lacks an effect gives no noise model, because the effect would
count as noise.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import scipy

from ...plant.columns import SHAFT_SPEED
from ..search.fitting import slower_than_waves_hertz
from ..search.spectra import Bands, Complex, band_products, make_bands
from ..simulate.joint_replay import Floats, JointReplay, blocks
from .model import Model

if TYPE_CHECKING:
    from .output_error import OutputError

HUBER = 3.0
"""Deviations, 1.48 times the median residual, beyond which a row counts less (Huber 1964)."""

OUTLIER = 10.0
"""Deviations, from the median, at which residuals are clipped in the comparison of models: a repeated
value or a wrong sign in a recording is no evidence about a model."""

KEPT = 5
"""Smallest number of remaining rows in each averaged row of the replay."""

OPPOSED = -0.5
"""Correlation of command and shaft speed at the frequencies of the waves below which the command opposes
them. In an open loop the shaft follows its command and the correlation is positive."""

BAND = 10.0
"""Ratio of the band's highest to its lowest frequency."""

PERIODS = 4.0
"""Periods of the lowest frequency in each of the spectra that are averaged."""

COMMAND_RESPONDS = (
    "the command responds to the waves, as that of a governor does, and a simulation without the waves "
    "would estimate a false lag; record steps of the command, or record in calm water"
)
"""Reason for no joint estimation on a ship in waves with a governor."""

MOST_VALUES, MOST_ROWS = 120_000, 30_000
"""Largest number of averaged rows times channels, and of recorded rows, that the search can handle."""

FIRST_ROWS = 100
"""Largest number of rows from which the first state of a held-out recording is estimated."""

STEP = 0.3
"""Finite difference of a first state, in deviations."""


def reason_to_skip(replay: JointReplay) -> str:
    """Return why effects and parameters cannot be estimated together; empty if they can be."""
    rows, values = replay.rows * replay.every, replay.rows * len(replay.channels)
    if rows > MOST_ROWS:
        return f"the recordings have {rows} rows, more than {MOST_ROWS}; shorten them"
    if values > MOST_VALUES:
        return f"the recordings have {values} values, more than {MOST_VALUES}; leave a channel out"
    return COMMAND_RESPONDS if command_opposes_waves(replay) else ""


def command_opposes_waves(replay: JointReplay) -> bool:
    """Return whether the command opposes the fluctuation of the shaft speed by waves.

    A simulation without the waves then treats the response of the command as a cause, so that estimates
    of inertia, lags and delays are biased.
    """
    if not replay.ship.moves or SHAFT_SPEED not in replay.channels or replay.steady:
        return False
    low, rate = slower_than_waves_hertz(replay.ship), 1.0 / replay.interval_s
    long = [slice(a, b) for a, b in replay.segments if (b - a) * low > 2.0 * PERIODS * rate]
    drive, speed = replay.drive_rows, replay.recorded[SHAFT_SPEED]
    found = [correlation(drive[own], speed[own], rate, low, BAND * low) for own in long]
    return bool(found) and float(np.median(found)) < OPPOSED


def correlation(one: Floats, other: Floats, rate: float, low: float, high: float) -> float:
    """Return the correlation of two signals from a low to a high frequency; 0 where one does not move.

    The rate of the rows and the frequencies are in Hz.
    """
    rows = min(len(one), round(PERIODS * rate / low))
    pairs = ((one, other), (one, one), (other, other))
    spectra = [scipy.signal.csd(a, b, rate, nperseg=rows) for a, b in pairs]
    frequency = spectra[0][0]
    band = (frequency >= low) & (frequency <= high)
    both, own, others = (float(np.sum(s[1][band].real)) for s in spectra)
    return both / np.sqrt(own * others) if own * others > 0.0 else 0.0


def coarser(replay: JointReplay, most: int) -> JointReplay:
    """Return a replay of means over the recordings' rows where there are more than a number of them.

    Its averaged rows are those of the given replay: only rows that these average anyway are taken
    together beforehand. The commands are straight lines between the means.
    """
    if replay.rows * replay.every <= most:
        return replay
    every = replay.every
    rows = max((k for k in range(2, every // KEPT + 1) if every % k == 0), default=1)
    if rows == 1:
        return replay
    own = [run.table for run in replay.runs]
    means = [blocks(table.to_numpy(dtype=float), rows) for table in own]
    tables = [pd.DataFrame(m, columns=t.columns) for m, t in zip(means, own, strict=True)]
    return JointReplay(
        replay.ship, *tables, line=True, every=every // rows, start_over_s=replay.start_over_s
    )


class Likelihood:
    """2 log L of residuals on the fitted and on the held-out rows.

    Args:
        floor: least deviation of a residual by channel, in the channels' units, shape (channels,).
        fitted: rows of each fitted segment.
        held: rows of each held-out segment.
        interval_s: sampling interval [s].
        highest_Hz: highest frequency that counts once there is a noise model.

    Attributes:
        weights: of the fitted rows, less than 1 for outliers; shape (channels, rows).
    """

    def __init__(
        self,
        floor: Floats,
        fitted: list[int],
        held: list[int],
        interval_s: float,
        highest_Hz: float = math.inf,
    ) -> None:
        self._floor, self._least = floor, floor  # in the channels' units; as residuals are compared
        self._fitted, self._held = fitted, held
        self._interval_s, self._highest_Hz = interval_s, highest_Hz
        self.weights = np.ones((len(floor), sum(fitted)))
        self._whitener: Whitener | None = None
        self._held_whitener: Whitener | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of a whitened residual: channels and values."""
        rows = self.weights.shape[1] if self._whitener is None else self._whitener.values
        return len(self._floor), rows

    def set_noise(self, residual: Floats) -> None:
        """Estimate outliers and the noise's spectrum from the richest model's fitted residual."""
        self.weights = row_weights(residual, self._floor)
        weighted, limits = residual * np.sqrt(self.weights), (self._interval_s, self._highest_Hz)
        noise = NoiseModel(weighted, self._floor, self._fitted, *limits)
        self._whitener = noise.whitener(self._fitted)
        self._held_whitener = noise.whitener(self._held)
        self._least = noise.least(self._floor)

    def white(self, residual: Floats) -> Floats:
        """Return residuals (..., channels, rows) on the fitted rows as compared: outliers weigh less."""
        weighted = residual * np.sqrt(self.weights)
        return weighted if self._whitener is None else self._whitener(weighted)

    def fitted(self, white: Floats) -> float:
        """Return 2 log L of a residual from :meth:`white`, shape (channels, values)."""
        return self._log(white, self._whitener)

    def scale(self, white: Floats) -> Floats:
        """Return the factors by channel, shape (channels, 1), that give a residual the variance 1."""
        return np.asarray(1.0 / np.sqrt(self._power(white, self._whitener)))[:, None]

    def held(self, residual: Floats, limit: Floats) -> float:
        """Return 2 log L of a residual, clipped at a limit by channel, on the held-out rows."""
        if not np.isfinite(residual).all():
            return -math.inf
        clipped = np.clip(residual, -limit[:, None], limit[:, None])
        white = clipped if self._held_whitener is None else self._held_whitener(clipped)
        return self._log(white, self._held_whitener)

    def rms(self, residual: Floats, limit: Floats | None = None) -> Floats:
        """Return the rms of a residual by channel, no less than the floor; infinite if it is not finite.

        Each row is clipped at a limit by channel, if there is one.
        """
        if not np.isfinite(residual).all():
            return np.full(len(self._floor), math.inf)
        if limit is not None:
            residual = np.minimum(np.abs(residual), limit[:, None])
        return np.asarray(np.hypot(np.sqrt(np.mean(residual**2, axis=1)), self._floor))

    def _power(self, white: Floats, whitener: Whitener | None) -> Floats:
        """Return the mean square by channel."""
        count = white.shape[-1] if whitener is None else whitener.count
        return np.asarray(np.sum(white**2, axis=-1) / count + self._least**2)

    def _log(self, white: Floats, whitener: Whitener | None) -> float:
        if not np.isfinite(white).all():
            return -math.inf
        count = white.shape[-1] if whitener is None else whitener.count
        return -count * float(np.sum(np.log(self._power(white, whitener))))


class NoiseModel:
    """Whitens residuals by the spectrum of the residual of the richest model, shape (channels, rows).

    Args:
        residual: the residual, rows end to end as in ``lengths``.
        floor: least deviation by channel, in the channels' units, shape (channels,).
        lengths: rows of each uninterrupted segment.
        interval_s: sampling interval [s].
        highest_Hz: highest frequency that counts.
    """

    def __init__(
        self,
        residual: Floats,
        floor: Floats,
        lengths: list[int],
        interval_s: float,
        highest_Hz: float,
    ) -> None:
        self._interval_s, self._highest_Hz = interval_s, highest_Hz
        bands = self._bands(lengths, len(residual))
        transformed = bands.transform(residual)
        spectrum = band_products(bands, transformed, transformed)
        count = np.add.reduceat(bands.weights, bands.edges[:-1])
        spectrum = spectrum / count[:, None, None] + np.diag(floor**2)
        self._roots: Complex = np.linalg.inv(np.linalg.cholesky(spectrum)).astype(np.complex128)
        self._share = count / count.sum()
        self._centres = np.array(
            [bands.frequency_Hz[a:b].mean() for a, b in itertools.pairwise(bands.edges)]
        )

    def whitener(self, lengths: list[int]) -> Whitener:
        """Return the transformation of residuals over segments with these numbers of rows."""
        bands = self._bands(lengths, self._roots.shape[1])
        # Each frequency takes the root of the nearest band of the noise model.
        middle = 0.5 * (self._centres[1:] + self._centres[:-1])
        nearest = np.searchsorted(middle, bands.frequency_Hz)
        return Whitener(bands, self._roots[nearest])

    def least(self, floor: Floats) -> Floats:
        """Return the deviation by channel that whitening makes of white noise with a deviation."""
        power = np.sum(np.abs(self._roots * floor) ** 2, axis=2)
        return np.asarray(np.sqrt(self._share @ power))

    def _bands(self, lengths: list[int], channels: int) -> Bands:
        ends = np.cumsum(lengths).tolist()
        segments = [(end - length, end) for end, length in zip(ends, lengths, strict=True)]
        highest = min(0.5 / self._interval_s, self._highest_Hz)
        return make_bands(segments, self._interval_s, channels, highest)


class Whitener:
    """Residuals as independent values of variance 1.

    The inverse root of the spectrum at each frequency has the shape (frequencies, channels, channels).

    Attributes:
        count: number of independent values in each channel.
        values: number of values in each channel, of which a few are 0.
    """

    def __init__(self, bands: Bands, roots: Complex) -> None:
        self._bands = bands
        scaled = roots * np.sqrt(2.0 * bands.weights)[:, None, None]
        self._roots = np.ascontiguousarray(scaled.transpose(1, 2, 0))
        self.count = float(2.0 * bands.weights.sum())
        self.values = 2 * len(bands.weights)

    def __call__(self, residual: Floats) -> Floats:
        """Return whitened residuals of shape (..., channels, 2 frequencies), from (..., channels, rows).

        These are real and imaginary parts, scaled so that ``count`` of them, with variance 1, are
        independent in each channel.
        """
        transformed = self._bands.transform(residual)
        white = np.zeros_like(transformed)
        for row in range(len(self._roots)):
            for column in range(row + 1):  # the root is lower triangular
                white[..., row, :] += self._roots[row, column] * transformed[..., column, :]
        return np.concatenate([white.real, white.imag], axis=-1)


def row_weights(residual: Floats, floor: Floats) -> Floats:
    """Return the weight of each row of a residual (channels, rows): 1, and less for outliers."""
    limit = HUBER * np.hypot(deviations(residual), floor)[:, None]
    return np.asarray(limit / np.maximum(np.abs(residual), limit))


def deviations(residual: Floats) -> Floats:
    """Return the standard deviation of a residual by channel, from the median of its size."""
    return np.asarray(np.median(np.abs(residual), axis=1) / 0.6745)


def with_first_states(problem: OutputError, model: Model) -> Floats:
    """Return a model's nuisance values with the first states of recordings that are not fitted.

    The first states are estimated from the recordings' first rows, because the first measurements of a
    lagging instrument differ from the ship's state.
    """
    nuisance = model.nuisance.copy()
    for run, (a, b) in enumerate(problem.replay.segments):
        every = range(problem.states * run, problem.states * (run + 1))
        own = [k for k in every if problem.starts[k] > 0.0]
        if not own or np.any((problem.rows >= a) & (problem.rows < b)):
            continue
        rows = max(2, min(FIRST_ROWS, (b - a) // 4))

        def first_rows(values: Floats, run: int = run, rows: int = rows) -> Floats:
            channels = problem.simulate_run_channels(run, model.effects, model.shifts, values)
            return channels[:, :rows]

        for _ in range(3):
            here = first_rows(nuisance)
            trials = nuisance + STEP * np.eye(len(nuisance))[own]
            columns = [((first_rows(trial) - here) / STEP).ravel() for trial in trials]
            residual = (problem.measured[:, a : a + rows] - here).ravel()
            if not np.isfinite(columns).all() or not np.isfinite(residual).all():
                break
            nuisance[own] += np.linalg.lstsq(np.transpose(columns), residual, rcond=1e-9)[0]
    return nuisance
