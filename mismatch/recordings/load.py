"""A recording with long gaps, cut there into several.

A recording read from its file: by its column map, through every check, with its noise.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import (
    BOUNDS,
    COLUMNS,
    ELECTRIC_POWER,
    HEADING,
    SHAFT_ANGLE,
    SHAFT_POWER,
    SHAFT_SPEED,
    TIME,
    answered_columns,
    foreign_columns,
    input_columns,
)
from ...plant.recording import RecordingError, as_numbers, check_bounds, read_table
from ...plant.ship import Ship
from ...plant.terms import OF_A_TURN
from .checks import (
    at_end_stop,
    dull,
    pitch_swapped,
    refuse_complex,
    refuse_wrapped,
    standing,
    too_short,
    without_spikes,
)
from .columns import load_map
from .noise import Noise, describe, describe_command
from .reference_simulation import Yardstick
from .steady_rows import (
    NO_EQUILIBRIUM,
    complete_rows,
    noise_of_rows,
    refuse_without_drive,
    rows_are_steady,
    running_rows,
    why_steady,
    without_outliers,
)
from .time_base import LEAST_OF_ONE, filled, on_even_time, parts, spread, times_of, with_seconds
from .unit_errors import demands, impossible_demands, ranges_of

TABLE = "table"
"""Name of a recording in messages that is no file."""

CUT = "the recording was cut"
"""How the remark on the gaps begins."""

MOST_PARTS = 50
"""Parts into which a recording is cut at most; with more its time base is hardly one."""


def load_parts(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    signals: Mapping[str, str] = MappingProxyType({}),
    name: str = TABLE,
    steady: bool = False,
) -> list[Recording]:
    """Read a recording and cut it where more samples are missing than are filled in.

    Each part is checked, and later simulated from its own start. Parts of fewer than
    :data:`.time_base.LEAST_OF_ONE` rows are left out.

    Args:
        source: as of :func:`load_recording`, as are the others.
        ship: the nominal ship.
        columns: column map, or none.
        signals: units of further columns for terms.
        name: of a table, in messages.
        steady: as of :func:`load_recording`; rows that are equilibria need no cut.

    Returns:
        The parts in their order; the first one's warnings say where the recording was cut.

    Raises:
        RecordingError: as of :func:`load_recording`; also where the parts that are long enough hold
            less than half of the rows, or are too many.
    """
    refuse_other_types(source, ship, columns)
    path = Path(name) if isinstance(source, pd.DataFrame) else Path(source)
    raw, mapped = read_mapped(source, ship, columns, name)
    time = times_of(path, raw)
    if rows_are_steady(ship, raw, time, steady):
        return [checked(path, raw, mapped, ship, signals, steady)]
    found = parts(time)
    kept = [(a, b) for a, b in found if b - a >= LEAST_OF_ONE]
    rows = sum(b - a for a, b in kept)
    if len(found) == 1 or len(kept) > MOST_PARTS or 2 * rows < len(raw):
        return [checked(path, raw, mapped, ship, signals)]  # which refuses gaps
    cuts = [f"{time[a] - time[a - 1]:.4g} s before row {a + 1}" for a, _ in found[1:]]
    said = (
        f"{CUT} at {len(cuts)} gap{'s' * (len(cuts) > 1)} ({', '.join(cuts[:5])}"
        f"{', ...' if len(cuts) > 5 else ''}) into {len(kept)} parts, each simulated from its own start"
    )
    if rows < len(raw):
        said += f"; {len(raw) - rows} rows in parts of fewer than {LEAST_OF_ONE} rows were left out"
    result = []
    for number, (a, b) in enumerate(kept, 1):
        part = raw.iloc[a:b].reset_index(drop=True)
        part.attrs = raw.attrs if number == 1 else {}
        own = path.with_name(f"{path.name} part {number} (from row {a + 1})")
        result.append(checked(own, part, mapped, ship, signals))
    result[0] = replace(result[0], warnings=(said, *result[0].warnings))
    return result


OUTSIDE = {
    "drift_angle": "rad",
    "sway_speed": "m/s",
    "yaw_rate": "rad/s",
    "rudder_angle": "rad",
    "head_wind": "m/s",
    "side_wind": "m/s",
}
"""Names under which entries of the catalogue hear what a recording may hold besides, and units."""


@dataclass(frozen=True)
class Recording:
    """A recording that has passed the checks.

    Args:
        source: the file it came from.
        table: canonical columns as floats, (n,) rows on an even time base.
        interval_s: spacing of the rows [s].
        noise: noise of each measured or ordered channel, in the channel's unit.
        warnings: what was mended or looks odd; sentences for the reader.
        limits: what the recording cannot show, each beginning with "too short" or "dull".
        signals: unit of each column that is a signal for terms, by its name.
        steady: whether each row is an equilibrium at the inputs of that row.
    """

    source: Path
    table: pd.DataFrame
    interval_s: float
    noise: Mapping[str, Noise]
    warnings: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    signals: Mapping[str, str] = field(default_factory=dict)
    steady: bool = False

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.table)

    def __contains__(self, column: object) -> bool:
        """Whether a canonical column is present."""
        return column in self.table

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        """Values of a canonical column, (n,).

        Raises:
            KeyError: the recording does not have it.
        """
        return np.array(self.table[column], dtype=float)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of each row [s], (n,)."""
        return self[TIME]

    @property
    def channels(self) -> tuple[str, ...]:
        """Canonical columns that are present, the time left out."""
        return tuple(c for c in self.table if c != TIME)


