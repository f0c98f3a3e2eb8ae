"""Text of a diagnosis: headline, sentences on the findings, remarks, and the summary for a terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..judge.held_out import rms_errors
from ..judge.verdict import EXPLAINED, NOTHING, PARTLY, UNEXPLAINED, BalanceVerdict, Finding
from ..outcome import Outcome, block_statistics
from .wording import (
    CHANGED,
    biased_parameter_sentence,
    biased_parameters,
    capitalise,
    changed_since_reference,
    channel_name,
    corrected_parameters,
    corrections,
    effect_words,
    formula_lines,
    formula_sentence,
    join_words,
    number,
    parameter_rows,
    parameter_words,
    percent,
    time_span,
    value_with_unit,
    values_with_unit,
)

_WORSE = 1.0  # points of FitPercent by which the correction may worsen a channel without a remark
_ELSEWHERE = 3.0  # ratio of the residual on held-out to other rows that gives a remark
NEUTRAL = (0.0, 1.0)  # values without an effect that need no mention: of a size and of a factor
MOST_WORDS = 15  # largest number of words of a headline
CONSTANT = "constant: no FitPercent"


def remarks(diagnosis: Outcome) -> list[str]:
    """Return remarks on channels that fit worse, on a larger held-out residual, and on model form."""
    said = []
    worse = [
        channel_name(column)[0]
        for column, before in diagnosis.fit_before.items()
        if diagnosis.fit_after[column] < before - _WORSE
    ]
    if worse:
        said.append(
            f"On the held-out data the corrected ship fits {', '.join(worse)} worse than the nominal "
            "ship does: use the correction as a description of this recording, not as a model."
        )
    time = diagnosis.time_s
    inside = np.any([(time >= a) & (time < b) for a, b in diagnosis.held_out], axis=0)
    size = diagnosis.rows_of_a_block
    where = block_statistics(inside.astype(float), size) > 0.5
    for (name, _), residual in zip(diagnosis.balances, diagnosis.residual_after, strict=True):
        means = block_statistics(residual, size) - float(np.median(residual[~inside]))
        here, there = (float(np.sqrt(np.mean(means[part] ** 2))) for part in (where, ~where))
        if not worse and here > _ELSEWHERE * there > 0.0:
            said.append(
                f"In the {name} balance the residual is {here / there:.0f} times as large on the "
                "held-out data as elsewhere. An effect that acts only there was never fitted: hold out "
                "another part of the recording and diagnose again."
            )
    colour = diagnosis.left_over
    if colour is not None and diagnosis.findings:
        name = diagnosis.balances[colour.balance][0]
        said.append(
            f"The identified effects leave more than the instruments' noise: in the {name} balance the "
            f"residual has {number(colour.ratio, 2)} times the noise's power between "
            f"{number(colour.low_Hz, 2)} and {number(colour.high_Hz, 2)} Hz. The form of the model is "
            "close, not exact."
        )
    return said


VERDICT_WORDS = {
    EXPLAINED: "explained",
    PARTLY: "partly explained",
    NOTHING: "nothing missing",
    UNEXPLAINED: "unexplained",
    "undecided": "cannot be decided",
}
"""Words of each verdict, and of ``undecided``."""


def status(diagnosis: Outcome) -> str:
    """Return the verdict, or ``undecided`` where the recording does not allow a verdict."""
    undecided = diagnosis.limits and (diagnosis.undecidable or not diagnosis.excited)
    return "undecided" if undecided and diagnosis.verdict == UNEXPLAINED else diagnosis.verdict


def headline(diagnosis: Outcome) -> str:
    """Return the verdict and its cause in at most :data:`MOST_WORDS` words.

    >>> from types import SimpleNamespace
    >>> headline(SimpleNamespace(verdict="nothing-missing", limits=[], parameters=[]))
    'Nothing missing: the difference is within noise and the tolerances of the ship file.'
    """
    verdict = VERDICT_WORDS[status(diagnosis)].capitalize()
    if diagnosis.verdict in (EXPLAINED, PARTLY):
        names = dict.fromkeys(effect_words(f.effect) for f in diagnosis.findings)
        return _shortened(f"{verdict} by", list(names))
    if corrected := corrected_parameters(diagnosis, free=True, far=True):
        wrong = [parameter_words(n.key.rpartition(".")[2], n.unit) for n in corrected]
        left = "; a residual remains" if has_residual(diagnosis) else ""
        begin = CHANGED if changed_since_reference(corrected) else "The ship file is wrong in"
        return _shortened(begin, wrong, left)
    if diagnosis.verdict == NOTHING:
        return f"{verdict}: the difference is within noise and the tolerances of the ship file."
    if status(diagnosis) != UNEXPLAINED:
        return f"{verdict}: the recording is too short or excites too little."
    if diagnosis.formula is not None:
        return f"{verdict}: no effect of the catalogue fits; a formula describes the residual."
    if diagnosis.shape is not None:
        return f"{verdict}: the {diagnosis.shape.balance} balance has a residual of unknown cause."
    return f"{verdict}: no effect of the catalogue fits."


def _shortened(begin: str, names: list[str], end: str = "") -> str:
    """Return a headline with as many names as :data:`MOST_WORDS` allows."""
    for count in range(len(names), 0, -1):
        more = len(names) - count
        line = f"{begin} {join_words([*names[:count], *([f'{more} more'] if more else [])])}{end}."
        if len(line.split()) <= MOST_WORDS:
            return line
    return f"{begin} {len(names)} places{end}."


def _between(windows: list[tuple[float, float]]) -> str:
    """Return windows of time as an adverbial: ``between 10 and 50 s``."""
    if not windows:
        return ""
    parts = [time_span(a, b, "and", whole=True) for a, b in windows[:3]]
    more = f", and in {len(windows) - 3} more windows" if len(windows) > 3 else ""
    return "between " + ", between ".join(parts) + more


def finding_sentence(finding: Finding) -> str:
    """Return what a balance lacks, with the parameters of the effect, their units and intervals."""
    effect = finding.effect
    sizes = []
    for estimate in finding.estimates:
        value, low, high = values_with_unit((estimate.value, *estimate.ci95), estimate.unit)
        neutral = value_with_unit(estimate.neutral, estimate.unit)
        size = f"{value} (95 % interval: {low} to {high})"
        if estimate.neutral not in NEUTRAL and math.isfinite(estimate.neutral):
            size += f", where the ship file has {neutral}"
        if estimate.is_undetermined:
            size = f"not determined ({low} to {high} is possible)"
        if finding.unmeasured:
            size = f"about {value}"
        sizes.append(f"{parameter_words(estimate.name, estimate.unit)} {size}")
    subject = "instrument" if effect.balance == "sensor" else f"{effect.balance} balance"
    where = f", with {finding.regime.replace('_', ' ')}," if finding.regime else ""
    when = _between(finding.windows)
    guess = f" ({finding.unmeasured}: no interval)" if finding.unmeasured else ""
    if finding.implausible:
        guess += f"; {finding.implausible}, so another cause is likely"
    said = f"{capitalise(when)}{where} the {subject} {lacking_or_excess(finding)}"
    return f"{said}, with {', '.join(sizes)}{guess}."


def lacking_or_excess(finding: Finding) -> str:
    """Return what a balance lacks or, with a value below the neutral one, has too much of."""
    effect, first = finding.effect, finding.estimates[0]
    if math.isinf(first.neutral) or first.value >= first.neutral:
        return f"lacks {effect.lacks}"
    if effect.excess:
        return f"has {effect.excess}"
    if first.neutral in NEUTRAL:
        return f"has too much of this: {effect.lacks}"
    return f"has less {effect_words(effect)} than the ship file"


def residual_sentence(balance: BalanceVerdict) -> str:
    """Return how much of the power beyond noise remains in a balance."""
    share = max(1.0 - balance.explained, 0.0)
    if share >= 1.0:
        return f"In the {balance.name} balance none of the difference is explained."
    left = f"{percent(share)} of the mean square beyond noise"
    return f"In the {balance.name} balance {left} is unexplained."


def has_residual(diagnosis: Outcome) -> bool:
    """Return whether any balance has a residual beyond noise."""
    return any(b.left is not None for b in diagnosis.balance_verdicts)


def sentence(diagnosis: Outcome) -> str:
    """Return the diagnosis in one sentence, or in one sentence for each finding."""
    limits = "; ".join(diagnosis.limits)
    if diagnosis.verdict in (EXPLAINED, PARTLY):
        verdicts = [b for b in diagnosis.balance_verdicts if b.verdict != EXPLAINED]
        left = [b for b in verdicts if b.left is not None]
        said = map(residual_sentence, left if diagnosis.verdict == PARTLY else ())
        return " ".join([*map(finding_sentence, diagnosis.findings), *said])
    if diagnosis.verdict == NOTHING:
        if right := corrections(corrected_parameters(diagnosis, free=True)):
            return (
                f"No physics is missing once the parameters are corrected: {right}. The simulation then "
                "differs from the recording by no more than noise and tolerances allow."
            )
        warning = f" Warning: the recording is limited: {limits}." if limits else ""
        return (
            "No physics is missing: the simulation differs from the recording by no more than noise and "
            f"the tolerances of the ship's parameters allow.{warning}"
        )
    shape = diagnosis.shape
    if diagnosis.undecidable and not has_residual(diagnosis):
        return f"Whether physics is missing cannot be decided, because {limits}."
    if limits and not diagnosis.excited:
        return (
            "Simulation and recording differ; which effect is the cause cannot be decided, because "
            f"{limits}."
        )
    if diagnosis.formula is not None:
        return f"No effect of the catalogue fits. {formula_sentence(diagnosis.formula)}"
    if shape is None:
        if biased := corrections(corrected_parameters(diagnosis, far=True)):
            rest = " The residual is more than noise, and no effect of the catalogue explains it."
            more = rest if has_residual(diagnosis) else ""
            return f"Parameters of the ship file are wrong: {biased}.{more}"
        return "Simulation and recording differ, and no effect of the catalogue fits."
    signal = shape.signal.replace("_", " ")
    low, high = float(np.min(shape.values)), float(np.max(shape.values))
    if high <= 0.0:
        least, most = (value_with_unit(-end, shape.unit) for end in (high, low))
        much = f"has {least} to {most} too much"
    else:
        much = f"lacks {value_with_unit(low, shape.unit)} to {value_with_unit(high, shape.unit)}"
    return f"No effect of the catalogue fits: the {shape.balance} balance {much}, depending on {signal}."


def align_columns(rows: Sequence[Mapping[str, str]], right: Sequence[str] = ()) -> str:
    """Return a table as text with aligned columns.

    Args:
        rows: cells by column head; every row has the heads of the first row.
        right: heads of the columns that are aligned to the right.

    >>> print(align_columns([{"channel": "speed", "fit": "9.5"}], ["fit"]))
    channel  fit
    speed    9.5
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
    """Return headline, findings with intervals, parameters and fit on the held-out data as text."""
    parts = [headline(diagnosis)]
    if diagnosis.findings:
        right = ("value", "95 % from", "to", "evidence", "threshold")
        head = "Missing physics (evidence: log-likelihood-ratio statistic, 2 Δ log L)"
        parts.append(f"{head}\n{align_columns(_findings(diagnosis), right)}")
    parts.append("In words\n" + sentence(diagnosis))
    biased = [
        f"{finding.effect.label}: {biased_parameter_sentence(parameter)}"
        for finding, parameter in zip(diagnosis.findings, biased_parameters(diagnosis), strict=True)
        if parameter is not None
    ]
    if biased:
        parts.append("Alternative: a biased parameter\n" + "\n".join(biased))
    if diagnosis.formula is not None:
        parts.append("Formula\n" + "\n".join(formula_lines(diagnosis.formula)))
    if diagnosis.parameters:
        right = ("ship file", "estimate", "se", "change", "corrected ship")
        head = "Parameters of the ship (change: by this recording, in tolerances)"
        parts.append(f"{head}\n{align_columns(parameter_rows(diagnosis), right)}")
    if any(b.verdict != NOTHING for b in diagnosis.balance_verdicts):
        parts.append("Verdict by balance\n" + align_columns(_balances(diagnosis), ("explained",)))
    held = ", ".join(time_span(a, b, whole=True) for a, b in diagnosis.held_out)
    parts.append(
        "Fit of the ship file (before) and of the corrected ship (after), simulated open loop; "
        "FitPercent: 100 is perfect\n"
        + align_columns(_fits(diagnosis), ("before", "after", "rms before", "rms after"))
        + f"\nevaluated on {held}, which was held out before anything was fitted"
    )
    return "\n\n".join([*parts, *notes_of(diagnosis.limits, diagnosis.warnings)])


