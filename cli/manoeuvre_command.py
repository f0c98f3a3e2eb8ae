"""``shaftline manoeuvre``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import display
from ..core.files import check_writable, write_json
from ..display.tables import write_csv
from ..plant import approach, load_ship
from ..plant.manoeuvres import MANOEUVRES, Trials, criteria, trials
from .console import check_folder, clear_errors, print_table, progress, say


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
        float,
        typer.Option(help="Of a model: length of the ship over its own; L/V goes with its root."),
    ] = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for tracks, figures and numbers.")] = Path(
        "out/manoeuvre"
    ),
    json: Annotated[
        Path | None,
        typer.Option(help="File for the numbers; OUT/manoeuvres.json by default."),
    ] = None,
) -> None:
    """Sail a ship's standard manoeuvres, beside IMO's limits.

    Turning circles with the rudder hard over (35 degrees, or what the ship has), 10/10 and 20/20
    zig-zags, each to both sides, and a spiral, which shows whether the ship holds her course by herself.
    Each begins on a straight course at the given speed in calm water; the drive keeps its demand, so
    what the turn does to speed, shaft and propeller follows. The ship's file has a `[manoeuvring]`
    and a `[rudder]` section (`kvlcc2`, `esso-osaka` and `ddg-51-surrogate` do).

    The table holds IMO's criteria (MSC.137(76)): advance and tactical diameter, the way until the
    heading has changed by 10 degrees, overshoots. Limits of the overshoots go with the time in which
    the ship sails her own length; for a model give its `--scale`.

    Written: a CSV of each track (`turning-circle-port.csv`, `zig-zag-10-10-starboard.csv`, ...),
    `spiral.csv`, `criteria.csv`, `turning-circles.png`, `zig-zags.png`, `spiral.png`, and
    `manoeuvres.json` (for programs). A track is also a recording: `shaftline identify` and `diagnose`
    read it.

    Examples:
        shaftline manoeuvre --ship kvlcc2 --speed 1.18 --scale 45.7 --out out/kvlcc2

        shaftline manoeuvre --ship ddg-51-surrogate --speed 11.3
    """
    with clear_errors():
        check_folder(out)
        if json is not None:
            check_writable(json)
        vessel = load_ship(ship)
        if not 0.0 < scale < float("inf"):
            raise ValueError(f"--scale {scale:g} (unit -; allowed: > 0)")
        point = approach(vessel, speed, pitch)
        with progress("sailing (the first run compiles the kernels)", MANOEUVRES) as tick:
            sailed = trials(vessel, point, tick)
        table = criteria(sailed, scale)
        demand = vessel.prime_mover.demand
        print_table(
            table,
            f"{vessel.name} at {speed:g} m/s, {demand.symbol} = {point.inputs.drive:.6g} "
            f"{demand.unit}: IMO's criteria",
        )
        for sentence in _sentences(sailed):
            say(sentence)
        for name, track in sailed.tracks().items():
            write_csv(out, name, track, digits=10)
        write_csv(out, "criteria", table)
        for name, figure in display.manoeuvres.pictures(sailed).items():
            display.figures.save(figure, out / f"{name}.png")
        numbers = json or out / "manoeuvres.json"
        rows = table.astype(object).where(table.notna(), None).to_dict("records")
        write_json(numbers, sailed.numbers() | {"scale": scale, "criteria": rows})
        say(f"\nPictures and tracks: {out}   numbers: {numbers}")


def _sentences(sailed: Trials) -> list[str]:
    """What the table does not say."""
    told = []
    for side, turn in sailed.turns.items():
        told.append(
            f"- Turning to {side} she keeps {100.0 * turn.speed_ratio:.0f} % of her speed and "
            f"{100.0 * turn.shaft_speed_ratio:.0f} % of her revolutions, on a circle of "
            f"{turn.steady_diameter:.2f} L."
        )
    if sailed.spiral is not None:
        wide = abs(sailed.spiral.width_deg)
        holds = "holds her course by herself" if wide < 0.05 else "is unstable on her course"
        told.append(f"- By the spiral she {holds}: its loop is {wide:.2f} deg wide.")
    told += [f"- Not sailed, {name}: {why}" for name, why in sailed.not_sailed.items()]
    return told
