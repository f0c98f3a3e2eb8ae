"""Split the column names of loggers into words and a unit."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ...plant.columns import COURSE, HEADING, OVER_GROUND, RUDDER, SHAFT_SPEED, YAW_RATE

COMMANDS = frozenset((
    "order", "ordered", "set", "setpoint", "cmd", "command", "demand", "demanded", "ref",
    "reference", "target", "goal", "desired", "soll", "sollwert", "vorgabe", "consigne",
))  # fmt: skip
"""Words of columns that hold a command."""
_SYNONYMS = {
    "cmd": "command", "ordered": "order", "demanded": "demand", "setpoint": "set", "cpp": "pitch",
    "draft": "draught", "fwd": "fore", "forward": "fore", "rel": "relative", "app": "apparent",
    "dir": "direction", "spd": "speed", "temp": "temperature", "hdg": "heading", "cons": "consumption",
    "fo": "fuel", "hfo": "fuel", "mdo": "fuel", "steigung": "pitch", "winkel": "angle",
    "geschw": "speed", "ruderlage": "rudder", "fahrt": "speed", "wasser": "water", "grund": "ground",
    "ist": "measured", "istwert": "measured", "actual": "measured", "feedback": "measured",
    "stigning": "pitch", "spoed": "pitch", "turtall": "rpm", "toerental": "rpm", "koppel": "torque",
    "couple": "torque", "vitesse": "speed", "fart": "speed", "snelheid": "speed",
    "puissance": "power", "vermogen": "power", "effekt": "power",
    "windwinkel": "wind angle", "windrichtung": "wind direction", "windgeschw": "wind speed",
    "windgeschwindigkeit": "wind speed", "wahre": "true", "wahrer": "true", "scheinbare": "apparent",
    "scheinbarer": "apparent", "wassertiefe": "water depth", "wassertemperatur": "water temperature",
}  # fmt: skip
"""Words of the phrases for each abbreviation, and for each word of another language."""

GROUND = frozenset(("sog", "ground", "vtg", "gps"))
"""Words of a speed over ground."""

WATER = frozenset(("stw", "water", "vhw"))
"""Words of a speed through the water."""

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
    | {"degrees": "deg", "radians": "rad", "hz": "Hz", "kg_s": "kg/s", "newton": "N", "MW": "MW"}
    | {"kg_h": "kg/h", "kgh": "kg/h", "l_h": "l/h", "lph": "l/h", "t_h": "t/h", "t_d": "t/day"}
    | {"degC": "degC"}
)  # fmt: skip
"""Unit for each suffix of a name."""
_SPELLED = {"kmh": "km/h", "kph": "km/h", "rads": "rad/s", "kts": "knot", "mps": "m/s"}
"""Units in brackets that the unit registry does not know, or knows with another meaning."""
LONG = 3  # fewest characters of a unit suffix whose case is ignored

_SIGNAL_K = {"navigation", "propulsion", "steering", "environment"}
"""Roots of Signal K paths, whose values have SI units and Hz."""
_SIGNAL_K_UNITS = {
    SHAFT_SPEED: "Hz",
    "ship_speed_m_s": "m/s",
    OVER_GROUND: "m/s",
    COURSE: "rad",
    "wind_speed_m_s": "m/s",
    "wind_angle_rad": "rad",
    "water_depth_m": "m",
    "water_temperature_C": "K",
    HEADING: "rad",
    RUDDER: "rad",
    YAW_RATE: "rad/s",
    "shaft_torque_N_m": "N m",
}


@dataclass(frozen=True)
class LoggerName:
    """Name of one column, split into words and a unit.

    Args:
        words: all words in lower case.
        core: words without those of the unit.
        unit: unit that the file or the name states; else empty.
    """

    words: tuple[str, ...]
    core: tuple[str, ...]
    unit: str

    @property
    def is_command(self) -> bool:
        """Whether the name has a word of a command."""
        return bool(COMMANDS & set(self.words))

    @property
    def is_over_ground(self) -> bool:
        """Whether the name has a word of a speed over ground."""
        return bool(GROUND & set(self.words))

    @property
    def is_through_water(self) -> bool:
        """Whether the name has a word of a speed through the water."""
        return bool(WATER & set(self.words))

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
    words = _split(bare) or (name.lower(),)
    parts = [part for part in re.split(r"[^0-9A-Za-zÀ-ÿ°%µμ]+", bare) if part]
    for length in (3, 2, 1):
        suffix = _unit_of("_".join(parts[-length:])) if len(parts) >= length else ""
        if suffix and (len(parts) > length or len(parts[0]) >= LONG):
            return LoggerName(words, _split(" ".join(parts[:-length])) or words, unit or suffix)
    if len(words) > 1 and len(words[-1]) >= LONG and (suffix := _unit_of(words[-1])):  # camelCase
        return LoggerName(words, words[:-1], unit or suffix)
    turns = next((word for word in words if word in ("rpm", "rps")), "")
    return LoggerName(words, words, unit or turns)


def _split(name: str) -> tuple[str, ...]:
    """Return the words of a name, split at signs, at digits and at capital letters."""
    spaced = re.sub(r"(?<=[a-zà-ÿ])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    words = re.findall(r"[^\W\d_]+|\d+", spaced.lower())
    return tuple(one for word in words for one in _SYNONYMS.get(word, word).split())


def _unit_of(suffix: str) -> str:
    folded = suffix.lower() if len(suffix) >= LONG else ""
    return UNITS.get(suffix) or UNITS.get(folded, "")
