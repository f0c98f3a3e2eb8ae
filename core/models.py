"""Base class of the models of user files: tasks, recipes, column maps, catalogues."""

from __future__ import annotations

import reprlib
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
)
from pydantic.fields import FieldInfo

from .files import FileError, read_toml


def _rising(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise ValueError(f"{list(ends)}: the lower value must come first")
    return ends


Number = Annotated[float, Field(strict=True)]
Range = Annotated[tuple[Number, Number], AfterValidator(_rising)]
"""Lowest and highest value, as a list of two numbers."""


class FileModel(BaseModel):
    """An immutable table of a file, without unknown keys; every number is finite and given as a number.

    Ship files have a stricter base, :class:`shaftline.plant.keys.Section`: TOML distinguishes types that
    YAML and pydantic's lax mode convert.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _numbers_are_numbers(cls, value: Any, info: ValidationInfo) -> Any:
        assert info.field_name is not None
        leaves = _leaves(cls.model_fields[info.field_name].annotation)
        numeric = bool(leaves & {float, int}) and leaves <= {float, int, NoneType}
        if leaves <= _PLAIN - {bool}:
            refuse_non_numbers(value, (bool, str) if numeric else (bool,))
        return value


_PLAIN = frozenset({float, int, str, bool, NoneType})


def _leaves(annotation: Any) -> set[Any]:
    """Return the types at the ends of an annotation; the key types of dictionaries are left out."""
    parts = get_args(annotation)
    if annotation in _PLAIN or not parts:
        return {annotation}
    if get_origin(annotation) is Annotated:  # The type is its first argument.
        parts = parts[:1]
    if get_origin(annotation) is Literal:
        return {type(part) for part in parts}
    if get_origin(annotation) is dict:
        parts = parts[1:]
    return set().union(*(_leaves(part) for part in parts if part is not Ellipsis))


def allowed_range(info: FieldInfo) -> str:
    """Return the allowed range of a parameter, or the names that a key accepts, as text."""
    if get_origin(info.annotation) is Literal:
        return ", ".join(map(str, get_args(info.annotation)))
    bounds = [
        f"{sign} {getattr(m, name):g}"
        for m in info.metadata
        for name, sign in (("ge", ">="), ("gt", ">"), ("le", "<="), ("lt", "<"))
        if getattr(m, name, None) is not None
    ]
    return " and ".join(bounds) or "any number"


def explain(error: ValidationError, model: type[BaseModel] | None = None) -> str:
    """Return a pydantic error as text: key, value and reason, with the model also the allowed range."""
    sentences = []
    for item in error.errors():
        key = ".".join(map(str, item["loc"]))
        if item["type"] == "missing":
            sentences.append(f"{key} is missing")
        elif item["type"] == "extra_forbidden":
            sentences.append(f"{key} is not a known key")
        elif item["type"] == "tuple_type":
            sentences.append(f"{key} = {item['input']!r}: a list is required")
        elif item["type"] == "value_error":
            sentences.append(": ".join(part for part in (key, str(item["ctx"]["error"])) if part))
        else:
            field = model.model_fields.get(key) if model else None
            allowed = f" (allowed: {allowed_range(field)})" if field else ""
            sentences.append(f"{key} = {short(item['input'])}: {item['msg'].lower()}{allowed}")
    return "; ".join(sentences)


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 100
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 12


def short(value: Any) -> str:
    """Return a value of a file as text for a message; the middle of a long one is left out.

    >>> short(3.5), len(short("x" * 500))
    ('3.5', 100)
    """
    return _SHORT.repr(value)


Model = TypeVar("Model", bound=FileModel)


def read_model(model: type[Model], path: str | Path, error: type[ValueError]) -> Model:
    """Return the model that a TOML file describes.

    Args:
        model: class of the model.
        path: TOML file with its keys.
        error: class of the error that is raised.

    Raises:
        ValueError: ``error``; the file cannot be read, or a key or value is wrong. Names file and key.
    """
    return make_model(model, read_keys(path, error), path, error)


def read_keys(path: str | Path, error: type[ValueError]) -> dict[str, Any]:
    """Return the keys of a TOML file; an ``error`` names the file that cannot be read."""
    try:
        return read_toml(Path(path))
    except FileError as refused:
        raise error(str(refused)) from None


def make_model(
    model: type[Model], keys: dict[str, Any], path: str | Path, error: type[ValueError]
) -> Model:
    """Return the model of keys that were read from a file; an ``error`` names file and key."""
    try:
        return model.model_validate(keys)
    except ValidationError as refused:
        text = explain(refused, model)
        if any(item["type"] == "extra_forbidden" for item in refused.errors()):
            text += f"; known keys of the file: {', '.join(model.model_fields)}"
        raise error(f"{path}: {text}") from None


def refuse_non_numbers(value: Any, kinds: tuple[type, ...] = (bool,)) -> None:
    """Refuse a truth value or a text, at any depth of lists and tables, in place of a number.

    ``kinds`` are the types to refuse: bool, str or both. The ValueError names the value.
    """
    if isinstance(value, dict):
        for key, part in value.items():
            try:
                refuse_non_numbers(part, kinds)
            except ValueError as error:
                raise ValueError(f"{key}: {error}") from None
    elif isinstance(value, list | tuple):
        for part in value:
            refuse_non_numbers(part, kinds)
    elif isinstance(value, kinds):
        given = "a truth value" if isinstance(value, bool) else "a text"
        raise ValueError(f"{short(value)} is {given}; a number is required")
