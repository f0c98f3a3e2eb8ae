"""Compute the linear models of the frigate, Tables 2-2 to 2-23: poles, zeros and steady gains.

The thesis does not print the mid-range point at which it compares its model with Vrijdag & Stapersma
2017. Two of its gains, from the fuel rack to shaft and ship speed (Tables 2-18 and 2-19), determine the
point; the other printed numbers then test it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.core.lazy import control
from shaftline.plant import Equilibrium, Ship, equilibrium, linearise

from ..cells import half_digit
from ..side_by_side import published, published_text


class Printed(NamedTuple):
    """One line of a printed table, numbers by size, with half a unit of their last digits."""

    poles: tuple[float, ...]
    zeros: tuple[float, ...]
    gain: float
    pole_rounding: tuple[float, ...]
    zero_rounding: tuple[float, ...]
    gain_rounding: float


def _numbers(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    parts = sorted((part for part in text.split(",") if part.strip()), key=lambda p: abs(float(p)))
    return tuple(map(float, parts)), tuple(map(half_digit, parts))


def printed_line(table: str, line: str) -> Printed:
    """Return a line of Tables 2-2 to 2-23."""
    lines = published_text("advance_velocity_thesis_poles_zeros_gains")
    found = lines.loc[[table]].set_index("working_point_or_source").loc[line]
    poles, pole_rounding = _numbers(found["poles_rad_s"])
    zeros, zero_rounding = _numbers(found["zeros_rad_s"])
    gain = found["dc_gain"]
    return Printed(poles, zeros, float(gain), pole_rounding, zero_rounding, half_digit(gain))


# table number: (output, input) in our names
TABLES = {
    "2-2": ("pitch_ratio", "pitch_command"),
    "2-3": ("shaft_speed", "pitch_command"),
    "2-4": ("ship_speed", "pitch_command"),
    "2-5": ("shaft_torque", "pitch_command"),
    "2-6": ("shaft_speed", "drive"),
    "2-7": ("ship_speed", "drive"),
    "2-8": ("shaft_torque", "drive"),
    "2-9": ("shaft_speed", "resistance_factor"),
    "2-10": ("ship_speed", "resistance_factor"),
    "2-11": ("shaft_torque", "resistance_factor"),
    "2-12": ("shaft_speed", "inflow"),
    "2-13": ("ship_speed", "inflow"),
    "2-14": ("shaft_torque", "inflow"),
}


def poles_zeros_gain(system: control.StateSpace) -> tuple[list[float], list[float], float]:
    """Return poles, zeros [rad/s] and steady gain of a transfer, by size, without common factors."""
    poles = [complex(p) for p in system.poles()]
    zeros = [complex(z) for z in system.zeros() if abs(z) < 1e6]
    for zero in list(zeros):
        near = [p for p in poles if abs(p - zero) < 1e-7 * max(1.0, abs(p))]
        if near:
            poles.remove(near[0])
            zeros.remove(zero)
    gain = float(np.real(system.dcgain()))
    return sorted((p.real for p in poles), key=abs), sorted((z.real for z in zeros), key=abs), gain


def sorted_numbers(text: Any) -> list[float]:
    """Return the numbers of a printed cell, by size."""
    if not isinstance(text, str) or not text.strip():
        return [float(text)] if isinstance(text, float) and np.isfinite(text) else []
    return sorted((float(part) for part in text.split(",")), key=abs)


def _shown(values: list[float]) -> str:
    return ", ".join(f"{value:.4f}" for value in values) or "–"


def plant_transfers(ship: Ship) -> pd.DataFrame:
    """Return every transfer of Tables 2-2 to 2-14 at A to D, ours beside the thesis's."""
    printed = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    rows = []
    for point, model in models(ship).items():
        for table, (output, source) in TABLES.items():
            poles, zeros, gain = poles_zeros_gain(model[output, source])
            line = printed[
                (printed["table"] == table) & (printed["working_point_or_source"] == point)
            ].iloc[0]
            thesis_gain = float(line["dc_gain"])
            difference = 100.0 * (gain / thesis_gain - 1.0)
            rows.append(
                {
                    "table": table,
                    "transfer": f"{output} / {source}",
                    "point": point,
                    "poles": _shown(poles),
                    "poles_thesis": _shown(sorted_numbers(line["poles_rad_s"])),
                    "zeros": _shown(zeros),
                    "zeros_thesis": _shown(sorted_numbers(line["zeros_rad_s"])),
                    "gain": gain,
                    "gain_thesis": thesis_gain,
                    "gain_difference_percent": difference,
                }
            )
    return pd.DataFrame(rows)


