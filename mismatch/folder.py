"""Diagnose each recording of a folder, and write an index of the results."""

from __future__ import annotations

import base64
import functools
import hashlib
import json
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from ..core.files import read_json, write_atomically, write_text
from ..core.sweep import source_digest, sweep
from ..plant.recording import PARQUET, SHEETS, read_table
from ..plant.ship import Ship
from .identification.parameters import Start
from .options import Options
from .pipeline import begin, diagnose
from .recordings.columns import load_map
from .recordings.time_base import first_day
from .report.index import PAGE, PDF, REPORT, SHIP, DiagnosisIndex, index_row

ENDINGS = (".csv", ".tsv", *PARQUET, *SHEETS)

_DATE = re.compile(r"(?<!\d)(\d{4})[-_.]?(\d{2})[-_.]?(\d{2})(?!\d)")


@dataclass(frozen=True)
class _Cell:
    """A recording for a worker, with the contents of its files where the worker shares no disk."""

    path: Path
    content: bytes | None = None
    columns: str | None = None
    effects: tuple[str, ...] | None = None


def find_recordings(folder: Path) -> dict[str, Path]:
    """Return the recordings of a folder by the name of their result folder.

    Raises:
        ValueError: the folder has no recording.
    """
    files = sorted(f for f in folder.iterdir() if f.is_file() and f.suffix.lower() in ENDINGS)
    files = [file for file in files if not file.name.startswith(".")]
    if not files:
        raise ValueError(
            f"{folder}: no recording in this folder; expected files that end in {', '.join(ENDINGS)}"
        )
    stems = [file.stem for file in files]
    return {f.stem if stems.count(f.stem) == 1 else f.name: f for f in files}


def diagnose_folder(
    folder: str | Path,
    ship: Ship,
    out: str | Path,
    options: Options = Options(),  # noqa: B008 (immutable)
    *,
    pdf: bool = False,
    jobs: int | None = None,
    backend: str = "processes",
    scheduler: str | None = None,
    tick: Callable[[], None] = lambda: None,
) -> DiagnosisIndex:
    """Diagnose every recording of a folder and write an index of the results.

    A recording that cannot be used is listed with its error; the other recordings are diagnosed all the
    same. Finished results are kept in ``out/cells``, under names that depend on the recording, the ship,
    the options and this package, so that an interrupted run can be resumed.

    Args:
        folder: folder of CSV, Parquet and spreadsheet files; its subfolders are ignored.
        ship: nominal ship of all recordings.
        out: folder for the results: one folder for each recording, ``index.html`` and ``index.csv``.
        options: column map, excluded effects, tolerances, free parameters, and a reference period on
            which the ship is calibrated once.
        pdf: whether to write ``report.pdf`` for each recording as well.
        jobs: number of processes (:func:`shaftline.core.sweep.sweep`).
        backend: ``processes`` or ``dask``.
        scheduler: address of a dask scheduler.
        tick: called after each recording.

    Returns:
        The index, largest mismatch first, with ``summary()``, ``to_dict()`` and ``save(folder)``; it is
        already written to ``out``.

    Raises:
        ValueError: the folder has no recording, or ``out`` is the same folder.
        SweepError: the backend is not available, or a diagnosis failed with an internal error; the index
            is written all the same.
    """
    folder, out = Path(folder), Path(out)
    options.check(ship)
    if out.resolve() == folder.resolve():
        raise ValueError(
            f"{out}: the results need another folder than the recordings; change --out"
        )
    if options.columns is not None:
        load_map(options.columns)
    files, kept = find_recordings(folder), out / "cells"
    start = begin(ship, options)
    waiting = {place: _cell_name(place, path, start, options, pdf) for place, path in files.items()}
    travels = backend == "dask"
    cells = {waiting[place]: _make_cell(path, options, travels) for place, path in files.items()}
    rows: dict[str, dict[str, Any]] = {}

    def write_finished() -> None:
        for place, name in list(waiting.items()):
            if (result := kept / f"{name}.json").is_file():
                rows[place] = _write_recording(place, files[place], read_json(result), out)
                del waiting[place]

    def progress() -> None:
        write_finished()
        tick()

    work = functools.partial(_diagnose_cell, start, replace(options, calibrate=()), pdf)
    try:
        sweep(work, cells, kept, jobs=jobs, backend=backend, scheduler=scheduler, tick=progress)
    finally:
        write_finished()
        for place, name in waiting.items():
            note, path = kept / f"{name}.error.txt", files[place]
            why = f"internal error, see cells/{note.name}" if note.is_file() else "not finished"
            rows[place] = index_row(path.name, recording_date(path, None), error=why)
        index = DiagnosisIndex.of(rows.values())
        if kept.is_dir():
            index.save(out)
    return index


