"""Noise model of a recording: the spectrum of the residual that the richest model leaves, and outliers.

Residuals of real machines are coloured: waves, drift, small model errors that an integrator adds up. A
sum of squares over raw rows would let the largest band drown all others. The residual of the richest
model found so far says how large the residual is at each frequency, and how the channels' residuals go
together; dividing by the root of that spectrum makes rows of it that are independent and of variance 1
(prediction errors, Ljung 1999, section 7.2; Whittle 1953). It cannot come from a model that lacks
something, because the missing effect would be taken for noise.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from ..search.spectra import Bands, Complex, make_bands, moments

Floats = NDArray[np.float64]

HUBER = 3.0
"""Deviations, 1.48 times the median residual, beyond which a row counts less (Huber 1964)."""

OUTLIER = 10.0
"""Deviations, by the median, at which residuals are clipped where models are compared: a repeated value
or a guessed sign says nothing about a model."""


def deviations(residual: Floats) -> Floats:
    """Return the standard deviation of a residual by channel, from the median of its size."""
    return np.asarray(np.median(np.abs(residual), axis=1) / 0.6745)


def row_weights(residual: Floats, floor: Floats) -> Floats:
    """Return the weight of each row of each channel: 1, and less for outliers.

    Args:
        residual: of the richest model, shape (channels, rows).
        floor: least deviation by channel, in the channels' units, shape (channels,).
    """
    limit = HUBER * np.hypot(deviations(residual), floor)[:, None]
    return np.asarray(limit / np.maximum(np.abs(residual), limit))


class NoiseModel:
    """Whitens residuals by the spectrum of one residual.

    Args:
        residual: of the richest model, shape (channels, rows); rows end to end as in ``lengths``.
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
        spectrum = moments(bands, transformed, transformed)
        count = np.add.reduceat(bands.weights, bands.edges[:-1])
        spectrum = spectrum / count[:, None, None] + np.diag(floor**2)
        self._roots: Complex = np.linalg.inv(np.linalg.cholesky(spectrum)).astype(np.complex128)
        self._share = count / count.sum()
        self._centres = np.array(
            [bands.frequency_Hz[a:b].mean() for a, b in itertools.pairwise(bands.edges)]
        )

    def whitener(self, lengths: list[int]) -> Whitener:
        """Return the transformation of residuals over some segments.

        Args:
            lengths: rows of each segment; other segments than the noise model was made from are
                allowed.
        """
        bands = self._bands(lengths, self._roots.shape[1])
        # each frequency takes the root of the nearest band of the noise model
        middle = 0.5 * (self._centres[1:] + self._centres[:-1])
        nearest = np.searchsorted(middle, bands.frequency_Hz)
        return Whitener(bands, self._roots[nearest])

    def least(self, floor: Floats) -> Floats:
        """Return the deviation by channel that whitening makes of white noise.

        Args:
            floor: deviation of the noise by channel, in the channels' units.
        """
        power = np.sum(np.abs(self._roots * floor) ** 2, axis=2)
        return np.asarray(np.sqrt(self._share @ power))

    def _bands(self, lengths: list[int], channels: int) -> Bands:
        ends = np.cumsum(lengths).tolist()
        segments = [(end - length, end) for end, length in zip(ends, lengths, strict=True)]
        highest = min(0.5 / self._interval_s, self._highest_Hz)
        return make_bands(segments, self._interval_s, channels, highest)


class Whitener:
    """Residuals as independent values of variance 1.

    Attributes:
        count: number of independent values in each channel.
        values: number of values in each channel, of which a few are 0.

    Args:
        bands: frequencies.
        roots: inverse root of the spectrum at each, shape (frequencies, channels, channels).
    """

    def __init__(self, bands: Bands, roots: Complex) -> None:
        self._bands = bands
        scaled = roots * np.sqrt(2.0 * bands.weights)[:, None, None]
        self._roots = np.ascontiguousarray(scaled.transpose(1, 2, 0))
        self.count = float(2.0 * bands.weights.sum())
        self.values = 2 * len(bands.weights)

    def __call__(self, residual: Floats) -> Floats:
        """Return whitened residuals.

        Args:
            residual: shape (..., channels, rows).

        Returns:
            Shape (..., channels, 2 frequencies): real and imaginary parts, scaled so that ``count`` of
            them, with variance 1, are independent in each channel.
        """
        found = self._bands.transform(residual)
        white = np.zeros_like(found)
        for made in range(len(self._roots)):
            for heard in range(made + 1):  # the root is lower triangular
                white[..., made, :] += self._roots[made, heard] * found[..., heard, :]
        return np.concatenate([white.real, white.imag], axis=-1)
