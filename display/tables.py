"""Tables as Markdown pages and CSV files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from ..core.files import write_atomically, write_text


def markdown(frame: pd.DataFrame, digits: int = 2) -> str:
    """Return a Markdown table; numbers rounded, missing ones as a dash, pipes in cells escaped."""

    def cell(value: Any) -> str:
        if isinstance(value, float):
            return "–" if pd.isna(value) else f"{value:.{digits}f}"
        return str(value).replace("|", "\\|")

    lines = ["| " + " | ".join(map(str, frame.columns)) + " |", "|" + "---|" * len(frame.columns)]
    lines += ["| " + " | ".join(map(cell, row)) + " |" for row in frame.itertuples(index=False)]
    return "\n".join(lines)


def write_csv(folder: Path, name: str, frame: pd.DataFrame, digits: int = 6) -> None:
    """Write ``name.csv`` into a folder, with six significant digits by default."""
    write_atomically(
        folder / f"{name}.csv",
        lambda file: frame.to_csv(file, index=False, float_format=f"%.{digits}g"),
    )


def write_table(
    folder: Path, name: str, title: str, command: str, frame: pd.DataFrame, body: str
) -> None:
    """Write ``name.csv`` and ``name.md`` into a folder."""
    write_csv(folder, name, frame)
    write_text(folder / f"{name}.md", f"# {title}\n\nMade by `{command}`.\n\n{body}\n")
