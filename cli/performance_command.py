"""``shaftline performance``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..performance.monitoring import analyse_performance, load_reference_ship, read_log
from ..performance.monitoring_report import periods_table, save_performance
from .console import check_folder, print_table, report_errors, say


def performance(
    log: Annotated[
        Path,
        typer.Argument(
            help="Log of the ship: hours, noon reports or faster rows.", show_default=False
        ),
    ],
    ship: Annotated[
        Path,
        typer.Option(help="TOML file with the reference curve of the ship.", show_default=False),
    ],
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
    `speed_over_ground_kn`, `wind_speed_m/s` and `wind_angle_deg` (relative), `draught_m`, `depth_m`,
    `water_temperature_C`, `rudder_deg`. Short names and units in brackets are read too: `STW [kn]`.

    The ship file has `name`, `beam_m`, `draught_m`, the reference curve `speed_kn` and `power_kW`
    (lists) and, for the wind, the table `[air]` as in `shaftline trial`.

    Written: `periods.csv`, `daily.csv`, `report.json`, `speed-loss.png`.

    Examples:
        shaftline performance log.csv --ship reference.toml --out out/performance
    """
    with report_errors():
        check_folder(out)
        report = analyse_performance(load_reference_ship(ship), read_log(log))
        save_performance(report, out)
        table = periods_table(report).rename(columns=_HEADS)
        print_table(table, f"{report.ship.name}: speed loss by period", 2)
        left = {reason: count for reason, count in report.rejected.items() if count}
        reasons = "; ".join(f"{reason}: {count}" for reason, count in left.items())
        say(f"{len(report.rows)} rows used" + (f"; left out: {reasons}" if left else ""))
        for remark in report.remarks:
            say(f"note: {remark}")
        say(f"\nPicture: {out / 'speed-loss.png'}   results: {out / 'report.json'}")


_HEADS = {
    "speed_loss_percent": "loss %", "ci95_half": "+-", "trend_percent_per_year": "trend %/year",
    "trend_ci95_half": "+- ", "step_percent": "step %", "step_ci95_half": "+-  ",
}  # fmt: skip
"""Heads of the printed table."""
