"""``shaftline loop``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from .. import display
from ..baselines import ControllerError, helmsman_names, make_controller, make_helmsman
from ..baselines.controller import Controller
from ..baselines.loops import helmsman_loop, linear_plant, loop_at_rest, settle_controller
from ..core.files import check_writable, write_json
from ..core.lazy import control
from ..plant import Ship, approach, load_ship
from ..plant.columns import drive_column
from ..plant.loops import Loop
from ..plant.order_tables import with_combinator_table
from .console import PresetShip, check_folder, check_pitch, print_table, report_errors, say
from .machine import to_json

_UNITS = {
    "gain_margin_dB": ("gain margin", "dB"),
    "gain_margin_down_dB": ("gain margin downwards", "dB"),
    "phase_margin_deg": ("phase margin", "deg"),
    "delay_margin": ("dead time at the stability limit", "s"),
    "crossover": ("crossover, |L| = 1", "rad/s"),
    "phase_crossover": ("frequency at a phase of -180 deg", "rad/s"),
    "peak_sensitivity": ("largest |S|", "-"),
    "peak_complementary": ("largest |T|", "-"),
    "overshoot_percent": ("overshoot of the step response", "%"),
    "settling": ("settling time to 2 %", "s"),
    "rise": ("rise time from 10 to 90 %", "s"),
    "peak": ("time of the peak", "s"),
    "last_value": ("final value", "-"),
}


def loop(
    controller: Annotated[str, typer.Argument(
        help="Controller: `NAME` or `NAME:option=number,...` (see `shaftline list`), or a transfer "
        "function `numerator/denominator` with falling powers of s.", show_default=False)],
    ship: PresetShip = "frigate",
    speed: Annotated[float, typer.Option(help="Ship speed [m/s] of the working point.")] = 8.0,
    interval: Annotated[float, typer.Option(
        help="Control interval [s]; a transfer function is continuous.")] = 0.5,
    lever: Annotated[Path | None, typer.Option(
        help="Combinator table (.toml or .csv) that the controller follows.",
        show_default="that of the ship")] = None,
    command: Annotated[str, typer.Option(
        help="Command at which the loop is opened: drive, pitch_command, rudder_command.")] = "drive",
    output: Annotated[str | None, typer.Option(
        help="Controlled output of a transfer function, such as ship_speed.",
        show_default="shaft_speed")] = None,
    pitch: Annotated[float | None, typer.Option(
        help="P/D for a transfer function; the highest by default.")] = None,
    out: Annotated[Path, typer.Option(
        help="Folder for the figure and the results.")] = Path("out/loop"),
    json: Annotated[Path | None, typer.Option(
        help="File for the results; OUT/loop.json by default.")] = None,
) -> None:  # fmt: skip
    """Compute stability margins and step response of a control loop.

    The ship is linearised about a steady course, the controller about its commands there, and the loop
    is opened at one command; the other commands stay under control. A controller that acts at intervals
    is analysed in discrete time: commands are held in between, and measurements are those just before.
    Helmsmen (`autopilot`, `lqg-autopilot`, `track-keeper`) control the heading or track of a ship that
    turns.

    The analysis is linear: limits, rates, dead bands and dead times of the ship are not included.

    Written: `loop.png` (gain, phase, S, T, step response) and `loop.json`.

    Examples:
        shaftline loop combinator --ship frigate-at-sea --speed 8

        shaftline loop autopilot --ship ddg-51-surrogate --speed 11.3

        shaftline loop "3,0.4/1,0" --command drive --output shaft_speed --speed 7
    """
    with report_errors():
        check_folder(out)
        if json is not None:
            check_writable(json)
        if not 0.0 < interval <= 60.0:
            raise ValueError(f"--interval {interval:g} s: must be above 0 and at most 60")
        vessel = load_ship(ship)
        if lever is not None:
            vessel = with_combinator_table(vessel, lever)
        check_pitch(vessel, pitch)
        found, about = _loop(controller, vessel, speed, interval, command, output, pitch)
        if not found.stable:
            worst = found.fastest_pole
            raise ValueError(
                f"{about}: the closed loop is unstable, its fastest growing pole is "
                f"{worst.real:.3g}{worst.imag:+.3g}j rad/s; {lacking_text(found)}"
            )
        numbers = found.margins()._asdict() | found.step_measures()._asdict()
        rows = [(*_UNITS[key], value) for key, value in numbers.items()]
        print_table(pd.DataFrame(rows, columns=["measure", "unit", "value"]), about, 4)
        display.figures.save(display.loops.loop_figure(found, about), out / "loop.png")
        target = json or out / "loop.json"
        write_json(target, to_json({"loop": about} | numbers))
        say(f"\nPicture: {out / 'loop.png'}   results: {target}")


def _loop(
    text: str,
    ship: Ship,
    speed: float,
    interval: float,
    command: str,
    output: str | None,
    pitch: float | None,
) -> tuple[Loop, str]:
    """Return the loop and its description."""
    name = text.partition(":")[0]
    what = f"{text} on {ship.name} at {speed:g} m/s, every {interval:g} s"
    if "/" not in name and (output is not None or pitch is not None):
        raise ValueError(
            f"--output and --pitch are for a transfer function such as 3,0.4/1,0 only, not for {name}"
        )
    if "/" in name:
        output = output or "shaft_speed"
        transfer = _transfer_function(text)
        plant = linear_plant(ship, approach(ship, speed, pitch))
        for known, wanted, kind in (
            (plant.input_labels, command, "--command"),
            (plant.output_labels, output, "--output"),
        ):
            if wanted not in known:
                raise ValueError(f"{kind} {wanted}: must be one of {', '.join(known)}")
        own = f"{text} from {output} to {command} of {ship.name} at {speed:g} m/s"
        return Loop.from_plant(plant[output, command], transfer), own
    if name in helmsman_names():
        return helmsman_loop(make_helmsman(text, ship, interval, speed)), what
    try:
        made = make_controller(text, ship, interval)
    except ControllerError as error:
        helmsmen = ", ".join(helmsman_names())
        raise ValueError(
            f"{error}; a helmsman ({helmsmen}); or a transfer function such as 3,0.4/1,0"
        ) from None
    if not isinstance(made, Controller):
        raise ValueError(
            f"{name}: the analysis needs the methods initial_state and act; derive the class from "
            "shaftline.baselines.Controller"
        )
    rest = settle_controller(made, speed)
    state, inputs = rest.point.state, rest.point.inputs
    at = (
        f"{state.shaft_speed * 30.0 / math.pi:.1f} rpm, P/D {state.pitch_ratio:.3f}, "
        f"{drive_column(ship)} {inputs.drive:.4g}"
    )
    about = f"{what}, opened at {command}; working point {at}; the step is one of the ordered ship speed"
    return loop_at_rest(made, rest, command), about


def _transfer_function(text: str) -> control.TransferFunction:
    """Return the transfer function of ``numerator/denominator``."""
    try:
        numerator, denominator = (
            [float(part) for part in side.split(",")] for side in text.split("/")
        )
        if not np.isfinite([*numerator, *denominator]).all():
            raise ValueError
        transfer = control.tf(numerator, denominator)
    except (ValueError, TypeError):
        raise ValueError(
            f"transfer function {text!r}: must be numerator/denominator with falling powers of s, such "
            "as 3,0.4/1,0 for 3 + 0.4/s"
        ) from None
    if len(numerator) > len(denominator):
        raise ValueError(
            f"transfer function {text!r}: the numerator must not be longer than the denominator"
        )
    return transfer


def lacking_text(found: Loop) -> str:
    """Return the margins of an unstable loop as text."""
    gain, phase = found.lacking_margins()
    words = f"gain margin {gain:.1f} dB" if np.isfinite(gain) else "no smaller gain makes it stable"
    return words + (f", phase margin {phase:.1f} deg" if np.isfinite(phase) else "")
