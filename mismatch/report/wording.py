"""Words and numbers of a report, as an engineer reads them; nothing here draws.

What a report says of the ship's numbers: which moved, and which would explain a finding as well.

A formula of what has no name, as data, as text and for the page.
"""

from __future__ import annotations

import math
import re
from typing import Any

from markupsafe import Markup, escape

from ...plant.columns import DEMANDS
from ...plant.signals import SIGNALS
from ..estimate import Estimate
from ..identification.parameters import MovedNumber, WrongNumber
from ..outcome import Outcome
from ..search.catalogue import Effect
from ..search.formulas import Formula

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


_SOURCES = {"calibrated": "told by the healthy period", "free": "free"}

INSIDE = 2.0
"""Standard deviations up to which a number is said to have moved inside its tolerance."""


def source_words(moved: MovedNumber) -> str:
    """Return how a number came to be another, in words that fit how far it moved."""
    if moved.source in _SOURCES:
        return _SOURCES[moved.source]
    if abs(moved.shifts) <= INSIDE:
        return "inside its tolerance"
    return f"beyond its tolerance, {abs(moved.shifts):.1f} times"


def numbers_as_dict(diagnosis: Outcome) -> dict[str, Any]:
    """``numbers`` of ``report.json``, by key, in its unit; ``moved`` is in standard deviations."""
    return {
        n.key: {
            "file": n.file, "value": n.value, "se": n.standard_error, "moved": n.shifts,
            "source": n.source, "corrected": n.corrected,
        }
        for n in diagnosis.numbers
    }  # fmt: skip


def wrong_of(diagnosis: Outcome, place: int) -> WrongNumber | None:
    """The number that would explain a finding as well, if there is one."""
    return diagnosis.wrong[place] if place < len(diagnosis.wrong) else None


def wrong_as_dict(wrong: WrongNumber | None) -> dict[str, Any] | None:
    """The same for ``report.json``."""
    if wrong is None:
        return None
    return {"key": wrong.key, "file": wrong.file, "value": wrong.value, "gain": wrong.gain}


def wrong_words(wrong: WrongNumber) -> str:
    """The same as a sentence."""
    file, value = (_as_in_the_file(size, wrong.unit) for size in (wrong.file, wrong.value))
    return f"A wrong {wrong.key} would explain it as well ({value}; the file has {file})."


def numbers_that_explain(diagnosis: Outcome) -> str:
    """Free numbers that were put right, in words; empty where none was."""
    return _changes([n for n in _corrected(diagnosis) if n.source == "free"])


def biased_parameters(diagnosis: Outcome) -> str:
    """Return the corrected parameters beyond three tolerances in words; empty where there are none."""
    return _changes([n for n in _corrected(diagnosis) if n.is_far])


def numbers_changed(diagnosis: Outcome) -> list[str]:
    """Return the names of the parameters of either kind; empty where there are none."""
    changed = [n for n in _corrected(diagnosis) if n.source == "free" or n.is_far]
    return [parameter_words(n.key.rpartition(".")[2], n.unit) for n in changed]


def _corrected(diagnosis: Outcome) -> list[MovedNumber]:
    return [n for n in diagnosis.numbers if n.corrected != n.file]


def _changes(numbers: list[MovedNumber]) -> str:
    """Return new and old values of parameters in words."""
    return " and ".join(
        f"{n.key} is {_as_in_the_file(n.corrected, n.unit)} in place of "
        f"{_as_in_the_file(n.file, n.unit)}"
        for n in numbers
    )


def _as_in_the_file(value: float, unit: str) -> str:
    """A number in its key's unit, without a prefix: as one would write it there."""
    return f"{number(value, 4)} {superscript(unit)}".strip()


def table_rows(diagnosis: Outcome) -> list[dict[str, str]]:
    """One row a number, for a terminal."""
    return [
        {
            "number": n.key,
            "file": f"{n.file:.5g}",
            "found": f"{n.value:.5g}",
            "se": "–" if math.isnan(n.standard_error) else f"{n.standard_error:.2g}",
            "unit": n.unit,
            "moved": f"{n.shifts:+.1f}",
            "corrected": f"{n.corrected:.5g}",
            "how": source_words(n),
        }
        for n in diagnosis.numbers
    ]


