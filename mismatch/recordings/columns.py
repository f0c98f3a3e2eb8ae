"""Units by their names, with the spellings of ships' logs.

Formulas of a column map: a column that is worked out from others, row by row.

The expressions are those of terms (:mod:`shaftline.plant.expressions`): parsed, never run.

What a column map says of how a file is a table.

Where one column comes from, and how its values are carried over to the canonical unit.

Column maps: foreign names, units and signs carried onto the canonical columns.

A map is a TOML file with one table, ``[columns]``; a key is a name in the recording's header::

    [columns]
    "Fuel index" = { column = "fuel_rack_mm", unit = "mm", scale = 0.4 }
    "N shaft" = { column = "shaft_speed_rad_s", unit = "rpm", sign = -1 }
    "P/D" = "pitch_ratio"

The canonical value is sign * (scale * value + offset), read in ``unit`` and converted. A linear axis has
forces, positions and speeds where a shaft has torques, angles and speeds of rotation; ``radius_m`` says
by which radius the one becomes the other::

    "Force" = { column = "motor_torque_N_m", unit = "N", radius_m = 1.0 }
    "Carriage" = { column = "shaft_angle_rad", unit = "mm", radius_m = 1.0 }

Whatever else the recording holds can be named as a signal, which terms of a ship may hear
(:mod:`shaftline.plant.terms`). With a unit it is carried over to SI; without, it is taken as it is::

    [signals]
    "Beta" = { signal = "drift_angle", unit = "deg", sign = -1 }
    "Fouling days" = "days_since_docking"

A column that the file does not have can be worked out from others, by an expression as terms have them;
its key is then the canonical column (or the signal). Columns of the file stand in it in the file's unit,
canonical ones in the canonical unit; ``unit`` is that of the result::

    [columns]
    "shaft_torque_N_m" = { formula = "power_W / (rpm * 0.10472)" }

    [signals]
    "head_wind" = { formula = "v * cos(a * 0.0174533)", names = { v = "Wind [m/s]", a = "Wind [deg]" } }

How the file is a table is guessed; a third table says what is known of it::

    [file]
    separator = ";"
    decimal = ","
    header_row = 3
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

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
from ...core.models import FileModel
from ...plant.columns import BOUNDS, COLUMNS, TIME
from ...plant.expressions import FUNCTIONS, names_in, parsed, rows_of
from ...plant.recording import RecordingError
from ...plant.terms import OF_A_TURN, TERM_SIGNALS, Name
from .time_base import seconds_of_stamps

LONGEST_UNIT = 60
"""Letters of a unit at most."""

_RAISED = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_POWER = re.compile(
    r"(?<=[^\W\d_]|[°µ])\s*(\*\*|\^)\s*([-+]?\d(\.\d)?|\([-+]?\d(\.\d)?\))(?![\d.])"
)
"""A power of a name, its exponent of one digit, perhaps with a decimal and in brackets."""


def unit_of(name: str) -> Any:
    """A unit by its name.

    Raises:
        ValueError: it is not understood.
    """
    if len(name) > LONGEST_UNIT:
        raise ValueError(
            f"unit {name[:20]!r}... has {len(name)} letters; at most {LONGEST_UNIT} are read"
        )
    lowered = _RAISED.sub(lambda found: f"**{found[0].translate(_LOWERED)}", name)
    plain = _POWER.sub(" ", lowered)
    if "**" in plain or "^" in plain:  # pint works numbers out, however large: 9**9**9 takes days
        raise ValueError(
            f"unit {name!r} is not understood: an exponent is one number from -9 to 9 behind a name, "
            "as in m/s**2"
        )
    try:
        return registry().parse_units(name)
    except Exception as error:  # pint raises many kinds for text that is no unit
        raise ValueError(
            f"unit {name!r} is not understood ({error}); examples: rpm, kN m, knot, deg"
        ) from None


@functools.cache
def registry() -> Any:
    """The unit registry, with the spellings of ships' logs; made when a map first needs it."""
    import pint

    units: Any = pint.UnitRegistry(cache_folder=None)
    for spelling in ("newton_metre = newton * metre = Nm", "newton_millimetre = 1e-3 newton_metre = Nmm",
                     "@alias knot = kn", "@alias revolutions_per_minute = RPM"):  # fmt: skip
        units.define(spelling)
    return units


LONGEST_FORMULA = 1000
"""Letters of a formula at most."""


