"""Format values, units, windows of time, parameters and formulas for the reports."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup, escape

from ...plant.columns import DEMANDS
from ...plant.ship import Ship
from ...plant.signals import SIGNALS
from ..identification.parameters import BiasedParameter, ParameterChange
from ..outcome import Outcome
from ..search.catalogue import Effect
from ..search.formulas import Formula

_NAMES = {
    s.column: (s.name.removeprefix("measured_").replace("_", " "), s.unit)
    for s in (*SIGNALS, *DEMANDS)
}


def number(value: float, digits: int = 3) -> str:
    """Return a value as text with a number of significant digits.

    >>> number(13900.0), number(0.0123, 2), number(2.5e7)
    ('13 900', '0.012', '2.50·10⁷')
    """
    if math.isinf(value) or math.isnan(value):
        return "∞" if value > 0 else "−∞" if value < 0 else "?"
    if value == 0.0:
        return "0"
    power = int(f"{value:.{digits - 1}e}".split("e")[1])  # power of ten after rounding
    if -4 < power < 6:
        rounded = round(value, digits - 1 - power)
        apart = "," if abs(rounded) >= 1e4 else ""
        text = f"{rounded:{apart}.{max(0, digits - 1 - power)}f}".replace(",", " ")
    else:
        raised = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{value / 10.0**power:.{digits - 1}f}·10{raised}"
    return text.replace("-", "−")


LEAST_P = 0.002
"""p-value below which only this limit is printed: 500 simulated null cases confirm no smaller one."""


def p_value_in_words(value: float) -> str:
    """Return a p-value as text.

    >>> p_value_in_words(0.0042), p_value_in_words(1e-30)
    ('p = 0.0042', 'p < 0.002')
    """
    return f"p < {LEAST_P:g}" if value < LEAST_P else f"p = {value:.2g}"


def numbers(values: Sequence[float]) -> list[str]:
    """Return an estimate and the ends of its interval with digits enough to distinguish them.

    >>> numbers((19700.0, 19690.0, 19710.0))
    ['19 700', '19 690', '19 710']
    >>> numbers((0.25, 0.2, 0.3))
    ['0.250', '0.200', '0.300']
    """
    return [number(value, _digits(values)) for value in values]


def _digits(values: Sequence[float], least: int = 3, most: int = 6) -> int:
    """Return the number of significant digits that distinguish the values, within limits."""
    different = {value for value in values if math.isfinite(value)}
    for digits in range(least, most):
        if len({number(value, digits) for value in different}) == len(different):
            return digits
    return most


def value_with_unit(value: float, unit: str, digits: int = 3) -> str:
    """Return a value with its unit; large forces and torques get a prefix.

    >>> value_with_unit(13900.0, "N m"), value_with_unit(0.25, "-")
    ('13.9 kN m', '0.250')
    """
    factor, shown = scale_unit(abs(value) if math.isfinite(value) else 0.0, unit)
    return f"{number(value / factor, digits)} {shown}".strip()


def values_with_unit(values: Sequence[float], unit: str) -> list[str]:
    """Return an estimate and the ends of its interval as :func:`value_with_unit`, distinguishable.

    >>> values_with_unit((19700.0, 19690.0, 19710.0), "N")
    ['19.70 kN', '19.69 kN', '19.71 kN']
    """
    return [value_with_unit(value, unit, _digits(values)) for value in values]


def scale_unit(largest: float, unit: str) -> tuple[float, str]:
    """Return the factor and the unit for values of a size: 1000 and kN m for 20 000 N m."""
    if unit.startswith("N"):
        for size, prefix in ((1e6, "M"), (1e3, "k")):
            if largest >= size:
                return size, prefix + superscript(unit)
    return 1.0, superscript(unit)


def superscript(unit: str) -> str:
    """Return a unit with raised powers, ``kg m²`` for ``kg m2``; empty for a dimensionless value."""
    raised = re.sub(r"(?<=[a-z])2\b", "²", unit)
    return "" if raised == "-" else raised


def axis_label(words: str, unit: str) -> str:
    """Return the label of an axis with its unit in brackets."""
    return f"{words} [{unit}]" if unit else words


def channel_name(column: str) -> tuple[str, str]:
    """Return the name and the unit of a recording's column."""
    name, unit = _NAMES.get(column, (column, ""))
    return name, superscript(unit)


def parameter_words(name: str, unit: str) -> str:
    """Return the name of a parameter without the unit at its end."""
    suffix = "_" + re.sub(r"[ /]", "_", unit.partition(" = ")[0])
    return name.removesuffix(suffix).replace("_", " ")


def effect_words(effect: Effect) -> str:
    """Return the name of an effect for use in a sentence."""
    return effect.id.replace("-", " ").replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")


def capitalise(words: str) -> str:
    """Return words with a capital first letter and the rest unchanged."""
    return words[:1].upper() + words[1:]


_UNITS = "%|kn|N m|kN m|kW|W|t/d|kg/d|rpm|mm|m/s|min|s|days|V|Hz|N|kN|MN|rad/s"


