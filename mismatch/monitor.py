"""Monitor the condition of a ship: identify its parameters in each recording and compare them.

The statistics are those of :mod:`.condition`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from ..core.sweep import sweep
from ..plant.ship import Ship
from .condition import Change, Estimated, Monitoring, baseline_of, change_of, trend_of
from .folder import cell_name, find_recordings, first_date, recording_date
from .identification.free_parameters import AUTO
from .identify import DEFAULT, METHODS, identify

RISK = 0.01
"""Default probability that a recording without a change raises an alarm."""

LEAST_TREND = 3
"""Number of later recordings from which a trend is fitted."""


class MonitorError(ValueError):
    """Recordings that cannot be monitored; the message names the file and the reason."""


class _Job(NamedTuple):
    """Identification of a recording in a worker."""

    ship: Ship
    keys: tuple[str, ...]
    method: str
    columns: Path | None
    path: Path


def _identify(job: _Job) -> dict[str, Any]:
    """Return the date and the estimates of a recording, or the error of one that cannot be used."""
    try:
        found = identify(
            job.ship, job.path, free=job.keys or AUTO, method=job.method, columns=job.columns
        )
    except (ValueError, OSError) as error:  # errors with a message for the user
        return {"error": str(error).replace(str(job.path), job.path.name)}
    date = recording_date(job.path, first_date(job.path, job.columns))
    freedom = {e.key: e.freedom if math.isfinite(e.freedom) else None for e in found.estimates}
    return {
        "date": date,
        "parameters": {e.key: [e.value, e.standard_error, freedom[e.key]] for e in found.estimates},
        "units": {e.key: e.unit for e in found.estimates},
    }


def _cell_name(job: _Job) -> str:
    """Return the file name of a result, which depends on recording, ship, keys, method and package."""
    columns = job.columns.read_text(encoding="utf-8") if job.columns else ""
    return cell_name(job.path.stem, job.path, (repr(job.ship), repr(job.keys), job.method, columns))


def recordings_in(paths: Sequence[str | Path]) -> list[Path]:
    """Return the recordings that are given as files or folders, in that order.

    Raises:
        MonitorError: a path does not exist, or a recording is given twice.
        ValueError: a folder has no recording.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.exists():
            raise MonitorError(f"{path}: no such file or folder")
        found += find_recordings(path).values() if path.is_dir() else [path]
    seen: set[Path] = set()
    for path in found:
        if path.resolve() in seen:
            raise MonitorError(f"{path}: is given twice")
        seen.add(path.resolve())
    return found


