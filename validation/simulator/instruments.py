"""Random programmes of rack and pitch commands, and the instruments of the true ship."""

from __future__ import annotations

import functools
import math

import numpy as np
import pandas as pd
import scipy
from numpy.random import Generator

from .motion import _curve
from .parameters import Floats, Parameters, frigate_parameters, open_water_curve

LIVELY = ("steps", "ramps", "staircase", "harbour", "sweep")
DULL = "cruise"
SPEED_PER_RACK = 0.3  # rad/s/mm; about what a millimetre of rack is worth


@functools.lru_cache(4096)
def steady(omega: float, pitch: float) -> tuple[float, float]:
    """Return rack [mm] and ship speed [m/s] of the frigate at a steady shaft speed and pitch."""
    n = frigate_parameters()
    kt, kq = (open_water_curve(curve, 5, 0.9) for curve in ("KT", "KQ"))
    turns, diameter = omega / (2.0 * math.pi), n["diameter"]

    def surplus(v: float) -> float:
        j = (1.0 - n["wake"]) * v / (turns * diameter)
        thrust = n["density"] * turns**2 * diameter**4 * float(_curve(kt, j, pitch))
        return n["screws"] * (1.0 - n["deduction"]) * thrust - n["resistance"] * v * v

    v = float(scipy.optimize.brentq(surplus, 0.0, 1.5 * turns * diameter))
    j = (1.0 - n["wake"]) * v / (turns * diameter)
    load = n["density"] * turns**2 * diameter**5 * float(_curve(kq, j, pitch)) / n["rotative"]
    brake = load / (n["gear"] * n["efficiency"])
    return (brake - n["map_speed"] * n["gear"] * omega - n["map_zero"]) / n["map_rack"], v


def _level(rng: Generator, slow: bool, governed: bool) -> tuple[float, float]:
    """Return rack (or shaft speed) and pitch of a random working point within the engine's limits."""
    for _ in range(100):
        omega = rng.uniform(5.8, 8.5) if slow else rng.uniform(6.5, 12.0)
        pitch = rng.uniform(0.7, 1.2) if slow else rng.uniform(0.95, 1.38)
        rack, _ = steady(round(omega, 3), round(pitch, 3))
        if rack < 27.0:
            return (omega if governed else rack), pitch
    raise AssertionError("no working point")


def voyage(
    kind: str, seconds: float, period: float, rng: Generator, governed: bool = False
) -> tuple[Floats, Floats]:
    """Return rack [mm] and pitch commands at each sample.

    Args:
        kind: one of ``LIVELY``, or ``"cruise"``.
        seconds: duration of the recording [s].
        period: sampling interval [s].
        rng: random generator.
        governed: whether to return the shaft speed [rad/s] in place of the rack.
    """
    unit = SPEED_PER_RACK if governed else 1.0
    count = round(seconds / period) + 1
    time: Floats = np.arange(count, dtype=np.float64) * period
    if kind == DULL:
        rack, pitch = _level(rng, False, governed)
        touched = np.cumsum(rng.random(count) < period / 200.0) % 3 - 1
        return np.asarray(rack + 0.12 * unit * touched, dtype=np.float64), np.full(count, pitch)
    if kind == "sweep":
        rack, pitch = _level(rng, False, governed)
        low, high = 1.0 / rng.uniform(90.0, 150.0), 1.0 / rng.uniform(8.0, 20.0)
        phase = 2.0 * math.pi * low * seconds / math.log(high / low)
        angle = phase * (np.exp(time / seconds * math.log(high / low)) - 1.0)
        drawn = unit * rng.uniform(1.5, 3.0)
        swell = np.sin(2.0 * math.pi * time / rng.uniform(130.0, 260.0))
        return rack + drawn * np.sin(angle), min(pitch, 1.3) + rng.uniform(0.04, 0.08) * swell
    slow = kind == "harbour"
    dwell = (12.0, 60.0) if slow else (50.0, 140.0)
    edges = [0.0]
    while edges[-1] < seconds:
        edges.append(edges[-1] + rng.uniform(*dwell))
    levels = [_level(rng, slow, governed) for _ in edges]
    if kind == "staircase":  # up and down in equal treads
        first, last = sorted(levels[:2])
        folded = np.abs((np.arange(len(edges)) % 10) - 5) / 5.0
        levels = [
            (first[0] + f * (last[0] - first[0]), first[1] + f * (last[1] - first[1]))
            for f in (1.0 - folded)
        ]
    place = np.searchsorted(edges, time, side="right") - 1
    knots, since = np.array(levels), time - np.array(edges)[place]
    demands = knots[place]
    if kind == "steps":  # rack and pitch seldom move at the same moment
        demands[:, 1] = knots[np.maximum(place - (since < 15.0), 0), 1]
    elif kind == "ramps":
        into = np.clip(since / rng.uniform(10.0, 40.0), 0.0, 1.0)[:, None]
        demands = knots[np.maximum(place - 1, 0)] * (1.0 - into) + knots[place] * into
    return demands[:, 0].copy(), demands[:, 1].copy()


