"""Estimate the white noise, the quantisation step and the update interval of a channel from its samples.

The white noise is estimated from fourth differences, which pass only the top of the spectrum: of a
motion at frequency f they keep the share (2 sin(pi f dt))^4 / sqrt(70), which is 5e-6 for a swell of 8
s sampled at 10 Hz. A robust scale leaves out steps and other events, which are outliers among the
differences.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ORDER = 4
_GAIN = math.sqrt(math.comb(2 * ORDER, ORDER))  # rms of the ORDER-th difference of unit white noise
_MAD_TO_RMS = 1.4826  # ratio of the rms to the median absolute deviation of a Gaussian
_OUTLIER = 3.5  # standard deviations beyond which a difference is an event
_KEPT_RMS = 0.9973  # rms of a Gaussian of unit variance without values beyond _OUTLIER
_FEWEST = 4 * ORDER
_UNUSUAL_REST = 20  # equal samples (or updates) in a row that noise does not explain
_ARITHMETIC = 1e-6  # share of the size of a channel below which no instrument noise lies
_DECIMALS = 12  # decimals to which values are compared, relative to the largest value


@dataclass(frozen=True)
class Noise:
    """Noise of one channel, in the unit of the channel.

    Attributes:
        white_rms: rms of the part that is uncorrelated from one update to the next, with the
            quantisation error. If sampling is too slow (slower than about 0.2 s in waves), motion
            reaches the top of the spectrum and the value is an upper bound.
        quantisation: step between neighbouring values; 0 if the channel has no visible step.
        update_s: interval between new values [s]; longer than the sampling interval if values repeat.
    """

    white_rms: float
    quantisation: float
    update_s: float


def estimate_noise(values: NDArray[Any], interval_s: float) -> Noise:
    """Estimate the noise of a measured channel.

    Example:
        >>> values = np.sin(0.05 * np.arange(1000)) + np.random.default_rng(1).normal(0.0, 0.1, 1000)
        >>> round(estimate_noise(values, 0.5).white_rms, 2)
        0.1

    Args:
        values: (n,) samples, evenly spaced and finite.
        interval_s: sampling interval [s].

    Raises:
        ValueError: the array is not one-dimensional or not finite.
    """
    values = _checked(values)
    held = _held(values)
    return Noise(white_rms(values[::held]), quantisation(values), held * interval_s)


def estimate_command_noise(values: NDArray[Any], interval_s: float) -> Noise:
    """Estimate the noise of a command: steps are not counted as noise, and constant stretches are usual.

    Arguments and errors are those of :func:`estimate_noise`.
    """
    values = _checked(values)
    rests = float(np.mean(np.diff(values) == 0.0)) > 0.5 if len(values) > 1 else True
    return Noise(0.0 if rests else white_rms(values), quantisation(values), interval_s)


def _checked(values: NDArray[Any]) -> Array:
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 1 or not np.isfinite(values).all():
        raise ValueError(
            f"a one-dimensional array of finite values is needed, not shape {values.shape} with "
            f"{int((~np.isfinite(values)).sum())} values that are not finite"
        )
    return values


def white_rms(values: NDArray[Any]) -> float:
    """Return the rms of the white noise of (n,) samples; 0 for fewer than 16 samples."""
    if len(values) < _FEWEST:
        return 0.0
    differences = _differences(values)
    scale = _MAD_TO_RMS * float(np.median(np.abs(differences)))
    if scale == 0.0:  # More than half of the differences are zero: the quantisation is coarse.
        return float(np.sqrt(np.mean(differences**2))) / _GAIN if _toggles(values) else 0.0
    for _ in range(20):
        kept = differences[np.abs(differences) <= _OUTLIER * scale]
        before, scale = scale, float(np.sqrt(np.mean(kept**2))) / _KEPT_RMS
        if abs(scale - before) <= 1e-3 * before:
            break
    return scale / _GAIN


def row_noise(values: NDArray[Any], explaining: Sequence[Array]) -> float:
    """Return the rms noise of a channel whose rows are independent equilibria.

    The inputs may differ from row to row, so differences between neighbouring rows hold more than
    noise. The part that a linear regression on the differences of the explaining signals gives, inputs
    and simulated channels of shape (n,), is subtracted. If the rows change slowly, :func:`white_rms` may
    be smaller; the smaller value is returned.
    """
    plain = white_rms(values)
    if len(values) < _FEWEST:
        return plain
    steps = np.diff(np.asarray(values, dtype=np.float64))
    columns = [np.diff(one) for one in explaining if np.ptp(one) > 0.0]
    if columns:
        sized = np.column_stack([one / max(float(np.abs(one).max()), 1e-300) for one in columns])
        steps = steps - sized @ np.linalg.lstsq(sized, steps, rcond=1e-9)[0]
    return min(plain, _MAD_TO_RMS * float(np.median(np.abs(steps))) / math.sqrt(2.0))


def _differences(values: NDArray[Any]) -> Array:
    """Return the differences of order ORDER without the rows in which a noisy channel stopped."""
    first, lengths = _rests(values)
    unusual = _unusual(lengths)
    if not unusual.any():
        return np.diff(values, ORDER)
    ends = np.concatenate([[0], (first + lengths)[unusual]])
    begins = np.concatenate([first[unusual], [len(values)]])
    moving = [values[a:b] for a, b in zip(ends, begins, strict=True) if b - a >= _FEWEST]
    if not moving or not _toggles(np.concatenate(moving)):
        return np.diff(values, ORDER)
    return np.concatenate([np.diff(part, ORDER) for part in moving])


def _rests(values: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first sample and the length of every run of equal values."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    return edges[:-1], np.diff(edges)


def _unusual(lengths: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which runs are much longer than the usual run of the channel."""
    return np.asarray(lengths >= _UNUSUAL_REST * max(1.0, float(np.median(lengths))))


