"""How well an estimate follows, and how much noise a signal carries."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .records import READINGS

Floats = NDArray[np.float64]


def variance_accounted_for(truth: Floats, estimate: Floats) -> float:
    """VAF [%] = max(0, 1 - var(truth - estimate) / var(truth)) * 100 (thesis eq. 4-1).

    Args:
        truth: shape (n,).
        estimate: likewise, in the same unit.

    Returns:
        NaN where either holds one.
    """
    return max(1.0 - float(np.var(truth - estimate) / np.var(truth)), 0.0) * 100.0  # NaN stays


def with_noisy_readings(table: pd.DataFrame, snr_db: float, seed: int) -> pd.DataFrame:
    """The same run as noisy instruments would have recorded it; true quantities stay clean.

    Args:
        table: simulated run with the canonical columns.
        snr_db: signal-to-noise ratio of every reading [dB].
        seed: of the white noise.
    """
    clean = table[[*READINGS, "advance_velocity_m_s"]].to_numpy()
    noise = np.random.default_rng(seed).standard_normal(clean.shape)
    noisy = with_noise(clean, snr_db, noise)
    return table.assign(**dict(zip(READINGS, noisy.T[:-1], strict=True)))


def with_noise(readings: Floats, snr_db: float, noise: Floats) -> Floats:
    """Add white noise at a signal-to-noise ratio (thesis eq. 4-2).

    Args:
        readings: shape (n, 5), the columns of a Measurement; the last, the truth, stays clean.
        snr_db: 20 log10(rms(signal) / rms(noise)), the same for every column.
        noise: unit normal, the shape of ``readings``.
    """
    rms = np.sqrt(np.mean(readings**2, axis=0)) * 10.0 ** (-snr_db / 20.0)
    rms[-1] = 0.0
    return np.asarray(readings + noise * rms)
