"""Write pages with their tables and figures, and make the cells and panels that many of them share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.core.statistics import wilson_interval
from shaftline.display.figures import PALETTE, TRUTH, new_figure, save
from shaftline.display.tables import write_table
from shaftline.mismatch import identify
from shaftline.plant import Ship

from .cells import Cell, Kind, number
from .pages import fill_template

DIGIT = "half a unit of the last printed digit"
WORDS = "the limit that the words name"


def near(
    where: str,
    what: str,
    ours: float,
    printed: float,
    within: float,
    basis: str = DIGIT,
    kind: Kind = Kind.FREE,
) -> Cell:
    """Return the cell of a printed number of a section without columns."""
    return number(where, what, "", ours, printed, within, basis, kind)


def claim(
    where: str,
    what: str,
    ours: float,
    words: str,
    low: float,
    high: float,
    basis: str = WORDS,
    kind: Kind = Kind.FREE,
) -> Cell:
    """Return the cell of printed words that hold between two limits."""
    return Cell(where, what, "", ours, low, high, basis, kind, words=words)


def rms(values: Any) -> float:
    """Return the root mean square of some values."""
    return float(np.sqrt(np.mean(np.square(np.asarray(values)))))


def refusal(ship: Ship, recordings: Sequence[Any], keys: Sequence[str], **options: Any) -> str:
    """Return the message with which ``identify`` refuses parameters that are not identifiable.

    Raises:
        ValueError: the parameters are not refused.
    """
    try:
        identify(ship, *recordings, free=keys, **options)
    except ValueError as error:
        return str(error)
    raise ValueError(f"identify did not refuse {', '.join(keys)}")


def interval(estimate: Any, form: str = ".3g") -> str:
    """Return an estimate with its 95 % interval as text."""
    low, high = estimate.ci95
    return f"{estimate.value:{form}} ({low:{form}} to {high:{form}})"


def span(values: Iterable[float], digits: int = 2) -> str:
    """Return the least and the largest of some values as text."""
    known = list(values)
    return f"{min(known):.{digits}f} to {max(known):.{digits}f}"


def share(hits: Any, digits: int = 2) -> str:
    """Return the share of true values with Wilson's 95 % interval as text; a dash without values."""
    count, whole = int(np.sum(hits)), len(hits)
    if not whole:
        return "–"
    low, high = wilson_interval(count, whole)
    return f"{count / whole:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


class Line(NamedTuple):
    """A line of a panel."""

    x: Any
    y: Any
    label: str = ""
    color: str = TRUTH
    style: str = "-"
    width: float = 1.0


class Panel(NamedTuple):
    """The lines of one pair of axes.

    Args:
        lines: in the order in which they are drawn.
        settings: arguments of :meth:`matplotlib.axes.Axes.set`, such as ``ylabel``.
        legend: number of columns of the legend; 0 for none.
    """

    lines: Iterable[Line]
    settings: Mapping[str, Any]
    legend: int = 0


def against_measured(
    time: Any, measured: Any, simulated: Mapping[str, Any], colors: Sequence[str] = PALETTE
) -> list[Line]:
    """Return the line of a measurement and those of simulations by label."""
    return [
        Line(time, measured, "measured", width=1.4),
        *(
            Line(time, y, label, color, width=1.1)
            for color, (label, y) in zip(colors, simulated.items(), strict=False)
        ),
    ]


def draw(
    panels: Sequence[Panel],
    size: tuple[float, float],
    columns: int = 1,
    xlabel: str = "",
    title: str = "",
) -> Figure:
    """Draw panels row by row, with the label of the x axes below the last row; ``size`` in inches."""
    figure, axes = new_figure(len(panels) // columns, columns, size)
    if title:
        figure.suptitle(title, fontsize=12)
    for axis, panel in zip(axes.flat, panels, strict=True):
        for line in panel.lines:
            axis.plot(
                line.x, line.y, line.style, color=line.color, label=line.label, linewidth=line.width
            )
        axis.set(**panel.settings)
        axis.title.set_fontsize(9)
        axis.tick_params(labelsize=8)
        if panel.legend:
            axis.legend(fontsize=8, frameon=False, ncols=panel.legend)
    if xlabel:
        for axis in axes[-1]:
            axis.set_xlabel(xlabel)
    return figure


def write_results(
    module: str,
    folder: Path,
    title: str,
    table: pd.DataFrame,
    figures: Mapping[str, Figure] = MappingProxyType({}),
    options: str = "",
    /,
    **fields: Any,
) -> Path:
    """Write ``NAME.md``, ``NAME.csv`` and the figures of a reproduction; print and return the page.

    Args:
        module: its ``__file__``; the template of the page lies beside it with the ending ``.md``.
        folder: of the page; figures are written to ``figures/``.
        title: title of the page.
        table: table of the CSV file.
        figures: by what their names add to the name of the page.
        options: further options in the command of the page.
        fields: fields of the template.
    """
    file = Path(module)
    short = file.parent.name if file.stem == "page" else file.stem
    name = short.replace("_", "-")
    command = f"python -m reproductions {short} --out docs/results {options}".strip()
    write_table(
        folder, name, title, command, table, fill_template(file.with_suffix(".md"), **fields)
    )
    for ending, figure in figures.items():
        save(figure, folder / "figures" / f"{name}{ending}.png")
    print(f"page: {folder / name}.md")
    return folder / f"{name}.md"
