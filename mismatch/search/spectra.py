"""Compute likelihoods of residuals with coloured noise of unknown spectrum (Whittle likelihood).

The residuals of the balances are noise of unknown spectrum: white instrument noise and its derivatives,
waves, drift. In the frequency domain such noise is independent from one frequency to the next, with a
covariance between the balances that varies slowly with frequency (Whittle 1953; Brillinger 1981,
chapter 7). Each band of neighbouring frequencies has a free covariance, so that the likelihood is

    2 log L = -2 sum over bands of n_b log det S_b,   S_b = mean over the band of r r^H.

A ratio of two likelihoods measures the explained power without an assumed spectrum. The coloured noise
that misleads F tests, AICc and BIC on raw samples is part of S_b.

Regressors have shares s with a standard normal prior, and f = -2 sum of n_b log det S_b - s^T s is
maximised over s. Alternating between least squares and new covariances always increases f, but converges
slowly for shares with little information. Each step is therefore a Newton step with the curvature of the
log det, damped where the maximum does not lie ahead (Levenberg 1944; Marquardt 1963).

The frequencies end where the recordings carry hardly any information about changes of the ship. Above,
the residual holds much of what the ship model leaves out: encoders, flexible shafts, the corner of a
friction law. These errors would bias the choice of effects, and more so with faster sampling.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.compiled import compiled_apart
from ...core.statistics import chi_squared_limit
from ...plant.columns import HEADING, SHAFT_ANGLE, YAW_RATE
from ...plant.simulation import alike_groups
from ..simulate.balances import Balances, Channels, time_derivative, tolerance_records
from ..simulate.joint_replay import NO_SHIFT, Floats, JointReplay, map_threaded
from .catalogue import Effect
from .trial_ship import TrialShip

Complex = NDArray[np.complex128]

Segments = list[tuple[int, int]]
"""First row of each segment, and one past its last."""

INFORMATION_SHARE = 0.95
"""Share of the information on a change below the frequency; the rest hardly reduces its error."""

LEAST_FREQUENCIES = 60
"""Fewest frequencies that are fitted, so that a slow change is distinguishable from noise."""

SAMPLES_A_PERIOD = 5.0
"""Averaged rows per period of the highest frequency. The mean over a row then passes 0.94 of it, and
aliases are damped to a quarter."""

TAPER_SHARE = 0.05
"""Share of a segment at each end over which the cosine window rises and falls."""

LONG = 30_000
"""Rows from which the last are dropped: 108001 rows take 25 times as long to transform as 108000."""

BAND_RATIO = 1.25
"""Ratio of the upper to the lower edge of a band that holds enough frequencies."""

SMALL_SAMPLE = 1.5
"""Factor on the chi-squared limit with few frequencies per band, from simulated null cases."""

MOST_STEPS = 60
"""Largest number of Newton steps."""

LEAST_CURVATURE = 0.02
"""Smallest curvature of a step, as a share of that of the information."""

TRUSTED, DISTRUSTED = 0.7, 0.25
"""Ratio of actual to predicted gain above which steps grow and below which they shrink."""


def highest_informative_frequency(
    balances: Balances, effects: list[Effect], segments: Segments
) -> float:
    """Return the highest informative frequency [Hz] of all effects and of all uncertain parameters.

    The effects are at their smallest probes; windowed effects are slow and left out. The frequency is
    infinite if no change has an effect on the segments.
    """
    replay, trial_ship = balances.replay, TrialShip(balances)
    trials = (next(trial_ship.smallest_trials(effect, []), None) for effect in effects)
    probes = ((trial_ship.record((trial,)), NO_SHIFT) for trial in trials if trial)
    changes = [*probes, *tolerance_records(replay)]
    frequency_of = informative_frequency(replay, balances.nominal, segments)

    def frequencies(group: Sequence[int]) -> list[float]:
        ships = replay.simulate_ships(*zip(*(changes[i] for i in group), strict=True))
        return list(map(frequency_of, ships))

    groups = alike_groups([plant for plant, _ in changes])
    found = itertools.chain.from_iterable(map_threaded(frequencies, groups))
    return max(filter(math.isfinite, found), default=math.inf)


def informative_frequency(
    replay: JointReplay, here: Channels, segments: Segments
) -> Callable[[Channels], float]:
    """Return a function that returns the highest informative frequency [Hz] of a change.

    The function has the channels (rows,) of another simulation than ``here`` as argument, and returns
    infinity if they do not differ. The information up to a frequency is the squared change of the
    channels, divided by the variance of their white noise and summed up to this frequency. An angle
    counts by its derivative.
    """
    noise, columns = replay.noise_rms, [c for c in replay.channels if replay.noise_rms[c] > 0.0]
    if YAW_RATE in replay.channels and HEADING in columns:
        columns.remove(HEADING)  # The balances use the yaw rate, which is measured more precisely.
    segments = [(a, a + fast_length(b - a)) for a, b in segments]
    frequency = np.concatenate([np.fft.rfftfreq(b - a, replay.interval_s) for a, b in segments])
    order = np.argsort(frequency)
    rising = frequency[order]
    least = float(rising[: LEAST_FREQUENCIES + 1][-1])
    windows = [(slice(a, b), cosine_taper(b - a)) for a, b in segments]

    def frequency_of(there: Channels) -> float:
        information = np.zeros(len(frequency))
        for column in columns:
            shift = there[column] - here[column]
            if column in (SHAFT_ANGLE, HEADING):
                shift = time_derivative(shift, replay.interval_s)
            if np.isfinite(shift).all():
                scaled = shift / noise[column]
                parts = [np.fft.rfft(scaled[rows] * taper) for rows, taper in windows]
                information += np.abs(np.concatenate(parts)) ** 2
        information = np.cumsum(information[order])
        if not information[-1] > 0.0:
            return math.inf
        last = np.searchsorted(information, INFORMATION_SHARE * information[-1])
        return max(least, float(rising[last]))

    return frequency_of


def rows_per_average(interval_s: float, highest_Hz: float) -> int:
    """Return the number of rows that may be averaged if only frequencies up to a limit are fitted.

    Example:
        >>> rows_per_average(0.01, 2.0)
        10

    Args:
        interval_s: sampling interval [s].
        highest_Hz: highest fitted frequency [Hz]; infinite for no averaging.
    """
    if not math.isfinite(highest_Hz):
        return 1
    return max(1, math.floor(1.0 / (SAMPLES_A_PERIOD * highest_Hz * interval_s) + 1e-9))


class Likelihood:
    """Likelihood 2 log L of residuals, with regressors that are free under a standard normal prior.

    The regressors are reduced to sums over bands once, so that each maximisation is cheap.

    Args:
        bands: the bands.
        regressors: shape (k, m, frequencies).
    """

    def __init__(self, bands: Bands, regressors: Complex) -> None:
        self.bands = bands
        k, m, f = regressors.shape
        self.shape = (k, m)
        self._flat = regressors.reshape(k * m, f)
        products = band_products(bands, self._flat, self._flat).reshape(-1, k, m, k, m)
        self._pairs = _in_order(products)
        self._counts = np.add.reduceat(bands.weights, bands.edges[:-1])

    def with_columns(self, columns: Complex) -> Likelihood:
        """Return a likelihood with further regressors, (c, m, frequencies), before the present ones."""
        other, (k, m) = copy.copy(self), self.shape
        other.shape = (len(columns) + k, m)
        other._flat = np.concatenate([columns.reshape(-1, self._flat.shape[1]), self._flat])
        other._pairs = _in_order(self._products(columns))
        return other

    def _products(self, columns: Complex) -> Complex:
        """Return the sums of products of columns and regressors, shape (bands, c + k, m, c + k, m).

        Those of the regressors with each other are known.
        """
        c, (k, m), bands = len(columns), self.shape, len(self._counts)
        flat = columns.reshape(c * m, self._flat.shape[1])
        crossed = band_products(self.bands, flat, self._flat).reshape(bands, c, m, k, m)
        products = np.empty((bands, c + k, m, c + k, m), np.complex128)
        products[:, :c, :, :c] = band_products(self.bands, flat, flat).reshape(bands, c, m, c, m)
        products[:, :c, :, c:] = crossed
        products[:, c:, :, :c] = np.conj(crossed.transpose(0, 3, 4, 1, 2))
        known = self._pairs.view(np.complex128).reshape(k, k, bands, m, m)
        products[:, c:, :, c:] = known.transpose(2, 0, 3, 1, 4)
        return products

    def __call__(
        self, residual: Complex, start: Floats | None = None, tolerance: float = 0.05
    ) -> Marginal:
        """Return the best shares and the score of a residual, shape (m, frequencies).

        The maximisation begins at shares (k,), 0 by default, and ends at gains below the tolerance.

        Raises:
            numpy.linalg.LinAlgError: the covariance of the residual is singular.
        """
        k, m = self.shape
        own = band_products(self.bands, residual, residual)
        products = band_products(self.bands, residual, self._flat).reshape(-1, m, k, m)
        crossed = np.ascontiguousarray(products.transpose(2, 0, 1, 3))
        first = np.zeros(k) if start is None else np.asarray(start, np.float64)
        sums = Sums(own, crossed, self._pairs, self._counts)
        score, shares, weight = best_shares(sums, first, tolerance)
        if not math.isfinite(score):
            raise np.linalg.LinAlgError(
                "singular covariance: the residual of a balance is 0 or a multiple of another residual"
            )
        return Marginal(score, shares, weight)

    def amount(self, weight: Complex, residual: Complex, column: Complex) -> tuple[float, float]:
        """Return the amount of a column in a residual by generalised least squares with free regressors.

        Both have the shape (m, frequencies). Also return its gain in 2 log L; both are 0 for a
        column without independent power. The weight is the inverse covariance by band.
        """
        (((rest,),), (along,)) = self.projections(weight, residual, column[None])
        return (float(along / rest), float(along**2 / rest)) if rest > 0.0 else (0.0, 0.0)

    def projections(
        self, weight: Complex, residual: Complex, columns: Complex, balances: slice = slice(None)
    ) -> tuple[Floats, Floats]:
        """Return what columns have in common with each other and with a residual, with free regressors.

        Args:
            weight: inverse covariance by band.
            residual: shape (m, frequencies).
            columns: shape (c, n, frequencies).
            balances: the n balances in which the columns act; all by default.

        Returns:
            Information of the columns, shape (c, c), and their products with the residual, shape (c,).
        """
        k, m = self.shape
        c, n, f = columns.shape
        flat = columns.reshape(c * n, f)
        crossed = band_products(self.bands, flat, self._flat).reshape(-1, c, n, k, m)
        across = 2.0 * np.einsum("bpn,bcnkp->ck", weight[:, :, balances], crossed).real
        towards = band_products(self.bands, residual, self._flat).reshape(-1, m, k, m)
        projection = np.linalg.solve(gram(self._pairs, weight), across.T)
        products = band_products(self.bands, flat, flat).reshape(-1, c, n, c, n)
        own = 2.0 * np.einsum("bpn,bcndp->cd", weight[:, balances, balances], products).real
        shared = band_products(self.bands, flat, residual).reshape(-1, c, n, m)
        along = 2.0 * np.einsum("bpn,bcnp->c", weight[:, :, balances], shared).real
        of_residual = 2.0 * np.einsum("bpq,bqkp->k", weight, towards).real
        return own - across @ projection, along - of_residual @ projection

    def information(self, weight: Complex, columns: Complex) -> Floats:
        """Return the Fisher information of columns and regressors with the prior, (c + k, c + k).

        The weight is the inverse covariance by band; the columns have the shape (c, m, frequencies).
        """
        prior = np.diag([0.0] * len(columns) + [1.0] * self.shape[0])
        return np.asarray(self.information_by_band(weight, columns).sum(axis=0) + prior)

    def information_by_band(self, weight: Complex, columns: Complex) -> Floats:
        """Return the information of each band without the prior, shape (bands, c + k, c + k)."""
        products = self._products(columns)
        return np.asarray(2.0 * np.einsum("bpq,blqkp->bkl", weight, products).real)


def _in_order(products: Complex) -> Floats:
    """Return sums of products (bands, k, m, k, m) in the order of :class:`Sums`.

    Rows are pairs (l, k) of regressors; columns are bands and pairs (q, p) of balances.
    """
    in_order = np.ascontiguousarray(products.transpose(1, 3, 0, 2, 4))
    return in_order.reshape(products.shape[1] ** 2, -1).view(np.float64)


@dataclass(frozen=True)
class Marginal:
    """Fit of nuisance regressors to a residual."""

    score: float  # 2 log L with the prior of the shares
    shares: Floats  # shares of the regressors in prior standard deviations
    weight: Complex  # inverse covariance by band, shape (bands, m, m)


def is_divergent(residual: Complex) -> bool:
    """Return whether a residual is so large, or not finite, that its simulation has diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        return not math.isfinite(float(np.square(np.abs(residual)).sum()))


