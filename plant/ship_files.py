"""Ships as TOML files: presets of the package, files of the user, and commented templates.

A template takes its values from a preset or from ``templates/``, and every comment from the declaration
of the key.
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

from ..core.files import FileError, parse_toml, read_text, write_text
from ..core.models import allowed_range
from .keys import (
    Section,
    declared,
    default_of,
    info_of,
    place_of,
    unit_of,
)
from .ship import Ship, ShipError, type_tag, union_members, validate_tables
from .tolerances import Tolerances, keys_of_tolerance

_FOLDER = resources.files("shaftline.plant")


def _toml_names(folder: str) -> list[str]:
    files = _FOLDER.joinpath(folder).iterdir()
    return sorted(file.name[:-5] for file in files if file.name.endswith(".toml"))


def ship_names() -> list[str]:
    """Return the names of the ships that come with the package."""
    return _toml_names("ships")


@functools.lru_cache(maxsize=64)
def _load_preset(name: str) -> Ship:
    text = _FOLDER.joinpath(f"ships/{name}.toml").read_text(encoding="utf-8")
    return _parse_ship(text, f"{name}.toml")


def load_ship(ship: str | Path | Ship) -> Ship:
    """Return a ship by preset name or by the path of a TOML file.

    Args:
        ship: name (see :func:`ship_names`), path ending in ``.toml``, or a Ship, returned unchanged.

    Raises:
        ShipError: unknown name, unreadable file, or a value that is missing, unknown, of the wrong
            type or out of range; the message names file, key, unit and allowed range.

    >>> from shaftline.plant import load_ship
    >>> load_ship("frigate").prime_mover.type
    'diesel'
    >>> load_ship("frigat")
    Traceback (most recent call last):
    ...
    shaftline.plant.ship.ShipError: unknown ship 'frigat'; known ships: ...
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
        return _parse_ship(read_text(path), str(path))
    except FileError as error:
        raise ShipError(str(error)) from None


def _parse_ship(text: str, source: str) -> Ship:
    return validate_tables(Ship, parse_toml(text, source), source)


def write_ship(ship: Ship, path: str | Path) -> Path:
    """Write a ship as a TOML file that :func:`load_ship` reads back to an equal ship.

    Keys that were not given stay absent. Comments of an original file are not kept.

    Args:
        ship: ship to write.
        path: path ending in ``.toml``; its folder is created if necessary.

    Returns:
        The path.

    Raises:
        ValueError: the path does not end in ``.toml``.
        OSError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise ValueError(f"{path}: a ship file must have a name that ends in .toml")
    write_text(path, ship_text(ship))
    return path


def ship_text(ship: Ship) -> str:
    """Return the text of the file that :func:`write_ship` writes."""
    return tomli_w.dumps(ship.model_dump(exclude_unset=True, exclude_none=True))


def ship_keys() -> list[tuple[str, str, str, str, str]]:
    """Return all keys of a ship file: dotted name, unit, allowed range, default, description."""
    rows = []
    for section, info in Ship.model_fields.items():
        options = _sections(info)
        for kind in options:
            tag = f" ({type_tag(kind)})" if len(options) > 1 else ""
            rows += _rows(section, kind, tag)
    return rows


def _sections(info: FieldInfo) -> list[type[BaseModel]]:
    members = union_members(info.annotation)
    return [k for k in members if isinstance(k, type) and issubclass(k, BaseModel)]


def _kind_of_value(field: FieldInfo) -> str:
    """Return what kind of value a key without a number accepts."""
    if field.annotation is bool:
        return "true, false"
    origin = get_origin(field.annotation)
    if origin is dict:
        return "a table"
    members = () if origin is tuple else union_members(field.annotation)
    bare = {get_args(m)[0] if get_origin(m) is Annotated else m for m in members}
    return "text" if str in bare else ""


def _rows(path: str, kind: type[BaseModel], tag: str) -> list[tuple[str, str, str, str, str]]:
    """Return the rows of one section, with the keys of tables inside it."""
    rows = []
    for key, field in kind.model_fields.items():
        if within := _sections(field):
            rows += _rows(f"{path}.{key}", within[0], tag)
            continue
        label = f"{path}.{key}" + (tag if key != "type" else "")
        names = [str(a) for a in get_args(field.annotation) if isinstance(a, str)]
        allowed = ", ".join(names) or _kind_of_value(field) or allowed_range(field)
        about = field.description or ""
        rows.append((label, unit_of(field), allowed, default_of(field), about))
    return rows


_WIDTH = 48  # column at which comments begin if the value is short enough
_SECTIONS_LEFT_OUT = ("name", "description", "signals", "term")

_HEAD = """\
# {description}
#
# A ship file to start from, made by `shaftline new-ship --template {template}`.
# The values belong to another ship or are invented: replace them by yours, and give the source of each
# in its comment. Keys behind a "#" are optional and show the value that applies if they are absent.
"""

_FOOT = """\
# Physics without a key is written as [[term]]; see docs/ships.md, "Physics of your own".
"""


def template_names() -> list[str]:
    """Return the names of the templates."""
    return _toml_names("templates")


def template(name: str) -> Ship:
    """Return a template as a ship; an unknown name raises a ShipError."""
    known = template_names()
    if name not in known:
        raise ShipError(f"unknown template {name!r}; known templates: {', '.join(known)}")
    text = _FOLDER.joinpath(f"templates/{name}.toml").read_text(encoding="utf-8")
    tree = tomllib.loads(text)
    if "preset" in tree:  # The template has the values of a ship of the package.
        return load_ship(tree["preset"])
    return validate_tables(Ship, tree, f"{name}.toml")


def template_text(name: str, ship_name: str | None = None) -> str:
    """Return a template as the text of a commented ship file, with the template's name by default."""
    ship = template(name)
    head = _HEAD.format(description=ship.description, template=name)
    head += f"name = {format_value(ship_name or ship.name)}\n"
    head += f"description = {format_value(ship.description)}\n"
    parts = [head]
    given = ship.model_dump(exclude_unset=True)
    for key in type(ship).model_fields:
        section = getattr(ship, key)
        if key not in _SECTIONS_LEFT_OUT and isinstance(section, Section):
            parts.append(_section(ship, key, section, given.get(key)))
    return "\n".join([*(part for part in parts if part), _FOOT])


