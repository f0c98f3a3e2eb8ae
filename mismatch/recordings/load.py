"""Read one recording: read the file, map its columns, clean the values, check them against the ship."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import (
    BOUNDS,
    COLUMNS,
    COURSE,
    ELECTRIC_POWER,
    HEADING,
    LOG_COLUMNS,
    OVER_GROUND,
    RUDDER,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    SHIP_SPEED,
    TIME,
    TURNING_COLUMNS,
    YAW_RATE,
    absent_columns,
    input_columns,
    simulated_columns,
)
from ...plant.recording import RecordingError, check_bounds, convert_numbers, read_table
from ...plant.ship import Ship
from ...plant.signals import LOG_SIGNALS
from ...plant.terms import TURNING_SIGNALS
from .checks import (
    constant_channel_warnings,
    end_stop_warnings,
    insufficient_excitation,
    length_limits,
    pitch_columns_swapped,
    refuse_complex,
    remove_spikes,
    wrapped_angle_errors,
)
from .columns import load_map
from .course import over_ground_warning, turning_rows, wind_signals
from .logger_names import split_name
from .measured_pitch import MEASURED_PITCH, follow_measured_pitch, use_measured_pitch
from .noise import Noise, estimate_command_noise, estimate_noise
from .reference_simulation import ReferenceSimulation
from .steady_rows import (
    NO_EQUILIBRIUM,
    drop_incomplete_rows,
    drop_outliers,
    estimate_row_noise,
    keep_running_rows,
    refuse_without_drive,
    rows_are_steady,
    steady_rows_remark,
)
from .time_base import (
    FEWEST_ROWS,
    Cleaned,
    complete_log,
    convert_dates,
    fill_missing,
    resample_evenly,
    split_at_gaps,
    spread_coarse_clock,
    time_in_seconds,
)
from .unit_errors import command_columns, command_ranges, impossible_commands

TABLE = "table"  # name in messages of a recording that is a table and not a file
CUT = "the recording was cut"  # first words of the warning on a recording that was cut at its gaps
MOST_PARTS = 50  # largest number of parts into which a recording is cut at its gaps
EXTRA_SIGNALS = {
    "drift_angle": "rad",
    "sway_speed": "m/s",
    "yaw_rate": "rad/s",
    "rudder_angle": "rad",
    "head_wind": "m/s",
    "side_wind": "m/s",
}
"""Unit of each optional signal of a recording that effects of the catalogue use, by signal name."""


@dataclass(frozen=True)
class Recording:
    """Recording that has passed the checks.

    Args:
        source: the file that was read.
        table: canonical columns as floats, (n,) rows on an even time base.
        interval_s: sampling interval [s].
        noise: noise of each measured or commanded channel, in the unit of the channel.
        warnings: sentences on values that were repaired or look implausible.
        limits: sentences on effects that the recording cannot identify; each begins with "too short" or
            "insufficient excitation".
        signals: unit of each column that is a signal for terms, by name.
        steady: whether each row is an equilibrium at the inputs of that row.
        log: columns of a ship's log that no simulation of the ship gives, such as wind, course and
            draught, at the same rows.
        over_ground: whether ``ship_speed_m_s`` is the speed over ground.
        through_water: whether the name of its column says that it is the speed through the water.
        measured_pitch: whether ``pitch_ratio_command`` is the measured pitch, in the place of a missing
            command.
    """

    source: Path
    table: pd.DataFrame
    interval_s: float
    noise: Mapping[str, Noise]
    warnings: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    signals: Mapping[str, str] = field(default_factory=dict)
    steady: bool = False
    log: pd.DataFrame = field(default_factory=pd.DataFrame)
    over_ground: bool = False
    through_water: bool = False
    measured_pitch: bool = False

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.table)

    def __contains__(self, column: object) -> bool:
        """Return whether the recording has a canonical column."""
        return column in self.table or column in self.log

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """Return the values of a canonical column, (n,).

        Raises:
            KeyError: the recording does not have the column.
        """
        table = self.log if column in self.log else self.table
        return np.array(table[column], dtype=float)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of each row [s], (n,)."""
        return self[TIME]

    @property
    def navigation(self) -> Mapping[str, NDArray[np.float64]]:
        """Values of each column of the table and of the log, (n,)."""
        return {str(c): self[str(c)] for c in (*self.log, *self.table)}

    @property
    def channels(self) -> tuple[str, ...]:
        """Canonical columns that a simulation uses or gives, and signals, without the time."""
        return tuple(c for c in self.table if c != TIME)


