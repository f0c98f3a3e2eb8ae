"""Draft a column map: recognise canonical columns and units in the columns of a logger's file.

A column is recognised by the words of its name. Its unit comes from the name, or else from the size of
its values.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant import Ship
from ...plant.columns import (
    BOUNDS,
    COLUMNS,
    COURSE,
    ELECTRIC_POWER,
    HEADING,
    LOG_COLUMNS,
    OVER_GROUND,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    SWAY_SPEED,
    TIME,
    TURNING_COLUMNS,
    YAW_RATE,
    absent_columns,
    drive_column,
    input_columns,
    simulated_columns,
)
from .columns import FUEL_FLOW, LINEAR, PERCENT, PERCENT_OF_RANGE, PITCHES, ColumnMap, Source
from .course import ANGLES
from .logger_names import GROUND, LONG, LoggerName, split_name
from .measured_pitch import PITCH, PITCH_COMMAND
from .unit_errors import HELMS, command_ranges, top_speed

Array = NDArray[np.float64]

ANY, RIG, MOVING = "any", "rig", "moving"
"""Ships to which a phrase applies: all ships, those with a fixed hull, those with a moving hull."""

PHRASES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    TIME: (
        (ANY, ("date time", "time stamp", "time", "t", "zeit", "stamp", "clock", "date", "elapsed")),
        (ANY, ("secs", "seconds", "sample", "index", "frame", "k")),
    ),
    "fuel_rack_mm": (
        (ANY, ("fuel rack", "rack", "fuel index", "load index", "load indicator", "index", "füllung")),
        (ANY, ("governor", "fuel command", "throttle", "lever", "command")),
    ),
    "motor_voltage_V": (
        (ANY, ("motor voltage", "armature voltage", "applied voltage", "motor volt", "motor v")),
        (ANY, ("voltage", "spannung", "volt", "u", "vir")),
        (ANY, ("pwm", "duty", "esc", "throttle", "lever", "command")),
    ),
    "motor_torque_N_m": (
        (ANY, ("motor torque", "torque command", "motor force", "force command", "effort command")),
        (ANY, ("force", "vir", "tau", "effort", "throttle", "lever", "command")),
    ),
    "pitch_ratio_command": (
        (ANY, ("pitch order", "pitch set", "pitch command", "pitch demand", "pitch")),
    ),
    "pitch_ratio": ((ANY, ("pitch ratio", "propeller pitch", "pitch", "p d")),),
    SHAFT_SPEED: (
        (ANY, ("shaft speed", "propeller speed", "prop speed", "optical speed", "prop n", "shaft rpm")),
        (ANY, ("propeller rpm", "prop rpm", "shaft velocity", "propeller velocity", "prop velocity")),
        (ANY, ("motor speed", "motor velocity", "joint velocity", "rotor speed", "engine speed")),
        (ANY, ("engine rpm", "motor rpm", "electrical speed", "revolutions", "rpm", "rps", "drehzahl")),
        (ANY, ("wellendrehzahl", "omega", "angular velocity", "angular speed", "tacho", "revs")),
        (ANY, ("rev", "n", "w")),
        (RIG, ("velocity", "speed", "qd", "dq")),
    ),
    SHAFT_ANGLE: (
        (ANY, ("shaft angle", "shaft position", "motor angle", "motor position", "joint position")),
        (RIG, ("theta", "angle", "position", "qm", "encoder", "q", "phi")),
    ),
    "shaft_torque_N_m": (
        (ANY, ("shaft torque", "propeller torque", "prop torque", "load torque", "torque")),
        (ANY, ("drehmoment", "moment", "effort", "q")),
    ),
    "thrust_N": ((ANY, ("thrust", "schub")),),
    SHAFT_POWER: (
        (ANY, ("shaft power", "mechanical power", "delivered power", "propeller power")),
        (MOVING, ("propulsion power", "engine power", "wellenleistung", "power", "ps")),
    ),
    ELECTRIC_POWER: ((ANY, ("electric power", "electrical power", "elec power", "input power")),),
    "motor_current_A": (
        (ANY, ("motor current", "armature current", "current", "strom", "ampere", "amps", "i")),
    ),
    "ship_speed_m_s": (
        (ANY, ("speed through water", "stw", "water speed", "log speed", "ship speed")),
        (ANY, ("vessel speed", "boat speed", "hull speed", "surge speed", "surge velocity", "surge")),
        (MOVING, ("u velo", "u velocity", "vhw speed", "log", "vs", "u")),
        (MOVING, ("speed",)),
    ),
    OVER_GROUND: ((MOVING, ("sog", "speed over ground", "ground speed", "vtg speed", "gps speed")),),
    COURSE: ((MOVING, ("cog", "course over ground", "vtg course", "course", "kurs")),),
    "wind_speed_m_s": (
        (MOVING, ("aws", "apparent wind speed", "relative wind speed", "rel wind speed")),
        (MOVING, ("wind speed", "wind")),
    ),
    "wind_angle_rad": (
        (MOVING, ("awa", "awd", "apparent wind angle", "apparent wind direction")),
        (MOVING, ("relative wind angle", "relative wind direction", "rel wind angle")),
        (MOVING, ("rel wind direction", "rel wind dir", "wind angle", "wind direction")),
    ),
    "true_wind_speed_m_s": ((MOVING, ("tws", "true wind speed")),),
    "true_wind_angle_rad": ((MOVING, ("twa", "true wind angle")),),
    "wind_height_m": ((MOVING, ("wind height", "anemometer height")),),
    "draught_fore_m": ((MOVING, ("draught fore", "tiefgang vorn", "draught f", "t fore")),),
    "draught_aft_m": ((MOVING, ("draught aft", "tiefgang hinten", "draught a", "t aft")),),
    "water_depth_m": ((MOVING, ("water depth", "depth below surface", "depth", "ukc")),),
    "water_temperature_C": (
        (MOVING, ("water temperature", "sea temperature", "seawater temperature", "sw temperature")),
    ),
    "inflow_velocity_m_s": (
        (RIG, ("inflow velocity", "inflow speed", "inflow", "airspeed", "air speed", "tunnel speed")),
        (RIG, ("advance velocity", "advance speed", "flow speed", "flow velocity", "water speed", "va")),
    ),
    FUEL_FLOW: (
        (ANY, ("fuel flow", "fuel rate", "fuel consumption", "fuel mass flow", "fuel volume flow")),
        (ANY, ("kraftstoff", "verbrauch")),
    ),
    "propeller_submergence_m": ((ANY, ("propeller submergence", "submergence", "immersion")),),
    RUDDER_COMMAND: ((ANY, ("rudder", "helm", "delta")),),
    RUDDER: ((ANY, ("rudder angle", "rudder", "rsa", "helm", "delta")),),
    SWAY_SPEED: ((ANY, ("sway speed", "sway velocity", "sway", "lateral speed", "vm", "v")),),
    YAW_RATE: ((ANY, ("yaw rate", "rate of turn", "turn rate", "yaw velocity", "rot", "r")),),
    HEADING: ((ANY, ("heading", "hdt", "gyro", "psi", "yaw")),),
}  # fmt: skip
"""Phrases by canonical column, the most reliable first; the name must have all words of a phrase."""

DUTY = frozenset({"pwm", "duty", "esc", "throttle", "lever", "command", "governor"})
"""Words of a command that is a share of the range of a drive."""

_QUANTITIES = frozenset((
    "torque", "speed", "pitch", "rudder", "heading", "thrust", "rpm", "position", "angle", "force",
    "current", "yaw", "course",
))  # fmt: skip
"""Words of a command of another quantity than the drive."""

FOREIGN = frozenset((
    "wind", "power", "temp", "temperature", "pressure", "vibration", "acceleration", "accel",
    "acc", "std", "test", "flag", "valid", "status", "mode", "error", "roll", "lat", "lon",
    "latitude", "longitude", "track", "depth", "energy", "efficiency", "quality", "count",
))  # fmt: skip
"""Words of columns that are no canonical columns."""
_ALLOWED = {
    SHAFT_POWER: {"power"},
    ELECTRIC_POWER: {"power"},
    COURSE: {"track"},
    "water_depth_m": {"depth"},
    "water_temperature_C": {"temp", "temperature"},
    **{column: {"wind"} for column in COLUMNS if "wind" in column},
}
"""Such words that a canonical column may have."""
_NOT_WITH = {
    "motor_current_A": {"speed", "velocity", "direction"},
    SHAFT_SPEED: {"air", "airspeed", "water", "ship", "vessel", "boat", "ground", "log", "stw", "sog",
                  "yaw"},
    SHAFT_ANGLE: {"x", "y", "z", "rudder", "pitch"},
    "ship_speed_m_s": {"motor", "shaft", "prop", "propeller", "engine", "rotor", "air", "joint", "yaw",
                       *GROUND},
    COURSE: {"speed", "steer"},
    "wind_speed_m_s": {"true", "direction", "angle", "height", "air"},
    "wind_angle_rad": {"true", "height"},
    "water_depth_m": {"propeller", "shaft", "tank", "mould", "moulded"},
    SHAFT_POWER: {"electric", "electrical", "elec", "battery", "generator", "aux", "hotel", "pto",
                  "supply", "rated", "max", "limit", "factor", "input"},
    "shaft_torque_N_m": {"speed"},
    "pitch_ratio": {"rate"},
    HEADING: {"rate", "velocity"},
    TIME: {"constant", "zone", "nsecs", "nanosec", "nsec"},
}  # fmt: skip
"""Words that exclude a canonical column although the name has one of its phrases."""

_NO_UNIT = ("-", "P/D", "p/d", "1", "none", "n/a", "dimensionless")
"""Units in the file of a column without a unit."""
_BESIDES = frozenset(
    ("raw", "measured", "meas", "volt", "velo", "velocity", "angvelo", "filtered", "hat", "state")
)
"""Words that a name of a single letter may have in addition."""

_TURNS = dict.fromkeys(
    ("1/min", "min-1", "min^-1", "r/min", "u/min", "rev/min", "rpm"), "rpm"
) | dict.fromkeys(("1/s", "s-1", "s^-1", "hz", "rev/s", "r/s", "rps"), "rps")
"""Unit of revolutions for each spelling of loggers."""
_COUNTS = ("rpm", "rps", "1/min", "min-1", "min^-1", "r/min", "u/min", "1/s", "hz")
"""Spellings that identify a shaft speed without its name."""
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
_LEAST_VARIATION = 0.1  # share of its size over which the voltage of a motor varies
_EITHER_WAY = 0.1  # share of its largest value that a reversing signal reaches with the other sign
_OPTIONAL = ("inflow_velocity_m_s", "propeller_submergence_m", RUDDER_COMMAND, *LOG_COLUMNS)
_FUEL_DENSITY = 850.0  # of marine diesel oil near the flow meter [kg/m3]


class _Fit(NamedTuple):
    """Column of the file that may be a canonical column, with its rank and its unit."""

    order: tuple[float, ...]
    name: str
    guess: Guess


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
    optional = _OPTIONAL
    if ship.moves and not ship.turns:  # The log of such a ship shows its turns.
        shown = (HEADING, YAW_RATE, RUDDER)
        foreign, optional = foreign - {*shown}, (*optional, *shown)
    for has, columns in (
        (ship.has_variable_pitch, {"pitch_ratio"}),
        (ship.has_propeller, {"inflow_velocity_m_s", "propeller_submergence_m"}),
        (ship.has_diesel, {FUEL_FLOW}),
        (ship.moves, {"ship_speed_m_s", *LOG_COLUMNS} - {FUEL_FLOW}),
    ):
        foreign |= set() if has else columns
    wanted = dict.fromkeys([*input_columns(ship), SHAFT_SPEED, *simulated_columns(ship), *optional])
    missing = [c for c in wanted if c not in taken and c not in foreign]
    left = left.rename(columns=str)
    left = left[[name for name in left if name not in ship.external_signals]]
    names = {name: split_name(name, units.get(name, "")) for name in map(str, left.columns)}
    if not names or not missing:
        return
    found = _by_name(ship, left, names, missing)
    _by_cells(ship, left, names, missing, found)
    if OVER_GROUND in found or OVER_GROUND in taken:  # It stands for the speed through water.
        missing = [c for c in missing if c != "ship_speed_m_s" or c in found]
    if PITCH in found or PITCH in taken:  # The measured pitch may stand for the command.
        missing = [c for c in missing if c != PITCH_COMMAND or c in found]
    if RUDDER in found or RUDDER in taken:  # The rudder angle may be the rudder command as well.
        missing = [c for c in missing if c != RUDDER_COMMAND]
    shaft = {SHAFT_SPEED, SHAFT_ANGLE}
    if shaft & {*taken, *found}:
        missing = [c for c in missing if c not in shaft or c in found]
    yield "# draft of a column map, from names, units and values: check each line"
    yield "[columns]"
    for column in sorted(found, key=[*wanted].index):
        choice = found[column]
        yield _line(choice.name, column, choice.guess)
        if choice.rivals:
            yield f"# also possible as {column}: {', '.join(choice.rivals)}"
    chosen = {choice.name for choice in found.values()}
    still = [f"{c} [{BOUNDS[c][2]}]" for c in missing if c not in found and c not in optional]
    others = [name for name in names if name not in chosen]
    if still and others:
        yield f"# still missing: {', '.join(still)}"
        for name in others:
            yield f'# {_quoted(name)} = {{ column = "?", unit = "{names[name].unit or "?"}" }}'


def with_given_map(given: ColumnMap, draft: Sequence[str]) -> list[str]:
    """Return the lines of a map that has the entries of a given map and those of a draft.

    Example:
        >>> given = ColumnMap.model_validate({"file": {"header_row": 3}, "columns": {"t": "time_s"}})
        >>> for line in with_given_map(given, ["[columns]", '"n" = { column = "shaft_speed_rad_s" }']):
        ...     print(line)
        [file]
        header_row = 3
        [columns]
        "t" = { column = "time_s" }
        "n" = { column = "shaft_speed_rad_s" }
    """
    entries = given.model_dump(exclude_unset=True)
    lines = [line for line in draft if line.startswith("# draft")]
    for table in ("file", "rows"):
        if values := entries.get(table):
            lines += [f"[{table}]", *(f"{key} = {_value(value)}" for key, value in values.items())]
    if entries.get("signals"):
        lines += ["[signals]", *_entries(entries["signals"])]
    own = [line for line in draft if not line.startswith(("# draft", "[columns]"))]
    return [*lines, "[columns]", *_entries(entries.get("columns", {})), *own]


def _entries(entries: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the lines of a table of a map."""
    for name, keys in entries.items():
        yield f"{_quoted(name)} = {{ {', '.join(f'{k} = {_value(v)}' for k, v in keys.items())} }}"