def chance_gain(freedom: int, tried: int, risk: float) -> float:
    """Return the gain in 2 log L that the best of several trials exceeds by chance with a given risk.

    Example:
        >>> round(chance_gain(1, 30, 0.01), 1)
        19.3

    Args:
        freedom: number of fitted parameters of each trial.
        tried: number of trials.
        risk: probability that at least one trial exceeds the gain.
    """
    return SMALL_SAMPLE * float(chi_squared_limit(risk / tried, freedom))


@dataclass(frozen=True)
class Bands:
    """Frequencies of the segments of a recording, pooled in bands."""

    starts: tuple[int, ...]  # first sample of each segment
    ends: tuple[int, ...]  # one past the last sample of each segment
    interval_s: float  # sampling interval [s]
    edges: NDArray[np.int64]  # first sorted frequency of each band, shape (bands + 1,)
    order: NDArray[np.int64]  # indices that sort the pooled frequencies, shape (frequencies,)
    frequency_Hz: Floats  # sorted frequencies [Hz], shape (frequencies,)
    weights: Floats  # weight of each in the likelihood: 1, or 1/2 for a real transform
    tapers: tuple[Floats, ...]  # window of each segment
    highest_Hz: float = math.inf  # highest frequency that is used [Hz]

    def transform(self, residual: Floats) -> Complex:
        """Return the windowed Fourier transform of residuals (..., n) over the whole recording.

        The shape is (..., frequencies), sorted by frequency and scaled to keep the variance.
        """
        segments = zip(self.starts, self.ends, self.tapers, strict=True)
        parts = [
            np.fft.rfft(residual[..., a:b] * taper, axis=-1) / np.sqrt(np.sum(taper**2))
            for a, b, taper in segments
        ]
        return np.asarray(np.concatenate(parts, axis=-1)[..., self.order])


