"""``shaftline identify``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import mismatch
from ..mismatch.identification.free_parameters import AUTO, doubtful
from ..mismatch.identify import DEFAULT, METHODS, SHIP
from ..mismatch.report.index import PAGE, REPORT
from ..plant import load_ship
from .console import (
    BelievedShip,
    ColumnMap,
    check_folder,
    clear_errors,
    say,
    stages,
)
from .machine import numbers


def identify(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="Recordings (CSV or Parquet) of one condition of the ship, fitted together; by "
            "`steady` also tables of points, a row each steady state, without time_s.",
            metavar="RECORDING...",
            show_default=False,
        ),
    ],
    ship: BelievedShip,
    out: Annotated[
        Path,
        typer.Option(help="Folder for the report and the identified ship.", show_default=False),
    ],
    free: Annotated[
        str,
        typer.Option(
            help="Keys of the ship's file that may move, with commas between; or `auto`: those that "
            "the recordings tell, or that the method usually finds."
        ),
    ] = AUTO,
    method: Annotated[
        str, typer.Option(help=f"How: {', '.join(METHODS)}.", metavar="METHOD")
    ] = DEFAULT,
    columns: ColumnMap = None,
    hold_out: Annotated[
        list[Path] | None,
        typer.Option(
            help="Recording that is only judged on, never fitted; repeatable.",
            show_default="a quarter of the longest recording, where the method can do without",
        ),
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(min=0.0, help="Factor on how far the numbers that are not free may be off."),
    ] = 1.0,
) -> None:
    """Find a ship's numbers from recordings, and how sure they are.

    A file's numbers are never right to half a per cent, and a wrong number looks like missing
    physics. So find the numbers first, then look for physics:

        shaftline identify trial.csv --ship mine.toml --free auto --out out/numbers

        shaftline diagnose other.csv --ship out/numbers/identified_ship.toml --out out/physics

        shaftline train --ship out/physics/corrected_ship.toml ...

    Written: `report.html` (read this), `report.json` (for programs), `identified_ship.toml` (the ship
    with the numbers, and how well each is known under `[tolerances]`, so that `diagnose` knows it
    too), and the tables of the method. Numbers that the recording does not tell, or of which it tells
    only a ratio or a product, are refused by name: exit code 2, nothing written.

    Steps of the demands over the whole range, for many of the ship's time constants, tell most.

    Examples:
        shaftline identify run1.csv run2.csv --hold-out run3.csv --ship mine.toml --out out/id
            --free hull.resistance_coefficient_N_s2_m2,transmission.inertia_engine_side_kg_m2
    """
    with clear_errors():
        check_folder(out, ship, SHIP)
        vessel = load_ship(ship)
        keys = [key.strip() for key in free.split(",") if key.strip()]
        if not keys:
            raise ValueError(
                f"--free {free!r} names no key; give {AUTO}, or keys of the ship's file with commas "
                f"between: {', '.join(doubtful(vessel))}"
            )
        with stages("identifying") as tick:
            found = mismatch.identify(
                vessel, *recordings, free=AUTO if keys == [AUTO] else keys, method=method,
                hold_out=hold_out or (), columns=columns, tolerance=tolerance, tick=tick,
            )  # fmt: skip
            tick("writing the report", 0, 1)
            found.save(out)
        numbers(found.to_dict())
        say(found.summary())
        say(f"\nreport: {out / PAGE}   data: {out / REPORT}   identified ship: {out / SHIP}")