def load_recording(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    signals: Mapping[str, str] = MappingProxyType({}),
    name: str = TABLE,
    steady: bool = False,
) -> Recording:
    """Read a recording, map its columns, clean its values and check them against the ship.

    Example:
        >>> from shaftline.mismatch.example import COLUMN_MAP, FOLDER, RECORDING, SHIP_FILE
        >>> from shaftline.plant import load_ship
        >>> ship = load_ship(FOLDER / SHIP_FILE)
        >>> recording = load_recording(FOLDER / RECORDING, ship, FOLDER / COLUMN_MAP)
        >>> len(recording), round(recording.interval_s, 3)
        (1401, 0.5)
        >>> recording.channels[:3]
        ('fuel_rack_mm', 'pitch_ratio_command', 'pitch_ratio')

    Args:
        source: CSV, spreadsheet or Parquet file with one row per sample; or a table with these columns.
        ship: the nominal ship. Its end stops and its simulation with the recorded commands distinguish
            unit errors, sign errors and swapped columns from real differences.
        columns: TOML file that maps the names, units and signs of the logger (:mod:`.columns`); without
            it the file has canonical names and units. Other columns are left out.
        signals: units of columns that are kept as signals for terms if the file has them, by name, in
            addition to those of the ship and of the column map.
        name: name of a table in messages.
        steady: whether each row is an equilibrium. Rows that are far enough apart for the ship to
            settle between them are treated as equilibria in any case.

    Returns:
        The recording on an even time base. A recording that is too short or has insufficient excitation
        raises no error; its ``limits`` say so.

    Raises:
        TypeError: an argument has another type; the message says which type is expected.
        RecordingError: the message gives file, column, row (counted from 1 below the header), unit and
            allowed range. The file cannot be read; a column is missing; values are out of bounds, are
            not numbers, or more than three in a row are missing; time does not rise, or has a gap of
            more than three samples; the shaft angle restarts at each turn; a channel is constant, has
            another unit, the opposite sign or the name of another channel.
    """
    check_argument_types(source, ship, columns)
    path = Path(name) if isinstance(source, pd.DataFrame) else Path(source)
    table, signal_units = read_canonical(source, ship, columns, name)
    units = {**signals, **ship.signals, **signal_units}
    return _with_over_ground_warning([clean_and_check(path, table, units, ship, steady)])[0]


def load_parts(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    signals: Mapping[str, str] = MappingProxyType({}),
    name: str = TABLE,
    steady: bool = False,
) -> list[Recording]:
    """Read a recording and cut it at each gap that is too long to be interpolated.

    Each part is checked, and is later simulated from its own first row. Parts of fewer than
    :data:`.time_base.FEWEST_ROWS` rows are left out. Rows that are equilibria are not cut. The arguments
    are those of :func:`load_recording`.

    Returns:
        The parts in order of time; the warnings of the first part say where the recording was cut.

    Raises:
        RecordingError: as in :func:`load_recording`; also if there are more than :data:`MOST_PARTS`
            parts, or if the parts that are long enough hold less than half of the rows.
    """
    check_argument_types(source, ship, columns)
    path = Path(name) if isinstance(source, pd.DataFrame) else Path(source)
    raw, signal_units = read_canonical(source, ship, columns, name)
    units = {**signals, **ship.signals, **signal_units}
    time = time_in_seconds(path, raw)
    if rows_are_steady(ship, raw, time, steady):
        return _with_over_ground_warning([clean_and_check(path, raw, units, ship, steady)])
    intervals = split_at_gaps(time)
    kept = [(a, b) for a, b in intervals if b - a >= FEWEST_ROWS]
    rows = sum(b - a for a, b in kept)
    if len(intervals) == 1 or len(kept) > MOST_PARTS or 2 * rows < len(raw):
        # If there are gaps, this call reports them as an error.
        return _with_over_ground_warning([clean_and_check(path, raw, units, ship)])
    cuts = [f"{time[a] - time[a - 1]:.4g} s before row {a + 1}" for a, _ in intervals[1:]]
    short = f"; {len(raw) - rows} rows in parts of fewer than {FEWEST_ROWS} rows were left out"
    warning = (
        f"{CUT} at {len(cuts)} gap{'s' * (len(cuts) > 1)} ({', '.join(cuts[:5])}"
        f"{', ...' if len(cuts) > 5 else ''}) into {len(kept)} parts; each part is simulated from its "
        f"own first row{short if rows < len(raw) else ''}"
    )
    result = []
    for number, (a, b) in enumerate(kept, 1):
        part = raw.iloc[a:b].reset_index(drop=True)
        part.attrs = (
            raw.attrs if number == 1 else {name: raw.attrs.get(name) for name in _STANDS_FOR}
        )
        part_path = path.with_name(f"{path.name} part {number} (from row {a + 1})")
        result.append(clean_and_check(part_path, part, units, ship, continues=number > 1))
    result[0] = replace(result[0], warnings=(warning, *result[0].warnings))
    return _with_over_ground_warning(result)


