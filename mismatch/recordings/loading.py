"""Whether something in a recording moves enough to tell one effect from another."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import COLUMNS
from ...plant.ship import Ship

DULL_SHARE = 0.05
"""Demands and loads that move over less than this share of their size tell no effect from another."""


def moves(values: NDArray[np.float64]) -> bool:
    """Whether a signal, shape (rows,), moves enough, its rarest values left out."""
    size = float(np.abs(values).max())
    return bool(np.ptp(np.quantile(values, [0.02, 0.98])) > DULL_SHARE * max(size, 1e-12))


def loaded(ship: Ship, table: pd.DataFrame) -> bool:
    """Whether what loads the propeller moves, whatever the orders do.

    A measured inflow, a surface that comes within a diameter of the propeller's centre, on a shaft whose
    speed is held the ship's speed, and any column that is none of the tool's own, such as a rudder's.

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
    yield from (name for name in table if name not in COLUMNS)
