"""Declaration of the parameters of a ship: TOML key, unit, allowed range, meaning, field in the record.

Each parameter is declared once, in its section: its TOML key (with the unit as suffix), its range, its
neutral value if it is an optional effect, and the name of its field in the kernels' ship record.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple, TypeAlias

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

from ..core.models import allowed_range
from .validity import Validity

INF = math.inf


def _printable(text: str) -> str:
    if not text.isprintable():  # A terminal would execute control characters.
        raise ValueError("contains control characters; use printable characters only")
    return text


Label: TypeAlias = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_printable)]
"""A short name that is displayed."""

Line: TypeAlias = Annotated[str, Field(max_length=1000), AfterValidator(_printable)]
"""One or two sentences that are displayed."""


MISSING_PROPERTIES = {
    "has_propeller": "has no propeller",
    "moves": "has a hull that is fixed",
    "turns": "does not turn: it has no manoeuvring.length_m",
    "rolls": "does not roll: it has no roll.metacentric_height_m",
    "turns_freely": "has a shaft whose speed is held",
    "meets_water": "has neither a propeller nor a hull that moves",
    "has_variable_pitch": "has a fixed pitch",
    "has_diesel": "has no diesel",
    "has_voltage": "has no motor under a voltage",
    "in_water": "turns in a fluid that is not water (water.density_kg_m3)",
    "in_liquid": "turns in a gas (water.density_kg_m3)",
    "has_constant_coefficients": "has a propeller whose KT and KQ follow J",
}
"""Properties of a ship that a parameter may require, each with the phrase for a ship that lacks it."""


def parameter(
    description: str,
    unit: str = "-",
    *,
    record: str,
    needs: str = "",
    required: str = "",
    lag: bool = False,
    **limits: Any,
) -> Any:
    """Declare a parameter of a ship.

    Args:
        description: meaning of the parameter.
        unit: SI unit.
        record: field of the kernels' ship record that holds the value.
        needs: names of :data:`MISSING_PROPERTIES`, separated by spaces. On a ship that lacks one of
            these properties the parameter has no effect.
        required: condition under which a parameter with a default must be given: ``with a propeller``.
        lag: whether it is the time constant [s] of a state that the Runge-Kutta steps integrate.
        limits: ``ge``, ``gt``, ``le``, ``lt`` and ``default``, as in pydantic.
    """
    extra: dict[str, Any] = {
        "unit": unit,
        "record": record,
        "needs": needs,
        "required": required,
        "lag": lag,
    }
    if limits.get("default") == INF:  # The lower bound of each such key refuses nan and -inf.
        limits["allow_inf_nan"] = True
    return Field(description=description, json_schema_extra=extra, **limits)


def quantity(description: str, unit: str, **limits: Any) -> Any:
    """Declare a parameter with a unit in its key that its section converts for the record."""
    return Field(description=description, json_schema_extra={"unit": unit}, **limits)


def entry(
    description: str, *, record: str, place: tuple[int, ...], needs: str, **limits: Any
) -> Any:
    """Declare a dimensionless parameter: entry ``place`` of the array field ``record``."""
    extra: dict[str, Any] = {"entry": (record, place), "needs": needs}
    return Field(description=description, json_schema_extra=extra, **limits)


def effect(neutral: float, description: str, unit: str = "-", *, record: str, **more: Any) -> Any:
    """Declare a parameter whose ``neutral`` value switches its effect off; see :func:`parameter`."""
    field = parameter(description, unit, record=record, default=neutral, **more)
    field.json_schema_extra["effect"] = True
    return field


class Section(BaseModel):
    """A table of a ship file: immutable, strictly typed, without unknown keys, every number finite.

    Infinity is allowed only for a key whose default is infinity: such a limit is absent.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    derived: ClassVar[tuple[tuple[Any, ...], ...]] = ()
    """Further fields of the ship record that ``fill`` computes from the keys, as NumPy dtype entries."""
    needs: ClassVar[str] = ""
    """Properties that all parameters of the section require: names of :data:`MISSING_PROPERTIES`."""
    validity: ClassVar[tuple[Validity, ...]] = ()
    """Ranges of validity of the section's models."""

    @property
    def time_constants(self) -> dict[str, float]:
        """Return the non-zero time constants [s] that the time step has to resolve, by key."""
        lags = (key for key, info in type(self).model_fields.items() if is_lag(info))
        return {key: float(getattr(self, key)) for key in lags if getattr(self, key) > 0.0}

    def fill(self, record: Any) -> None:
        """Write the section's values into a ship record; sections with ``derived`` fields extend it."""
        for key, info in type(self).model_fields.items():
            field = record_field(info)
            if field is not None:
                record[field] = getattr(self, key)


