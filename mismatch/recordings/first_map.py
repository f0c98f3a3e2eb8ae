"""A column map to begin with, guessed from a file's names, units and cells."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import pandas as pd

from ...plant import Ship
from ...plant.columns import (
    BOUNDS,
    SHAFT_SPEED,
    TIME,
    answered_columns,
    foreign_columns,
    input_columns,
)
from .sources import PERCENT, PERCENT_OF_RANGE, Source

_WORDS = {
    TIME: ("time", "date", "stamp", "clock"),
    "fuel_rack_mm": ("fuel rack", "rack", "fuel index", "index"),
    "motor_voltage_V": ("voltage",),
    "pitch_ratio_command": ("pitch order", "pitch set", "pitch command", "pitch demand"),
    "pitch_ratio": ("pitch", "p/d"),
    SHAFT_SPEED: ("shaft speed", "rpm", "rev"),
    "shaft_torque_N_m": ("torque",),
    "thrust_N": ("thrust",),
    "shaft_power_W": ("shaft power",),
    "electric_power_W": ("electric power", "elec power", "elec_power"),
    "ship_speed_m_s": ("ship speed", "stw", "log", "speed through"),
    "rudder_rad": ("rudder",),
    "heading_rad": ("heading",),
}  # fmt: skip
"""What loggers call a column, the surest first."""

_TURNS = dict.fromkeys(("1/min", "min-1", "min^-1", "r/min", "U/min"), "rpm") | dict.fromkeys(
    ("1/s", "s-1", "Hz"), "rps"
)
"""How loggers write revolutions; a map has to say that it is they that are counted."""


def first_map(
    ship: Ship, left: pd.DataFrame, units: Mapping[str, str], taken: set[str]
) -> Iterator[str]:
    """Lines of a column map; what cannot be guessed stands there as a comment to be filled in.

    By the name, else by the unit where only one column of the file and one of the ship have its kind,
    and the time by its stamps.

    Args:
        ship: the nominal ship.
        left: columns of the file that are not understood.
        units: that the file states, by name.
        taken: canonical columns that the file has.
    """
    foreign = foreign_columns(ship)
    wanted = dict.fromkeys([*input_columns(ship), SHAFT_SPEED, *answered_columns(ship)])
    if not ship.has_variable_pitch:
        foreign.add("pitch_ratio")
    missing = [c for c in wanted if c not in taken and c not in foreign]
    stated = {name: units.get(name) or _in_brackets(name) for name in map(str, left.columns)}
    found: dict[str, str] = {}
    for column in [c for c in _WORDS if c in missing]:
        for word in _WORDS[column]:
            fits = [n for n in stated if n not in found and word in n.lower()]
            fits = fits or [n for n in stated if (column, n.split()[0].lower()) == (TIME, "t")]
            if fits:
                found[fits[0]] = column
                break
    for name in [n for n in stated if n not in found]:
        if TIME in missing and TIME not in found.values() and _is_stamps(left[name]):
            found[name] = TIME
    counted = [n for n in stated if _unit(SHAFT_SPEED, stated[n]).lower() in ("rpm", "rps")]
    if SHAFT_SPEED in missing and SHAFT_SPEED not in found.values() and len(counted) == 1:
        found.setdefault(counted[0], SHAFT_SPEED)
    open_names = [n for n in stated if n not in found and stated[n] not in ("", "-", *PERCENT)]
    open_columns = [c for c in missing if c not in found.values()]
    for name in open_names:
        kinds = [c for c in open_columns if _turns_into(stated[name], c)]
        rivals = [n for n in open_names if kinds and _turns_into(stated[n], kinds[0])]
        if len(kinds) == len(rivals) == 1:
            found[name] = kinds[0]
    if not stated or not missing:
        return
    yield "# a column map to begin with, guessed from names, units and cells"
    yield "[columns]"
    for name, column in sorted(found.items(), key=lambda pair: missing.index(pair[1])):
        yield f'"{name}" = {{ column = "{column}", unit = "{_unit(column, stated[name])}" }}'
    still = [f"{c} [{BOUNDS[c][2]}]" for c in missing if c not in found.values()]
    others = [name for name in stated if name not in found]
    if still and others:
        yield f"# not found yet: {', '.join(still)}"
        yield from (f'# "{n}" = {{ column = "?", unit = "{stated[n] or "?"}" }}' for n in others)


def _in_brackets(name: str) -> str:
    """The unit that a name ends with, as in ``speed [m/s]``; empty where there is none."""
    found = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    return found.group(1).strip() if found else ""


def _unit(column: str, stated: str) -> str:
    if column == TIME:
        return stated if stated in ("s", "min", "h", "ms") else "datetime"
    if column == SHAFT_SPEED:
        return _TURNS.get(stated, stated or "?")
    return PERCENT_OF_RANGE if stated == "%" else stated or "?"


def _turns_into(unit: str, column: str) -> bool:
    if column == TIME and unit not in ("s", "min", "h", "ms"):
        return False
    try:
        Source(column=column, unit=_unit(column, unit))
    except ValueError:
        return False
    return True


def _is_stamps(values: pd.Series) -> bool:
    """Whether most cells are text with a time of day in it."""
    if pd.api.types.is_numeric_dtype(values):
        return False
    return bool(values.astype(str).str.contains(r"\d:\d\d", regex=True).mean() > 0.9)
