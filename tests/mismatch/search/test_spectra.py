"""The likelihood of coloured residuals, against formulas written out once more."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import chi2

from shaftline.mismatch.search.spectra import (
    Bands,
    Likelihood,
    band_products,
    chance_gain,
    make_bands,
)


def noise(bands: Bands, seed: int, *shape: int) -> Any:
    """Complex noise, one value a frequency."""
    rng = np.random.default_rng(seed)
    count = (*shape, len(bands.order))
    return rng.standard_normal(count) + 1j * rng.standard_normal(count)


def score_by_hand(bands: Bands, residual: Any) -> float:
    """-2 sum of n_b log det S_b, S_b the band's mean of r r^H, each frequency by its weight."""
    total = 0.0
    for first, end in zip(bands.edges, bands.edges[1:], strict=False):
        count, outer = 0.0, np.zeros((len(residual), len(residual)), complex)
        for f in range(first, end):
            count += bands.weights[f]
            outer += bands.weights[f] * np.outer(residual[:, f], residual[:, f].conj())
        total -= 2.0 * count * np.log(np.linalg.det(outer / count).real)
    return total


# -- frequencies and bands ---------------------------------------------------------------------


def test_the_transform_is_that_of_the_tapered_segment() -> None:
    n = 120
    bands = make_bands([(10, 10 + n)], 0.5, 1, 1.0)
    values = np.random.default_rng(0).standard_normal(200)
    ramp = [0.5 - 0.5 * np.cos(np.pi * (i + 0.5) / 6) for i in range(6)]  # 5 % of 120 rows
    taper = np.array([*ramp, *np.ones(n - 12), *reversed(ramp)])
    expected = np.fft.rfft(values[10 : 10 + n] * taper) / np.sqrt(np.sum(taper**2))
    assert np.allclose(bands.transform(values), expected)
    assert bands.frequency_Hz == pytest.approx(np.arange(61) / 60.0)


def test_the_transform_keeps_the_variance() -> None:
    bands = make_bands([(0, 20_000)], 0.1, 1, 5.0)
    white = 3.0 * np.random.default_rng(0).standard_normal(20_000)
    assert np.mean(np.abs(bands.transform(white)) ** 2) == pytest.approx(9.0, rel=0.03)


def test_real_frequencies_count_half() -> None:
    bands = make_bands([(0, 100)], 0.1, 1, 5.0)
    assert bands.weights[0] == bands.weights[-1] == 0.5  # 0 Hz and Nyquist's
    assert set(bands.weights[1:-1]) == {1.0}
    odd = make_bands([(0, 101)], 0.1, 1, 5.0)
    assert list(odd.weights[-2:]) == [1.0, 1.0]


def test_bands_widen_by_a_quarter_where_they_hold_enough() -> None:
    # every 0.01 Hz: eight at least, then up to 1.25 times the first
    bands = make_bands([(0, 1000)], 0.1, 1, 1.0)
    assert bands.frequency_Hz[[0, 1, -1]] == pytest.approx([0.0, 0.01, 1.0])
    assert list(bands.edges) == [0, 8, 16, 24, 32, 41, 52, 66, 83, 101]


def test_a_band_holds_three_frequencies_a_balance() -> None:
    assert list(make_bands([(0, 1000)], 0.1, 4, 0.45).edges) == [0, 12, 24, 46]  # 10 would be left
    assert list(make_bands([(0, 1000)], 0.1, 2, 0.2).edges) == [0, 8, 21]  # 8 at least


def test_segments_are_pooled_by_frequency() -> None:
    bands = make_bands([(0, 100), (100, 300)], 0.1, 1, 1.0)
    assert bands.frequency_Hz == pytest.approx(
        sorted([*np.arange(11) / 10.0, *np.arange(21) / 20.0])
    )
    assert (bands.starts, bands.ends, bands.interval_s) == ((0, 100), (100, 300), 0.1)
    only_second = np.zeros(300)
    only_second[100:] = np.cos(2.0 * np.pi * 0.55 * np.arange(200) * 0.1)
    loudest = int(np.argmax(np.abs(bands.transform(only_second))))
    assert bands.frequency_Hz[loudest] == pytest.approx(0.55)
    of_first = np.flatnonzero(bands.order < 51)
    assert np.abs(bands.transform(only_second)[of_first]).max() == 0.0


def test_moments_are_sums_over_bands() -> None:
    bands = make_bands([(0, 400), (400, 900)], 0.1, 2, 4.0)
    left, right = noise(bands, 0, 3), noise(bands, 1, 2)
    sums = band_products(bands, left, right)
    assert sums.shape == (len(bands.edges) - 1, 3, 2)
    for b, (first, end) in enumerate(zip(bands.edges, bands.edges[1:], strict=False)):
        weighted = left[:, first:end] * bands.weights[first:end]
        assert np.allclose(sums[b], weighted @ right[:, first:end].conj().T)
    assert bands.edges[-1] == len(bands.order)


