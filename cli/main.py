"""The ``shaftline`` command: one sub-command per job, each in a file of its own.

A sub-command's file is imported when it is called: together they take seconds, and ``--help``, a typing
slip or the shell's completion need none of them.
"""

from __future__ import annotations

import ast
import io
import os
import sys
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from . import STOPPED
from .console import loading, tell_compiling
from .machine import with_json

COMMANDS = (
    "tour", "new-ship", "simulate", "manoeuvre", "linearise", "loop", "reproduce", "train", "tune",
    "tune-recipe", "evaluate", "dataset", "video", "check", "identify", "diagnose", "validate", "list",
)  # fmt: skip
"""In the order of ``--help``; ``new-ship`` is ``new_ship`` in ``new_ship_command.py``."""

HERE = Path(__file__).parent
NAMED_OTHERWISE = {"list": "list_names", "linearise": "linearise_ship"}
"""Functions whose command's name is taken."""


def _stem(name: str) -> str:
    return name.replace("-", "_")


def _function(name: str) -> str:
    return NAMED_OTHERWISE.get(name, _stem(name))


def first_words(name: str) -> str:
    """First paragraph of a command's docstring, read without running its file.

    Args:
        name: of the command.
    """
    tree = ast.parse((HERE / f"{_stem(name)}_command.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == _function(name):
            return (ast.get_docstring(node) or "").split("\n\n")[0].replace("\n", " ")
    raise LookupError(f"{name}: no function {_function(name)} in its file")


class Later(TyperCommand):
    """A command whose file is imported when it is called."""

    def __init__(self, name: str) -> None:
        super().__init__(name, help=first_words(name), rich_markup_mode="markdown")

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **extra: Any) -> Any:
        """That of the command itself, which is thereby the one that runs."""
        with nullcontext() if "--help" in args else loading():
            command = self.itself()
        if "numba" in sys.modules:
            tell_compiling()
        return command.make_context(info_name, args, *rest, **extra)

    def itself(self) -> Any:
        """The command, imported."""
        from ..core.lazy import when_used

        when_used("pandas")  # a quarter of a second, and the first words need none of it
        assert self.name is not None
        module = import_module(f".{_stem(self.name)}_command", __package__)
        alone = typer.Typer(rich_markup_mode="markdown", pretty_exceptions_enable=False)
        alone.command(self.name)(with_json(getattr(module, _function(self.name))))
        return typer.main.get_command(alone)


class Commands(TyperGroup):
    """The sub-commands, none of them imported."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = {name: Later(name) for name in COMMANDS}

    def invoke(self, ctx: Any) -> Any:
        """Run a sub-command; Ctrl-C at any time, also while its modules load, ends with one line."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            typer.echo("stopped", err=True)
            raise typer.Exit(STOPPED) from None


app = typer.Typer(
    name="shaftline",
    cls=Commands,
    help="A workbench for ship propulsion control.\n\n"
    "Start with `shaftline tour`. Every command explains itself with --help.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(installed("shaftline"))
        raise typer.Exit


def main() -> None:
    """Entry point of the installed command."""
    os.environ["MPLBACKEND"] = "agg"  # pictures are files, whatever the shell asks for
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 - it was closed
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(
                errors="replace"
            )  # where it knows ASCII only, a dash is a question mark
    try:
        Path.cwd()
    except OSError:  # removed while the shell stood in it; half of what is imported asks for it
        sys.exit("error: the folder in which this was called does not exist any more")
    app()
