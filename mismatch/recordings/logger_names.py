"""Recognise canonical columns and units in the column names of loggers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ...plant import Ship
from ...plant.columns import (
    ELECTRIC_POWER,
    HEADING,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    SWAY_SPEED,
    TIME,
    YAW_RATE,
)

ANY, RIG, MOVING = "any", "rig", "moving"
"""Ships to which a phrase applies: all ships, those with a fixed hull, those with a moving hull."""

PHRASES: dict[str, tuple[tuple[str, tuple[str, ...]], ...]] = {
    TIME: (
        (ANY, ("date time", "time stamp", "time", "t", "zeit", "stamp", "clock", "date", "elapsed")),
        (ANY, ("secs", "seconds", "sample", "index", "frame", "k")),
    ),
    "fuel_rack_mm": (
        (ANY, ("fuel rack", "rack", "fuel index", "load index", "load indicator", "index")),
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
        (ANY, ("omega", "angular velocity", "angular speed", "tacho", "revs", "rev", "n", "w")),
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
    SHAFT_POWER: ((ANY, ("shaft power", "mechanical power", "delivered power", "propeller power")),),
    ELECTRIC_POWER: ((ANY, ("electric power", "electrical power", "elec power", "input power")),),
    "motor_current_A": (
        (ANY, ("motor current", "armature current", "current", "strom", "ampere", "amps", "i")),
    ),
    "ship_speed_m_s": (
        (ANY, ("speed through water", "stw", "water speed", "log speed", "ship speed")),
        (ANY, ("vessel speed", "boat speed", "hull speed", "surge speed", "surge velocity", "surge")),
        (MOVING, ("u velo", "u velocity", "vhw speed", "log", "vs", "u")),
        (MOVING, ("sog", "speed over ground", "ground speed", "vtg speed", "speed")),
    ),
    "inflow_velocity_m_s": (
        (RIG, ("inflow velocity", "inflow speed", "inflow", "airspeed", "air speed", "tunnel speed")),
        (RIG, ("advance velocity", "advance speed", "flow speed", "flow velocity", "water speed", "va")),
    ),
    "fuel_flow_kg_s": ((ANY, ("fuel flow", "fuel rate", "fuel consumption")),),
    "propeller_submergence_m": ((ANY, ("propeller submergence", "submergence", "immersion")),),
    RUDDER_COMMAND: ((ANY, ("rudder", "helm", "delta")),),
    RUDDER: ((ANY, ("rudder angle", "rudder", "rsa", "helm", "delta")),),
    SWAY_SPEED: ((ANY, ("sway speed", "sway velocity", "sway", "lateral speed", "vm", "v")),),
    YAW_RATE: ((ANY, ("yaw rate", "rate of turn", "turn rate", "yaw velocity", "rot", "r")),),
    HEADING: ((ANY, ("heading", "hdt", "hdg", "psi", "yaw")),),
}  # fmt: skip
"""Phrases by canonical column, the most reliable first; the name must have all words of a phrase."""

DUTY = frozenset({"pwm", "duty", "esc", "throttle", "lever", "command", "governor"})
"""Words of a command that is a share of the range of a drive."""

COMMANDS = frozenset((
    "order", "ordered", "set", "setpoint", "cmd", "command", "demand", "demanded", "ref",
    "reference", "target", "goal", "desired",
))  # fmt: skip
"""Words of columns that hold a command."""
_ORDERED = {"cmd": "command", "ordered": "order", "demanded": "demand", "setpoint": "set"}

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
_NOT_WITH = {
    "motor_current_A": {"speed", "velocity", "direction"},
    SHAFT_SPEED: {"air", "airspeed", "water", "ship", "vessel", "boat", "ground", "log", "stw", "sog",
                  "yaw"},
    SHAFT_ANGLE: {"x", "y", "z", "rudder", "pitch"},
    "ship_speed_m_s": {"motor", "shaft", "prop", "propeller", "engine", "rotor", "air", "joint", "yaw"},
    "shaft_torque_N_m": {"speed"},
    "pitch_ratio": {"rate"},
    HEADING: {"rate", "velocity"},
    TIME: {"constant", "zone", "nsecs", "nanosec", "nsec"},
}  # fmt: skip
"""Words that exclude a canonical column although the name has one of its phrases."""

UNITS = (
    {unit: unit for unit in ("s", "ms", "us", "ns", "min", "h", "A", "mA", "V", "mV", "kV", "N", "kN",
                             "Nmm", "rad", "deg", "rpm", "rps", "Hz", "W", "kW", "mm", "cm", "m")}
    | dict.fromkeys(("sec", "secs", "seconds"), "s")
    | dict.fromkeys(("nsec", "nsecs", "nanosec"), "ns")
    | dict.fromkeys(("msec", "millis"), "ms")
    | dict.fromkeys(("volt", "volts"), "V")
    | dict.fromkeys(("amp", "amps"), "A")
    | dict.fromkeys(("Nm", "N_m"), "N m")
    | dict.fromkeys(("kNm", "kN_m"), "kN m")
    | dict.fromkeys(("rad_s", "radps", "rads", "rad_per_s", "rad_sec"), "rad/s")
    | dict.fromkeys(("deg_s", "degps", "dps", "deg_per_s"), "deg/s")
    | dict.fromkeys(("m_s", "mps", "m_per_s"), "m/s")
    | dict.fromkeys(("kn", "kt", "kts", "knot", "knots"), "knot")
    | dict.fromkeys(("kmh", "km_h", "kph"), "km/h")
    | dict.fromkeys(("pct", "percent", "perc"), "%")
    | {"degrees": "deg", "radians": "rad", "hz": "Hz", "kg_s": "kg/s", "newton": "N"}
)  # fmt: skip
"""Unit for each suffix of a name."""
_SPELLED = {"kmh": "km/h", "kph": "km/h", "rads": "rad/s", "kts": "knot", "mps": "m/s"}
"""Units in brackets that the unit registry does not know, or knows with another meaning."""
_LONG = 3
"""Fewest characters of a unit suffix whose case is ignored."""

_SIGNAL_K = {"navigation", "propulsion", "steering", "environment"}
"""Roots of Signal K paths, whose values have SI units and Hz."""
_SIGNAL_K_UNITS = {SHAFT_SPEED: "Hz", "ship_speed_m_s": "m/s", HEADING: "rad", RUDDER: "rad",
                   YAW_RATE: "rad/s", "shaft_torque_N_m": "N m"}  # fmt: skip


@dataclass(frozen=True)
class LoggerName:
    """Name of one column, split into words and a unit.

    Args:
        name: name in the file.
        words: all words in lower case.
        core: words without those of the unit.
        unit: unit that the file or the name states; else empty.
    """

    name: str
    words: tuple[str, ...]
    core: tuple[str, ...]
    unit: str

    @property
    def is_command(self) -> bool:
        """Whether the name has a word of a command."""
        return bool(COMMANDS & set(self.words))

    def unit_as(self, column: str) -> str:
        """Return the unit of the name for a canonical column; a Signal K path has a standard unit."""
        if not self.unit and self.words[0] in _SIGNAL_K:
            return _SIGNAL_K_UNITS.get(column, "")
        return self.unit


def split_name(name: str, stated: str = "") -> LoggerName:
    """Split a name into words and a unit; a number in brackets is an index and no unit.

    Example:
        >>> name = split_name("PropShaftSpeed_rpm")
        >>> name.words, name.unit
        (('prop', 'shaft', 'speed', 'rpm'), 'rpm')

    Args:
        name: name in the file.
        stated: unit in the row of units of the file; empty or ``-`` if the file states none.
    """
    bare, unit = name, stated if stated not in ("", "-") else ""
    bracket = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    if bracket and not bracket[1].strip().isdigit():
        bare = name[: bracket.start()]
        unit = unit or _SPELLED.get(bracket[1].strip(), bracket[1].strip())
    words = _split(bare)
    core = words
    parts = [part for part in re.split(r"[^0-9A-Za-zÀ-ÿ°%µμ]+", bare) if part]
    for length in (3, 2, 1):
        suffix = _unit_of("_".join(parts[-length:])) if len(parts) >= length else ""
        if suffix and (len(parts) > length or len(parts[0]) >= _LONG):
            kept = _split(" ".join(parts[:-length])) or words
            return LoggerName(name, words or (name.lower(),), kept, unit or suffix)
    if len(words) > 1 and len(words[-1]) >= _LONG and (suffix := _unit_of(words[-1])):  # camelCase
        return LoggerName(name, words, words[:-1], unit or suffix)
    turns = next((word for word in words if word in ("rpm", "rps")), "")
    return LoggerName(name, words or (name.lower(),), core or (name.lower(),), unit or turns)


def _split(name: str) -> tuple[str, ...]:
    """Return the words of a name, split at signs, at digits and at capital letters."""
    spaced = re.sub(r"(?<=[a-zà-ÿ])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    words = re.findall(r"[^\W\d_]+|\d+", spaced.lower())
    return tuple(_ORDERED.get(word, word) for word in words)


def _unit_of(suffix: str) -> str:
    if suffix in UNITS:
        return UNITS[suffix]
    return UNITS.get(suffix.lower(), "") if len(suffix) >= _LONG else ""


def rank(name: LoggerName, column: str, ship: Ship, ordered: bool) -> tuple[int, int] | None:
    """Return the rank of a name for a canonical column, lower for a better fit; None without a fit.

    A name with the word of a command fits a command only, and the commands of pitch and rudder need such
    a word.

    Args:
        name: name of a column of the file.
        column: canonical column.
        ship: the nominal ship; some phrases apply to a fixed hull only, others to a moving hull.
        ordered: whether the canonical column is a command.

    Returns:
        Index of the phrase in the list of phrases, and the number of further words in the name.
    """
    words = set(name.words)
    foreign = FOREIGN - {"power"} if column in (SHAFT_POWER, ELECTRIC_POWER) else FOREIGN
    if words & foreign or words & _NOT_WITH.get(column, set()) or (name.is_command and not ordered):
        return None
    if column in ("pitch_ratio_command", RUDDER_COMMAND) and not name.is_command:
        return None
    place = 0
    for ships, phrases in PHRASES.get(column, ()):
        for phrase in phrases:
            place += 1
            if ships != ANY and (ships == MOVING) != bool(ship.moves):
                continue
            if phrase == "command" and words & _QUANTITIES:
                continue
            if _has(name, phrase.split()):
                return place, len(name.core) - len(phrase.split())
    return None


def _has(name: LoggerName, phrase: Iterable[str]) -> bool:
    """Return whether a name has all words of a phrase; a single letter must be the whole name."""
    phrase = list(phrase)
    if phrase == [word for word in phrase if len(word) == 1]:
        rest = [w for w in name.core if w not in phrase and not w.isdigit()]
        return set(phrase) <= set(name.core) and all(w in _BESIDES for w in rest)
    if len(phrase) > 1 and "".join(phrase) in "".join(name.words):
        return True
    return all(any(_is(word, found) for found in name.words) for word in phrase)


_BESIDES = frozenset(
    ("raw", "measured", "meas", "volt", "velo", "velocity", "angvelo", "filtered", "hat", "state")
)
"""Words that a name of a single letter may have in addition."""


def _is(word: str, found: str) -> bool:
    if word == found:
        return True
    return (len(word) > _LONG or word == "rpm") and (found.startswith(word) or found.endswith(word))


def split_names(names: Iterable[str], units: Mapping[str, str]) -> dict[str, LoggerName]:
    """Return the names of a file, split into words and units, by name."""
    return {name: split_name(name, units.get(name, "")) for name in names}
