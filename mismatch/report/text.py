"""What a careful reader is told beside the verdict.

A diagnosis as sentences: the headline of the report, the answer, and one for each finding.

A diagnosis as plain text, for a terminal or a notebook.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..judge.findings import Finding
from ..judge.held_out import rms_errors
from ..judge.verdict import EXPLAINED, NOTHING, PARTLY, UNEXPLAINED, BalanceVerdict
from ..outcome import Outcome
from .figures import block_rows, blocks, interval
from .wording import (
    biased_parameters,
    channel_name,
    effect_words,
    formula_lines,
    formula_sentence,
    listed,
    measure,
    number,
    numbers_changed,
    numbers_that_explain,
    parameter_words,
    span,
    table_rows,
    wrong_of,
    wrong_words,
)

_WORSE = 1.0
"""Points of FitPercent that a channel may lose to the correction without a word."""

_ELSEWHERE = 3.0
"""Ratio of what is missing on the part set aside to elsewhere, from which it is said."""


def remarks(diagnosis: Outcome) -> list[str]:
    """Sentences on what the correction worsens, never fitted or leaves over; often none."""
    said = []
    worse = [
        channel_name(column)[0]
        for column, before in diagnosis.fit_before.items()
        if diagnosis.fit_after[column] < before - _WORSE
    ]
    if worse:
        said.append(
            f"On the part set aside the corrected ship follows {', '.join(worse)} worse than the "
            "nominal one: take the correction as a description of this recording, not as a model."
        )
    inside = np.zeros(len(diagnosis.time_s), bool)
    for a, b in diagnosis.held_out:
        inside |= (diagnosis.time_s >= a) & (diagnosis.time_s < b)
    size = block_rows(float(diagnosis.time_s[-1]), interval(diagnosis))
    where = blocks(inside.astype(float), size) > 0.5
    for (name, _), residual in zip(diagnosis.balances, diagnosis.residual_after, strict=True):
        means = blocks(residual, size) - float(np.median(residual[~inside]))
        here, there = (float(np.sqrt(np.mean(means[part] ** 2))) for part in (where, ~where))
        if not worse and here > _ELSEWHERE * there > 0.0:
            said.append(
                f"In the {name} balance, {here / there:.0f} times as much is missing on the part set "
                "aside as elsewhere. What acts only there was never fitted: set another part aside "
                "and diagnose again."
            )
    colour = diagnosis.left_over
    if colour is not None and diagnosis.findings:
        name = diagnosis.balances[colour.balance][0]
        said.append(
            f"What is named leaves more than the instruments' noise: in the {name} balance, "
            f"{number(colour.ratio, 2)} times its power between {number(colour.low_Hz, 2)} and "
            f"{number(colour.high_Hz, 2)} Hz. The named form is close, not exact."
        )
    return said


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


CONSTANT = "constant: no FitPercent"


def aligned(rows: Sequence[Mapping[str, str]], right: Sequence[str] = ()) -> str:
    """Rows of text under their heads, in columns.

    Args:
        rows: cells by head; every row has the first one's heads.
        right: heads of the columns that are flush right, as numbers are.
    """
    heads = list(rows[0]) if rows else []
    lines = [heads, *([row[head] for head in heads] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if head in right else cell.ljust(width)
            for head, cell, width in zip(heads, line, widths, strict=True)
        ).rstrip()
        for line in lines
    )


def summary(diagnosis: Outcome) -> str:
    """The answer, the findings with their intervals, and the fit on what was set aside."""
    parts = [headline(diagnosis)]
    if diagnosis.findings:
        numbers = ("value", "95 % from", "to", "evidence", "threshold")
        parts.append(
            "What is missing (evidence in 2 log L)\n" + aligned(_findings(diagnosis), numbers)
        )
    parts.append("In words\n" + sentence(diagnosis))
    wrong = [
        f"{finding.effect.label}: {wrong_words(number)}"
        for place, finding in enumerate(diagnosis.findings)
        if (number := wrong_of(diagnosis, place)) is not None
    ]
    if wrong:
        parts.append("Or a wrong number\n" + "\n".join(wrong))
    if diagnosis.formula is not None:
        parts.append("A formula for it\n" + "\n".join(formula_lines(diagnosis.formula)))
    if diagnosis.numbers:
        right = ("file", "found", "se", "moved", "corrected")
        parts.append(
            "The ship's numbers (moved by this recording: in tolerances)\n"
            + aligned(table_rows(diagnosis), right)
        )
    if any(b.verdict != NOTHING for b in diagnosis.balance_verdicts):
        parts.append("Balance by balance\n" + aligned(_balances(diagnosis), ("explained",)))
    held = ", ".join(span(a, b, whole=True) for a, b in diagnosis.held_out)
    parts.append(
        "Ship file (before) and corrected ship (after), run freely; FitPercent: 100 is perfect\n"
        + aligned(_fits(diagnosis), ("before", "after", "rms before", "rms after"))
        + f"\njudged on {held}, which was set aside before anything was fitted"
    )
    notes = [f"note: {note}" for note in (*diagnosis.limits, *diagnosis.warnings)]
    return "\n\n".join([*parts, "\n".join(notes)] if notes else parts)


def _balances(diagnosis: Outcome) -> list[dict[str, str]]:
    return [
        {
            "balance": b.name,
            "verdict": b.verdict,
            "explained": "" if b.verdict == NOTHING else f"{100.0 * max(b.explained, 0.0):.0f} %",
            "left": "noise" if b.left is None
            else f"{b.left.ratio:.3g} times the noise's power at {b.left.low_Hz:.2g} to "
            f"{b.left.high_Hz:.2g} Hz",
        }
        for b in diagnosis.balance_verdicts
    ]  # fmt: skip


def _findings(diagnosis: Outcome) -> list[dict[str, str]]:
    """One row a parameter; what belongs to the whole finding stands in its first."""
    rows = []
    for finding in diagnosis.findings:
        effect = finding.effect
        others = [c.effect.label for c in finding.rivals if c.effect.label != effect.label]
        of_all = {
            "effect": f"{effect.id} ({effect.form})" if effect.form else effect.id,
            "balance": effect.balance,
            "evidence": f"{finding.score:.1f}",
            "threshold": f"{finding.threshold:.1f}",
            "or equally": ", ".join(others),
        }
        for estimate in finding.estimates:
            low, high = estimate.ci95
            row = {
                "effect": "",
                "balance": "",
                "parameter": estimate.name,
                "value": f"{estimate.value:.4g}",
                "95 % from": "" if finding.unmeasured else f"{low:.4g}",
                "to": "" if finding.unmeasured else f"{high:.4g}",
                "unit": estimate.unit,
                "evidence": "",
                "threshold": "",
                "or equally": "",
            }
            rows.append(row | of_all)
            of_all = {}
    return rows


def _fits(diagnosis: Outcome) -> list[dict[str, str]]:
    measured, rows = diagnosis.measured, diagnosis.held_rows
    before, after = (
        rms_errors(measured, simulated, rows) for simulated in (diagnosis.before, diagnosis.after)
    )
    table = []
    for channel in measured:
        row = {"channel": channel, "before": "–", "after": "–"}
        if channel in diagnosis.fit_before:
            row["before"] = f"{diagnosis.fit_before[channel]:.1f}"
            row["after"] = f"{diagnosis.fit_after[channel]:.1f}"
        row |= {
            "rms before": f"{before[channel]:.4g}",
            "rms after": f"{after[channel]:.4g}",
            "unit": channel_name(channel)[1],
            "": "" if channel in diagnosis.fit_before else CONSTANT,
        }
        table.append(row)
    return table
