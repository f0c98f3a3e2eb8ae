"""Draft a column map from the names, units and values of a file.

The unit of a column comes from its name, or else from the size of its values.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant import Ship
from ...plant.columns import (
    BOUNDS,
    COLUMNS,
    ELECTRIC_POWER,
    HEADING,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    TIME,
    YAW_RATE,
    absent_columns,
    drive_column,
    input_columns,
    simulated_columns,
)
from .columns import LINEAR, PERCENT, PERCENT_OF_RANGE, Source
from .logger_names import DUTY, LoggerName, rank, split_names
from .unit_errors import HELMS, command_ranges, top_speed

_TURNS = dict.fromkeys(
    ("1/min", "min-1", "min^-1", "r/min", "u/min", "rev/min", "rpm"), "rpm"
) | dict.fromkeys(("1/s", "s-1", "s^-1", "hz", "rev/s", "r/s", "rps"), "rps")
"""Unit of revolutions for each spelling of loggers."""
_PER_SECOND = {"rad/s": 1.0, "rps": 2.0 * math.pi, "rpm": math.pi / 30.0}
_REACHED = (0.02, 1.3)  # shares of the top speed between which the fastest rows of a recording lie
_USUAL = 0.6  # most likely share
_CLOCKS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))
"""Least value of a clock that counts from 1970, and its unit."""
_TIMES = ("s", "min", "h", "ms", "us", "ns", "µs")
_PULSE_US = (700.0, 2300.0)  # pulse widths [us] of servos and motor controllers
_NEUTRAL_US, _SPAN_US = 1500.0, 60.0
_LEAST_OPENING, _SMALL_OPENING = 0.25, 30.0  # share of the end stop; percent
_A_TURN = 2.0 * math.pi + 0.1


class Guess(NamedTuple):
    """Guessed unit of a column, further keys of its line in the map, and the reason for a doubt."""

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
    """Return the unit of a column of the file as a canonical column; None if the unit does not fit.

    Args:
        name: name of the column, split into words and unit.
        column: canonical column.
        ship: the nominal ship, whose ranges distinguish units that the name does not state.
        values: finite numbers of the column, (m,).
        cells: cells of the column, for a time as text.
        reverses: whether another column of the file shows that the shaft turns both ways.
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
        return Guess(PERCENT_OF_RANGE) if column in command_ranges(ship) else None
    if _is_unit_of(stated, column):
        doubt = "Signal K convention: SI units, revolutions in Hz" if not name.unit else ""
        if "electrical" in name.words and column == SHAFT_SPEED:
            doubt = "from the motor controller; right only if the logger knows the number of poles"
        if column == "ship_speed_m_s" and {"sog", "ground", "vtg"} & {*name.words}:
            doubt = "speed over ground includes the current"
        return Guess(stated, (), doubt)
    linear = not ship.moves and not ship.has_propeller
    if linear and BOUNDS[column][2] in LINEAR and _is_unit_of(stated, column, 1.0):
        doubt = "a linear axis: set the radius, or keep 1 m and use masses as inertias of the ship"
        return Guess(stated, ("radius_m = 1.0",), doubt)
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
        return Guess("s", (), "unit not stated; if it counts rows, add scale = seconds per row")
    return Guess("s", (), "unit not stated: s assumed")


def _repeats(values: NDArray[np.float64]) -> bool:
    return len(values) > 1 and bool((np.diff(values) == 0.0).any())


