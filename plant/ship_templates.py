"""Ship files to start from: values from here, every comment from the keys' own declarations."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from .keys import (
    LACKING,
    Section,
    allowed_range,
    info_of,
    needs_of,
    place_of,
    required_when,
    unit_of,
)
from .ship import Ship
from .ship_errors import ShipError, kinds, validated
from .ship_files import load_ship
from .tolerances import Tolerances, spoken_of

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
