"""What a report says of the ship's numbers: which moved, and which would explain a finding as well."""

from __future__ import annotations

import math
from typing import Any

from ..numbers.moved import MovedNumber
from ..numbers.wrong import WrongNumber
from ..outcome import Outcome
from .wording import breakable, number, parameter_words, superscript

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