def make_bands(
    segments: Segments, interval_s: float, balances: int, highest_Hz: float, regressors: int = 0
) -> Bands:
    """Return frequency bands for residuals of several balances over segments of a recording.

    Args:
        segments: (first sample, one past the last) of each segment.
        interval_s: sampling interval [s].
        balances: number of residuals with a joint covariance; a band holds at least three times as many
            frequencies, so that the covariance is well determined.
        highest_Hz: highest frequency that is used [Hz].
        regressors: number of free regressors, if there are many. With two more for each further balance,
            they can make a combination of the balances vanish at half as many frequencies; a band holds
            at least twice that number, so that it is not fitted perfectly by chance.
    """
    lengths = [fast_length(b - a) for a, b in segments]
    pooled = np.concatenate([np.fft.rfftfreq(length, interval_s) for length in lengths])
    order = np.argsort(pooled, kind="stable")
    order = order[pooled[order] <= highest_Hz]
    ordered = pooled[order]
    weights = np.where((ordered == 0.0) | np.isclose(ordered, 0.5 / interval_s), 0.5, 1.0)
    least = max(8, 3 * balances, regressors + 2 * (balances - 1))
    edges = [0]
    while edges[-1] < len(ordered):
        first = edges[-1]
        last = int(np.searchsorted(ordered, ordered[first] * BAND_RATIO, side="right"))
        last = max(last, first + least)
        edges.append(len(ordered) if len(ordered) - last < least else last)
    starts = tuple(a for a, _ in segments)
    ends = tuple(a + length for a, length in zip(starts, lengths, strict=True))
    tapers = tuple(map(cosine_taper, lengths))
    return Bands(
        starts, ends, interval_s, np.array(edges), order, ordered, weights, tapers, highest_Hz
    )


