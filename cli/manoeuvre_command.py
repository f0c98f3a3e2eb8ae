"""``shaftline manoeuvre``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from .. import display
from ..core.files import check_writable, write_json
from ..display.tables import write_csv
from ..plant import approach, load_ship
from ..plant.manoeuvres import MANOEUVRES, Trials, criteria, trials
from ..plant.roll import LARGEST_ANGLE
from .console import check_folder, print_table, progress, report_errors, say
from .machine import to_json


def manoeuvre(
    ship: Annotated[
        str,
        typer.Option(
            help="Ship that turns: a preset (see `shaftline list`) or a .toml file.",
            show_default=False,
        ),
    ],
    speed: Annotated[
        float,
        typer.Option(help="Speed of the approach [m/s]; 1 kn is 0.5144 m/s.", show_default=False),
    ],
    pitch: Annotated[
        float | None,
        typer.Option(help="Pitch ratio P/D; the highest by default.", show_default=False),
    ] = None,
    scale: Annotated[
        float, typer.Option(help="For a model: length of the ship over that of the model.")
    ] = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for tracks, figures and results.")] = Path(
        "out/manoeuvre"
    ),
    json: Annotated[
        Path | None, typer.Option(help="File for the results; OUT/manoeuvres.json by default.")
    ] = None,
) -> None:
    """Simulate standard manoeuvres of a ship and compare them with IMO's limits.

    The manoeuvres are turning circles with the rudder hard over (35 degrees, or the largest angle of the
    ship), 10/10 and 20/20 zig-zags, each to both sides, and a spiral, which shows whether the ship is
    directionally stable. Each starts on a straight course at the given speed in calm water. The command
    of the drive stays constant, so the results include the loss of speed and the load of shaft and
    propeller. The ship file needs a `[manoeuvring]` and a `[rudder]` section (as those of `kvlcc2`,
    `esso-osaka` and `ddg-51-surrogate`).

    The table contains IMO's criteria (MSC.137(76)): advance and tactical diameter, distance until the
    heading has changed by 10 degrees, overshoot angles. The limits of the overshoot angles depend on the
    time in which the ship travels her own length; for a model give its `--scale`.

    With a `[roll]` section the table and a panel of the figure also contain the heel of the turning
    circles: the largest inward (as the rudder is put over) and outward, and that of the steady turn.

    Written: a CSV of each track (`turning-circle-port.csv`, `zig-zag-10-10-starboard.csv`, ...),
    `spiral.csv`, `criteria.csv`, `turning-circles.png`, `zig-zags.png`, `spiral.png`, and
    `manoeuvres.json` (for programs). A track is also a recording: `shaftline identify` and `diagnose`
    read it.

    Examples:
        shaftline manoeuvre --ship kvlcc2 --speed 1.18 --scale 45.7 --out out/kvlcc2

        shaftline manoeuvre --ship ddg-51-surrogate --speed 11.3
    """
    with report_errors():
        check_folder(out)
        if json is not None:
            check_writable(json)
        vessel = load_ship(ship)
        if not 0.0 < scale < float("inf"):
            raise ValueError(f"--scale {scale:g} (unit -; allowed: > 0)")
        point = approach(vessel, speed, pitch)
        with progress("simulating (the first run compiles the kernels)", MANOEUVRES) as tick:
            results = trials(vessel, point, tick)
        table = criteria(results, scale)
        demand = vessel.prime_mover.demand
        print_table(
            table,
            f"{vessel.name} at {speed:g} m/s, {demand.symbol} = {point.inputs.drive:.6g} "
            f"{demand.unit}: IMO's criteria",
        )
        for sentence in _sentences(results):
            say(sentence)
        for name, track in results.tracks().items():
            write_csv(out, name, track, digits=10)
        write_csv(out, "criteria", table)
        for name, figure in display.manoeuvres.trial_figures(results).items():
            display.figures.save(figure, out / f"{name}.png")
        file = json or out / "manoeuvres.json"
        rows = to_json(table.to_dict("records"))
        write_json(file, results.results() | {"scale": scale, "criteria": rows})
        say(f"\nPictures and tracks: {out}   results: {file}")


def _sentences(results: Trials) -> list[str]:
    """Return the results that the table does not contain, as sentences."""
    lines = [
        f"- In a turn to {side} the ship keeps {100.0 * turn.speed_ratio:.0f} % of the speed and "
        f"{100.0 * turn.shaft_speed_ratio:.0f} % of the shaft speed, with a steady diameter of "
        f"{turn.steady_diameter:.2f} L."
        for side, turn in results.turns.items()
    ]
    heels = [turn.heel for turn in results.turns.values() if turn.heel is not None]
    if any(max(heel.inward_rad, heel.outward_rad) > LARGEST_ANGLE for heel in heels):
        limit = math.degrees(LARGEST_ANGLE)
        lines.append(
            f"- The heel exceeds {limit:.0f} deg, up to which the righting lever is valid."
        )
    if results.spiral is not None:
        wide = abs(results.spiral.width_deg)
        holds = "directionally stable" if wide < 0.05 else "directionally unstable"
        lines.append(f"- The ship is {holds}: the loop of the spiral is {wide:.2f} deg wide.")
    lines += [f"- Not simulated, {name}: {why}" for name, why in results.not_completed.items()]
    return lines