def _with_over_ground_warning(parts: list[Recording]) -> list[Recording]:
    """Return the parts of a recording, the first with a warning if their speed is over ground."""
    if not parts[0].over_ground:
        return parts
    said = over_ground_warning([part.navigation for part in parts])
    return [replace(parts[0], warnings=(*parts[0].warnings, said)), *parts[1:]]


def check_argument_types(source: object, ship: object, columns: object) -> None:
    """Raise a TypeError that names the expected type if an argument has another type."""
    for name, given, types, expected in (
        (
            "source",
            source,
            (str, os.PathLike, pd.DataFrame),
            "the path of a file or a pandas.DataFrame",
        ),
        ("ship", ship, Ship, 'a Ship, such as load_ship("frigate") returns'),
        ("columns", columns, (str, os.PathLike, type(None)), "the path of a column map, or None"),
    ):
        if not isinstance(given, types):  # type: ignore[arg-type]
            raise TypeError(f"{name} must be {expected}, not {type(given).__name__}")


def read_canonical(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    name: str = TABLE,
) -> tuple[pd.DataFrame, dict[str, str]]:
    """Read a recording and map it to canonical names and units; nothing is cleaned or checked yet.

    The column map is applied to a table only if the table has one of the columns of the map. The ranges
    of the ship define values in percent of range.

    Returns:
        The table, and the unit of each signal of the column map by signal name.

    Raises:
        RecordingError: the file or the column map cannot be used.
    """
    column_map = None if columns is None else load_map(columns)
    inputs = set() if column_map is None else column_map.inputs
    if isinstance(source, pd.DataFrame):
        path, raw = Path(name), source
        if not raw.columns.is_unique:
            repeated = raw.columns[raw.columns.duplicated()][0]
            raise RecordingError(
                f"{path}: column {repeated!r} occurs twice; rename or drop one of the two columns"
            )
        if not inputs & set(raw):
            column_map = None
    else:
        path = Path(source)
        layout = {} if column_map is None else column_map.file.model_dump(exclude_none=True)
        raw = read_table(path, layout)
    refuse_complex(path, raw, [*COLUMNS, *ship.signals, *inputs])
    if column_map is None:
        return _use_what_stands_for(raw, ship), {}
    ranges = command_ranges(ship)
    mapped = column_map.apply(path, raw, ranges)
    sources = column_map.columns.items()
    speeds = [split_name(name) for name, source in sources if source.column == SHIP_SPEED]
    cells = raw.attrs.get("text_cells", {})
    texts = {
        name: source.column
        for name, source in column_map.sources.items()
        if name in cells and source.formula is None
    }
    mapped.attrs = raw.attrs | {
        "remarks": [
            *raw.attrs.get("remarks", []),
            *(cells[name].remark(name) for name in texts),
            *column_map.remarks(ranges),
        ],
        "texts": {column: cells[name].description(name) for name, column in texts.items()},
        "over_ground": any(name.is_over_ground for name in speeds),
        "through_water": any(name.is_through_water for name in speeds),
    }
    mapped = _use_what_stands_for(mapped, ship)
    if column_map.rows.leave_out_turns:
        mapped = _leave_out_turns(path, mapped)
    return mapped, {one.signal: one.unit_in_expressions for one in column_map.signals.values()}


