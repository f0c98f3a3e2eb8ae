"""Compute the loop margins of every controller with a linear law; write ``loops.md``."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from shaftline.baselines import (
    controller_loop,
    controller_names,
    helmsman_loop,
    helmsman_names,
    make_controller,
    make_helmsman,
)
from shaftline.display.tables import write_table
from shaftline.plant import load_ship
from shaftline.plant.loops import Loop

from .pages import fill_template, make_parser

INTERVAL_S = 0.5
DRIVEN = (("frigate", (5.0, 8.0)), ("frigate-at-sea", (5.0, 8.0)))
"""Ships with speed controllers, and their speeds [m/s]."""

STEERED = (("ddg-51-surrogate", 11.318), ("esso-osaka", 3.6))
"""Ships with course controllers, and their speed [m/s]."""

TITLE = "Stability margins of the controllers"


def compute_margins() -> pd.DataFrame:
    """Return a row for each loop."""
    rows = []
    for name, speeds in DRIVEN:
        ship = load_ship(name)
        for text in controller_names():
            controller = make_controller(text, ship, INTERVAL_S)
            for speed in speeds:
                try:
                    loop = controller_loop(controller, speed)
                except ValueError as error:
                    if "cannot be linearised" not in str(error):
                        raise
                    continue
                rows.append((name, speed, text, "drive", *_numbers(loop)))
    for name, speed in STEERED:
        for text in helmsman_names():
            loop = helmsman_loop(make_helmsman(text, load_ship(name), INTERVAL_S, speed))
            rows.append((name, speed, text, "rudder_command", *_numbers(loop)))
    return pd.DataFrame(
        rows,
        columns=[
            "ship", "speed [m/s]", "controller", "opened at", "gain margin [dB]", "phase margin [deg]",
            "dead time [s]", "largest |S|", "crossover [rad/s]", "overshoot [%]", "settled after [s]",
        ],
    )  # fmt: skip


def _numbers(loop: Loop) -> tuple[float, ...]:
    margins, step = loop.margins(), loop.step_measures()
    return (
        margins.gain_margin_dB, margins.phase_margin_deg, margins.delay_margin,
        margins.peak_sensitivity, margins.crossover, step.overshoot_percent, step.settling,
    )  # fmt: skip


def main() -> None:
    """Compute the margins, and write ``loops.md`` and its table."""
    folder = make_parser("loops", __doc__, "out/loops").parse_args().out
    table = compute_margins()
    body = fill_template(Path(__file__).with_name("loops.md"), table=table)
    write_table(folder, "loops", TITLE, "python -m reproductions loops", table, body)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
