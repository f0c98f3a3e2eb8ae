"""Whether something in a recording moves enough to tell one effect from another."""

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

TURNED = math.radians(30.0)
"""Change of heading beyond which a recording turns: a current from ahead is a seventh weaker then."""

DULL_SHARE = 0.05
"""Demands and loads that move over less than this share of their size tell no effect from another."""


def moves(values: NDArray[np.float64]) -> bool:
    """Whether a signal, shape (rows,), moves enough, its rarest values left out."""
    size = float(np.abs(values).max())
    return bool(np.ptp(np.quantile(values, [0.02, 0.98])) > DULL_SHARE * max(size, 1e-12))


def helm_column(ship: Ship, table: pd.DataFrame) -> str | None:
    """Column that orders the rudder of a ship that turns: the command, or else the angle itself."""
    helms = (column for column in (RUDDER_COMMAND, RUDDER) if ship.turns and column in table)
    return next(helms, None)


def turned(tables: Iterable[pd.DataFrame]) -> bool:
    """Whether recordings turn, by their headings or else their rates of turn.

    Args:
        tables: with canonical columns; on a ship that does not turn under the names that terms hear.
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
        if np.abs(np.angle(np.exp(1j * apart))).max() > TURNED:
            return True
    return False


def one_way(ship: Ship, tables: Iterable[pd.DataFrame]) -> bool:
    """Whether the shaft of recordings turns, and is driven, one way only.

    Args:
        ship: the ship.
        tables: with canonical columns.
    """
    ends = []
    for table in tables:
        for column in {drive_column(ship), SHAFT_SPEED} & set(table):
            values = table[column].to_numpy(dtype=np.float64)
            low, high = float(values.min()), float(values.max())
            size = DULL_SHARE * max(abs(low), abs(high))
            ends.append((low < -size, high > size))
    return not (any(low for low, _ in ends) and any(high for _, high in ends))


def loaded(ship: Ship, table: pd.DataFrame) -> bool:
    """Whether what loads the propeller moves, whatever the orders do.

    A measured inflow, a surface that comes within a diameter of the propeller's centre, on a shaft whose
    speed is held the ship's speed, on one that turns her rudder, and any column that is none of the
    tool's own, such as a wind's.

    Args:
        ship: the ship.
        table: canonical columns.
    """
    return any(moves(table[name].to_numpy(dtype=np.float64)) for name in _loads(ship, table))


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
