"""An observer behind a whole series of readings: simulated, recorded, or columns of a table.

How well an estimate follows, and how much noise a signal carries.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.columns import drive_column
from ..plant.ship import Ship
from .base import Observer, ObserverError
from .records import ESTIMATE, READINGS, TRACKED, Measurement
from .registry import update
from .torque_curve import read_at_drive, torque_of_current, torque_of_drive


class Followed(NamedTuple):
    """What an observer makes of n readings, each of shape (n,)."""

    velocity: NDArray[np.float64]  # advance velocity [m/s]
    valid: NDArray[np.bool_]
    number: NDArray[np.float64]  # of the ship, in its key's unit; 0 where none is tracked
    deviation: NDArray[np.float64]  # its standard deviation


@compiled
def _follow(
    observer: Record, estimate: Record, readings: NDArray[np.float64], found: Followed
) -> None:
    for k in range(len(readings)):
        m = Measurement(
            readings[k, 0], readings[k, 1], readings[k, 2], readings[k, 3], readings[k, 4]
        )
        found.velocity[k] = update(observer, estimate, m)
        found.valid[k] = estimate.valid != 0
        found.number[k] = estimate.x[TRACKED]
        found.deviation[k] = math.sqrt(max(estimate.covariance[TRACKED, TRACKED], 0.0))


def follow(
    observer: Observer, ship: Ship, readings: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Let an observer follow a series of readings.

    Args:
        observer: from :func:`get_observer`.
        ship: the ship as the observer believes it to be.
        readings: shape (n, 5): omega [rad/s], M_m [N m], P/D [-], omega' [rad/s2], v_a [m/s]
            (the last for the oracle alone).
        dt: sample time [s].

    Returns:
        Estimated advance velocity [m/s] and validity, each of shape (n,).

    Raises:
        ObserverError: the ship lacks what the observer needs.
    """
    return follow_record(observer.discretise(ship, dt), readings)


