"""Read tables of runs and logs: columns by name and unit, values checked against a range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import FileError
from ..core.tables import LayoutError, read_text_table
from ..plant.surroundings import KNOT


class TableError(ValueError):
    """A table or a ship file of the trade cannot be used."""


class Column(NamedTuple):
    """Column of a table."""

    names: tuple[str, ...]
    """Names without unit, the first is the canonical one."""
    units: Mapping[str, float]
    """Accepted units with their factor to SI; the first one is assumed where the table names none."""
    default: float | None
    """Value of a table without this column; None if it is needed."""
    low: float
    high: float
    """Range in SI."""


DEGREES = {"deg": math.pi / 180.0, "°": math.pi / 180.0, "rad": 1.0}
METRES = {"m": 1.0, "ft": 0.3048}
SPEEDS = {
    **dict.fromkeys(("kn", "kt", "kts", "knots", "knot"), KNOT),
    "m/s": 1.0,
    "km/h": 1.0 / 3.6,
}
POWERS = {"kW": 1e3, "MW": 1e6, "W": 1.0, "hp": 745.6999}


TEXT_ENDINGS = (".csv", ".tsv", ".txt")
"""Endings of the tables of a folder."""


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a text table with its names and units as they stand.

    Args:
        path: CSV or similar text table; separator, decimal sign and unit rows are recognised. The tables
            of a folder, such as monthly logs, become one table in the order of the file names. A row
            that several of them have counts once.

    Raises:
        TableError: a file cannot be read, or the files of a folder have different columns.
    """
    path = Path(path)
    if not path.is_dir():
        return _read_file(path)
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in TEXT_ENDINGS)
    if not files:
        raise TableError(f"{path}: no table in this folder; expected {', '.join(TEXT_ENDINGS)}")
    tables = [_read_file(file) for file in files]
    for file, table in zip(files, tables, strict=True):
        if other := sorted(set(map(str, table.columns)) ^ set(map(str, tables[0].columns))):
            raise TableError(
                f"{file}: other columns than {files[0].name}: {', '.join(other)}; a folder needs tables "
                "with the same columns"
            )
    return pd.concat(tables, ignore_index=True).drop_duplicates(ignore_index=True)


def _read_file(path: Path) -> pd.DataFrame:
    try:
        return read_text_table(path)
    except (LayoutError, FileError, OSError) as error:
        raise TableError(f"{path}: {error}") from None


def canonical(
    table: pd.DataFrame, columns: Mapping[str, Column], source: str, gaps: bool = False
) -> pd.DataFrame:
    """Return a table in SI units with one column for each quantity.

    A column ``time`` of dates becomes seconds since the first row, and the dates stand in ``stamp``.

    Args:
        table: table with names such as ``SOG [kn]`` or ``shaft_power_kW``; other columns are ignored.
        columns: known columns by quantity.
        source: name of the table in messages.
        gaps: whether a cell may be empty or no number, and then becomes nan.

    Raises:
        TableError: a column is missing, read twice, or has a value outside its range.
    """
    known: dict[str, tuple[str, float]] = {}
    for name in map(str, table.columns):
        match = _quantity(name, columns)
        if match is None:
            continue
        quantity, factor = match
        if quantity in known:
            raise TableError(
                f"{source}: columns {known[quantity][0]!r} and {name!r} are both read as {quantity}; "
                "remove or rename one of them"
            )
        known[quantity] = (name, factor)
    result = pd.DataFrame(index=range(len(table)))
    for quantity, column in columns.items():
        if quantity in known:
            name, factor = known[quantity]
            cells = table[name].reset_index(drop=True)
            where = f"{source}: column {name!r}"
            stamps = _dates(cells) if quantity == "time" else None
            if stamps is not None:
                result["stamp"] = stamps
                result[quantity] = (stamps - stamps.iloc[0]).dt.total_seconds()
            else:
                result[quantity] = _values(cells, column, factor, where, gaps)
        elif column.default is not None:
            result[quantity] = column.default
        else:
            raise TableError(
                f"{source}: no column is read as {quantity}; name it {' or '.join(column.names)} with "
                f"its "
                f"unit ({', '.join(column.units)}), such as {quantity}_{next(iter(column.units))}. The "
                f"file "
                f"has: {', '.join(map(str, table.columns))}"
            )
    return result


def _dates(cells: pd.Series) -> pd.Series | None:
    """Return cells as dates; None if they are numbers or no dates."""
    if pd.api.types.is_numeric_dtype(cells) or pd.to_numeric(cells, errors="coerce").notna().all():
        return None
    stamps = pd.to_datetime(cells, errors="coerce", format="mixed", dayfirst=_day_first(cells))
    return stamps if stamps.notna().all() else None


def _day_first(cells: pd.Series) -> bool:
    """Return whether dates are written as dd.mm.yyyy or dd/mm/yyyy: a first number above 12 occurs."""
    first = cells.astype(str).str.extract(r"^\s*(\d{1,2})[./]\d{1,2}[./]\d{4}")[0]
    dotted = cells.astype(str).str.contains(r"^\s*\d{1,2}\.\d{1,2}\.\d{4}").all()
    return bool(dotted or (pd.to_numeric(first, errors="coerce") > 12).any())


def _values(
    cells: pd.Series, column: Column, factor: float, where: str, gaps: bool
) -> NDArray[np.float64]:
    values = np.array(pd.to_numeric(cells, errors="coerce"), dtype=float) * factor
    for row, value in enumerate(values):
        if not math.isfinite(value):
            if not gaps:
                raise TableError(
                    f"{where}, row {row + 1}: {str(cells.iloc[row])!r} is not a number"
                )
            values[row] = math.nan
        elif not column.low <= value <= column.high:
            raise TableError(
                f"{where}, row {row + 1}: {cells.iloc[row]} is outside {column.low / factor:g} to "
                f"{column.high / factor:g}; is the unit right?"
            )
    return values


def _quantity(name: str, columns: Mapping[str, Column]) -> tuple[str, float] | None:
    """Return quantity and factor to SI of a column name; None for a name that is no quantity."""
    text = name.strip()
    if text.endswith((")", "]")):
        start = max(text.rfind("("), text.rfind("["))
        stem, unit = text[:start], text[start + 1 : -1].strip()
    else:
        stem, _, unit = text.rpartition("_")
        if not any(_is_unit(unit, one) for column in columns.values() for one in column.units):
            stem, unit = text, ""
    plain = "_".join(stem.lower().replace("-", " ").replace("_", " ").split())
    for quantity, column in columns.items():
        if plain not in column.names:
            continue
        if not unit:
            return quantity, next(iter(column.units.values()))
        for known, factor in column.units.items():
            if _is_unit(unit, known):
                return quantity, factor
        raise TableError(
            f"column {name!r}: unit {unit!r} of {quantity} is not known; use {', '.join(column.units)}"
        )
    return None


def _is_unit(unit: str, known: str) -> bool:
    return unit.lower() == known.lower()
