"""Likelihood of residuals: raw until there is a noise model, whitened from then on."""

from __future__ import annotations

import math

import numpy as np

from .model import Floats
from .noise_model import NoiseModel, Whitener, row_weights


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
        """Estimate outliers and the noise's spectrum from the residual of the richest model.

        Args:
            residual: on the fitted rows, shape (channels, rows).
        """
        self.weights = row_weights(residual, self._floor)
        noise = NoiseModel(
            residual * np.sqrt(self.weights), self._floor, self._fitted, self._interval_s,
            self._highest_Hz,
        )  # fmt: skip
        self._whitener = noise.whitener(self._fitted)
        self._held_whitener = noise.whitener(self._held)
        self._least = noise.least(self._floor)

    def white(self, residual: Floats) -> Floats:
        """Return residuals on the fitted rows as they are compared, outliers with less weight.

        Args:
            residual: shape (..., channels, rows).
        """
        weighted = residual * np.sqrt(self.weights)
        return weighted if self._whitener is None else self._whitener(weighted)

    def fitted(self, white: Floats) -> float:
        """Return 2 log L of a residual from :meth:`white`, shape (channels, values)."""
        return self._log(white, self._whitener)

    def scale(self, white: Floats) -> Floats:
        """Return the factors by channel, shape (channels, 1), that give a residual the variance 1."""
        return np.asarray(1.0 / np.sqrt(self._power(white, self._whitener)))[:, None]

    def held(self, residual: Floats, limit: Floats) -> float:
        """Return 2 log L of a residual on the held-out rows.

        Args:
            residual: shape (channels, rows).
            limit: size by channel at which each row is clipped.
        """
        if not np.isfinite(residual).all():
            return -math.inf
        clipped = np.clip(residual, -limit[:, None], limit[:, None])
        white = clipped if self._held_whitener is None else self._held_whitener(clipped)
        return self._log(white, self._held_whitener)

    def rms(self, residual: Floats, limit: Floats | None = None) -> Floats:
        """Return the rms of a residual by channel, no less than the floor; infinite if it is not finite.

        Args:
            residual: shape (channels, rows).
            limit: size by channel at which each row is clipped; no clipping by default.
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
