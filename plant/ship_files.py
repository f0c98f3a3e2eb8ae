"""Ships as TOML files: those that come with the package, and one's own.

Ship files to start from: values from here, every comment from the keys' own declarations.
"""

from __future__ import annotations

import functools
import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import tomli_w
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..core.files import FileError, read_text, toml_of, write_text
from .keys import (
    LACKING,
    Section,
    allowed_range,
    default_of,
    info_of,
    needs_of,
    place_of,
    required_when,
    unit_of,
)
from .ship import Ship, ShipError, kinds, tag_of, validated
from .tolerances import Tolerances, spoken_of


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
    path = Path(path)
    if path.suffix != ".toml":
        raise ShipError(
            f"unknown ship {str(ship)!r}; known ships: {', '.join(ship_names())}; "
            "or give the path of a .toml file"
        )
    try:
        return _parsed(read_text(path), str(path))
    except FileError as error:
        raise ShipError(str(error)) from None


def _parsed(text: str, source: str) -> Ship:
    return validated(Ship, toml_of(text, source), source)


def write_ship(ship: Ship, path: str | Path) -> Path:
    """Write a ship as a TOML file that :func:`load_ship` reads back to an equal ship.

    Keys that were left out stay out; the comments of a file that it came from are lost.

    Args:
        ship: the ship.
        path: ending in ``.toml``; its folder is made where needed.

    Returns:
        The path.

    Raises:
        ValueError: the path does not end in ``.toml``.
        OSError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise ValueError(f"{path}: a ship's file ends in .toml")
    write_text(path, tomli_w.dumps(ship.model_dump(exclude_unset=True, exclude_none=True)))
    return path


def ship_keys() -> list[tuple[str, str, str, str, str]]:
    """Every key of a ship file: dotted name, unit, allowed range, default, description."""
    rows = []
    for section, info in Ship.model_fields.items():
        options = _sections(info)
        for kind in options:
            tag = f" ({tag_of(kind)})" if len(options) > 1 else ""
            rows += _rows(section, kind, tag)
    return rows


def _sections(info: FieldInfo) -> list[type[BaseModel]]:
    members = kinds(info.annotation)
    return [k for k in members if isinstance(k, type) and issubclass(k, BaseModel)]


def _of_kind(field: FieldInfo) -> str:
    """What a key that is no number takes."""
    if field.annotation is bool:
        return "true, false"
    origin = get_origin(field.annotation)
    if origin is dict:
        return "a table"
    members = () if origin is tuple else kinds(field.annotation)
    bare = {get_args(m)[0] if get_origin(m) is Annotated else m for m in members}
    return "text" if str in bare else ""


def _rows(path: str, kind: type[BaseModel], tag: str) -> list[tuple[str, str, str, str, str]]:
    """Rows of one section; a table within it has its keys in its place."""
    rows = []
    for key, field in kind.model_fields.items():
        if within := _sections(field):
            rows += _rows(f"{path}.{key}", within[0], tag)
            continue
        label = f"{path}.{key}" + (tag if key != "type" else "")
        names = [str(a) for a in get_args(field.annotation) if isinstance(a, str)]
        rows.append(
            (
                label,
                unit_of(field),
                ", ".join(names) or _of_kind(field) or allowed_range(field),
                default_of(field),
                field.description or "",
            )
        )
    return rows


_WIDTH = 48  # column at which comments begin, where the value leaves room
_SECTIONS_LEFT_OUT = ("name", "description", "signals", "term")

_HEAD = """\
# {description}
#
# A ship's file to start from, by `shaftline new-ship --template {template}`.
# The numbers are another ship's or made up: put yours in their place, and where each comes from into its
# comment. Keys behind a "#" are optional, with the value that acts where they are left out.
"""

_FOOT = """\
# Physics that no key describes is written as [[term]]; see docs/ships.md, "Physics of your own".
"""


def template_names() -> list[str]:
    """Names of the templates."""
    files = resources.files("shaftline.plant").joinpath("templates").iterdir()
    return sorted(f.name[:-5] for f in files if f.name.endswith(".toml"))


def template(name: str) -> Ship:
    """A template as a ship.

    Raises:
        ShipError: unknown name.
    """
    if name not in template_names():
        raise ShipError(f"unknown template {name!r}; known: {', '.join(template_names())}")
    file = resources.files("shaftline.plant").joinpath(f"templates/{name}.toml")
    tree = tomllib.loads(file.read_text(encoding="utf-8"))
    if "preset" in tree:  # the values of a ship that comes with the package
        return load_ship(tree["preset"])
    return validated(Ship, tree, f"{name}.toml")


def template_text(name: str, ship_name: str | None = None) -> str:
    """A template as a commented file that :func:`shaftline.plant.load_ship` reads.

    Args:
        name: of the template.
        ship_name: of the ship in the file; the template's own by default.

    Raises:
        ShipError: unknown template.
    """
    ship = template(name)
    head = _HEAD.format(description=ship.description, template=name)
    lines = [
        f"name = {_value(ship_name or ship.name)}",
        f"description = {_value(ship.description)}",
    ]
    parts = [head + "\n".join(lines) + "\n"]
    given = ship.model_dump(exclude_unset=True)
    for key in type(ship).model_fields:
        section = getattr(ship, key)
        if key not in _SECTIONS_LEFT_OUT and isinstance(section, Section):
            parts.append(_section(ship, key, section, given.get(key)))
    return "\n".join([*(part for part in parts if part), _FOOT])


def _section(ship: Ship, path: str, section: Section, given: dict[str, Any] | None) -> str:
    """A section with its keys: those given, then those left out, behind a ``#``."""
    off = "# " if given is None else ""
    lines, tables = [], []
    for key, info in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, Section):
            tables.append("\n" + _section(ship, f"{path}.{key}", value, (given or {})[key]))
        elif given and key in given:
            lines.append(_line(key, value, info))
    for key, info in type(section).model_fields.items():
        told = given is not None and key in given
        if not told and _acts(ship, section, info):
            lines.append("# " + _line(key, info.default, info))
    if not lines:
        return ""
    about = (type(section).__doc__ or "").strip().splitlines()[0]
    return "\n".join([f"# {about}", f"{off}[{path}]", *lines]) + "\n" + "".join(tables)


