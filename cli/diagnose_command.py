"""``shaftline diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import mismatch
from ..core.sweep import check_backend
from ..mismatch import Options
from ..mismatch.diagnosis import SHIP
from ..mismatch.example import concealed, copy_example
from ..mismatch.folder import recordings_in
from ..mismatch.report.index import INDEX_PAGE, INDEX_TABLE, PAGE, REPORT
from ..plant import Ship, load_ship
from .console import (
    Backend,
    BelievedShip,
    ColumnMap,
    SteadyRows,
    check_folder,
    clear_errors,
    progress,
    say,
    stages,
)


def diagnose(
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Recordings (CSV or Parquet) of one condition of the ship, diagnosed together; "
            "or one FOLDER, each of whose recordings is diagnosed for itself.",
            metavar="RECORDING... | FOLDER",
            show_default=False,
        ),
    ] = None,
    ship: BelievedShip = "",
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the report and the corrected ship.", show_default=False),
    ] = None,
    columns: ColumnMap = None,
    example: Annotated[
        bool,
        typer.Option(
            "--example",
            help="Diagnose the recording that comes with the package, to see how it is done; its files "
            "are copied to --out (out/example if it is left out).",
        ),
    ] = False,
    hold_out: Annotated[
        list[Path] | None,
        typer.Option(
            help="Recording that is only judged on, never fitted; repeatable.",
            show_default="a quarter of the longest recording; of three or more, whole ones",
        ),
    ] = None,
    exclude: Annotated[
        list[str] | None,
        typer.Option(
            help="Id of an effect that cannot be the reason (see `shaftline list`); repeatable.",
            show_default=False,
        ),
    ] = None,
    effects: Annotated[
        list[Path] | None,
        typer.Option(
            help="File MY.toml with physics of your own, tried beside the catalogue; repeatable.",
            show_default=False,
        ),
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Factor on how far the ship's numbers may be off before it counts as physics; "
            "2 for a ship file that was guessed.",
        ),
    ] = 1.0,
    calibrate: Annotated[
        list[Path] | None,
        typer.Option(
            help="Recording of a period in which the ship was healthy: its numbers are found there "
            "first, and what differs now is not blamed on them; repeatable.",
            show_default=False,
        ),
    ] = None,
    free: Annotated[
        str,
        typer.Option(
            help="Keys of the ship's file, with commas between. With --calibrate, the numbers to find "
            "there; without, numbers that may be far off (30 %) and move beside the effects.",
            metavar="KEY,KEY",
            show_default="with --calibrate those that it tells, without none",
        ),
    ] = "",
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Leave out the second search, which estimates effects and ship-file parameters "
            "together where the first one leaves a residual, and takes up to two minutes.",
        ),
    ] = False,
    steady: SteadyRows = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1, help="FOLDER only: processes on this machine.", show_default="one a core"
        ),
    ] = None,
    backend: Annotated[
        Backend, typer.Option(help="FOLDER only: here, or on a dask cluster.")
    ] = Backend.PROCESSES,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of the dask cluster, such as tcp://10.0.0.1:8786.", show_default=False
        ),
    ] = None,
) -> None:
    """Find where a recording and the simulation differ, and what physics was left out.

    The recording's orders drive the simulated ship. What the ship then does otherwise than it was
    measured is looked at balance by balance (engine, propeller, hull, pitch actuator, instruments),
    compared with a catalogue of effects, fitted, and judged on a part that was set aside before
    anything was fitted. There are four verdicts, and each ends with exit code 0:

    - **explained**: this effect, of this size, with a 95 % interval, and the names that the recording
      cannot tell from it;

    - **partly-explained**: this effect holds for itself, and something else is left, whose balance is
      named;

    - **nothing-missing**: noise and the tolerances of the ship's numbers explain the difference, or
      the recording is too short or too dull to decide, and the sentence says so;

    - **unexplained**: something is missing that has no name; its size as a function of a signal.

    Written: `report.html` (read this), `report.json` (for programs), `corrected_ship.toml` (the ship
    with what was found; accepted wherever a ship is). Bad input ends with exit code 2 and a message
    that names file, column and row; nothing is written then.

    A recording needs `time_s`, `fuel_rack_mm` (or `motor_voltage_V`), `pitch_ratio_command` and
    `shaft_speed_rad_s` (or `shaft_angle_rad`), and tells more with `shaft_torque_N_m`,
    `ship_speed_m_s`, `pitch_ratio`; see docs/recordings.md. Ten samples a second over 20 minutes with
    steps of rack and pitch is good.

    Logs of ships in service have a row every ten minutes, hour or day. Rows that are slower than the
    ship are each taken as an equilibrium at the inputs of that row, and effects that act in transients
    are left out; `--steady` asks for it.

    A wrong number looks like missing physics. So the report tells which numbers moved inside their
    tolerances, and whether a wrong one would explain the difference as well as the effect that is
    named. Better is to settle it: `--calibrate` finds the numbers where nothing was wrong yet, with
    their errors, and `--free` lets those move that you do not trust. What they take up is then not
    called physics: a free resistance takes up fouling.

    If the ship file contains guesses, or the recording comes from a test rig, a biased inertia can
    absorb friction, and two effects may improve the fit only as a pair. Where the first search leaves
    more than noise, a second one therefore estimates the doubtful parameters of the file together with
    each set of effects. Its model is reported if it is clearly closer to the held-out data. `--quick`
    leaves it out.

    What the catalogue does not know you can write yourself. A file MY.toml holds

        [[term]]
        id = "apparent-wind"
        balance = "hull"
        acts_on = "resistance"
        expression = "k * wind_speed ** 2 * cos(wind_angle)"
        parameters = { k = { unit = "N s2/m2", probes = [20.0, 200.0] } }

    and `--effects MY.toml` has it tried like any other: fitted, named if it holds on the part set
    aside, carried by the corrected ship. `wind_speed` and `wind_angle` are columns of the recording,
    or named by the column map under `[signals]`. An expression is data and is never run as code. See
    docs/own-physics.md.

    A FOLDER's recordings each get a folder in DIR, and `index.html` lists them, worst first. Bad ones
    are listed with their error and do not stop the rest. What is finished is not done again.

    Examples:
        shaftline diagnose --example

        shaftline diagnose trial.csv --ship frigate --out out/trial

        shaftline diagnose log.parquet --ship mine.toml --columns logger.toml --out out/log

        shaftline diagnose run1.csv run2.csv --hold-out run3.csv --ship mine.toml --out out/runs

        shaftline diagnose june.csv --calibrate sea-trial.csv --ship mine.toml --out out/june

        shaftline diagnose log.csv --free hull.resistance_coefficient_N_s2_m2 --ship mine.toml
            --out out/log

        shaftline diagnose run1.csv run2.csv --hold-out run3.csv --ship rig.toml --out out/rig

        shaftline diagnose log.csv --columns map.toml --effects MY.toml --ship mine.toml --out out/wind

        shaftline diagnose trials/ --ship frigate --out out/trials --jobs 8
    """
    with clear_errors():
        if example:
            if recordings or ship or columns:
                raise ValueError("--example brings its own recording, ship and column map")
            out = out or Path("out/example")
            check_folder(out)
            recording, columns, file = copy_example(out)
            recordings, ship = [recording], str(file)
            say(f"recording: {recording}   column map: {columns}   ship: {file}")
        if not recordings or not ship or out is None:
            missing = "a RECORDING" if not recordings else "--ship" if not ship else "--out"
            raise ValueError(
                f"{missing} is needed: shaftline diagnose RECORDING --ship SHIP --out FOLDER; "
                "`shaftline diagnose --example` shows how"
            )
        check_folder(out, ship, SHIP)
        vessel = load_ship(ship)
        keys = tuple(key.strip() for key in free.split(",") if key.strip())
        options = Options(
            columns, tuple(exclude or ()), tolerance, tuple(calibrate or ()), keys,
            tuple(effects or ()), quick=quick, steady=steady,
        )  # fmt: skip
        options.check(vessel)
        folders = [path for path in recordings if path.is_dir()]
        if folders:
            if len(recordings) > 1 or hold_out:
                raise ValueError(
                    f"{folders[0]}: a folder stands alone, without other recordings or --hold-out"
                )
            check_backend(jobs, backend, scheduler)
            _folder(folders[0], vessel, out, options, jobs, backend, scheduler)
            return
        if jobs is not None or scheduler is not None or backend is not Backend.PROCESSES:
            raise ValueError("--jobs, --backend and --scheduler spread a FOLDER of recordings")
        with stages("diagnosing") as tick:
            diagnosis = mismatch.diagnose(
                vessel, *recordings, hold_out=hold_out or (), options=options, tick=tick
            )
            tick("writing the report", 0, 1)
            diagnosis.save(out)
        say(diagnosis.summary())
        say(f"\nreport: {out / PAGE}   data: {out / REPORT}   corrected ship: {out / SHIP}")
        if example:
            say(f"what was concealed: {concealed()}; the report was made without knowing it")


def _folder(
    folder: Path,
    ship: Ship,
    out: Path,
    options: Options,
    jobs: int | None,
    backend: str,
    scheduler: str | None,
) -> None:
    with progress("diagnosing", len(recordings_in(folder))) as tick:
        index = mismatch.diagnose_folder(
            folder, ship, out, options, jobs=jobs, backend=backend, scheduler=scheduler, tick=tick
        )
    say(index.summary())
    say(f"\nindex: {out / INDEX_PAGE}   table: {out / INDEX_TABLE}")
    if not len(index.diagnosed):
        raise ValueError(f"{folder}: none of its {len(index.failed)} recordings could be diagnosed")
