"""Published tables beside ours: load them, compare them cell by cell, and show the comparison."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from shaftline import plant
from shaftline.display.tables import markdown

from .cells import Cell, Kind, Reason, Verdict, counts, number
from .pages import fill_template
from .unexplained import known_cells

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Tick = Callable[[], None]  # called once for each part of the work that is done
Judged = tuple[Kind, float, str]
"""Kind of a cell, half the width of its tolerance, and where the tolerance comes from."""


@functools.cache
def published(name: str) -> pd.DataFrame:
    """Return a published table, of the reproductions or the package, indexed by its first column."""
    return pd.read_csv(_file(name), index_col=0)


@functools.cache
def published_text(name: str) -> pd.DataFrame:
    """Return a published table as printed: every number as text, with its trailing zeros."""
    return pd.read_csv(_file(name), index_col=0, dtype=str, keep_default_na=False)


def _file(name: str) -> Path:
    own = Path(__file__).parent / f"data/{name}.csv"
    return own if own.is_file() else Path(plant.__file__).parent / f"data/{name}.csv"


def compare(
    table: str,
    ours: pd.DataFrame,
    theirs: pd.DataFrame,
    judge: Callable[[str, str, str], Judged],
    reasons: Mapping[tuple[str, str], Reason] | None = None,
) -> list[Cell]:
    """Return one cell for each number that is printed and that we have."""
    found = []
    for row in (row for row in ours.index if row in theirs.index):
        for column in (column for column in ours.columns if column in theirs.columns):
            text = str(theirs.loc[row, column]).strip()
            if text:
                kind, tolerance, basis = judge(str(row), str(column), text)
                mine, reason = float(ours.loc[row, column]), (reasons or {}).get((row, column))
                found.append(
                    number(
                        table,
                        str(row),
                        str(column),
                        mine,
                        float(text),
                        tolerance,
                        basis,
                        kind,
                        reason,
                    )
                )
    return found


def side_by_side(ours: pd.DataFrame, cells: Iterable[Cell], digits: int = 2) -> pd.DataFrame:
    """Return rows and columns of our table, each cell as ``ours (printed)``, ``*`` where unexplained."""
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


NAMED_CELLS = 8  # largest number of cells that a list item names; it counts more cells by table


def _cells(count: int) -> str:
    return f"{count} cell" if count == 1 else f"{count} cells"


def _group_by_text(cells: Iterable[tuple[Cell, str]]) -> str:
    """Return each text once as a list item, with the cells that it belongs to."""
    groups: dict[str, list[Cell]] = {}
    for cell, text in cells:
        groups.setdefault(text, []).append(cell)
    lines = []
    for text, own in groups.items():
        names = [" / ".join(part for part in cell.key if part) for cell in own]
        if len(own) > NAMED_CELLS:
            names = [f"{table}: {_cells(n)}" for table, n in Counter(c.table for c in own).items()]
        lines.append(f"- {text} ({'; '.join(names)})")
    return "\n".join(lines) or "- no cell"


def reasons_text(cells: Iterable[Cell]) -> str:
    """Return the calculated reasons as list items, each once, with the cells that it explains."""
    explained = [cell for cell in cells if cell.verdict is Verdict.EXPLAINED]
    return _group_by_text((cell, cell.reason.text) for cell in explained if cell.reason)


def unexplained_text(study: str, cells: Iterable[Cell]) -> str:
    """Return the unexplained cells as list items, grouped by what was tried."""
    notes = known_cells(study)
    open_ = [cell for cell in cells if cell.verdict is Verdict.UNEXPLAINED]
    return _group_by_text((cell, notes.get(cell.key) or "nothing was tried") for cell in open_)


def verdicts(study: str, cells: Iterable[Cell]) -> str:
    """Return the Markdown that ends a page: counts, tolerances, reasons and unexplained cells."""
    cells = list(cells)
    bases = Counter(cell.basis for cell in cells)
    derived = (
        " *Derived*: the number follows by arithmetic from other printed numbers."
        if any(cell.kind is Kind.DERIVED for cell in cells)
        else ""
    )
    tolerances = "\n".join(f"- {basis} ({_cells(count)})" for basis, count in bases.items())
    return (
        f"## Number of cells met\n\n{markdown(counts(cells).reset_index())}\n\n"
        "*input*: the model was given the number; *calibrated*: a parameter was fitted to the number or "
        f"to its table; *free*: the model predicts the number.{derived} "
        "Every cell with its interval is in "
        f"[cells/{study}.csv](cells/{study}.csv).\n\n"
        f"Tolerances:\n\n{tolerances}\n\n"
        f"## Differences with a calculated reason\n\n{reasons_text(cells)}\n\n"
        f"## Unexplained differences\n\n{unexplained_text(study, cells)}\n"
    )


def cell_table(cells: Iterable[Cell]) -> pd.DataFrame:
    """Return cells as a table for a page: quantity, ours, printed, kind and verdict."""
    rows = [
        (
            " / ".join(part for part in (cell.row, cell.column) if part),
            f"{cell.ours:.4g}",
            cell.print_text,
            str(cell.kind),
            str(cell.verdict),
        )
        for cell in cells
    ]
    return pd.DataFrame(rows, columns=["quantity", "ours", "printed", "kind", "verdict"])


class Page(NamedTuple):
    """A result page before it is written.

    ``table`` is written as CSV and ``shown`` is printed on the console; both are :func:`cell_table` of
    the cells where they are None. ``numbers`` are our numbers by row and column, for ``--json``.
    ``file`` is the name of the page where it differs from that of the study.
    """

    cells: Sequence[Cell]
    body: str
    figures: dict[str, Figure]
    numbers: dict[str, Any]
    table: pd.DataFrame | None = None
    shown: pd.DataFrame | None = None
    dpi: int = 110
    file: str = ""


class Study(NamedTuple):
    """A reproduction of printed tables: title of its page, its calculation and number of ticks."""

    title: str
    compute: Callable[[Tick], Page]
    ticks: int


def numbers_by_row(frame: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return the finite numbers of a table by row and column."""
    return {
        str(row): {str(c): float(v) for c, v in values.items() if pd.notna(v)}
        for row, values in frame.iterrows()
    }


def page_of_table(
    ours: pd.DataFrame,
    cells: Sequence[Cell],
    figures: dict[str, Figure],
    dpi: int,
    template: Path,
    digits: int = 2,
    **fields: Any,
) -> Page:
    """Return the page of one printed table; its template gets the comparison as ``shown``."""
    shown = side_by_side(ours, cells, digits)
    body = fill_template(template, shown=shown, **fields)
    return Page(cells, body, figures, numbers_by_row(ours), ours.reset_index(), shown, dpi)
