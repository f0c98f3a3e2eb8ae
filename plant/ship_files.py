"""Ships as TOML files: those that come with the package, and one's own."""

from __future__ import annotations

import functools
from importlib import resources
from pathlib import Path
from typing import Annotated, get_args, get_origin

import tomli_w
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..core.files import FileError, read_text, toml_of, write_text
from .keys import allowed_range, default_of, unit_of
from .ship import Ship
from .ship_errors import ShipError, kinds, tag_of, validated


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
