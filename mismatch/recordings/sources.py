"""Where one column comes from, and how its values are carried over to the canonical unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias

import pandas as pd
from pydantic import (
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from ...core.models import FileModel
from ...plant.columns import BOUNDS, COLUMNS, TIME
from ...plant.expressions import FUNCTIONS
from ...plant.terms import OF_A_TURN, TERM_SIGNALS, Name
from .formula import check_formula
from .time_base import seconds_of_stamps
from .units import registry, unit_of

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
