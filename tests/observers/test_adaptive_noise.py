"""Adaptive noise: the score is the derivative of the likelihood, and the noises reach the true ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from shaftline.observers.adaptive_noise import (
    LARGEST,
    LARGEST_STEP,
    LEAST_INFORMATION,
    AdaptiveNoise,
    adapt,
    correct_slopes,
    propagate_slopes,
    start_adaptive_noise,
)
from shaftline.observers.augmented import correct, propagate

F = np.array([[-0.4, 0.7, 0.3], [0.0, -0.5, 0.0], [0.0, 0.0, 0.0]])
"""Two states, the second with process noise, and a parameter that acts on the first."""
H = np.array([[1.0, 0.0, 0.0], [0.5, -2.0, 0.8]])
R, Q, DT = np.array([0.2, 0.5]), np.array([0.0, 0.6, 0.0]), 0.2
ROWS = 60


def run(log_factors: Any) -> tuple[float, AdaptiveNoise, list[float]]:
    """Return log L, the derivatives and the total score with noises times exp of the factors."""
    rng = np.random.default_rng(3)
    r, q = R * np.exp(log_factors[:2]), Q * np.array([1.0, math.exp(log_factors[2]), 1.0])
    z, p = np.array([0.1, -0.2, 0.3]), np.diag([0.5, 0.4, 0.2])
    adaptive = start_adaptive_noise(0.1, np.array([1]), np.zeros(3), 3)
    work, row = np.zeros((2, 3, 3)), np.zeros((3, 3))
    likelihood = 0.0
    for _ in range(ROWS):
        measured = rng.normal(0.0, 0.4, 2)
        for c in range(2):
            if c == 1 and rng.random() < 0.2:
                continue  # this measurement is missing
            d = measured[c] - H[c] @ z
            total = correct(z, p, H[c], d, r[c], row)
            correct_slopes(adaptive, c, H[c], row[1], d, r[c], total)
            likelihood -= 0.5 * (math.log(total) + d * d / total)
            assert d * d / total < LARGEST
        propagate(p, F, 2, q, DT, work)
        z[:2] = (work[0] @ z)[:2]
        propagate_slopes(adaptive, F, 2, q, DT, work)
    return likelihood, adaptive, adaptive.score.tolist()


def test_the_score_is_the_derivative_of_the_log_likelihood() -> None:
    _, adaptive, score = run(np.zeros(3))
    for j, unit in enumerate(1e-5 * np.eye(3)):
        slope = (run(unit)[0] - run(-unit)[0]) / 2e-5
        assert score[j] == pytest.approx(slope, rel=1e-6)
    assert np.all(np.abs(score) > 0.5)
    np.testing.assert_allclose(adaptive.covariance, adaptive.covariance.transpose(0, 2, 1))


def test_the_step_of_a_measurement_without_other_uncertainty() -> None:
    """S = R, so the score is (nu^2 - 1) / 2 and the information 1 / 2."""
    adaptive = start_adaptive_noise(0.01, np.zeros(0, np.int64), np.array([1e-3]), 1)
    noise = np.array([2.0])
    correct_slopes(adaptive, 0, np.ones(1), np.zeros(1), 4.0, noise[0], 2.0)
    assert adaptive.score[0] == pytest.approx(0.5 * (8.0 - 1.0))
    assert adaptive.seen[0] == pytest.approx(0.5)
    adapt(adaptive, noise, np.zeros(1))
    assert noise[0] == pytest.approx(2.0 * math.exp(0.01 * 3.5 / (0.5 + LEAST_INFORMATION)))
    assert adaptive.score[0] == adaptive.seen[0] == 0.0
    # an outlier counts as one of the largest size, and no row changes a noise by more than the limit
    for gain, expected in ((0.01, 0.01 * 4.5 / (0.5 + LEAST_INFORMATION)), (1.0, LARGEST_STEP)):
        adaptive = start_adaptive_noise(gain, np.zeros(0, np.int64), np.array([1e-3]), 1)
        noise = np.array([2.0])
        correct_slopes(adaptive, 0, np.ones(1), np.zeros(1), 400.0, noise[0], 2.0)
        adapt(adaptive, noise, np.zeros(1))
        assert math.log(noise[0] / 2.0) == pytest.approx(expected)


def test_a_noise_stays_above_its_limit() -> None:
    adaptive = start_adaptive_noise(1.0, np.zeros(1, np.int64), np.array([1.9, 0.4]), 1)
    noise, process = np.array([2.0]), np.array([0.5])
    adaptive.score[:], adaptive.seen[:] = -1.0, 0.5
    adapt(adaptive, noise, process)
    assert noise[0] == 1.9
    assert process[0] == pytest.approx(0.5 * math.exp(-LARGEST_STEP))
    adaptive.score[:] = -1.0
    adapt(adaptive, noise, process)
    assert process[0] == 0.4


@pytest.mark.parametrize(("seen", "known"), [(2.0, 2.0), (0.1, 0.5 + 0.01 * (0.1 - 0.5))])
def test_a_row_with_much_information_counts_no_more_than_others(seen: float, known: float) -> None:
    """The information of a row limits its step at once, and its mean later."""
    adaptive = start_adaptive_noise(0.01, np.zeros(0, np.int64), np.array([1e-3]), 1)
    noise = np.array([1.0])
    adaptive.score[0], adaptive.seen[0] = 1.0, seen
    adapt(adaptive, noise, np.zeros(1))
    assert math.log(noise[0]) == pytest.approx(0.01 / (known + LEAST_INFORMATION))
    assert adaptive.information[0] == pytest.approx(0.5 + 0.01 * (seen - 0.5))