def load_recording(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    signals: Mapping[str, str] = MappingProxyType({}),
    name: str = TABLE,
    steady: bool = False,
) -> Recording:
    """Read a recording and check it against the ship that made it.

    Args:
        source: CSV or Parquet file, one row a sample; or such a table, which passes the same checks.
        ship: the nominal ship; its end stops, and what it does under the recording's demands, tell
            another unit, a turned sign and swapped names from real differences.
        columns: TOML file that maps foreign names, units and signs (:mod:`.columns`); without it
            the file has canonical names and units. Columns that are neither canonical nor signals
            are left out.
        signals: units of columns that are kept as signals for terms where the file has them, by name,
            besides those of the ship and of the column map.
        name: of a table, in messages.
        steady: whether each row is an equilibrium at the inputs of that row; where rows are slower than
            the ship they are taken so in any case.

    Returns:
        The recording on an even time base. A recording too short or too dull to decide anything is
        no error; its ``limits`` say so.

    Raises:
        TypeError: an argument of another type; names it and says what is expected.
        RecordingError: naming file, column, row (from 1 below the header), unit and what is
            allowed. Unreadable; a column missing; values out of bounds, no numbers, or more than
            three missing in a row; time that does not rise, or with a gap of more than three
            samples; an angle that begins anew with every turn; a channel that is dead, in another unit,
            of the other sign or under another's name.
    """
    refuse_other_types(source, ship, columns)
    path = Path(name) if isinstance(source, pd.DataFrame) else Path(source)
    return checked(path, *read_mapped(source, ship, columns, name), ship, signals, steady)


def checked(
    path: Path,
    raw: pd.DataFrame,
    mapped: dict[str, str],
    ship: Ship,
    signals: Mapping[str, str],
    steady: bool = False,
) -> Recording:
    """A table under canonical names as a recording, through every check.

    Args:
        path: for messages.
        raw: as :func:`read_mapped` gives it.
        mapped: units of the signals of the column map.
        ship: the nominal ship.
        signals: units of further columns for terms.
        steady: whether the user says that each row is an equilibrium.
    """
    layout = raw.attrs.get("layout")
    warnings = [f"read as a table with {words}"] if layout and (words := layout.words()) else []
    warnings += raw.attrs.get("remarks", [])
    if not ship.turns:  # what it does not do itself its terms may hear
        others = {n: c for n, c in OF_A_TURN.items() if c in raw and n not in raw}
        raw = raw.assign(**{name: raw[column] for name, column in others.items()})
    heard = {n: u for n, u in {**signals, **ship.signals, **mapped}.items() if n in raw}
    turning = SHAFT_ANGLE if SHAFT_ANGLE in raw and SHAFT_SPEED not in raw else SHAFT_SPEED
    refuse_complex(path, raw, heard)
    raw, read = with_seconds(path, raw)
    warnings += read
    time = times_of(path, raw)
    asked, steady = steady, rows_are_steady(ship, raw, time, steady)
    if steady:
        turning = SHAFT_SPEED
        warnings.append(why_steady(ship, raw, time, asked))
        refuse_without_drive(path, raw, ship)
    foreign = foreign_columns(ship) | (NO_EQUILIBRIUM if steady else set())
    told = turning in raw or not {SHAFT_POWER, ELECTRIC_POWER} & set(raw) - foreign
    required = list(dict.fromkeys([*input_columns(ship), *([turning] * told), *ship.hears]))
    known = [*(c for c in COLUMNS if c in raw and c not in foreign), *sorted(heard)]
    if steady:
        raw, mended = complete_rows(path, raw, known, required)
        known = [column for column in known if column in raw]
    else:
        raw, mended = filled(path, raw, known)
    warnings += mended
    numbers = as_numbers(path, raw, required, heard)[known]
    if steady:
        numbers, mended = running_rows(path, numbers, ship)
        warnings += mended
    for even in () if steady else (spread, on_even_time):
        numbers, mended = even(path, numbers)
        warnings += mended
    orders = {*demands(ship, numbers), SHAFT_ANGLE, HEADING}  # an angle may begin anew
    measured = [c for c in answered_columns(ship) if c in numbers and c not in orders]
    table = numbers
    if not steady:
        table, mended = without_spikes(path, numbers, measured)
        warnings += mended
    refuse_wrapped(path, table)
    interval = (table[TIME].iloc[-1] - table[TIME].iloc[0]) / (len(table) - 1)
    yardstick = _refuse_slips(path, table, interval, ship, steady)
    check_bounds(path, table)
    if steady:
        table, mended = without_outliers(path, table, yardstick.sailed, measured)
        warnings += mended
    commands = demands(ship, table)
    noise = {
        c: (describe_command if c in commands else describe)(table[c].to_numpy(), interval)
        for c in table
        if c != TIME and c not in heard
    }
    if steady:
        at_rows = None if mended else yardstick.sailed
        for c in measured:
            own = noise_of_rows(table, at_rows, c, [*commands, *heard])
            noise[c] = replace(noise[c], white_rms=own)
    warnings += [*at_end_stop(table, ship), *standing(table, ship, noise, yardstick.sailed)]
    short = [] if steady else too_short([table], interval, ship)
    limits = (*short, *dull(table, ship, noise))
    return Recording(path, table, float(interval), noise, tuple(warnings), limits, heard, steady)


