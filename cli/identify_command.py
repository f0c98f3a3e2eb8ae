"""``shaftline identify``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import mismatch
from ..mismatch.identification.free_parameters import read_free_keys
from ..mismatch.identify import SHIP
from ..mismatch.report.index import PAGE, REPORT
from ..plant import load_ship
from .console import BelievedShip, ColumnMap, check_folder, report_errors, say, stages
from .machine import add_results
from .method_options import AUTO, DEFAULT, Method


def identify(
    recordings: Annotated[list[Path], typer.Argument(
        help="Recordings (CSV or Parquet) of one condition of the ship, fitted together; with "
        "`--method steady` also tables without time_s, one row for each steady state.",
        metavar="RECORDING...", show_default=False)],
    ship: BelievedShip,
    out: Annotated[Path, typer.Option(
        help="Folder for the report and the identified ship.", show_default=False)],
    free: Annotated[str, typer.Option(
        help="Keys of the ship file to estimate, separated by commas; or `auto`: the parameters "
        "that are identifiable from the recordings, or usual for the method.")] = AUTO,
    method: Method = DEFAULT,
    columns: ColumnMap = None,
    hold_out: Annotated[list[Path] | None, typer.Option(
        help="Held-out recording, used for evaluation only; repeatable.",
        show_default="a quarter of the longest recording, if the method allows it")] = None,
    tolerance: Annotated[float, typer.Option(
        min=0.0, help="Factor on the tolerances of the fixed parameters.")] = 1.0,
) -> None:  # fmt: skip
    """Identify parameters of a ship from recordings, with their uncertainties.

    The parameters of a ship file are rarely exact to half a per cent, and a biased parameter looks like
    missing physics. Therefore identify the parameters first, and diagnose afterwards:

        shaftline identify trial.csv --ship mine.toml --free auto --out out/numbers

        shaftline diagnose other.csv --ship out/numbers/identified_ship.toml --out out/physics

        shaftline train --ship out/physics/corrected_ship.toml ...

    Written: `report.html` (read this), `report.json` (for programs), `identified_ship.toml` (the ship
    with the estimated parameters and their uncertainties under `[tolerances]`, which `diagnose` uses),
    and the tables of the method. If the recordings do not identify a parameter, or only its ratio or
    product with another one, the message names it; the exit code is then 2 and nothing is written.

    `--method ekf` assumes noise of constant strength. `--method ekf-adaptive` estimates the noise of
    every instrument and of the inflow along the recording, for example where an instrument gets worse,
    and reports it at the beginning and the end; `noise.csv` has its course.

    Recordings with steps of the commands over the whole range, much longer than the time constants of
    the ship, identify most parameters.

    Examples:
        shaftline identify run1.csv run2.csv --hold-out run3.csv --ship mine.toml --out out/id
            --free hull.resistance_coefficient_N_s2_m2,transmission.inertia_engine_side_kg_m2
    """
    with report_errors():
        check_folder(out, ship, SHIP)
        vessel = load_ship(ship)
        keys = read_free_keys(free, vessel)
        with stages("identifying") as tick:
            found = mismatch.identify(
                vessel,
                *recordings,
                free=keys,
                method=method,
                hold_out=hold_out or (),
                columns=columns,
                tolerance=tolerance,
                tick=tick,
            )
            tick("writing the report", 0, 1)
            found.save(out)
        add_results(found.to_dict())
        say(found.summary())
        say(f"\nreport: {out / PAGE}   data: {out / REPORT}   identified ship: {out / SHIP}")
