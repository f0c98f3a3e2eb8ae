"""``shaftline trial``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..performance.log_runs import find_runs
from ..performance.speed_trial import analyse_trial, load_trial_ship, read_runs
from ..performance.tables import read_table
from ..performance.trial_report import runs_table, save_trial
from .console import check_folder, print_table, report_errors, say

_HEADS = {
    "run": "run",
    "heading_deg": "heading deg",
    "speed_over_ground_kn": "SOG kn",
    "shaft_power_kW": "shaft kW",
    "wind_resistance_kN": "wind kN",
    "wave_resistance_kN": "waves kN",
    "water_resistance_kN": "water kN",
    "current_kn": "current kn",
    "corrected_speed_kn": "calm kn",
    "corrected_shaft_power_kW": "calm kW",
}
"""Columns of the printed table with their heads."""


def trial(
    runs: Annotated[
        Path,
        typer.Argument(
            help="Table of runs, one row each, in the order of time; or a log, see --from-log.",
            show_default=False,
        ),
    ],
    ship: Annotated[
        Path, typer.Option(help="TOML file with the particulars of the ship.", show_default=False)
    ],
    power: Annotated[
        list[float] | None,
        typer.Option(
            help="Shaft power [kW] at which the speed is wanted; repeatable.",
            show_default="75 % MCR",
        ),
    ] = None,
    speed: Annotated[
        list[float] | None,
        typer.Option(help="Speed [kn] at which the shaft power is wanted; repeatable."),
    ] = None,
    from_log: Annotated[
        float | None,
        typer.Option(
            min=1.0,
            help="RUNS is a log of the whole trial: find its steady stretches of at least this many "
            "minutes (ISO 15016: 10) and average each.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for tables, figure and report.")] = Path(
        "out/trial"
    ),
) -> None:
    """Correct a speed trial to calm, deep water by ISO 15016.

    The power that wind (coefficients of a wind tunnel, or by Fujiwara), waves (STAWAVE-2), temperature
    and density cost is taken from the measured power (direct power method). Shallow water is corrected
    by Lackenby, displacement by the Admiralty formula. Runs of one power on reciprocal courses give the
    current: by the iterative method with 8 or more runs at 3 or more powers and their times, else by the
    mean of means.

    RUNS has the columns `heading_deg`, `speed_over_ground_kn`, `shaft_power_kW`; where measured also
    `time`, `wind_speed_m/s` and `wind_angle_deg` (relative, 0 from ahead), `wave_height_m`,
    `wave_period_s`, `wave_angle_deg`, the same for `swell_`, `depth_m`, `water_temperature_C`,
    `water_density_kg/m3`. Short names and units in brackets are read too: `SOG [kn]`, `HDG (deg)`,
    `Power [MW]`.

    A log of the whole trial has the same columns, with a `time` and a row every two minutes or more
    often. `--from-log 10` finds the stretches of at least 10 minutes with steady heading, power and
    speed, averages each, and leaves out those without a run on the reciprocal course.

    The ship file has `name`, `mcr_kW`, the table `[hull]` (`length_m`, `beam_m`, `draught_m`,
    `displacement_m3`; `midship_coefficient`, `waterplane_coefficient` and, with `design_speed_kn`,
    `lcb_percent` are estimated where they are absent) and, for the wind,
    `[superstructure]` (`frontal_area_m2` with `angle_deg` and `coefficient`, or the areas and heights of
    the regression). A file of main particulars, as for `shaftline new-ship --from-particulars`, serves
    as well.

    Written: `runs.csv`, `curve.csv`, `report.json`, `speed-power.png`, and the curve as a
    `reference.toml` for `shaftline performance`.

    Examples:
        shaftline trial runs.csv --ship tanker.toml --out out/trial

        shaftline trial runs.csv --ship tanker.toml --power 18000 --speed 15.5

        shaftline trial log.csv --ship tanker.toml --from-log 10
    """
    with report_errors():
        check_folder(out)
        particulars = load_trial_ship(ship)
        powers = power or ([0.75 * particulars.mcr_kW] if particulars.mcr_kW else [])
        if from_log is None:
            table = read_runs(runs)
        else:
            found = find_runs(read_table(runs), str(runs), 60.0 * from_log)
            table = found.runs
            for number, text in enumerate(found.texts, 1):
                say(f"run {number}: {text}")
            for text in found.left_out:
                say(f"left out, no run on the reciprocal course at this power: {text}")
        result = analyse_trial(particulars, table)
        report = save_trial(result, out, powers, speed or [])
        shown = runs_table(result)[list(_HEADS)].rename(columns=_HEADS)
        print_table(shown, f"{particulars.name}, current by {result.method}", 2)
        for row in report["speed_at_power"]:
            say(
                f"{row['speed_kn']:.2f} kn{_interval(row['ci95_half_kn'], 'kn')} at "
                f"{row['shaft_power_kW']:.0f} kW{_mark(row['extrapolated'])}"
            )
        for row in report["power_at_speed"]:
            say(
                f"{row['shaft_power_kW']:.0f} kW{_interval(row['ci95_half_kW'], 'kW')} at "
                f"{row['speed_kn']:.2f} kn{_mark(row['extrapolated'])}"
            )
        for remark in result.remarks:
            say(f"note: {remark}")
        say(f"\nPicture: {out / 'speed-power.png'}   results: {out / 'report.json'}")
        if (out / "reference.toml").exists():
            say(
                f"Reference for later logs: shaftline performance LOG --ship {out / 'reference.toml'}"
            )


def _interval(half: float | None, unit: str) -> str:
    """Return half an interval as ``+- 0.1 kn``."""
    if half is None:
        return " (no interval: too few runs)"
    return f" +- {half:.2f} {unit} (95 %)" if unit == "kn" else f" +- {half:.0f} {unit} (95 %)"


def _mark(extrapolated: bool) -> str:
    return ", outside the speeds of the trial" if extrapolated else ""
