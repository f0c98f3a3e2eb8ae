"""The proof on concealed data: recordings of an independent reality, diagnosed, opened, scored.

Each case has a folder of its own: ``recording.csv`` and ``sealed.sha256`` before the tool runs, its
``report.json``, then ``truth.json`` and ``score.json``. Finished cases are kept, so a proof that was
interrupted goes on where it stopped.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from ..core.files import read_json, write_atomically, write_json, write_text
from ..display.tables import markdown
from .cases import Case, draw_case, sealed
from .recording import Reality, make
from .scoring import confusion, draw_confusion, score, table_of, tables_of
from .variants import PLAIN, VARIANTS, file_text

Diagnose = Callable[..., Mapping[str, Any]]
"""(recording, ship, folder for results, ids to be left out of the catalogue) -> ``report.json``; where
there is a healthy record, it is handed over by name, as ``healthy``."""

HEALTHY = "healthy.csv"

TOOL = "shaftline"


def case_folder(folder: Path, case: Case) -> Path:
    """Where a case's files lie."""
    return folder / f"case-{case.seed}-{case.index:04d}"


def _report(name: str, diagnose: Diagnose, place: Path, ship: str, case: Case) -> dict[str, Any]:
    """The report of one tool: kept if it is there, else made; a crash is a report, too."""
    path = place / ("report.json" if name == TOOL else f"report-{name}.json")
    if path.exists():
        kept: dict[str, Any] = read_json(path)
        return kept
    begin = time.perf_counter()
    try:
        given = {"healthy": place / HEALTHY} if case.healthy_programme else {}
        report = dict(diagnose(place / "recording.csv", ship, place / name, case.exclude, **given))
    except Exception as error:  # whatever a tool under test may raise is one of its results
        report = {"verdict": "failed", "error": f"{type(error).__name__}: {error}"}
    # numbers that are not finite count as absent
    finite: dict[str, Any] = json.loads(
        json.dumps(report, default=str), parse_constant=lambda _: None
    )
    finite["seconds_taken"] = time.perf_counter() - begin
    write_json(path, finite)
    return finite


def _lay_out(case: Case, reality: Reality, place: Path) -> tuple[str, str]:
    """Write what a tool may see; gives the ship and the seal."""
    ship, text = case.ship, file_text(case)
    if text is not None:
        ship = str(place / "ship.toml")
        write_text(place / "ship.toml", text)
    if (healthy := reality.healthy) is not None:
        write_atomically(place / HEALTHY, lambda file: healthy.to_csv(file, index=False))
    seal = sealed(reality.truth)
    write_text(place / "sealed.sha256", seal + "\n")
    write_atomically(
        place / "recording.csv", lambda file: reality.recording.to_csv(file, index=False)
    )
    return ship, seal


def run_case(
    case: Case,
    folder: Path,
    diagnose: Diagnose,
    beside: Mapping[str, Diagnose] | None = None,
    announce: Callable[[Case, str], object] | None = None,
) -> list[dict[str, Any]]:
    """Record, seal, diagnose, open and score one case; or read the score of a finished one.

    Args:
        case: from :func:`~.reality.cases.draw_case`.
        folder: of the whole proof.
        diagnose: the tool under test; it is given the recording, the ship and the ids to leave out.
        beside: other tools by name, run on the same recording and scored alike.
        announce: called with the seal before any tool runs.

    Returns:
        One row a tool, as of :func:`~.reality.scoring.score`.

    Raises:
        RuntimeError: the truth is not the one that was sealed.
    """
    place = case_folder(folder, case)
    done = place / "score.json"
    if done.exists():
        rows: list[dict[str, Any]] = read_json(done)
        return rows
    reality = make(case)
    before = place / "sealed.sha256"
    if before.exists() and before.read_text(encoding="utf-8").strip() != sealed(reality.truth):
        raise RuntimeError(f"{place}: the truth is not the one that was sealed; remove the folder")
    ship, seal = _lay_out(case, reality, place)
    if announce is not None:
        announce(case, seal)
    rows = []
    for name, tool in {TOOL: diagnose, **(beside or {})}.items():
        report = _report(name, tool, place, ship, case)
        row = score(name, report, reality.truth, reality)
        rows.append(row | {"seconds": report["seconds_taken"], "seal": seal})
    write_json(place / "truth.json", reality.truth)
    write_json(done, rows)
    return rows


