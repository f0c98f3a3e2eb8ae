"""``shaftline challenge``."""

from __future__ import annotations

import secrets
import shlex
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..core.files import check_writable
from ..validation.challenge import (
    check_challenge_size,
    make_challenge,
    score_challenge,
    truth_file,
)
from ..validation.comparison.submission import run_rival
from ..validation.practice import CASES, copy_set
from .console import Jobs, check_folder, print_table, progress, report_errors, say
from .machine import add_results
from .source import constant

_PLAIN: str = constant("validation/variants.py", "PLAIN")


class Action(StrEnum):
    """What the command does."""

    COPY = "copy"
    MAKE = "make"
    RUN = "run"
    SCORE = "score"


def challenge(
    action: Annotated[Action, typer.Argument(
        help="copy the practice set, make a challenge, run a rival on it, or score submissions.",
        show_default=False)],
    folder: Annotated[Path | None, typer.Argument(
        help="run, score: folder of the challenge.", metavar="[DIR]", show_default=False)] = None,
    operands: Annotated[list[str] | None, typer.Argument(
        help="run: a rival, by name or as module:Class. score: submissions (JSON files), one for each "
        "tool.", metavar="[RIVAL | SUBMISSION...]", show_default=False)] = None,
    cases: Annotated[int, typer.Option(min=1, max=100_000, help="make: number of cases.")] = 20,
    seed: Annotated[int | None, typer.Option(
        min=0, help="make: secret seed of the cases.", show_default="a random one, printed")] = None,
    variant: Annotated[str, typer.Option(
        help="make: variant of the recordings (see `shaftline validate --help`).",
        metavar="VARIANT")] = _PLAIN,
    truth: Annotated[Path | None, typer.Option(
        help="make, score: file of the truth.", show_default="DIR-truth.json beside DIR")] = None,
    out: Annotated[Path | None, typer.Option(
        help="copy, make: folder of the challenge. run: file of the submission. score: folder of the "
        "tables.",
        show_default="out/challenge; out/RIVAL.json; out/challenge-scores")] = None,
    jobs: Jobs = None,
) -> None:  # fmt: skip
    """Make, run and score a challenge: which physics is missing, and can it be predicted?

    `copy` copies a small challenge of the package for practice, with its truth: six cases with one row
    a second.

    `make` writes recordings of an independent simulator with concealed effects, as `validate` uses
    them, for any tool: in a folder for each case the recording, the ship file, the simulation of the
    ship file, and the inputs of a held-out part whose measurements are withheld. The truth is written
    to a file beside the folder, and its SHA-256 (the *seal*) into the folder and to the console. Send
    the folder to others, and keep truth and seed until the last submission.

    `run` runs a rival on every case and writes its submission; finished cases are kept. The rivals
    are shaftline (this package's `diagnose`), shaftline-quick, stepwise-bic, lisdd, gaussian-process,
    neural-network, ship-file, pysindy and gplearn (with `pip install 'shaftline[rivals]'`), or a class
    of your own as module:Class with the method analyse(case). The import of its module executes it.

    `score` checks the seal and the submissions, and compares them in one table with 95 % intervals:
    effect, balance, size and interval of the parameter, null cases, prediction of the held-out part,
    and the time and the operating regime in which an effect acts. Written: `challenge.md`,
    `challenge.csv`, `challenge-cases.csv` and `challenge.json`.

    Examples:
        shaftline challenge copy --out out/practice

        shaftline challenge make --seed 112 --cases 4 --out out/challenge

        shaftline challenge run out/challenge stepwise-bic --out out/stepwise-bic.json

        shaftline challenge run out/challenge examples.challenge_rival:LaggedResidual --out out/own.json

        shaftline challenge score out/challenge out/stepwise-bic.json out/own.json --out out/scores
    """
    given = list(operands or [])
    with report_errors(resumes=action is Action.RUN):
        if action in (Action.COPY, Action.MAKE) and folder is not None:
            raise ValueError(f"{action.value} {folder}: give the new folder as --out {folder}")
        if action is Action.COPY:
            _copy(out or Path("out/challenge"))
            return
        if action is Action.MAKE:
            _make(out or Path("out/challenge"), truth, seed, cases, variant, jobs)
            return
        if folder is None or not given:
            needed = "RIVAL" if action is Action.RUN else "SUBMISSION.json"
            raise ValueError(
                f"{action.value}: needs a folder and a {needed}: "
                f"shaftline challenge {action.value} DIR {needed}"
            )
        if action is Action.RUN:
            if len(given) > 1:
                raise ValueError(f"run: one rival at a time, not {len(given)}: {', '.join(given)}")
            _run(folder, given[0], out, jobs)
        else:
            _score(
                folder, [Path(name) for name in given], truth, out or Path("out/challenge-scores")
            )


def _copy(out: Path) -> None:
    check_folder(out)
    check_writable(truth_file(out))
    truth = copy_set(out)
    say(f"practice set of {CASES} cases in {out}; data card: {out / 'README.md'}")
    say(f"truth: {truth}")
    say(f"next: shaftline challenge run {out} stepwise-bic --out out/stepwise-bic.json")


def _make(
    out: Path, truth: Path | None, seed: int | None, cases: int, variant: str, jobs: int | None
) -> None:
    target = truth or truth_file(out)
    check_folder(out)
    check_writable(target)
    check_challenge_size(cases, variant)
    seed = secrets.randbits(48) if seed is None else seed
    with progress("simulating", cases) as tick:
        seal = make_challenge(out, seed, cases, variant, target, jobs, tick)
    add_results({"seal": seal, "seed": seed})
    say(f"{cases} cases in {out}, variant {variant}; data card: {out / 'README.md'}")
    say(f"truth: {target}   seed: {seed}; keep both until the last submission")
    say(f"seal (SHA-256 of the truth): {seal}")


def _run(folder: Path, rival: str, out: Path | None, jobs: int | None) -> None:
    target = out or Path("out") / f"{rival.replace(':', '-')}.json"
    check_writable(target)
    with progress(f"running {rival}", len(list(folder.glob("case-*")))) as tick:
        entries = run_rival(folder, rival, target, jobs, tick)
    failed = {name: one["error"] for name, one in entries.items() if one.get("error")}
    for name, error in list(failed.items())[:3]:
        say(f"{name}: {error}")
    say(f"{len(entries) - len(failed)} of {len(entries)} cases analysed, {len(failed)} failed")
    say(f"submission: {target}")


def _score(folder: Path, submissions: list[Path], truth: Path | None, out: Path) -> None:
    check_folder(out)
    scores = score_challenge(folder, submissions, truth)
    line = ["shaftline", "challenge", "score", folder, *submissions, "--out", out]
    page = scores.write(out, shlex.join(map(str, line)))
    print_table(scores.figures, f"{scores.count} cases, variant {scores.variant}", digits=3)
    say(f"page: {page}   table: {out / 'challenge.csv'}")
