"""The ``shaftline`` command with one sub-command for each task, each in its own file.

The file of a sub-command is imported when it runs, because the import takes seconds. ``--help``, a
misspelt name or option and the completion of the shell only read the source of the files
(:mod:`.source`).
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from importlib import import_module, util
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from . import STOPPED
from .console import announce_compilation, announce_loading
from .machine import add_json_option
from .source import load_outline, summary

COMMANDS = (
    "tour", "new-ship", "simulate", "manoeuvre", "linearise", "loop", "reproduce", "train", "tune",
    "tune-recipe", "evaluate", "dataset", "export", "video", "check", "identify", "diagnose",
    "monitor", "plan-trial", "trial", "performance", "validate", "challenge", "list", "prepare",
)  # fmt: skip
"""Sub-commands in the order of ``--help``; ``new-ship`` is ``new_ship`` in ``new_ship_command.py``."""

_LazyModule: Any = util._LazyModule  # type: ignore[attr-defined]

HERE = Path(__file__).parent
FUNCTION_NAMES = {
    "list": "list_names",
    "linearise": "linearise_ship",
    "plan-trial": "plan",
    "monitor": "condition",
}
"""Functions whose name differs from that of the command."""


def _stem(name: str) -> str:
    return name.replace("-", "_")


def _function(name: str) -> str:
    return FUNCTION_NAMES.get(name, _stem(name))


def _source(name: str) -> tuple[str, str]:
    """Return the file of a command and the name of its function."""
    return f"{HERE.name}/{_stem(name)}_command.py", _function(name)


def command_summary(name: str) -> str:
    """Return the first paragraph of a command's docstring without importing its file.

    Args:
        name: name of the command.
    """
    return summary(*_source(name))


class _Deferred(_LazyModule):  # type: ignore[misc,valid-type]
    """Module that is loaded at its first use.

    An import statement asks only for the specification of a module. Python's own lazy module takes that
    for a use, so that ``import pandas`` would load it.
    """

    def __getattribute__(self, name: str) -> Any:
        if name == "__spec__":
            return ModuleType.__getattribute__(self, name)
        return super().__getattribute__(name)


def defer(name: str) -> None:
    """Let import statements of a library create a module that is loaded at its first use."""
    from ..core.lazy import lazy_import

    if name not in sys.modules:
        lazy_import(name).__class__ = _Deferred


class LazyCommand(TyperCommand):
    """Sub-command whose file is imported when it runs."""

    def __init__(self, name: str) -> None:
        super().__init__(name, help=command_summary(name), rich_markup_mode="markdown")

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **extra: Any) -> Any:
        """Return the context of the imported command, so that this command runs.

        Help, wrong options and the completion of the shell end with the outline.
        """
        outline = self.outline().make_context(info_name, [*args], *rest, **extra)
        if outline.resilient_parsing:
            return outline
        with announce_loading():
            command = self.itself()
        if "numba" in sys.modules:
            announce_compilation()
        return command.make_context(info_name, args, *rest, **extra)

    def outline(self) -> Any:
        """Return the command with its options and help, without importing it; it cannot run."""
        return self._command(load_outline(*_source(str(self.name))))

    def itself(self) -> Any:
        """Import the command and return it."""
        defer("pandas")  # Importing it takes time, and the first line does not need it.
        name = str(self.name)
        module = import_module(f".{_stem(name)}_command", __package__)
        return self._command(getattr(module, _function(name)))

    def _command(self, function: Callable[..., None]) -> Any:
        alone = typer.Typer(rich_markup_mode="markdown", pretty_exceptions_enable=False)
        alone.command(self.name)(add_json_option(function))
        return typer.main.get_command(alone)


class Commands(TyperGroup):
    """Group of the sub-commands, which are not imported yet."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self.commands = {name: LazyCommand(name) for name in COMMANDS}

    def invoke(self, ctx: Any) -> Any:
        """Run a sub-command; Ctrl-C ends it with one line, also while its modules are imported."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            typer.echo("stopped", err=True)
            raise typer.Exit(STOPPED) from None


app = typer.Typer(
    name="shaftline",
    cls=Commands,
    help="Simulate, control and diagnose the propulsion of ships.\n\n"
    "Start with `shaftline tour`. `shaftline COMMAND --help` explains each command with examples.",
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
    """Run the command line; entry point of the installed command."""
    os.environ["MPLBACKEND"] = "agg"  # All pictures are files, so no display is needed.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 (the stream was closed)
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # In an ASCII stream a dash becomes a question mark.
            stream.reconfigure(errors="replace")
    try:
        Path.cwd()
    except OSError:  # The working folder was removed, and many libraries ask for it.
        sys.exit("error: the working folder does not exist any more; change to another one")
    app()