def monitor(
    ship: Ship,
    references: Sequence[str | Path],
    recordings: Sequence[str | Path],
    out: str | Path,
    *,
    free: Sequence[str] | str = AUTO,
    method: str = DEFAULT,
    columns: str | Path | None = None,
    risk: float = RISK,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Monitoring:
    """Say which parameters of a ship have changed since its reference recordings, and by how much.

    A later recording that cannot be used is listed with its error. Finished identifications are kept in
    ``out/cells``, so that an interrupted run resumes.

    Args:
        ship: nominal ship.
        references: files or folders of recordings in the normal condition; three or more show the
            scatter between recordings.
        recordings: files or folders of later recordings.
        out: folder for intermediate results.
        free: dotted keys of the monitored parameters; ``auto``: those that the first reference
            recording identifies.
        method: method of identification, as in :func:`shaftline.mismatch.identify`.
        columns: column map of the recordings; None without one.
        risk: probability that a recording without a change raises an alarm, over all its parameters
            [-].
        jobs: number of processes, one for each core by default.
        tick: called after each recording.

    Raises:
        MonitorError: a recording is missing, stands on both sides or is given twice, or a reference
            recording cannot be used.
        ValueError: an unknown method or key, or a folder without recordings.
    """
    if not 0.0 < risk < 0.5:
        raise MonitorError(f"risk = {risk:g}: must lie between 0 and 0.5")
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; known: {', '.join(METHODS)}")
    normal, later = recordings_in(references), recordings_in(recordings)
    both = {path.resolve() for path in normal} & {path.resolve() for path in later}
    if both:
        raise MonitorError(f"{min(both)}: is a reference and a later recording")
    given = None if columns is None else Path(columns)
    job = functools.partial(_Job, ship, method=method, columns=given)
    kept = Path(out) / "cells"
    keys = () if isinstance(free, str) else tuple(free)
    if not keys:
        first = job(keys=(), path=normal[0])
        (chosen,) = sweep(_identify, {_cell_name(first): first}, kept, jobs=1).values()
        if "error" in chosen:
            raise MonitorError(f"{normal[0]}: {chosen['error']}")
        keys = tuple(chosen["parameters"])
    for key in keys:
        ship.parameter(key)  # refuses an unknown key before any recording is read
    jobs_of = {path: job(keys=keys, path=path) for path in (*normal, *later)}
    names = {path: _cell_name(one) for path, one in jobs_of.items()}
    cells = {names[path]: one for path, one in jobs_of.items()}
    results = sweep(_identify, cells, kept, jobs=jobs, tick=tick)
    found = {path: results[names[path]] for path in names}
    for path in normal:
        if "error" in found[path]:
            raise MonitorError(f"{path}: this reference cannot be used: {found[path]['error']}")
    return _compare(
        ship, method, risk, keys, {p: found[p] for p in normal}, {p: found[p] for p in later}
    )


def _estimate(result: Mapping[str, Any], key: str) -> Estimated:
    value, error, freedom = result["parameters"][key]
    return Estimated(value, error, math.inf if freedom is None else freedom)


def _compare(
    ship: Ship,
    method: str,
    risk: float,
    keys: tuple[str, ...],
    normal: Mapping[Path, dict[str, Any]],
    later: Mapping[Path, dict[str, Any]],
) -> Monitoring:
    """Compare the estimates of the later recordings with the normal values."""
    files = [path.name for path in (*normal, *later)]
    name = {
        path: path.name if files.count(path.name) == 1 else f"{path.parent.name}/{path.name}"
        for path in (*normal, *later)
    }
    used = {path: result for path, result in later.items() if "error" not in result}
    used = dict(sorted(used.items(), key=lambda item: (item[1]["date"], str(item[0]))))
    baselines = {key: baseline_of([_estimate(r, key) for r in normal.values()]) for key in keys}
    rows = []
    for path, result in used.items():
        for key in keys:
            estimate = _estimate(result, key)
            one = change_of(baselines[key], estimate, risk / len(keys))
            rows.append(
                {
                    "recording": name[path],
                    "date": result["date"],
                    "key": key,
                    "estimate": estimate.value,
                    "standard_error": estimate.standard_error,
                    **one._asdict(),
                    "alarm": one.alarm,
                }
            )
    dates = pd.to_datetime([result["date"] for result in used.values()])
    by_day = dates.nunique() > 1
    times = (dates - dates.min()).days.tolist() if by_day else list(range(len(used)))
    trends = {}
    if len(used) >= LEAST_TREND:
        trends = {
            key: trend_of(times, [_estimate(r, key) for r in used.values()], baselines[key].scatter)
            for key in keys
        }
    columns = ["recording", "date", "key", "estimate", "standard_error", *Change._fields, "alarm"]
    references = [
        {
            "recording": name[path],
            "date": result["date"],
            "key": key,
            "estimate": _estimate(result, key).value,
            "standard_error": _estimate(result, key).standard_error,
        }
        for path, result in normal.items()
        for key in keys
    ]
    remarks = []
    if len(normal) == 1:
        remarks.append(
            "one reference recording: the scatter between recordings is unknown and taken as 0, so "
            "there are more false alarms than stated; give three references or more"
        )
    elif len(normal) == 2:
        remarks.append(
            "two reference recordings: their scatter has one degree of freedom, so the thresholds are "
            "wide; give three references or more"
        )
    units = next(iter(normal.values()))["units"]
    return Monitoring(
        ship,
        method,
        risk,
        {key: units[key] for key in keys},
        baselines,
        pd.DataFrame(rows, columns=columns).astype({"alarm": bool}),
        pd.DataFrame(references),
        trends,
        "day" if by_day else "recording",
        {name[path]: result["error"] for path, result in later.items() if "error" in result},
        tuple(remarks),
    )
