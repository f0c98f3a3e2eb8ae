"""Option ``--json``: the output of a command as JSON, for programs.

Every command gets the option by :func:`add_json_option`. :func:`~.console.say` and
:func:`~.console.print_table` pass their output to this module. A command adds further results with
:func:`add_results`.
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
        show_default=False,
        help="File for all results as JSON; `-` writes them to the standard output, without other text.",
    ),
]

_STANDARD = Path("-")

RESULTS = ("out", "figure", "json", "draft", "markdown_file")
"""Parameters of commands that name a file or folder to write."""


class CapturedOutput:
    """Output of a command while it runs."""

    def __init__(self) -> None:
        self.tables: dict[str, list[dict[str, Any]]] = {}
        self.said: list[str] = []
        self.numbers: dict[str, Any] = {}

    def to_dict(self) -> dict[str, Any]:
        """Return the output as JSON values; numbers that are not finite become None."""
        found = {"said": self.said, "tables": self.tables} | self.numbers
        return {key: to_json(value) for key, value in found.items()}


_captured: CapturedOutput | None = None


def captured_output() -> CapturedOutput | None:
    """Return the captured output; None without ``--json``."""
    return _captured


def add_results(values: dict[str, Any]) -> None:
    """Add results by name to the JSON output; scalars of NumPy are allowed."""
    if _captured is not None:
        _captured.numbers.update(values)


def to_json(value: Any) -> Any:
    """Return a value as JSON allows it: paths as text, numbers that are not finite as None."""
    if isinstance(value, dict):
        return {str(key): to_json(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)


def add_json_option(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the option ``--json`` and a protection of its input files."""
    signature = inspect.signature(function, eval_str=True)
    own = "json" in signature.parameters

    @functools.wraps(function)
    def run(**given: Any) -> None:
        _protect_inputs(given)
        if own:
            function(**given)
        else:
            with _capture(given.pop("json", None)):
                function(**given)

    if not own:
        extra = inspect.Parameter(
            "json", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Json
        )
        whole = signature.replace(parameters=[*signature.parameters.values(), extra])
        run.__signature__ = whole  # type: ignore[attr-defined]
        run.__annotations__ = {name: one.annotation for name, one in whole.parameters.items()}
    return run


def _protect_inputs(given: Mapping[str, Any]) -> None:
    """Refuse an output file that is an input file or another output file of the command."""
    from .console import report_errors

    results = {name: given[name] for name in RESULTS if isinstance(given.get(name), Path)}
    inputs = [
        (name, value)
        for name, values in given.items()
        for value in (values if isinstance(values, list | tuple) else (values,))
        if name not in RESULTS and isinstance(value, str | Path)
    ]
    files = [(name, path) for name, path in results.items() if path != _STANDARD]
    with report_errors():
        for (name, path), (other, second) in itertools.combinations(files, 2):
            if os.path.realpath(path) == os.path.realpath(second) or _same_file(path, second):
                raise ValueError(
                    f"{_option(name)} {path} and {_option(other)} {second} are the same file: the "
                    "second would replace the first. Give two different files"
                )
        for (name, path), (other, value) in itertools.product(results.items(), inputs):
            if _same_file(path, value):
                raise ValueError(
                    f"{_option(name)} {path}: this file is also the input "
                    f"{other.replace('_', '-')} and would be replaced; give another file"
                )


def _option(name: str) -> str:
    """Return an option as the user types it."""
    return "--" + name.removesuffix("_file").replace("_", "-")


def _same_file(path: Path, other: str | Path) -> bool:
    try:
        return path.is_file() and os.path.samefile(path, other)
    except (OSError, ValueError):  # The file does not exist, or its name is not valid.
        return False


@contextmanager
def _capture(file: Path | None) -> Iterator[None]:
    global _captured
    if file is None:
        yield
        return
    from ..core.files import check_writable, record_written_files, write_json
    from .console import console, report_errors

    if file != _STANDARD:
        with report_errors():
            check_writable(file)
    _captured, console.quiet = CapturedOutput(), file == _STANDARD
    try:
        with record_written_files() as written:
            yield
        if file != _STANDARD and os.path.realpath(file) in written:
            with report_errors():
                raise ValueError(
                    f"--json {file}: the command wrote another result to this file, which is "
                    "kept. Give another file"
                )
        if file == _STANDARD:
            sys.stdout.write(json.dumps(_captured.to_dict(), indent=2, allow_nan=False) + "\n")
        else:
            write_json(file, _captured.to_dict())
    finally:
        _captured, console.quiet = None, False