def working_point(ship: Ship, point: str) -> Equilibrium:
    """Return the steady state of the ship at the printed rack and pitch of point A to D."""
    inputs = published("advance_velocity_thesis_working_points").loc[point]
    return equilibrium(ship, float(inputs["fuel_rack_mm"]), float(inputs["pitch_ratio"]))


def models(ship: Ship) -> dict[str, control.StateSpace]:
    """Return the linear models at A to D (Figure 2-5)."""
    return {point: linearise(ship, working_point(ship, point)) for point in "ABCD"}


MID_RANGE_TABLES = {
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


def _printed_row(table: str, source: str) -> Any:
    lines = published("advance_velocity_thesis_poles_zeros_gains").reset_index()
    return lines[(lines["table"] == table) & (lines["working_point_or_source"] == source)].iloc[0]


def mid_range_point(ship: Ship) -> Equilibrium:
    """Return the working point at which our gains from the rack equal the thesis's."""
    wanted = [float(_printed_row(table, SOURCES[0])["dc_gain"]) for table in ("2-18", "2-19")]

    def difference(inputs: Any) -> list[float]:
        model = linearise(ship, equilibrium(ship, float(inputs[0]), float(inputs[1])))
        gains = [float(np.real(model[o, "drive"].dcgain())) for o in ("shaft_speed", "ship_speed")]
        return [ours - theirs for ours, theirs in zip(gains, wanted, strict=True)]

    rack, pitch = scipy.optimize.root(difference, [22.0, 1.2]).x
    return equilibrium(ship, float(rack), float(pitch))


def mid_range(ship: Ship) -> pd.DataFrame:
    """Return our poles, zeros and gains at the mid-range point beside those of both printed models."""
    model = linearise(ship, mid_range_point(ship))
    rows = []
    for table, (output, source) in MID_RANGE_TABLES.items():
        poles, zeros, gain = poles_zeros_gain(model[output, source])
        row = {"table": table, "transfer": f"{output} / {source}"}
        for name, values in (("poles", poles), ("zeros", zeros), ("gain", [gain])):
            row[name] = ", ".join(f"{value:.4f}" for value in values) or "–"
            for who in SOURCES:
                key = {"poles": "poles_rad_s", "zeros": "zeros_rad_s", "gain": "dc_gain"}[name]
                text = str(_printed_row(table, who)[key])
                row[f"{name}, {who}"] = "–" if text == "nan" else text
        rows.append(row)
    return pd.DataFrame(rows)


def printed_model(source: str) -> control.TransferFunction:
    """Return one of the two models of Figure 2-6, composed from its printed tables."""
    grid: list[list[Any]] = []
    for output in ("shaft_speed", "ship_speed"):
        line = []
        for name in ("pitch_command", "drive", "resistance_factor", "inflow"):
            table = next(t for t, pair in MID_RANGE_TABLES.items() if pair == (output, name))
            row = _printed_row(table, source)
            poles, zeros = sorted_numbers(row["poles_rad_s"]), sorted_numbers(row["zeros_rad_s"])
            shape = control.zpk(zeros, poles, 1.0)
            line.append(float(row["dc_gain"]) / float(np.real(shape.dcgain())) * shape)
        grid.append(line)
    return control.combine_tf(grid)
