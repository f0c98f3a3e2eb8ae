"""Run a validation on concealed effects: simulate recordings, seal the truth, diagnose and score.

Each case has its own folder: ``recording.csv`` and ``sealed.sha256`` before the tool runs, then
``report.json``, ``truth.json`` and ``score.json``. Finished cases are kept, so that an interrupted
validation can be resumed.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from ..core.files import read_json, write_atomically, write_json, write_text
from ..display.tables import markdown
from .cases import Case, hash_truth
from .recording import SimulatedCase, simulate_case
from .scoring import confusion, draw_confusion, score, table_of, tables_of
from .variants import PLAIN, TITLES, VARIANTS, file_text

Diagnose = Callable[..., Mapping[str, Any]]
"""Function of (recording, ship, folder for results, excluded ids) that returns ``report.json``; the
recording of a reference period is passed as a keyword argument."""

HEALTHY = "healthy.csv"

TOOL = "shaftline"


def case_folder(folder: Path, case: Case) -> Path:
    """Return the folder of a case."""
    return folder / f"case-{case.seed}-{case.index:04d}"


def _report(name: str, diagnose: Diagnose, place: Path, ship: str, case: Case) -> dict[str, Any]:
    """Return the report of one tool, from its file if there is one; an exception is a result too."""
    path = place / ("report.json" if name == TOOL else f"report-{name}.json")
    if path.exists():
        kept: dict[str, Any] = read_json(path)
        return kept
    begin = time.perf_counter()
    try:
        given = {"healthy": place / HEALTHY} if case.healthy_programme else {}
        report = dict(diagnose(place / "recording.csv", ship, place / name, case.exclude, **given))
    except Exception as error:  # any exception of the tool under test is a result
        report = {"verdict": "failed", "error": f"{type(error).__name__}: {error}"}
    # Values that are not finite count as absent.
    text = json.dumps(report, default=str)
    finite: dict[str, Any] = json.loads(text, parse_constant=lambda _: None)
    finite["seconds_taken"] = time.perf_counter() - begin
    write_json(path, finite)
    return finite


def _lay_out(case: Case, simulated: SimulatedCase, place: Path) -> tuple[str, str]:
    """Write the files that a tool may use; return the ship and the seal."""
    ship, text = case.ship, file_text(case)
    if text is not None:
        ship = str(place / "ship.toml")
        write_text(place / "ship.toml", text)
    if simulated.healthy is not None:
        write_atomically(place / HEALTHY, partial(simulated.healthy.to_csv, index=False))
    seal = hash_truth(simulated.truth)
    write_text(place / "sealed.sha256", seal + "\n")
    recording = partial(simulated.recording.to_csv, index=False)
    write_atomically(place / "recording.csv", recording)
    return ship, seal


def run_case(
    case: Case,
    folder: Path,
    diagnose: Diagnose,
    beside: Mapping[str, Diagnose] | None = None,
) -> list[dict[str, Any]]:
    """Simulate, seal, diagnose and score one case, or read the score of a finished case.

    Args:
        case: case from :func:`.cases.draw_case`.
        folder: folder of the validation.
        diagnose: tool under test.
        beside: other tools by name, run on the same recording.

    Returns:
        One row of :func:`.scoring.score` for each tool.

    Raises:
        RuntimeError: the truth differs from the sealed truth.
    """
    place = case_folder(folder, case)
    done = place / "score.json"
    if done.exists():
        rows: list[dict[str, Any]] = read_json(done)
        return rows
    simulated = simulate_case(case)
    before, own = place / "sealed.sha256", hash_truth(simulated.truth)
    if before.exists() and before.read_text(encoding="utf-8").strip() != own:
        raise RuntimeError(f"{place}: the truth differs from the sealed truth; remove the folder")
    ship, seal = _lay_out(case, simulated, place)
    rows = []
    for name, tool in {TOOL: diagnose, **(beside or {})}.items():
        report = _report(name, tool, place, ship, case)
        row = score(name, report, simulated.truth, simulated)
        rows.append(row | {"seconds": report["seconds_taken"], "seal": seal})
    write_json(place / "truth.json", simulated.truth)
    write_json(done, rows)
    return rows


def scores(folder: Path) -> dict[str, pd.DataFrame]:
    """Return the tables of all finished cases in a folder.

    Returns:
        Tables by name: ``cases`` (one row for each case and tool), ``summary`` (each figure with target,
        number of cases and 95 % interval), ``strength``, ``kinds``, ``effects`` and ``parameters``.

    Raises:
        FileNotFoundError: the folder has no finished case.
    """
    files = sorted(folder.glob("case-*/score.json"))
    rows: list[dict[str, Any]] = [row for file in files for row in read_json(file)]
    if not rows:
        raise FileNotFoundError(f"{folder}: no finished case")
    return tables_of(table_of(rows))


def write_page(
    tables: dict[str, pd.DataFrame], folder: Path, command: str, variant: str = PLAIN
) -> Path:
    """Write ``validation.md``, its tables as ``validation-*.csv``, and the confusion matrix."""
    titles = {
        "summary": "Figures and targets",
        "strength": "Single effects by strength",
        "kinds": "Outcomes by kind of case",
        "effects": "Single effects by id",
        "parameters": "Parameters and their intervals",
    }
    count = tables["cases"]["index"].nunique()
    parts = [f"# {TITLES[variant]}", f"{count} cases, made by `{command}`.", PREFACE]
    if variant != PLAIN:
        parts.insert(2, f"Variant `{variant}`: {VARIANTS[variant]}.")
    for name, table in tables.items():
        text = partial(table.to_csv, index=False, float_format="%.6g")
        write_atomically(folder / f"validation-{name}.csv", text)
    for name, title in titles.items():
        table = tables[name]
        parts += [f"## {title}", markdown(table, 3) if len(table) else "No such case."]
    grid = confusion(tables["cases"], TOOL)
    if len(grid):
        draw_confusion(grid, folder / "validation-confusion.png")
        parts += ["## Confusion matrix", "![Confusion matrix](validation-confusion.png)"]
    page = folder / "validation.md"
    write_text(page, "\n\n".join(parts) + "\n")
    return page


PREFACE = """\
The recordings come from an independent simulator with its own equations, whose effects have other forms
than the catalogue's. The concealed effects are sealed (SHA-256) before any tool reads the recording. The
strength of an effect is the rms of its change of the most affected channel, less the part that biased
parameters within tolerance can imitate, relative to the rms residual of the ship file without the
effect. Intervals are Wilson's, 95 %."""
