"""Identify and diagnose a positioning system, and evaluate the result on a held-out recording.

Two recordings of 24.84 s at 1 kHz (Janot, Gautier & Brunot, nonlinearbenchmark.org): force and encoder.
The first is fitted; the second is held out and simulated open loop from its force alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.mismatch import Options, diagnose, identify, load_recording
from shaftline.mismatch.estimate import Tick, ignore_progress
from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

HOME = Path(__file__).parent
MASS = "transmission.inertia_engine_side_kg_m2"
VISCOUS = "transmission.viscous_friction_engine_side_N_m_s_rad"
COULOMB = "transmission.coulomb_friction_engine_side_N_m"
OFFSET = "prime_mover.torque_offset_N_m"
STICTION = "transmission.stiction_speed_rad_s"
KEYS = (MASS, VISCOUS, COULOMB, OFFSET)

PUBLISHED = dict(zip(KEYS, (95.11, 203.5, 20.4, 3.2), strict=True))
"""[kg, N s/m, N, N]; their offset opposes the force, ours is added by the drive."""

STARTS: dict[str, dict[str, float]] = {
    "as in the file": {},
    "far off": {MASS: 60.0, VISCOUS: 300.0, COULOMB: 30.0},
}
EVERY = (1, 5, 20)
"""One row in so many is kept for the identification: 1000, 200 and 50 Hz, without a filter."""

STICTIONS = (0.0005, 0.001, 0.002)
"""Speeds below which friction sticks [m/s]; not published, so several are tried."""

POSITION = "shaft_angle_rad"
SMOOTHED_HZ = 20.0
"""Velocities are low-passed (zero-phase Butterworth of fourth order), then differentiated."""


@dataclass(frozen=True)
class Recordings:
    """Both recordings with canonical columns."""

    estimation: pd.DataFrame
    validation: pd.DataFrame


def rig() -> Ship:
    """Return the positioning system as a drive with a load and rough parameters."""
    return load_ship(HOME / "emps.toml")


def load_runs(folder: Path) -> Recordings:
    """Return both recordings.

    Args:
        folder: that holds ``estimation.csv`` and ``validation.csv``.
    """
    found = [
        load_recording(folder / f"{name}.csv", rig(), HOME / "columns.toml").table
        for name in ("estimation", "validation")
    ]
    return Recordings(*found)


def errors(ship: Ship, recording: pd.DataFrame) -> tuple[float, float]:
    """Return the rms position error [mm] and the relative rms velocity error [%], open loop."""
    found = simulate_recording(ship, recording)[POSITION].to_numpy()
    measured = recording[POSITION].to_numpy()
    off = _velocity(found) - _velocity(measured)
    share = np.sqrt(np.mean(off**2) / np.mean(_velocity(measured) ** 2))
    return 1e3 * float(np.sqrt(np.mean((found - measured) ** 2))), 100.0 * float(share)


def _velocity(position: NDArray[np.float64]) -> NDArray[np.float64]:
    smooth = scipy.signal.sosfiltfilt(
        scipy.signal.butter(4, SMOOTHED_HZ, output="sos", fs=1000.0), position
    )
    return np.asarray(np.gradient(smooth, 1e-3))


def identify_all(runs: Recordings, tick: Tick = ignore_progress) -> pd.DataFrame:
    """Identify the parameters from each start, at each rate and with each sticking speed.

    Returns:
        A row each: parameters, standard errors, differences from the published values [%], and the
        errors on both recordings at 1 kHz.
    """
    rows = []
    tried = [(s, e, v) for s in STARTS for e in EVERY for v in STICTIONS]
    for count, (start, every, stiction) in enumerate(tried):
        tick("identifying", count, len(tried))
        ship = rig().with_values({**STARTS[start], STICTION: stiction})
        kept = runs.estimation.iloc[::every].reset_index(drop=True)
        judged = runs.validation.iloc[::every].reset_index(drop=True)
        found = identify(ship, kept, free=KEYS, hold_out=[judged])
        rows.append(
            {"start": start, "rate_Hz": 1000 // every, "stiction_m_s": stiction}
            | _row(found.identified, runs)
            | {f"se_{_short(e.key)}": e.standard_error for e in found.estimates}
        )
    tick("identifying", len(tried), len(tried))
    return pd.DataFrame(rows)


def references(runs: Recordings) -> pd.DataFrame:
    """Return the errors of the published parameters, and the least position error of four parameters."""
    published = rig().with_values(PUBLISHED)
    tried = {
        "published, mass and viscous friction alone": published.with_values(
            {COULOMB: 0.0, OFFSET: 0.0}
        ),
        "published, without the offset": published.with_values({OFFSET: 0.0}),
        "published": published,
        "least position error on estimation": fit_position(runs.estimation),
        "least position error on validation itself": fit_position(runs.validation),
    }
    return pd.DataFrame([{"numbers": name} | _row(ship, runs) for name, ship in tried.items()])


def fit_position(recording: pd.DataFrame) -> Ship:
    """Return the ship with the least squared position error in a free-running simulation."""
    scale = np.array(list(PUBLISHED.values()))
    measured = recording[POSITION].to_numpy()

    def at(shares: NDArray[np.float64]) -> Ship:
        return rig().with_values(dict(zip(KEYS, map(float, shares * scale), strict=True)))

    def residuals(shares: NDArray[np.float64]) -> NDArray[np.float64]:
        found = simulate_recording(at(shares), recording)[POSITION].to_numpy()
        return np.asarray(1e3 * (found - measured)[::10])

    return at(
        scipy.optimize.least_squares(
            residuals, np.ones(len(KEYS)), diff_step=np.full(len(KEYS), 1e-3)
        ).x
    )


def _row(ship: Ship, runs: Recordings) -> dict[str, float]:
    values = {key: ship.parameter(key).value for key in KEYS}
    row = {_short(key): value for key, value in values.items()}
    for key in KEYS[:3]:
        row[f"{_short(key)}_off_percent"] = 100.0 * (values[key] / PUBLISHED[key] - 1.0)
    for name, recording in (("estimation", runs.estimation), ("validation", runs.validation)):
        row[f"{name}_mm"], row[f"{name}_velocity_percent"] = errors(ship, recording)
    return row


def _short(key: str) -> str:
    names = ("mass_kg", "viscous_N_s_m", "coulomb_N", "offset_N")
    return dict(zip(KEYS, names, strict=True))[key]


DIAGNOSED_EVERY = (1, 5, 10, 20)
"""One row in so many is kept for the diagnosis: 1000, 200, 100 and 50 Hz."""

CUT_OFF = 0.4
MOST_HZ = 40.0
"""Cut-off over the kept rate, and its largest value; zero-phase Butterworth filter of fourth order."""

QUICK = Options(quick=True)
"""Options of the first search alone; the page of rigs has both."""

FILES = {
    "no Coulomb friction, no offset": {COULOMB: 0.0, OFFSET: 0.0},
    "no friction at all, no offset": {COULOMB: 0.0, OFFSET: 0.0, VISCOUS: 0.0},
}


def diagnose_all(runs: Recordings, tick: Tick = ignore_progress) -> pd.DataFrame:
    """Diagnose at each rate, raw and filtered, with the second recording held out.

    Returns:
        A row each: verdict, effects, and the errors of the corrected ship on the second recording at
        1 kHz.
    """
    rows = []
    tried = [(f, e, k) for f in FILES for e in DIAGNOSED_EVERY for k in ("raw", "filtered")]
    for count, (file, every, kind) in enumerate(tried):
        tick("diagnosing", count, len(tried))
        ship = rig().with_values({**PUBLISHED, **FILES[file]})
        estimation, validation = (
            _logged(table, every, kind == "filtered")
            for table in (runs.estimation, runs.validation)
        )
        found = diagnose(ship, estimation, hold_out=[validation], options=QUICK)
        position, velocity = errors(found.corrected, runs.validation)
        rows.append(
            {
                "file": file,
                "rate_Hz": 1000 // every,
                "recording": kind,
                "verdict": found.verdict,
                "named": ", ".join(
                    f"{f.effect.id} {f.estimates[0].value:.4g}" for f in found.findings
                ),
                "judged_to_Hz": found.highest_Hz,
                "demands": "lines" if found.line else "held",
                "validation_mm": position,
                "validation_velocity_percent": velocity,
            }
        )
    tick("diagnosing", len(tried), len(tried))
    return pd.DataFrame(rows)


def _logged(table: pd.DataFrame, every: int, filtered: bool) -> pd.DataFrame:
    if filtered:
        low = scipy.signal.butter(
            4, min(CUT_OFF * 1000.0 / every, MOST_HZ), output="sos", fs=1000.0
        )
        table = table.assign(
            **{
                c: scipy.signal.sosfiltfilt(low, table[c].to_numpy())
                for c in table
                if c != "time_s"
            }
        )
    return table.iloc[::every].reset_index(drop=True)