# -- the likelihood ----------------------------------------------------------------------------


def test_without_regressors_it_is_the_closed_formula() -> None:
    bands = make_bands([(0, 900)], 0.1, 2, 4.0)
    residual = noise(bands, 2, 2)
    found = Likelihood(bands, np.zeros((1, *residual.shape), complex))(residual)
    assert found.score == pytest.approx(score_by_hand(bands, residual), rel=1e-12)
    assert found.shares == pytest.approx([0.0])


def test_the_weight_is_the_inverse_of_each_band_s_covariance() -> None:
    """Four balances in units of very different sizes, each with a part of the others."""
    bands = make_bands([(0, 900)], 0.1, 4, 4.0)
    mixed = np.tril(noise(bands, 8, 4)[:, :4]) + 2.0 * np.eye(4)
    sizes = np.array([1e-3, 1.0, 1e6, 1e4])
    residual = sizes[:, None] * (mixed @ noise(bands, 9, 4))
    found = Likelihood(bands, np.zeros((1, *residual.shape), complex))(residual)
    assert found.score == pytest.approx(score_by_hand(bands, residual), rel=1e-12)
    counts = np.add.reduceat(bands.weights, bands.edges[:-1])
    units = np.outer(sizes, sizes)
    covariance = band_products(bands, residual, residual) / counts[:, None, None] / units
    np.testing.assert_allclose(found.weight * units, np.linalg.inv(covariance), atol=1e-12)


def test_a_balance_without_any_residual_is_refused() -> None:
    bands = make_bands([(0, 300)], 0.1, 2, 4.0)
    residual = noise(bands, 2, 2)
    residual[1] = 0.0
    with pytest.raises(
        np.linalg.LinAlgError, match="residual of a balance is 0 or a multiple of another"
    ):
        Likelihood(bands, np.zeros((1, *residual.shape), complex))(residual)


def test_white_noise_of_known_covariance_has_its_likelihood() -> None:
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    rng = np.random.default_rng(3)
    white = np.linalg.cholesky(covariance) @ rng.standard_normal((2, 200_000))
    bands = make_bands([(0, 200_000)], 0.1, 2, 4.0)
    residual = bands.transform(white)
    found = Likelihood(bands, np.zeros((1, *residual.shape), complex))(residual)
    known = -2.0 * np.sum(bands.weights) * np.log(np.linalg.det(covariance))
    assert found.score == pytest.approx(known, rel=0.01)
    wide = len(found.weight) - 1  # the best determined
    assert found.weight[wide] == pytest.approx(np.linalg.inv(covariance), abs=0.05)


def test_shares_and_score_are_the_best_under_their_prior() -> None:
    bands = make_bands([(0, 300)], 0.1, 2, 4.0)
    regressors = np.array([0.3, 0.05])[:, None, None] * noise(bands, 4, 2, 2)
    truth = np.array([1.2, -0.7])
    residual = noise(bands, 5, 2) + np.einsum("k,kmf->mf", truth, regressors)

    def lost(shares: Any) -> float:
        left = residual - np.einsum("k,kmf->mf", shares, regressors)
        return float(shares @ shares) - score_by_hand(bands, left)

    best = minimize(lost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9})
    found = Likelihood(bands, regressors)(residual, tolerance=1e-10)
    assert found.score == pytest.approx(-best.fun, abs=1e-5)
    assert found.shares == pytest.approx(best.x, abs=1e-3)
    # a start elsewhere comes to the same, and a coarse tolerance costs no more than that
    again = Likelihood(bands, regressors)(residual, np.array([5.0, 5.0]), 1e-10)
    assert again.score == pytest.approx(found.score, abs=1e-5)
    coarse = Likelihood(bands, regressors)(residual, tolerance=0.05)
    assert found.score - 0.1 < coarse.score <= found.score + 1e-9


def test_a_regressor_in_coloured_noise_is_found_with_its_share() -> None:
    rng = np.random.default_rng(1)
    bands = make_bands([(0, 4000)], 0.1, 1, 4.0)
    signal = np.repeat(rng.standard_normal(40), 100)
    coloured = np.convolve(rng.standard_normal(4200), np.ones(20) / 20.0, mode="valid")[:4000]
    column = bands.transform(signal)[None, None]
    found = Likelihood(bands, column)(bands.transform((coloured + 0.7 * signal)[None]))
    assert found.shares[0] == pytest.approx(0.7, abs=0.05)


# -- generalised least squares -----------------------------------------------------------------


