"""The noise of a channel, told from the channel alone: white part, quantisation, update interval.

The white part is read from fourth differences, which pass the top of the spectrum only: of a motion
at frequency f, the share (2 sin(pi f dt))^4 / sqrt(70). A swell of 8 s sampled at 10 Hz counts for
5e-6 of its amplitude. Steps and other events of the voyage are outliers among the differences and
are left out by a robust scale.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

ORDER = 4
_GAIN = math.sqrt(math.comb(2 * ORDER, ORDER))  # rms of the ORDER-th difference of unit white noise
_MAD_TO_RMS = 1.4826  # of a Gaussian
_OUTLIER = 3.5  # standard deviations beyond which a difference is an event
_KEPT_RMS = 0.9973  # rms of a Gaussian cut there
_FEWEST = 4 * ORDER
_ODD_REST = 20  # samples (or updates) without change that noise does not explain
_ARITHMETIC = 1e-6  # share of a channel's size below which no instrument's noise lies
_DECIMALS = 12  # digits below which two values are the same


@dataclass(frozen=True)
class Noise:
    """Noise of one channel, in the channel's own unit.

    Attributes:
        white_rms: rms of what is uncorrelated from one update to the next, the error of quantisation
            included. Where the sampling is too slow to leave the top of the spectrum to the noise
            (slower than about 0.2 s in a sea), it is an upper bound.
        quantisation: step between neighbouring values; 0 where none can be seen.
        update_s: interval at which the channel takes new values [s]; longer than the recording's
            where values are repeated in between.
    """

    white_rms: float
    quantisation: float
    update_s: float


def describe(values: NDArray[Any], interval_s: float) -> Noise:
    """Describe the noise of a channel.

    Args:
        values: (n,) samples, evenly spaced and finite.
        interval_s: spacing [s].

    Raises:
        ValueError: the values are not one finite row.
    """
    values = _checked(values)
    held = _held(values)
    return Noise(white_rms(values[::held]), quantisation(values), held * interval_s)


def describe_command(values: NDArray[Any], interval_s: float) -> Noise:
    """Describe the noise of a command, whose steps are no noise and whose rests are no slow instrument.

    Args:
        values: (n,) samples, evenly spaced and finite.
        interval_s: spacing [s].

    Raises:
        ValueError: the values are not one finite row.
    """
    values = _checked(values)
    rests = float(np.mean(np.diff(values) == 0.0)) > 0.5 if len(values) > 1 else True
    return Noise(0.0 if rests else white_rms(values), quantisation(values), interval_s)


def _checked(values: NDArray[Any]) -> NDArray[np.float64]:
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 1 or not np.isfinite(values).all():
        raise ValueError("the noise of a channel is described from one row of finite values")
    return values


def white_rms(values: NDArray[Any]) -> float:
    """Rms of the white part of (n,) samples; 0 with fewer than 16."""
    if len(values) < _FEWEST:
        return 0.0
    differences = _differences(values)
    scale = _MAD_TO_RMS * float(np.median(np.abs(differences)))
    if scale == 0.0:  # more than half do not move at all: coarse quantisation
        return float(np.sqrt(np.mean(differences**2))) / _GAIN if _toggles(values) else 0.0
    for _ in range(20):
        kept = differences[np.abs(differences) <= _OUTLIER * scale]
        before, scale = scale, float(np.sqrt(np.mean(kept**2))) / _KEPT_RMS
        if abs(scale - before) <= 1e-3 * before:
            break
    return scale / _GAIN


def row_noise(values: NDArray[Any], explaining: Sequence[NDArray[np.float64]]) -> float:
    """Return the rms noise of a channel whose rows each stand for themselves.

    The inputs may differ from row to row, so differences between neighbouring rows hold more than noise:
    what they share with the differences of some explaining signals is taken off. Where the rows change
    slowly, :func:`white_rms` may find less, and the lesser value counts.

    Args:
        values: (n,) samples.
        explaining: inputs and simulated channels, each of shape (n,).
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


def _differences(values: NDArray[Any]) -> NDArray[np.float64]:
    """Differences of that order, without long rests where a channel toggles outside them.

    A stopped sensor has no noise; an order that moves now and then has none anywhere.
    """
    first, lengths = _rests(values)
    odd = _odd(lengths)
    if not odd.any():
        return np.diff(values, ORDER)
    ends = np.concatenate([[0], (first + lengths)[odd]])
    begins = np.concatenate([first[odd], [len(values)]])
    moving = [values[a:b] for a, b in zip(ends, begins, strict=True) if b - a >= _FEWEST]
    if not moving or not _toggles(np.concatenate(moving)):
        return np.diff(values, ORDER)
    return np.concatenate([np.diff(part, ORDER) for part in moving])


def _rests(values: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First sample and length of every run of equal values."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    return edges[:-1], np.diff(edges)


def _odd(lengths: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which runs are longer than a channel that moves at all ever rests."""
    odd: NDArray[np.bool_] = lengths >= _ODD_REST * max(1.0, float(np.median(lengths)))
    return odd


def quantisation(values: NDArray[Any]) -> float:
    """Step q such that every value is a multiple of q apart from every other; 0 if there is none.

    A channel counts as quantised only where its values recur: a grid on which every sample has a
    level of its own cannot be told from the digits of the file.
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


def clipped(values: NDArray[Any], noise: Noise) -> list[tuple[float, float, int]]:
    """Ends at which a noisy channel is cut off: value, share of the samples, first sample.

    A channel whose noise moves it by more than its quantisation never rests; one that rests at its
    extreme, far more often than at the value next to it, is cut off there.
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


def odd_rests(values: NDArray[Any], noise: Noise) -> list[tuple[int, int]]:
    """Return first sample and length of the rests of a noisy channel that its noise does not explain."""
    if _is_still(values, noise):
        return []
    first, lengths = _rests(values)
    odd = _odd(lengths)
    return [(int(a), int(n)) for a, n in zip(first[odd], lengths[odd], strict=True)]


def frozen(values: NDArray[Any], noise: Noise) -> tuple[int, int]:
    """First sample and length of the longest rest of a noisy channel; (0, 0) if none is odd."""
    return max(odd_rests(values, noise), key=lambda rest: rest[1], default=(0, 0))


def _is_still(values: NDArray[Any], noise: Noise) -> bool:
    """Whether a channel may rest: no noise moves it, besides that of arithmetic in a simulation."""
    arithmetic = _ARITHMETIC * float(np.max(np.abs(values), initial=0.0))
    return noise.white_rms <= max(2.0 * noise.quantisation, arithmetic)


def _held(values: NDArray[Any]) -> int:
    """Samples over which each value is repeated: n of a sample-and-hold, else 1."""
    changes = np.flatnonzero(np.diff(values)) + 1
    if len(changes) < _FEWEST:
        return 1
    spacing = np.diff(changes)
    every = int(np.median(spacing))
    regular = np.mean(spacing % every == 0) > 0.95 and np.mean(spacing == every) > 0.5
    return every if every > 1 and regular else 1


def _toggles(values: NDArray[Any]) -> bool:
    """Whether a channel goes to and fro between levels, as noise does and an order does not."""
    steps = np.sign(np.diff(values))
    steps = steps[steps != 0.0]
    return len(steps) >= _FEWEST and float(np.mean(steps[1:] != steps[:-1])) > 0.3