def band_products(bands: Bands, left: Complex, right: Complex) -> Complex:
    """Return the sums of left (p, frequencies) times conjugate right (q, frequencies) over each band.

    The shape is (bands, p, q).
    """
    # The shorter left factor is conjugated, so that the long right factor is not copied.
    sums = np.empty((len(bands.edges) - 1, len(left), len(right)), np.complex128)
    for band, (first, end) in enumerate(itertools.pairwise(bands.edges)):
        conjugate = np.conj(left[:, first:end] * bands.weights[first:end])
        np.matmul(conjugate, right[:, first:end].T, out=sums[band])
    return np.conj(sums, out=sums)


def fast_length(rows: int) -> int:
    """Return the number of rows of a segment to be transformed: without prime factors above 7 if long.

    Example:
        >>> fast_length(108001)
        108000
    """
    if rows < LONG:
        return rows
    # A number divides a high power of 2 x 3 x 5 x 7 if it has no other prime factors.
    return next(n for n in range(rows, 0, -1) if pow(210, n.bit_length(), n) == 0)


def cosine_taper(n: int) -> Floats:
    """Return a Tukey window (split cosine bell) of n samples."""
    edge = max(1, round(TAPER_SHARE * n))
    window = np.ones(n)
    ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    window[:edge], window[n - edge :] = ramp, ramp[::-1]
    return window


