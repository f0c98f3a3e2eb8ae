"""``shaftline export``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from ..agents.policy.c_source import c_source
from ..agents.policy.fmu import export_policy
from ..agents.policy.policy import load_policy
from ..core.files import check_writable, write_text
from ..fmi.description import OUTPUT
from ..fmi.ship import export_ship
from ..plant import get_sea, load_ship, realise
from .console import PresetShip, check_pitch, print_table, report_errors, say
from .linearise_command import working_point

_SHIP = "fmu"
_SHOWN = ("name", "causality", "unit", "start", "description")
_USUAL = 0.6  # share of the highest drive command without --drive and --speed


def export(
    model: Annotated[
        str, typer.Argument(
            help="A policy (a name of the package or a file), or `fmu` for the ship of --ship.",
            show_default=False)
    ],
    out: Annotated[Path, typer.Option(
        help="File to write, ending in .fmu, or in .c for a policy.", show_default=False)],
    ship: PresetShip = "frigate",
    speed: Annotated[float | None, typer.Option(
        help="Ship speed [m/s] of the steady state at the start.", show_default=False)] = None,
    drive: Annotated[float | None, typer.Option(
        help="Command of the prime mover in its unit, in place of --speed.",
        show_default="60 % of the highest")] = None,
    pitch: Annotated[float | None, typer.Option(
        help="P/D [-] at the start.", show_default="highest P/D of the ship")] = None,
    step: Annotated[float | None, typer.Option(
        help="Time step [s]; communication steps are whole multiples of it.",
        show_default="that of the ship file")] = None,
    sea: Annotated[str, typer.Option(
        help="Sea in the FMU: a preset (see `shaftline list`), calm, or hs=3.2,tp=9.1 with optional "
        "gamma=, heading= and wind=.")] = "calm",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the sea.")] = 0,
) -> None:  # fmt: skip
    """Write a ship as an FMU for co-simulation, or a policy as an FMU or one C99 file.

    **Ship.** `shaftline export fmu` writes an FMU of FMI 2.0 that computes what `shaftline simulate`
    computes, for Simulink, the Open Simulation Platform and other tools. It runs without Python on the
    platform on which it was exported. Inputs are the commands and disturbances, outputs are the signals
    of the ship, parameters are the initial speeds and pitch. The options below `--out` concern ships.

    **Policy.** The C file needs no library but `math.h` and computes in double precision. It contains
    the scaling of the measurements, the memory of stacked observations and the network. The comment at
    its top names the measurements in their order and units, and what the actions mean. The functions
    are `NAME_reset` and `NAME_step`; NAME is the name of the file. The FMU contains this file as source
    and compiled.

    An FMU needs a C compiler here: `cc`, `gcc`, `clang`, or the one named by the variable CC.

    Written: the file.

    Examples:
        shaftline export fmu --ship frigate --speed 8 --out frigate.fmu

        shaftline export storm --out storm.c
    """
    with report_errors():
        check_writable(out)
        if model == _SHIP:
            vessel = load_ship(ship)
            if step is not None:
                vessel = vessel.with_values({"integration.time_step_s": step})
            check_pitch(vessel, pitch)
            if speed is None and drive is None:
                drive = _USUAL * float(vessel.record()["drive_max"])
            point = working_point(vessel, speed, drive, pitch)
            waves = get_sea(sea)
            realised = realise(waves, vessel.propeller.depth_m, seed) if waves else None
            variables = export_ship(vessel, point, out, realised)
            say(f"FMU of {vessel.name} with a time step of {vessel.time_step_s:g} s: {out}")
            table = pd.DataFrame(variables)[list(_SHOWN)]
            table.loc[table["causality"] == OUTPUT, "start"] = math.nan
            print_table(table, "variables", 4)
            return
        given = [
            option
            for option, value in {
                "--speed": speed,
                "--drive": drive,
                "--pitch": pitch,
                "--step": step,
            }.items()
            if value is not None
        ]
        if given:
            raise ValueError(f"{given[0]} is an option of `shaftline export fmu`, not of a policy")
        policy = load_policy(model)
        if out.suffix == ".fmu":
            export_policy(policy, out)
            say(f"FMU: {out}")
        elif out.suffix == ".c":
            write_text(out, c_source(policy, out.stem.replace("-", "_")))
            say(f"C source: {out}")
        else:
            raise ValueError(f"--out {out}: the name must end in .c or .fmu")
