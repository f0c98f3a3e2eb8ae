"""A folder of recordings, each diagnosed for itself, and the index of what was found where."""

from __future__ import annotations

import functools
import hashlib
import json
import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from ..core.files import read_json, write_text
from ..core.sweep import source_digest, sweep
from ..plant.recording import PARQUET, SHEETS, read_table
from ..plant.ship import Ship
from .diagnosis import SHIP
from .identification.start import Start
from .options import Options
from .pipeline import begin, diagnose
from .recordings.columns import load_map
from .recordings.time_base import first_day
from .report.index import PAGE, REPORT, DiagnosisIndex, row_of

ENDINGS = (".csv", ".tsv", *PARQUET, *SHEETS)

_DATE = re.compile(r"(?<!\d)(\d{4})[-_.]?(\d{2})[-_.]?(\d{2})(?!\d)")


@dataclass(frozen=True)
class _Cell:
    """A recording on its way to a worker; its content travels along where no disk is shared, as do the
    column map and effects of one's own.
    """

    path: Path
    content: bytes | None = None
    columns: str | None = None
    effects: tuple[str, ...] | None = None


def recordings_in(folder: Path) -> dict[str, Path]:
    """The recordings that stand in a folder, by the name of their results' folder.

    Raises:
        ValueError: there is none.
    """
    files = sorted(f for f in folder.iterdir() if f.is_file() and f.suffix.lower() in ENDINGS)
    files = [file for file in files if not file.name.startswith(".")]
    if not files:
        raise ValueError(f"{folder}: holds no recording ({', '.join(ENDINGS)})")
    stems = [file.stem for file in files]
    return {f.stem if stems.count(f.stem) == 1 else f.name: f for f in files}


def diagnose_folder(
    folder: str | Path,
    ship: Ship,
    out: str | Path,
    options: Options = Options(),  # noqa: B008 (immutable)
    *,
    jobs: int | None = None,
    backend: str = "processes",
    scheduler: str | None = None,
    tick: Callable[[], None] = lambda: None,
) -> DiagnosisIndex:
    """Diagnose every recording in a folder and write an index of what was found.

    A recording that cannot be used is listed with its error and does not stop the rest. What is
    finished is kept in ``out/cells`` under a name that changes with the file's content, the ship, the
    options and this package, so an interrupted run goes on where it stopped.

    Args:
        folder: CSV and Parquet files; folders within are left alone.
        ship: the nominal ship of all.
        out: gets a folder a recording, ``index.html`` and ``index.csv``.
        options: column map, ids to leave out, tolerance; a healthy period, on which the ship is
            calibrated once, numbers that are free.
        jobs: see :func:`shaftline.core.sweep.sweep`, as for the backend and the scheduler.
        backend: ``processes`` or ``dask``.
        scheduler: address of a dask scheduler.
        tick: called after each recording.

    Returns:
        The index, worst first, with ``summary()``, ``to_dict()`` and ``save(folder)``; it stands in
        ``out`` already.

    Raises:
        ValueError: no recording in the folder, or ``out`` is the same folder.
        SweepError: a backend that is not there, or a recording on which the tool itself failed; the
            index is written all the same.
    """
    folder, out = Path(folder), Path(out)
    options.check(ship)
    if out.resolve() == folder.resolve():
        raise ValueError(f"{out}: results need another folder than the recordings")
    if options.columns is not None:
        load_map(options.columns)
    files = recordings_in(folder)
    start = begin(ship, options)
    names = {place: _name(place, path, start, options) for place, path in files.items()}
    travels = backend == "dask"
    cells = {names[place]: _cell(path, options, travels) for place, path in files.items()}
    waiting = dict(names)
    rows: dict[str, dict[str, Any]] = {}

    def lay_out() -> None:
        for place, name in list(waiting.items()):
            kept = out / "cells" / f"{name}.json"
            if kept.is_file():
                result = read_json(kept)
                rows[place] = _laid_out(place, files[place], result, out)
                del waiting[place]

    def arrived() -> None:
        lay_out()
        tick()

    work = functools.partial(_work, start, replace(options, calibrate=()))
    try:
        sweep(
            work, cells, out / "cells",
            jobs=jobs, backend=backend, scheduler=scheduler, tick=arrived,
        )  # fmt: skip
    finally:
        lay_out()
        for place, name in waiting.items():
            note = out / "cells" / f"{name}.error.txt"
            why = f"the tool failed, see cells/{note.name}" if note.is_file() else "not finished"
            rows[place] = row_of(files[place].name, _date(files[place], None), error=why)
        if (out / "cells").is_dir():
            DiagnosisIndex.of(rows.values()).save(out)
    return DiagnosisIndex.of(rows.values())