def _cell_name(place: str, path: Path, start: Start, options: Options, pdf: bool) -> str:
    """Return the file name of a result, which depends on recording, ship, options and package."""
    used = (start, sorted(options.exclude), options.tolerance, options.steady, options.quick, pdf)
    files = [*([options.columns] if options.columns else []), *options.effects]
    texts = [Path(file).read_text(encoding="utf-8") for file in files]
    return cell_name(place, path, (*map(repr, used), *texts))


def cell_name(place: str, path: Path, texts: Iterable[str]) -> str:
    """Return the file name of a result that depends on a recording, on texts and on this package."""
    digest = hashlib.sha256(path.read_bytes())
    for text in (*texts, source_digest("core", "plant", "mismatch")):
        digest.update(text.encode() + b"\0")
    plain = "".join(c if c.isalnum() or c in "-._" else "-" for c in place)
    return f"{plain}_{digest.hexdigest()[:12]}"


def _make_cell(path: Path, options: Options, travels: bool) -> _Cell:
    if not travels:
        return _Cell(path)
    columns = Path(options.columns).read_text(encoding="utf-8") if options.columns else None
    effects = tuple(Path(file).read_text(encoding="utf-8") for file in options.effects)
    return _Cell(path, path.read_bytes(), columns, effects)


def _diagnose_cell(start: Ship | Start, options: Options, pdf: bool, cell: _Cell) -> dict[str, Any]:
    """Return the files of a diagnosis as text, or the error of a recording that cannot be used.

    The bytes of the PDF are encoded in base 64.
    """
    with tempfile.TemporaryDirectory() as name:
        place, path = Path(name), cell.path
        if cell.content is not None:
            path = place / cell.path.name
            path.write_bytes(cell.content)
        if cell.columns is not None:
            options = replace(options, columns=place / "map.toml")
            (place / "map.toml").write_text(cell.columns, encoding="utf-8")
        if cell.effects is not None:
            files = tuple(place / f"effects{i}.toml" for i in range(len(cell.effects)))
            options = replace(options, effects=files)
            for file, text in zip(files, cell.effects, strict=True):
                file.write_text(text, encoding="utf-8")
        try:
            diagnosis = diagnose(start, path, options=options)
        except (ValueError, OSError) as error:  # errors with a message for the user
            return {"error": str(error).replace(str(path), path.name)}
        results = diagnosis.save(place / "results", pdf=pdf)
        content = {
            file.relative_to(results).as_posix(): file.read_bytes()
            for file in results.rglob("*")
            if file.is_file()
        }
        printed = {"pdf": base64.b64encode(content.pop(PDF)).decode()} if pdf else {}
        return {
            "date": first_date(path, options.columns),
            "files": {name: text.decode() for name, text in content.items()},
        } | printed


def _write_recording(
    place: str, path: Path, result: Mapping[str, Any], out: Path
) -> dict[str, Any]:
    """Write the result files of a recording into its folder, and return its row of the index."""
    day = recording_date(path, result.get("date"))
    if "error" in result:
        for name in (REPORT, PAGE, PDF, SHIP):  # results of an earlier content of the recording
            (out / place / name).unlink(missing_ok=True)
        return index_row(path.name, day, error=result["error"])
    for name, text in result["files"].items():
        write_text(out / place / name, text)
    if "pdf" in result:
        content = base64.b64decode(result["pdf"])
        write_atomically(out / place / PDF, lambda file: file.write_bytes(content))
    report = json.loads(result["files"][REPORT])
    return index_row(path.name, day, report, link=f"{place}/{PAGE}")


def first_date(path: Path, columns: str | Path | None) -> str | None:
    """Return the date of the first time stamp; None where the recording has no dates."""
    if columns is None:
        return None
    given = load_map(columns)
    for name, source in given.columns.items():
        if (form := source.stamps) is not None:
            table = read_table(path, given.file.model_dump(exclude_none=True))
            return first_day(table[name], form or None)
    return None


def recording_date(path: Path, stamped: str | None) -> str:
    """Return the date of a recording: of its first time stamp, its file name, or the file itself."""
    if stamped is not None:
        return stamped
    if (found := _DATE.search(path.stem)) is not None:
        try:
            return date(*map(int, found.groups())).isoformat()
        except ValueError:  # the digits of the file name are not a date
            pass
    return str(datetime.fromtimestamp(path.stat().st_mtime, UTC).date())
