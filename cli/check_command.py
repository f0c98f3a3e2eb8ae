"""``shaftline check``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from .. import display
from ..core.files import check_writable, write_text
from ..mismatch.recordings.survey import survey
from ..plant import load_ship
from .console import (
    BelievedShip,
    ColumnMap,
    SteadyRows,
    clear_errors,
    print_table,
    say,
)

REFUSED = 2
"""Exit code where the recording cannot be used as it is."""


def check(
    recording: Annotated[
        Path,
        typer.Argument(
            help="Recording: text as a logger writes it, spreadsheet or Parquet.",
            show_default=False,
        ),
    ],
    ship: BelievedShip,
    columns: ColumnMap = None,
    steady: SteadyRows = False,
    draft: Annotated[
        Path | None,
        typer.Option(
            help="File (.toml, not there yet) for the column map to begin with.", show_default=False
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(help="Picture of what was understood (.png).", show_default=False),
    ] = None,
) -> None:
    """Say what of a recording is understood, what is missing, and what that costs.

    Nothing is diagnosed: each column of the file with the canonical column that it is taken for, its
    range, its noise and its missing values; how the file was read and what was mended; what was left
    out; and for each measurement that is not there, what cannot be told without it. Remarks name
    channels that look rectified, early, late or quantised. Where the recording cannot be used, the
    reason is said, with the line of the column map that mends it if there is one, a column map to begin
    with is guessed (`--draft` writes it), and the exit code is 2.

    Examples:
        shaftline check voyage.csv --ship frigate --draft logger.toml

        shaftline check log.xlsx --ship mine.toml --columns logger.toml --figure log.png
    """
    with clear_errors():
        if figure is not None:
            display.figures.check_picture(figure)
            check_writable(figure)
        if draft is not None:
            if draft.suffix != ".toml":
                raise ValueError(f"--draft {draft}: the name of a column map ends in .toml")
            if draft.exists():
                raise ValueError(f"{draft}: is there already; a draft replaces no map of yours")
            check_writable(draft)
        if recording == Path():
            raise ValueError(
                "a recording is needed, the path of one file; an empty name means the folder in which "
                "the command is called, which is a folder"
            )
        vessel = load_ship(ship)
        found = survey(recording, vessel, columns, steady)
        print_table(pd.DataFrame(found.table()), f"{recording} on {vessel.name}")
        for sentence in found.sentences():
            say(sentence)
        if draft is not None and found.begin:
            write_text(draft, "\n".join(found.begin) + "\n")
            say(f"column map to complete: {draft}")
            if columns is not None:
                say(f"it holds what {columns} leaves open; copy its lines there")
        elif draft is not None:
            say("no column map is needed, or nothing is known for one; none was written")
        if found.recording is None:
            raise typer.Exit(REFUSED)
        if figure is not None:
            display.figures.save(
                display.figures.columns(found.recording.table, f"{recording.name}"), figure
            )
            say(f"picture: {figure}")