def _name(place: str, path: Path, start: Start, options: Options) -> str:
    """File name of a cell; differs where the recording, the ship, an option or the tool differs."""
    digest = hashlib.sha256(path.read_bytes())
    said = [repr(start), repr(sorted(options.exclude)), repr(options.tolerance)]
    said.append(repr(options.steady))
    files = [*([options.columns] if options.columns else []), *options.effects]
    said += [Path(file).read_text(encoding="utf-8") for file in files]
    for text in (*said, source_digest("core", "plant", "mismatch")):
        digest.update(text.encode() + b"\0")
    plain = "".join(c if c.isalnum() or c in "-._" else "-" for c in place)
    return f"{plain}_{digest.hexdigest()[:12]}"


def _cell(path: Path, options: Options, travels: bool) -> _Cell:
    if not travels:
        return _Cell(path)
    columns = Path(options.columns).read_text(encoding="utf-8") if options.columns else None
    effects = tuple(Path(file).read_text(encoding="utf-8") for file in options.effects)
    return _Cell(path, path.read_bytes(), columns, effects)


def _work(start: Ship | Start, options: Options, cell: _Cell) -> dict[str, Any]:
    """The files of a diagnosis as text, or the error of a recording that cannot be used."""
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
        except (ValueError, OSError) as error:  # written for the reader
            return {"error": str(error).replace(str(path), path.name)}
        diagnosis.save(place / "results")
        return {
            "date": _first_date(path, options),
            "files": {f.name: f.read_text("utf-8") for f in (place / "results").iterdir()},
        }


def _laid_out(place: str, path: Path, result: Mapping[str, Any], out: Path) -> dict[str, Any]:
    """Put a finished recording's files into its folder; gives its row of the index."""
    day = _date(path, result.get("date"))
    if "error" in result:
        for name in (REPORT, PAGE, SHIP):  # of the recording as it was
            (out / place / name).unlink(missing_ok=True)
        return row_of(path.name, day, error=result["error"])
    for name, text in result["files"].items():
        write_text(out / place / name, text)
    report = json.loads(result["files"][REPORT])
    return row_of(path.name, day, report, link=f"{place}/{PAGE}")


def _first_date(path: Path, options: Options) -> str | None:
    """Date of the first time stamp, where the recording has dates."""
    if options.columns is None:
        return None
    given = load_map(options.columns)
    stamped = [(name, s.stamps) for name, s in given.columns.items() if s.stamps is not None]
    if not stamped:
        return None
    (name, form), table = stamped[0], read_table(path, given.file.model_dump(exclude_none=True))
    return first_day(table[name], form or None)


def _date(path: Path, stamped: str | None) -> str:
    """When it was recorded: by the first time stamp, else the file's name, else the file's own date."""
    if stamped is not None:
        return stamped
    if (found := _DATE.search(path.stem)) is not None:
        try:
            return date(*map(int, found.groups())).isoformat()
        except ValueError:  # digits that are no date
            pass
    return str(datetime.fromtimestamp(path.stat().st_mtime, UTC).date())
