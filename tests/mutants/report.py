"""What was noticed, folder by folder, and every survivor with the reason why it is let pass."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any, NamedTuple

from .sample import Mutant

TARGETS = {"plant": 0.95}
OTHERS = 0.85
"""Least share of the changes that tests notice."""


class Outcome(NamedTuple):
    """What became of a change."""

    mutant: Mutant
    noticed: bool
    by: str  # the first test that failed, or how it ended
    seconds: float


def target(folder: str) -> float:
    """Least share that is noticed in a folder."""
    return TARGETS.get(folder, OTHERS)


def reason(mutant: Mutant, let_pass: list[dict[str, Any]]) -> str:
    """Why a survivor is let pass; empty where nobody has said."""
    change = mutant.change
    for entry in let_pass:
        if entry["file"] == mutant.file and entry["line"] == change.source:
            whats = entry["change"] if isinstance(entry["change"], list) else [entry["change"]]
            if change.what in whats:
                return str(entry["reason"])
    return ""


def shares(outcomes: Iterable[Outcome]) -> dict[str, tuple[int, int]]:
    """Changes noticed and changes made, by folder."""
    made: Counter[str] = Counter()
    noticed: Counter[str] = Counter()
    for outcome in outcomes:
        made[outcome.mutant.folder] += 1
        noticed[outcome.mutant.folder] += outcome.noticed
    return {folder: (noticed[folder], made[folder]) for folder in made}


def page(outcomes: list[Outcome], seed: int, let_pass: list[dict[str, Any]]) -> str:
    """The report as Markdown."""
    lines = [
        "# Small wrong changes, and whether the tests notice",
        "",
        f"`make mutants` makes small wrong changes to the code, one at a time (seed {seed}, at most one "
        "to a line), and runs the tests that stand in the mirror of the changed module. A change that "
        "no test notices is a gap in the tests, or makes no wrong result.",
        "",
        "| folder | changes | noticed | share | at least |",
        "|---|---|---|---|---|",
    ]
    for folder, (noticed, made) in shares(outcomes).items():
        lines.append(
            f"| `{folder}/` | {made} | {noticed} | {noticed / made:.1%} | {target(folder):.0%} |"
        )
    survivors = sorted((o.mutant for o in outcomes if not o.noticed), key=lambda m: m[:2])
    lines += ["", f"## Survivors ({len(survivors)})"]
    folder = ""
    for mutant in survivors:
        if mutant.folder != folder:
            folder = mutant.folder
            lines += [
                "",
                f"### {folder}",
                "",
                "| where | change | line | why it may pass |",
                "|---|---|---|---|",
            ]
        change = mutant.change
        why = reason(mutant, let_pass) or "**a hole**"
        cells = (f"`{mutant.file}:{change.line}`", change.what, f"`{change.source}`", why)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