def check_formula(formula: str, names: Mapping[str, str]) -> None:
    """Refuse a formula that is no expression, or names that it does not use.

    Args:
        formula: see the module.
        names: names in it, and the columns of the file for which they stand.

    Raises:
        ValueError: says what is wrong and what is allowed.
    """
    if len(formula) > LONGEST_FORMULA:
        raise ValueError(f"a formula has at most {LONGEST_FORMULA} letters, not {len(formula)}")
    used = list(dict.fromkeys(names_in(formula)))
    parsed(formula, (), {name: k for k, name in enumerate(used)}, [])
    if not used:
        raise ValueError(f"{formula!r} uses no column; a formula needs the name of one at least")
    for name in names:
        if name not in used or name in FUNCTIONS:
            raise ValueError(
                f"names.{name} does not stand in {formula!r} (it uses {', '.join(used)})"
            )


def columns_in(formula: str, names: Mapping[str, str]) -> dict[str, str]:
    """Columns that a formula uses, by their names in it."""
    return {name: names.get(name, name) for name in names_in(formula)}


def worked_out(
    formula: str, names: Mapping[str, str], raw: pd.DataFrame, mapped: pd.DataFrame
) -> pd.Series:
    """Values of a formula, a row each; missing where one of its columns has no number.

    Args:
        formula: checked by :func:`check_formula`.
        names: as there.
        raw: the file's columns, in the file's units.
        mapped: columns that the map has given so far. Canonical ones and signals are taken from here,
            in the canonical unit.

    Raises:
        ValueError: a column that is in neither, or a row in which the formula has no finite value.
    """
    used = columns_in(formula, names)
    found = {}
    for name, column in used.items():
        canonical = name not in names and column in mapped
        if not canonical and column not in raw:
            known = dict.fromkeys([*map(str, raw), *(c for c in mapped if c in COLUMNS)])
            raise ValueError(
                f"{formula!r} uses {column!r}, which is no column (found: {', '.join(known)}); for a "
                f'column whose name has blanks or signs say names = {{ {name} = "..." }}'
            )
        values = (mapped if canonical else raw)[column]
        found[name] = pd.to_numeric(values, errors="coerce").to_numpy(dtype=np.float64)
    signals = np.column_stack(list(found.values()))
    literals: list[float] = []
    program = np.array(parsed(formula, (), {name: k for k, name in enumerate(found)}, literals))
    result: NDArray[np.float64] = np.empty(len(signals))
    rows_of(program, np.array([*literals, 0.0]), signals, result)
    bad = ~np.isfinite(result) & np.isfinite(signals).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        there = ", ".join(f"{name} = {values[row]:g}" for name, values in found.items())
        raise ValueError(
            f"row {row + 1}: {formula!r} has no finite value with {there} ({bad.sum()} of {len(bad)} "
            "rows): it divides by 0, has the root or logarithm of a number below 0, or is too large; "
            "keep a divisor away from 0 by max(..., 0.1), or cut these rows"
        )
    return pd.Series(result, raw.index)


class FileLayout(FileModel):
    """What is known of how a file is a table; the rest is guessed (:class:`.table_files.Layout`)."""

    separator: str | None = Field(default=None, description="between fields: one sign, or tab")
    decimal: Literal[".", ","] | None = Field(default=None, description="decimal sign")
    encoding: str | None = Field(default=None, description="of the text, as Python names it")
    header_row: int | None = Field(default=None, ge=1, le=1000, description="line of the names")
    unit_row: int | None = Field(default=None, ge=1, le=1000, description="line of the units")
    sheet: str | None = Field(default=None, description="of a spreadsheet; the first by default")

    @field_validator("separator")
    @classmethod
    def _one_sign(cls, value: str | None) -> str | None:
        value = "\t" if value == "tab" else value
        if value is not None and (len(value) != 1 or value.isalnum() or value in "\r\n.\"'"):
            raise ValueError(f"{value!r} (allowed: one sign such as ; , | or tab)")
        return value

    @field_validator("encoding")
    @classmethod
    def _encoding(cls, value: str | None) -> str | None:
        try:
            "".encode(value or "utf-8")  # refuses what turns bytes into bytes, as zip does
        except LookupError:
            raise ValueError(f"{value!r} is unknown (utf-8, utf-16, cp1252, ...)") from None
        return value

    @model_validator(mode="after")
    def _one_meaning(self) -> FileLayout:
        if self.separator is not None and self.separator == self.decimal:
            raise ValueError(
                f"separator and decimal are both {self.separator!r}; one of them is not"
            )
        return self


