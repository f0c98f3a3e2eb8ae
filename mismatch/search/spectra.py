"""The best shares of some regressors where every band's covariance is whatever they leave.

With S_b the covariance of band b, f = -2 sum of n_b log det S_b - s^T s is climbed over the shares s.
For fixed covariances the best shares are those of least squares; but what they take out of a band
lowers its covariance, which makes the band tell more. Going from one to the other in turn climbs always
and may creep, for the shares of what is hardly told; so each step is one of Newton's, with the curvature
of the log det, held back where no maximum lies ahead (Levenberg 1944; Marquardt 1963).

Whitened scoring: how likely coloured residuals are, without being told their colour.

The residuals of the balances are noise of unknown spectrum: white instruments, their derivatives, a sea
band, drift. In the frequency domain such noise is independent from one frequency to the next, with a
covariance between the balances that varies slowly with frequency (Whittle 1953; Brillinger 1981,
chapter 7). Bands of neighbouring frequencies each have a covariance of their own, free to be whatever
the residual makes it, so a model's likelihood is

    2 log L = -2 sum over bands of n_b log det S_b,   S_b = mean over the band of r r^H.

A ratio of two such likelihoods says what a model explains without an assumed colour; the coloured noise
that fools F, AICc and BIC on raw samples is inside S_b.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from ...core.compiled import compiled_apart

Complex = NDArray[np.complex128]

MOST_STEPS = 60

LEAST_CURVATURE = 0.02
"""Of the information's, that a step takes for granted."""

TRUSTED, DISTRUSTED = 0.7, 0.25
"""Share of the gain that was foretold, above which steps grow and below which they shrink."""


class Sums(NamedTuple):
    """Products over each band, which is all that the climb needs.

    Args:
        own: of the residual with itself, shape (bands, m, m).
        crossed: of the residual with each regressor, shape (k, bands, m, m).
        pairs: of the regressors with each other, real and imaginary parts side by side, shape
            (k * k, bands * m * m * 2).
        counts: weight of each band.
    """

    own: Complex
    crossed: Complex
    pairs: NDArray[np.float64]
    counts: NDArray[np.float64]


@compiled_apart
def gram(pairs: NDArray[np.float64], weight: Complex) -> NDArray[np.float64]:
    """Information on the regressors, their prior included, shape (k, k).

    The weight is Hermitian: its transpose, which the trace of weight times products asks for, is its
    conjugate, and that is what the real part of a product of complex numbers asks for.

    Args:
        pairs: as of :class:`Sums`.
        weight: inverse covariances, shape (bands, m, m).
    """
    k = int(len(pairs) ** 0.5 + 0.5)
    return 2.0 * (pairs @ weight.reshape(-1).view(np.float64)).reshape(k, k) + np.eye(k)


@compiled_apart
def inverted(matrices: Complex, counts: NDArray[np.float64]) -> float:
    """Invert a Hermitian matrix a band in place (Gauss and Jordan, without exchange of rows).

    Args:
        matrices: positive definite, shape (bands, m, m).
        counts: weight of each band.

    Returns:
        Sum over the bands of their weight times log |det|; nan where one is not positive definite, be it
        by rounding alone.
    """
    total = 0.0
    for band in range(len(matrices)):
        a = matrices[band]
        for p in range(len(a)):
            pivot = a[p, p].real
            if not pivot > 0.0:
                return np.nan
            total += counts[band] * np.log(pivot)
            a[p, p] = 1.0
            a[p] /= pivot
            for i in range(len(a)):
                if i != p:
                    share = a[i, p]
                    a[i, p] = 0.0
                    a[i] -= share * a[p]
        for p in range(len(a)):  # rounding leaves the halves of a nearly singular one apart
            for q in range(p + 1):
                mean = 0.5 * (a[p, q] + np.conj(a[q, p]))
                a[p, q], a[q, p] = mean, np.conj(mean)
    return total


@compiled_apart
def _at(sums: Sums, shares: NDArray[np.float64]) -> tuple[float, Complex, Complex]:
    """The score at some shares, the inverse covariances, and the derivatives of the bands' sums."""
    k, bands, m, _ = sums.crossed.shape
    moved = shares @ sums.pairs.reshape(k, k * bands * m * m * 2)
    half = moved.view(np.complex128).reshape(k, bands, m, m) - sums.crossed
    slopes = np.empty_like(half)
    covariance = sums.own.copy()
    for i in range(k):
        for b in range(bands):
            for p in range(m):
                for q in range(m):
                    slopes[i, b, p, q] = half[i, b, p, q] + np.conj(half[i, b, q, p])
                    covariance[b, p, q] += shares[i] * (
                        half[i, b, p, q] - np.conj(sums.crossed[i, b, q, p])
                    )
    for b in range(bands):
        covariance[b] /= sums.counts[b]
    determinant = inverted(covariance, sums.counts)
    return -2.0 * determinant - float(np.sum(shares**2)), covariance, slopes


