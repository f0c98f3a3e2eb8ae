"""``shaftline new-ship``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.files import check_writable, write_text
from ..plant.ship_files import template_names, template_text
from .console import report_errors, say


def new_ship(
    template: Annotated[
        str,
        typer.Option(help=f"Template: {', '.join(template_names())}.", show_default=False),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write (.toml); its name becomes the name of the ship. Without it the file is "
            "printed.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write a commented ship file to start from.

    The file can be used as it is. It contains every key with its meaning, unit and allowed range;
    optional keys are commented out with `#` and show their default. Keys that have no effect (such as
    those of a propeller where there is none) are left out. Then:

    - replace the values of the template by those of your ship, and note the source of each;

    - simulate it with a recording: `shaftline simulate --ship FILE --inputs RECORDING.csv --out
    SIM.csv`;

    - find what the file lacks: `shaftline diagnose RECORDING.csv --ship FILE --out DIR`.

    **diesel-controllable-pitch**: a ship with a rack map and a pitch actuator.

    **electric-fixed-pitch**: a DC motor and a hull that moves.

    **thruster-on-a-bench**: a DC motor at bollard pull.

    **drive-with-load**: friction and an inertia, no propeller.

    **constant-revolutions**: a model whose shaft speed the rig controls, with an open-water table.

    Written: the ship file with `--out`; without it the file is printed.

    Examples:
        shaftline new-ship --template drive-with-load

        shaftline new-ship --template constant-revolutions --out my_model.toml
    """
    with report_errors():
        if out is None:
            say(template_text(template).rstrip())
            return
        check_writable(out)
        if out.suffix != ".toml":
            raise ValueError(f"--out {out}: the name of a ship file must end in .toml")
        if out.exists():
            raise ValueError(
                f"--out {out}: the file already exists; nothing was written. Give another name"
            )
        write_text(out, template_text(template, out.stem))
        say(f"ship file: {out}")