DATE_TIME = "datetime"
"""Unit of a time column that holds dates with times of day, or times of day alone; a form of
``strptime`` may follow it."""
PERCENT_OF_RANGE = "percent of range"
"""Unit of an order or a position: 100 is the ship's upper limit, -100 its lower one, 0 is 0."""
PERCENT = ("%", "percent", "pct")
Ranges: TypeAlias = Mapping[str, tuple[float, float]]
"""Lowest and highest value of a canonical column on a ship."""
PITCHES = ("pitch_ratio", "pitch_ratio_command")
LINEAR = {"N m": "N", "rad": "m", "rad/s": "m/s"}
"""Units of a shaft, and of a linear axis in their place."""
_TURNING = ("revolution", "radian", "degree", "turn", "rpm", "rps")


class Source(FileModel):
    """Where one canonical column comes from, and how its values are carried over."""

    column: str = Field(description="canonical column")
    unit: str | None = Field(default=None, description="unit in the recording; canonical if absent")
    sign: Literal[1, -1] = Field(default=1, description="-1 turns the channel's sign")
    scale: float = Field(default=1.0, description="units per recorded value")
    offset: float = Field(default=0.0, description="added, in units")
    radius_m: float | None = Field(
        default=None, gt=0.0,
        description="radius by which a force, position or speed of a linear axis is a shaft's",
    )  # fmt: skip
    formula: str | None = Field(
        default=None, description="expression of other columns, in place of a column of the file"
    )
    names: dict[str, str] = Field(
        default={}, description="names in the formula, and the columns of the file they stand for"
    )

    @field_validator("column")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in COLUMNS:
            raise ValueError(f"{value!r} is not canonical (allowed: {', '.join(COLUMNS)})")
        return value

    @field_validator("scale")
    @classmethod
    def _not_zero(cls, value: float) -> float:
        if value == 0.0:
            raise ValueError("0 would leave nothing of the channel (allowed: any other number)")
        return value

    @model_validator(mode="after")
    def _worked_out(self) -> Source:
        _check_formula(self)
        if self.formula is not None and self.stamps is not None:
            raise ValueError("a formula gives numbers, and no dates: leave the unit datetime out")
        return self

    @model_validator(mode="after")
    def _turned_by_a_radius(self) -> Source:
        if self.radius_m is not None and BOUNDS[self.column][2] not in LINEAR:
            raise ValueError(
                f"radius_m is for torques, angles and speeds of the shaft, not for {self.column}"
            )
        return self

    @model_validator(mode="after")
    def _convertible(self) -> Source:
        if self.stamps is None and self.unit != PERCENT_OF_RANGE:
            self.convert(pd.Series([1.0]))
        return self

    def with_unit_of_file(self, unit: str | None) -> Source:
        """The same with the unit that the file states, where the map states none.

        Raises:
            ValueError: it is not understood, or may mean two things.
        """
        if self.unit is not None or unit in (None, "", "-"):
            return self
        try:
            if unit in PERCENT:
                raise ValueError(f'"percent" and "{PERCENT_OF_RANGE}" differ')
            return Source.model_validate(self.model_dump(exclude_unset=True) | {"unit": unit})
        except ValueError as error:
            why = error.errors()[0]["msg"] if isinstance(error, ValidationError) else error
            raise ValueError(
                f"the file's unit {unit!r} cannot be used ({why}); say unit = in the column map"
            ) from None

    @property
    def stamps(self) -> str | None:
        """What follows ``datetime`` where that is the unit; else None.

        Raises:
            ValueError: it is, and the column is not the time.
        """
        if self.unit is None or self.unit.split(maxsplit=1)[:1] != [DATE_TIME]:
            return None
        if self.column != TIME:
            raise ValueError(f"unit {DATE_TIME!r} is for {TIME} only")
        return self.unit[len(DATE_TIME) :].strip()

    def convert(self, values: pd.Series, ranges: Ranges = MappingProxyType({})) -> pd.Series:
        """Values in the canonical unit; what is no number is left to the recording's own checks.

        Args:
            values: as recorded.
            ranges: of the ship's orders and positions, for what is given in percent of them.

        Raises:
            ValueError: the unit is unknown, or of another kind than the canonical one; a time stamp
                cannot be read.
        """
        if (form := self.stamps) is not None:
            return seconds_of_stamps(values, form or None)
        if self.model_fields_set <= {"column"}:
            return values
        numbers = pd.to_numeric(values, errors="coerce").astype(float)
        numbers = self.sign * (self.scale * numbers + self.offset)
        if self.unit == PERCENT_OF_RANGE:
            if self.column not in ranges:
                raise ValueError(
                    f"unit {PERCENT_OF_RANGE!r} needs a range that the ship's file holds, as that of "
                    f"{', '.join(ranges) or 'an order'}; {self.column} has none"
                )
            low, high = ranges[self.column]
            return 0.01 * numbers * (numbers < 0.0).map({True: abs(low), False: high})
        unit = BOUNDS[self.column][2]
        if self.radius_m is None:
            return numbers if self.unit is None else self._in_unit(unit, numbers)
        linear = numbers if self.unit is None else self._in_unit(LINEAR[unit], numbers)
        return linear * self.radius_m if unit == "N m" else linear / self.radius_m

    def _in_unit(self, unit: str, numbers: pd.Series) -> pd.Series:
        """Values in a unit, the canonical one or that of a linear axis."""
        assert self.unit is not None
        units = registry()
        wanted = units.Unit({"-": "dimensionless"}.get(unit, unit.replace(" ", "*")))
        given = unit_of(self.unit)
        if not given.is_compatible_with(wanted):
            raise ValueError(f"unit {self.unit!r} cannot be turned into {unit} of {self.column}")
        angle = any(word in str(given) for word in _TURNING)
        if unit in ("rad/s", "rad") and not angle:
            angles = "rad and deg are angles, turn is a revolution"
            if unit == "rad/s":
                angles = "rpm and rps are revolutions, rad/s and deg/s angles"
            raise ValueError(f"unit {self.unit!r} does not say what turns: {angles}")
        if self.column in PITCHES and angle:  # a blade angle at 0.7 R: P/D = 0.7 pi tan
            radians = units.Quantity(numbers.to_numpy(), given).m_as("radian")
            return 0.7 * math.pi * pd.Series(radians, numbers.index).map(math.tan)
        return pd.Series(units.Quantity(numbers.to_numpy(), given).m_as(wanted), numbers.index)


