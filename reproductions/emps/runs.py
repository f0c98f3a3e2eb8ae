"""The positioning system's four numbers by ``identify``, and how far they carry a run never seen.

Two recordings of 24.84 s at 1 kHz (Janot, Gautier & Brunot, nonlinearbenchmark.org): force and encoder.
The first is fitted, the second judged: simulated open loop from its force alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.mismatch import identify, load_recording
from shaftline.mismatch.estimate import Tick, silent
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
"""[kg, N s/m, N, N]; their offset is what the force must overcome, ours what the drive adds."""

STARTS: dict[str, dict[str, float]] = {
    "as in the file": {},
    "far off": {MASS: 60.0, VISCOUS: 300.0, COULOMB: 30.0},
}
EVERY = (1, 5, 20)
"""Of the recording's rows, one in so many is kept: 1000, 200 and 50 Hz, nothing filtered."""

STICTIONS = (0.0005, 0.001, 0.002)
"""Speeds below which friction sticks [m/s]: nobody gives it, so all are tried."""

POSITION = "shaft_angle_rad"
SMOOTHED_HZ = 20.0
"""Velocities are compared below: zero-phase Butterworth of fourth order, then central differences."""


@dataclass(frozen=True)
class Recordings:
    """Both recordings as the tool reads them."""

    estimation: pd.DataFrame
    validation: pd.DataFrame


def rig() -> Ship:
    """The positioning system as a drive with a load, its numbers rough."""
    return load_ship(HOME / "emps.toml")


def load_runs(folder: Path) -> Recordings:
    """Both recordings.

    Args:
        folder: that holds ``estimation.csv`` and ``validation.csv``.
    """
    found = [
        load_recording(folder / f"{name}.csv", rig(), HOME / "columns.toml").table
        for name in ("estimation", "validation")
    ]
    return Recordings(*found)


def errors(ship: Ship, recording: pd.DataFrame) -> tuple[float, float]:
    """Position error, rms [mm], and velocity error, rms over rms [%], from the force alone."""
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


def identified(runs: Recordings, tick: Tick = silent) -> pd.DataFrame:
    """What ``identify`` finds from every start, at every rate, with every sticking speed.

    Returns:
        A row each: the numbers, their standard errors, how far they lie from the published ones [%],
        and the errors on both recordings at 1 kHz.
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


def yardsticks(runs: Recordings) -> pd.DataFrame:
    """The published numbers, all and in part, and the least position error that four numbers reach."""
    published = rig().with_values(PUBLISHED)
    tried = {
        "published, mass and viscous friction alone": published.with_values(
            {COULOMB: 0.0, OFFSET: 0.0}
        ),
        "published, without the offset": published.with_values({OFFSET: 0.0}),
        "published": published,
        "least position error on estimation": refitted(runs.estimation),
        "least position error on validation itself": refitted(runs.validation),
    }
    return pd.DataFrame([{"numbers": name} | _row(ship, runs) for name, ship in tried.items()])


def refitted(recording: pd.DataFrame) -> Ship:
    """The ship whose free-running position comes nearest to a recording, by plain least squares."""
    scale = np.array(list(PUBLISHED.values()))
    measured = recording[POSITION].to_numpy()

    def at(shares: NDArray[np.float64]) -> Ship:
        return rig().with_values(dict(zip(KEYS, map(float, shares * scale), strict=True)))

    def left(shares: NDArray[np.float64]) -> NDArray[np.float64]:
        found = simulate_recording(at(shares), recording)[POSITION].to_numpy()
        return np.asarray(1e3 * (found - measured)[::10])

    return at(
        scipy.optimize.least_squares(left, np.ones(len(KEYS)), diff_step=np.full(len(KEYS), 1e-3)).x
    )


def _row(ship: Ship, runs: Recordings) -> dict[str, float]:
    values = {key: ship.number(key).value for key in KEYS}
    row = {_short(key): value for key, value in values.items()}
    for key in KEYS[:3]:
        row[f"{_short(key)}_off_percent"] = 100.0 * (values[key] / PUBLISHED[key] - 1.0)
    for name, recording in (("estimation", runs.estimation), ("validation", runs.validation)):
        row[f"{name}_mm"], row[f"{name}_velocity_percent"] = errors(ship, recording)
    return row


def _short(key: str) -> str:
    names = ("mass_kg", "viscous_N_s_m", "coulomb_N", "offset_N")
    return dict(zip(KEYS, names, strict=True))[key]
