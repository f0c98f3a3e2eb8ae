"""``shaftline tour``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.files import write_atomically
from ..display.figures import save
from .console import check_folder, clear_errors, print_table, progress, say
from .tour import OBSERVERS, simulate_drive_train, simulate_seaway


def tour(
    out: Annotated[Path, typer.Option(help="Folder for pictures and tables.")] = Path("out/tour"),
    seed: Annotated[int, typer.Option(min=0, help="Of the sea and of the sensors' noise.")] = 0,
) -> None:
    """A first look: a frigate in a seaway, then a real drive train.

    First, simulates the frigate of van der Kroft's thesis for 300 s in head seas (significant wave
    height 2.9 m). Every observer estimates the advance velocity: the speed of the water through the
    propeller, which no ship can measure. Then simulates the model tug Tito Neri at the motor voltages
    of its published measurements, and reports where model and measurement differ most.
    """
    with clear_errors():
        check_folder(out)
        say(
            "A frigate is simulated for 300 s in head seas. Each observer estimates, from shaft speed, "
            "shaft torque and pitch, how fast the water flows into the propeller."
        )
        with progress("simulating (the first run compiles the kernels)", len(OBSERVERS)) as tick:
            sea = simulate_seaway(seed, tick)
        print_table(sea.table, "1. The frigate in head seas: accuracy of each observer")
        say(
            "VAF is the share of the advance velocity's variance for which an estimate accounts: 100 % "
            "is perfect. The noise is that of good shipboard instruments."
        )
        say(f"{sea.sentence}\n")
        save(sea.figure, out / "seaway.png")
        write_atomically(out / "seaway.csv", lambda f: sea.table.to_csv(f, index=False))

        train = simulate_drive_train()
        for model, points in train.points.groupby("model", sort=False):
            shown = points[
                ["voltage_V", "motor_speed_rad_s_measured", "motor_speed_rad_s",
                 "speed_error_percent", "motor_current_A_measured", "motor_current_A",
                 "current_error_percent"]
            ].set_axis(
                ["U [V]", "speed measured [rad/s]", "simulated", "error [%]",
                 "current measured [A]", "simulated ", "error [%] "], axis=1,
            )  # fmt: skip
            print_table(shown, f"2. Real measurements of a drive train, against {model}")
        print_table(
            train.gains,
            "3. Its measured frequency response about 5.89 V: gains, measured and simulated",
        )
        for sentence in train.sentences:
            say(f"- {sentence}")
        save(train.figure, out / "tito-neri.png")
        for name, frame in (("points", train.points), ("response", train.response)):
            write_atomically(
                out / f"tito-neri-{name}.csv",
                lambda f, frame=frame: frame.to_csv(f, index=False),  # type: ignore[misc]
            )
        say(
            f"\nPictures: {out / 'seaway.png'} and {out / 'tito-neri.png'}; the tables lie beside "
            "them as CSV."
        )
