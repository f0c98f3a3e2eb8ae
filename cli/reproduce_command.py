"""``shaftline reproduce``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import pandas as pd
import typer

from ..core.files import check_writable, write_json
from .console import check_folder, print_table, progress, report_errors, say

if TYPE_CHECKING:
    from reproductions.cells import Cell

ALL = "all"
CHECKOUT = Path(__file__).resolve().parent.parent
"""Folder of the package; in a checkout it also contains the reproductions."""


def reproduce(
    table: Annotated[
        str, typer.Argument(help=f"Name of a table (see below), or {ALL}.", metavar="TABLE")
    ] = ALL,
    out: Annotated[Path, typer.Option(help="Folder for CSV, Markdown and figures.")] = Path(
        "out/reproduce"
    ),
    json: Annotated[
        Path | None, typer.Option(help="File for our values by table, row and column.")
    ] = None,
) -> None:
    """Reproduce the tables of the five sources and compare our values with the printed ones.

    Van der Kroft, TU Delft 2020, advance velocity observers: `working-points`, `poles`, `vaf`,
    `snr`, `sensitivity`. Pivano et al. 2008, anti-spin: `storms`, `towing-tank`. The CPP optimiser
    paper: `levers`, `optimiser`. Vrijdag & Martelli 2021, identification of a drive train:
    `tito-neri`. Taylor, MIT 2000, a Kalman filter with parameters as states, and steering:
    `augmented-filter`, `esso-osaka`, `destroyer`, `autopilot`, `track`.

    The last table counts the printed values by kind: `input` (given to the model), `calibrated` (a
    parameter was fitted to it) and `free` (predicted). A value is reproduced within its tolerance,
    differs for a calculated reason, or is unexplained. The exit code is 1 if an unexplained value is not
    in the list of known ones.

    Written: each table as CSV and Markdown, its figures, and with `--json` all our values.

    Examples:
        shaftline reproduce all --out out/reproduce

        shaftline reproduce poles --json poles.json
    """
    with report_errors():
        _find_reproductions()
        from reproductions import cells as cell_files
        from reproductions import reproduce as study

        if table not in {ALL, *study.TABLES}:
            raise ValueError(f"unknown table {table!r}; known: {', '.join([ALL, *study.TABLES])}")
        check_folder(out)
        if json is not None:
            check_writable(json)
        numbers, found = {}, {}
        for name in study.TABLES if table == ALL else [table]:
            make, ticks = study.TABLES[name]
            with progress(name, ticks) as tick:
                result = make(out, tick)
            print_table(result.shown, result.title, 4 if name == "poles" else 2)
            say(f"Differences and their reasons:\n{result.reasons}\n")
            numbers[name], found[name] = result.numbers, list(result.cells)
            if result.cells:
                cell_files.write(out, name, result.cells)
        if json is not None:
            write_json(json, numbers)
            say(f"values: {json}")
        say(f"CSV, Markdown and figures: {out}")
        _summary(found)


def _find_reproductions() -> None:
    """Make the package ``reproductions`` of the checkout importable.

    Raises:
        ValueError: the package was installed from a wheel, which does not contain them.
    """
    if not (CHECKOUT / "reproductions" / "__init__.py").is_file():
        raise ValueError(
            "shaftline reproduce needs a checkout of the repository, because the installed package does "
            "not contain the reproductions; clone it, run `make run` there, and call this command again"
        )
    if str(CHECKOUT) not in sys.path:
        sys.path.append(str(CHECKOUT))  # At the end, so that it hides no other package.


def _summary(found: dict[str, list[Cell]]) -> None:
    from reproductions.cells import counts
    from reproductions.unexplained import outdated_keys, unlisted_cells

    counted = [counts(cells).reset_index().assign(study=name) for name, cells in found.items()]
    whole = pd.concat(counted)
    print_table(whole[["study", *whole.columns.drop("study")]], "printed values by kind")
    for name, cells in found.items():
        for key in outdated_keys(name, cells):
            say(f"no longer unexplained: {name}, {' / '.join(key)}")
    new = {name: lost for name, cells in found.items() if (lost := unlisted_cells(name, cells))}
    for name, lost in new.items():
        for cell in lost:
            where = " / ".join(part for part in cell.key if part)
            say(f"unexplained and not listed: {name}, {where}: {cell.ours:.6g} ({cell.print_text})")
    if new:
        say(
            "Printed values differ without a calculated reason, and reproductions/data/unexplained does "
            "not list them. Correct the cause, or list the cells with the attempted explanations."
        )
        raise typer.Exit(1)
