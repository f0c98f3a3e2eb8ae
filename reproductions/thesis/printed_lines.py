"""Printed poles, zeros and gains of the thesis, by table and working point."""

from __future__ import annotations

from typing import NamedTuple

from ..cells import half_digit
from ..side_by_side import published_text


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


def printed(table: str, line: str) -> Printed:
    """Return a line of Tables 2-2 to 2-23.

    Args:
        table: its number, such as ``2-3``.
        line: A to D, or the source of the model.
    """
    lines = published_text("advance_velocity_thesis_poles_zeros_gains")
    found = lines.loc[[table]].set_index("working_point_or_source").loc[line]
    poles, pole_rounding = _numbers(found["poles_rad_s"])
    zeros, zero_rounding = _numbers(found["zeros_rad_s"])
    gain = found["dc_gain"]
    return Printed(poles, zeros, float(gain), pole_rounding, zero_rounding, half_digit(gain))
