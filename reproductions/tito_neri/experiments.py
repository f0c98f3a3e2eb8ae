"""Make the experiments of Vrijdag & Martelli 2021 (Table 3): voltages, and simulated recordings.

The paper prints the voltages of the staircase and the frequencies of the sines. Assumed, for it does
not print them: 5 s per level, amplitudes of 5 % of the voltage at point C, noise of 5 % rms that is
flat to 1000 rad/s, sampling at 10 kHz (noise and mix 5 kHz), and the parts of the mix.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shaftline.plant import Ship, simulate_recording

from ..side_by_side import published

POINT_C_V = 5.89  # mean voltage of sines and noise
HOLD_S, AMPLITUDE, NOISE_TOP_RAD_S = 5.0, 0.05, 1000.0
FAST_S, USUAL_S = 1e-4, 2e-4


class Experiment(NamedTuple):
    """A voltage over time."""

    name: str
    interval_s: float
    voltage: NDArray[np.float64]


def staircase(levels_V: tuple[float, ...] | None = None, hold_s: float = HOLD_S) -> Experiment:
    """Return the voltages of Table 4 [V], or others, one after the other, each for ``hold_s`` [s]."""
    table = published("tito_neri_operating_points")["motor_voltage_V"]
    levels = tuple(map(float, table)) if levels_V is None else levels_V
    return Experiment("staircase", FAST_S, np.repeat(levels, round(hold_s / FAST_S)))


def frequencies() -> tuple[float, ...]:
    """Return the nine frequencies of Table 2 [rad/s]."""
    return tuple(float(value) for value in published("tito_neri_frequency_response").index)


def sine(frequency: float) -> Experiment:
    """Return a sine [rad/s] about point C of one second and three periods, or two of slow sines."""
    period = 2.0 * math.pi / frequency
    seconds = 1.3 + max(2.05 * period, min(3.0 * period, 10.0), 1.0)
    time = np.arange(round(seconds / FAST_S)) * FAST_S
    return Experiment("sine", FAST_S, POINT_C_V * (1.0 + AMPLITUDE * np.sin(frequency * time)))


def sines() -> list[Experiment]:
    """Return the nine sines."""
    return [sine(frequency) for frequency in frequencies()]


def noise(seconds: float = 120.0, seed: int = 0) -> Experiment:
    """Return band-limited white noise about point C."""
    rows = round(seconds / USUAL_S)
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(rows))
    spectrum[2.0 * math.pi * np.fft.rfftfreq(rows, USUAL_S) > NOISE_TOP_RAD_S] = 0.0
    spectrum[0] = 0.0
    values = np.fft.irfft(spectrum, rows)
    return Experiment("noise", USUAL_S, POINT_C_V * (1.0 + AMPLITUDE * values / values.std()))


def mix() -> Experiment:
    """Return steps, a strong sine, noise and a ramp, 20 s in all, for validation."""
    steps = np.repeat([4.91, 6.88, 3.91, 5.89, 7.87], round(2.0 / USUAL_S))
    swing = np.arange(round(3.0 / USUAL_S)) * USUAL_S
    sine_part = POINT_C_V * (1.0 + 0.2 * np.sin(4.0 * math.pi * swing))
    ramp = np.linspace(4.4, 7.4, round(3.0 / USUAL_S))
    parts = [steps, sine_part, noise(4.0, 1).voltage, ramp]
    return Experiment("mix", USUAL_S, np.concatenate(parts))


def simulate_test(ship: Ship, test: Experiment) -> pd.DataFrame:
    """Simulate a test on a drive train with perfect instruments, in canonical columns."""
    time = np.arange(len(test.voltage)) * test.interval_s
    table = pd.DataFrame({"time_s": time, "motor_voltage_V": test.voltage, "motor_current_A": 0.0})
    found = simulate_recording(ship, table)
    return found[["time_s", "motor_voltage_V", "shaft_speed_rad_s", "motor_current_A"]]


MATRIX: dict[str, Callable[[], list[Experiment]]] = {
    "staircase": lambda: [staircase()],
    "sines": sines,
    "noise": lambda: [noise()],
    "mix": lambda: [mix()],
}
"""The tests of Table 3 by name."""
