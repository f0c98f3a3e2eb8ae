"""``shaftline tour``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import display
from ..core.files import write_atomically
from ..studies import tour as study
from ..studies.thesis.vaf import ROWS
from .console import check_folder, clear_errors, print_table, progress, say


def tour(
    out: Annotated[Path, typer.Option(help="Folder for pictures and tables.")] = Path("out/tour"),
    seed: Annotated[int, typer.Option(min=0, help="Of the sea and of the sensors' noise.")] = 0,
) -> None:
    """A first look: a frigate in a seaway, then a real drive train.

    Sails the frigate of van der Kroft's thesis through 300 s of head seas (significant height 2.9 m)
    and lets every observer estimate the advance velocity, the speed of the water through the
    propeller, which no ship can measure. Then simulates the model tug Tito Neri at the voltages at
    which it was measured and says where model and measurement differ most.
    """
    with clear_errors():
        check_folder(out)
        say(
            "A frigate sails 300 s of head seas; each observer estimates from shaft speed, torque and "
            "pitch how fast the water meets the propeller."
        )
        with progress("sailing (the first run compiles the kernels)", len(ROWS)) as tick:
            sea = study.sail_the_thesis_sea(seed, tick)
        print_table(sea.table, "1. The frigate in head seas: who sees the water's speed?")
        say(
            "VAF is the share of the advance velocity's variance that an estimate accounts for; 100 % "
            "is perfect. The noisy readings are those of good shipboard instruments."
        )
        say(f"{sea.sentence}\n")
        display.figures.save(sea.figure, out / "seaway.png")
        write_atomically(out / "seaway.csv", lambda f: sea.table.to_csv(f, index=False))

        train = study.meet_the_drive_train()
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
        display.figures.save(train.figure, out / "tito-neri.png")
        for name, frame in (("points", train.points), ("response", train.response)):
            write_atomically(
                out / f"tito-neri-{name}.csv",
                lambda f, frame=frame: frame.to_csv(f, index=False),  # type: ignore[misc]
            )
        say(
            f"\nPictures: {out / 'seaway.png'} and {out / 'tito-neri.png'}; the tables lie beside "
            "them as CSV."
        )
