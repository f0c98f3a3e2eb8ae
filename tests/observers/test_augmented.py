"""Augmented filter of arbitrary models: matrices by hand, and the falling body."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from reproductions.augmented_filter.falling_body import largest_errors, simulate_fall
from shaftline.observers.augmented import AugmentedFilter, correct, propagate

RNG = np.random.default_rng(3)


def some_covariance(n: int) -> Any:
    root = RNG.normal(size=(n, n))
    return root @ root.T


def test_covariance_is_propagated_by_phi_and_the_process_noise() -> None:
    n, states, dt = 5, 3, 0.1
    f = np.zeros((n, n))
    f[:states] = RNG.normal(size=(states, n))
    process = RNG.uniform(0.1, 1.0, n)
    p = some_covariance(n)
    phi = np.eye(n) + f * dt + 0.5 * (f * dt) @ (f * dt)
    expected = phi @ p @ phi.T + np.diag(process) * dt
    propagate(p, f, states, process, dt, np.zeros((2, n, n)))
    np.testing.assert_allclose(p, expected, rtol=1e-12)
    np.testing.assert_array_equal(p, p.T)


def test_one_measurement_corrects_as_the_gain_says() -> None:
    n, noise, innovation = 4, 0.3, 1.7
    p, z, slope = some_covariance(n), RNG.normal(size=n), RNG.normal(size=n)
    total = slope @ p @ slope + noise
    gain = p @ slope / total
    left = np.eye(n) - np.outer(gain, slope)
    expected = left @ p @ left.T + noise * np.outer(gain, gain)
    moved = z + gain * innovation
    assert correct(z, p, slope, innovation, noise, np.zeros((3, n))) == pytest.approx(total)
    np.testing.assert_allclose(z, moved, rtol=1e-12)
    np.testing.assert_allclose(p, expected, rtol=1e-11, atol=1e-13)
    np.testing.assert_array_equal(p, p.T)


def spring(x: Any, theta: Any, u: Any) -> Any:
    """Return the rate of a mass on a spring with unknown damping and input gain."""
    return np.array([x[1], -4.0 * x[0] - theta[0] * x[1] + theta[1] * u])


def both(x: Any, theta: Any, u: Any) -> Any:
    return np.array([x[0], x[1] + 0.5 * theta[1]])


def test_two_measurements_at_once_agree_with_the_matrix_equations() -> None:
    p = some_covariance(4)
    filter_ = AugmentedFilter(
        spring, both, [0.3, -0.2], [0.5, 2.0], covariance=p.copy(), noise=[0.1, 0.4]
    )
    h = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.5]])
    s = h @ p @ h.T + np.diag([0.1, 0.4])
    gain = p @ h.T @ np.linalg.inv(s)
    errors = np.array([1.0, 2.0]) - h @ filter_.z
    expected = filter_.z + gain @ errors
    found = filter_.update([1.0, 2.0])
    np.testing.assert_allclose(filter_.z, expected, rtol=1e-12)
    np.testing.assert_allclose(filter_.p, (np.eye(4) - gain @ h) @ p, rtol=1e-10, atol=1e-12)
    whitened = np.linalg.solve(np.linalg.cholesky(s), errors)
    np.testing.assert_allclose(found, whitened, rtol=1e-10)


def test_prediction_follows_the_model_and_its_exact_slopes() -> None:
    """For a linear model P after one second follows from the matrix exponential."""
    p = np.diag([0.1, 0.2, 0.01, 0.04])
    filter_ = AugmentedFilter(spring, both, [1.0, 0.0], [0.5, 2.0], covariance=p, noise=[1.0, 1.0])
    filter_.predict(0.0, 1.0, steps=200)
    a = np.array([[0.0, 1.0], [-4.0, -0.5]])
    np.testing.assert_allclose(filter_.state, expm(a) @ [1.0, 0.0], rtol=1e-7)
    np.testing.assert_array_equal(filter_.parameters, [0.5, 2.0])
    np.testing.assert_allclose(filter_.p[:2, :2][0, 1], filter_.p[1, 0], rtol=1e-14)
    # States only: the falling body tests the effect of uncertain parameters.
    alone = AugmentedFilter(
        spring, both, [1.0, 0.0], [0.5, 2.0], covariance=[0.1, 0.2, 0.0, 0.0], noise=[1.0, 1.0]
    )
    alone.predict(0.0, 1.0, steps=200)
    expected = expm(a) @ np.diag([0.1, 0.2]) @ expm(a).T
    np.testing.assert_allclose(alone.p[:2, :2], expected, atol=1e-5)


def test_process_noise_adds_its_density_times_time() -> None:
    filter_ = AugmentedFilter(
        lambda x, theta, u: 0.0 * x,
        lambda x, theta, u: x,
        [0.0],
        [1.0],
        covariance=[0.0, 0.0],
        noise=[1.0],
        process=[0.5, 0.02],
    )
    filter_.predict(None, 4.0, steps=3)
    np.testing.assert_allclose(filter_.standard_errors, np.sqrt([2.0, 0.08]), rtol=1e-12)


def test_a_missing_measurement_changes_nothing() -> None:
    filter_ = AugmentedFilter(
        spring, both, [1.0, 0.0], [0.5, 2.0], covariance=[0.1, 0.2, 0.01, 0.04], noise=[1.0, 1.0]
    )
    before = filter_.z.copy(), filter_.p.copy()
    assert np.isnan(filter_.update([math.nan, math.nan])).all()
    np.testing.assert_array_equal(filter_.z, before[0])
    np.testing.assert_array_equal(filter_.p, before[1])
    assert np.isfinite(filter_.update([math.nan, 1.0])).tolist() == [False, True]


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"covariance": np.eye(3)}, r"covariance: shape must be \(2, 2\) or \(2,\), not \(3, 3\)"),
        ({"noise": [0.0]}, "noise: every variance must be positive"),
        ({"process": -1.0}, "no variance may be negative"),
    ],
)
def test_invalid_arguments_are_refused(wrong: dict[str, Any], why: str) -> None:
    settings: dict[str, Any] = {"covariance": [1.0, 1.0], "noise": [1.0]}
    with pytest.raises(ValueError, match=why):
        AugmentedFilter(lambda x, t, u: x, lambda x, t, u: x, [0.0], [0.0], **(settings | wrong))


@pytest.mark.parametrize("beta", [3000.0, 2000.0])
def test_falling_body_shows_its_drag_in_dense_air_only(beta: float) -> None:
    """Errors as in thesis Figure A-2 with noise: velocity at once, beta in dense air only.

    High up beta begins to move a little; it stays within 3 %. Exact measurements are the study's test.
    """
    noisy = [largest_errors(simulate_fall(beta, seed), beta) for seed in range(12)]
    assert np.all(np.median(noisy, axis=0) < [5.0, 0.03, 0.10, 0.06])


def test_standard_errors_of_the_falling_body_are_right() -> None:
    """The final errors of beta over the standard errors of the filter have a unit variance."""
    ends = np.array(
        [simulate_fall(3000.0, seed).iloc[-1][["beta", "beta_sd"]] for seed in range(8)]
    )
    scores = (ends[:, 0] - 3000.0) / ends[:, 1]
    assert 0.4 < np.sqrt(np.mean(scores**2)) < 1.8
