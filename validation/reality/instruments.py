"""What the instruments of the true ship show of it."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from .numbers import Numbers

Floats = NDArray[np.float64]
ENCODER_DIGIT = 0.005  # rad/s; of a rounded reading


def _late(values: Floats, delay: float, smoothing: float, period: float) -> Floats:
    """A delay of which a share is an exponential smoothing, the rest pure."""
    time = np.arange(len(values)) * period
    share = -math.expm1(-period / max(smoothing * delay, 1e-9))
    smooth, _ = scipy.signal.lfilter(
        [share], [1.0, share - 1.0], values, zi=[(1.0 - share) * values[0]]
    )
    pure = delay - smoothing * delay
    return np.asarray(np.interp(time - pure, time, smooth))


def _trailing_mean(values: Floats, window: float, period: float) -> Floats:
    wide = max(round(window / period), 1)
    return np.asarray(
        scipy.ndimage.uniform_filter1d(values, wide, mode="nearest", origin=(wide - 1) // 2)
    )


def encoder_noise(numbers: Numbers, rows: int, seed: int) -> Floats:
    """What :func:`read` adds to the shaft speed [rad/s]; it draws it first."""
    return np.asarray(numbers["encoder_noise"] * np.random.default_rng(seed).standard_normal(rows))


def read(truth: pd.DataFrame, numbers: Numbers, period: float, seed: int | None) -> pd.DataFrame:
    """Readings of the true signals.

    Args:
        truth: the canonical columns, true.
        numbers: of the instruments: systematic errors, and noise as one standard deviation.
        period: between samples [s].
        seed: of the noise; None for none.
    """
    table = truth.copy()
    time = table["time_s"].to_numpy()
    if "pitch_ratio" in table:
        pitch = table["pitch_ratio"].to_numpy()
        slope = 1.0 + numbers["pitch_reading_slope"] * (pitch - 1.1)
        table["pitch_ratio"] = pitch + numbers["pitch_reading"] * slope
    if "shaft_torque_N_m" in table:
        torque = table["shaft_torque_N_m"].to_numpy()
        if numbers["torque_delay"] > 0.0:
            torque = _late(torque, numbers["torque_delay"], numbers["torque_filter"], period)
        bow = 1.0 + numbers["torque_scale_bow"] * (torque / 2e5 - 1.0)
        torque = torque * (1.0 + numbers["torque_scale"] * bow)
        drift = 1.0 + numbers["torque_zero_drift"] * np.sin(2.0 * math.pi * time / 1500.0)
        table["shaft_torque_N_m"] = torque + numbers["torque_zero"] * drift
    if "ship_speed_m_s" in table and numbers["log_window"] > 0.0:
        speed = table["ship_speed_m_s"].to_numpy()
        table["ship_speed_m_s"] = _trailing_mean(speed, numbers["log_window"], period)
    if seed is None:
        return table
    rng = np.random.default_rng(seed)
    noise = {
        "shaft_speed_rad_s": ("encoder_noise", ENCODER_DIGIT),
        "shaft_torque_N_m": ("gauge_noise", 100.0),
        "pitch_ratio": ("pitch_noise", 0.001),
        "ship_speed_m_s": ("log_noise", 0.01),
        "motor_current_A": ("current_noise", 0.001),
        "propeller_submergence_m": ("depth_noise", 0.01),
    }
    for column, (name, digit) in noise.items():
        drawn = rng.standard_normal(len(table))
        if column in table:
            table[column] += numbers[name] * drawn
            if numbers["rounding"] > 0.0:
                table[column] = np.round(table[column] / digit) * digit
    if "thrust_N" in table:
        size = numbers["thrust_noise"] * table["thrust_N"].abs().mean()
        table["thrust_N"] += size * rng.standard_normal(len(table))
    return table
