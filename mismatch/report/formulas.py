"""A formula of what has no name, as data, as text and for the page."""

from __future__ import annotations

from typing import Any

from ..estimate import Estimate
from ..search.formulas import Formula
from .wording import number, superscript

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
