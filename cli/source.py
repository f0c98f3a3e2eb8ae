"""Commands and values read from source files, because importing their modules takes seconds.

The help of a command and the completion of the shell need the options of one function. The file of the
command also imports the packages that a run needs, such as the compiled equations.
"""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parent.parent
"""Folder of the package ``shaftline``; files are named relative to it."""

_QUICK = {*sys.stdlib_module_names, "typer"}
"""Libraries that the options of a command may use."""


@functools.cache
def _tree(file: str) -> ast.Module:
    return ast.parse((PACKAGE / file).read_text(encoding="utf-8"))


def summary(file: str, function: str) -> str:
    """Return the first paragraph of a function's docstring in one line."""
    for node in _tree(file).body:
        if isinstance(node, ast.FunctionDef) and node.name == function:
            return (ast.get_docstring(node) or "").split("\n\n")[0].replace("\n", " ")
    raise LookupError(f"{file}: no function {function}")


def load_outline(file: str, function: str) -> Callable[..., None]:
    """Return a command's function with its signature and docstring; only the imported one can run.

    The file is executed without its imports of other packages and of other commands. Its options
    therefore use the standard library, typer, and the other modules of this package.

    Args:
        file: file of the command.
        function: name of the function.

    Raises:
        NameError: an option, or another statement outside functions, needs a module that is left out.
    """
    needed = [node for node in _tree(file).body if _is_quick(node)]
    scope: dict[str, Any] = {
        "__name__": f"{__package__}.{Path(file).stem}",
        "__package__": __package__,
        "__file__": str(PACKAGE / file),
    }
    exec(compile(ast.Module(needed, []), scope["__file__"], "exec"), scope)
    found: Callable[..., None] = scope[function]
    return found


def _is_quick(node: ast.stmt) -> bool:
    """Return False for an import of another package or of another command."""
    match node:
        case ast.Import(names):
            return {name.name.partition(".")[0] for name in names} <= _QUICK
        case ast.ImportFrom(module=str(module), level=0):
            return module.partition(".")[0] in _QUICK
        case ast.ImportFrom(module=module, level=level):
            return level == 1 and not (module or "").endswith("_command")
    return True


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