class Sums(NamedTuple):
    """Sums of products over each band; of pairs, real and imaginary parts are side by side."""

    own: Complex  # products of the residual with itself, shape (bands, m, m)
    crossed: Complex  # products of the residual with each regressor, shape (k, bands, m, m)
    pairs: Floats  # products of regressors, shape (k * k, bands * m * m * 2)
    counts: Floats  # weight of each band


@compiled_apart
def invert_in_place(matrices: Complex, counts: Floats) -> float:
    """Invert Hermitian matrices (bands, m, m) in place by Gauss-Jordan elimination without pivoting.

    Return the sum over the bands of weight times log |det|; NaN if a matrix is not positive definite,
    possibly by rounding.
    """
    bands, m, _ = matrices.shape
    total = 0.0
    for b in range(bands):
        for p in range(m):
            pivot = matrices[b, p, p].real
            if not pivot > 0.0:
                return math.nan
            total += counts[b] * math.log(pivot)
            matrices[b, p, p] = 1.0
            for q in range(m):
                matrices[b, p, q] /= pivot
            for i in range(m):
                if i != p:
                    share = matrices[b, i, p]
                    matrices[b, i, p] = 0.0
                    for q in range(m):
                        matrices[b, i, q] -= share * matrices[b, p, q]
        # Rounding makes the inverse of a nearly singular matrix asymmetric.
        for p in range(m):
            for q in range(p + 1):
                mean = 0.5 * (matrices[b, p, q] + matrices[b, q, p].conjugate())
                matrices[b, p, q], matrices[b, q, p] = mean, mean.conjugate()
    return total


@compiled_apart
def _fill(sums: Sums, shares: Floats, half: Complex, covariance: Complex, slopes: Complex) -> None:
    """Fill the covariances of all bands, and their derivatives times the weight of each band.

    ``half`` holds the products of each regressor with all of them at their shares, less those with the
    residual.
    """
    k, bands, m, _ = slopes.shape
    for i in range(k):
        for b in range(bands):
            for p in range(m):
                for q in range(m):
                    slopes[i, b, p, q] = half[i, b, p, q] + half[i, b, q, p].conjugate()
                    covariance[b, p, q] += shares[i] * (
                        half[i, b, p, q] - sums.crossed[i, b, q, p].conjugate()
                    )
    for b in range(bands):
        for p in range(m):
            for q in range(m):
                covariance[b, p, q] /= sums.counts[b]