def _section(ship: Ship, path: str, section: Section, given: dict[str, Any] | None) -> str:
    """Return a section: the keys that are given, then the absent ones behind a ``#``."""
    off = "# " if given is None else ""
    lines, tables = [], []
    for key, info in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, Section):
            tables.append("\n" + _section(ship, f"{path}.{key}", value, (given or {})[key]))
        elif given and key in given:
            lines.append(_line(key, value, info))
    for key, info in type(section).model_fields.items():
        absent = given is None or key not in given
        if absent and _is_applicable(ship, section, info):
            lines.append("# " + _line(key, info.default, info))
    if not lines:
        return ""
    about = (type(section).__doc__ or "").strip().splitlines()[0]
    return "\n".join([f"# {about}", f"{off}[{path}]", *lines]) + "\n" + "".join(tables)


def _is_applicable(ship: Ship, section: Section, info: FieldInfo) -> bool:
    """Return whether an absent key may be given on this ship and would have an effect."""
    if info.is_required() or _sections(info):
        return False
    if isinstance(section, Tolerances):
        return any(ship.has_key(key) for key in keys_of_tolerance(info))
    needs = f"{section.needs} {declared(info, 'needs', '')}".split()
    has_value = place_of(info) is not None or isinstance(info.default, float)
    optional = has_value and not declared(info, "required")
    return optional and all(getattr(ship, need) for need in needs)


def _line(key: str, value: Any, info: FieldInfo) -> str:
    text = f"{key} = {format_value(value)}"
    has_unit = type(value) is float or unit_of(info) != "-"
    parts = [info.description or "", f"[{unit_of(info)}]" if has_unit else ""]
    if place_of(info) is not None or type(value) in (int, float):
        neutral = info_of(info).neutral
        off = "; no effect at this value" if neutral is not None and value == neutral else ""
        parts.append(f"({allowed_range(info)}{off})")
    comment = " ".join(part for part in parts if part)
    return f"{text:<{_WIDTH}} # {comment}" if comment else text


def format_value(value: Any) -> str:
    """Return a value as TOML text."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, tuple) and len(value) == 1 and isinstance(value[0], tuple):
        value = value[0]  # A table with one curve needs no list of lists.
    if isinstance(value, list | tuple):
        return "[" + ", ".join(format_value(item) for item in value) + "]"
    return repr(value)
