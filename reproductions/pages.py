"""Pages made from Markdown templates, and the options that the commands of the reproductions share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd
from matplotlib.axes import Axes

from shaftline.display.tables import markdown, write_table

_ENVIRONMENT = jinja2.Environment(
    undefined=jinja2.StrictUndefined, autoescape=False, trim_blocks=True, lstrip_blocks=True
)
_ENVIRONMENT.filters["table"] = markdown
_ENVIRONMENT.filters["fmt"] = format


def fill_template(template: Path, **fields: Any) -> str:
    """Return a page: a Markdown template whose fields are filled.

    Templates are Jinja2 with two more filters: ``{{ frame|table(3) }}`` writes a data frame as a table
    with three digits, ``{{ value|fmt(".2f") }}`` formats a number.

    Raises:
        jinja2.UndefinedError: a field that the template uses is not given.
    """
    return fill_text(template.read_text(encoding="utf-8"), **fields)


def fill_text(text: str, /, **fields: Any) -> str:
    """Return the text of a template as :func:`fill_template` returns it."""
    return _ENVIRONMENT.from_string(text).render(fields).strip()


def write_page(
    folder: Path,
    name: str,
    title: str,
    command: str,
    table: pd.DataFrame,
    template: Path,
    **fields: Any,
) -> None:
    """Fill a template, and write ``NAME.md`` with its table ``NAME.csv`` into a folder.

    ``command`` follows ``python -m reproductions`` in the line that says how the page is made.
    """
    made_by = f"python -m reproductions {command}"
    write_table(folder, name, title, made_by, table, fill_template(template, **fields))


def label_axis(
    axis: Axes,
    x: str = "",
    y: str = "",
    title: str = "",
    size: float = 8.0,
    ticks: float | None = 8.0,
    legend: float = 0.0,
) -> None:
    """Write labels [points] and title of an axis; ``legend`` is the size of its legend, 0 for none."""
    axis.set_xlabel(x, fontsize=size)
    axis.set_ylabel(y, fontsize=size)
    axis.set_title(title, fontsize=9)
    if ticks:
        axis.tick_params(labelsize=ticks)
    if legend:
        axis.legend(fontsize=legend, frameon=False)


def make_parser(
    name: str,
    description: str | None,
    out: str,
    *,
    recordings: str = "",
    kept: str = "",
    jobs: int | bool | None = False,
) -> argparse.ArgumentParser:
    """Return the parser of a command with the shared options.

    Args:
        name: name of the reproduction.
        description: docstring of the module; its first line is shown.
        out: default folder of ``--out``.
        recordings: help text of ``--recordings``; empty leaves the option out.
        kept: default folder of ``--kept``; empty leaves the option out.
        jobs: default of ``--jobs`` (None is one process for each core); False leaves the option out.
    """
    parser = argparse.ArgumentParser(
        f"python -m reproductions {name}", description=(description or "").split("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path(out), help="folder of the page")
    if recordings:
        parser.add_argument("--recordings", type=Path, required=True, help=recordings)
    if kept:
        text = "folder of intermediate results; an interrupted run resumes there"
        parser.add_argument("--kept", type=Path, default=Path(kept), help=text)
    if jobs is not False:
        text = "number of processes" + ("" if jobs else "; one for each core by default")
        parser.add_argument("--jobs", type=int, default=jobs, help=text)
    return parser


def print_dot() -> None:
    """Print a dot: one part of the work is done."""
    print(".", end="", flush=True)
