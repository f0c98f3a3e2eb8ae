"""Variance accounted for, and noise of a given signal-to-noise ratio."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shaftline.observers import add_noise, add_noise_to_table, variance_accounted_for
from shaftline.observers.records import READINGS


def test_variance_accounted_for_by_hand() -> None:
    truth = np.array([1.0, 3.0, 1.0, 3.0])  # variance 1
    assert variance_accounted_for(truth, truth) == 100.0
    assert variance_accounted_for(truth, truth + 5.0) == 100.0  # a constant error has no variance
    assert variance_accounted_for(truth, np.array([1.5, 2.5, 1.5, 2.5])) == pytest.approx(75.0)
    assert variance_accounted_for(truth, -truth) == 0.0  # the lower bound


@pytest.mark.parametrize("snr_db", [0.0, 20.0, 40.0])
def test_noise_has_its_strength_and_leaves_the_truth(snr_db: float) -> None:
    rng = np.random.default_rng(0)
    measurements = rng.normal(3.0, 1.0, (4000, 5)) * (1.0, 1e5, 1.0, 0.1, 2.0)
    noise = rng.standard_normal(measurements.shape)
    added = add_noise(measurements, snr_db, noise) - measurements
    share = np.sqrt(np.mean(added**2, axis=0) / np.mean(measurements**2, axis=0))
    strength = np.sqrt(np.mean(noise**2, axis=0))
    np.testing.assert_allclose(20.0 * np.log10(share[:4] / strength[:4]), -snr_db, atol=1e-9)
    assert not added[:, 4].any()


def test_a_noisy_table_keeps_what_is_true() -> None:
    t = np.arange(200) * 0.05
    columns = {name: 2.0 + np.sin(t + i) for i, name in enumerate(READINGS)}
    table = pd.DataFrame({"time_s": t, **columns, "advance_velocity_m_s": 8.0 + 0.0 * t})
    noisy = add_noise_to_table(table, 20.0, seed=3)
    for i, name in enumerate(READINGS):
        added = noisy[name] - table[name]
        rms = np.sqrt(np.mean(columns[name] ** 2)) * 0.1
        assert np.std(added) == pytest.approx(rms, rel=0.15), i
    assert noisy[["time_s", "advance_velocity_m_s"]].equals(
        table[["time_s", "advance_velocity_m_s"]]
    )
    assert noisy.equals(add_noise_to_table(table, 20.0, seed=3))
    assert not noisy.equals(add_noise_to_table(table, 20.0, seed=4))