@compiled_apart
def _fill_steepness(
    weight: Complex, slopes: Complex, counts: Floats, weighed: Complex, rise: Floats, bent: Floats
) -> None:
    """Add half the derivative of the score, and the curvature due to the changing covariances."""
    k, bands, m, _ = slopes.shape
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


def gram(pairs: Floats, weight: Complex) -> Floats:
    """Return the information on the regressors with their prior, shape (k, k).

    The weight has the inverse covariances, shape (bands, m, m). The trace of weight times products needs
    its transpose. For a Hermitian weight this is its conjugate, which the real part of the complex
    product gives.
    """
    k = math.isqrt(len(pairs))
    return 2.0 * (pairs @ weight.reshape(-1).view(np.float64)).reshape(k, k) + np.eye(k)


def _at(sums: Sums, shares: Floats) -> tuple[float, Complex, Complex]:
    """Return the score at given shares, the inverse covariances and the derivatives of the band sums."""
    moved = shares @ sums.pairs.reshape(len(shares), -1)
    half = moved.view(np.complex128).reshape(sums.crossed.shape) - sums.crossed
    covariance, slopes = sums.own.copy(), np.empty_like(half)
    _fill(sums, shares, half, covariance, slopes)
    determinant = invert_in_place(covariance, sums.counts)
    return -2.0 * determinant - float(shares @ shares), covariance, slopes


def _steepness(
    weight: Complex, slopes: Complex, counts: Floats, shares: Floats
) -> tuple[Floats, Floats]:
    """Return half the derivative of the score, and the curvature due to the changing covariances."""
    k, _, m, _ = slopes.shape
    rise, bent = -shares, np.zeros((k, k))
    _fill_steepness(weight, slopes, counts, np.empty((k, m, m), np.complex128), rise, bent)
    return rise, bent


def best_shares(sums: Sums, start: Floats, tolerance: float) -> tuple[float, Floats, Complex]:
    """Maximise f over the shares, from initial shares (k,) to steps that gain less than the tolerance.

    Return f, the shares, and the inverse covariances, shape (bands, m, m).
    """
    shares = start.copy()
    score, weight, slopes = _at(sums, shares)
    held = 0.0
    for _ in range(MOST_STEPS if math.isfinite(score) else 0):
        rise, bent = _steepness(weight, slopes, sums.counts, shares)
        try:
            whitening = np.linalg.inv(np.linalg.cholesky(gram(sums.pairs, weight)))
        except np.linalg.LinAlgError:  # Rounding has ended the search.
            break
        bends, axes = np.linalg.eigh(whitening @ bent @ whitening.T)
        along = axes.T @ (whitening @ rise)
        curvature = np.where(bends < 1.0, 1.0 - bends, 0.3 * (bends - 1.0))
        curvature = np.maximum(curvature, LEAST_CURVATURE)
        gain = -1.0
        while True:
            step = along / (curvature + held)
            predicted = float(2.0 * along @ step - (1.0 - bends) @ step**2)
            trial = shares + whitening.T @ (axes @ step)
            found, heavier, steeper = _at(sums, trial)
            if found > score or not abs(predicted) > 1e-3 * tolerance:
                break
            held = max(4.0 * held, 0.3)
        if found > score:
            gain = found - score
            score, shares, weight, slopes = found, trial, heavier, steeper
        # A small damped step does not show convergence.
        if gain <= 0.0 or (gain < tolerance and held == 0.0):
            break
        sure = gain / abs(predicted) if predicted else math.inf
        if sure > TRUSTED:
            held = 0.0 if held < 0.1 else held / 5.0
        elif sure < DISTRUSTED:
            held = max(3.0 * held, 0.1)
    return score, shares, weight
