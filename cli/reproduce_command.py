"""``shaftline reproduce``."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..core.files import write_json
from ..studies import reproduce as study
from .console import clear_errors, console, print_table, progress


class Table(StrEnum):
    """Tables that can be reproduced."""

    WORKING_POINTS = "working-points"
    POLES = "poles"
    VAF = "vaf"
    SNR = "snr"
    SENSITIVITY = "sensitivity"
    STORMS = "storms"
    LEVERS = "levers"
    TITO_NERI = "tito-neri"
    AUGMENTED_FILTER = "augmented-filter"
    ESSO_OSAKA = "esso-osaka"
    DESTROYER = "destroyer"
    AUTOPILOT = "autopilot"
    TRACK = "track"
    ALL = "all"


def reproduce(
    table: Annotated[Table, typer.Argument(help="Which table.")] = Table.ALL,
    out: Annotated[Path, typer.Option(help="Folder for CSV, Markdown and figures.")] = Path(
        "out/reproduce"
    ),
    json: Annotated[
        Path | None, typer.Option(help="File for our numbers by table, row and column.")
    ] = None,
) -> None:
    """Reproduce the thesis's tables, ours beside the printed numbers.

    Van der Kroft, "Development and Analysis of Advance Velocity Observers for Marine Propulsion
    Systems", TU Delft 2020. `working-points`: Table 2-1; `poles`: 2-2 to 2-14; `vaf`: 4-1; `snr`:
    4-2; `sensitivity`: 5-1. `storms`: Table 1 of Pivano et al. 2008, anti-spin, beside storms.
    `levers`: Tables 1 to 3 of the CPP optimiser paper. `tito-neri`: Table 5 of Vrijdag & Martelli
    2021, a drive train's numbers from its steady states and frequency response. `augmented-filter`:
    Taylor's thesis (MIT 2000), appendix A, and the same filter on the frigate; `esso-osaka` and
    `destroyer`: its sections 2.3 and 4.2, steering told from a zig-zag; `autopilot` and `track`: its
    sections 5.2 and 5.3, loops and voyages. Where a number differs, a
    sentence says why.
    """
    names = list(study.TABLES) if table is Table.ALL else [table.value]
    with clear_errors():
        numbers = {}
        for name in names:
            make, ticks = study.TABLES[name]
            with progress(name, ticks) as tick:
                result = make(out, tick)
            digits = 4 if name == "poles" else 2
            print_table(result.shown, result.title, digits)
            console.print("Where they differ, and why:\n" + result.reasons + "\n",
                          highlight=False, markup=False)  # fmt: skip
            numbers[name] = result.numbers
        if json is not None:
            write_json(json, numbers)
            console.print(f"numbers: {json}", highlight=False, soft_wrap=True)
        console.print(f"CSV, Markdown and figures: {out}", highlight=False, soft_wrap=True)