_STANDS_FOR = ("over_ground", "through_water", "measured_pitch")
"""Attributes of a canonical table: what its speed is, and whether its command is the measured pitch."""


def _use_what_stands_for(table: pd.DataFrame, ship: Ship) -> pd.DataFrame:
    """Return a table in which a speed over ground stands for a missing speed through water.

    A measured pitch stands for a missing command likewise.
    """
    table = use_measured_pitch(table, ship)
    if not ship.moves or SHIP_SPEED in table or OVER_GROUND not in table:
        return table
    given = table.assign(**{SHIP_SPEED: table[OVER_GROUND]})
    given.attrs = table.attrs | {"over_ground": True}
    return given


def _leave_out_turns(path: Path, table: pd.DataFrame) -> pd.DataFrame:
    """Return the table without the rows in which the ship turns.

    Raises:
        RecordingError: no column shows a turn, or fewer than :data:`.time_base.FEWEST_ROWS` rows remain.
    """
    shown = [c for c in (COURSE, HEADING, RUDDER, YAW_RATE) if c in table]
    if not shown:
        raise RecordingError(
            f"{path}: leave_out_turns needs a column that shows a turn: {HEADING}, {COURSE}, {YAW_RATE} "
            f"or {RUDDER}"
        )
    columns, _ = complete_log(table[shown], shown)
    time = pd.Series(time_in_seconds(path, table)).interpolate(limit_direction="both")
    clock, _ = spread_coarse_clock(path, pd.DataFrame({TIME: time}))
    rows = turning_rows(clock[TIME].to_numpy(), columns)
    if len(table) - rows.sum() < FEWEST_ROWS:
        raise RecordingError(
            f"{path}: the ship turns in {rows.sum()} of {len(table)} rows; at least {FEWEST_ROWS} other "
            "rows are needed: remove leave_out_turns from the column map"
        )
    kept = table[~rows].reset_index(drop=True)
    said = f"{rows.sum()} of {len(table)} rows were left out, in which the ship turns"
    kept.attrs = table.attrs | {"remarks": [*table.attrs["remarks"], said]}
    return kept


@dataclass
class _Draft:
    """Recording while it is cleaned and checked; the stages change its table and its warnings."""

    path: Path
    ship: Ship
    table: pd.DataFrame
    signals: dict[str, str]
    steady: bool
    known: list[str]
    required: list[str]
    warnings: list[str]
    log: list[str]
    over_ground: bool
    through_water: bool
    measured_pitch: bool
    continues: bool = False

    def apply(self, step: Cleaned) -> bool:
        """Take over the table and the warnings of a cleaning step; return whether there were any."""
        self.table, warnings = step
        self.warnings += warnings
        return bool(warnings)

    @property
    def interval_s(self) -> float:
        """Sampling interval [s]."""
        time = self.table[TIME]
        return float((time.iloc[-1] - time.iloc[0]) / (len(time) - 1))

    @property
    def measured(self) -> list[str]:
        """Measured channels; without angles, which may jump by a full turn."""
        others = {*command_columns(self.ship, self.table), SHAFT_ANGLE, HEADING}
        return [c for c in simulated_columns(self.ship) if c in self.table and c not in others]

    @cached_property
    def impossible_commands(self) -> list[str]:
        """Errors on commands outside the range of the ship."""
        return list(impossible_commands(self.table, self.ship))

    @cached_property
    def reference(self) -> ReferenceSimulation:
        """Simulation of the nominal ship with the recorded commands."""
        ship = (
            follow_measured_pitch(self.ship, self.interval_s) if self.measured_pitch else self.ship
        )
        return ReferenceSimulation(ship, self.table, self.interval_s, self.steady)

    @property
    def swapped_columns(self) -> tuple[str, str] | None:
        """Two columns that look swapped; the first part of a file decides for all of its parts."""
        return None if self.continues else self.reference.swapped_columns


def clean_and_check(
    path: Path,
    table: pd.DataFrame,
    units: Mapping[str, str],
    ship: Ship,
    steady: bool = False,
    continues: bool = False,
) -> Recording:
    """Return the recording of a table of :func:`read_canonical` after all cleaning steps and checks.

    ``units`` are those of signals for terms, by name; signals that the table does not have are ignored.
    A table that ``continues`` is a later part of a file, whose first part has passed the checks. Other
    arguments and errors are as in :func:`load_recording`.
    """
    draft = _prepare(path, table, units, ship, steady)
    draft.continues = continues
    _clean(draft)
    for check in CHECKS:
        if errors := list(check(draft)):
            raise RecordingError("\n".join(f"{path}: {error}" for error in errors))
    return _finish(draft)


