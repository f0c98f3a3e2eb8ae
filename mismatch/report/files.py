"""The folder of a result: its report, its page, its ship and its tables."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ...core.files import write_json, write_text
from ...plant.ship import Ship
from ...plant.ship_files import write_ship

REPORT, PAGE = "report.json", "report.html"
"""Names of the files that every result has."""


def write_result(
    folder: str | Path,
    report: dict[str, Any],
    page: str | None,
    ships: Mapping[str, Ship],
    tables: Mapping[str, pd.DataFrame] | None = None,
) -> Path:
    """Write a result, of which all has been made; each file is renamed into place.

    Args:
        folder: made where needed.
        report: for :data:`REPORT`.
        page: for :data:`PAGE`; None where none is wanted.
        ships: by the names of their files.
        tables: by the names of theirs, without ``.csv``.

    Returns:
        The folder.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder = Path(folder)
    texts = {f"{name}.csv": table.to_csv(index=False) for name, table in (tables or {}).items()}
    if page is not None:
        texts[PAGE] = page
    write_json(folder / REPORT, report)
    for name, ship in ships.items():
        write_ship(ship, folder / name)
    for name, text in texts.items():
        write_text(folder / name, text)
    return folder