class MissingKeyError(ValueError):
    """A required key is missing; the message begins with the key."""


def require(section: BaseModel, keys: tuple[str, ...], because: str, before: str = "") -> None:
    """Refuse a section in which keys are missing that the value of another key requires.

    The MissingKeyError names the first missing key, behind the prefix ``before`` (such as ``water.``),
    with its unit and range, and ``because``, the condition that makes the keys required.
    """
    for key in keys:
        if key not in section.model_fields_set:
            allowed = unit_and_range(type(section).model_fields[key])
            raise MissingKeyError(f"{before}{key} is missing; it is required {because}{allowed}")


INSIDE = 1e-3
"""Distance that a search keeps from an excluded bound, as a fraction of the distance to its start."""


class KeyInfo(NamedTuple):
    """Unit and allowed range of a parameter; ``neutral`` is None if it does not switch an effect off.

    ``above`` and ``below`` mean that the bounds ``low`` and ``high`` themselves are excluded. Values
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
        """Return the nearest allowed value: within the range and outside the gap."""
        value = min(max(value, self.low), self.high)
        if 0.0 < value < self.gap:
            return self.gap if value >= 0.5 * self.gap else 0.0
        return value

    def around(self, value: float) -> tuple[float, float]:
        """Return allowed bounds of a search from a value that is inside the range or infinite."""
        value = value if math.isfinite(value) else self.low + 1.0
        low = self.low + INSIDE * (value - self.low) if self.above else self.low
        high = self.high - INSIDE * (self.high - value) if self.below else self.high
        return low, high


class ShipParameter(NamedTuple):
    """A parameter of one ship: its value, and its location in the kernels' ship record."""

    key: str  # dotted
    value: float
    info: KeyInfo
    field: str  # of the ship record
    place: tuple[int, ...] = ()  # index, if the field is an array

    @property
    def search_range(self) -> tuple[float, float]:
        """Bounds of a search that starts at the present value; a ship file may hold both of them."""
        return self.info.around(self.value)

    def clipped(self, value: float) -> float:
        """Return the nearest value within the bounds of a search that the ship file allows."""
        low, high = self.search_range
        return self.info.inside(min(max(value, low), high))

    def write(self, record: Any, value: float) -> None:
        """Write another value into a ship record, without the checks of :meth:`Ship.with_values`.

        The end stop of a motor is the one exception: ``with_values`` also sets ``drive_min``.
        """
        if self.place:
            record[self.field][self.place] = value
        else:
            record[self.field] = value

    def read(self, record: Any) -> float:
        """Return the value in a ship record."""
        return float(record[self.field][self.place] if self.place else record[self.field])


def declared(info: FieldInfo, name: str, default: Any = None) -> Any:
    """Return an entry of a parameter's declaration, or the default: see :func:`parameter`."""
    extra: Any = info.json_schema_extra
    return extra.get(name, default) if isinstance(extra, dict) else default


def info_of(info: FieldInfo) -> KeyInfo:
    """Return unit, range, neutral value and excluded bounds of a declared parameter."""
    ends = {
        name: [getattr(limit, name) for limit in info.metadata if hasattr(limit, name)]
        for name in ("ge", "gt", "le", "lt")
    }
    low, high = max((-INF, *ends["ge"], *ends["gt"])), min((INF, *ends["le"], *ends["lt"]))
    neutral = float(info.default) if declared(info, "effect") else None
    bounds = float(low), float(high)
    return KeyInfo(unit_of(info), *bounds, neutral, low in ends["gt"], high in ends["lt"])


def unit_and_range(info: FieldInfo) -> str:
    """Return unit and allowed range of a parameter as the end of a message."""
    return f" (unit {unit_of(info)}; allowed: {allowed_range(info)})"


def unit_of(info: FieldInfo) -> str:
    """Return the unit of a parameter."""
    return str(declared(info, "unit", "-"))


def is_lag(info: FieldInfo) -> bool:
    """Return whether a parameter is the time constant of a state that is integrated in steps."""
    return bool(declared(info, "lag"))


def default_of(info: FieldInfo) -> str:
    """Return the default of a parameter, or when it is required, as text."""
    when = declared(info, "required", "")
    return f"required {when}".strip() if info.is_required() or when else f"{info.default}"


def place_of(info: FieldInfo) -> tuple[str, tuple[int, ...]] | None:
    """Return the field of the ship record, and the index in it, of a parameter; None if it has none."""
    field = record_field(info)
    if field is not None:
        return field, ()
    place: tuple[str, tuple[int, ...]] | None = declared(info, "entry")
    return place


def record_field(info: FieldInfo) -> str | None:
    """Return the name of a parameter's own field in the ship record; None if it has none."""
    field: str | None = declared(info, "record")
    return field