ENCODER_DIGIT = 0.005  # resolution of a rounded measurement [rad/s]
NOISE = {
    "shaft_speed_rad_s": ("encoder_noise", ENCODER_DIGIT),
    "shaft_torque_N_m": ("gauge_noise", 100.0),
    "pitch_ratio": ("pitch_noise", 0.001),
    "ship_speed_m_s": ("log_noise", 0.01),
    "motor_current_A": ("current_noise", 0.001),
    "propeller_submergence_m": ("depth_noise", 0.01),
}
"""Parameter of the noise's standard deviation, and resolution of a rounded measurement, by column."""


def _late(values: Floats, delay: float, smoothing: float, period: float) -> Floats:
    """Return values with a delay, a share of which is a first-order lag."""
    time = np.arange(len(values)) * period
    share = -math.expm1(-period / max(smoothing * delay, 1e-9))
    start = [(1.0 - share) * values[0]]
    smooth, _ = scipy.signal.lfilter([share], [1.0, share - 1.0], values, zi=start)
    pure = delay - smoothing * delay
    return np.asarray(np.interp(time - pure, time, smooth))


def encoder_noise(numbers: Parameters, rows: int, seed: int) -> Floats:
    """Return the noise that :func:`add_instruments` adds to the shaft speed [rad/s]."""
    return np.asarray(numbers["encoder_noise"] * np.random.default_rng(seed).standard_normal(rows))


def add_instruments(
    truth: pd.DataFrame, numbers: Parameters, period: float, seed: int | None
) -> pd.DataFrame:
    """Return the measurements of the true signals.

    Args:
        truth: true signals in canonical columns.
        numbers: parameters of the instruments: systematic errors, and standard deviations of noise.
        period: sampling interval [s].
        seed: seed of the noise; None for no noise.
    """
    table = truth.copy()
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
        wave = np.sin(2.0 * math.pi * table["time_s"].to_numpy() / 1500.0)
        drift = 1.0 + numbers["torque_zero_drift"] * wave
        table["shaft_torque_N_m"] = torque + numbers["torque_zero"] * drift
    if "ship_speed_m_s" in table:
        speed = table["ship_speed_m_s"]
        bow = 1.0 + numbers["log_scale_bow"] * (speed / 7.0 - 1.0)
        table["ship_speed_m_s"] = speed * (1.0 + numbers["log_scale"] * bow)
    if "ship_speed_m_s" in table and numbers["log_window"] > 0.0:
        speed, wide = table["ship_speed_m_s"], max(round(numbers["log_window"] / period), 1)
        table["ship_speed_m_s"] = scipy.ndimage.uniform_filter1d(  # the trailing mean
            speed.to_numpy(), wide, mode="nearest", origin=(wide - 1) // 2
        )
    if seed is None:
        return table
    rng = np.random.default_rng(seed)
    for column, (name, digit) in NOISE.items():
        drawn = rng.standard_normal(len(table))
        if column in table:
            table[column] += numbers[name] * drawn
            if numbers["rounding"] > 0.0:
                table[column] = np.round(table[column] / digit) * digit
    if "thrust_N" in table:
        size = numbers["thrust_noise"] * table["thrust_N"].abs().mean()
        table["thrust_N"] += size * rng.standard_normal(len(table))
    return table
