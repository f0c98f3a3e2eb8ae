"""``shaftline linearise``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from .. import display
from ..core.files import write_atomically, write_json
from ..core.lazy import control
from ..plant import Equilibrium, Ship, approach, equilibrium, linearise, load_ship
from .console import PresetShip, check_folder, check_pitch, print_table, report_errors, say
from .machine import to_json

_USUAL = "pitch_ratio,shaft_speed,ship_speed,shaft_torque"


def linearise_ship(
    ship: PresetShip = "frigate",
    speed: Annotated[
        float | None,
        typer.Option(help="Ship speed [m/s] of the working point.", show_default=False),
    ] = None,
    drive: Annotated[
        float | None,
        typer.Option(
            help="Command of the prime mover in its unit, in place of --speed (fuel rack [mm], voltage "
            "[V], torque [N m], shaft speed [rad/s]).",
            show_default=False,
        ),
    ] = None,
    pitch: Annotated[
        float | None, typer.Option(help="P/D [-].", show_default="highest P/D of the ship")
    ] = None,
    output: Annotated[
        str, typer.Option(help="Outputs, separated by commas: states or quantities such as thrust.")
    ] = _USUAL,
    out: Annotated[Path, typer.Option(help="Folder for the model and the figure.")] = Path(
        "out/linear"
    ),
) -> None:
    """Linearise a ship about a working point: state-space model, poles, zeros, Bode plot and margins.

    The model is x' = A x + B u, y = C x + D u in deviations from a steady state, in SI units. Its
    derivatives are those of the simulated equations, exact to rounding. Rate limits, dead bands and dead
    times are not included.

    The margins of a channel are those of the channel closed by a gain of 1 in its units (-1 if its
    steady gain is negative). `shaftline loop` gives the margins of a controller.

    Written: `linear.json` (point, A, B, C, D, names, units, poles), `linear.mat` (the same matrices for
    MATLAB or Octave: `ss(A,B,C,D)`) and `bode.png` (gain and phase of every channel).

    Examples:
        shaftline linearise --ship frigate --drive 22 --pitch 1.4

        shaftline linearise --ship my_ship.toml --speed 7 --output shaft_speed,thrust
    """
    with report_errors():
        check_folder(out)
        vessel = load_ship(ship)
        check_pitch(vessel, pitch)
        point = working_point(vessel, speed, drive, pitch)
        names = tuple(filter(None, (name.strip() for name in output.split(","))))
        if not names:
            raise ValueError(f"--output {output!r}: give at least one output, such as shaft_speed")
        system = linearise(vessel, point, outputs=names)
        about = _about(vessel, point)
        say(about)
        print_table(display.linear.modes(system), "modes", 4)
        channels = display.linear.channels(system, vessel)
        print_table(channels, "channels", 4)
        picture = display.linear.frequency_response(system, vessel, about)
        display.figures.save(picture, out / "bode.png")
        _write(out, about, system, channels)
        say(f"\nModel: {out / 'linear.json'}, {out / 'linear.mat'}   picture: {out / 'bode.png'}")


def working_point(
    ship: Ship, speed: float | None, drive: float | None, pitch: float | None
) -> Equilibrium:
    """Return the steady state at ``--speed`` or at ``--drive``, with ``--pitch``."""
    if (speed is None) == (drive is None):
        raise ValueError("give either --speed or --drive, but not both")
    if drive is None:
        assert speed is not None
        return approach(ship, speed, pitch)
    low, high = (float(ship.record()[f"drive_{end}"]) for end in ("min", "max"))
    if not low <= drive <= high:
        unit = ship.prime_mover.demand.unit
        raise ValueError(f"--drive {drive:g} {unit}: must be from {low:g} to {high:g} {unit}")
    return equilibrium(ship, drive, ship.propeller.pitch_ratio_max if pitch is None else pitch)


def _about(ship: Ship, point: Equilibrium) -> str:
    demand = ship.prime_mover.demand
    return (
        f"{ship.name} at {demand.symbol} = {point.inputs.drive:.4g} {demand.unit}, P/D = "
        f"{point.state.pitch_ratio:.4g}: {point.state.shaft_speed:.4g} rad/s, "
        f"{point.state.ship_speed:.4g} m/s"
    )


def _write(out: Path, about: str, system: control.StateSpace, channels: pd.DataFrame) -> None:
    from scipy.io import savemat

    matrices = {name: np.asarray(getattr(system, name)) for name in "ABCD"}
    names = {
        f"{kind}s": list(getattr(system, f"{kind}_labels")) for kind in ("state", "input", "output")
    }
    poles = [{"real": p.real, "imag": p.imag} for p in map(complex, system.poles())]
    plain = {key: value.tolist() for key, value in matrices.items()}
    rows = to_json(channels.to_dict("records"))
    found = {"about": about} | names | plain | {"poles": poles, "channels": rows}
    write_json(out / "linear.json", found)
    both = matrices | {key: np.array(value, dtype=object) for key, value in names.items()}
    write_atomically(out / "linear.mat", lambda file: savemat(str(file), both, appendmat=False))
