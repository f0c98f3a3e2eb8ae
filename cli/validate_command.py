"""``shaftline validate``."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.files import write_json, write_text
from ..core.sweep import refuse_other_plan, source_digest, sweep
from ..mismatch import Options, diagnose
from ..plant import load_ship
from ..validation.cases import draw_case, hash_truth
from ..validation.comparison import sindy, stepwise_bic
from ..validation.recording import simulate_case
from ..validation.run import Diagnose, case_folder, run_case, scores, write_page
from ..validation.variants import VARIANTS
from .console import Jobs, check_folder, print_table, progress, report_errors, say
from .source import constant

PLAIN: str = constant("validation/variants.py", "PLAIN")


def validate(
    cases: Annotated[int, typer.Option(min=1, max=100_000, help="Number of cases.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the cases.")] = 1,
    out: Annotated[
        Path, typer.Option(help="Folder for the cases, the page and its tables.")
    ] = Path("out/validate"),
    jobs: Jobs = None,
    with_sindy: Annotated[
        bool,
        typer.Option(
            "--sindy", help="Also analyse by PySINDy (`pip install 'shaftline[rivals]'`)."
        ),
    ] = False,
    variant: Annotated[
        str,
        typer.Option(
            help=f"Variant of the recordings: {PLAIN}, or one of those above.", metavar="VARIANT"
        ),
    ] = PLAIN,
    reports: Annotated[
        bool, typer.Option("--reports", help="Also write report.html of each case.")
    ] = False,
) -> None:
    """Validate the diagnosis on recordings with concealed effects.

    The recordings come from an independent simulator that shares no code with the package: its own
    formulas, integrated by scipy, with effects in other forms than those of the catalogue (Stribeck
    friction in place of Coulomb friction, a second-order lag in place of a first-order one). The seed
    draws effect, size, programme, instruments, noise and sea. Two cases in five conceal nothing, an
    effect that the catalogue does not contain, or an effect that is not identifiable from the recording.

    The truth of each case is written to a file whose hash (its *seal*) is printed before the diagnosis
    gets any recording. Then each recording is diagnosed, the truth is opened, and the result is scored.
    For comparison each recording is also analysed by a stepwise regression with the Bayesian information
    criterion.

    Variants make the cases more like recordings of real ships. realistic: inertia and friction of the
    ship file have errors of 10 %, resistance, KT and KQ of 5 %, and a recording of a reference period is
    available for calibration. 1-hz: one row a second. 100-hz: a hundred rows a second, unfiltered.
    one-missing: one channel is missing. closed-loop: a governor sets the commands from the measured
    shaft speed. The stepwise regression is run with the variant plain only.

    Written: `validation.md` with every figure and its target, its tables as CSV, and a folder for each
    case with recording, seal, reports, truth and score. Finished cases are kept: an interrupted
    validation resumes, and a larger number adds cases.

    Examples:
        shaftline validate --cases 20 --seed 1 --out out/validate

        shaftline validate --cases 40 --seed 7 --variant realistic --out out/validate-realistic

        shaftline validate --cases 200 --seed 7 --sindy --out out/validate-7
    """
    with report_errors(resumes=True):
        check_folder(out)
        if variant not in VARIANTS:
            raise ValueError(f"--variant {variant}: unknown; known: {', '.join(VARIANTS)}")
        if with_sindy and variant != PLAIN:
            raise ValueError("--sindy: other methods are compared with the variant plain only")
        beside: dict[str, Diagnose] = {}
        if variant == PLAIN:
            beside["stepwise-bic"] = stepwise_bic.diagnose
        if with_sindy:
            if importlib.util.find_spec("pysindy") is None:
                raise ValueError("--sindy needs PySINDy: pip install 'shaftline[rivals]'")
            beside["pysindy"] = sindy.diagnose
        _same_validation(out, seed, variant, list(beside))
        names = {f"{seed}-{i:04d}": (seed, i, variant) for i in range(cases)}
        with progress("sealing", cases) as tick:
            work = functools.partial(_seal, out)
            seals = sweep(work, names, out / "cells" / "seals", jobs=jobs, tick=tick)
        lines = [f"case {name}  sealed {digest}" for name, digest in seals.items()]
        say("\n".join(lines))
        whole = hashlib.sha256("\n".join(lines).encode()).hexdigest()
        say(f"all {cases} cases sealed, before any is diagnosed: {whole}\n")
        write_text(out / "seals.txt", "\n".join(lines) + "\n")
        with progress("diagnosing", cases) as tick:
            run = functools.partial(_run, out, beside, reports)
            sweep(run, names, out / "cells" / "scores", jobs=jobs, tick=tick)
        tables = scores(out)
        finished = len(list(out.glob("case-*/score.json")))
        command = f"shaftline validate --cases {finished} --seed {seed}"
        command += " --sindy" if with_sindy else ""
        command += f" --variant {variant}" if variant != PLAIN else ""
        page = write_page(tables, out, command, variant)
        print_table(tables["summary"], f"{finished} cases of seed {seed}", digits=3)
        say(f"page: {page}   cases: {out / 'case-*'}")


def _same_validation(out: Path, seed: int, variant: str, beside: list[str]) -> None:
    """Refuse to mix cases of two seeds, variants, sets of methods or versions."""
    note = out / "cells" / "validation.json"
    version = source_digest("core", "plant", "mismatch", "validation")
    mine = {"seed": seed, "variant": variant, "beside": beside, "version": version}
    refuse_other_plan(out, note, mine, "validation")
    if not note.is_file() and any(out.glob("case-*")):
        raise ValueError(f"{out}: contains cases of another command; give another --out")
    write_json(note, mine)


def _seal(out: Path, cell: tuple[int, int, str]) -> str:
    """Write the seal of a case's truth to the folder of the case, and return it."""
    case = draw_case(*cell)
    digest = hash_truth(simulate_case(case).truth)
    write_text(case_folder(out, case) / "sealed.sha256", digest + "\n")
    return digest


def _run(
    out: Path, beside: dict[str, Diagnose], reports: bool, cell: tuple[int, int, str]
) -> list[dict[str, Any]]:
    """Diagnose, open and score a case, whose truth must match its seal."""
    return run_case(draw_case(*cell), out, functools.partial(_tool, reports), beside)


def _tool(
    page: bool,
    recording: Path,
    ship: str,
    folder: Path,
    exclude: tuple[str, ...],
    healthy: Path | None = None,
) -> dict[str, Any]:
    """Diagnose a recording as ``shaftline diagnose`` does, with or without calibration."""
    options = Options(exclude=exclude, calibrate=() if healthy is None else (healthy,))
    diagnosis = diagnose(load_ship(ship), recording, options=options)
    diagnosis.save(folder, page=page)
    return diagnosis.to_dict()
