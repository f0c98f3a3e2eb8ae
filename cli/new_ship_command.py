"""``shaftline new-ship``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.files import check_writable, write_text
from ..plant.ship_files import template_names, template_text
from .console import clear_errors, say


def new_ship(
    template: Annotated[
        str,
        typer.Option(
            help=f"What to start from: {', '.join(template_names())}.", show_default=False
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write (.toml); its name becomes the ship's. Printed where it is left out.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write a commented ship file to start from.

    The file loads as it is. Every key stands in it with what it means, its unit and its allowed range;
    those that may be left out stand behind a `#` with the value that acts then. Keys that act on nothing
    (of a propeller where there is none) are not in it. Then:

    - put your numbers in place of the template's, and note where each comes from;

    - drive it with a recording: `shaftline simulate --ship FILE --inputs RECORDING.csv --out SIM.csv`;

    - ask what the file leaves out: `shaftline diagnose RECORDING.csv --ship FILE --out DIR`.

    **diesel-controllable-pitch**: a ship with a rack map and a pitch actuator.

    **electric-fixed-pitch**: a DC motor and a hull that moves.

    **thruster-on-a-bench**: a DC motor at bollard pull.

    **drive-with-load**: friction and an inertia, no propeller.

    **constant-revolutions**: a model whose revolutions the rig holds, with an open-water table.

    Examples:
        shaftline new-ship --template drive-with-load

        shaftline new-ship --template constant-revolutions --out my_model.toml
    """
    with clear_errors():
        if out is None:
            say(template_text(template).rstrip())
            return
        check_writable(out)
        if out.suffix != ".toml":
            raise ValueError(f"--out {out}: a ship's file ends in .toml")
        if out.exists():
            raise ValueError(f"--out {out}: is there already; nothing was written")
        write_text(out, template_text(template, out.stem))
        say(f"ship file: {out}")
