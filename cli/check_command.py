"""``shaftline check``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from .. import display
from ..core.files import check_writable, write_text
from ..mismatch.recordings.survey import survey
from ..plant import load_ship
from .console import BelievedShip, ColumnMap, SteadyRows, print_table, report_errors, say

REFUSED = 2
"""Exit code if the recording cannot be used as it is."""


def check(
    recording: Annotated[
        Path,
        typer.Argument(
            help="Recording: text file of a logger, spreadsheet or Parquet.", show_default=False
        ),
    ],
    ship: BelievedShip,
    columns: ColumnMap = None,
    steady: SteadyRows = False,
    draft: Annotated[
        Path | None,
        typer.Option(help="New file (.toml) for a column map to start from.", show_default=False),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            help="File for a picture of the channels as they are read (.png).", show_default=False
        ),
    ] = None,
) -> None:
    """Check a recording: report how it is read, what is missing and what that costs.

    The table lists each column of the file with the canonical column that it is taken for, its range,
    its noise and its missing values. The sentences below it report repairs, columns that were left out,
    and, for each missing measurement, what a diagnosis cannot identify without it. Remarks name channels
    that seem rectified, early, late or quantised. Nothing is diagnosed.

    If the recording cannot be used, the message gives the reason and, where possible, the line of the
    column map that solves it, and the exit code is 2. A column map to start from is then proposed;
    `--draft` writes it, and checks the recording as this map reads it.

    Written: the column map with `--draft`, a picture of all channels with `--figure`.

    Examples:
        shaftline check voyage.csv --ship frigate --draft logger.toml

        shaftline check log.xlsx --ship mine.toml --columns logger.toml --figure log.png
    """
    with report_errors():
        if figure is not None:
            display.figures.check_picture(figure)
            check_writable(figure)
        if draft is not None:
            if draft.suffix != ".toml":
                raise ValueError(f"--draft {draft}: the name of a column map must end in .toml")
            if draft.exists():
                raise ValueError(f"--draft {draft}: the file already exists; give another name")
            check_writable(draft)
        if recording == Path():
            raise ValueError("RECORDING is empty: give the path of one file, such as voyage.csv")
        vessel = load_ship(ship)
        found = survey(recording, vessel, columns, steady)
        written = draft is not None and bool(found.begin)
        if draft is not None and written:
            write_text(draft, "\n".join(found.begin) + "\n")
            say(f"column map: {draft}")
            for line in found.begin:
                say(line)
            if columns is not None:
                say(f"it contains the entries of {columns} as well")
            found = replace(survey(recording, vessel, draft, steady), begin=())
        print_table(pd.DataFrame(found.table()), f"{recording} on {vessel.name}")
        for sentence in found.sentences():
            say(sentence)
        if draft is not None and not written:
            say("no draft was written: no column map is needed, or no column was recognised")
        if found.recording is None:
            raise typer.Exit(REFUSED)
        if figure is not None:
            display.figures.save(
                display.figures.signals_figure(found.recording.table, f"{recording.name}"), figure
            )
            say(f"picture: {figure}")