def quantisation(values: NDArray[Any]) -> float:
    """Return the step of which all differences between values are multiples; 0 if there is none.

    A channel counts as quantised only if its values recur: a grid with a separate level for each sample
    cannot be distinguished from the decimals of the file.
    """
    scale = float(np.max(np.abs(values), initial=0.0))
    if scale == 0.0:
        return 0.0
    levels = np.unique(np.round(values / scale, _DECIMALS)) * scale
    if len(levels) < 3 or len(levels) > len(values) // 2:
        return 0.0
    steps = np.diff(levels)
    step = float(np.min(steps))
    multiples = steps / step
    fits = np.abs(multiples - np.round(multiples)) < 1e-3 * np.maximum(1.0, multiples)
    return step if fits.mean() > 0.99 else 0.0


def saturated_ends(values: NDArray[Any], noise: Noise) -> list[tuple[float, float, int]]:
    """Return the extremes at which a noisy channel saturates: value, share of the samples, first sample.

    Noise larger than the quantisation step changes a channel in every row. A channel that stays at its
    extreme far more often than at the next value is saturated there.
    """
    if _is_still(values, noise):
        return []
    found = []
    for end, inward in ((values.max(), -1.0), (values.min(), 1.0)):
        at = values == end
        if 10 <= at.sum() < len(values) and at.mean() > 0.01:
            following = end + inward * np.min(np.abs(values[~at] - end))
            if at.sum() > 3 * np.sum(values == following):
                found.append((float(end), float(at.mean()), int(np.argmax(at))))
    return found


def unusual_rests(values: NDArray[Any], noise: Noise) -> list[tuple[int, int]]:
    """Return first sample and length of the constant stretches that the noise of a channel excludes."""
    if _is_still(values, noise):
        return []
    first, lengths = _rests(values)
    unusual = _unusual(lengths)
    return [(int(a), int(n)) for a, n in zip(first[unusual], lengths[unusual], strict=True)]


def _is_still(values: NDArray[Any], noise: Noise) -> bool:
    """Return whether a channel has no noise but quantisation and the rounding of a simulation."""
    arithmetic = _ARITHMETIC * float(np.max(np.abs(values), initial=0.0))
    return noise.white_rms <= max(2.0 * noise.quantisation, arithmetic)


def _held(values: NDArray[Any]) -> int:
    """Return the number of samples over which each value is repeated: n of a sample-and-hold, else 1."""
    changes = np.flatnonzero(np.diff(values)) + 1
    if len(changes) < _FEWEST:
        return 1
    spacing = np.diff(changes)
    every = int(np.median(spacing))
    regular = np.mean(spacing % every == 0) > 0.95 and np.mean(spacing == every) > 0.5
    return every if every > 1 and regular else 1


def _toggles(values: NDArray[Any]) -> bool:
    """Return whether a channel moves back and forth between levels, unlike a command."""
    steps = np.sign(np.diff(values))
    steps = steps[steps != 0.0]
    return len(steps) >= _FEWEST and float(np.mean(steps[1:] != steps[:-1])) > 0.3
