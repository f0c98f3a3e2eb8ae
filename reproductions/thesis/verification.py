"""Tables 2-15 to 2-23 and Figure 2-6: the thesis's model against Vrijdag & Stapersma 2017.

The thesis does not print the mid-range working point at which it compares the two. Two of its gains,
from the fuel rack to shaft and ship speed (Tables 2-18 and 2-19), determine the point; the other
printed numbers then judge it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import scipy

from shaftline.core.lazy import control
from shaftline.plant import Equilibrium, Ship, equilibrium, linearise

from ..side_by_side import published
from .poles import reduced, sorted_numbers

TABLES = {
    "2-16": ("shaft_speed", "pitch_command"),
    "2-17": ("ship_speed", "pitch_command"),
    "2-18": ("shaft_speed", "drive"),
    "2-19": ("ship_speed", "drive"),
    "2-20": ("shaft_speed", "resistance_factor"),
    "2-21": ("ship_speed", "resistance_factor"),
    "2-22": ("shaft_speed", "inflow"),
    "2-23": ("ship_speed", "inflow"),
}
SOURCES = ("This thesis", "Vrijdag paper")


def _printed(table: str, source: str) -> Any:
    lines = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    return lines[(lines["table"] == table) & (lines["working_point_or_source"] == source)].iloc[0]


def mid_range_point(ship: Ship) -> Equilibrium:
    """The working point at which our gains from the rack equal the thesis's."""
    wanted = [float(_printed(table, SOURCES[0])["dc_gain"]) for table in ("2-18", "2-19")]

    def difference(inputs: Any) -> list[float]:
        model = linearise(ship, equilibrium(ship, float(inputs[0]), float(inputs[1])))
        gains = [float(np.real(model[o, "drive"].dcgain())) for o in ("shaft_speed", "ship_speed")]
        return [ours - theirs for ours, theirs in zip(gains, wanted, strict=True)]

    rack, pitch = scipy.optimize.root(difference, [22.0, 1.2]).x
    return equilibrium(ship, float(rack), float(pitch))


def mid_range(ship: Ship) -> pd.DataFrame:
    """Our poles, zeros and gains at that point beside both printed models'."""
    model = linearise(ship, mid_range_point(ship))
    rows = []
    for table, (output, source) in TABLES.items():
        poles, zeros, gain = reduced(model[output, source])
        row = {"table": table, "transfer": f"{output} / {source}"}
        for name, values in (("poles", poles), ("zeros", zeros), ("gain", [gain])):
            row[name] = ", ".join(f"{value:.4f}" for value in values) or "–"
            for who in SOURCES:
                key = {"poles": "poles_rad_s", "zeros": "zeros_rad_s", "gain": "dc_gain"}[name]
                text = str(_printed(table, who)[key])
                row[f"{name}, {who}"] = "–" if text == "nan" else text
        rows.append(row)
    return pd.DataFrame(rows)


def printed_model(source: str) -> control.TransferFunction:
    """Figure 2-6's printed curves: one of the two models, put together from its tables."""
    grid: list[list[Any]] = []
    for output in ("shaft_speed", "ship_speed"):
        line = []
        for name in ("pitch_command", "drive", "resistance_factor", "inflow"):
            table = next(t for t, pair in TABLES.items() if pair == (output, name))
            row = _printed(table, source)
            poles, zeros = sorted_numbers(row["poles_rad_s"]), sorted_numbers(row["zeros_rad_s"])
            shape = control.zpk(zeros, poles, 1.0)
            line.append(float(row["dc_gain"]) / float(np.real(shape.dcgain())) * shape)
        grid.append(line)
    return control.combine_tf(grid)