def _prepare(
    path: Path, table: pd.DataFrame, units: Mapping[str, str], ship: Ship, steady: bool
) -> _Draft:
    """Convert time stamps to seconds and select the columns that the ship and its terms use."""
    layout = table.attrs.get("layout")
    words = layout.description() if layout else ""
    warnings = [f"read as a table with {words}"] if words else []
    warnings += table.attrs.get("remarks", [])
    warnings += [MEASURED_PITCH] * bool(table.attrs.get("measured_pitch"))
    speed = SHAFT_ANGLE if SHAFT_ANGLE in table and SHAFT_SPEED not in table else SHAFT_SPEED
    table, converted = convert_dates(path, table)
    warnings += converted
    time = time_in_seconds(path, table)
    requested, steady = steady, rows_are_steady(ship, table, time, steady)
    if steady:
        speed = SHAFT_SPEED
        warnings.append(steady_rows_remark(ship, table, time, requested))
        refuse_without_drive(path, table, ship)
    log = [c for c in (*LOG_COLUMNS, *TURNING_COLUMNS) if c in table]
    log = [c for c in log if c in LOG_COLUMNS or steady or not ship.turns]
    refuse_complex(path, table, log)
    table, completed = complete_log(table, log)
    warnings += completed
    log = [column for column in log if column in table]
    if HEADING in table and HEADING not in log:  # The heading of the model is continuous.
        table = table.assign(**{HEADING: _continuous(table[HEADING])})
    # Terms may depend on a turn that the equations of the ship do not have, and on the log.
    named = {one.name: one.column for one in LOG_SIGNALS} | ({} if ship.turns else TURNING_SIGNALS)
    given = {name: table[c] for name, c in named.items() if c in log} | wind_signals(table[log])
    table = table.assign(**{n: v for n, v in given.items() if n in units and n not in table})
    signals = {name: unit for name, unit in units.items() if name in table}
    refuse_complex(path, table, signals)
    unused = absent_columns(ship) | (NO_EQUILIBRIUM if steady else set())
    needs_speed = speed in table or not {SHAFT_POWER, ELECTRIC_POWER} & set(table) - unused
    needed = [*input_columns(ship), *([speed] * needs_speed), *ship.external_signals]
    channels = [c for c in COLUMNS if c in table and c not in unused and c not in log]
    known = [*channels, *sorted(signals), *log]
    required = list(dict.fromkeys(needed))
    stands_for = (bool(table.attrs.get(name)) for name in _STANDS_FOR)
    return _Draft(path, ship, table, signals, steady, known, required, warnings, log, *stands_for)


def _continuous(angle: pd.Series) -> pd.Series:
    """Return an angle [rad] without jumps of a full turn; gaps and text stay as they are."""
    numbers = pd.to_numeric(angle, errors="coerce")
    known = numbers.dropna()
    if (known.diff().abs() <= np.pi).iloc[1:].all():
        return angle
    return angle.where(
        numbers.isna(), pd.Series(np.unwrap(known), known.index).reindex(angle.index)
    )


def _clean(draft: _Draft) -> None:
    """Fill in or drop missing values, convert to floats, resample evenly and remove spikes."""
    path, required, signals = draft.path, draft.required, draft.signals
    if draft.steady:
        draft.apply(drop_incomplete_rows(path, draft.table, draft.known, required))
        known = [column for column in draft.known if column in draft.table]
        draft.table = convert_numbers(path, draft.table, required, signals)[known]
        draft.apply(keep_running_rows(path, draft.table, draft.ship))
        return
    draft.apply(fill_missing(path, draft.table, draft.known))
    draft.table = convert_numbers(path, draft.table, required, signals)[draft.known]
    draft.apply(spread_coarse_clock(path, draft.table))
    draft.apply(resample_evenly(path, draft.table))
    draft.apply(remove_spikes(path, draft.table, draft.measured))