def _value(value: Any) -> str:
    """Return a value of a map as TOML."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{k} = {_value(v)}' for k, v in value.items())} }}"
    return json.dumps(value, ensure_ascii=False)


def _by_name(
    ship: Ship, left: pd.DataFrame, names: Mapping[str, LoggerName], missing: list[str]
) -> dict[str, _Choice]:
    """Choose for each canonical column the column of the file with the best-fitting name."""
    drive = drive_column(ship)
    ordered = {drive, "pitch_ratio_command", RUDDER_COMMAND}
    reverses = any(
        rank(split, column, bool(ship.moves), False) is not None and _reverses(_numbers(left[name]))
        for name, split in names.items()
        for column in (SHAFT_SPEED, "thrust_N", "shaft_torque_N_m")
    )
    fits: dict[str, list[_Fit]] = {}
    for column in missing:
        for name, split in names.items():
            place = rank(split, column, bool(ship.moves), column in ordered)
            values = _numbers(left[name])
            # The column holds text, such as the source of a speed.
            is_text = column != TIME and len(values) < len(left) / 2
            # A power of 0 throughout comes from an instrument that is not connected.
            is_dead = column in (SHAFT_POWER, ELECTRIC_POWER) and not np.any(values)
            if place is None or is_text or is_dead:
                continue
            guess = guess_unit(split, column, ship, values, left[name], reverses)
            if guess is None:
                continue
            # A measured shaft speed is preferred to a commanded one.
            late = split.is_command and column == SHAFT_SPEED
            still = column == "motor_voltage_V" and not DUTY & {*split.words} and _stands(values)
            fits.setdefault(column, []).append(_Fit((late, still, *place), name, guess))
    if SHAFT_SPEED in fits or SHAFT_SPEED not in missing:
        fits.pop(SHAFT_ANGLE, None)  # It adds nothing to the speed and may restart each turn.
    fewest: dict[str, float] = {}  # words of each name that its best canonical column leaves
    for fit in (fit for those in fits.values() for fit in those):
        fewest[fit.name] = min(fit.order[-1], fewest.get(fit.name, math.inf))
    found: dict[str, _Choice] = {}
    taken: set[str] = set()
    for column in sorted(fits, key=lambda c: (c not in ordered, COLUMNS.index(c))):
        free = [fit for fit in sorted(fits[column], key=lambda f: f.order) if fit.name not in taken]
        better = [fit for fit in free if fit.order[-1] <= fewest[fit.name]]
        if not free:
            continue
        best = (better or free)[0]
        found[column] = _Choice(best.name, best.guess, [f.name for f in free if f is not best])
        taken.add(best.name)
    for choice in found.values():  # Columns chosen elsewhere are no longer alternatives.
        rivals = [name for name in choice.rivals if name not in taken]
        choice.rivals = [f"{_quoted(n)} ({names[n].unit or 'no unit'})" for n in rivals]
    return found


def _by_cells(
    ship: Ship,
    left: pd.DataFrame,
    names: Mapping[str, LoggerName],
    missing: list[str],
    found: dict[str, _Choice],
) -> None:
    """Add the columns that are recognised by time stamps or by their unit alone."""

    def guess(name: str, column: str) -> Guess | None:
        return guess_unit(names[name], column, ship, _numbers(left[name]))

    def rest() -> list[str]:
        chosen = {choice.name for choice in found.values()}
        return [name for name in names if name not in chosen]

    stamped = [name for name in rest() if holds_time_stamps(left[name])]
    if TIME in missing and TIME not in found and stamped:
        found[TIME] = _Choice(stamped[0], Guess("datetime"))
    counted = [name for name in rest() if names[name].unit.lower() in _COUNTS]
    wanted = SHAFT_SPEED in missing and SHAFT_SPEED not in found and len(counted) == 1
    if wanted and (speed := guess(counted[0], SHAFT_SPEED)) is not None:
        found[SHAFT_SPEED] = _Choice(counted[0], speed)
    optional = _OPTIONAL if ship.turns else (*_OPTIONAL, *TURNING_COLUMNS)
    columns = [c for c in missing if c not in found and c not in optional]
    if ship.moves:  # Of a ship's angles none is likely that of the shaft.
        columns = [c for c in columns if c != SHAFT_ANGLE]
    pairs = [
        (name, column, own)
        for name in rest()
        for column in columns
        if names[name].unit not in ("", "-", *PERCENT) and (own := guess(name, column)) is not None
    ]
    for name, column, own in pairs:
        if sum(n == name for n, _, _ in pairs) == sum(c == column for _, c, _ in pairs) == 1:
            found[column] = _Choice(name, own._replace(doubt="guessed from the unit alone"))


def _line(name: str, column: str, guess: Guess) -> str:
    """Return the line of a map, with a comment if the unit is doubtful."""
    parts = [f'column = "{column}"', f'unit = "{guess.unit}"', *guess.more]
    comment = f"  # {guess.doubt}" if guess.doubt else ""
    return f"{_quoted(name)} = {{ {', '.join(parts)} }}{comment}"


def _quoted(name: str) -> str:
    """Return a name as a TOML string."""
    return json.dumps(name, ensure_ascii=False)


def _numbers(values: pd.Series) -> Array:
    """Return the finite numbers of a column, (m,)."""
    numbers: NDArray[Any] = pd.to_numeric(values, errors="coerce").to_numpy(dtype=np.float64)
    return np.asarray(numbers[np.isfinite(numbers)])


def _stands(values: Array) -> bool:
    """Return whether a voltage is nearly constant, as that of a supply."""
    if len(values) < 2:
        return False
    size = float(np.abs(values).max())
    return bool(np.ptp(values) < _LEAST_VARIATION * size) or size == 0.0


def _reverses(values: Array) -> bool:
    """Return whether a signal reaches clearly positive and clearly negative values."""
    low, high = float(np.min(values, initial=0.0)), float(np.max(values, initial=0.0))
    return min(-low, high) > _EITHER_WAY * max(-low, high)


def holds_time_stamps(values: pd.Series) -> bool:
    """Return whether most cells are text with a time of day."""
    if pd.api.types.is_numeric_dtype(values):
        return False
    return bool(values.astype(str).str.contains(r"\d:\d\d", regex=True).mean() > 0.9)


class Guess(NamedTuple):
    """Guessed unit of a column, further keys of its line in the map, and the reason for a doubt."""

    unit: str
    more: tuple[str, ...] = ()
    doubt: str = ""


def guess_unit(
    name: LoggerName,
    column: str,
    ship: Ship,
    values: Array,
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
    if not stated or stated in _NO_UNIT:
        return _from_size(name, column, ship, values)
    if column == FUEL_FLOW and (volume := _is_volume_flow(stated)) is not None:
        return volume
    if column == SHAFT_SPEED:
        stated = _TURNS.get(stated.lower(), stated)
    if stated in PERCENT:
        return _percent(column, ship)
    if _is_unit_of(stated, column):
        doubt = "Signal K convention: SI units, revolutions in Hz" if not name.unit else ""
        if "electrical" in name.words and column == SHAFT_SPEED:
            doubt = "from the motor controller; right only if the logger knows the number of poles"
        return Guess(stated, (), doubt or _meaning_doubt(name, column))
    linear = not ship.moves and not ship.has_propeller
    if linear and BOUNDS[column][2] in LINEAR and _is_unit_of(stated, column, 1.0):
        doubt = "a linear axis: set the radius, or keep 1 m and use masses as inertias of the ship"
        return Guess(stated, ("radius_m = 1.0",), doubt)
    return None


def _percent(column: str, ship: Ship) -> Guess | None:
    """Return the guess for a share of a range; 100 % of a pitch is often the design pitch."""
    if column not in command_ranges(ship):
        return None
    if column not in PITCHES:
        return Guess(PERCENT_OF_RANGE)
    highest = command_ranges(ship)[column][1]
    doubt = (
        f"100 % assumed to be the highest P/D, {highest:.4g}; if it is the design P/D: "
        'unit = "percent", scale = design P/D'
    )
    return Guess(PERCENT_OF_RANGE, (), doubt)


def _time(stated: str, values: Array, cells: pd.Series | None) -> Guess | None:
    if cells is not None and pd.api.types.is_datetime64_any_dtype(cells):
        return Guess("datetime")
    text = cells is not None and not pd.api.types.is_numeric_dtype(cells)
    if text and cells is not None and len(values) < len(cells) / 2:
        return Guess("datetime")
    if stated in _TIMES:
        repeats = bool((np.diff(values) == 0.0).any())
        coarse = "whole seconds: several rows in one are spread evenly" if repeats else ""
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


def _opening(stated: str, values: Array, top: float, unit: str, reverses: bool) -> Guess | None:
    """Return the unit of a command that is a share of its range: a pulse width, a fraction or percent.

    The end stop ``top`` of the drive is in its canonical ``unit``.
    """
    if len(values) == 0:
        return None
    low, high = float(values.min()), float(values.max())
    if stated in PERCENT:
        return Guess(PERCENT_OF_RANGE)
    if stated not in ("", "-", "us", "µs", "μs"):
        return None
    if low >= _PULSE_US[0] and high <= _PULSE_US[1]:
        one_way, both_ways = ("scale = 0.1", "offset = -100"), ("scale = 0.2", "offset = -300")
        rests = abs(values[0] - _NEUTRAL_US) < _SPAN_US
        if low < _NEUTRAL_US - _SPAN_US and (reverses or rests):
            more, other = both_ways, one_way
            doubt = "1500 assumed for 0, 1000 and 2000 for the ends; without reversals"
        else:
            more, other = one_way, both_ways
            doubt = "1000 assumed for 0 and 2000 for the upper limit; with reversals"
        return Guess(PERCENT_OF_RANGE, more, f"pulse in us: {doubt}: {', '.join(other)}")
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


def _from_size(name: LoggerName, column: str, ship: Ship, values: Array) -> Guess | None:
    """Return the unit that the size of the values suggests, with the reason for a doubt."""
    unit = {"N m": "N m", "-": "dimensionless"}.get(BOUNDS[column][2], BOUNDS[column][2])
    size = float(np.percentile(np.abs(values), 95)) if len(values) else 0.0
    if column == SHAFT_SPEED:
        return _speed(name, ship, size)
    if column in HELMS:
        unit = "deg" if size > float(ship.record()["rudder_max"]) * 1.25 else "rad"
    elif column == YAW_RATE and {"rot", "turn"} & {*name.words}:
        unit = "deg/min"
    elif column in ANGLES:
        unit = "deg" if size > _A_TURN else "rad"
    elif column in command_ranges(ship) and BOUNDS[column][2] == "-" and size > BOUNDS[column][1]:
        unit = PERCENT_OF_RANGE
    elif column in PITCHES and name.unit in _NO_UNIT:
        return Guess("dimensionless")
    doubt = f"unit not stated: {unit} assumed"
    if BOUNDS[column][2] == "m/s":
        doubt += "; knot is also common"
    if meaning := _meaning_doubt(name, column):
        doubt += f"; {meaning}"
    return Guess(unit, (), doubt)


def _meaning_doubt(name: LoggerName, column: str) -> str:
    """Return the doubt about the meaning of a column of a ship's log; empty if it is clear."""
    words = {*name.words}
    if column.startswith("wind_") and not {"apparent", "relative", "aws", "awa"} & words:
        return "assumed to be relative to the ship"
    if column == "water_depth_m" and not {"water"} & words:
        return "if it is the depth below the keel, add the draught as offset"
    if column == SHAFT_POWER and not {"shaft", "propeller"} & words:
        return "assumed to be the power of the shaft of the model"
    return ""


