"""Words and numbers of a report, as an engineer reads them; nothing here draws."""

from __future__ import annotations

import math
import re

from markupsafe import Markup, escape

from ...plant.columns import DEMANDS
from ...plant.signals import SIGNALS
from ..search.effect import Effect

_NAMES = {
    s.column: (s.name.removeprefix("measured_").replace("_", " "), s.unit)
    for s in (*SIGNALS, *DEMANDS)
}


def number(value: float, digits: int = 3) -> str:
    """A number as it is read: thousands apart, powers of ten written out."""
    if math.isinf(value) or math.isnan(value):
        return "∞" if value > 0 else "−∞" if value < 0 else "?"
    if value == 0.0:
        return "0"
    power = int(f"{value:.{digits - 1}e}".split("e")[1])  # of the rounded number
    if -4 < power < 6:
        rounded = round(value, digits - 1 - power)
        apart = "," if abs(rounded) >= 1e4 else ""
        text = f"{rounded:{apart}.{max(0, digits - 1 - power)}f}".replace(",", " ")
    else:
        raised = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{value / 10.0**power:.{digits - 1}f}·10{raised}"
    return text.replace("-", "−")


def measure(value: float, unit: str) -> str:
    """A number with its unit, large forces and torques with a prefix: 13900 N m -> 13.9 kN m."""
    factor, shown = scaled(abs(value), unit) if math.isfinite(value) else (1.0, superscript(unit))
    return f"{number(value / factor)} {shown}".strip()


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which numbers of a size are read best: 20 000 N m are 20 kN m."""
    if unit.startswith("N"):
        for size, prefix in ((1e6, "M"), (1e3, "k")):
            if largest >= size:
                return size, prefix + superscript(unit)
    return 1.0, superscript(unit)


def superscript(unit: str) -> str:
    """A unit with raised powers, and nothing for a number that has none: ``kg m2`` is kg m²."""
    raised = re.sub(r"(?<=[a-z])2\b", "²", unit)
    return "" if raised == "-" else raised


def with_unit(words: str, unit: str) -> str:
    """Label of an axis."""
    return f"{words} [{unit}]" if unit else words


def channel_name(column: str) -> tuple[str, str]:
    """Name and unit of a column of the recording, for people."""
    name, unit = _NAMES.get(column, (column, ""))
    return name, superscript(unit)


def parameter_words(name: str, unit: str) -> str:
    """Name of a ship's key without the unit that it ends in."""
    suffix = "_" + re.sub(r"[ /]", "_", unit.partition(" = ")[0])
    return name.removesuffix(suffix).replace("_", " ")


def effect_words(effect: Effect) -> str:
    """An effect's name for people, as it stands in a sentence."""
    return effect.id.replace("-", " ").replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")


def capital(words: str) -> str:
    """Return words with a capital letter in front."""
    return words[:1].upper() + words[1:]


def listed(names: list[str]) -> str:
    """Return names in a row: a, b and c."""
    return " and ".join([part for part in (", ".join(names[:-1]), names[-1]) if part])


DAY_S, DAYS = 86400.0, 2.0
"""A day, and days from which on a time is given in them."""


def time_unit(longest: float) -> tuple[float, str]:
    """Seconds in a unit of time, and the unit, in which times up to some [s] are read best."""
    return (DAY_S, "days") if longest >= DAYS * DAY_S else (1.0, "s")


def span(start: float, end: float, word: str = "to", whole: bool = False) -> str:
    """A stretch of time: in whole seconds unless it is short, in days if it ends after :data:`DAYS`.

    Args:
        start: [s].
        end: [s].
        word: between the two.
        whole: whether seconds are whole however short the stretch is.
    """
    size, unit = time_unit(end)
    digits = 0 if size == 1.0 and (whole or end - start >= 20.0) else 1
    return f"{start / size:.{digits}f} {word} {end / size:.{digits}f} {unit}"


def spans(windows: list[tuple[float, float]], duration: float) -> str:
    """Windows of a recording in words."""
    if not windows:
        return "not located"
    if windows[0][0] <= 0.0 and windows[0][1] >= 0.98 * duration:
        return f"the whole recording, {span(0.0, duration)}"
    said = ", ".join(span(a, b) for a, b in windows[:6])
    return said + (f" and {len(windows) - 6} more" if len(windows) > 6 else "")


def breakable(key: str) -> Markup:
    """A key that a narrow column may break at its joints."""
    return Markup(re.sub(r"([._])", r"\1<wbr>", str(escape(key))))
