"""Markdown page of an evaluation: one section for each sea, equal rows merged."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from ...display.tables import markdown
from .kpis import KPIS
from .statistics import LEAST_SEEDS

_ALL = "any"
"""Name of the observer in a row that holds for all observers."""


def merge_equal_rows(table: pd.DataFrame) -> pd.DataFrame:
    """Merge rows of the same controller and sea whose figures agree to the last digit.

    ``observer`` of the result lists the observers of a row, or is ``any``.
    """
    every = table["observer"].nunique()
    keys = ["controller", "sea", *KPIS]

    def joined(observers: pd.Series[str]) -> str:
        return _ALL if 1 < every == len(observers) else ", ".join(observers)

    observers = table.groupby(keys, sort=False, dropna=False)["observer"].transform(joined)
    return table.assign(observer=observers).drop_duplicates(["controller", "sea", "observer"])


def zero_columns(table: pd.DataFrame, columns: Sequence[str]) -> list[str]:
    """Return the columns that are 0 in every row.

    Examples:
        >>> table = pd.DataFrame({"failed": [0.0, 0.0], "reward": [1.0, 0.0]})
        >>> zero_columns(table, ["failed", "reward"])
        ['failed']
    """
    return [name for name in columns if (table[name] == 0.0).all()]


def page(table: pd.DataFrame, title: str, columns: Sequence[str]) -> str:
    """Return the table with its intervals as Markdown, one section for each sea.

    Args:
        table: table from :func:`shaftline.agents.evaluation.sweeps.evaluate`.
        title: title of the page.
        columns: KPIs to show; those that are zero in every row are listed instead.
    """
    zero = zero_columns(table, columns)
    shown = [name for name in columns if name not in zero]
    rows = merge_equal_rows(table)
    cells = rows[["controller", "observer"]].copy()
    for name in shown:
        middle, low, high = (rows[f"{name}{end}"] for end in ("", "_low", "_high"))
        cells[name] = [
            f"{m:.2f} ({a:.2f} to {b:.2f})" if a < b else f"{m:.2f}"
            for m, a, b in zip(middle, low, high, strict=True)
        ]
    sections = [
        f"## Sea: {sea}\n\n{markdown(cells[rows['sea'] == sea])}" for sea in rows["sea"].unique()
    ]
    notes = [
        "Interquartile mean over the episodes with its 95 % interval, a bootstrap widened by Student's "
        f"quantile; with fewer than {LEAST_SEEDS} episodes no interval is given. `table.csv` contains "
        "the figures of every cell."
    ]
    if (rows["observer"] == _ALL).any():
        notes.append(
            f"Observer `{_ALL}`: the figures are the same with each of the "
            f"{table['observer'].nunique()} observers, because the controller does not use the estimate."
        )
    if zero:
        notes.append(f"Zero everywhere: {', '.join(f'`{name}`' for name in zero)}.")
    meanings = "\n".join(f"- `{name}`: {KPIS[name]}" for name in columns)
    return "\n\n".join([f"# {title}", *notes, *sections, meanings]) + "\n"
