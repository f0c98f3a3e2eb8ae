"""``python -m tests.mutants``: make small wrong changes, one at a time, and see whether tests notice."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress

from .report import Outcome, page, reason, shares, target
from .sample import sample
from .trial import TestsFailError, try_all

ROOT = Path(__file__).resolve().parents[2]
DECLARED = tomllib.loads((Path(__file__).parent / "let_pass.toml").read_text(encoding="utf-8"))
LET_PASS = DECLARED.get("let_pass", [])

console = Console(soft_wrap=True, markup=False, highlight=False)


def main(
    only: Annotated[
        list[str] | None,
        typer.Option(help="File or folder to change, such as plant/shaft.py; repeat for more."),
    ] = None,
    size: Annotated[int, typer.Option("--sample", help="How many changes to make.")] = 480,
    seed: Annotated[int, typer.Option(help="Another seed draws other changes.")] = 1,
    jobs: Annotated[int, typer.Option(min=1, help="Changes tried at once.")] = 2,
    fresh: Annotated[bool, typer.Option("--fresh", help="Try finished ones again.")] = False,
    kept: Annotated[Path, typer.Option(help="Folder of finished ones.")] = ROOT / "out/mutants",
    out: Annotated[Path | None, typer.Option(help="Page to write (Markdown).")] = None,
) -> None:
    """Make small wrong changes to the code, one at a time, and see whether the tests notice.

    A change is what a slip of the hand makes: + for -, < for <=, a constant a tenth too large, min for
    max, a condition negated, an argument or a statement left out. Each is made in a scratch copy of
    the repository, and the tests in the mirror of the changed module are run until one fails.

    A change that no test notices is either a hole in the tests - write the test that pins the number -
    or makes no wrong result. Then say why in tests/mutants/let_pass.toml.

    Stop it and start it again: what is finished is kept, until the changed file or its tests change.
    Ends with 1 where a folder misses its target or a survivor has no reason.

    Examples:

    python -m tests.mutants --only plant/shaft.py --sample 50

    python -m tests.mutants --only plant --sample 100 --seed 2
    """
    mutants = sample(ROOT, size, seed, only or [], DECLARED["serves"])
    store = {mutant: kept / f"{mutant.key}.json" for mutant in mutants}
    waiting = [mutant for mutant in mutants if fresh or not store[mutant].is_file()]
    console.print(
        f"{len(mutants)} changes, seed {seed}; {len(mutants) - len(waiting)} are finished"
    )
    kept.mkdir(parents=True, exist_ok=True)
    with Progress(
        *Progress.get_default_columns(), MofNCompleteColumn(), console=console
    ) as progress:
        task = progress.add_task("the tests without a change", total=None)
        try:
            for outcome in try_all(ROOT, waiting, jobs) if waiting else ():
                store[outcome.mutant].write_text(json.dumps(outcome[1:]), encoding="utf-8")
                progress.update(task, description="changes", total=len(waiting), advance=1)
                if not outcome.noticed:
                    console.print(f"not noticed: {outcome.mutant}")
        except TestsFailError as error:
            console.print(f"the tests must pass before changes are tried:\n{error}")
            raise typer.Exit(2) from None
    outcomes = [Outcome(m, *json.loads(store[m].read_text(encoding="utf-8"))) for m in mutants]
    if out:
        out.write_text(page(outcomes, seed, LET_PASS), encoding="utf-8")
    raise typer.Exit(not told(outcomes))


def told(outcomes: list[Outcome]) -> bool:
    """Print what was found; whether every target is met and every survivor has a reason."""
    survivors = [outcome.mutant for outcome in outcomes if not outcome.noticed]
    reasons = [reason(mutant, LET_PASS) for mutant in survivors]
    for mutant, why in zip(survivors, reasons, strict=True):
        console.print(f"{mutant}\n    {why or 'A HOLE'}")
    good = all(reasons)
    for folder, (noticed, made) in shares(outcomes).items():
        good &= noticed >= target(folder) * made
        console.print(f"{folder}: {noticed} of {made} noticed, {noticed / made:.1%}")
    return good


if __name__ == "__main__":
    typer.run(main)
