"""Compute the linear models of the frigate, Tables 2-2 to 2-23: poles, zeros and steady gains.

The thesis does not print the mid-range point at which it compares its model with Vrijdag & Stapersma
2017. Two of its gains, from the fuel rack to shaft and ship speed (Tables 2-18 and 2-19), determine the
point; the other printed numbers then test it.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy

from shaftline.core.lazy import control
from shaftline.plant import Equilibrium, Ship, equilibrium, linearise

from ..cells import half_digit
from ..side_by_side import published, published_text

PRINTED = "advance_velocity_thesis_poles_zeros_gains"
INPUTS = ("pitch_command", "drive", "resistance_factor", "inflow")
TABLES = {"2-2": ("pitch_ratio", "pitch_command")} | {
    f"2-{number}": (output, source)
    for number, (source, output) in enumerate(
        itertools.product(INPUTS, ("shaft_speed", "ship_speed", "shaft_torque")), 3
    )
}
"""Output and input of Tables 2-2 to 2-14."""
MID_RANGE_TABLES = {
    f"2-{number}": (output, source)
    for number, (source, output) in enumerate(
        itertools.product(INPUTS, ("shaft_speed", "ship_speed")), 16
    )
}
SOURCES = ("This thesis", "Vrijdag paper")


class Printed(NamedTuple):
    """One line of a printed table, numbers by size."""

    poles: tuple[float, ...]
    zeros: tuple[float, ...]
    gain: float
    numbers: dict[str, tuple[float, float]]
    """Each number with half of its last digit, by name, such as ``zero 1``."""


def _printed_texts(table: str, line: str) -> Any:
    return published_text(PRINTED).loc[[table]].set_index("working_point_or_source").loc[line]


def printed_line(table: str, line: str) -> Printed:
    """Return a line of Tables 2-2 to 3-14: a working point, or one of :data:`SOURCES`."""
    found, numbers = _printed_texts(table, line), {}
    for kind, column in (("pole", "poles_rad_s"), ("zero", "zeros_rad_s"), ("gain", "dc_gain")):
        texts = [re.sub(r"\s*\\cdot\s*10\^", "e", one) for one in found[column].split(",")]
        parts = sorted(filter(str.strip, texts), key=lambda part: abs(float(part)))
        for i, part in enumerate(parts, 1):
            numbers[kind if kind == "gain" else f"{kind} {i}"] = float(part), half_digit(part)
    poles, zeros = (
        tuple(value for name, (value, _) in numbers.items() if name.startswith(kind))
        for kind in ("pole", "zero")
    )
    return Printed(poles, zeros, numbers["gain"][0], numbers)


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


def show(values: Iterable[float]) -> str:
    """Return numbers as a cell of a table."""
    return ", ".join(f"{value:.4f}" for value in values) or "–"


def plant_transfers(ship: Ship) -> pd.DataFrame:
    """Return every transfer of Tables 2-2 to 2-14 at A to D, ours beside the thesis's."""
    rows = []
    for point, model in models(ship).items():
        for table, (output, source) in TABLES.items():
            poles, zeros, gain = poles_zeros_gain(model[output, source])
            line = printed_line(table, point)
            rows.append(
                {
                    "table": table,
                    "transfer": f"{output} / {source}",
                    "point": point,
                    "poles": show(poles),
                    "poles_thesis": show(line.poles),
                    "zeros": show(zeros),
                    "zeros_thesis": show(line.zeros),
                    "gain": gain,
                    "gain_thesis": line.gain,
                    "gain_difference_percent": 100.0 * (gain / line.gain - 1.0),
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


def mid_range_point(ship: Ship) -> Equilibrium:
    """Return the working point at which our gains from the rack equal the thesis's."""
    wanted = {MID_RANGE_TABLES[n]: printed_line(n, SOURCES[0]).gain for n in ("2-18", "2-19")}

    def difference(inputs: Any) -> list[float]:
        model = linearise(ship, equilibrium(ship, float(inputs[0]), float(inputs[1])))
        return [float(np.real(model[pair].dcgain())) - gain for pair, gain in wanted.items()]

    rack, pitch = scipy.optimize.root(difference, [22.0, 1.2]).x
    return equilibrium(ship, float(rack), float(pitch))


def mid_range(ship: Ship) -> pd.DataFrame:
    """Return our poles, zeros and gains at the mid-range point beside those of both printed models."""
    model, rows = linearise(ship, mid_range_point(ship)), []
    for table, (output, source) in MID_RANGE_TABLES.items():
        poles, zeros, gain = poles_zeros_gain(model[output, source])
        row = {"table": table, "transfer": f"{output} / {source}"}
        keys = {"poles": "poles_rad_s", "zeros": "zeros_rad_s", "gain": "dc_gain"}
        for (name, key), values in zip(keys.items(), (poles, zeros, [gain]), strict=True):
            row[name] = show(values)
            row |= {f"{name}, {who}": _printed_texts(table, who)[key] or "–" for who in SOURCES}
        rows.append(row)
    return pd.DataFrame(rows)


def printed_model(source: str) -> control.TransferFunction:
    """Return one of the two models of Figure 2-6, composed from its printed tables."""
    transfers = {}
    for table, pair in MID_RANGE_TABLES.items():
        row = printed_line(table, source)
        shape = control.zpk(row.zeros, row.poles, 1.0)
        transfers[pair] = row.gain / float(np.real(shape.dcgain())) * shape
    outputs = ("shaft_speed", "ship_speed")
    return control.combine_tf([[transfers[output, name] for name in INPUTS] for output in outputs])
