"""The printed tables and figures of the five sources by name, computed again and written as pages."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from shaftline.display import figures
from shaftline.display.tables import write_table

from .augmented_filter import destroyer, esso_osaka
from .augmented_filter import page as filter_page
from .cells import Cell
from .ferry import levers, optimiser
from .side_by_side import Page, Study, Tick, cell_table, reasons_text, verdicts
from .steering import page as steering_page
from .steering import results as steering_results
from .storms import page as storm_page
from .thesis import poles_page, sensitivity, snr, vaf, working_points
from .tito_neri import identification_page
from .towing_tank import page as towing_tank_page


class Reproduced(NamedTuple):
    """A reproduced source: the table for the console, reasons of differences, numbers and cells."""

    title: str
    shown: pd.DataFrame
    reasons: str
    numbers: dict[str, Any]
    cells: list[Cell]


def augmented_filter(tick: Tick) -> Page:
    """Return the page of the falling body of Taylor 2000, and of the same filter on the frigate."""
    found = filter_page.compute_results(tick)
    numbers: dict[str, dict[str, float]] = {}
    for row in found.falls.to_dict("records"):
        of = numbers.setdefault(f"falling body, beta {row['beta']:g}, {row['readings']}", {})
        of[str(row["quantity"])] = float(row["median"])
    drawn = {"augmented-filter": filter_page.figure(found)}
    cells, body, shown = (
        filter_page.cells_of(found),
        filter_page.body(found),
        filter_page.fall_table(found),
    )
    return Page(cells, body, drawn, numbers, found.falls, shown)


STUDIES: dict[str, Study] = {
    "working-points": working_points.STUDY,
    "poles": poles_page.STUDY,
    "vaf": vaf.STUDY,
    "snr": snr.STUDY,
    "sensitivity": sensitivity.STUDY,
    "storms": storm_page.STUDY,
    "towing-tank": towing_tank_page.STUDY,
    "levers": levers.STUDY,
    "optimiser": optimiser.STUDY,
    "tito-neri": identification_page.STUDY,
    "augmented-filter": Study(filter_page.TITLE, augmented_filter, filter_page.TICKS),
    "esso-osaka": Study(esso_osaka.TITLE, esso_osaka.page, esso_osaka.TICKS),
    "destroyer": Study(destroyer.TITLE, destroyer.page, destroyer.TICKS),
    "autopilot": Study(
        steering_page.AUTOPILOT_TITLE, steering_page.autopilot, steering_results.AUTOPILOT_TICKS
    ),
    "track": Study(steering_page.TRACK_TITLE, steering_page.track, steering_results.TRACK_TICKS),
}
"""Every reproduction by the name of its page."""


def reproduce(name: str, folder: Path, tick: Tick) -> Reproduced:
    """Compute a reproduction and write its page, table and figures to a folder.

    Args:
        name: key of :data:`STUDIES`.
        folder: of ``NAME.md``, ``NAME.csv`` and ``figures/``.
        tick: called once for each part of the work, as often as the study says.
    """
    study = STUDIES[name]
    page = study.compute(tick)
    compared = cell_table(page.cells)
    table = compared if page.table is None else page.table
    body = f"{page.body}\n\n{verdicts(name, page.cells)}"
    write_table(folder, page.file or name, study.title, f"shaftline reproduce {name}", table, body)
    for file, figure in page.figures.items():
        figures.save(figure, folder / "figures" / f"{file}.png", page.dpi)
    shown = compared if page.shown is None else page.shown
    return Reproduced(study.title, shown, reasons_text(page.cells), page.numbers, list(page.cells))


TABLES: dict[str, tuple[Callable[[Path, Tick], Reproduced], int]] = {
    name: (partial(reproduce, name), study.ticks) for name, study in STUDIES.items()
}
"""The function that writes each page, and the number of its ticks."""
