"""Survey a recording before a diagnosis: recognised columns, missing columns and what they would add."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...core.tables import Layout
from ...plant.columns import (
    BOUNDS,
    COLUMNS,
    ELECTRIC_POWER,
    OVER_GROUND,
    SHAFT_POWER,
    input_columns,
    simulated_columns,
)
from ...plant.recording import RecordingError, read_table
from ...plant.ship import Ship
from ...plant.terms import TURNING_SIGNALS
from .columns import ColumnMap, SignalSource, Source, load_map
from .course import speeds_remark
from .draft import draft_column_map, with_given_map
from .joint import refuse_too_few_rows
from .load import CUT, EXTRA_SIGNALS, Recording, load_parts
from .measured_pitch import PITCH, PITCH_COMMAND, follow_measured_pitch
from .remarks import remarks
from .steady_rows import NoDriveCommandError, drive_by_shaft_speed, missing_drive_remark

COSTS = {
    "shaft_torque_N_m": "losses of the drive and of its load are indistinguishable",
    "ship_speed_m_s": "effects on the hull, such as fouling or a current, are not identifiable",
    "pitch_ratio": "faults of the pitch actuator and of the propeller are indistinguishable",
    "thrust_N": "the propeller thrust is inferred from torque and ship speed alone",
    "motor_current_A": "losses of the motor and of its load are indistinguishable",
    "sway_speed_m_s": "effects on the side force are not identifiable",
    "yaw_rate_rad_s": "effects on the yaw moment are identifiable from the heading alone, or not at all",
}
"""Consequence of each measured column that is missing."""


@dataclass(frozen=True)
class Entry:
    """Column of a file and its meaning.

    Args:
        name: name in the file.
        column: canonical column or signal; empty if the column is left out.
        unit: unit of the canonical column or signal.
        low: smallest value in this unit; NaN if there is no number.
        high: largest value in this unit.
        missing: number of missing values.
    """

    name: str
    column: str
    unit: str
    low: float
    high: float
    missing: int


@dataclass(frozen=True)
class Survey:
    """Contents of a recording file and its use in a diagnosis.

    Args:
        path: the file.
        entries: columns of the file in their order.
        absent: consequence of each missing column that the ship model could use.
        recording: the checked recording; None if it is refused.
        refused: reasons for the refusal, one per line.
        layout: layout of the file if it is not plain CSV.
        begin: lines of a draft of a column map; empty if every column is recognised.
        remarks: implausible values of a usable recording; the data are not changed.
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
        """Yield all results except the table of the columns."""
        if (recording := self.recording) is not None:
            yield (
                f"{len(recording)} rows over {recording.time_s[-1] - recording.time_s[0]:.4g} s, one "
                f"every {recording.interval_s:.4g} s"
            )
            yield from (f"note: {warning}" for warning in recording.warnings)
            yield from (f"limit: {limit}" for limit in recording.limits)
            yield from (f"remark: {remark}" for remark in self.remarks)
        elif self.layout:
            yield f"note: read as a table with {self.layout}"
        left = [entry.name for entry in self.entries if not entry.column]
        if left:
            yield f"left out, neither canonical nor in the column map: {', '.join(left)}"
        yield from (f"without {column}: {cost}" for column, cost in self.absent.items())
        if self.recording is None:
            yield from (f"refused: {line}" for line in self.refused.splitlines())
            if self.begin:
                yield "column map: check these lines, complete them and use the file with --columns:"
            yield from self.begin
        else:
            yield "usable: `shaftline diagnose` accepts this recording"

    def table(self) -> list[dict[str, Any]]:
        """Return one row per column of the file, for a printed table or JSON."""
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
    """Survey a recording without a diagnosis.

    Example:
        >>> from shaftline.mismatch.example import COLUMN_MAP, FOLDER, RECORDING, SHIP_FILE
        >>> from shaftline.plant import load_ship
        >>> found = survey(FOLDER / RECORDING, load_ship(FOLDER / SHIP_FILE), FOLDER / COLUMN_MAP)
        >>> list(found.sentences())[0]
        '1401 rows over 700 s, one every 0.5 s'
        >>> list(found.absent)
        ['thrust_N']

    Args:
        path: file of the recording.
        ship: the nominal ship.
        columns: column map, or None.
        steady: whether each row is an equilibrium, as in :func:`.load.load_recording`.

    Raises:
        RecordingError: the column map cannot be used, or the file cannot be read. A recording that fails
            a check raises no error; the survey gives the reason.
    """
    path = Path(path)
    given = ColumnMap.model_construct() if columns is None else load_map(columns)
    raw = read_table(path, given.file.model_dump(exclude_none=True))
    recording, refused = None, ""
    no_drive: list[str] = []
    implausible: dict[str, None] = {}
    try:
        try:
            parts = load_parts(path, ship, columns, EXTRA_SIGNALS, steady=steady)
        except NoDriveCommandError:
            no_drive = [missing_drive_remark(ship)]
            ship = drive_by_shaft_speed(ship)
            parts = load_parts(path, ship, columns, EXTRA_SIGNALS, steady=steady)
        refuse_too_few_rows(parts)
        compared = ship
        if parts[0].measured_pitch:
            compared = follow_measured_pitch(ship, parts[0].interval_s)
        implausible = dict.fromkeys(_grouped_remarks(parts, compared))
        recording = replace(
            parts[0],
            table=pd.concat([part.table for part in parts], ignore_index=True),
            log=pd.concat([part.log for part in parts], ignore_index=True),
            warnings=(*no_drive, *_numbered_warnings(parts)),
            limits=tuple(dict.fromkeys(limit for part in parts for limit in part.limits)),
        )
        if not recording.over_ground:
            said = speeds_remark(recording.time_s, recording.navigation)
            implausible |= {said: None} if said else {}
    except RecordingError as error:
        refused = str(error).replace(f"{path}: ", "")
    entries = [
        _entry(name, raw[name], given.sources.get(name), recording, name in given.inputs)
        for name in raw.columns
    ]
    none = pd.Series(dtype=float)
    formulas = [source for source in given.sources.values() if source.formula is not None]
    entries += [_entry(f"= {source.formula}", none, source, recording) for source in formulas]
    have = {entry.column for entry in entries}
    stands_for: set[str] = set()
    if recording is not None and recording.measured_pitch:
        # The file may have the command under a name that the draft knows.
        have, stands_for = have - {PITCH_COMMAND} | {PITCH}, {PITCH_COMMAND}
    # Power divided by shaft speed is the torque.
    powers = {SHAFT_POWER} if ship.turns_freely else {SHAFT_POWER, ELECTRIC_POWER}
    useful = {
        "shaft_torque_N_m": not powers & have,
        "ship_speed_m_s": ship.moves and OVER_GROUND not in have,
        "motor_current_A": ship.has_voltage,
        "pitch_ratio": ship.has_variable_pitch,
    }
    wanted = [c for c in simulated_columns(ship) if c in COSTS and useful.get(c, True)]
    absent = {c: COSTS[c] for c in wanted if c not in have}
    needed = [c for c in input_columns(ship) if c not in have | stands_for]
    absent |= dict.fromkeys(needed, "the ship cannot be simulated")
    layout = raw.attrs.get("layout")
    left = raw[[entry.name for entry in entries if not entry.column]]
    begin = tuple(draft_column_map(ship, left, raw.attrs.get("units", {}), have))
    recognised = any(line.startswith('"') for line in begin)
    if recording is not None and not recognised:
        begin = ()
    if recording is None and not recognised and not given.sources:
        refused += f"\n{_where_names_are(layout)}"
    if begin and columns is not None:
        begin = tuple(with_given_map(given, begin))
    words = layout.description() if layout else ""
    return Survey(
        path, tuple(entries), absent, recording, refused, words, begin, tuple(implausible)
    )