def _check_formula(source: Source | Heard) -> None:
    """Refuse a formula that cannot be used, or names without one."""
    if source.formula is not None:
        check_formula(source.formula, source.names)
    elif source.names:
        raise ValueError("names are those in a formula, which is missing")


class Heard(FileModel):
    """Where one signal for terms comes from, and how its values are carried over."""

    signal: Name = Field(description="name in expressions")
    unit: str | None = Field(default=None, description="unit in the recording; carried over to SI")
    sign: Literal[1, -1] = Field(default=1, description="-1 turns the signal's sign")
    scale: float = Field(default=1.0, description="units per recorded value")
    offset: float = Field(default=0.0, description="added, in units")
    formula: str | None = Field(
        default=None, description="expression of other columns, in place of a column of the file"
    )
    names: dict[str, str] = Field(
        default={}, description="names in the formula, and the columns of the file they stand for"
    )

    @property
    def column(self) -> str:
        """Its name in the table, too."""
        return self.signal

    @field_validator("signal")
    @classmethod
    def _free(cls, value: str) -> str:
        own = {*TERM_SIGNALS} - {*OF_A_TURN}  # of any ship
        if value in COLUMNS or value in own or value in FUNCTIONS:
            raise ValueError(f"{value!r} has a meaning already: a name of its own is needed")
        return value

    @model_validator(mode="after")
    def _understood(self) -> Heard:
        _check_formula(self)
        _ = self.unit_in_expressions
        return self

    @property
    def unit_in_expressions(self) -> str:
        """Unit in which terms hear it: SI."""
        if self.unit is None:
            return "-"
        base = registry().Quantity(1.0, unit_of(self.unit)).to_base_units().units
        return f"{base:~C}".replace("**", "").replace("*", " ") or "-"

    def convert(self, values: pd.Series) -> pd.Series:
        """Values in SI; what is no number is left to the recording's own checks."""
        numbers = pd.to_numeric(values, errors="coerce").astype(float)
        numbers = self.sign * (self.scale * numbers + self.offset)
        if self.unit is None:
            return numbers
        return pd.Series(
            registry().Quantity(numbers.to_numpy(), unit_of(self.unit)).to_base_units().magnitude,
            numbers.index,
        )


