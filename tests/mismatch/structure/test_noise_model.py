"""The noise model: whitened residuals, and what coloured noise is worth."""

from __future__ import annotations

import numpy as np
import pytest

from shaftline.mismatch.structure.noise_model import Likelihood, NoiseModel

ROWS, INTERVAL_S = 4000, 0.1
FLOOR = np.array([1e-3, 1e-3])


def _drift(seed: int, rows: int = ROWS) -> np.ndarray:
    """Return two channels of slow noise that go together, with a little white noise."""
    rng = np.random.default_rng(seed)
    slow = np.convolve(rng.standard_normal(rows + 50), np.ones(50) / 7.0, "valid")[:rows]
    white = 0.1 * rng.standard_normal((2, rows))
    return np.array([slow, 0.5 * slow]) + white


def test_whitened_residuals_are_independent_and_of_variance_one() -> None:
    noise = NoiseModel(_drift(1), FLOOR, [ROWS], INTERVAL_S, 100.0)
    whitener = noise.whitener([ROWS])
    white = whitener(_drift(2))  # another realisation
    power = np.sum(white**2, axis=1) / whitener.count
    assert power == pytest.approx([1.0, 1.0], abs=0.15)
    assert abs(np.sum(white[0] * white[1]) / whitener.count) < 0.1
    slow, fast = (white[:, part] for part in (slice(0, 200), slice(1000, 1200)))
    assert np.mean(slow**2) == pytest.approx(np.mean(fast**2), rel=0.25)
    assert whitener.count == pytest.approx(ROWS, abs=2)


def test_other_segments_are_whitened_by_the_same_spectrum() -> None:
    noise = NoiseModel(_drift(1), FLOOR, [ROWS], INTERVAL_S, 100.0)
    whitener = noise.whitener([1500, 700])
    white = whitener(np.concatenate([_drift(3, 1500), _drift(4, 700)], axis=1))
    assert np.sum(white**2, axis=1) / whitener.count == pytest.approx([1.0, 1.0], abs=0.15)


def test_frequencies_above_the_highest_do_not_count() -> None:
    noise = NoiseModel(_drift(1), FLOOR, [ROWS], INTERVAL_S, 1.0)
    whitener = noise.whitener([ROWS])
    assert whitener.count == pytest.approx(0.2 * ROWS, abs=2)  # the Nyquist frequency is 5 Hz
    tone = np.sin(2.0 * np.pi * 3.0 * INTERVAL_S * np.arange(ROWS))
    assert np.abs(whitener(np.array([tone, tone]))).max() < 1e-3


@pytest.mark.parametrize(("frequency_Hz", "gain"), [(0.01, (0.0, 40.0)), (2.0, (3e3, 1e5))])
def test_noise_hides_what_is_as_slow_as_itself(
    frequency_Hz: float, gain: tuple[float, float]
) -> None:
    """A tone of half the noise's size; nobody finds it in the drift, and everybody beside it."""
    own = Likelihood(FLOOR, [ROWS], [ROWS], INTERVAL_S)
    own.set_noise(_drift(1))
    wave = 0.5 * np.sin(2.0 * np.pi * frequency_Hz * INTERVAL_S * np.arange(ROWS))
    limit = np.full(2, np.inf)
    lost = own.held(_drift(2), limit) - own.held(_drift(2) + np.array([wave, 0.5 * wave]), limit)
    low, high = gain
    assert low - 10.0 < lost < high


def test_an_outlier_counts_little_and_a_residual_that_is_not_finite_is_impossible() -> None:
    own = Likelihood(FLOOR, [ROWS], [ROWS], INTERVAL_S)
    residual = _drift(1)
    residual[0, 100] = 500.0
    own.set_noise(residual)
    assert own.weights[0, 100] < 0.02
    assert own.shape == (2, own.white(residual).shape[1])
    limit = np.array([5.0, 5.0])
    assert own.rms(residual, limit)[0] < 1.2 < own.rms(residual)[0]
    residual[0, 100] = np.nan
    assert own.held(residual, limit) == -np.inf
    assert own.rms(residual)[0] == np.inf