def follow_record(
    observer: Any, readings: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The same for an OBSERVER record, whose beliefs may have been changed by hand.

    Args:
        observer: from :meth:`Observer.discretise`.
        readings: as for :func:`follow`.
    """
    found = _followed(observer, readings)
    return found.velocity, found.valid


def follow_number(
    observer: Observer, ship: Ship, readings: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The number of the ship that an observer tracks, as it follows a series of readings.

    Args:
        observer: one with ``tracks``.
        ship: as for :func:`follow`.
        readings: likewise.
        dt: likewise [s].

    Returns:
        Estimate of the number and its standard deviation in the unit of its key, each of shape (n,).

    Raises:
        ObserverError: an observer that tracks none, or a ship that lacks what it needs.
    """
    if not observer.tracks:
        raise ObserverError(f"observer {observer.name!r} tracks no number of the ship")
    found = _followed(observer.discretise(ship, dt), readings)
    return found.number, found.deviation


def _followed(observer: Any, readings: NDArray[np.float64]) -> Followed:
    n = len(readings)
    found = Followed(np.empty(n), np.empty(n, dtype=np.bool_), np.empty(n), np.empty(n))
    _follow(observer, np.zeros(1, ESTIMATE)[0], np.ascontiguousarray(readings), found)
    return found


def readings_of(samples: NDArray[Any], ship: Ship | None = None) -> NDArray[np.float64]:
    """The columns of :class:`Measurement` from simulated samples; shape (n, 5).

    Args:
        samples: SAMPLE array of shape (n,), of :func:`shaftline.plant.simulate`.
        ship: that was simulated. An electric drive without a torque gauge has its own torque read, less
            friction (:mod:`shaftline.observers.torque_curve`); without a ship it is the gauge's.
    """
    shaft_speed, torque = samples["measured_shaft_speed"], samples["measured_shaft_torque"]
    if ship is not None and read_at_drive(ship):
        torque = torque_of_drive(ship, samples["brake_torque"], shaft_speed)
    return np.column_stack(
        [
            shaft_speed,
            torque,
            samples["measured_pitch_ratio"],
            samples["shaft_acceleration"],
            samples["advance_velocity"],
        ]
    )


def _torque_read(ship: Ship, table: pd.DataFrame) -> Any:
    """Torque [N m] of a table's rows, at the gauge or at the drive.

    Raises:
        ObserverError: the column is missing.
    """
    column = READINGS[1]
    if read_at_drive(ship):
        column = "motor_current_A" if ship.has_voltage else drive_column(ship)
    if column not in table:
        raise ObserverError(f"{ship.name}: an observer needs the column {column}")
    torque = table[column].to_numpy(np.float64)
    if not read_at_drive(ship):
        return torque
    shaft_speed = table[READINGS[0]].to_numpy(np.float64)
    if ship.has_voltage:
        torque = torque_of_current(ship, torque, shaft_speed)
    return torque_of_drive(ship, torque, shaft_speed)


def follow_table(observer: Observer, ship: Ship, table: pd.DataFrame) -> pd.DataFrame:
    """A table with canonical columns, with an observer's estimate added.

    Args:
        observer: from :func:`get_observer`.
        ship: the ship as the observer believes it to be.
        table: even time base; acceleration and true advance velocity may be missing. An electric drive
            without a torque gauge is read by ``motor_torque_N_m`` or ``motor_current_A``.

    Returns:
        The table with ``estimated_advance_velocity_m_s`` and ``estimate_valid`` (0 or 1); of an observer
        that tracks a number also ``estimated_KEY`` and ``estimated_KEY_sd``.

    Raises:
        ObserverError: the ship or the table lacks what the observer needs.
    """
    unknown = np.full(len(table), np.nan)
    shaft_speed, _, pitch, acceleration = READINGS
    readings = np.column_stack(
        [
            table[shaft_speed],
            _torque_read(ship, table),
            table[pitch],
            table.get(acceleration, unknown),
            table.get("advance_velocity_m_s", unknown),
        ]
    )
    dt = float(np.median(np.diff(table["time_s"])))
    found = _followed(observer.discretise(ship, dt), readings)
    table = table.assign(
        estimated_advance_velocity_m_s=found.velocity, estimate_valid=found.valid.astype(int)
    )
    if observer.tracks:
        name = f"estimated_{observer.tracks}"
        table = table.assign(**{name: found.number, f"{name}_sd": found.deviation})
    return table


Floats = NDArray[np.float64]


def variance_accounted_for(truth: Floats, estimate: Floats) -> float:
    """VAF [%] = max(0, 1 - var(truth - estimate) / var(truth)) * 100 (thesis eq. 4-1).

    Args:
        truth: shape (n,).
        estimate: likewise, in the same unit.

    Returns:
        NaN where either holds one.
    """
    return max(1.0 - float(np.var(truth - estimate) / np.var(truth)), 0.0) * 100.0  # NaN stays


def with_noisy_readings(table: pd.DataFrame, snr_db: float, seed: int) -> pd.DataFrame:
    """The same run as noisy instruments would have recorded it; true quantities stay clean.

    Args:
        table: simulated run with the canonical columns.
        snr_db: signal-to-noise ratio of every reading [dB].
        seed: of the white noise.
    """
    clean = table[[*READINGS, "advance_velocity_m_s"]].to_numpy()
    noise = np.random.default_rng(seed).standard_normal(clean.shape)
    noisy = with_noise(clean, snr_db, noise)
    return table.assign(**dict(zip(READINGS, noisy.T[:-1], strict=True)))


def with_noise(readings: Floats, snr_db: float, noise: Floats) -> Floats:
    """Add white noise at a signal-to-noise ratio (thesis eq. 4-2).

    Args:
        readings: shape (n, 5), the columns of a Measurement; the last, the truth, stays clean.
        snr_db: 20 log10(rms(signal) / rms(noise)), the same for every column.
        noise: unit normal, the shape of ``readings``.
    """
    rms = np.sqrt(np.mean(readings**2, axis=0)) * 10.0 ** (-snr_db / 20.0)
    rms[-1] = 0.0
    return np.asarray(readings + noise * rms)
