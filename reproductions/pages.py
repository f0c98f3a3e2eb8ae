"""Pages made from Markdown templates, and the options that the commands of the reproductions share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import jinja2

from shaftline.display.tables import markdown

_ENVIRONMENT = jinja2.Environment(
    undefined=jinja2.StrictUndefined, autoescape=False, trim_blocks=True, lstrip_blocks=True
)
_ENVIRONMENT.filters["table"] = markdown
_ENVIRONMENT.filters["fmt"] = format


def fill_template(template: Path, **fields: Any) -> str:
    """Return a page: a Markdown template whose fields are filled.

    Templates are Jinja2 with two more filters: ``{{ frame|table(3) }}`` writes a data frame as a table
    with three digits, ``{{ value|fmt(".2f") }}`` formats a number.

    Args:
        template: file of the template.
        fields: values by name; a field that the template uses and that is not given is an error.

    Raises:
        jinja2.UndefinedError: a field is not given.
    """
    return fill_text(template.read_text(encoding="utf-8"), **fields)


def fill_text(text: str, /, **fields: Any) -> str:
    """Return the text of a template as :func:`fill_template` returns it."""
    return _ENVIRONMENT.from_string(text).render(fields).strip()


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
        recordings: help text of ``--recordings``; empty where the command reads no recordings.
        kept: default folder of ``--kept``; empty where no intermediate results are kept.
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
