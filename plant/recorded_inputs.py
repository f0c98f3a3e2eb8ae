"""The inputs of a recording, row by row: demands, and what the water does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from .columns import TIME, drive_column
from .hull import wake_inflow, water_speed
from .recording import RecordingError
from .ship import Ship

WATER = ("propeller_submergence_m", "inflow_velocity_m_s")
"""Columns of what the water does, which act where a recording has them."""


@compiled
def _fill_inflow(
    plant: Record, ship_speed: NDArray[np.float64], inflow: NDArray[np.float64]
) -> None:
    """Advance velocity [m/s] in the wake at each ship speed [m/s]; ``inflow`` filled."""
    for k in range(len(ship_speed)):
        inflow[k] = wake_inflow(plant, water_speed(plant, ship_speed[k]))


class RecordedInputs:
    """Inputs of a ship at the rows of a recording.

    Args:
        ship: the ship.
        table: canonical columns at an even interval, all finite.

    Raises:
        RecordingError: a column that is missing or not finite, too few rows, a time that falls, or a
            measured inflow at a hull that moves without a ship speed beside it.
    """

    def __init__(self, ship: Ship, table: pd.DataFrame) -> None:
        self.ship = ship
        self.table = table
        time = self._column(TIME)
        self.rows = len(time)
        if self.rows < 2 or not (np.diff(time) > 0.0).all():
            raise RecordingError(f"{TIME}: at least two rows are needed, and time must rise")
        self.interval_s = float((time[-1] - time[0]) / (self.rows - 1))
        self.time_s = time - time[0]
        self.drive_rows = self._column(drive_column(ship))
        self.command = np.full(self.rows, ship.propeller.pitch_ratio_max)
        if ship.has_variable_pitch and "pitch_ratio_command" in table:
            self.command = self._column("pitch_ratio_command")
        self.elevation_rows = np.zeros(self.rows)
        if WATER[0] in table:
            self.elevation_rows = self._column(WATER[0]) - ship.propeller.depth_m
        self._met = self._column(WATER[1]) if WATER[1] in table else None
        self._speed = np.zeros(self.rows)
        if self._met is not None and ship.moves:
            if "ship_speed_m_s" not in table:
                raise RecordingError("inflow_velocity_m_s asks for ship_speed_m_s beside it")
            self._speed = self._column("ship_speed_m_s")

    def _column(self, name: str, count: int | None = None) -> NDArray[np.float64]:
        """The first values of a column, all by default; what follows them is not looked at."""
        if name not in self.table:
            raise RecordingError(f"column {name!r} is missing; found: {', '.join(self.table)}")
        values = np.asarray(self.table[name], dtype=np.float64)[:count]
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise RecordingError(f"{name}, row {row + 1}: {values[row]} is not a finite number")
        return values

    def inflow_rows(self, plant: Any) -> NDArray[np.float64]:
        """Disturbance u_x [m/s] at the rows that brings the inflow to the measured one; else 0.

        Args:
            plant: ship record.
        """
        if self._met is None:
            return np.zeros(self.rows)
        nominal = np.empty(self.rows)
        _fill_inflow(plant, self._speed, nominal)
        return np.asarray(self._met - nominal)
