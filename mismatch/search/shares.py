"""The best shares of some regressors where every band's covariance is whatever they leave.

With S_b the covariance of band b, f = -2 sum of n_b log det S_b - s^T s is climbed over the shares s.
For fixed covariances the best shares are those of least squares; but what they take out of a band
lowers its covariance, which makes the band tell more. Going from one to the other in turn climbs always
and may creep, for the shares of what is hardly told; so each step is one of Newton's, with the curvature
of the log det, held back where no maximum lies ahead (Levenberg 1944; Marquardt 1963).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
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
