"""Identify and diagnose a positioning system, and evaluate the result on a held-out recording.

Two recordings of 24.84 s at 1 kHz (Janot, Gautier & Brunot, nonlinearbenchmark.org): force and encoder.
The first is fitted; the second is held out and simulated open loop from its force alone.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.mismatch import Options, diagnose, identify, load_recording
from shaftline.plant import Ship, load_ship
from shaftline.plant.replay import simulate_recording

from ..writing import rms

HOME = Path(__file__).parent
MASS = "transmission.inertia_engine_side_kg_m2"
VISCOUS = "transmission.viscous_friction_engine_side_N_m_s_rad"
COULOMB = "transmission.coulomb_friction_engine_side_N_m"
OFFSET = "prime_mover.torque_offset_N_m"
STICTION = "transmission.stiction_speed_rad_s"
KEYS = (MASS, VISCOUS, COULOMB, OFFSET)
NAMES = dict(zip(KEYS, ("mass_kg", "viscous_N_s_m", "coulomb_N", "offset_N"), strict=True))
"""Columns of the table by key."""

PUBLISHED = dict(zip(KEYS, (95.11, 203.5, 20.4, 3.2), strict=True))
"""[kg, N s/m, N, N]; their offset opposes the force, ours is added by the drive."""

FAR_OFF = {MASS: 60.0, VISCOUS: 300.0, COULOMB: 30.0}
STARTS: dict[str, dict[str, float]] = {"as in the file": {}, "far off": FAR_OFF}
EVERY = (1, 5, 20)
"""One row in so many is kept for the identification: 1000, 200 and 50 Hz, without a filter."""

STICTIONS = (0.0005, 0.001, 0.002)
"""Speeds below which friction sticks [m/s]; not published, so several are tried."""

POSITION = "shaft_angle_rad"
SMOOTHED_HZ = 20.0
"""Velocities are low-passed (zero-phase Butterworth of fourth order), then differentiated."""


class Recordings(NamedTuple):
    """Both recordings with canonical columns."""

    estimation: pd.DataFrame
    validation: pd.DataFrame


def rig() -> Ship:
    """Return the positioning system as a drive with a load and rough parameters."""
    return load_ship(HOME / "emps.toml")


def load_runs(folder: Path) -> Recordings:
    """Return both recordings of a folder: ``estimation.csv`` and ``validation.csv``."""
    files = (folder / f"{name}.csv" for name in Recordings._fields)
    return Recordings(*(load_recording(f, rig(), HOME / "columns.toml").table for f in files))


def errors(ship: Ship, recording: pd.DataFrame) -> tuple[float, float]:
    """Return the rms position error [mm] and the relative rms velocity error [%], open loop."""
    found = simulate_recording(ship, recording)[POSITION].to_numpy()
    measured = recording[POSITION].to_numpy()
    off, velocity = _velocity(found) - _velocity(measured), _velocity(measured)
    return 1e3 * rms(found - measured), 100.0 * rms(off) / rms(velocity)


def _low_passed(values: NDArray[np.float64], cut_off_Hz: float) -> NDArray[np.float64]:
    """Return values at 1 kHz after a zero-phase Butterworth filter of fourth order."""
    low = scipy.signal.butter(4, cut_off_Hz, output="sos", fs=1000.0)
    return np.asarray(scipy.signal.sosfiltfilt(low, values))


def _velocity(position: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.gradient(_low_passed(position, SMOOTHED_HZ), 1e-3))


def identify_all(runs: Recordings) -> pd.DataFrame:
    """Identify the parameters from each start, at each rate and with each sticking speed.

    A row has parameters, standard errors, differences from the published values [%], and the errors on
    both recordings at 1 kHz.
    """
    rows = []
    for start, every, stiction in itertools.product(STARTS, EVERY, STICTIONS):
        print(f"identifying: {start}, {1000 // every} Hz, {stiction:g} m/s", flush=True)
        ship = rig().with_values({**STARTS[start], STICTION: stiction})
        kept, judged = (table.iloc[::every].reset_index(drop=True) for table in runs)
        found = identify(ship, kept, free=KEYS, hold_out=[judged])
        case = {"start": start, "rate_Hz": 1000 // every, "stiction_m_s": stiction}
        deviations = {f"se_{NAMES[e.key]}": e.standard_error for e in found.estimates}
        rows.append(case | _row(found.identified, runs) | deviations)
    return pd.DataFrame(rows)


def references(runs: Recordings) -> pd.DataFrame:
    """Return the errors of the published parameters, and the least position error of four parameters."""
    published = rig().with_values(PUBLISHED)
    less = published.with_values({OFFSET: 0.0})
    tried = {
        "published, mass and viscous friction alone": less.with_values({COULOMB: 0.0}),
        "published, without the offset": less,
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

    start = np.ones(len(KEYS))
    return at(scipy.optimize.least_squares(residuals, start, diff_step=1e-3 * start).x)


def _row(ship: Ship, runs: Recordings) -> dict[str, float]:
    values = {key: ship.parameter(key).value for key in KEYS}
    row = {NAMES[key]: value for key, value in values.items()}
    for key in KEYS[:3]:
        row[f"{NAMES[key]}_off_percent"] = 100.0 * (values[key] / PUBLISHED[key] - 1.0)
    for name, recording in runs._asdict().items():
        row[f"{name}_mm"], row[f"{name}_velocity_percent"] = errors(ship, recording)
    return row


DIAGNOSED_EVERY = (1, 5, 10, 20)
"""One row in so many is kept for the diagnosis: 1000, 200, 100 and 50 Hz."""

KINDS = ("raw", "filtered")
CUT_OFF = 0.4
MOST_HZ = 40.0
"""Cut-off over the kept rate, and its largest value; zero-phase Butterworth filter of fourth order."""

FILES = {
    "no Coulomb friction, no offset": {COULOMB: 0.0, OFFSET: 0.0},
    "no friction at all, no offset": {COULOMB: 0.0, OFFSET: 0.0, VISCOUS: 0.0},
}


def diagnose_all(runs: Recordings) -> pd.DataFrame:
    """Diagnose at each rate, raw and filtered, with the second recording held out.

    A row has verdict, effects, and the errors of the corrected ship on the second recording at 1 kHz.
    """
    rows = []
    for file, every, kind in itertools.product(FILES, DIAGNOSED_EVERY, KINDS):
        print(f"diagnosing: {file}, {1000 // every} Hz, {kind}", flush=True)
        ship = rig().with_values({**PUBLISHED, **FILES[file]})
        estimation, validation = (_logged(table, every, kind == "filtered") for table in runs)
        found = diagnose(ship, estimation, hold_out=[validation], options=Options(quick=True))
        position, velocity = errors(found.corrected, runs.validation)
        said = [f"{f.effect.id} {f.estimates[0].value:.4g}" for f in found.findings]
        rows.append(
            {
                "file": file,
                "rate_Hz": 1000 // every,
                "recording": kind,
                "verdict": found.verdict,
                "named": ", ".join(said),
                "judged_to_Hz": found.highest_Hz,
                "demands": "lines" if found.line else "held",
                "validation_mm": position,
                "validation_velocity_percent": velocity,
            }
        )
    return pd.DataFrame(rows)


def _logged(table: pd.DataFrame, every: int, filtered: bool) -> pd.DataFrame:
    """Return one row in so many, of channels that are low-passed before if wanted."""
    if filtered:
        cut_off = min(CUT_OFF * 1000.0 / every, MOST_HZ)
        channels = [c for c in table if c != "time_s"]
        table = table.assign(**{c: _low_passed(table[c].to_numpy(), cut_off) for c in channels})
    return table.iloc[::every].reset_index(drop=True)
