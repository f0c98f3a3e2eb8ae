"""``shaftline loop``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from .. import display
from ..baselines import ControllerError, helmsman_names, make_controller, make_helmsman
from ..baselines.controller import Controller
from ..baselines.helmsman import ShapedHelmsman
from ..baselines.loops import controller_loop, helmsman_loop, readable
from ..core.files import check_writable, write_json
from ..core.lazy import control
from ..plant import Ship, approach, load_ship
from ..plant.loops import Loop
from .console import check_folder, check_pitch, clear_errors, print_table, say

_UNITS = {
    "gain_margin_dB": ("gain margin", "dB"),
    "gain_margin_down_dB": ("gain margin downwards", "dB"),
    "phase_margin_deg": ("phase margin", "deg"),
    "delay_margin": ("dead time that takes it away", "s"),
    "crossover": ("crossover, |L| = 1", "rad/s"),
    "phase_crossover": ("where L turns by 180 deg", "rad/s"),
    "peak_sensitivity": ("largest |S|", "-"),
    "peak_complementary": ("largest |T|", "-"),
    "overshoot_percent": ("overshoot of a step of the order", "%"),
    "settling": ("within 2 % after", "s"),
    "rise": ("from 10 to 90 % in", "s"),
    "peak": ("highest after", "s"),
    "last_value": ("comes to rest at", "-"),
}


def loop(
    controller: Annotated[
        str,
        typer.Argument(
            help="A controller, `NAME` or `NAME:option=number,...` (see `shaftline list`), or a law of "
            "your own, `numerator/denominator` by falling powers of s.",
            show_default=False,
        ),
    ],
    ship: Annotated[
        str, typer.Option(help="Ship: a preset (see `shaftline list`) or a .toml file.")
    ] = "frigate",
    speed: Annotated[float, typer.Option(help="Ship speed [m/s] about which all is linear.")] = 8.0,
    interval: Annotated[
        float, typer.Option(help="Control interval [s]; a law of your own acts all the time.")
    ] = 0.5,
    command: Annotated[
        str,
        typer.Option(
            help="Command at which the loop is opened: drive, pitch_command, rudder_command."
        ),
    ] = "drive",
    reading: Annotated[
        str | None,
        typer.Option(
            help="What a law of your own is to hold, such as ship_speed.",
            show_default="shaft_speed",
        ),
    ] = None,
    pitch: Annotated[
        float | None,
        typer.Option(help="P/D at which a law of your own is looked at; the highest by default."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for figure and numbers.")] = Path("out/loop"),
    json: Annotated[
        Path | None, typer.Option(help="File for the numbers; OUT/loop.json by default.")
    ] = None,
) -> None:
    """Tell how far a control loop stands from instability, and how fast it is.

    The ship is linearised about a steady course, the controller about what it does there
    (differentiated as it stands), and the loop is opened at one command; other commands stay under
    control. A controller that acts at intervals is seen as it acts: commands are held in between,
    readings are those just before. Helmsmen (`autopilot`, `track-keeper`) hold heading or track of a
    ship that turns.

    Linear means small: limits, rates, dead bands and dead times of the ship are not in it.

    Written: `loop.png` (gain, phase, S, T, a step of the order) and `loop.json`.

    Examples:
        shaftline loop combinator --ship frigate-at-sea --speed 8

        shaftline loop autopilot --ship ddg-51-surrogate --speed 11.3

        shaftline loop "3,0.4/1,0" --command drive --reading shaft_speed --speed 7
    """
    with clear_errors():
        check_folder(out)
        if json is not None:
            check_writable(json)
        if not 0.0 < interval <= 60.0:
            raise ValueError(f"--interval {interval:g} s: must be above 0 and at most 60")
        vessel = load_ship(ship)
        check_pitch(vessel, pitch)
        found, about = _loop(controller, vessel, speed, interval, command, reading, pitch)
        if not found.stable:
            raise ValueError(
                f"{about}: the closed loop is unstable, its fastest growing pole is {_worst(found)}"
            )
        numbers = found.margins()._asdict() | found.step_measures()._asdict()
        rows = [(*_UNITS[key], value) for key, value in numbers.items()]
        print_table(pd.DataFrame(rows, columns=["measure", "unit", "value"]), about, 4)
        display.figures.save(display.loops.loop_figure(found, about), out / "loop.png")
        plain = {key: value if np.isfinite(value) else None for key, value in numbers.items()}
        target = json or out / "loop.json"
        write_json(target, {"loop": about} | plain)
        say(f"\nPicture: {out / 'loop.png'}   numbers: {target}")


def _loop(
    text: str, ship: Ship, speed: float, interval: float, command: str, reading: str | None,
    pitch: float | None,
) -> tuple[Loop, str]:  # fmt: skip
    """The loop, and what it is, in words."""
    name = text.partition(":")[0]
    if "/" not in name and (reading is not None or pitch is not None):
        raise ValueError(
            f"--reading and --pitch are of a law of your own, such as 3,0.4/1,0; {name} has its own"
        )
    if "/" in name:
        reading = reading or "shaft_speed"
        law = _law(text)
        point = approach(ship, speed, pitch)
        plant = readable(ship, point)
        for known, wanted, kind in (
            (plant.input_labels, command, "--command"), (plant.output_labels, reading, "--reading"),
        ):  # fmt: skip
            if wanted not in known:
                raise ValueError(f"{kind} {wanted}: known are {', '.join(known)}")
        own = f"{text} from {reading} to {command} of {ship.name} at {speed:g} m/s"
        return Loop.of(plant[reading, command], law), own
    if name in helmsman_names():
        helmsman = make_helmsman(text, ship, interval, speed)
        held: ShapedHelmsman = helmsman
        return helmsman_loop(held), f"{text} on {ship.name} at {speed:g} m/s, every {interval:g} s"
    try:
        made = make_controller(text, ship, interval)
    except ControllerError as error:
        helmsmen = ", ".join(helmsman_names())
        raise ValueError(f"{error}; a helmsman ({helmsmen}); or a law such as 3,0.4/1,0") from None
    if not isinstance(made, Controller):
        raise ValueError(
            f"{name}: a loop is looked at where a controller tells its memory (`fresh`) and its law "
            "(`act`); derive the class from shaftline.baselines.Controller"
        )
    what = f"{text} on {ship.name} at {speed:g} m/s, every {interval:g} s, opened at {command}"
    return controller_loop(made, speed, command), what


def _law(text: str) -> control.TransferFunction:
    """A transfer function of ``numerator/denominator``."""
    try:
        numerator, denominator = (
            [float(part) for part in side.split(",")] for side in text.split("/")
        )
        if not np.isfinite([*numerator, *denominator]).all():
            raise ValueError
        law = control.tf(numerator, denominator)
    except (ValueError, TypeError):
        raise ValueError(
            f"law {text!r}: must be numerator/denominator, each numbers by falling powers of s, such as "
            "3,0.4/1,0 for 3 + 0.4/s"
        ) from None
    if len(numerator) > len(denominator):
        raise ValueError(f"law {text!r}: differentiates; the denominator must be as long")
    return law


def _worst(found: Loop) -> str:
    poles = control.feedback(found.open_loop, 1).poles()
    if found.interval:
        poles = np.log(poles.astype(complex)) / found.interval
    worst = poles[np.argmax(poles.real)]
    return f"{worst.real:.3g}{worst.imag:+.3g}j rad/s"
