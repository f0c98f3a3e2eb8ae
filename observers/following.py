"""An observer behind a whole series of readings: simulated, recorded, or columns of a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from ..plant.ship import Ship
from .base import ESTIMATE, READINGS, Measurement, Observer
from .registry import update


@compiled
def _follow(
    observer: Record,
    estimate: Record,
    readings: NDArray[np.float64],
    velocity: NDArray[np.float64],
    valid: NDArray[np.bool_],
) -> None:
    for k in range(len(readings)):
        m = Measurement(
            readings[k, 0], readings[k, 1], readings[k, 2], readings[k, 3], readings[k, 4]
        )
        velocity[k] = update(observer, estimate, m)
        valid[k] = estimate.valid != 0


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
    velocity = np.empty(len(readings))
    valid = np.empty(len(readings), dtype=np.bool_)
    estimate = np.zeros(1, ESTIMATE)[0]
    _follow(observer, estimate, np.ascontiguousarray(readings), velocity, valid)
    return velocity, valid


def readings_of(samples: NDArray[Any]) -> NDArray[np.float64]:
    """The columns of :class:`Measurement` from simulated samples; shape (n, 5)."""
    return np.column_stack(
        [
            samples["measured_shaft_speed"],
            samples["measured_shaft_torque"],
            samples["measured_pitch_ratio"],
            samples["shaft_acceleration"],
            samples["advance_velocity"],
        ]
    )


def follow_table(observer: Observer, ship: Ship, table: pd.DataFrame) -> pd.DataFrame:
    """A table with canonical columns, with an observer's estimate added.

    Args:
        observer: from :func:`get_observer`.
        ship: the ship as the observer believes it to be.
        table: even time base; acceleration and true advance velocity may be missing.

    Returns:
        The table with ``estimated_advance_velocity_m_s`` and ``estimate_valid`` (0 or 1).

    Raises:
        ObserverError: the ship lacks what the observer needs.
    """
    unknown = np.full(len(table), np.nan)
    *needed, acceleration = READINGS
    readings = np.column_stack(
        [
            *(table[name] for name in needed),
            table.get(acceleration, unknown),
            table.get("advance_velocity_m_s", unknown),
        ]
    )
    dt = float(np.median(np.diff(table["time_s"])))
    velocity, valid = follow(observer, ship, readings, dt)
    return table.assign(estimated_advance_velocity_m_s=velocity, estimate_valid=valid.astype(int))
