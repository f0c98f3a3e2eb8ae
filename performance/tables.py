"""Read tables of runs and logs: columns by name and unit, values checked against a range."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import FileError
from ..core.tables import DATE_FORMAT, LayoutError, TextCells, read_text_table
from ..plant.columns import (
    COURSE,
    HEADING,
    OVER_GROUND,
    RUDDER,
    SHAFT_POWER,
    SHAFT_SPEED,
    SHIP_SPEED,
    TIME,
)
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
    substitutes: tuple[str, ...] = ()
    """Names of another quantity that stands in where no column has one of ``names``."""


DEGREES = {"deg": math.pi / 180.0, "°": math.pi / 180.0, "rad": 1.0}
METRES = {"m": 1.0, "ft": 0.3048}
SPEEDS = {
    **dict.fromkeys(("kn", "kt", "kts", "knots", "knot"), KNOT),
    "m/s": 1.0,
    "km/h": 1.0 / 3.6,
}
POWERS = {"kW": 1e3, "MW": 1e6, "W": 1.0, "hp": 745.6999}


WIND_ANGLES = (
    "wind_angle",
    "relative_wind_angle",
    "apparent_wind_angle",
    "wind_direction",
    "relative_wind_direction",
    "apparent_wind_direction",
    "rel_wind_angle",
    "rel_wind_dir",
    "rel_wind_direction",
    "awa",
    "awd",
)
"""Names of the angle from the bow from which the relative wind comes."""


COURSES = ("course", "cog", "course_over_ground")
"""Names of the course over ground, which stands in for the heading."""

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
    whole = pd.concat(tables, ignore_index=True).drop_duplicates(ignore_index=True)
    stated = [table.attrs.get("units", {}) for table in tables]
    for file, units in zip(files, stated, strict=True):
        if units != stated[0]:
            raise TableError(f"{file}: another row of units than {files[0].name}")
    whole.attrs["units"] = stated[0]
    whole.attrs["remarks"] = [
        f"{file.name}: {remark}"
        for file, table in zip(files, tables, strict=True)
        for remark in table.attrs["remarks"]
    ]
    texts: dict[str, TextCells] = {}
    for file, table in zip(files, tables, strict=True):
        for name, found in table.attrs["text_cells"].items():
            first = texts.get(name, found._replace(cells=0, file=file.name))
            texts[name] = first._replace(cells=first.cells + found.cells)
    whole.attrs["text_cells"] = texts
    return whole


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
    ``attrs["remarks"]`` has sentences on text in columns of numbers, on assumed units and on columns
    that are not used.

    Args:
        table: table with names such as ``SOG [kn]`` or ``shaft_power_kW``, or with a row of units
            (``attrs["units"]``); other columns are not used.
        columns: known columns by quantity.
        source: name of the table in messages.
        gaps: whether a cell may be empty or no number, and then becomes nan.

    Raises:
        TableError: a column is missing, read twice, or has a value outside its range.
    """
    known: dict[str, tuple[str, float]] = {}
    units, unused, unitless = table.attrs.get("units", {}), [], []
    names = [*map(str, table.columns)]
    matches = {name: _quantity(name, columns, units.get(name, "")) for name in names}
    named = {match.quantity for match in matches.values() if match and not match.substitute}
    for name, match in matches.items():
        if match is None or (match.substitute and match.quantity in named):
            unused.append(name)
            continue
        quantity, factor, _ = match
        if factor is None:
            unit, factor = next(iter(columns[quantity].units.items()))
            if quantity != "time":
                unitless.append(f"{name} as {unit}")
        if quantity in known:
            raise TableError(
                f"{source}: columns {known[quantity][0]!r} and {name!r} are both read as {quantity}; "
                "remove or rename one of them"
            )
        known[quantity] = (name, factor)
    by_words = _by_words(columns, known, unused, units)
    known |= by_words
    unused = [name for name in unused if name not in {one for one, _ in by_words.values()}]
    result = pd.DataFrame(index=range(len(table)))
    remarks, texts = [*table.attrs.get("remarks", ())], table.attrs.get("text_cells", {})
    if by_words:
        pairs = ", ".join(f"{name!r} as {quantity}" for quantity, (name, _) in by_words.items())
        remarks.append(f"read by the words of their names, check them: {pairs}")
    for quantity, column in columns.items():
        if quantity in known:
            name, factor = known[quantity]
            cells = table[name].reset_index(drop=True)
            where = f"{source}: column {name!r}"
            stamps = _dates(cells) if quantity == "time" else None
            if stamps is not None:
                result["stamp"] = stamps
                result[quantity] = (stamps - stamps.iloc[0]).dt.total_seconds()
                continue
            if name in texts:
                if not gaps:
                    said = texts[name].description(name)
                    raise TableError(f"{source}: {said}; correct this cell or remove its row")
                remarks.append(texts[name].remark(name))
            result[quantity] = _values(cells, column, factor, where, gaps)
        elif column.default is not None:
            result[quantity] = column.default
        else:
            raise TableError(
                f"{source}: no column is read as {quantity}; name it "
                f"{' or '.join((*column.names, *column.substitutes))} with "
                f"its unit ({', '.join(column.units)}), such as {quantity}_{next(iter(column.units))}. "
                f"The file has: {', '.join(map(str, table.columns))}"
            )
    if unitless:
        remarks.append(f"no unit is stated, taken: {', '.join(unitless)}")
    if unused:
        remarks.append(f"columns that are not understood or not used: {', '.join(unused)}")
    result.attrs |= {"remarks": remarks, "absent": [q for q in columns if q not in known]}
    return result


