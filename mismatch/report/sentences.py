"""A diagnosis as sentences: the headline of the report, the answer, and one for each finding."""

from __future__ import annotations

import math

import numpy as np

from ..judge.findings import Finding
from ..judge.verdict import EXPLAINED, NOTHING, PARTLY, UNEXPLAINED, BalanceVerdict
from ..outcome import Outcome
from .formulas import formula_sentence
from .numbers import biased_parameters, numbers_changed, numbers_that_explain
from .wording import effect_words, listed, measure, parameter_words, span

NEUTRAL = (0.0, 1.0)
"""Values at which an effect is absent that a reader knows without the ship file."""

MOST_WORDS = 15
"""Words of a headline, at most."""

VERDICT_WORDS = {
    EXPLAINED: "explained",
    PARTLY: "partly explained",
    NOTHING: "nothing missing",
    UNEXPLAINED: "unexplained",
    "undecided": "cannot be decided",
}
"""A verdict, or that there is none, in words."""


def status(diagnosis: Outcome) -> str:
    """Return the verdict, or ``undecided`` where the recording's limits do not allow one."""
    undecided = diagnosis.limits and (diagnosis.undecidable or not diagnosis.excited)
    return "undecided" if undecided and diagnosis.verdict == UNEXPLAINED else diagnosis.verdict


def headline(diagnosis: Outcome) -> str:
    """Return the answer in at most :data:`MOST_WORDS` words; sizes stand in the table of findings."""
    verdict = VERDICT_WORDS[status(diagnosis)].capitalize()
    if diagnosis.verdict in (EXPLAINED, PARTLY):
        names = dict.fromkeys(effect_words(f.effect) for f in diagnosis.findings)
        return _shortened(f"{verdict} by", list(names))
    if wrong := numbers_changed(diagnosis):
        left = "; more is missing" if differs(diagnosis) else ""
        return _shortened("The ship file is wrong in", wrong, left)
    if diagnosis.verdict == NOTHING:
        return f"{verdict}: the difference is within noise and the tolerances of the ship file."
    if status(diagnosis) != UNEXPLAINED:
        return f"{verdict}: the recording is too short or excites too little."
    if diagnosis.formula is not None:
        return f"{verdict}: no effect of the catalogue fits; a formula describes what is missing."
    if diagnosis.shape is not None:
        return f"{verdict}: the {diagnosis.shape.balance} balance lacks something without a name."
    return f"{verdict}: no effect of the catalogue fits."


def _shortened(begin: str, names: list[str], end: str = "") -> str:
    """Return a headline with as many names as it has words for."""
    for count in range(len(names), 0, -1):
        more = len(names) - count
        line = f"{begin} {listed([*names[:count], *([f'{more} more'] if more else [])])}{end}."
        if len(line.split()) <= MOST_WORDS:
            return line
    return f"{begin} {len(names)} places{end}."


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
        if biased := biased_parameters(diagnosis):
            said = f"Parameters of the ship file are wrong: {biased}."
            left = " The residual is more than noise, and no effect of the catalogue explains it."
            return said + left if differs(diagnosis) else said
        return "Something is missing that the catalogue does not name."
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
