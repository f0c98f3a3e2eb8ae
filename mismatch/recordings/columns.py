"""Map the column names, units and signs of a logger to the canonical columns.

A column map is a TOML file (``docs/recordings.md`` describes all keys)::

    [columns]
    "Fuel index" = { column = "fuel_rack_mm", unit = "mm", scale = 0.4 }
    "P/D" = "pitch_ratio"
    "shaft_torque_N_m" = { formula = "power_W / (rpm * 0.10472)" }

    [signals]
    "Beta" = { signal = "drift_angle", unit = "deg", sign = -1 }

    [file]
    separator = ";"

    [rows]
    leave_out_turns = true

The canonical value is sign * (scale * value + offset), converted from ``unit``. Terms of a ship may
depend on the signals (:mod:`shaftline.plant.terms`), which are converted to SI. A formula has the syntax
of terms (:mod:`shaftline.plant.expressions`); it is parsed and never executed, and is evaluated row by
row. In it, columns of the file have the unit of the file and canonical columns the canonical unit. The
layout of a text file is recognised from its content; the table ``[file]`` overrides it.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ...core.files import FileError, read_toml
from ...core.models import FileModel, short
from ...plant.columns import BOUNDS, COLUMNS, TIME
from ...plant.expressions import FUNCTIONS, evaluate_rows, names_in, parse_expression
from ...plant.recording import RecordingError
from ...plant.terms import TERM_SIGNALS, TURNING_SIGNALS, Name
from .time_base import seconds_since_first

LONGEST_UNIT = 60  # largest number of characters of a unit
LONGEST_FORMULA = 1000  # largest number of characters of a formula
_RAISED = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_POWER = re.compile(
    r"(?<=[^\W\d_]|[°µ])\s*(\*\*|\^)\s*([-+]?\d(\.\d)?|\([-+]?\d(\.\d)?\))(?![\d.])"
)
"""Power of a unit: an exponent of one digit, optionally with one decimal and in brackets."""


def parse_unit(name: str) -> Any:
    """Return the unit of the registry with a name.

    Example:
        >>> print(parse_unit("kN m"))
        kilonewton * meter

    Raises:
        ValueError: the name is too long, is no unit, or has an exponent outside -9 to 9.
    """
    if len(name) > LONGEST_UNIT:
        raise ValueError(
            f"unit {name[:20]!r}... has {len(name)} characters; at most {LONGEST_UNIT} are allowed"
        )
    lowered = _RAISED.sub(lambda found: f"**{found[0].translate(_LOWERED)}", name)
    plain = _POWER.sub(" ", lowered)
    if "**" in plain or "^" in plain:  # pint evaluates every power, and 9**9**9 would take days.
        raise ValueError(
            f"unit {name!r} is not understood: an exponent is one number from -9 to 9 after a unit, as "
            "in m/s**2"
        )
    try:
        return unit_registry().parse_units(name)
    except Exception as error:  # pint raises many kinds of errors for text that is no unit.
        raise ValueError(
            f"unit {name!r} is not understood ({error}); examples: rpm, kN m, knot, deg"
        ) from None


@functools.cache
def unit_registry() -> Any:
    """Return the unit registry with common spellings of ship logs; it is created at the first call."""
    import pint

    units: Any = pint.UnitRegistry(cache_folder=None)
    for spelling in (
        "newton_metre = newton * metre = Nm",
        "newton_millimetre = 1e-3 newton_metre = Nmm",
        "@alias knot = kn",
        "@alias revolutions_per_minute = RPM",
    ):
        units.define(spelling)
    return units


def check_formula(formula: str, names: Mapping[str, str]) -> None:
    """Raise a ValueError for a formula that is no valid expression, or names that it does not use.

    ``names`` has the column of the file for each name in the formula that is no column itself.
    """
    if len(formula) > LONGEST_FORMULA:
        raise ValueError(f"a formula has at most {LONGEST_FORMULA} characters, not {len(formula)}")
    used = list(dict.fromkeys(names_in(formula)))
    parse_expression(formula, (), {name: k for k, name in enumerate(used)}, [])
    if not used:
        raise ValueError(f"{formula!r} uses no column; a formula needs the name of at least one")
    for name in names:
        if name not in used or name in FUNCTIONS:
            raise ValueError(
                f"names.{name} does not occur in {formula!r} (it uses {', '.join(used)}); remove it"
            )


def columns_of_formula(formula: str, names: Mapping[str, str]) -> dict[str, str]:
    """Return the columns that a formula uses, by their names in the formula."""
    return {name: names.get(name, name) for name in names_in(formula)}


def evaluate_formula(
    formula: str, names: Mapping[str, str], raw: pd.DataFrame, mapped: pd.DataFrame
) -> pd.Series:
    """Return the value of a formula in each row; missing if one of its columns has no number there.

    Args:
        formula: expression that :func:`check_formula` accepts.
        names: column of the file for each name in the formula that is no column itself.
        raw: columns of the file in the units of the file.
        mapped: canonical columns and signals that the map has produced so far, in the canonical unit.

    Raises:
        ValueError: neither table has a column of the formula, or a row gives no finite value.
    """
    found = {}
    for name, column in columns_of_formula(formula, names).items():
        canonical = name not in names and column in mapped
        if not canonical and column not in raw:
            known = dict.fromkeys([*map(str, raw), *(c for c in mapped if c in COLUMNS)])
            raise ValueError(
                f"{formula!r} uses {column!r}, which is no column (found: {', '.join(known)}); for a "
                f'column whose name has blanks or signs add names = {{ {name} = "..." }}'
            )
        values = (mapped if canonical else raw)[column]
        found[name] = pd.to_numeric(values, errors="coerce").to_numpy(dtype=np.float64)
    signals = np.column_stack(list(found.values()))
    literals: list[float] = []
    program = np.array(
        parse_expression(formula, (), {name: k for k, name in enumerate(found)}, literals)
    )
    result: NDArray[np.float64] = np.empty(len(signals))
    evaluate_rows(program, np.array([*literals, 0.0]), signals, result)
    bad = ~np.isfinite(result) & np.isfinite(signals).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        inputs = ", ".join(f"{name} = {values[row]:g}" for name, values in found.items())
        raise ValueError(
            f"row {row + 1}: {formula!r} has no finite value with {inputs} ({bad.sum()} of {len(bad)} "
            "rows): a division by 0, the root or logarithm of a negative number, or an overflow; limit "
            "a divisor by max(..., 0.1), or cut these rows out"
        )
    return pd.Series(result, raw.index)


class FileLayout(FileModel):
    """Known layout of a file; the rest is recognised (:class:`shaftline.core.tables.Layout`)."""

    separator: Annotated[
        str | None, Field(description="field separator: one character, or tab")
    ] = None
    decimal: Annotated[Literal[".", ","] | None, Field(description="decimal sign")] = None
    encoding: Annotated[str | None, Field(description="text encoding, as Python names it")] = None
    header_row: Annotated[int | None, Field(ge=1, le=1000, description="line of the names")] = None
    unit_row: Annotated[int | None, Field(ge=1, le=1000, description="line of the units")] = None
    sheet: Annotated[
        str | None,
        Field(description="sheet of a spreadsheet; that with the most numbers by default"),
    ] = None

    @field_validator("separator")
    @classmethod
    def _one_sign(cls, value: str | None) -> str | None:
        value = "\t" if value == "tab" else value
        if value is not None and (len(value) != 1 or value.isalnum() or value in "\r\n.\"'"):
            raise ValueError(f"{value!r} (allowed: one character such as ; , | or the word tab)")
        return value

    @field_validator("encoding")
    @classmethod
    def _encoding(cls, value: str | None) -> str | None:
        try:
            "".encode(value or "utf-8")  # This refuses codecs without text, such as zip.
        except LookupError:
            raise ValueError(
                f"{value!r} is no known encoding (allowed: utf-8, utf-16, cp1252, ...)"
            ) from None
        return value

    @model_validator(mode="after")
    def _one_meaning(self) -> FileLayout:
        if self.separator is not None and self.separator == self.decimal:
            raise ValueError(f"separator and decimal are both {self.separator!r}; they must differ")
        return self


DATE_TIME = "datetime"
"""Unit of a time column with dates and times of day, or times of day; a format of ``strptime`` may
follow it."""
PERCENT_OF_RANGE = "percent of range"
"""Unit of a command or a position: 100 is the upper limit of the ship, -100 the lower limit, 0 is 0."""
PERCENT = ("%", "percent", "pct")
Ranges: TypeAlias = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each command and position of a ship, by canonical column."""
FUEL_FLOW = "fuel_flow_kg_s"
PITCHES = ("pitch_ratio", "pitch_ratio_command")
LINEAR = {"N m": "N", "rad": "m", "rad/s": "m/s"}  # unit of a linear axis for each unit of a shaft
_TURNING = ("revolution", "radian", "degree", "turn", "rpm", "rps")


