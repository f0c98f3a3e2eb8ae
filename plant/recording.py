"""Recordings: how their tables are read and checked, and the inputs that each row gives a ship."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import FileError, SizeError, check_size, reason_of, refuse_special
from ..core.models import short
from ..core.tables import LayoutError, read_sheet, read_text_table
from .columns import BOUNDS, TIME, drive_column
from .hull import wake_inflow, water_speed
from .ship import Ship

WATER = ("propeller_submergence_m", "inflow_velocity_m_s")
"""Columns of the water, which act if a recording has them."""


class RecordedInputs:
    """Inputs of a ship at the rows of a recording.

    Args:
        ship: the ship.
        table: canonical columns at an even interval, all finite.

    Raises:
        RecordingError: a column is missing or not finite, there are too few rows, the time does not
            rise, or a moving hull has a measured inflow but no ship speed.
    """

    def __init__(self, ship: Ship, table: pd.DataFrame) -> None:
        self.ship = ship
        self.table = table
        time = self._column(TIME)
        self.rows = len(time)
        if self.rows < 2 or not (np.diff(time) > 0.0).all():
            raise RecordingError(f"{TIME}: needs at least two rows with rising time")
        self.interval_s = float((time[-1] - time[0]) / (self.rows - 1))
        self.time_s = time - time[0]
        self.drive_rows = self._column(drive_column(ship))
        self.command = np.full(self.rows, float(ship.propeller.pitch_ratio_max))
        if ship.has_variable_pitch and "pitch_ratio_command" in table:
            self.command = self._column("pitch_ratio_command")
        self.elevation_rows = np.zeros(self.rows)
        if WATER[0] in table:
            self.elevation_rows = self._column(WATER[0]) - ship.propeller.depth_m
        self._met = self._column(WATER[1]) if WATER[1] in table else None
        self._speed = np.zeros(self.rows)
        if self._met is not None and ship.moves:
            if "ship_speed_m_s" not in table:
                needed = "needs the column ship_speed_m_s, because the hull moves"
                raise RecordingError(f"{WATER[1]} {needed}")
            self._speed = self._column("ship_speed_m_s")

    def _column(self, name: str, count: int | None = None) -> NDArray[np.float64]:
        """Return the first ``count`` values of a column, by default all of them."""
        if name not in self.table:
            known = ", ".join(self.table)
            raise RecordingError(f"column {name!r} is missing; the recording has: {known}")
        values = np.asarray(self.table[name], dtype=np.float64)[:count]
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise RecordingError(f"{name}, row {row + 1}: {values[row]} is not a finite number")
        return values

    def inflow_rows(self, plant: Any) -> NDArray[np.float64]:
        """Return the disturbance u_x [m/s] at the rows that reproduces the measured inflow, or 0."""
        if self._met is None:
            return np.zeros(self.rows)
        nominal = wake_inflow(plant, water_speed(plant, self._speed))
        return np.asarray(self._met - nominal)


PARQUET = (".parquet", ".pq")
SHEETS = (".xlsx", ".xls", ".xlsm", ".xlsb", ".ods")
"""File endings of spreadsheets."""


class RecordingError(ValueError):
    """A recording that cannot be used; the message names file, column, row and error."""


def read_recording(
    path: str | Path, required: list[str], signals: Mapping[str, str] = MappingProxyType({})
) -> pd.DataFrame:
    """Read and check a recording.

    Args:
        path: CSV or Parquet file with a header of canonical columns (name and unit, such as
            ``fuel_rack_mm``).
        required: columns that must be present.
        signals: units of further known columns, by name: the external signals of a ship's terms.

    Returns:
        The table as floats; unknown columns are kept unchanged.

    Raises:
        RecordingError: the file is unreadable, a column is missing, a value is not a finite number or
            outside its signal's bounds, or the time does not rise evenly. Rows count from 1 below the
            header.
    """
    path = Path(path)
    table = convert_numbers(path, read_table(path), required, signals)
    check_bounds(path, table)
    _check_time(path, table[TIME].to_numpy())
    return table


def read_table(path: Path, layout: Mapping[str, object] = MappingProxyType({})) -> pd.DataFrame:
    """Return the raw table of a text file, a spreadsheet or a Parquet file.

    ``layout`` holds known properties of a text file, as in :class:`shaftline.core.tables.Layout`; the
    others are guessed.

    Raises:
        RecordingError: the file cannot be read, or the reader of its format is not installed.
    """
    parquet, sheet = path.suffix.lower() in PARQUET, path.suffix.lower() in SHEETS
    try:
        refuse_special(path)
        # Numbers need about as much memory as their text; a compressed table needs more.
        check_size(path.stat().st_size, 10.0 if parquet else 2.0, f"bytes of {path}")
        if parquet:
            return pd.read_parquet(path)
        read = read_sheet if sheet else read_text_table
        table = read(path, dict(layout), as_logged=True)
        for column in (c for c in BOUNDS if f"{c} (2)" in table):
            raise LayoutError(
                f"column {column!r} occurs twice; rename or drop one of the two columns"
            )
        return table
    except ImportError:
        needs = "a Parquet file needs pyarrow" if parquet else "a spreadsheet needs python-calamine"
        extra = "parquet" if parquet else "excel"
        raise RecordingError(f"{path}: {needs}: pip install 'shaftline[{extra}]'") from None
    except (SizeError, FileError) as error:
        raise RecordingError(str(error)) from None
    except LayoutError as error:
        raise RecordingError(f"{path}: {error}") from None
    except (OSError, ValueError) as error:  # pandas and pyarrow raise subclasses of ValueError
        kind = "Parquet" if parquet else "a spreadsheet" if sheet else "CSV"
        raise RecordingError(f"{path}: cannot be read as {kind}: {reason_of(error)}") from None


def convert_numbers(
    path: Path,
    table: pd.DataFrame,
    required: list[str],
    signals: Mapping[str, str] = MappingProxyType({}),
) -> pd.DataFrame:
    """Return a copy whose known columns are finite floats.

    The path is for messages; ``required`` columns must be present; ``signals`` are units of further
    known columns.

    Raises:
        RecordingError: a required column is missing, there are fewer than two rows, or a value is not a
            finite number.
    """
    missing = [column for column in required if column not in table.columns]
    if missing:
        raise RecordingError(
            f"{path}: column {missing[0]!r} is missing; required: {', '.join(required)}; "
            f"found: {', '.join(map(str, table.columns))}"
        )
    if len(table) < 2:
        raise RecordingError(f"{path}: {len(table)} row(s); at least 2 are needed")
    table = table.copy()
    units = {c: unit for c, (_, _, unit) in BOUNDS.items()} | dict(signals)
    for column in (c for c in table.columns if c in units):
        numbers = pd.to_numeric(table[column], errors="coerce").astype(float)
        bad = ~np.isfinite(numbers.to_numpy())
        bad |= pd.api.types.is_bool_dtype(table[column])  # A truth value is no measurement.
        if bad.any():
            row = int(np.argmax(bad))
            given = table[column].iloc[row]
            shown = short(given) if isinstance(given, str) else given
            raise RecordingError(
                f"{path}: {column}, row {row + 1}: {shown} is not a finite number ({bad.sum()} of "
                f"{len(table)} rows; unit {units[column]}); correct the cell, or clear it if the value "
                "is missing"
            )
        table[column] = numbers
    return table


def within_bounds(column: str, values: pd.Series) -> NDArray[np.bool_]:
    """Return which values lie within the physical :data:`BOUNDS` of a column; all if it has none."""
    low, high, _ = BOUNDS.get(column, (-np.inf, np.inf, ""))
    return np.asarray(values.between(low, high))


def check_bounds(path: Path, table: pd.DataFrame) -> None:
    """Refuse a value outside the physical :data:`BOUNDS` of its column with a RecordingError."""
    for column in (c for c in table.columns if c in BOUNDS):
        low, high, unit = BOUNDS[column]
        outside = ~within_bounds(column, table[column])
        if outside.any():
            row = int(np.argmax(outside))
            raise RecordingError(
                f"{path}: {column}, row {row + 1}: {table[column].iloc[row]:g} {unit} lies outside "
                f"the physical range of {low:g} to {high:g} {unit}; check the unit"
            )


def _check_time(path: Path, time: np.ndarray[Any, Any]) -> None:
    steps = np.diff(time)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 2
        raise RecordingError(f"{path}: {TIME}, row {row}: the time does not rise; sort the rows")
    usual = float(np.median(steps))
    uneven = np.abs(steps - usual) > 0.01 * usual
    if uneven.any():
        row = int(np.argmax(uneven)) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: the step is {steps[row - 2]:g} s instead of {usual:g} s; "
            "resample the recording to an even time base"
        )