def _acts(ship: Ship, section: Section, info: FieldInfo) -> bool:
    """Whether a key that is left out may be given on this ship, and would act."""
    if info.is_required() or _is_table(info):
        return False
    if isinstance(section, Tolerances):
        return any(ship.has_key(key) for key in spoken_of(info))
    needs = f"{section.needs} {needs_of(info)}".split()
    number = place_of(info) is not None or isinstance(info.default, float)
    return (
        number and not required_when(info) and all(getattr(ship, n) for n in needs if n in LACKING)
    )


def _is_table(info: FieldInfo) -> bool:
    return any(isinstance(k, type) and issubclass(k, BaseModel) for k in kinds(info.annotation))


def _line(key: str, value: Any, info: FieldInfo) -> str:
    text = f"{key} = {_value(value)}"
    measured = type(value) is float or unit_of(info) != "-"
    said = [info.description or "", f"[{unit_of(info)}]" if measured else ""]
    if place_of(info) is not None or type(value) in (int, float):
        said.append(
            f"({allowed_range(info)}{'; absent at this value' if _absent(value, info) else ''})"
        )
    comment = " ".join(part for part in said if part)
    return f"{text:<{_WIDTH}} # {comment}" if comment else text


def _absent(value: Any, info: FieldInfo) -> bool:
    neutral = info_of(info).neutral
    return neutral is not None and value == neutral


def _value(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, tuple) and len(value) == 1 and isinstance(value[0], tuple):
        value = value[0]  # one curve needs no list of lists
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return repr(value)
