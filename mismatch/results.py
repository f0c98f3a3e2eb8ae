"""From recordings on disk to a diagnosis, and from a diagnosis to the files that it leaves behind."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.files import write_json, write_text
from ..plant.recording import RecordingError
from ..plant.ship import Ship
from ..plant.ship_files import write_ship
from .diagnosis import Diagnosis, diagnose
from .recordings import Recording, load_recording
from .report import as_json
from .search.catalogue import applicable
from .search.selection import Tick

REPORT, PAGE, SHIP = "report.json", "report.html", "corrected_ship.toml"
"""Names of the files of a diagnosis."""

LEAST_ROWS = 40
"""Of a recording, so that there is something to fit and something to set aside."""


@dataclass(frozen=True)
class Options:
    """How to diagnose, whatever the recording.

    Args:
        columns: column map of the recordings (:mod:`.recordings.columns`), or none.
        exclude: ids of the catalogue to leave out.
        tolerance: factor on the tolerances of the ship's numbers.
    """

    columns: Path | None = None
    exclude: tuple[str, ...] = ()
    tolerance: float = 1.0

    def check(self, ship: Ship) -> None:
        """Refuse what no recording could mend, before any is read.

        Raises:
            ValueError: an unknown id, or a tolerance that is no factor.
        """
        applicable(ship, (), self.exclude)
        if not (math.isfinite(self.tolerance) and self.tolerance >= 0.0):
            raise ValueError(f"tolerance {self.tolerance:g}: a factor of at least 0 is needed")


def diagnose_files(
    ship: Ship,
    recordings: Sequence[Path],
    hold_out: Sequence[Path] = (),
    options: Options = Options(),
    tick: Tick = lambda stage, done, total: None,
) -> Diagnosis:
    """Read recordings of one condition of a ship, check them and diagnose them together.

    Args:
        ship: the nominal ship.
        recordings: CSV or Parquet files, to be fitted.
        hold_out: files set aside to judge on; without them a quarter of the longest is set aside.
        options: column map, ids to leave out, tolerance.
        tick: told the stage, how much is done, and how much there is.

    Raises:
        RecordingError: a recording or the column map cannot be used; names file, column and row.
        ValueError: no recording, recordings that do not go together, one that is given twice, an
            unknown id.
        ShipError: a ship that cannot be simulated.
    """
    options.check(ship)
    paths = [*recordings, *hold_out]
    if not recordings:
        raise ValueError("no recording to fit: give at least one that is not set aside")
    twice = [path for i, path in enumerate(paths) if path in paths[:i]]
    if twice:
        raise ValueError(f"{twice[0]} is given twice; what is set aside must not be fitted")
    loaded = []
    for done, path in enumerate(paths):
        tick("reading and checking", done, len(paths))
        recording = load_recording(path, ship, options.columns)
        if len(recording) < LEAST_ROWS:
            raise RecordingError(f"{path}: {len(recording)} rows; at least {LEAST_ROWS} are needed")
        loaded.append(recording)
    tick("reading and checking", len(paths), len(paths))
    limits, warnings = _said(loaded[: len(recordings)], loaded)
    return diagnose(
        ship,
        *(recording.table for recording in loaded),
        exclude=options.exclude,
        held_out_runs=len(hold_out),
        tolerance=options.tolerance,
        limits=limits,
        warnings=warnings,
        tick=tick,
    )


def _said(fitted: list[Recording], loaded: list[Recording]) -> tuple[list[str], list[str]]:
    """Limits and warnings of all recordings; several are named, and limit only where all do."""
    if len(loaded) == 1:
        return list(loaded[0].limits), list(loaded[0].warnings)

    def named(part: Iterable[Recording], attribute: str) -> list[str]:
        return [f"{r.source.name}: {said}" for r in part for said in getattr(r, attribute)]

    warnings = named(loaded, "warnings")
    if all(recording.limits for recording in fitted):
        return named(fitted, "limits"), warnings
    return [], warnings + named(loaded, "limits")


def write_results(diagnosis: Diagnosis, folder: Path, page: bool = True) -> dict[str, Any]:
    """Write ``report.json``, ``report.html`` and ``corrected_ship.toml``.

    All is made before anything is written, and each file is renamed into place.

    Args:
        diagnosis: of :func:`diagnose_files`.
        folder: made where needed.
        page: whether ``report.html`` with its figures is wanted.

    Returns:
        What stands in ``report.json``.

    Raises:
        OSError: the folder cannot be written to.
    """
    report: dict[str, Any] = _finite(as_json(diagnosis))
    text = ""
    if page:
        from .report.html import report_html  # draws: loaded only where a page is wanted

        text = report_html(diagnosis)
    write_json(folder / REPORT, report)
    write_ship(diagnosis.corrected, folder / SHIP)
    if page:
        write_text(folder / PAGE, text)
    return report


def _finite(value: Any) -> Any:
    """The same data with numbers that are not finite as null: an interval may have no end."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
