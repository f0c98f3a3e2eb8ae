"""Ships as data: TOML files, validated, and turned into the record that the kernels take."""

from __future__ import annotations

import functools
import math
import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import tomli_w
from pydantic import BaseModel, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from ..core.files import write_text
from . import four_quadrant, prime_mover, propeller, unexplained
from .ship_sections import (
    INF,
    DcMotor,
    Diesel,
    Hull,
    Integration,
    KeyInfo,
    PitchActuator,
    Propeller,
    Section,
    Sensors,
    Tolerances,
    TorqueSource,
    Transmission,
    Unexplained,
    Ventilation,
    Water,
    allowed_range,
    info_of,
    record_field,
    unit_of,
)


class ShipError(ValueError):
    """A ship that cannot be used; the message names file, key, unit and allowed range."""


HISTORY = 128
"""Samples that a delay can look back."""


class Ship(Section):
    """A ship: everything that the plant needs to know, immutable.

    Use :func:`load_ship` to get one, :meth:`with_values` to vary it, :meth:`record` for the kernels.
    """

    name: str
    description: str = ""
    water: Water
    hull: Hull
    propeller: Propeller
    ventilation: Ventilation = Ventilation()
    prime_mover: Annotated[Diesel | DcMotor | TorqueSource, Field(discriminator="type")]
    transmission: Transmission
    pitch_actuator: PitchActuator = PitchActuator()
    sensors: Sensors = Sensors()
    integration: Integration = Integration()
    tolerances: Tolerances = Tolerances()
    unexplained: Unexplained | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Ship:
        step = self.integration.time_step_s
        longest = step * (HISTORY - 2)
        delays = {"sensors.torque_delay_s": self.sensors.torque_delay_s}
        if isinstance(self.prime_mover, Diesel):
            delays["prime_mover.dead_time_s"] = self.prime_mover.dead_time_s
        for key, delay in delays.items():
            if delay > longest:
                raise ValueError(
                    f"{key} = {delay} s is more than {longest:.4g} s, "
                    f"the longest delay at a time step of {step} s"
                )
        lacking = self.unexplained.balance if self.unexplained else ""
        if lacking == "hull" and self.hull.fixed:
            raise ValueError("unexplained.balance = 'hull' asks for a hull that is not fixed")
        screw = self.propeller
        if lacking == "pitch-actuator" and screw.pitch_ratio_min == screw.pitch_ratio_max:
            raise ValueError("unexplained.balance = 'pitch-actuator' asks for a variable pitch")
        motor = self.prime_mover
        if isinstance(motor, DcMotor) and motor.armature_inductance_H > 0.0:
            constant = motor.armature_inductance_H / motor.armature_resistance_ohm
            if step > constant:
                raise ValueError(
                    f"integration.time_step_s = {step} s must not exceed the armature's time "
                    f"constant L/R = {constant:.3g} s"
                )
        return self

    @property
    def time_step_s(self) -> float:
        """Time step of the integration [s]."""
        return self.integration.time_step_s

    def with_values(self, values: dict[str, Any]) -> Ship:
        """A copy with some values changed, validated like a file.

        Args:
            values: by dotted key, for example ``{"transmission.gear_ratio": 7.0}``.

        Raises:
            ShipError: unknown key, or a value out of range.
        """
        tree = self.model_dump(exclude_unset=True)
        for dotted, value in values.items():
            *path, key = dotted.split(".")
            section = tree
            for part in path:
                section = section.setdefault(part, {})
                if not isinstance(section, dict):
                    raise ShipError(f"{self.name}: no section {part!r} in {dotted!r}")
            section[key] = value
        return _validated(tree, self.name)

    def record(self) -> Any:
        """The kernels' record of this ship: one element of dtype :data:`PLANT`, yours to change."""
        return _record(self).copy()

    def _sections(self) -> list[BaseModel]:
        return [
            v
            for v in (getattr(self, k) for k in type(self).model_fields)
            if isinstance(v, BaseModel)
        ]


