"""``shaftline reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from ..core.files import check_writable, write_json
from ..studies import reproduce as study
from ..studies.reproduced import Cells
from .console import check_folder, clear_errors, print_table, progress, say

ALL = "all"


def reproduce(
    table: Annotated[
        str, typer.Argument(help=f"Which: {', '.join(study.TABLES)}, or {ALL}.", metavar="TABLE")
    ] = ALL,
    out: Annotated[Path, typer.Option(help="Folder for CSV, Markdown and figures.")] = Path(
        "out/reproduce"
    ),
    json: Annotated[
        Path | None, typer.Option(help="File for our numbers by table, row and column.")
    ] = None,
) -> None:
    """Reproduce the five sources' tables, ours beside the printed numbers.

    Van der Kroft, TU Delft 2020, advance velocity observers: `working-points`, `poles`, `vaf`, `snr`,
    `sensitivity`. Pivano et al. 2008, anti-spin: `storms`. The CPP optimiser paper: `levers`. Vrijdag &
    Martelli 2021, a drive train identified: `tito-neri`. Taylor, MIT 2000, a Kalman filter with numbers
    as states, and steering: `augmented-filter`, `esso-osaka`, `destroyer`, `autopilot`, `track`.

    Where a number differs by more than its page allows, a sentence says why; one without a sentence
    is an error (exit code 1). At the end stands how many are met.

    Examples:
        shaftline reproduce all --out out/reproduce

        shaftline reproduce poles --json poles.json
    """
    with clear_errors():
        if table not in {ALL, *study.TABLES}:
            raise ValueError(f"unknown table {table!r}; known: {', '.join([ALL, *study.TABLES])}")
        check_folder(out)
        if json is not None:
            check_writable(json)
        numbers, cells = {}, {}
        for name in study.TABLES if table == ALL else [table]:
            make, ticks = study.TABLES[name]
            with progress(name, ticks) as tick:
                result = make(out, tick)
            print_table(result.shown, result.title, 4 if name == "poles" else 2)
            say(f"Where they differ, and why:\n{result.reasons}\n")
            numbers[name], cells[name] = result.numbers, result.cells
        if json is not None:
            write_json(json, numbers)
            say(f"numbers: {json}")
        _summary(cells)
        say(f"CSV, Markdown and figures: {out}")


def _summary(cells: dict[str, Cells | None]) -> None:
    counted = {name: found for name, found in cells.items() if found is not None}
    if counted:
        rows = [(name, *found) for name, found in counted.items()]
        columns = ["table", "met", "differ, with a reason", "differ, without one"]
        print_table(pd.DataFrame(rows, columns=columns), "printed numbers")
    if told := [name for name in cells if name not in counted]:
        say(f"compared in words on their pages: {', '.join(told)}")
    if lost := [name for name, found in counted.items() if found.unexplained]:
        say(f"without a reason: {', '.join(lost)}")
        raise typer.Exit(1)
