"""Compute the loop margins of every controller with a linear law; write ``loops.md``."""

from __future__ import annotations

from typing import Any

import pandas as pd

from shaftline import baselines
from shaftline.plant import ShipError, load_ship
from shaftline.plant.loops import Loop

from .pages import make_parser
from .writing import write_results

INTERVAL_S = 0.5
DRIVEN = (("frigate", (5.0, 8.0)), ("frigate-at-sea", (5.0, 8.0)))
"""Ships with speed controllers, and their speeds [m/s]."""

STEERED = (("ddg-51-surrogate", 11.318), ("esso-osaka", 3.6), ("kvlcc2", 1.179))
"""Ships with course controllers, and their speed [m/s]; the last is unstable on a straight course."""


def compute_margins() -> pd.DataFrame:
    """Return a row for each loop."""
    rows = []
    for name, speeds in DRIVEN:
        ship = load_ship(name)
        for text in baselines.controller_names():
            controller = baselines.make_controller(text, ship, INTERVAL_S)
            for speed in speeds:
                try:
                    loop = baselines.controller_loop(controller, speed)
                except ValueError as error:
                    if "cannot be linearised" not in str(error):
                        raise
                    continue
                rows.append(_row(name, speed, text, "drive", loop))
    for name, speed in STEERED:
        for text in baselines.helmsman_names():
            try:
                helmsman = baselines.make_helmsman(text, load_ship(name), INTERVAL_S, speed)
            except ShipError as error:
                if "stable on a straight course" not in str(error):
                    raise
                continue
            loop = baselines.helmsman_loop(helmsman)
            rows.append(_row(name, speed, text, "rudder_command", loop))
    return pd.DataFrame(rows)


def _row(ship: str, speed: float, controller: str, opened: str, loop: Loop) -> dict[str, Any]:
    margins, step = loop.margins(), loop.step_measures()
    return {
        "ship": ship,
        "speed [m/s]": speed,
        "controller": controller,
        "opened at": opened,
        "gain margin [dB]": margins.gain_margin_dB,
        "phase margin [deg]": margins.phase_margin_deg,
        "dead time [s]": margins.delay_margin,
        "largest |S|": margins.peak_sensitivity,
        "crossover [rad/s]": margins.crossover,
        "overshoot [%]": step.overshoot_percent,
        "settled after [s]": step.settling,
    }


def main() -> None:
    """Compute the margins, and write ``loops.md`` and its table."""
    folder = make_parser("loops", __doc__, "out/loops").parse_args().out
    table = compute_margins()
    write_results(__file__, folder, "Stability margins of the controllers", table, table=table)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
