"""``--json``: what a command tells, for programs; every command has it, and none spells it out.

What is said goes through :func:`~.console.say` and :func:`~.console.print_table`, which hand it on to
here. A command that has numbers of its own to give adds them with :func:`numbers`.
"""

from __future__ import annotations

import functools
import inspect
import itertools
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

Json = Annotated[
    Path | None,
    typer.Option(
        "--json",
        help="File for all that is told, for programs; `-` is the standard output, with nothing else.",
        show_default=False,
    ),
]

_STANDARD = Path("-")

RESULTS = ("out", "figure", "json", "draft", "markdown_file")
"""Options that name a file to be written."""


class Told:
    """What a command tells while it runs."""

    def __init__(self) -> None:
        self.tables: dict[str, list[dict[str, Any]]] = {}
        self.said: list[str] = []
        self.numbers: dict[str, Any] = {}

    def to_dict(self) -> dict[str, Any]:
        """As JSON allows: numbers that are not finite are null."""
        found = {"said": self.said, "tables": self.tables} | self.numbers
        return {key: plain(value) for key, value in found.items()}


_told: Told | None = None


def told() -> Told | None:
    """Where to tell it; None where nobody asked for JSON."""
    return _told


def numbers(values: dict[str, Any]) -> None:
    """Add numbers of one's own to what is told.

    Args:
        values: by name, of anything that JSON allows, NumPy's scalars among it.
    """
    if _told is not None:
        _told.numbers.update(values)


def plain(value: Any) -> Any:
    """A value as JSON allows it.

    Args:
        value: of dictionaries, lists, numbers, paths and texts.
    """
    if isinstance(value, dict):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)


def with_json(function: Callable[..., None]) -> Callable[..., None]:
    """A command with ``--json``, where it has none of its own, that replaces nothing that it reads.

    Args:
        function: the command.
    """
    signature = inspect.signature(function, eval_str=True)
    own = "json" in signature.parameters

    @functools.wraps(function)
    def run(**given: Any) -> None:
        _keep_what_is_read(given)
        if own:
            function(**given)
        else:
            with _telling(given.pop("json", None)):
                function(**given)

    if own:
        return run
    extra = inspect.Parameter("json", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Json)
    whole = signature.replace(parameters=[*signature.parameters.values(), extra])
    run.__signature__ = whole  # type: ignore[attr-defined]
    run.__annotations__ = {name: one.annotation for name, one in whole.parameters.items()}
    return run


def _keep_what_is_read(given: Mapping[str, Any]) -> None:
    """Refuse a file for results that is one of those that the command reads."""
    from .console import clear_errors

    with clear_errors():
        _keep_apart({n: given[n] for n in RESULTS if isinstance(given.get(n), Path)})
        for name in (name for name in RESULTS if isinstance(given.get(name), Path)):
            for other, values in given.items():
                for value in values if isinstance(values, list | tuple) else (values,):
                    read = other not in RESULTS and isinstance(value, str | Path)
                    if read and _same_file(given[name], value):
                        raise ValueError(
                            f"{_option(name)} {given[name]}: is read as "
                            f"{other.replace('_', '-')} and would be replaced; give another file"
                        )


def _option(name: str) -> str:
    """Return an option as it is typed."""
    return "--" + name.removesuffix("_file").replace("_", "-")


def _keep_apart(results: Mapping[str, Path]) -> None:
    """Refuse two options that name one file, or a folder where another one asks for a file.

    Raises:
        ValueError: names both.
    """
    places = [(name, p) for name, p in results.items() if p != _STANDARD]
    for (name, path), (other, second) in itertools.combinations(places, 2):
        if os.path.realpath(path) == os.path.realpath(second) or _same_file(path, second):
            raise ValueError(
                f"{_option(name)} {path} and {_option(other)} {second} are one file: the second "
                "would replace the first. Give each a file of its own"
            )


def _same_file(path: Path, other: str | Path) -> bool:
    try:
        return path.is_file() and os.path.samefile(path, other)
    except (OSError, ValueError):  # no file, or a name that none can have
        return False


@contextmanager
def _telling(file: Path | None) -> Iterator[None]:
    global _told
    if file is None:
        yield
        return
    from ..core.files import check_writable, recorded, write_json
    from .console import clear_errors, console

    if file != _STANDARD:
        with clear_errors():
            check_writable(file)
    _told, console.quiet = Told(), file == _STANDARD
    try:
        with recorded() as written:
            yield
        if file != _STANDARD and os.path.realpath(file) in written:
            with clear_errors():
                raise ValueError(
                    f"--json {file}: the command has written a result of its own there, which "
                    "is kept. Give another file"
                )
        if file == _STANDARD:
            sys.stdout.write(json.dumps(_told.to_dict(), indent=2, allow_nan=False) + "\n")
        else:
            write_json(file, _told.to_dict())
    finally:
        _told, console.quiet = None, False