def notes_of(limits: Sequence[str], warnings: Sequence[str]) -> list[str]:
    """Return limits and warnings as one paragraph of notes; without any, no paragraph."""
    notes = "\n".join(f"note: {note}" for note in (*limits, *warnings))
    return [notes] if notes else []


def _balances(diagnosis: Outcome) -> list[dict[str, str]]:
    return [
        {
            "balance": b.name,
            "verdict": b.verdict,
            "explained": "" if b.verdict == NOTHING else percent(b.explained),
            "residual": "noise"
            if b.left is None
            else f"{b.left.ratio:.3g} times the noise's power at {b.left.low_Hz:.2g} to "
            f"{b.left.high_Hz:.2g} Hz",
        }
        for b in diagnosis.balance_verdicts
    ]


_OF_FINDING = ("effect", "balance", "evidence", "threshold", "indistinguishable from")


def _findings(diagnosis: Outcome) -> list[dict[str, str]]:
    """Return one row for each parameter; the first row of a finding has the finding's own columns."""
    rows = []
    for finding in diagnosis.findings:
        effect = finding.effect
        others = [c.effect.label for c in finding.rivals if c.effect.label != effect.label]
        for place, estimate in enumerate(finding.estimates):
            low, high = ("" if finding.unmeasured else f"{end:.4g}" for end in estimate.ci95)
            row = {
                "effect": f"{effect.id} ({effect.form})" if effect.form else effect.id,
                "balance": effect.balance,
                "parameter": estimate.name,
                "value": f"{estimate.value:.4g}",
                "95 % from": low,
                "to": high,
                "unit": estimate.unit,
                "evidence": f"{finding.score:.1f}",
                "threshold": f"{finding.threshold:.1f}",
                "indistinguishable from": ", ".join(others),
            }
            if place > 0:
                row |= dict.fromkeys(_OF_FINDING, "")
            rows.append(row)
    return rows


def _fits(diagnosis: Outcome) -> list[dict[str, str]]:
    measured, rows = diagnosis.measured, diagnosis.held_rows
    before, after = (
        rms_errors(measured, simulated, rows) for simulated in (diagnosis.before, diagnosis.after)
    )
    table = []
    for channel in measured:
        fits = diagnosis.fit_before.get(channel), diagnosis.fit_after.get(channel)
        fit_before, fit_after = ("–" if fit is None else f"{fit:.1f}" for fit in fits)
        table.append(
            {
                "channel": channel,
                "before": fit_before,
                "after": fit_after,
                "rms before": f"{before[channel]:.4g}",
                "rms after": f"{after[channel]:.4g}",
                "unit": channel_name(channel)[1],
                "": "" if channel in diagnosis.fit_before else CONSTANT,
            }
        )
    return table
