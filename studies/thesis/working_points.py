"""Table 2-1: the working points A to D, and the steady state of the load cases."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...plant import Ship, equilibrium, load_ship
from ..cells import Cell, Kind, half_digit
from ..side_by_side import Judged, compare, published, published_text
from .poles import models, sorted_numbers

TABLE = "advance_velocity_thesis_working_points"
COLUMNS = ["shaft_speed_rad_s", "ship_speed_m_s", "advance_velocity_m_s", "engine_torque_N_m"]


def working_points() -> pd.DataFrame:
    """Our steady states at the thesis's inputs; rows A, B, C, D and base."""
    frigate = load_ship("frigate")
    table = published("advance_velocity_thesis_working_points")
    rows = {}
    for point in table.index:
        inputs = table.loc[point]
        found = equilibrium(frigate, float(inputs["fuel_rack_mm"]), float(inputs["pitch_ratio"]))
        rows[point] = [
            found.state.shaft_speed,
            found.state.ship_speed,
            found.outputs.advance_velocity,
            found.outputs.brake_torque,
        ]
    return pd.DataFrame.from_dict(rows, orient="index", columns=COLUMNS)


def _judge(row: str, column: str, text: str) -> Judged:
    return Kind.FREE, half_digit(text), "half a unit of the last printed digit"


def cells(ours: pd.DataFrame) -> list[Cell]:
    """Return the cells of Table 2-1 for our steady states, from :func:`working_points`."""
    return compare("2-1", ours, published_text(TABLE), _judge)


SAID = """\
The pitch step differs by 0.3 points, which is what a coarse table of KQ in P/D may cost. Of the gain
from the inflow to the shaft speed section 2-7-3 says about 0 dB at 0.1 rad/s and about -20 dB at 4; what
stands under *printed* is worked out from the poles, zero and gain of its Table 2-12, so at 4 rad/s the
sentence speaks of the middle of a wide range."""


def _of_table(point: str, frequency: float) -> float:
    """Gain [dB] from the inflow to the shaft speed by the thesis's Table 2-12."""
    table = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    own = table[(table["table"] == "2-12") & (table["working_point_or_source"] == point)].iloc[0]
    s = 1j * frequency
    above = [1.0 - s / zero for zero in sorted_numbers(own["zeros_rad_s"])]
    below = [1.0 - s / pole for pole in sorted_numbers(own["poles_rad_s"])]
    return 20.0 * float(np.log10(abs(float(own["dc_gain"]) * np.prod(above) / np.prod(below))))


def said(ship: Ship) -> pd.DataFrame:
    """Numbers of the thesis's text, ours beside them.

    Args:
        ship: the frigate.
    """
    rows = []
    for what, before, after, printed in (
        ("rack 20 to 27.5 mm at P/D 1.4: shaft speed [%]", (20.0, 1.4), (27.5, 1.4), "24.62"),
        ("P/D 1.25 to 1.0 at 22 mm: shaft speed [%]", (22.0, 1.25), (22.0, 1.0), "23.23"),
    ):
        speeds = [equilibrium(ship, *point).state.shaft_speed for point in (before, after)]
        rows.append((what, 100.0 * (speeds[1] / speeds[0] - 1.0), printed))
    linear = models(ship)
    for frequency in (0.1, 4.0):
        for point in "AD":
            answer = abs(complex(linear[point]["shaft_speed", "inflow"](1j * frequency)))
            what = f"inflow to shaft speed at {frequency:g} rad/s, {point} [dB]"
            printed = f"{_of_table(point, frequency):.1f}"
            rows.append((what, 20.0 * float(np.log10(answer)), printed))
    return pd.DataFrame(rows, columns=["what", "ours", "printed"])
