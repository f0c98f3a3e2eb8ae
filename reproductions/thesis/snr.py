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

from shaftline.observers import Observer, follow, get_observer, readings_of
from shaftline.observers.following import Floats, variance_accounted_for, with_noise
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.records import READINGS
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, PITCH

from ..cells import Cell, Kind, Reason, half_digit
from ..side_by_side import Judged, compare, published, published_text
from .rounded_table import ROWS as INVERTING
from .vaf import ROWS

SAMPLE_TIME_S = 0.01
SAMPLE_TIMES_S = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
SEEDS = 20
SHARE = 0.95


SEARCH_DB = 0.05
"""Resolution of the search for the SNR."""
_PITCH = READINGS.index("pitch_ratio")


def within_table(readings: Floats, ship: Ship) -> Floats:
    """Return readings whose pitch ends at the highest pitch of the inverse table (section 3-1-1)."""
    limited = readings.copy()
    limited[:, _PITCH] = np.minimum(limited[:, _PITCH], float(ship.record()["pitch_ratio_max"]))
    return limited


def without_pitch_noise(readings: Floats, ship: Ship) -> Floats:
    """Return readings whose pitch is the load case's own."""
    quiet = readings.copy()
    quiet[:, _PITCH] = PITCH
    return quiet


Change = Callable[[Floats, Ship], Floats]
"""What becomes of noisy readings before an observer reads them."""


def required_snr(
    observer: Observer,
    ship: Ship,
    readings: Floats,
    truth: Floats,
    dt: float,
    seeds: int,
    change: Change | None = None,
) -> float:
    """Return the SNR [dB] from which the mean VAF is 95 % of the noiseless one; NaN where that is 0.

    The same noise is scaled up and down, so the mean VAF rises steadily with the SNR.

    Args:
        observer: the observer.
        ship: the ship that it believes in.
        readings: without noise, shape (n, 5).
        truth: advance velocity [m/s], shape (n,).
        dt: sample time [s].
        seeds: number of noise records.
        change: of the noisy readings, such as :func:`within_table`; none by default.
    """
    clean = variance_accounted_for(truth, follow(observer, ship, readings, dt)[0])
    if clean < 1.0:
        return float("nan")
    noises = [np.random.default_rng(seed).standard_normal(readings.shape) for seed in range(seeds)]
    low, high = 0.0, 120.0
    while high - low > SEARCH_DB:
        middle = 0.5 * (low + high)
        read = (with_noise(readings, middle, noise) for noise in noises)
        if change is not None:
            read = (change(one, ship) for one in read)
        noisy = (follow(observer, ship, one, dt)[0] for one in read)
        mean = np.mean([variance_accounted_for(truth, estimate) for estimate in noisy])
        low, high = (low, middle) if mean >= SHARE * clean else (middle, high)
    return high


def snr_at(
    sample_time_s: float,
    seeds: int = SEEDS,
    tick: Callable[[], None] = lambda: None,
    change: Change | None = None,
) -> pd.Series:
    """Return the required SNR [dB] of every row at one sample time of the noise and of the observers.

    Args:
        sample_time_s: sample time [s].
        seeds: number of noise records.
        tick: called after each row.
        change: as of :func:`required_snr`.
    """
    frigate = load_ship("frigate")
    samples = CASES["measurement_noise"].run(frigate, dt=sample_time_s)
    readings, truth = readings_of(samples), samples["advance_velocity"]

    def one(name: str) -> float:
        found = required_snr(
            get_observer(name), frigate, readings, truth, sample_time_s, seeds, change
        )
        tick()
        return found

    # threads: the kernels release the interpreter lock
    found = Parallel(n_jobs=-1, prefer="threads")(delayed(one)(name) for name in ROWS.values())
    return pd.Series(found, index=list(ROWS))


COLUMN = "snr_db_for_95pct"


EDGE_DB = 0.4
"""Distance from the printed SNR [dB] that still counts as explained by the edge of the table."""


def edge_reasons(ours: pd.Series, at_edge: pd.Series) -> dict[tuple[str, str], Reason]:
    """Return what the edge of the inverse table adds to the required SNR, as reasons of Table 4-2.

    Args:
        ours: required SNR [dB] from :func:`snr_at`.
        at_edge: likewise, with :func:`within_table`.
    """
    text = (
        "the inverse table of the thesis ends at P/D 1.4 (section 3-1-1), which is the pitch of this "
        "load case: noise that lifts the measured pitch above 1.4 is lost. With the measured pitch "
        f"limited to 1.4 our SNR comes to within {EDGE_DB:g} dB of the print"
    )
    return {
        (row, COLUMN): Reason(text, shift, min(EDGE_DB, 0.5 * abs(shift)))
        for row in INVERTING
        if np.isfinite(shift := float(at_edge[row] - ours[row])) and shift
    }


def cells(ours: pd.Series, reasons: dict[tuple[str, str], Reason] | None = None) -> list[Cell]:
    """Return the cells of Table 4-2 for our required SNR [dB], from :func:`snr_at`.

    Args:
        ours: by row.
        reasons: from :func:`edge_reasons`.
    """

    def judge(row: str, column: str, text: str) -> Judged:
        # the noise's sample time was chosen by this row
        kind = Kind.CALIBRATED if row == "luenberger-high" else Kind.FREE
        basis = f"half a unit of the last printed digit, and the {SEARCH_DB:g} dB of our search"
        return kind, half_digit(text, 1) + SEARCH_DB, basis

    theirs = published_text("advance_velocity_thesis_vaf")
    return compare("4-2", ours.to_frame(COLUMN), theirs, judge, reasons)


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
