"""Table 4-2: the signal-to-noise ratio that each observer needs.

The thesis adds white noise to omega, M_m, omega' and P/D and asks for the SNR at which the mean VAF of
20 seeds is 95 % of the noiseless one (4 rad/s inflow). White noise has no meaning without its sample
time, which the thesis does not print. An observer without dynamics does not care; one that
differentiates does: the fast Luenberger observer's 67.6 dB fits 0.01 s and no other time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from ...observers import Observer, follow, get_observer, readings_of
from ...observers.immersion_invariance import ImmersionInvariance
from ...observers.metrics import Floats, variance_accounted_for, with_noise
from ...plant import Ship, load_ship
from ..cells import Cell, Kind, half_digit
from ..side_by_side import Judged, compare, published, published_text
from .load_cases import CASES
from .vaf import ROWS

SAMPLE_TIME_S = 0.01
SAMPLE_TIMES_S = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
SEEDS = 20
SHARE = 0.95


def required_snr(
    observer: Observer, ship: Ship, readings: Floats, truth: Floats, dt: float, seeds: int
) -> float:
    """SNR [dB], to 0.05 dB, from which the mean VAF is 95 % of the noiseless; NaN where that is 0.

    The same noise is scaled up and down, so the mean VAF rises steadily with the SNR.
    """
    clean = variance_accounted_for(truth, follow(observer, ship, readings, dt)[0])
    if clean < 1.0:
        return float("nan")
    noises = [np.random.default_rng(seed).standard_normal(readings.shape) for seed in range(seeds)]
    low, high = 0.0, 120.0
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        noisy = (follow(observer, ship, with_noise(readings, middle, n), dt)[0] for n in noises)
        mean = np.mean([variance_accounted_for(truth, estimate) for estimate in noisy])
        low, high = (low, middle) if mean >= SHARE * clean else (middle, high)
    return high


def snr_at(
    sample_time_s: float, seeds: int = SEEDS, tick: Callable[[], None] = lambda: None
) -> pd.Series:
    """Required SNR [dB] of every row at one sample time of the noise (and of the observers)."""
    frigate = load_ship("frigate")
    samples = CASES["measurement_noise"].run(frigate, dt=sample_time_s)
    readings, truth = readings_of(samples), samples["advance_velocity"]

    def one(name: str) -> float:
        found = required_snr(get_observer(name), frigate, readings, truth, sample_time_s, seeds)
        tick()
        return found

    # threads: the kernels release the interpreter lock
    found = Parallel(n_jobs=-1, prefer="threads")(delayed(one)(name) for name in ROWS.values())
    return pd.Series(found, index=list(ROWS))


COLUMN = "snr_db_for_95pct"


def _judge(row: str, column: str, text: str) -> Judged:
    return Kind.FREE, half_digit(text, 1), "half a unit of the last printed digit"


def cells(ours: pd.Series) -> list[Cell]:
    """Return the cells of Table 4-2 for our noise limits [dB], from :func:`snr_at`."""
    theirs = published_text("advance_velocity_thesis_vaf")
    return compare("4-2", ours.to_frame(COLUMN), theirs, _judge)


def sample_time_scan(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Required SNR [dB] over the noise's sample time, with the rms distance to the thesis."""
    printed = published("advance_velocity_thesis_vaf")["snr_db_for_95pct"]
    table = pd.DataFrame({f"{t:g} s": snr_at(t, seeds=8, tick=tick) for t in SAMPLE_TIMES_S})
    distance = table.sub(printed, axis=0).pow(2).mean().pow(0.5)
    table["thesis"] = printed.reindex(table.index)
    table.loc["rms distance to the thesis"] = distance
    return table


def gain_sweep(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """I&I over its gain gamma: noiseless VAF [%] and SNR needed [dB] (thesis Figure 4-3)."""
    frigate = load_ship("frigate")
    samples = CASES["measurement_noise"].run(frigate, dt=SAMPLE_TIME_S)
    readings, truth = readings_of(samples), samples["advance_velocity"]
    rows = []
    for gamma in np.geomspace(0.7, 40.0, 10):
        observer = ImmersionInvariance(float(gamma))
        clean = variance_accounted_for(truth, follow(observer, frigate, readings, SAMPLE_TIME_S)[0])
        needed = required_snr(observer, frigate, readings, truth, SAMPLE_TIME_S, seeds=8)
        rows.append({"gamma": gamma, "vaf": clean, "snr_db": needed})
        tick()
    return pd.DataFrame(rows)
