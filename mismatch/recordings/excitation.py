"""Measure whether commands, loads and course of a recording vary enough to identify effects."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import (
    COLUMNS,
    HEADING,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_SPEED,
    TIME,
    YAW_RATE,
    drive_column,
)
from ...plant.ship import Ship

COURSE_CHANGE = math.radians(30.0)
"""Change of heading [rad] from which a recording turns; it weakens a current from ahead by a seventh."""

LEAST_VARIATION = 0.05  # share of its size over which a command or a load must vary


def varies(values: NDArray[np.float64]) -> bool:
    """Return whether a signal, shape (rows,), varies enough between its 2nd and 98th percentile."""
    size = float(np.abs(values).max())
    return bool(np.ptp(np.quantile(values, [0.02, 0.98])) > LEAST_VARIATION * max(size, 1e-12))


def helm_column(ship: Ship, table: pd.DataFrame) -> str | None:
    """Return the rudder command of a ship that turns: its column, else the rudder angle, else None."""
    helms = (column for column in (RUDDER_COMMAND, RUDDER) if ship.turns and column in table)
    return next(helms, None)


def course_changes(tables: Iterable[pd.DataFrame]) -> bool:
    """Return whether recordings turn, by their headings or else their rates of turn.

    Example:
        >>> time = np.arange(5.0)
        >>> course_changes([pd.DataFrame({"time_s": time, "heading_rad": 0.2 * time})])
        True

    A ship without turning has the signals ``heading`` or ``yaw_rate``.
    """
    first: float | None = None
    for table in tables:
        known = [c for c in (HEADING, "heading") if c in table]
        rates = [c for c in (YAW_RATE, "yaw_rate") if c in table]
        if known:
            heading = table[known[0]].to_numpy(dtype=np.float64)
            first = heading[0] if first is None else first
            apart = heading - first
        elif rates:
            apart = np.cumsum(table[rates[0]].to_numpy()) * float(table[TIME].diff().mean())
        else:
            continue
        if np.abs(np.angle(np.exp(1j * apart))).max() > COURSE_CHANGE:
            return True
    return False


def shaft_runs_one_way(ship: Ship, tables: Iterable[pd.DataFrame]) -> bool:
    """Return whether shaft speed and drive command of all recordings keep one sign."""
    ends = []
    for table in tables:
        for column in {drive_column(ship), SHAFT_SPEED} & set(table):
            values = table[column].to_numpy(dtype=np.float64)
            low, high = float(values.min()), float(values.max())
            size = LEAST_VARIATION * max(abs(low), abs(high))
            ends.append((low < -size, high > size))
    return not (any(low for low, _ in ends) and any(high for _, high in ends))


def load_varies(ship: Ship, table: pd.DataFrame) -> bool:
    """Return whether the propeller load varies independently of the commands.

    Loads are: a measured inflow; the submergence, if it is less than a diameter; the ship speed, if the
    shaft speed is prescribed; the rudder of a ship that turns; and every signal that is no canonical
    column, such as wind.
    """
    return any(varies(table[name].to_numpy(dtype=np.float64)) for name in _loads(ship, table))


def _loads(ship: Ship, table: pd.DataFrame) -> Iterator[str]:
    if "inflow_velocity_m_s" in table:
        yield "inflow_velocity_m_s"
    depth = table.get("propeller_submergence_m")
    if depth is not None and ship.has_propeller and float(depth.min()) < ship.propeller.diameter_m:
        yield "propeller_submergence_m"
    if "ship_speed_m_s" in table and not ship.turns_freely:
        yield "ship_speed_m_s"
    if (helm := helm_column(ship, table)) is not None:
        yield helm
    yield from (name for name in table if name not in COLUMNS)
