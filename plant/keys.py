"""How a number of a ship's file is declared: key with unit, allowed range, meaning, place in the record.

Each number stands once, in its section: its TOML key (with unit), its range, its neutral value where it
is an effect that a ship may or may not have, and the name of its field in the kernels' record.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

from .validity import Validity

INF = math.inf


def _in_print(text: str) -> str:
    if not text.isprintable():  # a terminal would obey the rest
        raise ValueError("holds signs that cannot be printed")
    return text


Label: TypeAlias = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_in_print)]
"""A name that is shown."""

Line: TypeAlias = Annotated[str, Field(max_length=1000), AfterValidator(_in_print)]
"""A sentence or two that are shown."""


LACKING = {
    "has_propeller": "has no propeller",
    "moves": "has a hull that is fixed",
    "turns": "does not turn: it has no manoeuvring.length_m",
    "turns_freely": "has a shaft whose speed is held",
    "meets_water": "has neither a propeller nor a hull that moves",
    "has_variable_pitch": "has a fixed pitch",
    "has_diesel": "has no diesel",
    "has_voltage": "has no motor under a voltage",
    "in_water": "turns in a fluid that is not water (water.density_kg_m3)",
    "in_liquid": "turns in a gas (water.density_kg_m3)",
    "has_constant_coefficients": "has a propeller whose KT and KQ follow J",
}
"""What a number may need of its ship, by the ship's property, and how a ship is called without it."""


def number(
    description: str,
    unit: str = "-",
    *,
    record: str,
    needs: str = "",
    required: str = "",
    lag: bool = False,
    **limits: Any,
) -> Any:
    """A number of a ship.

    Args:
        description: what it is.
        unit: SI.
        record: its field in the kernels' record.
        needs: names of :data:`LACKING`; on a ship without one of them it acts on nothing.
        required: when it must be given although it has a default: ``with a propeller``.
        lag: whether it is a time constant [s] of a state that the Runge-Kutta steps integrate.
        limits: pydantic's ``ge``, ``gt``, ``le``, ``lt`` and ``default``.
    """
    extra: dict[str, Any] = {"unit": unit, "record": record, "needs": needs, "required": required}
    if lag:
        extra["lag"] = True
    if limits.get("default") == INF:
        limits["allow_inf_nan"] = (
            True  # the lower bound that each such key has refuses nan and -inf
        )
    return Field(description=description, json_schema_extra=extra, **limits)


def measure(description: str, unit: str, **limits: Any) -> Any:
    """A number with a unit that its section writes into the record itself.

    Args:
        description: what it is.
        unit: as its key has it.
        limits: as of a number.
    """
    return Field(description=description, json_schema_extra={"unit": unit}, **limits)


def entry(
    description: str, *, record: str, place: tuple[int, ...], needs: str, **limits: Any
) -> Any:
    """A number without a unit that is one entry of a field of the kernels' record.

    The section writes it itself, with the others of that field.

    Args:
        description: what it is.
        record: the field.
        place: in it.
        needs: as of a number.
        limits: likewise.
    """
    extra: dict[str, Any] = {"unit": "-", "entry": (record, place), "needs": needs}
    return Field(description=description, json_schema_extra=extra, **limits)


def effect(neutral: float, description: str, unit: str = "-", *, record: str, **more: Any) -> Any:
    """A number whose ``neutral`` value means that the effect is absent; the rest as of a number."""
    field = number(description, unit, record=record, default=neutral, **more)
    field.json_schema_extra["effect"] = True
    return field


class Section(BaseModel):
    """A table of a ship's file: immutable, strictly typed, no unknown keys, every number finite.

    Infinity is allowed for a key whose own default is infinity, where it means that a limit is absent.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    derived: ClassVar[tuple[tuple[Any, ...], ...]] = ()
    """Further fields of the kernels' record, worked out from the section's keys, as NumPy has them."""
    needs: ClassVar[str] = ""
    """What all of its numbers need of their ship: names of :data:`LACKING`."""
    validity: ClassVar[tuple[Validity, ...]] = ()
    """Ranges in which the section's models hold."""

    @property
    def time_constants(self) -> dict[str, float]:
        """Time constants [s] in force, by key, that the time step has to resolve; 0 is none."""
        values = {
            k: getattr(self, k) for k, info in type(self).model_fields.items() if is_lag(info)
        }
        return {key: float(value) for key, value in values.items() if value > 0.0}

    def fill(self, record: Any) -> None:
        """Write the section's numbers into a ship's record; a section with ``derived`` adds those."""
        for key, info in type(self).model_fields.items():
            field = record_field(info)
            if field is not None:
                record[field] = getattr(self, key)


class MissingKeyError(ValueError):
    """A key of a section that is left out and must not be; the message begins with the key."""


