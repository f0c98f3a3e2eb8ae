"""What of a recording is understood, what is missing, and what that costs: before any diagnosis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...plant.columns import (
    BOUNDS,
    COLUMNS,
    ELECTRIC_POWER,
    SHAFT_POWER,
    answered_columns,
    input_columns,
)
from ...plant.recording import RecordingError, read_table
from ...plant.ship import Ship
from ...plant.terms import OF_A_TURN
from .columns import Heard, Source, load_map
from .draft import first_map
from .joint import refuse_few
from .load import CUT, OUTSIDE, Recording, load_parts
from .remarks import remarks
from .steady_rows import NoDriveCommandError, led_by_speed, remark_on

COSTS = {
    "shaft_torque_N_m": "a loss of the engine and one of the propeller look alike",
    "ship_speed_m_s": "the hull does not show: neither fouling nor current",
    "pitch_ratio": "a fault of the pitch actuator looks like one of the propeller",
    "thrust_N": "the propeller's thrust is judged by torque and ship speed alone",
    "motor_current_A": "a loss of the motor and one of its load look alike",
    "sway_speed_m_s": "the side force is not judged",
    "yaw_rate_rad_s": "the turning moment is judged by the heading alone, or not at all",
}
"""What cannot be told without a measured column."""


@dataclass(frozen=True)
class Entry:
    """One column of a file.

    Args:
        name: in the file.
        column: canonical column or signal that it is; empty where it is left out.
        unit: of that.
        low: least value there [unit]; NaN where none can be told.
        high: greatest.
        missing: how many values are missing.
    """

    name: str
    column: str
    unit: str
    low: float
    high: float
    missing: int


@dataclass(frozen=True)
class Survey:
    """What a recording's file holds.

    Args:
        path: of the file.
        entries: its columns, in their order.
        absent: measured columns that the ship could answer and the file does not have, and the cost.
        recording: as it would be diagnosed; None where it is refused.
        refused: why, a line each.
        layout: how the file was read, where that is not plain.
        begin: lines of a column map to begin with; none where nothing is left to be understood.
        remarks: what is odd in a recording that can be used; the data are not changed.
    """

    path: Path
    entries: tuple[Entry, ...]
    absent: dict[str, str]
    recording: Recording | None
    refused: str = ""
    layout: str = ""
    begin: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    def sentences(self) -> Iterator[str]:
        """Everything besides the table of the columns."""
        if (found := self.recording) is not None:
            yield (
                f"{len(found)} rows over {found.time_s[-1] - found.time_s[0]:.4g} s, one every "
                f"{found.interval_s:.4g} s"
            )
            yield from (f"note: {said}" for said in found.warnings)
            yield from (f"limit: {said}" for said in found.limits)
            yield from (f"remark: {said}" for said in self.remarks)
        elif self.layout:
            yield f"note: read as a table with {self.layout}"
        left = [entry.name for entry in self.entries if not entry.column]
        if left:
            yield f"left out, as neither canonical nor in the column map: {', '.join(left)}"
        yield from (f"without {column}: {cost}" for column, cost in self.absent.items())
        if self.recording is None:
            yield from (f"refused: {line}" for line in self.refused.splitlines())
            if self.begin:
                yield "a column map might begin so (--columns takes it):"
            yield from self.begin
        else:
            yield "usable: `shaftline diagnose` takes it as it is"

    def table(self) -> list[dict[str, Any]]:
        """A row a column, for a printed table or JSON."""
        return [
            {
                "in the file": entry.name,
                "understood as": entry.column or "-",
                "from": _short(entry.low),
                "to": _short(entry.high),
                "unit": entry.unit,
                "noise": _short(self._noise(entry.column)),
                "missing": entry.missing,
            }
            for entry in self.entries
        ]

    def _noise(self, column: str) -> float:
        found = None if self.recording is None else self.recording.noise.get(column)
        return float("nan") if found is None else found.white_rms


def survey(
    path: str | Path, ship: Ship, columns: str | Path | None = None, steady: bool = False
) -> Survey:
    """Look at a recording without diagnosing it.

    Args:
        path: as of :func:`.load_recording`.
        ship: the nominal ship.
        columns: column map, or none.
        steady: whether each row is an equilibrium, as of :func:`.load.load_recording`.

    Raises:
        RecordingError: the column map cannot be used, or the file cannot be read at all.
    """
    path = Path(path)
    given = None if columns is None else load_map(columns)
    raw = read_table(path, {} if given is None else given.file.model_dump(exclude_none=True))
    sources = {} if given is None else given.sources
    recording, refused, led = None, "", ""
    odd: tuple[str, ...] = ()
    try:
        try:
            found = load_parts(path, ship, columns, OUTSIDE, steady=steady)  # as a diagnosis
        except NoDriveCommandError:
            led = remark_on(ship)
            ship = led_by_speed(ship)
            found = load_parts(path, ship, columns, OUTSIDE, steady=steady)
        refuse_few(found)
        recording = replace(
            found[0], table=pd.concat([part.table for part in found], ignore_index=True),
            warnings=(*([led] if led else []), *_named(found)),
            limits=tuple(dict.fromkeys(said for part in found for said in part.limits)),
        )  # fmt: skip
        odd = tuple(dict.fromkeys(said for part in found for said in remarks(part, ship)))
    except RecordingError as error:
        recording = None
        refused = str(error).replace(f"{path}: ", "")
    used = set() if given is None else given.inputs
    entries = tuple(
        _entry(name, raw[name], sources.get(name), recording, name in used) for name in raw.columns
    )
    none = pd.Series(dtype=float)
    entries += tuple(
        _entry(f"= {source.formula}", none, source, recording)
        for source in sources.values()
        if source.formula is not None
    )
    have = {entry.column for entry in entries}
    wanted = [c for c in answered_columns(ship) if c in COSTS and c not in have]
    powers = {SHAFT_POWER} if ship.turns_freely else {SHAFT_POWER, ELECTRIC_POWER}
    if powers & have:  # power over shaft speed is the torque
        wanted = [c for c in wanted if c != "shaft_torque_N_m"]
    if not ship.moves:
        wanted = [c for c in wanted if c != "ship_speed_m_s"]
    if not ship.has_voltage:
        wanted = [c for c in wanted if c != "motor_current_A"]
    if not ship.has_variable_pitch:
        wanted = [c for c in wanted if c != "pitch_ratio"]
    absent = {c: COSTS[c] for c in wanted}
    absent |= {c: "the ship cannot be driven" for c in input_columns(ship) if c not in have}
    layout = raw.attrs.get("layout")
    left = raw[[entry.name for entry in entries if not entry.column]]
    begin = tuple(first_map(ship, left, raw.attrs.get("units", {}), have))
    if recording is not None and not any(line.startswith('"') for line in begin):
        begin = ()
    return Survey(
        path, entries, absent, recording, refused, layout.words() if layout else "", begin, odd
    )


def _named(parts: Sequence[Recording]) -> Iterator[str]:
    """Warnings on the parts of a recording, each with its part where there are several."""
    for number, part in enumerate(parts, 1):
        for said in part.warnings:
            several = len(parts) > 1 and not said.startswith(CUT)
            yield f"part {number}: {said}" if several else said


def _entry(
    name: str,
    values: pd.Series,
    source: Source | Heard | None,
    recording: Recording | None,
    used: bool = False,
) -> Entry:
    """Return what is understood of a column.

    Args:
        name: in the file, or the formula.
        values: as recorded.
        source: of the column map, or none.
        recording: None where it is refused.
        used: whether the column map uses it, be it in a formula.
    """
    known = source.column if source is not None else name if name in COLUMNS else ""
    if recording is not None:
        heard = {
            column: signal for signal, column in OF_A_TURN.items()
        }  # by a ship that runs straight
        names = (known, heard.get(known, ""), name if name in recording.signals else "")
        column = next(
            (c for c in names if c and c in recording), ""
        )  # else the ship has no such thing
        numbers = recording[column] if column else np.array([])
        unit = recording.signals.get(column) or BOUNDS.get(column, ("", "", ""))[2]
    else:
        column, unit = known, "as recorded"
        numbers = pd.to_numeric(values, errors="coerce").dropna().to_numpy(dtype=float)
    if not column and used:
        column, unit = "in a formula", "as recorded"
        numbers = pd.to_numeric(values, errors="coerce").dropna().to_numpy(dtype=float)
    low, high = (numbers.min(), numbers.max()) if len(numbers) else (np.nan, np.nan)
    return Entry(name, column, unit, float(low), float(high), int(values.isna().sum()))


def _short(value: float) -> str:
    return (
        "–" if np.isnan(value) else f"{value:.0f}" if 1e4 <= abs(value) < 1e15 else f"{value:.4g}"
    )
