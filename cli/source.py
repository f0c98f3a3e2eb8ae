"""Values read from source files, because importing their modules takes seconds."""

from __future__ import annotations

import ast
import functools
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parent.parent
"""Folder of the package ``shaftline``; files are named relative to it."""


@functools.cache
def _tree(file: str) -> ast.Module:
    return ast.parse((PACKAGE / file).read_text(encoding="utf-8"))


def constant(file: str, name: str) -> Any:
    """Return a number or text that a module assigns to a name, or the default of a class's field.

    Examples:
        >>> constant("envs/settings.py", "EPISODE_S")
        300.0
        >>> constant("envs/settings.py", "Settings.control_interval_s")
        0.5
    """
    value = _assigned(file, name)
    if isinstance(value, ast.Call):  # such as Field(default=0.5, gt=0)
        (value,) = (keyword.value for keyword in value.keywords if keyword.arg == "default")
    return ast.literal_eval(value)


def dictionary_keys(file: str, name: str) -> list[str]:
    """Return the keys of a dictionary that a module assigns to a name.

    Examples:
        >>> dictionary_keys("mismatch/identify.py", "METHODS")[0]
        'output-error'
    """
    found = _assigned(file, name)
    assert isinstance(found, ast.Dict)
    return [ast.literal_eval(key) for key in found.keys if key is not None]


def _assigned(file: str, name: str) -> ast.expr:
    """Return the expression that a module assigns to ``NAME``, or a class to ``CLASS.NAME``."""
    body = _tree(file).body
    *inside, last = name.split(".")
    for outer in inside:
        body = next(
            node.body for node in body if isinstance(node, ast.ClassDef) and node.name == outer
        )
    for node in body:
        match node:
            case (
                ast.Assign(targets=[ast.Name(target)], value=value)
                | ast.AnnAssign(target=ast.Name(target), value=ast.expr() as value)
            ) if target == last:
                return value
    raise LookupError(f"{file}: assigns nothing to {name}")