class ColumnMap(FileModel):
    """A whole map: canonical sources, and signals for terms, by foreign name."""

    columns: dict[str, Source] = Field(default={})
    signals: dict[str, Heard] = Field(default={})
    file: FileLayout = FileLayout()

    @field_validator("columns", "signals", mode="before")
    @classmethod
    def _bare_names(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value
        key = "column" if info.field_name == "columns" else "signal"
        given = {k: {key: v} if isinstance(v, str) else v for k, v in value.items()}
        return {
            k: {key: k} | v if isinstance(v, dict) and "formula" in v else v
            for k, v in given.items()
        }

    @property
    def sources(self) -> dict[str, Source | Heard]:
        """All of them."""
        return {**self.columns, **self.signals}

    @property
    def inputs(self) -> set[str]:
        """Names of the columns that the map uses; of a formula canonical ones, too."""
        found = {name for name, source in self.sources.items() if source.formula is None}
        return found.union(*(columns_in(f, names).values() for f, names in self.formulas.values()))

    @property
    def formulas(self) -> dict[str, tuple[str, dict[str, str]]]:
        """Each formula with its names, by the column that it gives."""
        return {
            s.column: (s.formula, s.names) for s in self.sources.values() if s.formula is not None
        }

    @model_validator(mode="after")
    def _each_once(self) -> ColumnMap:
        if not self.sources and not self.file.model_fields_set:
            raise ValueError("neither [columns] nor [signals] nor [file] says anything")
        if both := sorted(set(self.columns) & set(self.signals)):
            raise ValueError(f"{both[0]!r} stands under [columns] and [signals]")
        names = [source.column for source in self.sources.values()]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{twice[0]} is given by more than one column")
        return self

    def remarks(self, ranges: Ranges) -> Iterator[str]:
        """Sentences on units that are easily taken for others."""
        for name, source in self.columns.items():
            if source.unit in PERCENT and source.column in ranges:
                yield (
                    f"{name!r} is read as hundredths; if 100 is the end of "
                    f'its range ({ranges[source.column][1]:.3g}), say unit = "{PERCENT_OF_RANGE}"'
                )

    def apply(
        self, path: Path, table: pd.DataFrame, ranges: Ranges = MappingProxyType({})
    ) -> pd.DataFrame:
        """The table under canonical names and units; columns not in the map are kept as they are.

        Args:
            path: for messages.
            table: as read.
            ranges: of the ship's orders and positions, for what is given in percent of them.

        Raises:
            RecordingError: the map names a column that the recording does not have, gives a
                canonical column that it has already, or a time stamp cannot be read; a formula uses a
                column that is not there, or has no finite value in a row.
        """
        sources = sorted(self.sources.items(), key=lambda pair: pair[1].formula is not None)
        plain = [name for name, source in sources if source.formula is None]
        result = table.drop(columns=[name for name in plain if name in table])
        for name, source in sources:
            if source.formula is None and name not in table:
                raise RecordingError(
                    f"{path}: column {name!r} of the column map is missing; "
                    f"found: {', '.join(map(str, table.columns))}"
                )
            if source.column in result:
                raise RecordingError(
                    f"{path}: {source.column} is in the recording and given by {name!r} as well"
                )
            try:
                if source.formula is not None:
                    values, stated = worked_out(source.formula, source.names, table, result), None
                else:
                    values, stated = table[name], table.attrs.get("units", {}).get(name)
                if isinstance(source, Heard):
                    result[source.column] = source.convert(values)
                else:
                    result[source.column] = source.with_unit_of_file(stated).convert(values, ranges)
            except ValueError as error:
                raise RecordingError(f"{path}: {name!r} as {source.column}: {error}") from None
        return result


def load_map(path: str | Path) -> ColumnMap:
    """Read a column map.

    Args:
        path: TOML file; see the module's head and ``docs/recordings.md``.

    Raises:
        RecordingError: unreadable, or a key that is missing, unknown, of the wrong type or out of
            range; the message names file, key and what is allowed.
    """
    path = Path(path)
    try:
        return ColumnMap.model_validate(read_toml(path))
    except FileError as error:
        raise RecordingError(str(error)) from None
    except ValidationError as error:
        lines = [f"{path}: {_explained(dict(item))}" for item in error.errors()]
        raise RecordingError("\n".join(lines)) from None


def _explained(item: dict[str, Any]) -> str:
    """One pydantic error as a sentence with key and what is allowed."""
    key = ".".join(map(str, item["loc"])) or "the map"
    what = item["ctx"]["error"] if item["type"] == "value_error" else item["msg"].lower()
    if item["type"] == "missing":
        return f"{key} is missing"
    if item["type"] == "extra_forbidden":
        tables: dict[Any, type[BaseModel]] = {"signals": Heard, "file": FileLayout}
        known = ColumnMap if len(item["loc"]) == 1 else tables.get(item["loc"][0], Source)
        return f"{key} is not a known key (allowed: {', '.join(known.model_fields)})"
    return f"{key}: {what}"