@functools.lru_cache(maxsize=256)
def _record(ship: Ship) -> Any:
    record = np.zeros(1, PLANT)[0]
    for section in ship._sections():
        for key, info in type(section).model_fields.items():
            field = record_field(info)
            if field is not None:
                record[field] = getattr(section, key)
    screw = ship.propeller
    record["propellers"] = ship.hull.propellers
    record["hull_fixed"] = ship.hull.fixed
    record["expanded_area_ratio"] = screw.expanded_area_ratio
    record["blade_solidity"] = 2.073 * screw.expanded_area_ratio  # c Z / D at 0.75 R, B-series
    if screw.model == "bollard":
        record["kt"] = propeller.constant_coefficient(screw.thrust_coefficient)
        record["kq"] = propeller.constant_coefficient(screw.torque_coefficient)
    else:
        record["kt"] = propeller.b_series("KT", screw.expanded_area_ratio, screw.blades)
        record["kq"] = propeller.b_series("KQ", screw.expanded_area_ratio, screw.blades)
    record["four_quadrant_pitch"] = four_quadrant.PITCH_NODES
    if screw.model == "four-quadrant":
        record["propeller_model"] = propeller.FOUR_QUADRANT
        powers = np.power.outer(four_quadrant.PITCH_NODES, propeller.PITCH_POWERS)
        record["four_quadrant"] = four_quadrant.scaled_to_bollard(
            powers @ record["kt"][:, 0], powers @ record["kq"][:, 0]
        )
    mover = ship.prime_mover
    if isinstance(mover, Diesel):
        record["prime_mover"] = prime_mover.DIESEL
        record["engine_speed_min"] = mover.speed_min_rpm * math.pi / 30.0
        record["engine_speed_max"] = mover.speed_max_rpm * math.pi / 30.0
    else:
        is_motor = isinstance(mover, DcMotor)
        record["prime_mover"] = prime_mover.DC_MOTOR if is_motor else prime_mover.TORQUE
        record["drive_min"] = -record["drive_max"]
        record["rack_rate_limit"] = INF
    lacking = ship.unexplained
    if lacking is not None:
        record["unexplained_balance"] = 1 + unexplained.BALANCES.index(lacking.balance)
        record["unexplained_signal"] = unexplained.FOLLOWED.index(lacking.signal)
        record["unexplained_count"] = len(lacking.knots)
        record["unexplained_knots"][: len(lacking.knots)] = lacking.knots
        record["unexplained_values"][: len(lacking.values)] = lacking.values
    return record


def _number_of(dotted: str, ship: Ship) -> FieldInfo:
    """The number behind a dotted key of this ship, whose prime mover decides about its keys."""
    section, _, key = dotted.partition(".")
    table = getattr(ship, section, None) if section in type(ship).model_fields else None
    fields = type(table).model_fields if isinstance(table, BaseModel) else {}
    if key not in fields:
        raise ShipError(f"{ship.name}: {dotted} is not a known key")
    if record_field(fields[key]) is None:
        raise ShipError(f"{ship.name}: {dotted} has no field of its own in the kernels' record")
    return fields[key]


def record_name(dotted: str, ship: Ship) -> str:
    """Field of the ship's record that a dotted key sets.

    Writing ``record[record_name(key, ship)] = value`` is what ``with_values`` does, without its
    checks; only a motor's end stop also sets ``drive_min``, to its negative.

    Raises:
        ShipError: unknown key, or one that is not a single number of the record.
    """
    return str(record_field(_number_of(dotted, ship)))


def key_info(dotted: str, ship: Ship) -> KeyInfo:
    """Unit, range and neutral value of a dotted key.

    Raises:
        ShipError: unknown key, or one that is not a single number of the record.
    """
    return info_of(_number_of(dotted, ship))


def _section_types() -> list[type[BaseModel]]:
    """All sections that a ship may have, each kind of prime mover included."""
    kinds = [k for info in Ship.model_fields.values() for k in _kinds(info.annotation)]
    return [k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)]


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """Members of a union, or the one type itself."""
    return get_args(annotation) or (annotation,)


def _plant_dtype() -> np.dtype[Any]:
    names: dict[str, None] = {}
    for section in _section_types():
        for info in section.model_fields.values():
            field = record_field(info)
            if field is not None:
                names[field] = None
    derived = [
        "propellers",
        "expanded_area_ratio",
        "blade_solidity",
        "drive_min",
        "engine_speed_min",
        "engine_speed_max",
    ]
    codes = (
        "propeller_model",
        "prime_mover",
        "hull_fixed",
        "unexplained_balance",
        "unexplained_signal",
        "unexplained_count",
    )
    nodes = len(four_quadrant.PITCH_NODES)
    return np.dtype(
        [(name, np.float64) for name in (*names, *derived)]
        + [(name, np.int64) for name in codes]
        + [
            ("unexplained_knots", np.float64, (unexplained.MAX_KNOTS,)),
            ("unexplained_values", np.float64, (unexplained.MAX_KNOTS,)),
            ("kt", np.float64, propeller.CURVE_SHAPE),
            ("kq", np.float64, propeller.CURVE_SHAPE),
            ("four_quadrant_pitch", np.float64, (nodes,)),
            ("four_quadrant", np.float64, (nodes, four_quadrant.HARMONICS, 4)),
        ],
        align=True,
    )


PLANT = _plant_dtype()
"""Structured dtype of a ship in the kernels; an array of it is a batch of ships."""


