"""Compute Table 4-2: the signal-to-noise ratio that each observer needs.

The thesis adds white noise to omega, M_m, omega' and P/D and asks for the SNR at which the mean VAF of
20 seeds is 95 % of the noiseless one (4 rad/s inflow). White noise has no meaning without its sample
time, which the thesis does not print. It matters for observers that differentiate: the
67.6 dB of the fast Luenberger observer result at 0.01 s only.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from shaftline.observers import Observer, get_observer, simulated_measurements
from shaftline.observers.following import add_noise
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.records import READINGS, Floats
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, PITCH

from .. import side_by_side as beside
from ..cells import HALF_DIGIT, Cell, Kind, Reason, half_digit
from ..side_by_side import Tick, published
from . import figures
from .vaf import INVERTING_ROWS as INVERTING
from .vaf import ROWS, records, score, vaf_table

SAMPLE_TIME_S = 0.01
SAMPLE_TIMES_S = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
SEEDS = 20
SHARE = 0.95
SNRS_DB = np.arange(0.0, 101.0, 2.0)
SEARCH_DB = 0.05  # resolution of the search for the SNR
_PITCH = READINGS.index("pitch_ratio")


def within_table(measurements: Floats, ship: Ship) -> Floats:
    """Return measurements with the pitch limited to the end of the inverse table (section 3-1-1)."""
    limited = measurements.copy()
    limited[:, _PITCH] = np.minimum(limited[:, _PITCH], float(ship.record()["pitch_ratio_max"]))
    return limited


def without_pitch_noise(measurements: Floats, ship: Ship) -> Floats:
    """Return measurements with the true pitch of the load case."""
    quiet = measurements.copy()
    quiet[:, _PITCH] = PITCH
    return quiet


Change = Callable[[Floats, Ship], Floats]  # changes noisy measurements before an observer uses them


def _record(ship: Ship, dt: float) -> tuple[Floats, Floats]:
    """Return measurements without noise, shape (n, 5), and the advance velocity [m/s], shape (n,)."""
    samples = CASES["measurement_noise"].run(ship, dt=dt)
    return simulated_measurements(samples), samples["advance_velocity"]


def _noises(measurements: Floats, seeds: int) -> list[Floats]:
    return [
        np.random.default_rng(seed).standard_normal(measurements.shape) for seed in range(seeds)
    ]


def _for_each_row(one: Callable[[str], Any]) -> list[Any]:
    """Call a function for each row, in threads: the kernels release the interpreter lock."""
    return list(Parallel(n_jobs=-1, prefer="threads")(delayed(one)(row) for row in ROWS))


def required_snr(
    observer: Observer,
    ship: Ship,
    measurements: Floats,
    truth: Floats,
    dt: float,
    seeds: int,
    change: Change | None = None,
) -> float:
    """Return the SNR [dB] from which the mean VAF is 95 % of the noiseless one; NaN where that is 0.

    The same noise is scaled up and down, so the mean VAF rises steadily with the SNR. The measurements
    without noise have the shape (n, 5), the true advance velocity [m/s] (n,), at steps of ``dt`` [s].
    ``change`` is applied to the noisy measurements, such as :func:`within_table`.
    """
    clean = score(observer, ship, measurements, truth, dt)
    if clean < 1.0:
        return float("nan")
    noises = _noises(measurements, seeds)
    low, high = 0.0, 120.0
    while high - low > SEARCH_DB:
        middle = 0.5 * (low + high)
        read = (add_noise(measurements, middle, noise) for noise in noises)
        if change is not None:
            read = (change(one, ship) for one in read)
        mean = np.mean([score(observer, ship, one, truth, dt) for one in read])
        low, high = (low, middle) if mean >= SHARE * clean else (middle, high)
    return high


def snr_at(
    sample_time_s: float,
    seeds: int = SEEDS,
    tick: Tick = lambda: None,
    change: Change | None = None,
) -> pd.Series:
    """Return the required SNR [dB] of every row at one sample time of the noise and of the observers.

    ``tick`` is called after each row, ``change`` is that of :func:`required_snr`.
    """
    frigate = load_ship("frigate")
    record = _record(frigate, sample_time_s)

    def one(row: str) -> float:
        observer = get_observer(ROWS[row])
        found = required_snr(observer, frigate, *record, sample_time_s, seeds, change)
        tick()
        return found

    return pd.Series(_for_each_row(one), index=list(ROWS))


COLUMN = "snr_db_for_95pct"
EDGE_DB = 0.4
"""Distance from the printed SNR [dB] that still counts as explained by the edge of the table."""


def edge_reasons(ours: pd.Series, at_edge: pd.Series) -> dict[tuple[str, str], Reason]:
    """Return the effect of :func:`within_table` on the required SNR [dB], as reasons of Table 4-2."""
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
    """Return the cells of Table 4-2 for our required SNR [dB], from :func:`snr_at`."""

    def judge(row: str, column: str, text: str) -> beside.Judged:
        # the noise's sample time was chosen by this row
        kind = Kind.CALIBRATED if row == "luenberger-high" else Kind.FREE
        basis = f"{HALF_DIGIT}, and the {SEARCH_DB:g} dB of our search"
        return kind, half_digit(text, 1) + SEARCH_DB, basis

    theirs = beside.published_text("advance_velocity_thesis_vaf")
    return beside.compare("4-2", ours.to_frame(COLUMN), theirs, judge, reasons)


def snr_curves(ship: Ship, tick: Tick) -> pd.DataFrame:
    """Return mean, lowest and highest VAF [%] by observer and SNR (Figures A-12 to A-22)."""
    measurements, truth = _record(ship, SAMPLE_TIME_S)
    noises = _noises(measurements, SEEDS)

    def one(row: str) -> list[tuple[str, float, float, float, float]]:
        rows = []
        for snr in map(float, SNRS_DB):
            noisy = (add_noise(measurements, snr, noise) for noise in noises)
            found = [score(ROWS[row], ship, read, truth, SAMPLE_TIME_S) for read in noisy]
            rows.append((row, snr, float(np.mean(found)), min(found), max(found)))
        tick()
        return rows

    found = [line for lines in _for_each_row(one) for line in lines]
    return pd.DataFrame(found, columns=["row", "snr_dB", "mean", "least", "most"])


def sample_time_scan(tick: Tick = lambda: None) -> pd.DataFrame:
    """Return the required SNR [dB] over the noise's sample time, with the rms distance to the thesis."""
    printed = published("advance_velocity_thesis_vaf")[COLUMN]
    table = pd.DataFrame({f"{t:g} s": snr_at(t, seeds=8, tick=tick) for t in SAMPLE_TIMES_S})
    distance = table.sub(printed, axis=0).pow(2).mean().pow(0.5)
    table["thesis"] = printed.reindex(table.index)
    table.loc["rms distance to the thesis"] = distance
    return table


