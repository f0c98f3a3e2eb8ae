"""``shaftline simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from .. import display
from ..core.files import check_writable, write_atomically
from ..observers import follow_table, get_observer
from ..observers.following import add_noise_to_table
from ..plant import get_sea, load_ship, realise
from ..plant.columns import input_columns, signal_columns
from ..plant.load_cases import NOISE_SNR_DB, get_case
from ..plant.recording import read_recording
from ..plant.replay import simulate_recording
from .console import OwnHeight, OwnPeriod, PresetShip, read_own_sea, report_errors, say


def simulate(
    ship: PresetShip = "frigate",
    inputs: Annotated[
        Path | None, typer.Option(help="Recording (CSV) whose commands drive the ship open loop.")
    ] = None,
    columns: Annotated[
        Path | None, typer.Option(help="Column map of the recording, as for `shaftline diagnose`.")
    ] = None,
    case: Annotated[
        str | None, typer.Option(help="Load case in place of a recording (see `shaftline list`).")
    ] = None,
    sea: Annotated[
        str | None,
        typer.Option(
            help="Sea: a preset (see `shaftline list`), calm, or hs=3.2,tp=9.1 with optional gamma=, "
            "heading= and wind=.",
            show_default="that of the load case, or calm",
        ),
    ] = None,
    hs: OwnHeight = None,
    tp: OwnPeriod = None,
    observer: Annotated[
        str | None, typer.Option(help="Observer whose estimate is added to the table.")
    ] = None,
    tuning: Annotated[
        str | None, typer.Option(help="Tuning of the observer: low, moderate, high.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="CSV file for the simulated signals.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Picture of the run (.png).")] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the sea or the noise of the load case.")
    ] = 0,
) -> None:
    """Simulate a ship open loop, driven by a recording or by a load case.

    A recording needs the columns `time_s`, `fuel_rack_mm` (`motor_voltage_V` for a DC motor) and
    `pitch_ratio_command`. If it also has `pitch_ratio`, `shaft_speed_rad_s` (or `shaft_angle_rad`) and
    `ship_speed_m_s`, the simulation starts from their first row, otherwise from the steady state at the
    first commands.

    Written: a CSV with the columns of the recording and every simulated signal (true values,
    measurements, forces), and with `--figure` a picture. `--observer` adds two columns: the estimated
    advance velocity and whether it is valid.

    Examples:
        shaftline simulate --case jonswap --observer random-walk-kalman --figure run.png

        shaftline simulate --ship my_ship.toml --case jonswap --hs 2.5 --tp 8 --out run.csv

        shaftline simulate --ship frigate --inputs voyage.csv --out simulated.csv

        shaftline simulate --ship rig.toml --inputs log.csv --columns map.toml --out sim.csv
    """
    with report_errors():
        if (inputs is None) == (case is None):
            raise ValueError("give either --inputs RECORDING.csv or --case NAME")
        if columns is not None and inputs is None:
            raise ValueError("--columns needs --inputs RECORDING")
        if out is None and figure is None:
            raise ValueError("nothing to write: give --out FILE.csv, --figure FILE.png or both")
        for file in filter(None, (out, figure)):
            check_writable(file)
        if figure is not None:
            display.figures.check_picture(figure)
        if own := read_own_sea(hs, tp):
            if sea is not None:
                raise ValueError("give either --sea or --hs and --tp")
            (sea,) = own
        vessel = load_ship(ship)
        if tuning is not None and observer is None:
            raise ValueError("--tuning needs --observer NAME")
        watcher = get_observer(observer, tuning) if observer else None
        if case is not None:
            samples = get_case(case).run(vessel, seed=seed, sea=sea)
            table = pd.DataFrame({c: samples[s] for c, s in signal_columns(vessel).items()})
            if get_case(case).noisy:
                table = add_noise_to_table(table, NOISE_SNR_DB, seed)
            title = f"{vessel.name}: {get_case(case).description}"
        else:
            assert inputs is not None
            waves = get_sea(sea or "calm")
            realised = realise(waves, vessel.propeller.depth_m, seed) if waves else None
            if columns is not None:
                # The import is slow and only needed for a column map.
                from ..mismatch import load_recording

                recording = load_recording(inputs, vessel, columns).table
            else:
                recording = read_recording(
                    inputs, [*input_columns(vessel), *vessel.external_signals], vessel.signals
                )
            table = simulate_recording(vessel, recording, realised, every_signal=True)
            title = f"{vessel.name} driven by {inputs.name}"
        if watcher is not None:
            table = follow_table(watcher, vessel, table)
        if out is not None:
            write_atomically(out, lambda f: table.to_csv(f, index=False, float_format="%.10g"))
            say(f"{len(table)} rows written to {out}")
        if figure is not None:
            display.figures.save(display.figures.signals_figure(table, title), figure)
            say(f"picture: {figure}")