_RECORDED = {
    "time": (TIME,),
    "heading": (HEADING, COURSE),
    "speed_over_ground": (OVER_GROUND,),
    "speed_through_water": (SHIP_SPEED,),
    "shaft_power": (SHAFT_POWER,),
    "shaft_speed": (SHAFT_SPEED,),
    "wind_speed": ("wind_speed_m_s",),
    "wind_angle": ("wind_angle_rad",),
    "draught_fore": ("draught_fore_m",),
    "draught_aft": ("draught_aft_m",),
    "depth": ("water_depth_m",),
    "water_temperature": ("water_temperature_C",),
    "rudder": (RUDDER,),
}
"""Columns of recordings by quantity, whose names in several languages :mod:`..mismatch` knows."""


def _by_words(
    columns: Mapping[str, Column],
    known: Mapping[str, tuple[str, float]],
    unused: Sequence[str],
    units: Mapping[str, str],
) -> dict[str, tuple[str, float]]:
    """Return names and factors of quantities that no name gives, by the words of unused names.

    A name is used only if it or the row of units states a unit of the quantity; a time needs none.
    """
    missing = [quantity for quantity in columns if quantity not in known and quantity in _RECORDED]
    if not missing or not unused:
        return {}
    # These modules take a second to import.
    from ..mismatch.recordings.draft import rank
    from ..mismatch.recordings.logger_names import split_name

    found: dict[str, tuple[str, float]] = {}
    split = {name: split_name(name, units.get(name, "")) for name in unused}
    for quantity in missing:
        fits = []
        for place, column in enumerate(_RECORDED[quantity]):
            for name, words in split.items():
                try:
                    factor = _factor(name, quantity, columns[quantity], words.unit)
                except TableError:
                    continue
                order = rank(words, column, moves=True, ordered=False)
                if order is not None and (factor is not None or quantity == "time"):
                    fits.append((place, *order, name, factor or 1.0))
        if fits:
            *_, name, factor = min(fits)
            found[quantity] = (name, factor)
            del split[name]
    return found


def _dates(cells: pd.Series) -> pd.Series | None:
    """Return cells as dates; None if they are numbers or no dates."""
    if pd.api.types.is_datetime64_any_dtype(cells):
        return cells
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


class _Match(NamedTuple):
    """Quantity of a column, its factor to SI, and whether the column only stands in for it."""

    quantity: str
    factor: float | None
    substitute: bool


def _quantity(name: str, columns: Mapping[str, Column], stated: str) -> _Match | None:
    """Return quantity and factor to SI of a column; None for a name that is no quantity.

    Args:
        name: name of the column, with or without its unit.
        columns: known columns by quantity.
        stated: unit in the row of units; empty without one.

    Returns:
        The factor is None where neither the name nor the row states a unit.

    Raises:
        TableError: an unknown unit, or another one in the name than in the row of units.
    """
    text = name.strip()
    if text.endswith((")", "]")):
        start = max(text.rfind("("), text.rfind("["))
        stem, unit = text[:start], text[start + 1 : -1].strip()
    else:
        stem, _, unit = text.rpartition("_")
        if not any(_is_unit(unit, one) for column in columns.values() for one in column.units):
            stem, unit = text, ""
    plain = "_".join(re.sub(r"[^a-z0-9]+", " ", stem.lower()).split())
    for quantity, column in columns.items():
        if plain not in (*column.names, *column.substitutes):
            continue
        factors = [_factor(name, quantity, column, one) for one in (unit, stated) if one]
        if len(set(factors) - {None}) > 1:
            raise TableError(
                f"column {name!r}: its name has the unit {unit!r} and the row of units {stated!r}"
            )
        known = next((factor for factor in factors if factor is not None), None)
        return _Match(quantity, known, plain in column.substitutes)
    return None


def _factor(name: str, quantity: str, column: Column, unit: str) -> float | None:
    """Return the factor of a unit to SI; None for a dash or the form of a date."""
    for known, factor in column.units.items():
        if _is_unit(unit, known):
            return factor
    if unit in ("", "-") or (quantity == "time" and DATE_FORMAT.fullmatch(unit)):
        return None
    raise TableError(
        f"column {name!r}: unit {unit!r} of {quantity} is not known; use {', '.join(column.units)}"
    )


def _is_unit(unit: str, known: str) -> bool:
    return unit.lower() == known.lower()