def page_rows(diagnosis: Outcome) -> list[dict[str, Any]]:
    """The same for the page."""
    return [
        {
            "key": breakable(n.key),
            "unit": superscript(n.unit) or "–",
            "file": number(n.file, 5),
            "value": number(n.value, 5),
            "error": _error(n),
            "moved": number(n.shifts, 2),
            "how": source_words(n),
            "corrected": number(n.corrected, 5),
        }
        for n in diagnosis.numbers
    ]


def _error(moved: MovedNumber) -> str:
    return "–" if math.isnan(moved.standard_error) else number(moved.standard_error, 2)


_ACTS_ON = {
    "drive": "demand on the drive",
    "inflow_velocity": "inflow to the propeller",
    "thrust": "thrust",
    "drive_torque": "torque of the drive",
    "load_torque": "torque of the load",
    "resistance": "resistance",
    "pitch_rate": "rate of the pitch",
    "side_force": "side force",
    "yaw_moment": "yaw moment",
}


def formula_sentence(formula: Formula) -> str:
    """What a formula says, with its coefficients and their intervals."""
    sizes = []
    for estimate in formula.estimates:
        low, high = (number(end) for end in estimate.ci95)
        unit = f" {superscript(estimate.unit)}".rstrip()
        sizes.append(f"{estimate.name} = {number(estimate.value)}{unit} (95 %: {low} to {high})")
    return (
        f"In the {formula.balance} balance the {_ACTS_ON[formula.term.acts_on]} changes as "
        f"{formula.words}, {', '.join(sizes)}."
    )


def better_sentence(formula: Formula) -> str:
    """How it stands to what the catalogue names."""
    return (
        f"it follows the recordings better than {', '.join(formula.better_than)}, by "
        f"{formula.ahead:.1f} in 2 log L beyond the thresholds: the truth may be near the name and has "
        "another form"
    )


def formula_as_dict(formula: Formula | None) -> dict[str, Any] | None:
    """As it stands in ``report.json``; None where there is none."""
    if formula is None:
        return None
    return {
        "balance": formula.balance,
        "acts_on": formula.term.acts_on,
        "expression": formula.term.expression,
        "coefficients": {e.name: e.to_dict() | {"unit": e.unit} for e in formula.estimates},
        "signals": list(formula.signals),
        "evidence": {
            "score": formula.gain,
            "threshold": formula.threshold,
            "held_out": formula.held_out,
        },
        "or_equally": list(formula.rivals),
        "better_than": list(formula.better_than),
        "sentence": formula_sentence(formula),
    }


def formula_lines(formula: Formula) -> list[str]:
    """As lines of text."""
    found = [
        formula_sentence(formula),
        f"evidence {formula.gain:.1f} in 2 log L, threshold {formula.threshold:.1f}; on the data set "
        f"aside {formula.held_out:.1f}",
    ]
    if formula.better_than:
        found.append(better_sentence(formula))
    return [*found, *(f"or equally {other}" for other in formula.rivals)]


def formula_for_page(formula: Formula | None) -> dict[str, Any] | None:
    """As the page reads it; None where there is none."""
    if formula is None:
        return None
    return {
        "sentence": formula_sentence(formula),
        "coefficients": [_row(estimate) for estimate in formula.estimates],
        "term": f"{formula.term.acts_on}: {formula.term.expression}",
        "score": number(formula.gain),
        "threshold": number(formula.threshold),
        "held_out": number(formula.held_out),
        "rivals": formula.rivals,
        "better": better_sentence(formula) if formula.better_than else "",
    }


def _row(estimate: Estimate) -> dict[str, str]:
    low, high = estimate.ci95
    return {
        "name": estimate.name,
        "value": number(estimate.value),
        "interval": f"{number(low)} to {number(high)}",
        "unit": superscript(estimate.unit),
    }
