"""``shaftline new-ship``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.files import check_writable, write_text
from ..plant.particulars import fixed_pitch_remarks, load_particulars, particulars_text
from ..plant.ship_files import template_text
from .console import report_errors, say


def new_ship(
    template: Annotated[
        str | None,
        typer.Option(help="Template: one of the names above.", show_default=False),
    ] = None,
    from_particulars: Annotated[
        Path | None,
        typer.Option(help="TOML file with the main particulars of a ship.", show_default=False),
    ] = None,
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

    With `--from-particulars` the ship is estimated from what a data sheet has: resistance, wake and
    thrust deduction by Holtrop and Mennen, blade area by Keller, pitch from the thrust at the design
    speed, the engine's map scaled to its rating. Each estimate has a note on its method, and
    `[tolerances]` state its uncertainty, which `diagnose` uses. The file needs `name`, `length_m`,
    `beam_m`, `draught_m`, `displacement_t`, `design_speed_kn`, `mcr_kW`, `engine_speed_rpm`,
    `shaft_speed_rpm`, `propeller_diameter_m`; `trial_power_kW` and `full_load_rack_mm` make the
    resistance and the engine far more certain. See `docs/ships.md` for what else it may have.

    Written: the ship file with `--out`; without it the file is printed.

    Examples:
        shaftline new-ship --template drive-with-load

        shaftline new-ship --from-particulars particulars.toml --out my_ship.toml

        shaftline new-ship --template constant-revolutions --out my_model.toml
    """
    with report_errors():
        if (template is None) == (from_particulars is None):
            raise ValueError("give either --template or --from-particulars")
        if from_particulars is not None:
            given = load_particulars(from_particulars)
            text, remarks = particulars_text(given), fixed_pitch_remarks(given)
        else:
            assert template is not None
            text, remarks = template_text(template, out.stem if out else None), []
        if out is None:
            say(text.rstrip())
            return
        check_writable(out)
        if out.suffix != ".toml":
            raise ValueError(f"--out {out}: the name of a ship file must end in .toml")
        if out.exists():
            raise ValueError(
                f"--out {out}: the file already exists; nothing was written. Give another name"
            )
        write_text(out, text)
        say(f"ship file: {out}")
        for remark in remarks:
            say(f"remark: {remark}")