_Sign: TypeAlias = Annotated[Literal[1, -1], Field(description="-1 reverses the sign")]
_Scale: TypeAlias = Annotated[float, Field(description="units per recorded value")]
_Offset: TypeAlias = Annotated[float, Field(description="offset in this unit, added after scaling")]
_Radius: TypeAlias = Annotated[
    float | None,
    Field(gt=0.0, description="converts a force, position or speed of a linear axis to a shaft"),
]
_Density: TypeAlias = Annotated[
    float | None,
    Field(ge=100.0, le=2000.0, description="converts a volume flow of fuel to a mass flow"),
]
_Formula: TypeAlias = Annotated[
    str | None, Field(description="expression of other columns, instead of a column of the file")
]
_Names: TypeAlias = Annotated[
    dict[str, str], Field(description="column of the file for each name in the formula")
]


class Source(FileModel):
    """Source of one canonical column: a column of the file or a formula, with unit, sign and scale."""

    column: str = Field(description="canonical column")
    unit: Annotated[str | None, Field(description="unit in the recording; canonical if absent")] = (
        None
    )
    sign: _Sign = 1
    scale: _Scale = 1.0
    offset: _Offset = 0.0
    radius_m: _Radius = None
    density_kg_m3: _Density = None
    formula: _Formula = None
    names: _Names = {}  # noqa: RUF012 (pydantic copies it)

    @field_validator("column")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in COLUMNS:
            similar = difflib.get_close_matches(value, COLUMNS, cutoff=0.7)
            known = (
                f"similar: {', '.join(similar)}" if similar else f"allowed: {', '.join(COLUMNS)}"
            )
            raise ValueError(f"{short(value)} is not canonical ({known})")
        return value

    @field_validator("scale")
    @classmethod
    def _not_zero(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("0 would make every value 0 (allowed: any other number)")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Source:
        _check_formula(self)
        if self.formula is not None and self.stamps is not None:
            raise ValueError("a formula gives numbers and no dates: remove the unit datetime")
        if self.radius_m is not None and BOUNDS[self.column][2] not in LINEAR:
            raise ValueError(
                f"radius_m applies to torques, angles and speeds of the shaft, not to {self.column}"
            )
        if self.density_kg_m3 is not None and self.column != FUEL_FLOW:
            raise ValueError(f"density_kg_m3 applies to {FUEL_FLOW}, not to {self.column}")
        if self.stamps is None and self.unit != PERCENT_OF_RANGE:
            self.convert(pd.Series([1.0]))
        return self

    def with_unit_of_file(self, unit: str | None) -> Source:
        """Return this source with the unit that the file states if the map states none.

        Raises:
            ValueError: the unit of the file is not understood or is ambiguous.
        """
        if self.unit is not None or unit in (None, "", "-"):
            return self
        try:
            if unit in PERCENT:
                raise ValueError(f'it may mean "percent" or "{PERCENT_OF_RANGE}"')
            return Source.model_validate(self.model_dump(exclude_unset=True) | {"unit": unit})
        except ValueError as error:
            why = str(error)
            if isinstance(error, ValidationError):
                why = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise ValueError(
                f"the unit {unit!r} in the file cannot be used ({why}); set unit = in the column map"
            ) from None

    @property
    def stamps(self) -> str | None:
        """Format after the unit ``datetime``; None if the column has another unit.

        Raises:
            ValueError: a column other than the time has the unit ``datetime``.
        """
        if self.unit is None or self.unit.split(maxsplit=1)[:1] != [DATE_TIME]:
            return None
        if self.column != TIME:
            raise ValueError(f"unit {DATE_TIME!r} is allowed for {TIME} only")
        return self.unit[len(DATE_TIME) :].strip()

    def convert(self, values: pd.Series, ranges: Ranges = MappingProxyType({})) -> pd.Series:
        """Return the values in the canonical unit; text becomes NaN, as a missing value.

        Example:
            >>> source = Source(column="shaft_speed_rad_s", unit="rpm", sign=-1)
            >>> source.convert(pd.Series([0.0, 60.0])).round(3).tolist()
            [-0.0, -6.283]

        Args:
            values: recorded values.
            ranges: ranges of the commands and positions of the ship, for values in percent of range.

        Raises:
            ValueError: the unit is unknown or has another dimension than the canonical unit, or a time
                stamp cannot be read.
        """
        if (form := self.stamps) is not None:
            return seconds_since_first(values, form or None)
        if self.model_fields_set <= {"column"}:
            return values
        numbers = _scaled(self, values)
        if self.unit == PERCENT_OF_RANGE:
            if self.column not in ranges:
                raise ValueError(
                    f"unit {PERCENT_OF_RANGE!r} needs a range in the ship file, as for "
                    f"{', '.join(ranges) or 'a command'}; {self.column} has none"
                )
            low, high = ranges[self.column]
            return 0.01 * numbers * (numbers < 0.0).map({True: abs(low), False: high})
        unit = BOUNDS[self.column][2]
        if self.radius_m is None:
            return self._in_unit(unit, numbers)
        linear = self._in_unit(LINEAR[unit], numbers)
        return linear * self.radius_m if unit == "N m" else linear / self.radius_m

    def _in_unit(self, unit: str, numbers: pd.Series) -> pd.Series:
        """Return the values in the canonical unit or in that of a linear axis."""
        if self.unit is None:
            return numbers
        units = unit_registry()
        wanted = _pint_unit(unit)
        given = parse_unit(self.unit)
        if self.density_kg_m3 is not None and given.is_compatible_with("m**3/s"):
            return pd.Series(
                units.Quantity(numbers.to_numpy(), given).m_as("m**3/s") * self.density_kg_m3,
                numbers.index,
            )
        if not given.is_compatible_with(wanted):
            raise ValueError(
                f"unit {self.unit!r} cannot be converted to {unit} of {self.column}: "
                f"{_way_out(given, unit, self.column)}"
            )
        angle = any(word in str(given) for word in _TURNING)
        if unit in ("rad/s", "rad") and not angle:
            angles = "rad and deg are angles, turn is a revolution"
            if unit == "rad/s":
                angles = "rpm and rps are revolutions, rad/s and deg/s angles"
            raise ValueError(f"unit {self.unit!r} is ambiguous for an angle: {angles}")
        quantity = units.Quantity(numbers.to_numpy(), given)
        if self.column in PITCHES and angle:  # The angle at 0.7 R gives P/D = 0.7 pi tan(angle).
            radians = pd.Series(quantity.m_as("radian"), numbers.index)
            return 0.7 * math.pi * radians.map(math.tan)
        return pd.Series(quantity.m_as(wanted), numbers.index)


def _way_out(given: Any, unit: str, column: str) -> str:
    """Return what to do about a unit that cannot be converted to the canonical unit of a column."""
    units = unit_registry()
    if column == FUEL_FLOW and given.is_compatible_with("m**3/s"):
        return "it is a volume flow; add density_kg_m3 = 850, or the density of your fuel"
    others = [
        c
        for c, (_, _, other) in BOUNDS.items()
        if c in COLUMNS and other != "-" and given.is_compatible_with(_pint_unit(other))
    ]
    if given.dimensionless:
        others = []
    usual = (
        f"use {_EXAMPLES[unit]}" if unit in _EXAMPLES else f"use a unit of the same kind as {unit}"
    )
    if column == "shaft_torque_N_m" and given.is_compatible_with(units.watt):
        return "it is a power; map it as shaft_power_W, and the torque follows from the shaft speed"
    if others:
        return f"{usual}, or map the column as {' or '.join(others[:3])}, which has a unit of this kind"
    return f"{usual}, or give a formula that converts it"


_EXAMPLES = {
    "m/s": "knot, km/h or m/s",
    "rad/s": "rpm, rps, deg/s or rad/s",
    "rad": "deg or rad",
    "N m": "kN m or N m",
    "N": "kN or N",
    "W": "kW, MW or hp",
    "kg/s": "kg/h, t/day or l/h",
    "m": "m or ft",
    "mm": 'mm, cm or "percent of range"',
    "degC": "degC, degF or K",
    "s": "s, min or h",
    "V": 'V, or "percent of range"',
    "A": "A or mA",
    "-": 'a pure number, "percent", "percent of range", or deg for a pitch',
}
"""Units that loggers use, by canonical unit."""


def _pint_unit(unit: str) -> Any:
    """Return the unit of the registry for a canonical unit."""
    return unit_registry().Unit({"-": "dimensionless"}.get(unit, unit.replace(" ", "*")))


def _scaled(source: Source | SignalSource, values: pd.Series) -> pd.Series:
    """Return the values with sign, scale and offset, in the unit of the source; text becomes NaN."""
    numbers = pd.to_numeric(values, errors="coerce").astype(float)
    return source.sign * (source.scale * numbers + source.offset)


def _check_formula(source: Source | SignalSource) -> None:
    """Refuse an invalid formula, and names without a formula."""
    if source.formula is not None:
        check_formula(source.formula, source.names)
    elif source.names:
        raise ValueError("names is allowed with formula only; add the formula or remove names")


class SignalSource(FileModel):
    """Source of one signal for terms: a column of the file or a formula, with unit, sign and scale."""

    signal: Name = Field(description="name in expressions")
    unit: Annotated[str | None, Field(description="unit in the recording; converted to SI")] = None
    sign: _Sign = 1
    scale: _Scale = 1.0
    offset: _Offset = 0.0
    formula: _Formula = None
    names: _Names = {}  # noqa: RUF012 (pydantic copies it)

    @property
    def column(self) -> str:
        """Column of the table with this signal."""
        return self.signal

    @field_validator("signal")
    @classmethod
    def _free(cls, value: str) -> str:
        own = {*TERM_SIGNALS} - {*TURNING_SIGNALS}  # These signals exist on every ship.
        if value in COLUMNS or value in own or value in FUNCTIONS:
            raise ValueError(f"{value!r} is a reserved name; choose another name for the signal")
        return value

    @model_validator(mode="after")
    def _understood(self) -> SignalSource:
        _check_formula(self)
        _ = self.unit_in_expressions
        return self

    @property
    def unit_in_expressions(self) -> str:
        """SI unit of the signal in expressions."""
        if self.unit is None:
            return "-"
        base = unit_registry().Quantity(1.0, parse_unit(self.unit)).to_base_units().units
        return f"{base:~C}".replace("**", "").replace("*", " ") or "-"

    def convert(self, values: pd.Series) -> pd.Series:
        """Return the values in SI; text becomes NaN, as a missing value."""
        numbers = _scaled(self, values)
        if self.unit is None:
            return numbers
        quantity = unit_registry().Quantity(numbers.to_numpy(), parse_unit(self.unit))
        return pd.Series(quantity.to_base_units().magnitude, numbers.index)


class Rows(FileModel):
    """Rows of a recording that are used."""

    leave_out_turns: Annotated[
        bool, Field(description="whether rows in which the ship turns are left out")
    ] = False


class ColumnMap(FileModel):
    """Column map: canonical columns and signals for terms by their names in the file, and its layout."""

    columns: dict[str, Source] = Field(default={})
    signals: dict[str, SignalSource] = Field(default={})
    file: FileLayout = FileLayout()
    rows: Rows = Rows()

    @field_validator("columns", "signals", mode="before")
    @classmethod
    def _bare_names(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value
        key = "column" if info.field_name == "columns" else "signal"
        given = {k: {key: v} if isinstance(v, str) else v for k, v in value.items()}
        by_formula = {k for k, v in given.items() if isinstance(v, dict) and "formula" in v}
        return {k: {key: k} | v if k in by_formula else v for k, v in given.items()}

    @property
    def sources(self) -> dict[str, Source | SignalSource]:
        """Sources of all columns and signals, by their names in the file."""
        return {**self.columns, **self.signals}

    @property
    def inputs(self) -> set[str]:
        """Names of the columns that the map uses; those of a formula may be canonical."""
        found: set[str] = set()
        for name, source in self.sources.items():
            formula = source.formula
            found |= (
                {name} if formula is None else {*columns_of_formula(formula, source.names).values()}
            )
        return found

    @model_validator(mode="after")
    def _each_once(self) -> ColumnMap:
        if not (self.sources or self.file.model_fields_set or self.rows.model_fields_set):
            raise ValueError(
                "the map is empty: [columns], [signals], [file] or [rows] needs an entry"
            )
        if both := sorted(set(self.columns) & set(self.signals)):
            raise ValueError(f"{both[0]!r} is in [columns] and in [signals]; keep one of the two")
        names = [source.column for source in self.sources.values()]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{twice[0]} is given by more than one column; keep one of them")
        return self

    def remarks(self, ranges: Ranges) -> Iterator[str]:
        """Yield a remark on each unit "percent" of a command or position with a range."""
        for name, source in self.columns.items():
            if source.unit in PERCENT and source.column in ranges:
                yield (
                    f"{name!r} is converted from percent to hundredths; if 100 is the end of its "
                    f'range ({ranges[source.column][1]:.3g}), set unit = "{PERCENT_OF_RANGE}"'
                )

    def apply(
        self, path: Path, table: pd.DataFrame, ranges: Ranges = MappingProxyType({})
    ) -> pd.DataFrame:
        """Return the table with canonical names and units; columns outside the map are kept.

        The ranges of the commands and positions of the ship convert values in percent of range.

        Raises:
            RecordingError: the recording lacks a column of the map, or has a canonical column that the
                map gives as well; a time stamp cannot be read; a formula uses a missing column, or has
                no finite value in a row.
        """
        sources = sorted(self.sources.items(), key=lambda pair: pair[1].formula is not None)
        used = [name for name, source in sources if source.formula is None and name in table]
        result = table.drop(columns=used)
        for name, source in sources:
            if source.formula is None and name not in table:
                raise RecordingError(
                    f"{path}: column {name!r} of the column map is missing; "
                    f"found: {', '.join(map(str, table.columns))}"
                )
            if source.column in result:
                raise RecordingError(
                    f"{path}: {source.column} is in the recording and also given by {name!r}; rename "
                    "the column or remove the entry of the column map"
                )
            try:
                values, stated = table.get(name), table.attrs.get("units", {}).get(name)
                if source.formula is not None:
                    stated = None
                    values = evaluate_formula(source.formula, source.names, table, result)
                if isinstance(source, SignalSource):
                    result[source.column] = source.convert(values)
                else:
                    result[source.column] = source.with_unit_of_file(stated).convert(values, ranges)
            except (ValueError, OverflowError) as error:  # also an integer too large for a float
                raise RecordingError(f"{path}: {name!r} as {source.column}: {error}") from None
        return result


def load_map(path: str | Path) -> ColumnMap:
    """Read a column map.

    Args:
        path: TOML file, as described in ``docs/recordings.md``.

    Example:
        >>> from shaftline.mismatch.example import COLUMN_MAP, FOLDER
        >>> load_map(FOLDER / COLUMN_MAP).columns["Fuel rack"].unit
        'percent of range'

    Raises:
        RecordingError: the file cannot be read, or a key is missing, unknown, of the wrong type or out
            of range; the message gives file, key and what is allowed.
    """
    path = Path(path)
    try:
        return ColumnMap.model_validate(read_toml(path))
    except FileError as error:
        raise RecordingError(str(error)) from None
    except ValidationError as error:
        lines = (f"{path}: {_explained(dict(item))}" for item in error.errors())
        raise RecordingError("\n".join(lines)) from None


def _explained(item: dict[str, Any]) -> str:
    """Return a pydantic error as a sentence with the key and what is allowed."""
    key = ".".join(map(str, item["loc"])) or "the map"
    what = item["ctx"]["error"] if item["type"] == "value_error" else item["msg"].lower()
    if item["type"] == "missing":
        return f"{key} is missing"
    if item["type"] == "extra_forbidden":
        tables: dict[Any, type[BaseModel]] = {
            "signals": SignalSource,
            "file": FileLayout,
            "rows": Rows,
        }
        known = ColumnMap if len(item["loc"]) == 1 else tables.get(item["loc"][0], Source)
        return f"{key} is not a known key (allowed: {', '.join(known.model_fields)})"
    return f"{key}: {what}"
