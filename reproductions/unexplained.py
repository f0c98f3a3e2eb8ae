"""List the printed numbers that are known to be unexplained, with what was tried, one file a study.

``shaftline reproduce`` fails where a cell is unexplained that
``reproductions/data/unexplained/NAME.csv`` does not list. ``python -m reproductions unexplained
docs/results`` writes these files again from the cells of the pages, and keeps the notes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from shaftline.display.tables import write_csv

from . import cells as cell_files
from .cells import Cell, Verdict

COLUMNS = ["table", "row", "column", "note"]

Key = tuple[str, str, str]


FOLDER = Path(__file__).parent / "data" / "unexplained"


def known_cells(study: str) -> dict[Key, str]:
    """Return the listed cells of a study, (table, row, column), with what was tried."""
    file = FOLDER / f"{study}.csv"
    if not file.is_file():
        return {}
    frame = pd.read_csv(file, dtype=str, keep_default_na=False)
    return {(line.table, line.row, line.column): line.note for line in frame.itertuples()}


def unexplained_cells(cells: Iterable[Cell]) -> list[Cell]:
    """Return the unexplained cells."""
    return [cell for cell in cells if cell.verdict is Verdict.UNEXPLAINED]


def unlisted_cells(study: str, cells: Iterable[Cell]) -> list[Cell]:
    """Return the unexplained cells that the study's file does not list."""
    listed = known_cells(study)
    return [cell for cell in unexplained_cells(cells) if cell.key not in listed]


def outdated_keys(study: str, cells: Iterable[Cell]) -> list[Key]:
    """Return the listed cells of a study that are met or explained, or that it does not have."""
    found = {cell.key for cell in unexplained_cells(cells)}
    return [key for key in known_cells(study) if key not in found]


def main() -> None:
    """Write the lists again from the cells of the result pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    help_text = "Folder of the result pages, with cells/NAME.csv."
    parser.add_argument("results", type=Path, help=help_text)
    parser.add_argument("--study", action="append", help="Only this study; may be repeated.")
    options = parser.parse_args()
    for file in sorted((options.results / "cells").glob("*.csv")):
        if options.study and file.stem not in options.study:
            continue
        notes = known_cells(file.stem)
        cells = unexplained_cells(cell_files.read(file))
        rows = [(*cell.key, notes.get(cell.key, "")) for cell in cells]
        write_csv(FOLDER, file.stem, pd.DataFrame(rows, columns=COLUMNS))
        print(f"{file.stem}: {len(rows)} unexplained")


if __name__ == "__main__":
    main()
