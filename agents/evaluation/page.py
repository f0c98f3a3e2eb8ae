"""A table of controllers as a page to read: by sea, and what is equal said once."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from ...display.tables import markdown
from .kpis import KPIS
from .statistics import LEAST_SEEDS

_ALL = "any"
"""Stands for all observers of the table: the controller does not use the estimate."""


def distinct(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of a controller and a sea whose figures agree to the last digit, joined into one.

    Args:
        table: as :func:`shaftline.agents.evaluation.sweeps.evaluate` makes it.

    Returns:
        The same columns; ``observer`` names those that the row stands for, or ``any``.
    """
    every = table["observer"].nunique()
    keys = ["controller", "sea", *KPIS]

    def joined(observers: pd.Series[str]) -> str:
        return _ALL if 1 < every == len(observers) else ", ".join(observers)

    observers = table.groupby(keys, sort=False, dropna=False)["observer"].transform(joined)
    return table.assign(observer=observers).drop_duplicates(["controller", "sea", "observer"])


def zero_everywhere(table: pd.DataFrame, columns: Sequence[str]) -> list[str]:
    """Columns that say nothing because they are 0 in every row.

    Args:
        table: as :func:`shaftline.agents.evaluation.sweeps.evaluate` makes it.
        columns: to look at.
    """
    return [name for name in columns if (table[name] == 0.0).all()]


def page(table: pd.DataFrame, title: str, columns: Sequence[str]) -> str:
    """The table with its intervals as Markdown, one section a sea.

    Args:
        table: as :func:`shaftline.agents.evaluation.sweeps.evaluate` makes it.
        title: of the page.
        columns: KPIs to show; those that are zero in every row are named instead.
    """
    zero = zero_everywhere(table, columns)
    shown = [name for name in columns if name not in zero]
    rows = distinct(table)
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
        f"quantile; with fewer than {LEAST_SEEDS} episodes no interval is given. `table.csv` has the "
        "figures of every cell."
    ]
    if (rows["observer"] == _ALL).any():
        notes.append(
            f"Observer `{_ALL}`: with each of the {table['observer'].nunique()} observers the "
            "figures are the same; the controller does not use the estimate."
        )
    if zero:
        notes.append(f"Zero everywhere: {', '.join(f'`{name}`' for name in zero)}.")
    meanings = "\n".join(f"- `{name}`: {KPIS[name]}" for name in columns)
    return "\n\n".join([f"# {title}", *notes, *sections, meanings]) + "\n"