def verify(place: Path) -> bool:
    """Whether a finished case's truth is the one that was sealed."""
    truth = read_json(place / "truth.json")
    return (place / "sealed.sha256").read_text(encoding="utf-8").strip() == sealed(truth)


def validate(
    cases: int | Iterable[int],
    seed: int,
    folder: Path,
    diagnose: Diagnose,
    *,
    variant: str = PLAIN,
    beside: Mapping[str, Diagnose] | None = None,
    announce: Callable[[Case, str], object] | None = None,
    progress: Callable[[list[dict[str, Any]]], object] | None = None,
) -> dict[str, pd.DataFrame]:
    """Run a whole proof, one case after the other, and write its page.

    Args:
        cases: how many, or which indices.
        seed: decides every case.
        folder: for the cases and the page.
        diagnose: the tool under test.
        variant: how the recordings are; of :data:`.variants.VARIANTS`.
        beside: other tools by name.
        announce: called with each case's seal before any tool sees its recording.
        progress: called with each finished case's rows.

    Returns:
        The tables of :func:`scores`.
    """
    for index in range(cases) if isinstance(cases, int) else cases:
        rows = run_case(draw_case(seed, index, variant), folder, diagnose, beside, announce)
        if progress is not None:
            progress(rows)
    tables = scores(folder)
    write_page(tables, folder, variant=variant)
    return tables


def scores(folder: Path) -> dict[str, pd.DataFrame]:
    """Tables of all finished cases in a folder.

    Returns:
        By name: ``cases`` (a row a case and tool), ``summary`` (each figure with its target, number of
        cases and 95 % interval), ``strength``, ``kinds``, ``effects`` and ``parameters``.

    Raises:
        FileNotFoundError: no case is finished.
    """
    rows: list[dict[str, Any]] = []
    for file in sorted(folder.glob("case-*/score.json")):
        rows += read_json(file)
    if not rows:
        raise FileNotFoundError(f"{folder}: no finished case")
    return tables_of(table_of(rows))


def write_page(
    tables: dict[str, pd.DataFrame],
    folder: Path,
    command: str = "shaftline validate",
    variant: str = PLAIN,
) -> Path:
    """Write ``validation.md``, its tables as ``validation-*.csv``, and the confusion matrix."""
    titles = {
        "summary": "What was to be shown",
        "strength": "Single effects by strength",
        "kinds": "What the verdicts amount to, by kind of case",
        "effects": "Single effects one by one",
        "parameters": "Parameters and their intervals",
    }
    count = tables["cases"]["index"].nunique()
    parts = ["# Validation on concealed effects", f"{count} cases, made by `{command}`.", PREFACE]
    if variant != PLAIN:
        parts.insert(2, f"Variant `{variant}`: {VARIANTS[variant]}.")
    for name, title in titles.items():
        table = tables[name]
        write_atomically(
            folder / f"validation-{name}.csv",
            partial(table.to_csv, index=False, float_format="%.6g"),
        )
        parts += [f"## {title}", markdown(table, 3) if len(table) else "No such case."]
    write_atomically(
        folder / "validation-cases.csv",
        partial(tables["cases"].to_csv, index=False, float_format="%.6g"),
    )
    grid = confusion(tables["cases"], TOOL)
    if len(grid):
        draw_confusion(grid, folder / "validation-confusion.png")
        parts += ["## Which was taken for which", "![Confusion matrix](validation-confusion.png)"]
    page = folder / "validation.md"
    write_text(page, "\n\n".join(parts) + "\n")
    return page


PREFACE = """\
Recordings come from a second ship, integrated by scipy with formulas of its own, whose effects have
other forms than the catalogue's. What a case conceals is sealed (SHA-256) before any tool sees its
recording. The strength of an effect is the rms of its change of the most affected reading, less what
wrong numbers within tolerance can imitate, over the rms of what the file's ship leaves of a recording
without the effect. Intervals are Wilson's, 95 %."""
