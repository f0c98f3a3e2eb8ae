"""How a number of a ship's file is declared: key with unit, allowed range, meaning, place in the record.

Each number stands once, in its section: its TOML key (with unit), its range, its neutral value where it
is an effect that a ship may or may not have, and the name of its field in the kernels' record.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

INF = math.inf


def number(description: str, unit: str = "-", *, record: str, **limits: Any) -> Any:
    """A number of a ship.

    Args:
        description: what it is.
        unit: SI.
        record: its field in the kernels' record.
        limits: pydantic's ``ge``, ``gt``, ``le``, ``lt`` and ``default``.
    """
    return Field(
        description=description, json_schema_extra={"unit": unit, "record": record}, **limits
    )


def effect(neutral: float, description: str, unit: str = "-", *, record: str, **limits: Any) -> Any:
    """A number whose ``neutral`` value means that the effect is absent; the rest as of a number."""
    field = number(description, unit, record=record, default=neutral, **limits)
    field.json_schema_extra["effect"] = True
    return field


class Section(BaseModel):
    """A table of a ship's file: immutable, strictly typed, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    derived: ClassVar[tuple[tuple[Any, ...], ...]] = ()
    """Further fields of the kernels' record, worked out from the section's keys, as NumPy has them."""

    def fill(self, record: Any) -> None:
        """Write the section's numbers into a ship's record; a section with ``derived`` adds those."""
        for key, info in type(self).model_fields.items():
            field = record_field(info)
            if field is not None:
                record[field] = getattr(self, key)


def require(section: BaseModel, keys: tuple[str, ...], because: str) -> None:
    """Refuse a section in which keys are left out that another key's value asks for.

    Raises:
        ValueError: names the first key that is missing.
    """
    absent = [key for key in keys if key not in section.model_fields_set]
    if absent:
        raise ValueError(f"{absent[0]} is missing; it is required {because}")


class KeyInfo(NamedTuple):
    """Unit and range of a ship's number; ``neutral`` is None where it describes no effect."""

    unit: str
    low: float
    high: float
    neutral: float | None


class Number(NamedTuple):
    """A number that stands in a ship's file, and its place in the kernels' record."""

    key: str  # dotted
    value: float
    info: KeyInfo
    field: str  # of the record
    place: tuple[int, ...] = ()  # in a field that holds several

    def write(self, record: Any, value: float) -> None:
        """Put another value into a record: what ``with_values`` does, without its checks.

        Only a motor's end stop also sets ``drive_min``, to its negative.
        """
        if self.place:
            record[self.field][self.place] = value
        else:
            record[self.field] = value

    def read(self, record: Any) -> float:
        """The value that stands in a record."""
        return float(record[self.field][self.place] if self.place else record[self.field])


def info_of(info: FieldInfo) -> KeyInfo:
    """Unit, range and neutral value of a number; a bound may itself be excluded (> or <)."""
    low, high = -INF, INF
    for limit in info.metadata:
        low = max(low, getattr(limit, "ge", -INF), getattr(limit, "gt", -INF))
        high = min(high, getattr(limit, "le", INF), getattr(limit, "lt", INF))
    extra = info.json_schema_extra
    effect = isinstance(extra, dict) and "effect" in extra
    neutral = float(info.default) if effect else None
    return KeyInfo(unit_of(info), float(low), float(high), neutral)


def allowed_range(info: FieldInfo) -> str:
    """Allowed range of a number, in words."""
    bounds = [
        f"{sign} {getattr(m, name):g}"
        for m in info.metadata
        for name, sign in (("ge", ">="), ("gt", ">"), ("le", "<="), ("lt", "<"))
        if getattr(m, name, None) is not None
    ]
    return " and ".join(bounds) or "any number"


def unit_of(info: FieldInfo) -> str:
    """Unit of a number."""
    extra = info.json_schema_extra
    return str(extra.get("unit", "-")) if isinstance(extra, dict) else "-"


def record_field(info: FieldInfo) -> str | None:
    """Name of a number's field in the kernels' record; None for what stays outside."""
    extra = info.json_schema_extra
    return str(extra["record"]) if isinstance(extra, dict) and "record" in extra else None