def gram_by_hand(bands: Bands, weight: Any, columns: Any, others: Any) -> Any:
    """2 Re sum of w_f c^H W_b d, each pair of columns and each frequency by itself."""
    found = np.zeros((len(columns), len(others)))
    for b, (first, end) in enumerate(zip(bands.edges, bands.edges[1:], strict=False)):
        for f in range(first, end):
            for i, c in enumerate(columns):
                for j, d in enumerate(others):
                    product = c[:, f].conj() @ weight[b] @ d[:, f]
                    found[i, j] += 2.0 * bands.weights[f] * product.real
    return found


@pytest.fixture(scope="module")
def weighted() -> tuple[Bands, Any, Any]:
    """Bands, regressors, and a weight that ties the balances together."""
    bands = make_bands([(0, 90)], 0.1, 2, 4.0)
    loose = noise(bands, 6, 2)
    loose[1] += 0.8j * loose[0]
    regressors = 0.5 * noise(bands, 7, 2, 2)
    found = Likelihood(bands, np.zeros((1, *loose.shape), complex))(loose)
    return bands, regressors, found.weight


def test_the_amount_is_that_of_generalised_least_squares(
    weighted: tuple[Bands, Any, Any],
) -> None:
    bands, regressors, weight = weighted
    residual, column = noise(bands, 8, 2), noise(bands, 9, 2)
    columns = [column, *regressors]
    gram = gram_by_hand(bands, weight, columns, columns) + np.diag([0.0, 1.0, 1.0])
    right = gram_by_hand(bands, weight, columns, [residual])[:, 0]
    likelihood = Likelihood(bands, regressors)
    expected = np.linalg.solve(gram, right)[0]
    amount, gain = likelihood.amount(weight, residual, column)
    assert amount == pytest.approx(expected)
    # what least squares over all columns gains beyond that over the regressors alone
    fewer = gram[1:, 1:]
    alone = right[1:] @ np.linalg.solve(fewer, right[1:])
    assert gain == pytest.approx(right @ np.linalg.solve(gram, right) - alone)
    assert likelihood.amount(weight, residual + 2.5 * column, column)[0] == pytest.approx(
        expected + 2.5
    )
    assert likelihood.amount(weight, residual, np.zeros_like(column)) == (0.0, 0.0)


def test_columns_of_one_balance_are_projected_as_whole_ones(
    weighted: tuple[Bands, Any, Any],
) -> None:
    bands, regressors, weight = weighted
    residual, own = noise(bands, 13, 2), noise(bands, 14, 3, 1)
    whole = np.concatenate([np.zeros_like(own), own], axis=1)  # they act in the second balance
    gram = gram_by_hand(bands, weight, [*whole, *regressors], [*whole, *regressors, residual])
    gram[3:, 3:5] += np.eye(2)
    left = gram[:3, 3:5] @ np.linalg.inv(gram[3:, 3:5])
    expected = gram[:3] - left @ gram[3:]  # what the regressors do not explain
    likelihood = Likelihood(bands, regressors)
    for columns, balances in ((whole, slice(None)), (own, slice(1, 2))):
        together, along = likelihood.projections(weight, residual, columns, balances)
        assert together == pytest.approx(expected[:, :3])
        assert along == pytest.approx(expected[:, 5])


def test_the_information_is_the_gram_with_the_prior(weighted: tuple[Bands, Any, Any]) -> None:
    bands, regressors, weight = weighted
    columns = noise(bands, 10, 3, 2)
    both = [*columns, *regressors]
    expected = gram_by_hand(bands, weight, both, both) + np.diag([0.0, 0.0, 0.0, 1.0, 1.0])
    assert Likelihood(bands, regressors).information(weight, columns) == pytest.approx(expected)


def test_chance_is_a_rare_likelihood_ratio_widened() -> None:
    assert chance_gain(5, 8, 1e-3) == pytest.approx(1.5 * chi2.isf(1e-3 / 8, 5))


def test_further_regressors_are_those_of_a_likelihood_with_all(
    weighted: tuple[Bands, Any, Any],
) -> None:
    bands, own, weight = weighted
    further, residual = noise(bands, 11, 3, 2), noise(bands, 12, 2)
    both, part = Likelihood(bands, np.concatenate([further, own])), Likelihood(bands, own)
    found, expected = part.with_columns(further)(residual), both(residual)
    assert found.score == pytest.approx(expected.score, rel=1e-12)
    np.testing.assert_allclose(found.shares, expected.shares, rtol=1e-9)
    np.testing.assert_allclose(found.weight, expected.weight, rtol=1e-9)
    prior = np.diag([1.0, 1.0, 1.0, 0.0, 0.0])  # of the columns, which have none of their own
    information = both.information(weight, further[:0]) - prior
    np.testing.assert_allclose(part.information(weight, further), information, atol=1e-9)
