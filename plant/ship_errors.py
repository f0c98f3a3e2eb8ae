"""What is wrong with a ship's file, in sentences that name key, unit and allowed range."""

from __future__ import annotations

from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from .keys import MissingKeyError, allowed_range, unit_of

Model = TypeVar("Model", bound=BaseModel)


class ShipError(ValueError):
    """A ship that cannot be used; the message names file, key, unit and allowed range."""


def kinds(annotation: Any) -> tuple[Any, ...]:
    """Members of a union, or the one type itself."""
    return get_args(annotation) or (annotation,)


def tag_of(section: type[BaseModel]) -> str:
    """The ``type`` of a section of which there are several kinds."""
    return str(get_args(section.model_fields["type"].annotation)[0])


def validated(model: type[Model], tree: dict[str, Any], source: str) -> Model:
    """A ship from its tables.

    Args:
        model: of the ship.
        tree: of its file.
        source: named in errors.

    Raises:
        ShipError: a line for everything that is wrong.
    """
    try:
        return model.model_validate(tree)
    except ValidationError as error:
        lines = [f"{source}: {_explained(model, dict(item))}" for item in error.errors()]
        raise ShipError("\n".join(lines)) from None


def _explained(model: type[BaseModel], item: dict[str, Any]) -> str:
    """One pydantic error as a sentence with key, unit, given value and allowed range."""
    tags = {tag_of(kind) for kind in kinds(model.model_fields["prime_mover"].annotation)}
    path = [str(part) for part in item["loc"] if part not in tags]
    key = ".".join(path) or "ship"
    table = model.model_fields.get(path[0]) if path else None  # one key may stand in two sections
    info = next(
        (
            section.model_fields[path[-1]]
            for section in (kinds(table.annotation) if table else ())
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
        error = item["ctx"]["error"]
        joint = "." if isinstance(error, MissingKeyError) else ": "
        return f"{section}{joint}{error}" if section else str(error)
    return f"{key} = {item.get('input')!r}: {item['msg'].lower()}{allowed}"