def _is_volume_flow(unit: str) -> Guess | None:
    """Return the guess for a fuel flow by volume; None for another unit."""
    try:
        Source(column=FUEL_FLOW, unit=unit, density_kg_m3=_FUEL_DENSITY)
        if _is_unit_of(unit, FUEL_FLOW):
            return None
    except ValueError:
        return None
    doubt = "density at the flow meter assumed: see the bunker note"
    return Guess(unit, (f"density_kg_m3 = {_FUEL_DENSITY:g}",), doubt)


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


def rank(name: LoggerName, column: str, moves: bool, ordered: bool) -> tuple[int, int] | None:
    """Return the rank of a name for a canonical column, lower for a better fit; None without a fit.

    A name with the word of a command fits a command only (``ordered``), and the commands of pitch and
    rudder need such a word. Some phrases apply to a fixed hull only, others to a hull that ``moves``.

    Returns:
        Index of the phrase in the list of phrases, and the number of further words in the name.
    """
    words = set(name.words)
    foreign = FOREIGN - _ALLOWED.get(column, set())
    if words & foreign or words & _NOT_WITH.get(column, set()) or (name.is_command and not ordered):
        return None
    if column in ("pitch_ratio_command", RUDDER_COMMAND) and not name.is_command:
        return None
    every = [(ships, one) for ships, phrases in PHRASES.get(column, ()) for one in phrases]
    for place, (ships, phrase) in enumerate(every, 1):
        other_ship = ships != ANY and (ships == MOVING) != moves
        other_quantity = phrase == "command" and words & _QUANTITIES
        if not other_ship and not other_quantity and _has(name, phrase.split()):
            return place, len(name.core) - len(phrase.split())
    return None


def _has(name: LoggerName, phrase: list[str]) -> bool:
    """Return whether a name has all words of a phrase; a single letter must be the whole name."""
    if all(len(word) == 1 for word in phrase):
        rest = [w for w in name.core if w not in phrase and not w.isdigit()]
        return set(phrase) <= set(name.core) and all(w in _BESIDES for w in rest)
    if len(phrase) > 1 and "".join(phrase) in "".join(name.words):
        return True

    def is_word(word: str, found: str) -> bool:
        part = found.startswith(word) or found.endswith(word)
        return word == found or ((len(word) > LONG or word == "rpm") and part)

    return all(any(is_word(word, found) for found in name.words) for word in phrase)