def refuse_other_types(source: object, ship: object, columns: object) -> None:
    """Raise a TypeError that says what is expected where an argument is of another type."""
    for name, given, types, expected in (
        ("source", source, (str, os.PathLike, pd.DataFrame), "the path of a file or a pandas.DataFrame"),
        ("ship", ship, Ship, 'a Ship, such as load_ship("frigate") returns'),
        ("columns", columns, (str, os.PathLike, type(None)), "the path of a column map, or None"),
    ):  # fmt: skip
        if not isinstance(given, types):  # type: ignore[arg-type]
            raise TypeError(f"{name} must be {expected}, not {type(given).__name__}")


def read_mapped(
    source: str | Path | pd.DataFrame,
    ship: Ship,
    columns: str | Path | None = None,
    name: str = TABLE,
) -> tuple[pd.DataFrame, dict[str, str]]:
    """A recording's table under canonical names and units, not yet checked; and units of its signals.

    Args:
        source: text, spreadsheet or Parquet file; or a table, to which the column map applies where it
            has one of the map's columns.
        ship: whose limits tell what percent of a range are.
        columns: column map, or none.
        name: of a table, in messages.

    Raises:
        RecordingError: file or map cannot be used.
    """
    given = None if columns is None else load_map(columns)
    if isinstance(source, pd.DataFrame):
        path, raw = Path(name), source
        if not raw.columns.is_unique:
            twice = raw.columns[raw.columns.duplicated()][0]
            raise RecordingError(f"{path}: column {twice!r} stands twice")
        if given is not None and not given.inputs & set(raw):
            given = None
    else:
        path = Path(source)
        raw = read_table(path, {} if given is None else given.file.model_dump(exclude_none=True))
    refuse_complex(path, raw, [*COLUMNS, *ship.signals, *(() if given is None else given.inputs)])
    if given is None:
        return raw, {}
    units = {source.signal: source.unit_in_expressions for source in given.signals.values()}
    mapped = given.apply(path, raw, ranges_of(ship))
    mapped.attrs = raw.attrs | {"remarks": list(given.remarks(ranges_of(ship)))}
    return mapped, units


def _refuse_slips(
    path: Path, table: pd.DataFrame, interval: float, ship: Ship, steady: bool
) -> Yardstick:
    """Return the reference simulation; raise a RecordingError where units, signs or names are wrong."""
    yardstick = Yardstick(ship, table, interval, steady)
    pair = yardstick.swapped()
    impossible = list(impossible_demands(table, ship))
    if pair is None and not impossible and (reason := yardstick.foreign()):
        raise RecordingError(f"{path}: {reason}")
    if dead := list(yardstick.dead()):
        raise RecordingError("\n".join(f"{path}: {sentence}" for sentence in dead))
    if pair is None and not steady and pitch_swapped(table, interval, ship):
        pair = ("pitch_ratio_command", "pitch_ratio")
    if pair is not None:
        a, b = (f"{c} (median {table[c].median():.4g} {BOUNDS[c][2]})" for c in pair)
        lag = set(pair) == {"pitch_ratio", "pitch_ratio_command"}
        why = "the order follows" if lag else "exchanged, they come far nearer to this ship"
        raise RecordingError(f"{path}: {a} and {b} look swapped: {why}")
    slips = impossible or list(yardstick.slips())
    if slips:
        raise RecordingError("\n".join(f"{path}: {sentence}" for sentence in slips))
    if yardstick.diverges:
        raise RecordingError(f"{path}: this ship cannot be driven by it: {yardstick.diverges}")
    return yardstick


def fetch(
    name: str, base_url: str, checksums: str | Path, folder: str | Path | None = None
) -> Path:
    """Download one file of a public collection, once, and check it.

    Args:
        name: file name, as in the list of checksums.
        base_url: address of the folder that holds the files (http or https).
        checksums: text file, one ``name sha256:...`` or ``name <hex>`` a line; ``#`` begins a comment.
        folder: where to keep the files; the user's cache folder by default.

    Returns:
        Path of the file; one that is there already with the right checksum is not fetched again.

    Raises:
        RecordingError: the name is not in the list, the address cannot be reached, or what came does
            not have the checksum.
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
