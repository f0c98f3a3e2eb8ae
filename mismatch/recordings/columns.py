"""Column maps: foreign names, units and signs carried onto the canonical columns.

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

from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pandas as pd
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
from ...plant.recording import RecordingError
from .file_layout import FileLayout
from .formula import columns_in, worked_out
from .sources import PERCENT, PERCENT_OF_RANGE, Heard, Ranges, Source


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