def ship_names() -> list[str]:
    """Names of the ships that come with the package."""
    folder = resources.files("shaftline.plant").joinpath("ships")
    return sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml"))


@functools.lru_cache(maxsize=64)
def _load_preset(name: str) -> Ship:
    file = resources.files("shaftline.plant").joinpath(f"ships/{name}.toml")
    return _parsed(file.read_text(encoding="utf-8"), f"{name}.toml")


def load_ship(ship: str | Path | Ship) -> Ship:
    """A ship by preset name or by the path of a TOML file.

    Args:
        ship: name (see :func:`ship_names`), path ending in ``.toml``, or a Ship, returned as it is.

    Raises:
        ShipError: unknown name, unreadable file, or a value that is missing, unknown, of the wrong
            type or out of range; the message names file, key, unit and allowed range.
    """
    if isinstance(ship, Ship):
        return ship
    if isinstance(ship, str) and ship in ship_names():
        return _load_preset(ship)
    path = Path(ship)
    if path.suffix != ".toml":
        raise ShipError(
            f"unknown ship {str(ship)!r}; known ships: {', '.join(ship_names())}; "
            "or give the path of a .toml file"
        )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ShipError(f"{path}: cannot be read: {error}") from None
    return _parsed(text, str(path))


def _parsed(text: str, source: str) -> Ship:
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ShipError(f"{source}: not valid TOML: {error}") from None
    return _validated(tree, source)


def _validated(tree: dict[str, Any], source: str) -> Ship:
    try:
        return Ship.model_validate(tree)
    except ValidationError as error:
        lines = [f"{source}: {_explained(dict(item))}" for item in error.errors()]
        raise ShipError("\n".join(lines)) from None


def write_ship(ship: Ship, path: Path) -> Path:
    """Write a ship as a TOML file that :func:`load_ship` reads back to an equal ship.

    Keys that were left out stay out; the comments of a file that it came from are lost.

    Args:
        ship: the ship.
        path: ending in ``.toml``; its folder is made where needed.

    Returns:
        The same path.

    Raises:
        ValueError: the path does not end in ``.toml``.
        OSError: the file cannot be written.
    """
    if path.suffix != ".toml":
        raise ValueError(f"{path}: a ship's file ends in .toml")
    write_text(path, tomli_w.dumps(ship.model_dump(exclude_unset=True, exclude_none=True)))
    return path


def ship_keys() -> list[tuple[str, str, str, str, str]]:
    """Every key of a ship file: dotted name, unit, allowed range, default, description."""
    rows = []
    for section, info in Ship.model_fields.items():
        kinds = _kinds(info.annotation)
        options = [k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel)]
        for kind in options:
            for key, field in kind.model_fields.items():
                label = f"{section}.{key}"
                if len(options) > 1 and key != "type":
                    label += f" ({get_args(kind.model_fields['type'].annotation)[0]})"
                names = [str(a) for a in get_args(field.annotation) if isinstance(a, str)]
                allowed = ", ".join(names) or ("true, false" if field.annotation is bool else "")
                default = "required" if field.is_required() else f"{field.default}"
                rows.append(
                    (
                        label,
                        unit_of(field),
                        allowed or allowed_range(field),
                        default,
                        field.description or "",
                    )
                )
    return rows


def _explained(item: dict[str, Any]) -> str:
    """One pydantic error as a sentence with key, unit, given value and allowed range."""
    tags = {"diesel", "dc-motor", "torque-command"}
    path = [str(part) for part in item["loc"] if part not in tags]
    key = ".".join(path) or "ship"
    table = Ship.model_fields.get(path[0]) if path else None  # one key may stand in two sections
    info = next(
        (
            section.model_fields[path[-1]]
            for section in (_kinds(table.annotation) if table else ())
            if path[-1] in getattr(section, "model_fields", {})
        ),
        None,
    )
    allowed = ""
    if info is not None:
        allowed = f" (unit {unit_of(info)}; allowed: {allowed_range(info)})"
    kind = item["type"]
    if kind.startswith("union_tag"):
        given = item["ctx"].get("tag")
        what = "is missing" if given is None else f"= {given!r} is unknown"
        return f"{key}.type {what} (allowed: {', '.join(sorted(tags))})"
    if kind == "missing":
        return f"{key} is missing{allowed}"
    if kind == "extra_forbidden":
        return f"{key} is not a known key"
    if kind == "value_error":
        section = ".".join(str(part) for part in item["loc"] if part not in tags)
        return f"{section}: {item['ctx']['error']}" if section else str(item["ctx"]["error"])
    return f"{key} = {item.get('input')!r}: {item['msg'].lower()}{allowed}"
