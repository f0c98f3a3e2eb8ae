"""Table 2-1: the working points A to D, and the steady state of the load cases."""

from __future__ import annotations

import pandas as pd

from ...plant import equilibrium, load_ship
from ..side_by_side import compare, published

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


def compared() -> pd.DataFrame:
    """Ours beside the thesis's."""
    theirs = published("advance_velocity_thesis_working_points")
    reason = (
        "the thesis prints three digits of the inputs and takes KT and KQ from a coarse table, whose "
        "edge is P/D 0.6"
    )
    return compare(
        working_points(), theirs, {("*", "*"): reason}, lambda row, column, value: 0.005 * value
    )