def _where_names_are(layout: Layout | None) -> str:
    """Return what to do if the names of the columns were read from the wrong line or sheet."""
    line = f"line {layout.header_row}" if layout else "the header"
    sheet = ", and sheet, the name of the sheet" if layout and layout.sheet else ""
    return (
        f"no column is recognised by the names in {line}; if the names are elsewhere, set header_row, "
        f"their line, and unit_row, the line of the units{sheet}, under [file] in a column map"
    )


def _numbered_warnings(parts: Sequence[Recording]) -> Iterator[str]:
    """Yield the warnings on the parts of a recording, numbered if there are several parts."""
    for number, part in enumerate(parts, 1):
        for warning in part.warnings:
            numbered = len(parts) > 1 and not warning.startswith(CUT)
            yield f"part {number}: {warning}" if numbered else warning


_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


def _grouped_remarks(parts: Sequence[Recording], ship: Ship) -> Iterator[str]:
    """Yield the remarks on the parts of a recording; findings that differ in numbers only are one."""
    found: dict[str, tuple[str, list[int]]] = {}
    for number, part in enumerate(parts, 1):
        for remark in remarks(part, ship):
            finding, _, _ = remark.partition(";")
            found.setdefault(_NUMBER.sub("", finding), (remark, []))[1].append(number)
    for remark, numbers in found.values():
        if len(parts) == 1:
            yield remark
        elif len(numbers) == 1:
            yield f"part {numbers[0]}: {remark}"
        else:
            listed = ", ".join(map(str, numbers))
            yield f"parts {listed} alike, with the values of part {numbers[0]}: {remark}"


def _entry(
    name: str,
    values: pd.Series,
    source: Source | SignalSource | None,
    recording: Recording | None,
    used: bool = False,
) -> Entry:
    """Return the meaning of a column of the file, or of a formula, which the column map may use."""
    known = source.column if source is not None else name if name in COLUMNS else ""
    if recording is not None:
        # On a ship that does not turn, a column of turning is the signal of that name for terms.
        signals = {column: signal for signal, column in TURNING_SIGNALS.items()}
        stands_for = PITCH_COMMAND if known == PITCH and recording.measured_pitch else ""
        signal = name if name in recording.signals else ""
        names = (known, stands_for, signals.get(known, ""), signal)
        column = next((c for c in names if c and c in recording), "")
        numbers = recording[column] if column else np.array([])
        unit = recording.signals.get(column) or BOUNDS.get(column, ("", "", ""))[2]
    else:
        column, unit = known, "as recorded"
    if not column and used:
        column, unit = "in a formula", "as recorded"
    if unit == "as recorded":
        numbers = pd.to_numeric(values, errors="coerce").dropna().to_numpy(dtype=float)
    low, high = (numbers.min(), numbers.max()) if len(numbers) else (np.nan, np.nan)
    missing = pd.to_numeric(values, errors="coerce").isna()
    if 2 * missing.sum() > len(values):  # a column of dates or other text
        missing = values.isna()
    return Entry(name, column, unit, float(low), float(high), int(missing.sum()))


def _short(value: float) -> str:
    if np.isnan(value):
        return "–"
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e15 else f"{value:.4g}"
