"""Run an observer over a series of measurements; add noise to measurements; score estimates."""

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
from .records import ESTIMATE, READINGS, TRACKED, Floats, Measurement
from .registry import update
from .torque_curve import torque_of_current, torque_of_drive, uses_drive_torque


class Estimates(NamedTuple):
    """Estimates of an observer over n measurements, each of shape (n,)."""

    velocity: Floats  # advance velocity [m/s]
    valid: NDArray[np.bool_]
    parameter: Floats  # ship parameter in the unit of its key; 0 if none is estimated
    deviation: Floats  # its standard deviation


@compiled
def _follow(observer: Record, estimate: Record, measurements: Floats, found: Estimates) -> None:
    for k in range(len(measurements)):
        row = measurements[k]
        m = Measurement(row[0], row[1], row[2], row[3], row[4])
        found.velocity[k] = update(observer, estimate, m)
        found.valid[k] = estimate.valid != 0
        found.parameter[k] = estimate.x[TRACKED]
        found.deviation[k] = math.sqrt(max(estimate.covariance[TRACKED, TRACKED], 0.0))


def follow(
    observer: Observer, ship: Ship, measurements: Floats, dt: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Run an observer over a series of measurements.

    Args:
        observer: from :func:`get_observer`.
        ship: ship model of the observer.
        measurements: shape (n, 5): omega [rad/s], M_m [N m], P/D [-], omega' [rad/s2], true v_a [m/s]
            (used by the oracle only).
        dt: sample time [s].

    Returns:
        Estimated advance velocity [m/s] and validity, each of shape (n,).

    Raises:
        ObserverError: the observer cannot be used on this ship.

    Example:
        >>> import numpy as np
        >>> from shaftline.observers import get_observer
        >>> from shaftline.plant import load_ship
        >>> steady = np.tile([10.0, 1.4e5, 1.3, 0.0, 0.0], (3, 1))
        >>> estimate, valid = follow(get_observer("luenberger"), load_ship("frigate"), steady, 0.05)
        >>> estimate.round(2).tolist(), valid.all().item()
        ([6.8, 6.8, 6.8], True)
    """
    return follow_record(observer.discretise(ship, dt), measurements)


def follow_record(observer: Any, measurements: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Run an observer that is given as a record, for example with a changed ship model.

    Args:
        observer: OBSERVER record of :meth:`Observer.discretise`.
        measurements: as in :func:`follow`, whose results are those of this function.
    """
    found = _estimate_series(observer, measurements)
    return found.velocity, found.valid


def follow_parameter(
    observer: Observer, ship: Ship, measurements: Floats, dt: float
) -> tuple[Floats, Floats]:
    """Return the ship parameter that an observer estimates over a series of measurements.

    The observer has ``tracks``, such as ``augmented-kalman``; arguments: see :func:`follow`.

    Returns:
        Estimate of the parameter and its standard deviation in the unit of its key, each of shape (n,).

    Raises:
        ObserverError: the observer estimates no parameter, or cannot be used on this ship.
    """
    if not observer.tracks:
        raise ObserverError(f"observer {observer.name!r} estimates no parameter of the ship")
    found = _estimate_series(observer.discretise(ship, dt), measurements)
    return found.parameter, found.deviation


def _estimate_series(observer: Any, measurements: Floats) -> Estimates:
    n = len(measurements)
    found = Estimates(np.empty(n), np.empty(n, dtype=np.bool_), np.empty(n), np.empty(n))
    _follow(observer, np.zeros(1, ESTIMATE)[0], np.ascontiguousarray(measurements), found)
    return found


def simulated_measurements(samples: NDArray[Any], ship: Ship | None = None) -> Floats:
    """Return the measurements of a simulation, shape (n, 5), with the columns of :class:`Measurement`.

    Args:
        samples: SAMPLE array of shape (n,), from :func:`shaftline.plant.simulate`.
        ship: simulated ship. With an electric drive and no shaft torque meter, the torque is that of the
            drive less friction (:mod:`shaftline.observers.torque_curve`), otherwise that of the meter.

    Example:
        >>> from shaftline.plant import Schedule, equilibrium, load_ship, simulate
        >>> frigate = load_ship("frigate")
        >>> start = equilibrium(frigate, 20.0, 1.3).state
        >>> samples = simulate(frigate, Schedule(20.0, 1.3), 1.0, initial=start)
        >>> simulated_measurements(samples, frigate).shape
        (21, 5)
    """
    shaft_speed, torque = samples["measured_shaft_speed"], samples["measured_shaft_torque"]
    if ship is not None and uses_drive_torque(ship):
        torque = torque_of_drive(ship, samples["brake_torque"], shaft_speed)
    rest = ("measured_pitch_ratio", "shaft_acceleration", "advance_velocity")
    return np.column_stack([shaft_speed, torque, *(samples[name] for name in rest)])


def _torque_of_table(ship: Ship, table: pd.DataFrame) -> Any:
    """Return the torque [N m] of the rows of a table, of the torque meter or of the drive."""
    column = READINGS[1]
    if electric := uses_drive_torque(ship):
        column = "motor_current_A" if ship.has_voltage else drive_column(ship)
    if column not in table:
        raise ObserverError(
            f"{ship.name}: an observer needs the column {column}; add it to the table"
        )
    torque = table[column].to_numpy(np.float64)
    if not electric:
        return torque
    shaft_speed = table[READINGS[0]].to_numpy(np.float64)
    if ship.has_voltage:
        torque = torque_of_current(ship, torque, shaft_speed)
    return torque_of_drive(ship, torque, shaft_speed)


def follow_table(observer: Observer, ship: Ship, table: pd.DataFrame) -> pd.DataFrame:
    """Add the estimate of an observer to a table with canonical columns.

    Args:
        observer: from :func:`get_observer`.
        ship: ship model of the observer.
        table: measurements at a constant sample time; acceleration and true advance velocity may be
            missing. For an electric drive without a shaft torque meter the torque is taken from
            ``motor_torque_N_m`` or ``motor_current_A``.

    Returns:
        The table with ``estimated_advance_velocity_m_s`` and ``estimate_valid`` (0 or 1), and with
        ``estimated_KEY`` and ``estimated_KEY_sd`` if the observer estimates the ship parameter KEY.

    Raises:
        ObserverError: the observer cannot be used on this ship, or a column is missing.

    Example:
        >>> import pandas as pd
        >>> from shaftline.observers import get_observer
        >>> from shaftline.plant import load_ship
        >>> table = pd.DataFrame({"time_s": [0.0, 0.05], "shaft_speed_rad_s": 10.0,
        ...                       "shaft_torque_N_m": 1.4e5, "pitch_ratio": 1.3})
        >>> table = follow_table(get_observer("power-balance"), load_ship("frigate"), table)
        >>> table["estimated_advance_velocity_m_s"].round(2).tolist()
        [6.8, 6.8]
    """
    unknown = np.full(len(table), np.nan)
    shaft_speed, _, pitch, acceleration = READINGS
    torque = _torque_of_table(ship, table)
    rest = [table.get(name, unknown) for name in (acceleration, "advance_velocity_m_s")]
    measurements = np.column_stack([table[shaft_speed], torque, table[pitch], *rest])
    dt = float(np.median(np.diff(table["time_s"])))
    found = _estimate_series(observer.discretise(ship, dt), measurements)
    table = table.assign(
        estimated_advance_velocity_m_s=found.velocity, estimate_valid=found.valid.astype(int)
    )
    if observer.tracks:
        name = f"estimated_{observer.tracks}"
        table = table.assign(**{name: found.parameter, f"{name}_sd": found.deviation})
    return table


def variance_accounted_for(truth: Floats, estimate: Floats) -> float:
    """Return VAF [%] = max(0, 1 - var(truth - estimate) / var(truth)) * 100 (thesis eq. 4-1).

    Args:
        truth: shape (n,).
        estimate: shape (n,), in the same unit.

    Returns:
        NaN if a value of either is NaN.

    Example:
        A constant error does not reduce the measure:

        >>> import numpy as np
        >>> truth = np.array([6.0, 7.0, 8.0, 7.0])
        >>> variance_accounted_for(truth, truth + 0.5)
        100.0
        >>> round(variance_accounted_for(truth, 0.9 * truth), 6)
        99.0
    """
    share = 1.0 - float(np.var(truth - estimate) / np.var(truth))
    return max(share, 0.0) * 100.0  # NaN remains NaN, because it is the first argument


def add_noise_to_table(table: pd.DataFrame, snr_db: float, seed: int) -> pd.DataFrame:
    """Add white noise to the measured columns of a simulated recording.

    Args:
        table: simulated recording with the canonical columns.
        snr_db: signal-to-noise ratio of every measured column [dB].
        seed: seed of the noise.

    Returns:
        The table with noise; true quantities are unchanged.
    """
    clean = table[[*READINGS, "advance_velocity_m_s"]].to_numpy()
    noise = np.random.default_rng(seed).standard_normal(clean.shape)
    noisy = add_noise(clean, snr_db, noise)
    return table.assign(**dict(zip(READINGS, noisy.T[:-1], strict=True)))


def add_noise(measurements: Floats, snr_db: float, noise: Floats) -> Floats:
    """Add white noise at a signal-to-noise ratio (thesis eq. 4-2).

    Args:
        measurements: shape (n, 5), the columns of a :class:`Measurement`; the last, the true advance
            velocity, is not changed.
        snr_db: 20 log10(rms(signal) / rms(noise)), the same for every column.
        noise: standard normal, the shape of ``measurements``.

    Example:
        >>> import numpy as np
        >>> clean = np.full((2, 5), 10.0)
        >>> add_noise(clean, 20.0, np.ones((2, 5)))[0].tolist()
        [11.0, 11.0, 11.0, 11.0, 10.0]
    """
    rms = np.sqrt(np.mean(measurements**2, axis=0)) * 10.0 ** (-snr_db / 20.0)
    rms[-1] = 0.0
    return np.asarray(measurements + noise * rms)
