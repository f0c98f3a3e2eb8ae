"""``shaftline diagnose``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import mismatch
from ..core.sweep import check_backend
from ..mismatch import Options
from ..mismatch.example import concealed, copy_example
from ..mismatch.folder import find_recordings
from ..mismatch.identification.free_parameters import split_keys
from ..mismatch.report.index import (
    CALIBRATED,
    INDEX_PAGE,
    INDEX_TABLE,
    PAGE,
    PDF,
    REPORT,
    SHIP,
)
from ..plant import Ship, load_ship
from . import console
from .console import check_folder, progress, report_errors, say, stages


def diagnose(
    recordings: Annotated[list[Path] | None, typer.Argument(
        help="Recordings (CSV or Parquet) of one condition of the ship, diagnosed together; "
        "or one FOLDER, whose recordings are diagnosed one by one.",
        metavar="RECORDING... | FOLDER", show_default=False)] = None,
    ship: console.BelievedShip = "",
    out: Annotated[Path | None, typer.Option(
        help="Folder for the report and the corrected ship.", show_default=False)] = None,
    columns: console.ColumnMap = None,
    example: Annotated[bool, typer.Option(
        "--example",
        help="Diagnose the example recording of the package; its files are copied to --out "
        "(default: out/example).")] = False,
    hold_out: Annotated[list[Path] | None, typer.Option(
        help="Held-out recording, used for evaluation only; repeatable.",
        show_default="a quarter of the longest recording; of three or more, whole ones")] = None,
    exclude: Annotated[list[str] | None, typer.Option(
        help="Id of an effect to exclude (see `shaftline list --effects`); repeatable.",
        show_default=False)] = None,
    effects: Annotated[list[Path] | None, typer.Option(
        help="File MY.toml with user-defined effects, added to the catalogue; repeatable.",
        show_default=False)] = None,
    tolerance: Annotated[float, typer.Option(
        min=0.0,
        help="Factor on the tolerances of the ship's parameters, within which a difference does not "
        "count as physics; 2 for a ship file with guesses.")] = 1.0,
    calibrate: Annotated[list[Path] | None, typer.Option(
        help="Recording of a reference period without missing physics, from which parameters are "
        "estimated first; repeatable.", show_default=False)] = None,
    free: Annotated[str, typer.Option(
        help="Keys of the ship file, separated by commas. With --calibrate: parameters to estimate "
        "from the reference period; without: parameters that are uncertain by 30 % and are "
        "estimated together with the effects.", metavar="KEY,KEY",
        show_default="with --calibrate: the identifiable ones; without: none")] = "",
    quick: Annotated[bool, typer.Option(
        "--quick",
        help="Leave out the second search, which estimates effects and parameters of the ship file "
        "together if the first one leaves a residual; it takes some minutes.")] = False,
    steady: console.SteadyRows = False,
    pdf: Annotated[bool, typer.Option(
        "--pdf", help="Also write report.pdf, the report on A4 pages for print and mail.")] = False,
    jobs: Annotated[int | None, typer.Option(
        min=1, help="FOLDER only: processes on this machine.", show_default="one a core")] = None,
    backend: Annotated[console.Backend, typer.Option(
        help="FOLDER only: processes of this machine, or a dask cluster.")] = console.Backend.PROCESSES,
    scheduler: console.Scheduler = None,
) -> None:  # fmt: skip
    """Diagnose why a recording and the simulation differ, and identify missing physics.

    The commands of the recording drive the simulated ship. The differences between measurement and
    simulation are analysed for each balance (engine, propeller, hull, pitch actuator, instruments),
    compared with a catalogue of effects, fitted, and evaluated on a held-out part of the recording.
    There are four verdicts, and each ends with exit code 0:

    - **explained**: one effect or several, with sizes and 95 % intervals, and the effects that the
    recording
      cannot distinguish from them;

    - **partly-explained**: an effect is identified, and a residual remains in a balance that is named;

    - **nothing-missing**: noise and the tolerances of the ship's parameters explain the difference, or
    the
      recording is too short or has too little excitation to decide, and the report says so;

    - **unexplained**: physics is missing that matches no effect; the report shows it as a function of a
    signal.

    Written: `report.html` (read this: its first page says what the difference costs in speed, power and
    fuel, where it is and what to do next; the technical part follows), `report.json` (for programs),
    `corrected_ship.toml` (the ship with the identified effects; accepted wherever a ship is), with
    `--calibrate` `calibrated_ship.toml` (for other voyages, in place of `--calibrate`), and with
    `--pdf` `report.pdf`. Invalid input ends with exit code 2 and a
    message that names file, column and row; nothing is written then.

    A recording needs `time_s`, `fuel_rack_mm` (or `motor_voltage_V`), `pitch_ratio_command` and
    `shaft_speed_rad_s` (or `shaft_angle_rad`). The columns `shaft_torque_N_m`, `ship_speed_m_s` and
    `pitch_ratio` make more effects identifiable; see docs/recordings.md. Recommended are 20 minutes at
    ten samples a second with steps of rack and pitch.

    Logs of ships in service have a row every ten minutes, hour or day. If rows are slower than the ship,
    each row is treated as an equilibrium at the inputs of that row, and effects of transients are left
    out; `--steady` enforces this.

    A biased parameter of the ship file can look like missing physics. The report therefore lists the
    parameters that moved within their tolerances, and whether a biased parameter would explain the
    difference equally well. To decide between them, `--calibrate` first estimates parameters from a
    recording of a reference period, and `--free` frees parameters that are uncertain. A difference that
    a free parameter can explain is not reported as physics: a free resistance explains fouling.

    If the ship file contains guesses, or the recording comes from a test rig, a biased inertia can
    absorb friction, and two effects may improve the fit only as a pair. If the first search leaves a
    residual above the noise, a second search therefore estimates the uncertain parameters of the file
    together with each set of effects. Its model is reported if it is clearly closer to the held-out
    data. `--quick` leaves it out.

    You can define physics that the catalogue does not contain. A file MY.toml has the form

        [[term]]
        id = "apparent-wind"
        balance = "hull"
        acts_on = "resistance"
        expression = "k * wind_speed ** 2 * cos(wind_angle)"
        parameters = { k = { unit = "N s2/m2", probes = [20.0, 200.0] } }

    and `--effects MY.toml` adds it to the candidates: it is fitted, reported if it holds on the held-out
    part, and included in the corrected ship. `wind_speed` and `wind_angle` are columns of the recording,
    or are mapped under `[signals]` of the column map. An expression is data and is never run as code.
    See docs/own-physics.md.

    For a FOLDER, each recording gets a folder in DIR, and `index.html` lists them, worst first.
    Recordings with errors are listed with their error and do not stop the others. Finished recordings
    are not diagnosed again.

    Examples:
        shaftline diagnose --example

        shaftline diagnose trial.csv --ship frigate --out out/trial

        shaftline diagnose log.parquet --ship mine.toml --columns logger.toml --out out/log

        shaftline diagnose run1.csv run2.csv --hold-out run3.csv --ship mine.toml --out out/runs

        shaftline diagnose june.csv --calibrate sea-trial.csv --ship mine.toml --out out/june

        shaftline diagnose log.csv --free hull.resistance_coefficient_N_s2_m2 --ship mine.toml
            --out out/log

        shaftline diagnose log.csv --columns map.toml --effects MY.toml --ship mine.toml --out out/wind

        shaftline diagnose trials/ --ship frigate --out out/trials --jobs 8
    """
    with report_errors(resumes=any(path.is_dir() for path in recordings or ())):
        if example:
            if recordings or ship or columns:
                raise ValueError(
                    "--example has its own recording, ship and column map: leave yours out"
                )
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
        check_folder(out, ship, SHIP, CALIBRATED)
        vessel = load_ship(ship)
        keys = tuple(split_keys(free))
        options = Options(
            columns,
            tuple(exclude or ()),
            tolerance,
            tuple(calibrate or ()),
            keys,
            tuple(effects or ()),
            quick=quick,
            steady=steady,
        )
        options.check(vessel)
        folders = [path for path in recordings if path.is_dir()]
        if folders:
            if len(recordings) > 1 or hold_out:
                raise ValueError(
                    f"{folders[0]}: give a folder alone, without other recordings and without --hold-out"
                )
            check_backend(jobs, backend, scheduler)
            _folder(folders[0], vessel, out, options, pdf, jobs, backend, scheduler)
            return
        if jobs is not None or scheduler is not None or backend is not console.Backend.PROCESSES:
            raise ValueError(
                "--jobs, --backend and --scheduler are for a FOLDER of recordings only"
            )
        with stages("diagnosing") as tick:
            diagnosis = mismatch.diagnose(
                vessel, *recordings, hold_out=hold_out or (), options=options, tick=tick
            )
            tick("writing the report", 0, 1)
            diagnosis.save(out, pdf=pdf)
        say(diagnosis.summary())
        printed = f"   for print: {out / PDF}" if pdf else ""
        say(
            f"\nreport: {out / PAGE}{printed}   data: {out / REPORT}   corrected ship: {out / SHIP}"
        )
        if diagnosis.calibrated is not None:
            say(
                f"calibrated ship: {out / CALIBRATED}; give it with --ship in place of --calibrate to "
                "diagnose other voyages of the same instruments"
            )
        if diagnosis.alternatives or diagnosis.hidden:
            what = "decide between the alternatives" if diagnosis.alternatives else "decide"
            say(f"trial that would {what}: shaftline plan-trial {out / REPORT}")
        if example:
            say(f"concealed effect: {concealed()}; the diagnosis did not know it")


def _folder(
    folder: Path,
    ship: Ship,
    out: Path,
    options: Options,
    pdf: bool,
    jobs: int | None,
    backend: str,
    scheduler: str | None,
) -> None:
    with progress("diagnosing", len(find_recordings(folder))) as tick:
        index = mismatch.diagnose_folder(
            folder,
            ship,
            out,
            options,
            pdf=pdf,
            jobs=jobs,
            backend=backend,
            scheduler=scheduler,
            tick=tick,
        )
    say(index.summary())
    say(f"\nindex: {out / INDEX_PAGE}   table: {out / INDEX_TABLE}")
    if not len(index.diagnosed):
        raise ValueError(f"{folder}: none of its {len(index.failed)} recordings could be diagnosed")