def unbroken(words: str) -> str:
    r"""Return a text with no-break spaces inside numbers and before their units.

    >>> unbroken("13 900 kW at 15.9 kn").split(" ")
    ['13\xa0900\xa0kW', 'at', '15.9\xa0kn']
    """
    words = re.sub(r"(?<=\d) (?=\d{3}(?!\d))", "\xa0", words)
    return re.sub(rf"(?<=\d) (?=(?:{_UNITS})(?![\w/]))", "\xa0", words)


def join_words(names: list[str]) -> str:
    """Return names as a list in words: a, b and c."""
    return " and ".join([part for part in (", ".join(names[:-1]), names[-1]) if part])


DAY_S, DAYS = 86400.0, 2.0
"""Length of a day [s], and the number of days from which times are given in days."""


def time_unit(longest: float) -> tuple[float, str]:
    """Return the size [s] and the name of the unit for times up to ``longest`` [s]."""
    return (DAY_S, "days") if longest >= DAYS * DAY_S else (1.0, "s")


def time_span(start: float, end: float, word: str = "to", whole: bool = False) -> str:
    """Return an interval of time as text, in seconds or, if it ends after :data:`DAYS`, in days.

    Args:
        start: [s].
        end: [s].
        word: word between start and end.
        whole: whether the seconds of a short interval have no decimals.
    """
    size, unit = time_unit(end)
    digits = 0 if size == 1.0 and (whole or end - start >= 20.0) else 1
    return f"{start / size:.{digits}f} {word} {end / size:.{digits}f} {unit}"


def windows_in_words(windows: list[tuple[float, float]], duration: float) -> str:
    """Return windows of a recording in words."""
    if not windows:
        return "not located"
    if windows[0][0] <= 0.0 and windows[0][1] >= 0.98 * duration:
        return f"the whole recording, {time_span(0.0, duration)}"
    more = f" and {len(windows) - 6} more" if len(windows) > 6 else ""
    return ", ".join(time_span(a, b) for a, b in windows[:6]) + more


def breakable_key(key: str) -> Markup:
    """Return a dotted key that a browser may break after its dots and underscores."""
    return Markup(re.sub(r"([._])", r"\1<wbr>", str(escape(key))))


_SOURCES = {"calibrated": "estimated from the reference period", "free": "free"}

INSIDE = 2.0  # standard deviations up to which a parameter counts as inside its tolerance


def source_words(change: ParameterChange) -> str:
    """Return how a parameter was estimated, and whether it lies inside its tolerance."""
    if change.source in _SOURCES:
        return _SOURCES[change.source]
    if abs(change.shifts) <= INSIDE:
        return "inside its tolerance"
    return f"{abs(change.shifts):.1f} times its tolerance"


def parameters_as_dict(diagnosis: Outcome) -> dict[str, Any]:
    """Return ``numbers`` of ``report.json``: values in the keys' units, ``moved`` in tolerances."""
    return {
        n.key: {
            "file": n.file,
            "value": n.value,
            "se": n.standard_error,
            "moved": n.shifts,
            "source": n.source,
            "corrected": n.corrected,
        }
        for n in diagnosis.parameters
    }


def biased_parameters(diagnosis: Outcome) -> list[BiasedParameter | None]:
    """Return for each finding the parameter whose bias would explain it as well, or None."""
    count = len(diagnosis.findings)
    return [*diagnosis.biased, *[None] * count][:count]


def biased_parameter_sentence(biased: BiasedParameter) -> str:
    """Return the sentence on a parameter whose bias would explain a finding as well."""
    file, value = (_in_file_unit(size, biased.unit) for size in (biased.file, biased.value))
    return (
        f"A biased {biased.key} would explain the difference as well: {value} in place of {file} in "
        "the ship file."
    )


INERTIA = "transmission.inertia_"
"""Begin of the keys of the inertia of a shaft line."""


def corrected_parameters(
    diagnosis: Outcome, *, free: bool = False, far: bool = False
) -> list[ParameterChange]:
    """Return the corrected parameters that were free, or that lie far from the ship file.

    The inertia of a shaft line does not change after the reference period that determined it. A new
    estimate then stands for dynamics that the model lacks.
    """
    changed = [
        n
        for n in diagnosis.parameters
        if n.corrected != n.file and not (n.source == "calibrated" and n.key.startswith(INERTIA))
    ]
    return [n for n in changed if (free and n.source == "free") or (far and n.is_far)]


def percent(share: float) -> str:
    """Return a share in whole per cent; a small rest does not vanish.

    >>> percent(0.998), percent(0.002), percent(0.5), percent(1.0), percent(-0.1)
    ('more than 99 %', 'less than 1 %', '50 %', '100 %', '0 %')
    """
    share = max(share, 0.0)
    if 0.0 < share < 0.005:
        return "less than 1 %"
    return "more than 99 %" if 0.995 <= share < 1.0 else f"{100.0 * share:.0f} %"


CHANGED = "Changed since the reference period:"
"""Begin of a headline on parameters of :func:`changed_since_reference`."""


