"""Tables of orders as other programs write them: columns with their unit as suffix."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import FileError, read_toml
from .recording import RecordingError, read_table
from .ship import Ship, ShipError, validate_tables
from .surroundings import KNOT

TIMES = MappingProxyType({"time_s": 1.0, "time_min": 60.0, "time_h": 3600.0})
SPEED_ORDERS = MappingProxyType(
    {"speed_order_m_s": 1.0, "speed_order_kn": KNOT, "speed_order_km_h": 1.0 / 3.6}
)
LEVERS = MappingProxyType({"lever": 1.0, "lever_percent": 0.01})
_SHAFT_SPEEDS = MappingProxyType({"shaft_speed_rpm": 1.0, "shaft_speed_rad_s": 30.0 / math.pi})
"""Names of the columns of a quantity, each with the factor to its first unit."""


def find_column(path: Path, table: pd.DataFrame, names: Mapping[str, float]) -> str | None:
    """Return the one column of a quantity that a table has; None without any.

    Raises:
        RecordingError: the table has the quantity in two units.
    """
    found = [name for name in names if name in table]
    if len(found) > 1:
        raise RecordingError(f"{path}: {found[0]} and {found[1]} are the same quantity; keep one")
    return found[0] if found else None


def read_column(
    path: Path, table: pd.DataFrame, name: str, factor: float, limits: tuple[float, float]
) -> NDArray[np.float64]:
    """Return the values of a column, multiplied by a factor, shape (n,).

    Args:
        path: file, for messages.
        table: raw table.
        name: column.
        factor: factor to the unit of the result.
        limits: lowest and highest allowed value, in the unit of the result.

    Raises:
        RecordingError: a value is missing, no number, or out of range; rows count from 1 below the
            header.
    """
    given_values = pd.to_numeric(table[name], errors="coerce").to_numpy(np.float64)
    values: NDArray[np.float64] = given_values * factor
    low, high = limits
    for row in np.flatnonzero(~((values >= low) & (values <= high)))[:1]:
        given = table[name].iloc[row]
        shown = repr(given) if isinstance(given, str) else f"{given:g}"
        raise RecordingError(
            f"{path}: {name}, row {row + 1}: {shown} is not a number from {low / factor:.4g} to "
            f"{high / factor:.4g}; correct or remove the row, and check the unit in the column's name"
        )
    return values


def with_combinator_table(ship: Ship, path: str | Path) -> Ship:
    r"""Return a ship with the combinator table of a file.

    Args:
        ship: ship with a diesel.
        path: TOML file with the keys of the section ``[combinator]`` (or a ship file that has one), or a
            table with the columns ``lever``, ``lever_percent`` or ``speed_order_...``,
            ``shaft_speed_rpm`` or ``shaft_speed_rad_s``, and ``pitch_ratio``.

    Raises:
        ShipError: the file cannot be read, or a column is missing or wrong; names file, column and row.

    >>> import tempfile, pathlib
    >>> from shaftline.plant import load_ship
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "lever.csv"
    >>> _ = file.write_text("lever_percent,shaft_speed_rpm,pitch_ratio\n0,70,0.7\n100,130,1.3\n")
    >>> with_combinator_table(load_ship("frigate"), file).combinator.lever
    (0.0, 1.0)
    """
    path = Path(path)
    try:
        if path.suffix.lower() == ".toml":
            tree = read_toml(path)
            columns: dict[str, Any] = tree.get("combinator", tree)
            if not columns:
                raise ShipError(f"{path}: has no combinator table")
        else:
            columns = _columns_of(path, read_table(path))
    except (FileError, RecordingError) as error:
        raise ShipError(str(error)) from None
    tree = ship.model_dump(exclude_unset=True)
    return validate_tables(Ship, tree | {"combinator": columns}, str(path))


def _columns_of(path: Path, table: pd.DataFrame) -> dict[str, tuple[float, ...]]:
    columns = {}
    for names in (LEVERS, SPEED_ORDERS, _SHAFT_SPEEDS, {"pitch_ratio": 1.0}):
        if (name := find_column(path, table, names)) is not None:
            values = read_column(path, table, name, names[name], (0.0, math.inf))
            columns[next(iter(names))] = tuple(values.tolist())
    if not columns:
        raise RecordingError(
            f"{path}: no column of a combinator table; found: {', '.join(map(str, table))}; needed: "
            "lever or speed_order_m_s, shaft_speed_rpm, pitch_ratio"
        )
    return columns