def gain_sweep(tick: Tick = lambda: None) -> pd.DataFrame:
    """Return VAF without noise [%] and required SNR [dB] over the gain of I&I (Figure 4-3)."""
    frigate, rows = load_ship("frigate"), []
    record = _record(frigate, SAMPLE_TIME_S)
    for gamma in map(float, np.geomspace(0.7, 40.0, 10)):
        observer = ImmersionInvariance(gamma)
        clean = score(observer, frigate, *record, SAMPLE_TIME_S)
        rows.append(
            (gamma, clean, required_snr(observer, frigate, *record, SAMPLE_TIME_S, seeds=8))
        )
        tick()
    return pd.DataFrame(rows, columns=["gamma", "vaf", "snr_db"])


def page(tick: Tick) -> beside.Page:
    """Return the page of Table 4-2 and Figures 4-2, 4-3 and A-12 to A-22."""
    ours, at_edge, no_pitch = (
        snr_at(SAMPLE_TIME_S, tick=tick, change=change)
        for change in (None, within_table, without_pitch_noise)
    )
    scan, sweep = sample_time_scan(tick), gain_sweep(tick)
    clean, _ = vaf_table(tick)
    printed = published("advance_velocity_thesis_vaf")[COLUMN]
    edge = pd.DataFrame(
        {
            "ours": ours,
            "pitch limited to 1.4": at_edge,
            "no noise on the pitch": no_pitch,
            "printed": printed.reindex(ours.index),
        }
    )
    drawn = {
        "noise": figures.noise_figure(snr_curves(load_ship("frigate"), tick), printed, SHARE),
        "trade-off": figures.trade_off(ours, clean),
        "gain-sweep": figures.gain_sweep(sweep),
    }
    return beside.page_of_table(
        ours.to_frame(COLUMN),
        cells(ours, edge_reasons(ours, at_edge)),
        drawn,
        80,
        Path(__file__).with_suffix(".md"),
        1,
        seeds=SEEDS,
        sample_time=SAMPLE_TIME_S,
        scan=scan.reset_index(names="row"),
        edge=edge.reset_index(names=""),
    )


TITLE = "Signal-to-noise ratio for 95 % of the noiseless VAF, dB (thesis, Table 4-2)"
STUDY = beside.Study(TITLE, page, (4 + len(SAMPLE_TIMES_S)) * len(ROWS) + 10 + records())
