"""``shaftline validate``."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.files import write_json, write_text
from ..core.sweep import refuse_another, source_digest, sweep
from ..mismatch import Options, diagnose
from ..plant import load_ship
from ..validation.cases import draw_case, sealed
from ..validation.recording import make
from ..validation.rivals import sindy, stepwise_bic
from ..validation.run import Diagnose, case_folder, run_case, scores, write_page
from ..validation.variants import PLAIN, VARIANTS
from .console import check_folder, clear_errors, print_table, progress, say


def validate(
    cases: Annotated[int, typer.Option(min=1, max=100_000, help="How many concealed cases.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Decides every case.")] = 1,
    out: Annotated[
        Path, typer.Option(help="Folder for the cases, the page and its tables.")
    ] = Path("out/validate"),
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="Processes on this machine.", show_default="one a core"),
    ] = None,
    with_sindy: Annotated[
        bool,
        typer.Option("--sindy", help="Also PySINDy beside it (`pip install 'shaftline[sindy]'`)."),
    ] = False,
    variant: Annotated[
        str,
        typer.Option(
            help="How the recordings are: " + ", ".join(VARIANTS) + ".", metavar="VARIANT"
        ),
    ] = PLAIN,
    reports: Annotated[
        bool, typer.Option("--reports", help="Also write each case's report.html.")
    ] = False,
) -> None:
    """Prove the diagnosis on recordings in which an effect is concealed.

    The recordings come from a second ship that shares no code with the one that the tool simulates:
    its own formulas, integrated by scipy, with effects in other forms than the catalogue's (Stribeck
    friction where that has Coulomb's, a second-order lag where it has a first-order one). The seed
    draws effect, strength, programme, instruments, noise and sea. Two cases in five
    conceal nothing, something the catalogue does not have, or something that the recording cannot
    show.

    What each case conceals is written down, hashed, and the hash (its *seal*) printed before the tool
    sees any recording. Then each is diagnosed from the recording alone, opened and scored, beside a
    stepwise regression by the Bayesian information criterion, which is the plain way to do it.

    Variants meet the same cases as recordings of real ships are. realistic: the file's inertia and
    friction are off by 10 %, resistance, KT and KQ by 5 %, and a healthy record of the same ship is
    there to calibrate on. 1-hz: a log of one row a second. 100-hz: a hundred rows, unfiltered.
    one-missing: a channel was not recorded. closed-loop: a governor gives the demands by what the
    encoder shows. The stepwise regression stands beside the plain proof only.

    Written: `validation.md` with every figure beside its target, its tables as CSV, and a folder a case
    with recording, seal, reports, truth and score. Finished cases are kept: a proof that was
    interrupted goes on where it stopped, and a larger N adds cases.

    Examples:
        shaftline validate --cases 20 --seed 1 --out out/validate

        shaftline validate --cases 40 --seed 7 --variant realistic --out out/validate-realistic

        shaftline validate --cases 200 --seed 7 --sindy --out out/validate-7
    """
    with clear_errors():
        check_folder(out)
        if variant not in VARIANTS:
            known = ", ".join(VARIANTS)
            raise ValueError(f"--variant {variant}: no such variant; known: {known}")
        if with_sindy and variant != PLAIN:
            raise ValueError("--sindy: other methods are compared with in the plain proof only")
        beside: dict[str, Diagnose] = {}
        if variant == PLAIN:
            beside["stepwise-bic"] = stepwise_bic.diagnose
        if with_sindy:
            if importlib.util.find_spec("pysindy") is None:
                raise ValueError("--sindy: needs an extra, `pip install 'shaftline[sindy]'`")
            beside["pysindy"] = sindy.diagnose
        _same_validation(out, seed, variant, list(beside))
        names = {f"{seed}-{i:04d}": (seed, i, variant) for i in range(cases)}
        with progress("sealing", cases) as tick:
            work = functools.partial(_seal, out)
            seals = sweep(work, names, out / "cells" / "seals", jobs=jobs, tick=tick)
        lines = [f"case {name}  sealed {seal}" for name, seal in seals.items()]
        say("\n".join(lines))
        whole = hashlib.sha256("\n".join(lines).encode()).hexdigest()
        say(f"all {cases} cases sealed, before any is diagnosed: {whole}\n")
        write_text(out / "seals.txt", "\n".join(lines) + "\n")
        with progress("diagnosing", cases) as tick:
            run = functools.partial(_run, out, beside, reports)
            sweep(run, names, out / "cells" / "scores", jobs=jobs, tick=tick)
        tables = scores(out)
        finished = len(list(out.glob("case-*/score.json")))
        more = " --sindy" if with_sindy else ""
        more += f" --variant {variant}" if variant != PLAIN else ""
        command = f"shaftline validate --cases {finished} --seed {seed}{more}"
        page = write_page(tables, out, command, variant)
        print_table(tables["summary"], f"{finished} cases of seed {seed}", digits=3)
        say(f"page: {page}   cases: {out / 'case-*'}")


def _same_validation(out: Path, seed: int, variant: str, beside: list[str]) -> None:
    """Refuse to mix cases of two seeds or variants, of two sets of tools or of two versions of them."""
    note = out / "cells" / "validation.json"
    mine = {
        "seed": seed,
        "variant": variant,
        "beside": beside,
        "version": source_digest("core", "plant", "mismatch", "validation"),
    }
    refuse_another(out, note, mine, "validation")
    if not note.is_file() and any(out.glob("case-*")):
        raise ValueError(f"{out}: holds cases that this command did not make; give another --out")
    write_json(note, mine)


def _seal(out: Path, cell: tuple[int, int, str]) -> str:
    """Make a case's truth, and leave its seal where the diagnosis will look for it."""
    case = draw_case(*cell)
    seal = sealed(make(case).truth)
    write_text(case_folder(out, case) / "sealed.sha256", seal + "\n")
    return seal


def _run(
    out: Path, beside: dict[str, Diagnose], reports: bool, cell: tuple[int, int, str]
) -> list[dict[str, Any]]:
    """Diagnose, open and score a case, whose truth must still be the one that was sealed."""
    tool = functools.partial(_tool, reports)
    return run_case(draw_case(*cell), out, tool, beside)


def _tool(
    page: bool,
    recording: Path,
    ship: str,
    folder: Path,
    exclude: tuple[str, ...],
    healthy: Path | None = None,
) -> dict[str, Any]:
    """The tool under test: what ``shaftline diagnose`` does with the recording alone, or calibrated."""
    options = Options(exclude=exclude, calibrate=() if healthy is None else (healthy,))
    diagnosis = diagnose(load_ship(ship), recording, options=options)
    diagnosis.save(folder, page=page)
    return diagnosis.to_dict()
