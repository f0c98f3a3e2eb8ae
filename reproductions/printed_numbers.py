"""Count the printed numbers of the five sources by what our models knew of them, and how many are met.

The cells come from the pages that ``shaftline reproduce`` writes. The page is
``docs/results/printed-numbers.md``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from .cells import Cell, Kind, Verdict, read
from .errata import SOURCES
from .pages import make_parser
from .writing import write_results

TITLE = "Printed numbers of the sources: inputs, calibrated and predicted"
FOLDER = Path("docs/results")

PAGES = {
    "observers": ("working-points", "poles", "vaf", "snr", "sensitivity"),
    "drive train": ("tito-neri",),
    "steering": ("augmented-filter", "esso-osaka", "destroyer", "autopilot", "track"),
    "optimiser": ("levers", "optimiser"),
    "anti-spin": ("towing-tank", "storms"),
}
"""Pages with the cells of each source of :data:`.errata.SOURCES`."""

TARGET = 90.0
"""Percentage of the predicted numbers that should be met, or be off for a calculated reason."""


def count_cells(cells: Sequence[Cell]) -> dict[str, object]:
    """Return the numbers of cells by kind, and of the predicted ones that are met."""
    found = Counter((cell.kind, cell.verdict) for cell in cells)

    def of(kind: Kind) -> int:
        return sum(found[kind, verdict] for verdict in Verdict)

    free, met = of(Kind.FREE), found[Kind.FREE, Verdict.MET]
    explained = found[Kind.FREE, Verdict.EXPLAINED]
    return {
        "inputs": of(Kind.INPUT),
        "calibrated, met": f"{found[Kind.CALIBRATED, Verdict.MET]} of {of(Kind.CALIBRATED)}",
        "derived, consistent": f"{found[Kind.DERIVED, Verdict.MET]} of {of(Kind.DERIVED)}",
        "predicted": free,
        "met": met,
        "reason calculated": explained,
        "unexplained": free - met - explained,
        "met or reason calculated": _share(met + explained, free),
        "lower bound": _share(met + explained, free + of(Kind.CALIBRATED) + of(Kind.DERIVED)),
    }


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.0f} %" if whole else "–"


def tabulate(groups: Mapping[str, Sequence[Cell]], name: str) -> pd.DataFrame:
    """Return the counts of each group of cells, a row each."""
    return pd.DataFrame([{name: key, **count_cells(cells)} for key, cells in groups.items()])


def main(arguments: list[str] | None = None) -> None:
    """Count the cells of all pages, and write the page."""
    parser = make_parser("printed_numbers", __doc__, "out/printed-numbers")
    parser.add_argument("--cells", type=Path, default=FOLDER, help="folder with cells/*.csv")
    options = parser.parse_args(arguments)
    pages = {
        page: read(options.cells / "cells" / f"{page}.csv")
        for names in PAGES.values()
        for page in names
    }
    sources = {
        SOURCES[source]: [cell for page in names for cell in pages[page]]
        for source, names in PAGES.items()
    }
    every = [cell for cells in pages.values() for cell in cells]
    tables = {
        f"[{page}]({page}.md), {table}": [cell for cell in pages[page] if cell.table == table]
        for page, cells in pages.items()
        for table in dict.fromkeys(cell.table for cell in cells)
    }
    by_table = tabulate(tables, "table")
    worst = by_table[by_table["unexplained"] > 0].sort_values(
        "unexplained", ascending=False, kind="stable"
    )
    free = [cell for cell in every if cell.kind is Kind.FREE]
    fitted = sum(cell.kind in {Kind.CALIBRATED, Kind.DERIVED} for cell in every)
    explained = sum(cell.verdict is not Verdict.UNEXPLAINED for cell in free)
    write_results(
        __file__,
        options.out,
        TITLE,
        by_table,
        sources=tabulate({**sources, "all": every}, "source"),
        worst=worst.drop(columns=["inputs", "calibrated, met", "derived, consistent"]).head(12),
        count=len(every),
        free=len(free),
        explained=explained,
        share=100.0 * explained / len(free),
        all_but_inputs=len(free) + fitted,
        lower=100.0 * explained / (len(free) + fitted),
        target=TARGET,
        top=worst["unexplained"].head(12).sum(),
        unexplained=worst["unexplained"].sum(),
    )


if __name__ == "__main__":
    main()