def changed_since_reference(parameters: Sequence[ParameterChange]) -> bool:
    """Return whether parameters were known from a reference period, so that the ship has changed."""
    return all(change.source == "calibrated" for change in parameters)


def corrections(parameters: list[ParameterChange]) -> str:
    """Return new and old values of parameters in words; empty without parameters."""
    return " and ".join(
        f"{n.key} is {_in_file_unit(n.corrected, n.unit)} in place of {_in_file_unit(n.file, n.unit)}"
        for n in parameters
    )


def _in_file_unit(value: float, unit: str) -> str:
    """Return a value in its key's unit without a prefix, as in the ship file."""
    return f"{number(value, 4)} {superscript(unit)}".strip()


def parameter_rows(diagnosis: Outcome) -> list[dict[str, str]]:
    """Return one table row for each parameter, for the terminal."""
    return [
        {
            "parameter": n.key,
            "ship file": f"{n.file:.5g}",
            "estimate": f"{n.value:.5g}",
            "se": "–" if math.isnan(n.standard_error) else f"{n.standard_error:.2g}",
            "unit": n.unit,
            "change": f"{n.shifts:+.1f}",
            "corrected ship": f"{n.corrected:.5g}",
            "source": source_words(n),
        }
        for n in diagnosis.parameters
    ]


def parameter_rows_for_page(diagnosis: Outcome) -> list[dict[str, Any]]:
    """Return one table row for each parameter, for the page."""
    return [
        {
            "key": breakable_key(n.key),
            "unit": superscript(n.unit) or "–",
            "file": number(n.file, 5),
            "value": number(n.value, 5),
            "error": "–" if math.isnan(n.standard_error) else number(n.standard_error, 2),
            "change": number(n.shifts, 2),
            "source": source_words(n),
            "corrected": number(n.corrected, 5),
        }
        for n in diagnosis.parameters
    ]


_ACTS_ON = {"drive": "command of the drive", "inflow_velocity": "inflow to the propeller"}
"""Words of the locations in the model whose names do not serve as words."""


def formula_sentence(formula: Formula) -> str:
    """Return a formula in words, with its coefficients, their units and intervals."""
    sizes = []
    for e in formula.estimates:
        value, *ends = numbers((e.value, *e.ci95))
        size = f"{e.name} = {value} {superscript(e.unit)}".rstrip()
        sizes.append(f"{size} (95 % interval: {' to '.join(ends)})")
    place = formula.term.acts_on
    where = _ACTS_ON.get(place, place.replace("_", " "))
    return (
        f"In the {formula.balance} balance the {where} changes as {formula.words}, with "
        f"{', '.join(sizes)}."
    )


def formula_advantage(formula: Formula) -> str:
    """Return by how much a formula fits better than the effects of the catalogue."""
    return (
        f"it fits the recordings better than {', '.join(formula.better_than)}: 2 Δ log L less the "
        f"threshold is {formula.ahead:.1f} higher. The missing physics may be close to this effect and "
        "have another form"
    )


def formula_as_dict(formula: Formula | None) -> dict[str, Any] | None:
    """Return ``formula`` of ``report.json``; None without a formula."""
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
    """Return a formula as lines of text: sentence, evidence and indistinguishable formulas."""
    return [
        formula_sentence(formula),
        f"evidence (2 Δ log L) {formula.gain:.1f}, threshold {formula.threshold:.1f}; on the held-out "
        f"data {formula.held_out:.1f}",
        *([formula_advantage(formula)] if formula.better_than else []),
        *(f"indistinguishable from {other}" for other in formula.rivals),
    ]


def formula_for_page(formula: Formula | None) -> dict[str, Any] | None:
    """Return the fields of a formula for the page; None without a formula."""
    if formula is None:
        return None
    coefficients = []
    for e in formula.estimates:
        value, *ends = numbers((e.value, *e.ci95))
        coefficients.append(
            {
                "name": e.name,
                "value": value,
                "interval": " to ".join(ends),
                "unit": superscript(e.unit),
            }
        )
    return {
        "sentence": formula_sentence(formula),
        "coefficients": coefficients,
        "term": f"{formula.term.acts_on}: {formula.term.expression}",
        "score": number(formula.gain),
        "threshold": number(formula.threshold),
        "held_out": number(formula.held_out),
        "rivals": formula.rivals,
        "better": formula_advantage(formula) if formula.better_than else "",
    }


def values_by_key(ship: Ship) -> dict[str, Any]:
    """Return the values of a ship file by dotted key, and the expressions of its terms by id."""

    def flat(tree: dict[str, Any], above: str = "") -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in tree.items():
            name = above + key
            found |= flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
        return found

    found = flat(ship.model_dump(exclude={"term"}))
    for term in ship.term:
        found[f"term.{term.id}"] = "; ".join(f"{where}: {what}" for where, what in term.expressions)
        for name, parameter in term.parameters.items():
            found[f"term.{term.id}.{name}"] = parameter.value
    return found
