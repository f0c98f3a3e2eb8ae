"""A diagnosis as sentences: the line on top of the report, and one for each finding."""

from __future__ import annotations

import math

import numpy as np

from ..judge.findings import Finding
from ..judge.verdict import EXPLAINED, NOTHING, PARTLY, BalanceVerdict
from ..outcome import Outcome
from .formulas import formula_sentence
from .numbers import biased_parameters, numbers_that_explain
from .wording import measure, parameter_words, span

NEUTRAL = (0.0, 1.0)
"""Values at which an effect is absent that a reader knows without the ship file."""


def between(windows: list[tuple[float, float]]) -> str:
    """Windows in words."""
    if not windows:
        return ""
    parts = [span(a, b, "and", whole=True) for a, b in windows[:3]]
    more = f", and in {len(windows) - 3} more windows" if len(windows) > 3 else ""
    return "between " + ", between ".join(parts) + more


def finding_sentence(finding: Finding) -> str:
    """What an effect means, with its parameters and their intervals."""
    effect = finding.effect
    sizes = []
    for estimate in finding.estimates:
        unit = estimate.unit
        low, high = (measure(end, unit) for end in estimate.ci95)
        size = f"{measure(estimate.value, unit)} (95 %: {low} to {high})"
        if estimate.neutral not in NEUTRAL and math.isfinite(estimate.neutral):
            size += f", where the ship file has {measure(estimate.neutral, unit)}"
        if finding.unmeasured:
            size = f"about {measure(estimate.value, unit)}"
        alone = len(finding.estimates) == 1
        sizes.append(size if alone else f"{parameter_words(estimate.name, unit)} {size}")
    subject = "instrument" if effect.balance == "sensor" else f"{effect.balance} balance"
    where = f", {finding.regime}," if finding.regime else ""
    when = between(finding.windows)
    guess = f" ({finding.unmeasured}: no interval)" if finding.unmeasured else ""
    if finding.implausible:
        guess += f"; {finding.implausible}, so another cause is likely"
    said = f"{when[:1].upper()}{when[1:]}{where} the {subject} {what_is_missing(finding)}"
    return f"{said}, {', '.join(sizes)}{guess}."


def what_is_missing(finding: Finding) -> str:
    """Return what a balance lacks, or, of a value below the neutral one, what it has too much of."""
    effect, first = finding.effect, finding.estimates[0]
    if math.isfinite(first.neutral) and first.value < first.neutral:
        return f"has {effect.excess or f'too much of this: {effect.lacks}'}"
    return f"lacks {effect.lacks}"


def partly_left(diagnosis: Outcome) -> list[BalanceVerdict]:
    """Balances in which a partly explained recording leaves more than noise; none of another verdict."""
    if diagnosis.verdict != PARTLY:
        return []
    return [b for b in diagnosis.balance_verdicts if b.left is not None and b.verdict != EXPLAINED]


def left_sentence(balance: BalanceVerdict) -> str:
    """What a balance leaves."""
    share = max(1.0 - balance.explained, 0.0)
    if share >= 1.0:
        return f"In the {balance.name} balance nothing of it is explained."
    return f"In the {balance.name} balance {100.0 * share:.0f} % of the power beyond noise is left."


def differs(diagnosis: Outcome) -> bool:
    """Whether any balance shows more than noise."""
    return any(b.left is not None for b in diagnosis.balance_verdicts)


def sentence(diagnosis: Outcome) -> str:
    """The answer in one sentence."""
    limits = "; ".join(diagnosis.limits)
    if diagnosis.verdict in (EXPLAINED, PARTLY):
        named = " ".join(finding_sentence(f) for f in diagnosis.findings)
        return " ".join([named, *(left_sentence(b) for b in partly_left(diagnosis))])
    if diagnosis.verdict == NOTHING:
        if right := numbers_that_explain(diagnosis):
            return (
                f"Nothing is missing once the numbers are right: {right}. The simulation then differs "
                "from the recording by no more than noise and tolerances allow."
            )
        said = (
            "Nothing is missing: the simulation differs from the recording by no more than noise and "
            "the tolerances of the ship's numbers allow."
        )
        return f"{said} Mind that the recording is limited: {limits}." if limits else said
    shape = diagnosis.shape
    if diagnosis.undecidable and not differs(diagnosis):
        return f"Cannot be decided, because {limits}."
    if limits and not diagnosis.excited:
        return f"Something differs; which effect it is cannot be decided, because {limits}."
    if diagnosis.formula is not None:
        return f"Something is missing that has no name. {formula_sentence(diagnosis.formula)}"
    if shape is None:
        unknown = "Something is missing that the catalogue does not name."
        if biased := biased_parameters(diagnosis):
            return f"{unknown} Parameters of the ship file are biased: {biased}."
        return unknown
    signal = shape.signal.replace("_", " ")
    low, high = float(np.min(shape.values)), float(np.max(shape.values))
    if high <= 0.0:
        much = f"has {measure(-high, shape.unit)} to {measure(-low, shape.unit)} too much"
    else:
        much = f"lacks {measure(low, shape.unit)} to {measure(high, shape.unit)}"
    return (
        f"Something is missing that has no name: the {shape.balance} balance {much}, depending on "
        f"{signal}."
    )
