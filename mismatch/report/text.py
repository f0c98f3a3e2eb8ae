"""A diagnosis as plain text, for a terminal or a notebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..judge.fit import rms_errors
from ..judge.verdict import NOTHING
from ..outcome import Outcome
from .formulas import formula_lines
from .numbers import table_rows, wrong_of, wrong_words
from .sentences import headline, sentence
from .wording import channel_name, span

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