def _wrong_ship(draft: _Draft) -> Iterable[str]:
    if draft.swapped_columns is None and not draft.impossible_commands:
        yield from draft.reference.wrong_ship_errors()


def _swapped_columns(draft: _Draft) -> Iterable[str]:
    pair, table = draft.swapped_columns, draft.table
    dynamic = pair is None and not draft.steady
    if dynamic and pitch_columns_swapped(table, draft.interval_s, draft.ship):
        pair = ("pitch_ratio_command", "pitch_ratio")
    if pair is not None:
        a, b = (f"{c} (median {table[c].median():.4g} {BOUNDS[c][2]})" for c in pair)
        why = "exchanged, they agree much better with the simulation of this ship"
        if set(pair) == {"pitch_ratio", "pitch_ratio_command"}:
            why = "the command follows the measurement"
        yield f"{a} and {b} look swapped: {why}; exchange the two names in the header or the column map"


def _diverging_simulation(draft: _Draft) -> Iterable[str]:
    if why := draft.reference.divergence:
        yield (
            f"the nominal ship cannot be simulated with the recorded commands: {why}; check the units "
            "of the commands and the ship file"
        )


def _values_out_of_bounds(draft: _Draft) -> Iterable[str]:
    check_bounds(draft.path, draft.table)
    return ()


CHECKS: tuple[Callable[[_Draft], Iterable[str]], ...] = (
    lambda draft: wrapped_angle_errors(draft.table),
    _wrong_ship,
    lambda draft: draft.reference.dead_channel_errors(),
    _swapped_columns,
    lambda draft: draft.impossible_commands or draft.reference.unit_errors(),
    _diverging_simulation,
    _values_out_of_bounds,
)
"""Checks of a cleaned recording; each yields error sentences, and the first with errors is reported.

The order matters: a wrong ship or a swapped column would also appear as unit errors of other columns.
"""


def _finish(draft: _Draft) -> Recording:
    """Return the recording with its noise, its warnings and its limits."""
    ship, signals, interval, measured = draft.ship, draft.signals, draft.interval_s, draft.measured
    simulated = draft.reference.simulated
    dropped = False
    if draft.steady:
        dropped = draft.apply(drop_outliers(draft.path, draft.table, simulated, measured))
    log = draft.table[draft.log]
    draft.table = draft.table.drop(columns=draft.log)
    table, commands = draft.table, command_columns(ship, draft.table)
    noise = {
        c: (estimate_command_noise if c in commands else estimate_noise)(v.to_numpy(), interval)
        for c, v in table.items()
        if c != TIME and c not in signals
    }
    if draft.steady:
        at_rows = None if dropped else simulated
        for c in measured:
            rms = estimate_row_noise(table, at_rows, c, [*commands, *signals])
            noise[c] = replace(noise[c], white_rms=rms)
    constant = constant_channel_warnings(table, ship, noise, simulated)
    warnings = (*draft.warnings, *end_stop_warnings(table, ship), *constant)
    too_short = [] if draft.steady else length_limits([table], interval, ship)
    limits = (*too_short, *insufficient_excitation(table, ship, noise))
    return Recording(
        draft.path,
        table,
        interval,
        noise,
        warnings,
        limits,
        signals,
        draft.steady,
        log,
        draft.over_ground,
        draft.through_water,
        draft.measured_pitch,
    )


def fetch(
    name: str, base_url: str, checksums: str | Path, folder: str | Path | None = None
) -> Path:
    """Download one file of a public collection and verify its checksum.

    A file that is in the folder with the right checksum is not downloaded again.

    Args:
        name: file name, as in the list of checksums.
        base_url: address of the folder that holds the files (http or https).
        checksums: text file with one line ``name sha256:...`` or ``name <hex>`` per file; ``#`` begins
            a comment.
        folder: folder for downloaded files; the cache folder of the user by default.

    Returns:
        Path of the file.

    Raises:
        RecordingError: the name is not in the list, the address cannot be reached, or the downloaded
            file has another checksum.
    """
    import pooch

    store: Any = pooch.create(
        path=folder or pooch.os_cache("shaftline"),
        base_url=base_url if base_url.endswith("/") else f"{base_url}/",
        retry_if_failed=1,
    )
    try:
        store.load_registry(str(checksums))
        return Path(store.fetch(name))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{name} from {base_url}: {error}") from None
