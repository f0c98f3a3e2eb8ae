"""Published tables beside ours: load them, compare them cell by cell, and show the comparison."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from shaftline.display.tables import markdown

from .cells import Cell, Kind, Reason, Verdict, counts, number
from .unexplained import known

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Judged = tuple[Kind, float, str]
"""Kind of a cell, half the width of its tolerance, and where the tolerance comes from."""


@functools.cache
def published(name: str) -> pd.DataFrame:
    """Return a published table that ships with the package, indexed by its first column.

    Args:
        name: file name without ending, as in ``reproductions/data``.
    """
    with _table(name).open() as file:
        return pd.read_csv(file, index_col=0)


@functools.cache
def published_text(name: str) -> pd.DataFrame:
    """Return a published table as printed: every number as text, with its trailing zeros.

    Args:
        name: as of :func:`published`.
    """
    with _table(name).open() as file:
        return pd.read_csv(file, index_col=0, dtype=str, keep_default_na=False)


def _table(name: str) -> Traversable:
    """Return the file of a published table, of the reproductions or of the package."""
    own = resources.files("reproductions").joinpath(f"data/{name}.csv")
    packaged = resources.files("shaftline.plant").joinpath(f"data/{name}.csv")
    return own if own.is_file() else packaged


def compare(
    table: str,
    ours: pd.DataFrame,
    theirs: pd.DataFrame,
    judge: Callable[[str, str, str], Judged],
    reasons: Mapping[tuple[str, str], Reason] | None = None,
) -> list[Cell]:
    """Return one cell for each number that is printed and that we have.

    Args:
        table: number of the table in the source.
        ours: our numbers, rows and columns named like theirs (more of both are allowed).
        theirs: the printed table, from :func:`published_text`; empty cells are not printed.
        judge: kind, tolerance and basis of a cell by row, column and printed text.
        reasons: calculated causes by (row, column); each belongs to one cell.
    """
    reasons = reasons or {}
    found = []
    for row in (row for row in ours.index if row in theirs.index):
        for column in (column for column in ours.columns if column in theirs.columns):
            text = str(theirs.loc[row, column]).strip()
            if not text:
                continue
            kind, tolerance, basis = judge(str(row), str(column), text)
            found.append(
                number(table, str(row), str(column), float(ours.loc[row, column]), float(text),
                       tolerance, basis, kind, reasons.get((row, column)))
            )  # fmt: skip
    return found


def side_by_side(ours: pd.DataFrame, cells: Iterable[Cell], digits: int = 2) -> pd.DataFrame:
    """Return rows and columns of our table, each cell as ``ours (printed)``, ``*`` where unexplained.

    Args:
        ours: our numbers.
        cells: the comparison of these numbers.
        digits: behind the point.
    """
    found = {(cell.row, cell.column): cell for cell in cells}

    def both(row: str, column: str) -> str:
        value, cell = float(ours.loc[row, column]), found.get((row, column))
        mine = "–" if pd.isna(value) else f"{value:.{digits}f}"
        if cell is None:
            return mine
        mark = "*" if cell.verdict is Verdict.UNEXPLAINED else ""
        return f"{mine} ({cell.printed:.{digits}f}){mark}"

    lines = [[row, *(both(row, column) for column in ours.columns)] for row in ours.index]
    return pd.DataFrame(lines, columns=["", *ours.columns])


def _by_text(cells: Iterable[tuple[Cell, str]]) -> str:
    where: dict[str, list[str]] = {}
    for cell, text in cells:
        where.setdefault(text, []).append(" / ".join(part for part in cell.key if part))
    return "\n".join(f"- {text} ({'; '.join(names)})" for text, names in where.items())


def reasons_text(cells: Iterable[Cell]) -> str:
    """Return the calculated reasons as list items, each once, with the cells that it explains."""
    shown = [
        (cell, cell.reason.text)
        for cell in cells
        if cell.verdict is Verdict.EXPLAINED and cell.reason is not None
    ]
    return _by_text(shown) or "- no cell"


def unexplained_text(study: str, cells: Iterable[Cell]) -> str:
    """Return the unexplained cells as list items, grouped by what was tried.

    Args:
        study: name of the study, whose list of unexplained cells holds the notes.
        cells: of the study.
    """
    notes = known(study)
    off = [
        (cell, notes.get(cell.key) or "nothing was tried")
        for cell in cells
        if cell.verdict is Verdict.UNEXPLAINED
    ]
    return _by_text(off) or "- no cell"


def tolerances_text(cells: Iterable[Cell]) -> str:
    """Return where the tolerances come from as list items, with the number of cells of each."""
    found: dict[str, int] = {}
    for cell in cells:
        found[cell.basis] = found.get(cell.basis, 0) + 1
    return "\n".join(f"- {basis} ({count} cells)" for basis, count in found.items())


def verdicts(study: str, cells: Iterable[Cell]) -> str:
    """Return the Markdown that ends a page: counts, tolerances, reasons and unexplained cells.

    Args:
        study: name of the study.
        cells: of the study.
    """
    cells = list(cells)
    return (
        f"## How many are met\n\n{markdown(counts(cells).reset_index())}\n\n"
        "*input*: the model was given the number; *calibrated*: a parameter was fitted to the number or "
        "to its table; *free*: the model predicts the number. Every cell with its interval is in "
        f"[cells/{study}.csv](cells/{study}.csv).\n\n"
        f"Where the tolerances come from:\n\n{tolerances_text(cells)}\n\n"
        f"## Differences with a calculated reason\n\n{reasons_text(cells)}\n\n"
        f"## Unexplained differences\n\n{unexplained_text(study, cells)}\n"
    )


def cell_table(cells: Iterable[Cell]) -> pd.DataFrame:
    """Return cells as a table for a page: quantity, ours, printed, kind and verdict."""
    rows = [
        (" / ".join(part for part in (cell.row, cell.column) if part), f"{cell.ours:.4g}",
         cell.print_text, str(cell.kind), str(cell.verdict))
        for cell in cells
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=["quantity", "ours", "printed", "kind", "verdict"])


class Page(NamedTuple):
    """A page's parts."""

    cells: list[Cell]
    body: str
    figures: dict[str, Figure]
    numbers: dict[str, Any]