@compiled_apart
def _steepness(
    weight: Complex,
    slopes: Complex,
    counts: NDArray[np.float64],
    shares: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Half the derivative of the score, and what the bands' own change takes from its curvature."""
    k, bands, m, _ = slopes.shape
    rise, bent = -shares.copy(), np.zeros((k, k))
    weighed = np.empty((k, m, m), np.complex128)
    for b in range(bands):
        for i in range(k):
            for p in range(m):
                for q in range(m):
                    total = 0.0 + 0.0j
                    for r in range(m):
                        total += weight[b, p, r] * slopes[i, b, r, q]
                    weighed[i, p, q] = total
                rise[i] -= weighed[i, p, p].real
        for i in range(k):
            for j in range(i + 1):
                total = 0.0 + 0.0j
                for p in range(m):
                    for q in range(m):
                        total += weighed[i, p, q] * weighed[j, q, p]
                bent[i, j] += total.real / counts[b]
    for i in range(k):
        for j in range(i):
            bent[j, i] = bent[i, j]
    return rise, bent


@compiled_apart
def best_shares(
    sums: Sums, start: NDArray[np.float64], tolerance: float
) -> tuple[float, NDArray[np.float64], Complex]:
    """Climb f from some shares on.

    Args:
        sums: over each band.
        start: shares, shape (k,).
        tolerance: gain in f below which a step is the last.

    Returns:
        f, the shares, and the inverse covariances, shape (bands, m, m).
    """
    shares = start.copy()
    score, weight, slopes = _at(sums, shares)
    held = 0.0
    for _ in range(MOST_STEPS if np.isfinite(score) else 0):
        rise, bent = _steepness(weight, slopes, sums.counts, shares)
        told = True
        try:
            root = np.linalg.cholesky(gram(sums.pairs, weight))
        except Exception:  # compiled code knows no other; rounding has left no way on
            told = False
        if not told:
            break
        inner = np.linalg.solve(root, bent)
        bends, axes = np.linalg.eigh(np.linalg.solve(root, inner.T.copy()))
        along = axes.T @ np.linalg.solve(root, rise)
        curvature = np.where(bends < 1.0, 1.0 - bends, 0.3 * (bends - 1.0))
        curvature = np.maximum(curvature, LEAST_CURVATURE)
        gain = -1.0
        while True:
            step = along / (curvature + held)
            foretold = 2.0 * (along @ step) - np.sum((1.0 - bends) * step**2)
            trial = shares + np.linalg.solve(root.T.copy(), axes @ step)
            found, heavier, steeper = _at(sums, trial)
            if found > score or not abs(foretold) > 1e-3 * tolerance:
                break
            held = max(4.0 * held, 0.3)
        if found > score:
            gain = found - score
            score, shares, weight, slopes = found, trial, heavier, steeper
        # a small step that was held back tells nothing
        if gain <= 0.0 or (gain < tolerance and held == 0.0):
            break
        sure = gain / abs(foretold)
        if sure > TRUSTED:
            held = 0.0 if held < 0.1 else held / 5.0
        elif sure < DISTRUSTED:
            held = max(3.0 * held, 0.1)
    return score, shares, weight


TAPER_SHARE = 0.05
"""Share of a segment at either end over which the cosine bell fades it in and out."""

LONG = 30_000
"""Rows from which on a segment gives up its last few for a length that is transformed fast: 108001 rows
take 25 times as long as 108000."""

BAND_RATIO = 1.25
"""Ratio of a band's upper to its lower edge, where it holds enough frequencies."""


SMALL_SAMPLE = 1.5
"""Factor by which a likelihood ratio of few frequencies a band is larger than its limit, chi-squared;
measured on simulated nulls."""


def chance(freedom: int, tried: int, risk: float) -> float:
    """Gain in 2 log L that the best of some trials exceeds by chance alone with a small probability.

    Args:
        freedom: numbers that each trial fits.
        tried: how many.
        risk: the probability, that one of all of them does.
    """
    return SMALL_SAMPLE * float(scipy.stats.chi2.isf(risk / tried, freedom))


@dataclass(frozen=True)
class Bands:
    """Frequencies of the segments of a recording, and the bands that pool them.

    Args:
        starts: first sample of each segment.
        ends: one past its last.
        interval_s: sampling interval [s].
        edges: index of each band's first frequency among the pooled, sorted ones; shape (bands + 1,).
        order: that sorts the pooled frequencies; shape (frequencies,).
        weights: of each sorted frequency in the likelihood: 1, and 1/2 where the transform is real.
        tapers: of each segment.
        highest_Hz: above which frequencies are left out.
    """

    starts: tuple[int, ...]
    ends: tuple[int, ...]
    interval_s: float
    edges: NDArray[np.int64]
    order: NDArray[np.int64]
    frequency_Hz: NDArray[np.float64]
    weights: NDArray[np.float64]
    tapers: tuple[NDArray[np.float64], ...]
    highest_Hz: float = math.inf

    def transform(self, residual: NDArray[np.float64]) -> Complex:
        """Tapered Fourier transform of residuals.

        Args:
            residual: shape (..., n) over the whole recording; the last axis is time.

        Returns:
            Shape (..., frequencies), sorted by frequency, scaled to keep the variance.
        """
        parts = [
            np.fft.rfft(residual[..., a:b] * taper, axis=-1) / np.sqrt(np.sum(taper**2))
            for a, b, taper in zip(self.starts, self.ends, self.tapers, strict=True)
        ]
        pooled = np.concatenate(parts, axis=-1)
        return np.asarray(pooled[..., self.order])


def taper(n: int) -> NDArray[np.float64]:
    """Split cosine bell (Tukey window) of n samples."""
    edge = max(1, round(TAPER_SHARE * n))
    window = np.ones(n)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    window[:edge], window[n - edge :] = ramp, ramp[::-1]
    return window


def fast_length(rows: int) -> int:
    """Rows of a long segment that are transformed: the most of which no prime factor is above 7."""
    if rows < LONG:
        return rows
    for length in range(rows, 0, -1):
        rest = length
        for prime in (2, 3, 5, 7):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return length
    return rows


def make_bands(
    segments: list[tuple[int, int]],
    interval_s: float,
    balances: int,
    highest_Hz: float,
    regressors: int = 0,
) -> Bands:
    """Bands for residuals of some balances over segments of a recording.

    Args:
        segments: (first sample, one past the last) of each.
        interval_s: [s].
        balances: how many residuals are judged together; a band holds three times as many frequencies
            at least, so that its covariance is well determined.
        highest_Hz: frequencies above are left out.
        regressors: how many are free where they are many. So many and two for each further balance can
            make a combination of the balances vanish at half as many frequencies, and a band of no more
            would be explained perfectly by chance: a band holds as many again.
    """
    frequency, weight = [], []
    segments = [(a, a + fast_length(b - a)) for a, b in segments]
    for a, b in segments:
        f = np.fft.rfftfreq(b - a, interval_s)
        real = (f == 0.0) | (np.isclose(f, 0.5 / interval_s))
        frequency.append(f)
        weight.append(np.where(real, 0.5, 1.0))
    pooled = np.concatenate(frequency)
    order = np.argsort(pooled, kind="stable")
    order = order[pooled[order] <= highest_Hz]
    ordered = pooled[order]
    least = max(8, 3 * balances, regressors + 2 * (balances - 1))
    edges = [0]
    while edges[-1] < len(ordered):
        first = edges[-1]
        last = int(np.searchsorted(ordered, ordered[first] * BAND_RATIO, side="right"))
        last = max(last, first + least)
        edges.append(len(ordered) if len(ordered) - last < least else last)
    tapers = tuple(taper(b - a) for a, b in segments)
    return Bands(
        tuple(a for a, _ in segments), tuple(b for _, b in segments), interval_s,
        np.array(edges), order, ordered, np.concatenate(weight)[order], tapers,
        highest_Hz,
    )  # fmt: skip


def moments(bands: Bands, left: Complex, right: Complex) -> Complex:
    """Sums of products over each band, left times right conjugate; shape (bands, p, q).

    Args:
        bands: the bands.
        left: shape (p, frequencies).
        right: shape (q, frequencies).
    """
    turned = np.conj(left * bands.weights)  # the left, so that the long right is not copied
    sums = np.empty((len(bands.edges) - 1, len(left), len(right)), np.complex128)
    for band, (first, end) in enumerate(itertools.pairwise(bands.edges)):
        np.matmul(turned[:, first:end], right[:, first:end].T, out=sums[band])
    return np.conj(sums, out=sums)


@dataclass(frozen=True)
class Marginal:
    """A residual with nuisance regressors fitted to it."""

    score: float  # 2 log L with the prior of the shares
    shares: NDArray[np.float64]  # of the regressors, in prior standard deviations
    weight: Complex  # inverse covariance by band, shape (bands, m, m)


def runs_away(residual: Complex) -> bool:
    """Whether a residual comes from a simulation whose numbers have left what a power is formed of."""
    with np.errstate(over="ignore", invalid="ignore"):
        return not math.isfinite(float(np.square(np.abs(residual)).sum()))


class Likelihood:
    """2 log L of residuals with some regressors free under a standard normal prior.

    Everything is reduced to sums over bands once, so that the climb over the regressors' shares costs
    little.

    Args:
        bands: the bands.
        regressors: shape (k, m, frequencies).
    """

    def __init__(self, bands: Bands, regressors: Complex) -> None:
        self.bands = bands
        k, m, f = regressors.shape
        self.shape = (k, m)
        self._flat = regressors.reshape(k * m, f)
        count = len(bands.edges) - 1
        products = moments(bands, self._flat, self._flat).reshape(count, k, m, k, m)
        # rows: pairs (l, k) of regressors; columns: bands and pairs (q, p) of balances
        in_order = np.ascontiguousarray(products.transpose(1, 3, 0, 2, 4))
        self._pairs = in_order.reshape(k * k, -1).view(np.float64)
        self._counts = np.add.reduceat(bands.weights, bands.edges[:-1])

    def __call__(
        self, residual: Complex, start: NDArray[np.float64] | None = None, tolerance: float = 0.05
    ) -> Marginal:
        """Best shares and score of a residual of shape (m, frequencies), from some shares on."""
        k, m = self.shape
        own = moments(self.bands, residual, residual)
        products = moments(self.bands, residual, self._flat).reshape(-1, m, k, m)
        crossed = np.ascontiguousarray(products.transpose(2, 0, 1, 3))
        first = np.zeros(k) if start is None else np.asarray(start, np.float64)
        sums = Sums(own, crossed, self._pairs, self._counts)
        score, shares, weight = best_shares(sums, first, tolerance)
        if not math.isfinite(score):
            raise np.linalg.LinAlgError("singular: a balance's residual is 0 or another's multiple")
        return Marginal(score, shares, weight)

    def amount(self, weight: Complex, residual: Complex, column: Complex) -> tuple[float, float]:
        """Generalised least squares: how much of a column is in a residual, the regressors free.

        Args:
            weight: inverse covariance by band.
            residual: shape (m, frequencies).
            column: likewise.

        Returns:
            The amount, and what it gains in 2 log L; both 0 where the column moves nothing.
        """
        k, m = self.shape
        both = np.concatenate([residual, column])
        crossed = moments(self.bands, both, self._flat).reshape(-1, 2, m, k, m)
        with_regressors = 2.0 * np.einsum("bpq,baqkp->ak", weight, crossed).real
        own = moments(self.bands, both, column).reshape(-1, 2, m, m)
        with_column = 2.0 * np.einsum("bpq,baqp->a", weight, own).real
        taken = np.linalg.solve(gram(self._pairs, weight), with_regressors[1])
        rest = with_column[1] - taken @ with_regressors[1]
        told = with_column[0] - taken @ with_regressors[0]
        return (float(told / rest), float(told**2 / rest)) if rest > 0.0 else (0.0, 0.0)

    def information(self, weight: Complex, columns: Complex) -> NDArray[np.float64]:
        """Fisher information of columns and regressors together, the prior included.

        Args:
            weight: inverse covariance by band.
            columns: shape (c, m, frequencies).

        Returns:
            Shape (c + k, c + k).
        """
        prior = np.diag([0.0] * len(columns) + [1.0] * self.shape[0])
        return np.asarray(self.information_by_band(weight, columns).sum(axis=0) + prior)

    def information_by_band(self, weight: Complex, columns: Complex) -> NDArray[np.float64]:
        """Return what each band adds to the information, without the prior.

        Args:
            weight: inverse covariance by band.
            columns: shape (c, m, frequencies).

        Returns:
            Shape (bands, c + k, c + k).
        """
        c = len(columns)
        k, m = self.shape
        flat = np.concatenate([columns.reshape(c * m, self._flat.shape[1]), self._flat])
        products = moments(self.bands, flat, flat).reshape(-1, c + k, m, c + k, m)
        return np.asarray(2.0 * np.einsum("bpq,blqkp->bkl", weight, products).real)
