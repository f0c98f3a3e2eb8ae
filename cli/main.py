"""The ``shaftline`` command: one sub-command per job."""

from __future__ import annotations

from typing import Annotated

import typer

from . import (
    diagnose_command,
    evaluate_command,
    identify_command,
    list_command,
    loop_command,
    manoeuvre_command,
    new_ship_command,
    prove_command,
    reproduce_command,
    simulate_command,
    tour_command,
    train_command,
    tune_command,
)

app = typer.Typer(
    name="shaftline",
    help="A workbench for ship propulsion control.\n\n"
    "Start with `shaftline tour`. Every command explains itself with --help.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
)
app.command("tour")(tour_command.tour)
app.command("new-ship")(new_ship_command.new_ship)
app.command("simulate")(simulate_command.simulate)
app.command("manoeuvre")(manoeuvre_command.manoeuvre)
app.command("loop")(loop_command.loop)
app.command("reproduce")(reproduce_command.reproduce)
app.command("train")(train_command.train)
app.command("tune")(tune_command.tune)
app.command("evaluate")(evaluate_command.evaluate)
app.command("identify")(identify_command.identify)
app.command("diagnose")(diagnose_command.diagnose)
app.command("prove")(prove_command.prove)
app.command("list")(list_command.list_names)


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
    app()
