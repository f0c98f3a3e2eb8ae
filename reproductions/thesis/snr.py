"""Compute Table 4-2: the signal-to-noise ratio that each observer needs.

The thesis adds white noise to omega, M_m, omega' and P/D and asks for the SNR at which the mean VAF of
20 seeds is 95 % of the noiseless one (4 rad/s inflow). White noise has no meaning without its sample
time, which the thesis does not print. It matters for observers that differentiate: the
67.6 dB of the fast Luenberger observer result at 0.01 s only.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray

from shaftline.observers import Observer, follow, get_observer, simulated_measurements
from shaftline.observers.following import Floats, add_noise, variance_accounted_for
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.records import READINGS
from shaftline.plant import Ship, load_ship
from shaftline.plant.load_cases import CASES, PITCH

from ..cells import Cell, Kind, Reason, half_digit
from ..pages import fill_template
from ..side_by_side import (
    Judged,
    Page,
    Study,
    Tick,
    compare,
    numbers_by_row,
    published,
    published_text,
    side_by_side,
)
from . import figures
from .vaf import INVERTING_ROWS as INVERTING
from .vaf import ROWS, records, vaf_table

SAMPLE_TIME_S = 0.01
SAMPLE_TIMES_S = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
SEEDS = 20
SHARE = 0.95
SNRS_DB = np.arange(0.0, 101.0, 2.0)


SEARCH_DB = 0.05
"""Resolution of the search for the SNR."""
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


Change = Callable[[Floats, Ship], Floats]
"""Changes noisy measurements before an observer uses them."""


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

    The same noise is scaled up and down, so the mean VAF rises steadily with the SNR.

    Args:
        observer: the observer.
        ship: the ship that the observer assumes.
        measurements: measurements without noise, shape (n, 5).
        truth: advance velocity [m/s], shape (n,).
        dt: sample time [s].
        seeds: number of noise records.
        change: applied to the noisy measurements, such as :func:`within_table`; none by default.
    """
    clean = variance_accounted_for(truth, follow(observer, ship, measurements, dt)[0])
    if clean < 1.0:
        return float("nan")
    noises = [
        np.random.default_rng(seed).standard_normal(measurements.shape) for seed in range(seeds)
    ]
    low, high = 0.0, 120.0
    while high - low > SEARCH_DB:
        middle = 0.5 * (low + high)
        read = (add_noise(measurements, middle, noise) for noise in noises)
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
    measurements, truth = simulated_measurements(samples), samples["advance_velocity"]

    def one(name: str) -> float:
        found = required_snr(
            get_observer(name), frigate, measurements, truth, sample_time_s, seeds, change
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
    """Return the effect of the inverse table's limit on the required SNR, as reasons of Table 4-2.

    Args:
        ours: required SNR [dB] from :func:`snr_at`.
        at_edge: required SNR [dB] with :func:`within_table`.
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
    """Return the cells of Table 4-2 for our required SNR [dB], from :func:`snr_at`."""

    def judge(row: str, column: str, text: str) -> Judged:
        # the noise's sample time was chosen by this row
        kind = Kind.CALIBRATED if row == "luenberger-high" else Kind.FREE
        basis = f"half a unit of the last printed digit, and the {SEARCH_DB:g} dB of our search"
        return kind, half_digit(text, 1) + SEARCH_DB, basis

    theirs = published_text("advance_velocity_thesis_vaf")
    return compare("4-2", ours.to_frame(COLUMN), theirs, judge, reasons)


def snr_curves(ship: Ship, tick: Tick) -> pd.DataFrame:
    """Return mean, lowest and highest VAF [%] by observer and SNR (Figures A-12 to A-22)."""
    samples = CASES["measurement_noise"].run(ship, dt=SAMPLE_TIME_S)
    measurements, truth = simulated_measurements(samples), samples["advance_velocity"]
    noises = [
        np.random.default_rng(seed).standard_normal(measurements.shape) for seed in range(SEEDS)
    ]

    def scored(observer: str, snr: float, noise: NDArray[np.float64]) -> float:
        noisy = add_noise(measurements, snr, noise)
        estimate, _ = follow(get_observer(observer), ship, noisy, SAMPLE_TIME_S)
        return variance_accounted_for(truth, estimate)

    def one(name: str) -> list[dict[str, float | str]]:
        rows: list[dict[str, float | str]] = []
        for snr in SNRS_DB:
            found = [scored(ROWS[name], float(snr), noise) for noise in noises]
            rows.append({"row": name, "snr_dB": float(snr), "mean": float(np.mean(found)),
                         "least": min(found), "most": max(found)})  # fmt: skip
        tick()
        return rows

    # threads: the kernels release the interpreter lock
    found = Parallel(n_jobs=-1, prefer="threads")(delayed(one)(name) for name in ROWS)
    return pd.DataFrame([row for rows in found for row in rows])


def sample_time_scan(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Return the required SNR [dB] over the noise's sample time, with the rms distance to the thesis."""
    printed = published("advance_velocity_thesis_vaf")["snr_db_for_95pct"]
    table = pd.DataFrame({f"{t:g} s": snr_at(t, seeds=8, tick=tick) for t in SAMPLE_TIMES_S})
    distance = table.sub(printed, axis=0).pow(2).mean().pow(0.5)
    table["thesis"] = printed.reindex(table.index)
    table.loc["rms distance to the thesis"] = distance
    return table


def gain_sweep(tick: Callable[[], None] = lambda: None) -> pd.DataFrame:
    """Return VAF without noise [%] and required SNR [dB] over the gain of I&I (Figure 4-3)."""
    frigate = load_ship("frigate")
    samples = CASES["measurement_noise"].run(frigate, dt=SAMPLE_TIME_S)
    measurements, truth = simulated_measurements(samples), samples["advance_velocity"]
    rows = []
    for gamma in np.geomspace(0.7, 40.0, 10):
        observer = ImmersionInvariance(float(gamma))
        clean = variance_accounted_for(
            truth, follow(observer, frigate, measurements, SAMPLE_TIME_S)[0]
        )
        needed = required_snr(observer, frigate, measurements, truth, SAMPLE_TIME_S, seeds=8)
        rows.append({"gamma": gamma, "vaf": clean, "snr_db": needed})
        tick()
    return pd.DataFrame(rows)


def page(tick: Tick) -> Page:
    """Return the page of Table 4-2 and Figures 4-2, 4-3 and A-12 to A-22."""
    ours = snr_at(SAMPLE_TIME_S, tick=tick)
    at_edge, no_pitch = (
        snr_at(SAMPLE_TIME_S, tick=tick, change=change)
        for change in (within_table, without_pitch_noise)
    )
    scan, sweep = sample_time_scan(tick), gain_sweep(tick)
    clean, _ = vaf_table(tick)
    printed = published("advance_velocity_thesis_vaf")[COLUMN]
    edge = pd.DataFrame(
        {"ours": ours, "pitch limited to 1.4": at_edge, "no noise on the pitch": no_pitch,
         "printed": printed.reindex(ours.index)}
    )  # fmt: skip
    compared = cells(ours, edge_reasons(ours, at_edge))
    frame = ours.to_frame(COLUMN)
    shown = side_by_side(frame, compared, 1)
    body = fill_template(
        Path(__file__).with_suffix(".md"), shown=shown, seeds=SEEDS, sample_time=SAMPLE_TIME_S,
        scan=scan.reset_index(names="row"), edge=edge.reset_index(names=""),
    )  # fmt: skip
    curves = snr_curves(load_ship("frigate"), tick)
    drawn = {
        "noise": figures.noise_figure(curves, printed, SHARE),
        "trade-off": figures.trade_off(ours, clean),
        "gain-sweep": figures.gain_sweep(sweep),
    }
    return Page(compared, body, drawn, numbers_by_row(frame), frame.reset_index(), shown, 80)


STUDY = Study(
    "Signal-to-noise ratio for 95 % of the noiseless VAF, dB (thesis, Table 4-2)",
    page,
    (4 + len(SAMPLE_TIMES_S)) * len(ROWS) + 10 + records(),
)
