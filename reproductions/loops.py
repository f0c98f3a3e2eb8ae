"""Margins of every controller that has a linear law, on its ships: ``docs/results/loops.md``."""

from __future__ import annotations

import argparse
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
from shaftline.display.tables import markdown, write_table
from shaftline.plant import load_ship
from shaftline.plant.loops import Loop

INTERVAL_S = 0.5
DRIVEN = (("frigate", (5.0, 8.0)), ("frigate-at-sea", (5.0, 8.0)))
"""Ships with the speeds [m/s] at which their speed controllers are looked at."""

STEERED = (("ddg-51-surrogate", 11.318), ("esso-osaka", 3.6))
"""Ships that hold their course, each with a speed [m/s]."""

TITLE = "Margins of the loops"

WHY = """\
Each loop is opened at the command named, with the other commands under control, at a control interval
of 0.5 s; what the holding of the command costs is in the numbers. The combinator's loop at the rack is
its governor's. `dead time` is what takes the phase margin away. Small signals only: rate limits, end
stops and dead bands are left out. So is the pilot's integral that waits while the error exceeds 0.5
m/s: the overshoots here are those of smaller steps.

Not here: `anti-spin` and `no-anti-spin`, whose memories hold more than numbers (they switch). The
benchmark tanker `kvlcc2` has no loop of this kind: she does not hold her course, so that C = L / P
would cancel an unstable pole; the command says so."""


def measured() -> pd.DataFrame:
    """A row a loop."""
    rows = []
    for name, speeds in DRIVEN:
        ship = load_ship(name)
        for text in controller_names():
            controller = make_controller(text, ship, INTERVAL_S)
            for speed in speeds:
                try:
                    loop = controller_loop(controller, speed)
                except ValueError as error:
                    if "more than numbers" not in str(error):
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
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/loops"))
    folder = parser.parse_args().out
    table = measured()
    command = "python -m reproductions loops"
    write_table(folder, "loops", TITLE, command, table, f"{WHY}\n\n{markdown(table, 2)}")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
