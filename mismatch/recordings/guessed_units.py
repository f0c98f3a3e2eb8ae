"""The unit of a column, as its name states it or as its values suggest it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant import Ship
from ...plant.columns import BOUNDS, HEADING, SHAFT_SPEED, TIME, YAW_RATE, drive_column
from .logger_names import DUTY, LoggerName
from .slips import HELMS, ranges_of, top_speed
from .sources import LINEAR, PERCENT, PERCENT_OF_RANGE, Source

_TURNS = dict.fromkeys(
    ("1/min", "min-1", "min^-1", "r/min", "u/min", "rev/min", "rpm"), "rpm"
) | dict.fromkeys(("1/s", "s-1", "s^-1", "hz", "rev/s", "r/s", "rps"), "rps")
"""How loggers write revolutions; a map has to say that they are counted."""
_PER_SECOND = {"rad/s": 1.0, "rps": 2.0 * math.pi, "rpm": math.pi / 30.0}
_REACHED = (0.02, 1.3)  # shares of the top speed between which a recording's fastest rows lie
_USUAL = 0.6  # the likeliest
_CLOCKS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""Least value of a clock since 1970, and its unit."""
_TIMES = ("s", "min", "h", "ms", "us", "ns", "µs")
_PULSE_US = (700.0, 2300.0)  # pulse widths of servos and motor controllers
_NEUTRAL_US, _SPAN_US = 1500.0, 60.0
_LEAST_OPENING, _SMALL_OPENING = 0.25, 30.0  # share of the end stop; per cent
_A_TURN = 2.0 * math.pi + 0.1


class Guess(NamedTuple):
    """The unit of a column: further keys of its line in the map, and what is not sure of it."""

    unit: str
    more: tuple[str, ...] = ()
    doubt: str = ""


def guess_unit(
    name: LoggerName,
    column: str,
    ship: Ship,
    values: NDArray[np.float64],
    cells: pd.Series | None = None,
    reverses: bool = False,
) -> Guess | None:
    """Return the unit of a column of the file if it is a canonical one; None if it cannot be.

    Args:
        name: of the column, split.
        column: canonical.
        ship: the nominal ship, whose ranges tell units apart that no name states.
        values: its finite numbers, (m,).
        cells: as read, for a time in text.
        reverses: whether another column of the file says that the shaft turns either way.
    """
    stated = name.unit_as(column)
    if column == TIME:
        return _time(stated, values, cells)
    is_opening = stated in PERCENT or bool(DUTY & {*name.words})
    if column == drive_column(ship) and column != SHAFT_SPEED and is_opening:
        top = float(ship.record()["drive_max"])
        found = _opening(stated, values, top, BOUNDS[column][2], reverses)
        if found is not None:
            return found
    if not stated:
        return _from_size(name, column, ship, values)
    if column == SHAFT_SPEED:
        stated = _TURNS.get(stated.lower(), stated)
    if stated in PERCENT:
        return Guess(PERCENT_OF_RANGE) if column in ranges_of(ship) else None
    if _is_unit_of(stated, column):
        doubt = "the path's convention: SI units, revolutions in Hz" if not name.unit else ""
        if "electrical" in name.words and column == SHAFT_SPEED:
            doubt = "of the motor controller; the logger must know the number of poles"
        if column == "ship_speed_m_s" and {"sog", "ground", "vtg"} & {*name.words}:
            doubt = "speed over ground: a current is in it"
        return Guess(stated, (), doubt)
    linear = not ship.moves and not ship.has_propeller
    if linear and BOUNDS[column][2] in LINEAR and _is_unit_of(stated, column, 1.0):
        said = (
            "a linear axis: set the radius, or keep 1 m and give the ship file masses for inertias"
        )
        return Guess(stated, ("radius_m = 1.0",), said)
    return None


def _time(stated: str, values: NDArray[np.float64], cells: pd.Series | None) -> Guess | None:
    text = cells is not None and not pd.api.types.is_numeric_dtype(cells)
    if text and cells is not None and len(values) < len(cells) / 2:
        return Guess("datetime")
    if stated in _TIMES:
        coarse = "whole seconds: several rows in one are spread evenly" if _repeats(values) else ""
        return Guess(stated, (), coarse)
    if stated:
        return Guess("datetime") if len(values) == 0 else None
    largest = float(np.abs(values).max()) if len(values) else 0.0
    for least, unit in _CLOCKS:
        if largest >= least:
            return Guess(unit, (), f"unit not stated; the values are those of a clock in {unit}")
    if len(values) > 2 and np.allclose(np.diff(values), 1.0):
        return Guess(
            "s", (), "unit not stated; if it counts rows, add scale = seconds from row to row"
        )
    return Guess("s", (), "unit not stated: s taken")


