"""Published tables beside ours: loading, comparing, telling where they differ."""

from __future__ import annotations

import functools
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNEXPLAINED = "not explained"
"""Where a number differs and no reason is known."""


@functools.cache
def published(name: str) -> pd.DataFrame:
    """A published table that ships with the package, indexed by its first column.

    Args:
        name: file name without ending, as in ``studies/data``.
    """
    with resources.files("shaftline.studies").joinpath(f"data/{name}.csv").open() as file:
        return pd.read_csv(file, index_col=0)


def compare(
    ours: pd.DataFrame, theirs: pd.DataFrame, reasons: dict[tuple[str, str], str], tolerance: Any
) -> pd.DataFrame:
    """Both tables cell by cell.

    Args:
        ours: our numbers, rows and columns named like theirs (more rows are allowed).
        theirs: the published numbers.
        reasons: why a cell differs, by (row, column); ``"*"`` stands for every row or column.
        tolerance: difference up to which no reason is asked for: a number, or a function of
            (row, column, published value).

    Returns:
        One row per cell: row, column, ours, thesis, difference, why.
    """
    cells = []
    for row in ours.index:
        for column in ours.columns:
            value = float(ours.loc[row, column])
            printed = (
                float(theirs.loc[row, column])
                if row in theirs.index and column in theirs.columns
                else float("nan")
            )
            difference = value - printed
            allowed = tolerance(row, column, printed) if callable(tolerance) else tolerance
            why = ""
            if abs(difference) > allowed:
                why = next(
                    (
                        reasons[key]
                        for key in ((row, column), ("*", column), (row, "*"), ("*", "*"))
                        if key in reasons
                    ),
                    UNEXPLAINED,
                )
            cells.append((row, column, value, printed, difference, why))
    return pd.DataFrame(cells, columns=["row", "column", "ours", "thesis", "difference", "why"])


def side_by_side(comparison: pd.DataFrame, digits: int = 2) -> pd.DataFrame:
    """Rows and columns of the published table, each cell as ``ours (thesis)``."""

    def both(cell: Any) -> str:
        if pd.isna(cell.ours):
            return "–"
        if pd.isna(cell.thesis):
            return f"{cell.ours:.{digits}f}"
        return f"{cell.ours:.{digits}f} ({cell.thesis:.{digits}f})"

    cells = comparison.assign(cell=[both(row) for row in comparison.itertuples()])
    wide = cells.pivot(index="row", columns="column", values="cell")
    wide = wide.loc[list(dict.fromkeys(comparison["row"]))]
    return wide[list(dict.fromkeys(comparison["column"]))].reset_index(names="")


def reasons_text(comparison: pd.DataFrame) -> str:
    """The reasons for differences, each once, with the cells that it explains."""
    lines = []
    for why, cells in comparison[comparison["why"] != ""].groupby("why", sort=False):
        where = ", ".join(f"{c.row} / {c.column}" for c in cells.itertuples())
        lines.append(f"- {why} ({where})")
    return "\n".join(lines) or "- no cell differs by more than the tolerance"


class Row(NamedTuple):
    """A number beside the print."""

    key: str
    what: str
    ours: float
    printed: str
    low: float
    high: float
    why: str = ""  # it differs, or what it rests on

    @property
    def met(self) -> bool:
        """Whether it lies where the print allows it."""
        return self.low <= self.ours <= self.high


class Page(NamedTuple):
    """A page's parts."""

    rows: list[Row]
    body: str
    figures: dict[str, Figure]
    numbers: dict[str, Any]


def table(rows: list[Row]) -> pd.DataFrame:
    """Rows as a table: quantity, ours, printed, whether it is met."""
    return pd.DataFrame(
        {
            "quantity": [row.what for row in rows],
            "ours": [f"{row.ours:.4g}" for row in rows],
            "printed": [row.printed for row in rows],
            "met": ["yes" if row.met else "no" for row in rows],
        }
    )


def reasons(rows: list[Row]) -> str:
    """Why numbers differ, or what they rest on."""
    return "\n".join(f"- {row.what}: {row.why}" for row in rows if row.why)
