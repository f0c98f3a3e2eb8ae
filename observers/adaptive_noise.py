"""Kernels that estimate the noises of an extended Kalman filter from its innovations, row by row.

The logarithm theta of each variance R of a measurement and of each density Q of process noise climbs the
likelihood of the innovations d, whose expected variance is S = H P H' + R. Maximum likelihood is one of
the four approaches of Mehra 1972 (IEEE Trans. Automatic Control 17(5)), the recursion that of Ljung and
Soederstroem 1983 (Theory and Practice of Recursive Identification, section 3.8):

    theta += g score / J,   score = S_t / S (nu^2 - 1) / 2 - nu d_t / S^0.5,   nu = d / S^0.5

The index t is the derivative by theta, J the mean of the information (S_t / S)^2 / 2 + d_t^2 / S, and
g = 1 - exp(-T / memory) the weight of a row of T seconds. The derivatives of the estimate z and of its
covariance P change over a measurement with gain K = P H' / S by (R_t = R for its own noise, else 0)

    S_t = H P_t H' + R_t,   d_t = -H z_t,   z_t += K d_t + (P_t H' - K S_t) d / S,
    P_t += K K' S_t - K H P_t - P_t H' K'

and over a step to z_t = Phi z_t, P_t = Phi P_t Phi' + Q_t dt.

Covariance matching (Mohamed and Schwarz 1999, J. Geodesy 73; Akhlaghi, Zhou and Huang 2017) uses the
first term of the score alone. It holds the variance of the innovations, which is also right where R is
far too small and Q too large. The second term holds their correlation in time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import compiled
from .augmented import propagate
from .records import Floats

Ints = NDArray[np.int64]

LARGEST = 10.0
"""Largest squared innovation over its expected variance that counts. It holds outliers back; a normal
innovation exceeds it once in 600 rows."""
LEAST_INFORMATION = 0.02
"""Added to the mean information of a row about a log variance: 0.5 is that of a measurement without
any other uncertainty. A noise that the innovations hardly determine then changes slowly."""
LARGEST_STEP = 0.2  # largest change of a log variance by a row


class AdaptiveNoise(NamedTuple):
    """Noises that are estimated, m in all: those of the channels, then those of states.

    The derivatives are by the logarithms of the variances.
    """

    gain: float  # weight g of a row; 0 keeps the noises constant
    states: Ints  # index in z of each process noise that is estimated
    estimate: Floats  # derivatives z' of the estimate, shape (m, n)
    covariance: Floats  # derivatives P', shape (m, n, n)
    score: Floats  # score of the present row, shape (m,)
    seen: Floats  # information of the present row, shape (m,)
    information: Floats  # mean information of a row, shape (m,)
    least: Floats  # smallest variances, shape (m,)


def start_adaptive_noise(gain: float, states: Ints, least: Floats, n: int) -> AdaptiveNoise:
    """Return adaptive noise at the start of a recording, with an estimate z of n elements.

    Args:
        gain: weight g of a row [-].
        states: index in z of each process noise.
        least: smallest variance of each channel, then of the process noises, shape (m,).
        n: number of elements of z.
    """
    m = len(least)
    return AdaptiveNoise(
        gain,
        states,
        np.zeros((m, n)),
        np.zeros((m, n, n)),
        np.zeros(m),
        np.zeros(m),
        np.full(m, 0.5),
        least,
    )


@compiled
def propagate_slopes(
    adaptive: AdaptiveNoise, f: Floats, states: int, process: Floats, dt: float, work: Floats
) -> None:
    """Propagate the derivatives over a step in place; arguments as of :func:`.augmented.propagate`."""
    channels, still = len(adaptive.score) - len(adaptive.states), np.zeros(len(process))
    for j in range(len(adaptive.score)):
        propagate(adaptive.covariance[j], f, states, still, dt, work)
        phi, before = work[0], adaptive.estimate[j].copy()
        for i in range(states):
            total = 0.0
            for k in range(len(before)):
                total += phi[i, k] * before[k]
            adaptive.estimate[j, i] = total
        if j >= channels:
            i = adaptive.states[j - channels]
            adaptive.covariance[j, i, i] += process[i] * dt


@compiled
def correct_slopes(
    adaptive: AdaptiveNoise,
    channel: int,
    slope: Floats,
    gain: Floats,
    innovation: float,
    noise: float,
    total: float,
) -> None:
    """Correct the derivatives by one measurement in place, and add its score and information.

    Args:
        adaptive: estimated noises.
        channel: index of the measurement's noise.
        slope: H, shape (n,).
        gain: K, shape (n,).
        innovation: d.
        noise: variance R of the measurement.
        total: variance S of the innovation.
    """
    n = len(slope)
    nu = innovation / np.sqrt(total)
    square = min(nu * nu, LARGEST)
    limited = np.copysign(np.sqrt(square), nu)
    cross = np.zeros(n)
    for j in range(len(adaptive.score)):
        z, p = adaptive.estimate[j], adaptive.covariance[j]
        more, shift = noise if j == channel else 0.0, 0.0
        for i in range(n):
            cross[i] = 0.0
            for k in range(n):
                cross[i] += p[i, k] * slope[k]
            more += slope[i] * cross[i]
            shift -= slope[i] * z[i]
        share, moved = more / total, shift / np.sqrt(total)
        adaptive.score[j] += 0.5 * share * (square - 1.0) - limited * moved
        adaptive.seen[j] += 0.5 * share * share + moved * moved
        for i in range(n):
            z[i] += gain[i] * shift + (cross[i] - gain[i] * more) * innovation / total
            for k in range(n):
                p[i, k] += gain[i] * gain[k] * more - gain[i] * cross[k] - cross[i] * gain[k]


@compiled
def adapt(adaptive: AdaptiveNoise, noise: Floats, process: Floats) -> None:
    """Change the noises by the score of one row, in place.

    Args:
        adaptive: estimated noises; the score of the row is cleared.
        noise: variances of the channels.
        process: densities of z.
    """
    for j in range(len(adaptive.score)):
        adaptive.information[j] += adaptive.gain * (adaptive.seen[j] - adaptive.information[j])
        known = max(adaptive.information[j], adaptive.seen[j]) + LEAST_INFORMATION
        step = adaptive.gain * adaptive.score[j] / known
        factor = np.exp(min(max(step, -LARGEST_STEP), LARGEST_STEP))
        adaptive.score[j], adaptive.seen[j] = 0.0, 0.0
        if j < len(noise):
            noise[j] = max(noise[j] * factor, adaptive.least[j])
        else:
            i = adaptive.states[j - len(noise)]
            process[i] = max(process[i] * factor, adaptive.least[j])