def _opening(
    stated: str, values: NDArray[np.float64], top: float, unit: str, reverses: bool
) -> Guess | None:
    """Return the unit of a command that is a share of its range: a pulse width, a fraction or percent.

    Args:
        stated: stated unit; empty if there is none.
        values: finite numbers, (m,).
        top: end stop of the drive, in ``unit``.
        unit: canonical unit of the drive.
        reverses: whether another column of the file shows that the shaft turns both ways.
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
            doubt = (
                "pulse in us: 1500 assumed for 0, 1000 and 2000 for the ends; without reversals: "
            )
            more = ("scale = 0.2", "offset = -300")
            return Guess(PERCENT_OF_RANGE, more, f"{doubt}scale = 0.1, offset = -100")
        doubt = "pulse in us: 1000 assumed for 0 and 2000 for the upper limit; with reversals: "
        more = ("scale = 0.1", "offset = -100")
        return Guess(PERCENT_OF_RANGE, more, f"{doubt}scale = 0.2, offset = -300")
    limit = "assumed for the upper limit"
    if max(-low, high) <= 1.0:
        return Guess(PERCENT_OF_RANGE, ("scale = 100",), f"unit not stated; 1 {limit}")
    if 1.0 < _LEAST_OPENING * top <= max(-low, high) <= min(top, _SMALL_OPENING):
        doubt = f"unit not stated: {unit} assumed, which fits the range of this ship; else percent"
        return Guess(unit, (), doubt)
    if max(-low, high) <= 100.0:
        return Guess(PERCENT_OF_RANGE, (), f"unit not stated; 100 {limit}")
    if low >= 0.0 and high <= 255.0:
        return Guess(PERCENT_OF_RANGE, ("scale = 0.392157",), f"unit not stated; 255 {limit}")
    return None


def _from_size(
    name: LoggerName, column: str, ship: Ship, values: NDArray[np.float64]
) -> Guess | None:
    """Return the unit that the size of the values suggests, with the reason for a doubt."""
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
    elif column in command_ranges(ship) and BOUNDS[column][2] == "-" and size > BOUNDS[column][1]:
        unit = PERCENT_OF_RANGE
    doubt = f"unit not stated: {unit} assumed"
    if column == "ship_speed_m_s":
        doubt += "; knot is also common"
        if {"sog", "ground", "vtg"} & {*name.words}:
            doubt += "; speed over ground includes the current"
    return Guess(unit, (), doubt)


def _speed(name: LoggerName, ship: Ship, size: float) -> Guess:
    """Return the unit of the shaft speed in which the values are closest to the range of this shaft."""
    top = top_speed(ship) / 3.0
    if drive_column(ship) == SHAFT_SPEED:
        top = float(ship.record()["drive_max"])
    units = list(_PER_SECOND)
    fits = [u for u in units if _REACHED[0] * top <= _PER_SECOND[u] * size <= _REACHED[1] * top]
    if "omega" in name.words or not fits:
        others = "else rpm or rps" if fits else "none of rad/s, rps, rpm fits this ship"
        return Guess("rad/s", (), f"unit not stated: rad/s assumed; {others}")
    best = min(fits, key=lambda u: abs(math.log(_PER_SECOND[u] * size / (_USUAL * top))))
    others = ", ".join(u for u in fits if u != best)
    doubt = f"unit not stated: {best} fits the top speed {top:.4g} rad/s of the shaft"
    return Guess(best, (), doubt + (f"; {others} would fit too" if others else ""))


def _is_unit_of(unit: str, column: str, radius_m: float | None = None) -> bool:
    try:
        keys: dict[str, Any] = {} if radius_m is None else {"radius_m": radius_m}
        Source(column=column, unit=unit, **keys)
    except ValueError:
        return False
    return True


_LEAST_VARIATION = 0.1  # share of its size over which the voltage of a motor varies
_EITHER_WAY = 0.1  # share of its largest value that a reversing signal reaches with the other sign
_OPTIONAL = ("inflow_velocity_m_s", "fuel_flow_kg_s", "propeller_submergence_m", RUDDER_COMMAND)


@dataclass
class _Choice:
    """Column of the file for a canonical column, its unit, and other columns that would fit."""

    name: str
    guess: Guess
    rivals: list[str] = field(default_factory=list)


def draft_column_map(
    ship: Ship, left: pd.DataFrame, units: Mapping[str, str], taken: set[str]
) -> Iterator[str]:
    """Yield the lines of a draft of a column map; a column that is not recognised becomes a comment.

    A column is recognised by its name, or by its unit if only one column of the file and one of the ship
    have this unit; the time is also recognised by its stamps. Comments list columns of the file that
    compete for a canonical column, and units that are assumed.

    Example:
        >>> from shaftline.plant import load_ship
        >>> table = pd.DataFrame({"Time (s)": [0.0, 1.0], "Fuel rack (mm)": [20.0, 21.0]})
        >>> for line in draft_column_map(load_ship("frigate"), table, {}, set()):
        ...     print(line)
        # draft of a column map, from names, units and values: check each line
        [columns]
        "Time (s)" = { column = "time_s", unit = "s" }
        "Fuel rack (mm)" = { column = "fuel_rack_mm", unit = "mm" }

    Args:
        ship: the nominal ship.
        left: columns of the file that are not mapped.
        units: units that the file states in a row of units, by name.
        taken: canonical columns that the file has.
    """
    foreign = absent_columns(ship)
    wanted = dict.fromkeys(
        [*input_columns(ship), SHAFT_SPEED, *simulated_columns(ship), *_OPTIONAL]
    )
    if not ship.has_variable_pitch:
        foreign |= {"pitch_ratio"}
    if not ship.has_propeller:
        foreign |= {"inflow_velocity_m_s", "propeller_submergence_m"}
    if not ship.has_diesel:
        foreign |= {"fuel_flow_kg_s"}
    if not ship.moves:
        foreign |= {"ship_speed_m_s"}
    missing = [c for c in wanted if c not in taken and c not in foreign]
    left = left.rename(columns=str)
    left = left[[name for name in left if name not in ship.external_signals]]
    names = split_names(map(str, left.columns), units)
    if not names or not missing:
        return
    found = _by_name(ship, left, names, missing)
    _by_cells(ship, left, names, missing, found)
    if RUDDER in found or RUDDER in taken:  # The rudder angle may be the rudder command as well.
        missing = [c for c in missing if c != RUDDER_COMMAND]
    if taken & {SHAFT_SPEED, SHAFT_ANGLE} or {SHAFT_SPEED, SHAFT_ANGLE} & {*found}:
        missing = [c for c in missing if c not in (SHAFT_SPEED, SHAFT_ANGLE) or c in found]
    yield "# draft of a column map, from names, units and values: check each line"
    yield "[columns]"
    for column in sorted(found, key=[*wanted].index):
        choice = found[column]
        yield _line(choice.name, column, choice.guess)
        if choice.rivals:
            yield f"# also possible as {column}: {', '.join(choice.rivals)}"
    chosen = {choice.name for choice in found.values()}
    still = [f"{c} [{BOUNDS[c][2]}]" for c in missing if c not in found and c not in _OPTIONAL]
    others = [name for name in names if name not in chosen]
    if still and others:
        yield f"# still missing: {', '.join(still)}"
        for name in others:
            yield f'# {_quoted(name)} = {{ column = "?", unit = "{names[name].unit or "?"}" }}'


def _by_name(
    ship: Ship, left: pd.DataFrame, names: Mapping[str, LoggerName], missing: list[str]
) -> dict[str, _Choice]:
    """Choose for each canonical column the column of the file with the best-fitting name."""
    drive = drive_column(ship)
    ordered = {drive, "pitch_ratio_command", RUDDER_COMMAND}
    reverses = any(
        rank(split, column, ship, False) is not None and _reverses(_numbers(left[name]))
        for name, split in names.items()
        for column in (SHAFT_SPEED, "thrust_N", "shaft_torque_N_m")
    )
    fits: dict[str, list[tuple[tuple[float, ...], str, Guess]]] = {}
    for column in missing:
        for name, split in names.items():
            place = rank(split, column, ship, column in ordered)
            values = _numbers(left[name])
            # The column holds text, such as the source of a speed.
            if column != TIME and len(values) < len(left) / 2:
                continue
            # A power of 0 throughout comes from an instrument that is not connected.
            if column in (SHAFT_POWER, ELECTRIC_POWER) and not np.any(values):
                continue
            if place is None:
                continue
            guess = guess_unit(split, column, ship, values, left[name], reverses)
            if guess is None:
                continue
            # A measured shaft speed is preferred to a commanded one.
            late = split.is_command and column == SHAFT_SPEED
            still = column == "motor_voltage_V" and not DUTY & {*split.words} and _stands(values)
            fits.setdefault(column, []).append(((late, still, *place), name, guess))
    if SHAFT_SPEED in fits or SHAFT_SPEED not in missing:
        fits.pop(
            SHAFT_ANGLE, None
        )  # The angle adds nothing to the speed and may restart each turn.
    found: dict[str, _Choice] = {}
    taken: set[str] = set()
    for column in sorted(fits, key=lambda c: (c not in ordered, COLUMNS.index(c))):
        free = [fit for fit in sorted(fits[column], key=lambda fit: fit[0]) if fit[1] not in taken]
        better = [fit for fit in free if not _belongs_elsewhere(fit, column, fits)]
        if not (better or free):
            continue
        _, name, guess = (better or free)[0]
        rivals = [f"{_quoted(n)} ({names[n].unit or 'no unit'})" for _, n, _ in free if n != name]
        found[column] = _Choice(name, guess, rivals)
        taken.add(name)
    for column, choice in found.items():  # Columns chosen elsewhere are no longer alternatives.
        own = {_quoted(other.name) for key, other in found.items() if key != column}
        choice.rivals = [r for r in choice.rivals if r.rpartition(" (")[0] not in own]
    return found


def _belongs_elsewhere(
    fit: tuple[tuple[float, ...], str, Guess],
    column: str,
    fits: Mapping[str, list[tuple[tuple[float, ...], str, Guess]]],
) -> bool:
    """Return whether another canonical column leaves fewer words of the name unexplained."""
    return any(
        other[1] == fit[1] and other[0][-1] < fit[0][-1]
        for key, those in fits.items()
        if key != column
        for other in those
    )


def _by_cells(
    ship: Ship,
    left: pd.DataFrame,
    names: Mapping[str, LoggerName],
    missing: list[str],
    found: dict[str, _Choice],
) -> None:
    """Add the columns that are recognised by time stamps or by their unit alone."""
    chosen = {choice.name for choice in found.values()}
    for name in (n for n in names if n not in chosen):
        if TIME in missing and TIME not in found and holds_time_stamps(left[name]):
            found[TIME] = _Choice(name, Guess("datetime"))
            chosen.add(name)
    counted = [n for n in names if n not in chosen and _counts_turns(names[n])]
    if SHAFT_SPEED in missing and SHAFT_SPEED not in found and len(counted) == 1:
        guess = guess_unit(names[counted[0]], SHAFT_SPEED, ship, _numbers(left[counted[0]]))
        if guess is not None:
            found[SHAFT_SPEED] = _Choice(counted[0], guess)
            chosen.add(counted[0])
    rest = [n for n in names if n not in chosen and names[n].unit not in ("", "-", *PERCENT)]
    columns = [c for c in missing if c not in found and c not in _OPTIONAL]

    def kinds(name: str) -> list[str]:
        return [c for c in columns if guess_unit(names[name], c, ship, _numbers(left[name]))]

    fitting = {name: kinds(name) for name in rest}
    for name in rest:
        if len(fitting[name]) != 1:
            continue
        (column,) = fitting[name]
        if sum(column in those for those in fitting.values()) == 1:
            guess = guess_unit(names[name], column, ship, _numbers(left[name]))
            assert guess is not None
            found[column] = _Choice(
                name, Guess(guess.unit, guess.more, "guessed from the unit alone")
            )


def _line(name: str, column: str, guess: Guess) -> str:
    """Return the line of a map, with a comment if the unit is doubtful."""
    parts = [f'column = "{column}"', f'unit = "{guess.unit}"', *guess.more]
    comment = f"  # {guess.doubt}" if guess.doubt else ""
    return f"{_quoted(name)} = {{ {', '.join(parts)} }}{comment}"


def _quoted(name: str) -> str:
    """Return a name as a TOML string."""
    return json.dumps(name, ensure_ascii=False)


def _counts_turns(name: LoggerName) -> bool:
    units = ("rpm", "rps", "1/min", "min-1", "min^-1", "r/min", "u/min", "1/s", "hz")
    return name.unit.lower() in units


def _numbers(values: pd.Series) -> NDArray[np.float64]:
    """Return the finite numbers of a column, (m,)."""
    numbers: NDArray[Any] = pd.to_numeric(values, errors="coerce").to_numpy(dtype=np.float64)
    return np.asarray(numbers[np.isfinite(numbers)])


def _stands(values: NDArray[np.float64]) -> bool:
    """Return whether a voltage is nearly constant, as that of a supply."""
    if len(values) < 2:
        return False
    size = float(np.abs(values).max())
    return bool(np.ptp(values) < _LEAST_VARIATION * size) or math.isclose(size, 0.0)


def _reverses(values: NDArray[np.float64]) -> bool:
    """Return whether a signal reaches clearly positive and clearly negative values."""
    if len(values) == 0:
        return False
    low, high = float(values.min()), float(values.max())
    return min(-low, high) > _EITHER_WAY * max(-low, high)


def holds_time_stamps(values: pd.Series) -> bool:
    """Return whether most cells are text with a time of day."""
    if pd.api.types.is_numeric_dtype(values):
        return False
    return bool(values.astype(str).str.contains(r"\d:\d\d", regex=True).mean() > 0.9)