def require(section: BaseModel, keys: tuple[str, ...], because: str, before: str = "") -> None:
    """Refuse a section in which keys are left out that another key's value asks for.

    Args:
        section: that lacks them.
        keys: of it.
        because: why they are needed.
        before: what stands before the key in the message, where the section is not named already.

    Raises:
        MissingKeyError: names the first key that is missing, with its unit and range.
    """
    for key in keys:
        if key not in section.model_fields_set:
            info = type(section).model_fields[key]
            raise MissingKeyError(
                f"{before}{key} is missing; it is required {because} "
                f"(unit {unit_of(info)}; allowed: {allowed_range(info)})"
            )


INSIDE = 1e-3
"""Share of the way from an excluded bound to a number that a search keeps away from the bound."""


class KeyInfo(NamedTuple):
    """Unit and range of a ship's number; ``neutral`` is None where it describes no effect.

    ``above`` and ``below`` say that the lowest and the highest value are themselves not allowed. Values
    between 0 and ``gap`` are time constants that the time step cannot resolve.
    """

    unit: str
    low: float
    high: float
    neutral: float | None
    above: bool = False
    below: bool = False
    gap: float = 0.0

    def inside(self, value: float) -> float:
        """Return the nearest value that the ship can have: within the range and outside the gap."""
        value = min(max(value, self.low), self.high)
        if 0.0 < value < self.gap:
            return self.gap if value >= 0.5 * self.gap else 0.0
        return value

    def around(self, value: float) -> tuple[float, float]:
        """Return the lowest and the highest value that a search may try, both of them allowed.

        Args:
            value: from which the search starts, in the key's unit; inside the range or infinite.
        """
        value = value if math.isfinite(value) else self.low + 1.0
        low = self.low + INSIDE * (value - self.low) if self.above else self.low
        high = self.high - INSIDE * (self.high - value) if self.below else self.high
        return low, high


class Number(NamedTuple):
    """A number that stands in a ship's file, and its place in the kernels' record."""

    key: str  # dotted
    value: float
    info: KeyInfo
    field: str  # of the record
    place: tuple[int, ...] = ()  # in a field that holds several

    @property
    def searched(self) -> tuple[float, float]:
        """Lowest and highest value that a search from here may try; a ship's file allows both."""
        return self.info.around(self.value)

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
    """Unit, range and neutral value of a number, and which bounds are excluded (> or <)."""
    ends = {
        name: [getattr(limit, name) for limit in info.metadata if hasattr(limit, name)]
        for name in ("ge", "gt", "le", "lt")
    }
    low, high = max((-INF, *ends["ge"], *ends["gt"])), min((INF, *ends["le"], *ends["lt"]))
    extra = info.json_schema_extra
    effect = isinstance(extra, dict) and "effect" in extra
    neutral = float(info.default) if effect else None
    return KeyInfo(
        unit_of(info), float(low), float(high), neutral, low in ends["gt"], high in ends["lt"]
    )


def allowed_range(info: FieldInfo) -> str:
    """Allowed range of a number, or the names that a key takes, in words."""
    if get_origin(info.annotation) is Literal:
        return ", ".join(map(str, get_args(info.annotation)))
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


def is_lag(info: FieldInfo) -> bool:
    """Return whether a number is the time constant of a state that is integrated in steps."""
    extra = info.json_schema_extra
    return isinstance(extra, dict) and "lag" in extra


def needs_of(info: FieldInfo) -> str:
    """What a number needs of its ship: names of :data:`LACKING`."""
    extra = info.json_schema_extra
    return str(extra.get("needs", "")) if isinstance(extra, dict) else ""


def required_when(info: FieldInfo) -> str:
    """When a number that has a default must be given, in words; empty if never."""
    extra = info.json_schema_extra
    return str(extra.get("required", "")) if isinstance(extra, dict) else ""


def default_of(info: FieldInfo) -> str:
    """Default of a number in words, or when it is required."""
    when = required_when(info)
    if info.is_required() or when:
        return f"required {when}".strip()
    return f"{info.default}"


def place_of(info: FieldInfo) -> tuple[str, tuple[int, ...]] | None:
    """Field of the kernels' record that holds a number, and the place in it; None for what has none."""
    field = record_field(info)
    if field is not None:
        return field, ()
    extra = info.json_schema_extra
    found: Any = extra.get("entry") if isinstance(extra, dict) else None
    return found if found is None else (str(found[0]), tuple(found[1]))


def record_field(info: FieldInfo) -> str | None:
    """Name of a number's field in the kernels' record; None for what stays outside."""
    extra = info.json_schema_extra
    return str(extra["record"]) if isinstance(extra, dict) and "record" in extra else None
