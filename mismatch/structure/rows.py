"""Count the independent rows of a residual, and find the rows that lie far off."""

from __future__ import annotations

import math

import numpy as np

from .model import Floats, Model

SMOOTHED = 1.0
"""Width over which a spectrum of n rows is smoothed, in the square root of n frequencies."""

STRAY = 10.0
"""Deviations, by the median, at which residuals are clipped where models are compared: a guessed sign or
a repeated value is no measure of a model."""


def clipping_limit(model: Model) -> Floats:
    """Return the residual by channel at which rows are clipped, in the channels' units."""
    return np.asarray(STRAY * np.median(np.abs(model.error), axis=1) / 0.6745)


def telling(error: Floats, columns: Floats) -> float:
    """How many independent rows some errors are worth to what a model's values move.

    A value's variance is that of independent errors times ``sum S |J|^2 / (mean S sum |J|^2)``, S being
    the errors' spectrum, smoothed, and J what the value moves: errors that drift slowly say little
    against what answers fast.

    Args:
        error: of one channel, shape (rows,).
        columns: what each value moves there, shape (values, rows).
    """
    rows = len(error)
    size = 1 << (2 * rows - 1).bit_length()
    power = np.abs(np.fft.rfft(error - error.mean(), size)) ** 2
    width = max(3, round(SMOOTHED * math.sqrt(rows) * size / rows / 2.0))
    smooth = np.convolve(power, np.ones(width) / width, mode="same")
    moved = np.abs(np.fft.rfft(columns - columns.mean(axis=1, keepdims=True), size, axis=1)) ** 2
    heard = moved.sum(axis=1)
    if not np.any(heard > 0.0) or smooth.sum() == 0.0:
        return float(rows)
    worth = smooth.mean() * heard[heard > 0.0] / (moved[heard > 0.0] @ smooth)
    return float(rows * min(1.0, np.median(worth)))
