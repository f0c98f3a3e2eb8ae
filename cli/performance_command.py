"""``shaftline performance``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..performance.monitoring import (
    PerformanceReport,
    analyse_performance,
    load_reference_ship,
    read_log,
)
from ..performance.monitoring_report import periods_table, save_performance
from ..performance.tables import read_table
from ..plant import Ship, load_ship
from .console import check_folder, print_table, report_errors, say, stages

if TYPE_CHECKING:
    from ..performance.physical_cause import PhysicalCause


def performance(
    log: Annotated[
        Path,
        typer.Argument(
            help="Log of the ship: hours, noon reports or faster rows; or a folder of logs, such as one "
            "for each month.",
            show_default=False,
        ),
    ],
    ship: Annotated[
        Path,
        typer.Option(help="TOML file with the reference curve of the ship.", show_default=False),
    ],
    plant: Annotated[
        str | None,
        typer.Option(
            help="Ship (preset or TOML file) whose propulsion plant explains the speed loss: each "
            "period is diagnosed against the first.",
            show_default=False,
        ),
    ] = None,
    columns: Annotated[
        Path | None,
        typer.Option(
            help="Column map of the log for --plant, as of `diagnose`.", show_default=False
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for tables, figure and report.")] = Path(
        "out/performance"
    ),
) -> None:
    """Compute the speed loss of a ship in service by ISO 19030.

    The speed loss is the difference between the measured speed through the water and the speed at
    which the reference curve has the measured power, in per cent; a fouled hull has a negative one.
    The power is corrected for wind. Rows outside the reference conditions are left out: true wind
    above 7.9 m/s, shallow water, water below 2 degrees Celsius, rudder above 5 degrees, another
    draught. Events such as a docking or a cleaning are found as steps of the trend.

    LOG has the columns `time` (dates), `speed_through_water_kn`, `shaft_power_kW`; where logged also
    `speed_over_ground_kn`, `wind_speed_m/s` and `wind_angle_deg` (relative), `draught_m` or
    `draught_fore_m` and `draught_aft_m`, `depth_m`, `water_temperature_C`, `rudder_deg`. Short names
    and units in brackets are read too: `STW [kn]`.

    The ship file has `name`, `beam_m`, `draught_m`, the reference curve `speed_kn` and `power_kW`
    (lists) and, for the wind, the table `[superstructure]` as in `shaftline trial`.

    A speed loss does not say where it arises. With --plant, and a log that also has the fuel rack,
    the pitch and the shaft speed, the plant is calibrated on the first period, and each later period
    is diagnosed: hull, propeller, engine or instrument, with its size.

    Written: `periods.csv`, `daily.csv`, `report.json`, `speed-loss.png`; with --plant also the
    report of each diagnosis in `period-2`, `period-3`, ...

    Examples:
        shaftline performance log.csv --ship reference.toml --out out/performance

        shaftline performance logs/2026 --ship reference.toml

        shaftline performance log.csv --ship reference.toml --plant ship.toml --columns map.toml
    """
    with report_errors():
        check_folder(out)
        if plant is None and columns is not None:
            raise ValueError(
                "--columns: has an effect with --plant only; give --plant SHIP as well"
            )
        vessel = None if plant is None else load_ship(plant)
        report = analyse_performance(load_reference_ship(ship), read_log(log))
        causes: list[PhysicalCause] = []
        remarks = list(report.remarks)
        if vessel is not None:
            causes = _explain(report, log, vessel, columns, remarks)
        save_performance(report, out, causes)
        table = periods_table(report).rename(columns=_HEADS)
        print_table(table, f"{report.ship.name}: speed loss by period", 2)
        left = {reason: count for reason, count in report.rejected.items() if count}
        reasons = "; ".join(f"{reason}: {count}" for reason, count in left.items())
        say(f"{len(report.rows)} rows used" + (f"; left out: {reasons}" if left else ""))
        for remark in remarks:
            say(f"note: {remark}")
        for cause in causes:
            say(f"from {table['from'].iloc[cause.period]}: {cause.headline}")
            if cause.diagnosis is not None:
                say(f"  {cause.diagnosis.sentence}")
        say(f"\nPicture: {out / 'speed-loss.png'}   results: {out / 'report.json'}")


def _explain(
    report: PerformanceReport, log: Path, ship: Ship, columns: Path | None, remarks: list[str]
) -> list[PhysicalCause]:
    """Return the physical causes; where there is none, the reason is added to the remarks."""
    from ..mismatch import load_recording
    from ..performance.physical_cause import explain_periods

    recording = load_recording(read_table(log) if log.is_dir() else log, ship, columns)
    try:
        with stages("diagnosing the periods") as tick:
            return [*explain_periods(report, recording, ship, tick)]
    except ValueError as error:  # The speed loss is a result without its cause, too.
        remarks.append(f"no physical cause: {error}")
        return []


_HEADS = {
    "speed_loss_percent": "loss %",
    "ci95_half": "+-",
    "trend_percent_per_year": "trend %/year",
    "trend_ci95_half": "+- ",
    "step_percent": "step %",
    "step_ci95_half": "+-  ",
}
"""Heads of the printed table."""
