"""The climb over shares: it arrives, also where going in turn between shares and covariances creeps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from shaftline.mismatch.search.spectra import Sums, best_shares, invert_in_place


def products(seed: int, count: int, told: float) -> tuple[Any, ...]:
    """Products by band of a residual that is mostly two regressors, which weak noise hides."""
    rng = np.random.default_rng(seed)
    own, crossed, pairs, counts = [], [], [], []
    truth = np.array([2.5, -1.5])
    for _ in range(12):
        real, imaginary = rng.standard_normal((2, 3, 2, count))
        *columns, noise = real + 1j * imaginary
        columns = told * np.array(columns)
        residual = np.einsum("k,kmf->mf", truth, columns) + 0.02 * noise
        own.append(residual @ residual.conj().T)
        crossed.append([residual @ column.conj().T for column in columns])
        pairs.append([a @ b.conj().T for a in columns for b in columns])
        counts.append(float(count))
    return (
        np.array(own),
        np.ascontiguousarray(np.array(crossed).transpose(1, 0, 2, 3)),
        np.ascontiguousarray(np.array(pairs).transpose(1, 0, 2, 3)),
        np.array(counts),
    )


def test_a_matrix_that_is_not_positive_definite_has_no_determinant() -> None:
    for matrix in ([[1.0, 2.0], [2.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]):
        assert np.isnan(invert_in_place(np.array([matrix], complex), np.ones(1)))


def test_the_inverse_of_a_nearly_singular_matrix_is_hermitian() -> None:
    """Rounding would leave its halves apart by more than the prior of the shares is worth."""
    rng = np.random.default_rng(1)
    mixed = rng.standard_normal((3, 50)) + 1j * rng.standard_normal((3, 50))
    mixed[2] = mixed[0] + 1e-6 * mixed[2]
    found = (mixed @ mixed.conj().T)[None]
    invert_in_place(found, np.ones(1))
    assert np.abs(found).max() > 1e8
    assert (found == found.conj().transpose(0, 2, 1)).all()


def test_without_any_way_on_the_climb_ends_where_it_stands() -> None:
    """Products that rounding has left with a negative power, as of balances that tell the same."""
    own = np.array([np.eye(2, dtype=complex)])
    pairs = -1e3 * np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])[None]
    crossed = np.ones((1, 1, 2, 2), complex)
    score, shares, weight = best_shares(Sums(own, crossed, pairs, np.ones(1)), np.zeros(1), 0.05)
    assert (score, *shares) == (0.0, 0.0)
    assert (weight == own).all()


def by_hand(own: Any, crossed: Any, pairs: Any, counts: Any, shares: Any) -> float:
    k = len(shares)
    total = -float(shares @ shares)
    for b, count in enumerate(counts):
        cross = np.einsum("k,kpq->pq", shares, crossed[:, b])
        both = np.einsum("kl,klpq->pq", np.outer(shares, shares), pairs[:, b].reshape(k, k, 2, 2))
        left = (own[b] - cross - cross.conj().T + both) / count
        total -= 2.0 * count * np.log(np.linalg.det(left).real)
    return total


@pytest.mark.parametrize("seed", range(5))
def test_the_climb_arrives_where_the_best_shares_are(seed: int) -> None:
    own, crossed, pairs, counts = products(seed, 9, 0.3)
    flat = pairs.reshape(4, -1).view(np.float64)
    score, shares, weight = best_shares(Sums(own, crossed, flat, counts), np.zeros(2), 0.01)

    def lost(trial: Any) -> float:
        return -by_hand(own, crossed, pairs, counts, trial)

    best = minimize(
        lost,
        np.array([2.5, -1.5]),
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-10},
    )
    assert score == pytest.approx(-best.fun, abs=0.02)
    assert score == pytest.approx(by_hand(own, crossed, pairs, counts, shares), abs=1e-6)
    cross = np.einsum("k,kbpq->bpq", shares, crossed)
    both = np.einsum("i,ibpq->bpq", np.outer(shares, shares).ravel(), pairs)
    left = own - cross - np.conj(np.swapaxes(cross, 1, 2)) + both
    assert weight @ (left / counts[:, None, None]) == pytest.approx(
        np.broadcast_to(np.eye(2), left.shape), abs=1e-6
    )


def test_inverses_and_determinants_are_those_of_every_band() -> None:
    rng = np.random.default_rng(1)
    loose = rng.standard_normal((3, 2, 2)) + 1j * rng.standard_normal((3, 2, 2))
    matrices: Any = loose @ np.conj(np.swapaxes(loose, 1, 2)) + np.eye(2)
    counts = np.array([1.0, 2.0, 5.0])
    found = matrices.copy()
    total = invert_in_place(found, counts)
    assert found == pytest.approx(np.linalg.inv(matrices))
    assert total == pytest.approx(counts @ np.log(np.linalg.det(matrices).real))