def _repeats(values: NDArray[np.float64]) -> bool:
    return len(values) > 1 and bool((np.diff(values) == 0.0).any())


def _opening(
    stated: str, values: NDArray[np.float64], top: float, unit: str, reverses: bool
) -> Guess | None:
    """Return the guess for a command that says how far a drive is opened: pulse, share or per cent.

    Args:
        stated: unit; empty where none is.
        values: finite numbers, (m,).
        top: the drive's end stop, in ``unit``.
        unit: canonical unit of the drive.
        reverses: whether another column of the file says that the shaft turns either way.
    """
    if len(values) == 0:
        return None
    low, high = float(values.min()), float(values.max())
    if stated in PERCENT:
        return Guess(PERCENT_OF_RANGE)
    if stated not in ("", "-", "us", "µs", "μs"):
        return None
    if low >= _PULSE_US[0] and high <= _PULSE_US[1]:
        rests = abs(values[0] - _NEUTRAL_US) < _SPAN_US
        if low < _NEUTRAL_US - _SPAN_US and (reverses or rests):
            said = "a pulse in us: 1500 taken for rest, 1000 and 2000 for the ends; one way otherwise: "
            more = ("scale = 0.2", "offset = -300")
            return Guess(PERCENT_OF_RANGE, more, f"{said}scale = 0.1, offset = -100")
        said = "a pulse in us: 1000 taken for rest and 2000 for full; with reversals otherwise: "
        more = ("scale = 0.1", "offset = -100")
        return Guess(PERCENT_OF_RANGE, more, f"{said}scale = 0.2, offset = -300")
    if max(-low, high) <= 1.0:
        return Guess(PERCENT_OF_RANGE, ("scale = 100",), "unit not stated; 1 taken for full")
    if 1.0 < _LEAST_OPENING * top <= max(-low, high) <= min(top, _SMALL_OPENING):
        said = f"unit not stated: {unit} taken, in which it fits this ship; per cent otherwise"
        return Guess(unit, (), said)
    if max(-low, high) <= 100.0:
        return Guess(PERCENT_OF_RANGE, (), "unit not stated; 100 taken for full")
    if low >= 0.0 and high <= 255.0:
        return Guess(PERCENT_OF_RANGE, ("scale = 0.392157",), "unit not stated; 255 taken for full")
    return None


def _from_size(
    name: LoggerName, column: str, ship: Ship, values: NDArray[np.float64]
) -> Guess | None:
    """Return the unit that the size of the values suggests, with what is not sure of it."""
    unit = {"N m": "N m", "-": "dimensionless"}.get(BOUNDS[column][2], BOUNDS[column][2])
    size = float(np.percentile(np.abs(values), 95)) if len(values) else 0.0
    if column == SHAFT_SPEED:
        return _speed(name, ship, size)
    if column in HELMS:
        unit = "deg" if size > float(ship.record()["rudder_max"]) * 1.25 else "rad"
    elif column == YAW_RATE and {"rot", "turn"} & {*name.words}:
        unit = "deg/min"
    elif column == HEADING:
        unit = "deg" if size > _A_TURN else "rad"
    elif column in ranges_of(ship) and BOUNDS[column][2] == "-" and size > BOUNDS[column][1]:
        unit = PERCENT_OF_RANGE
    said = f"unit not stated: {unit} taken"
    if column == "ship_speed_m_s":
        said += "; knot is as common"
        if {"sog", "ground", "vtg"} & {*name.words}:
            said += "; speed over ground: a current is in it"
    return Guess(unit, (), said)


def _speed(name: LoggerName, ship: Ship, size: float) -> Guess:
    """Return the unit of revolutions in which they are nearest to what this shaft reaches."""
    top = top_speed(ship) / 3.0
    if drive_column(ship) == SHAFT_SPEED:
        top = float(ship.record()["drive_max"])
    units = list(_PER_SECOND)
    fits = [u for u in units if _REACHED[0] * top <= _PER_SECOND[u] * size <= _REACHED[1] * top]
    if "omega" in name.words or not fits:
        others = "rpm or rps otherwise" if fits else "none of rad/s, rps, rpm fits this ship"
        return Guess("rad/s", (), f"unit not stated: rad/s taken; {others}")
    best = min(fits, key=lambda u: abs(math.log(_PER_SECOND[u] * size / (_USUAL * top))))
    others = ", ".join(u for u in fits if u != best)
    said = f"unit not stated: {best} by the ship's top speed of {top:.4g} rad/s"
    return Guess(best, (), said + (f"; {others} would fit too" if others else ""))


def _is_unit_of(unit: str, column: str, radius_m: float | None = None) -> bool:
    try:
        keys: dict[str, Any] = {} if radius_m is None else {"radius_m": radius_m}
        Source(column=column, unit=unit, **keys)
    except ValueError:
        return False
    return True
