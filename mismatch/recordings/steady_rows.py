"""Clean recordings of equilibria: rows so far apart that the ship settles between them.

Nothing is interpolated between such rows. A row that lacks a value or cannot be an equilibrium is left
out; gaps and missing days do not matter.

Logs of ships in service have the shaft speed, seldom the fuel rack. A recording without the command of
the prime mover is compared with a ship whose shaft turns at the recorded speed. Each row is then the
equilibrium of hull and propeller at this speed, and the prime mover is not diagnosed.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import (
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_SPEED,
    TIME,
    TURNING_COLUMNS,
    drive_column,
)
from ...plant.drives.speed_source import held_speed_source
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from .checks import find_spikes
from .noise import row_noise
from .time_base import Cleaned, refuse_falling_time
from .unit_errors import top_speed

Array = NDArray[np.float64]

SETTLED = 2.0
"""Interval in surge time constants of the ship from which each row is an equilibrium. The thrust falls
with the ship speed as well, so that the ship settles nearly twice as fast as the constant indicates."""

NO_EQUILIBRIUM = frozenset({SHAFT_ANGLE, RUDDER_COMMAND, *TURNING_COLUMNS})
"""Columns that an equilibrium straight ahead does not have."""

_SLOW_ROWS_S = 5.0
_USUAL_SPEED_M_S = 5.0
_STANDS = 0.1  # share of the 90th percentile of a speed below which a shaft or a ship stands still
_MOSTLY = 0.5  # share of missing values above which a column is left out
_MOST_OUTLIERS = 0.05  # largest share of spikes among the rows
_EVEN = 0.01  # largest deviation of an even step, as a share of the usual step


def surge_time_constant(ship: Ship, table: pd.DataFrame) -> float:
    """Return mass over the slope of the resistance at the median recorded speed [s]; 0 for a fixed hull.

    The table has canonical columns, before cleaning.
    """
    if not ship.moves:
        return 0.0
    speed = _USUAL_SPEED_M_S
    if "ship_speed_m_s" in table:
        known = pd.to_numeric(table["ship_speed_m_s"], errors="coerce").abs().median()
        speed = float(known) if math.isfinite(known) else speed
    return ship.hull.mass_kg / ship.hull.resistance_slope(max(speed, 1.0))


def median_step(time: Array) -> float:
    """Return the median of the positive steps of time [s]; 0 if there are none."""
    steps = np.diff(time)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    return float(np.median(steps)) if len(steps) else 0.0


def rows_are_steady(ship: Ship, table: pd.DataFrame, time: Array, asked: bool = False) -> bool:
    """Return whether each row of a recording is an equilibrium: on request, or by its sampling interval.

    The table has canonical columns, before cleaning; ``time`` is that of each row [s], shape (rows,).
    """
    usual = median_step(time)
    return asked or usual >= max(SETTLED * surge_time_constant(ship, table), 1.01 * _SLOW_ROWS_S)


def steady_rows_remark(ship: Ship, table: pd.DataFrame, time: Array, asked: bool) -> str:
    """Return the warning that each row is treated as an equilibrium, with the reason."""
    surge, usual = surge_time_constant(ship, table), median_step(time)
    why = "as requested"
    if not asked:
        why = f"because the rows are {usual:.4g} s apart"
        if surge > 0.0:
            why += f" and the surge time constant of the ship is {surge:.2g} s"
    return (
        f"each row is treated as an equilibrium of the ship at the inputs of that row, {why}; inertia, "
        "mass, lags, delays and rate limits cannot be identified from such rows"
    )


def drop_incomplete_rows(
    path: Path, table: pd.DataFrame, known: list[str], required: list[str]
) -> Cleaned:
    """Drop columns that are mostly empty, rows without a value and rows that repeat a time.

    The table has canonical names; required columns are not dropped.

    Raises:
        RecordingError: no row is complete.
    """
    empty = table[[column for column in known if column in table]].isna().mean()
    sparse = [c for c in empty.index[empty > _MOSTLY] if c not in (TIME, *required)]
    warnings = [f"{c} has no value in {empty[c]:.0%} of the rows; left out" for c in sparse]
    known = [column for column in empty.index if column not in sparse]
    missing = table[known].isna().any(axis=1)
    again = table[TIME].duplicated() & ~missing if TIME in table else pd.Series(False, table.index)
    warnings += _left_out(missing, "a value is missing")
    warnings += _left_out(again, "the time repeats another row's")
    kept = table.drop(columns=sparse)[~(missing | again)]
    if kept.empty:
        raise RecordingError(
            f"{path}: no row has a value in each of {', '.join(known)}; leave out the columns that are "
            "mostly empty, or fill in their values"
        )
    return kept.reset_index(drop=True), warnings


def _left_out(rows: pd.Series | NDArray[np.bool_], why: str) -> list[str]:
    """Return a warning on the rows that were left out; none without such rows."""
    first, count = int(np.argmax(rows)) + 1, int(rows.sum())
    said = f"{count} of {len(rows)} rows were left out, first row {first}: {why}"
    return [said] if count else []


def keep_running_rows(path: Path, table: pd.DataFrame, ship: Ship) -> Cleaned:
    """Keep the rows in which the ship runs ahead, and replace their times by an even time base.

    Raises:
        RecordingError: time falls, or fewer than two rows remain.
    """
    time = table[TIME].to_numpy()
    refuse_falling_time(path, time, np.diff(time) < 0.0)
    runs = np.ones(len(table), np.bool_)
    if ship.moves or ship.has_diesel:
        turning = SHAFT_SPEED if SHAFT_SPEED in table else drive_column(ship)
        for column in dict.fromkeys((turning, "ship_speed_m_s")):
            if column in table:
                values = table[column].to_numpy()
                runs &= values > _STANDS * float(np.quantile(np.abs(values), 0.9))
    warnings = _left_out(
        ~runs,
        f"the shaft or the ship stands still, runs astern or is below {_STANDS:.0%} of its usual speed, "
        "so that the row may be no equilibrium",
    )
    table, usual = table[runs].reset_index(drop=True), median_step(time)
    if len(table) < 2 or not usual > 0.0:
        raise RecordingError(
            f"{path}: {len(table)} row(s) in which shaft and ship run ahead; at least 2 are needed"
        )
    even = float(table[TIME].iloc[0]) + usual * np.arange(len(table))
    if (np.abs(table[TIME].to_numpy() - even) > _EVEN * usual).any():
        warnings.append(
            f"times in the report count rows of {usual:.4g} s; gaps and rows that were left out are not "
            "counted"
        )
    return table.assign(**{TIME: np.maximum(even, 0.0) if even[0] < 0.0 else even}), warnings


def drop_outliers(
    path: Path, table: pd.DataFrame, simulated: pd.DataFrame | None, measured: list[str]
) -> Cleaned:
    """Drop the rows in which the residual of a measured channel against the simulation is a spike.

    The simulation has the equilibria of the nominal ship at the same rows.

    Raises:
        RecordingError: more than 5 % of the values of a channel are spikes.
    """
    far = np.zeros(len(table), np.bool_)
    if simulated is None or len(simulated) != len(table):
        return table, []
    for column in (column for column in measured if column in simulated):
        own = find_spikes(table[column].to_numpy() - simulated[column].to_numpy())
        if own.mean() > _MOST_OUTLIERS:
            raise RecordingError(
                f"{path}: {column}: {own.sum()} of {len(own)} values are spikes, first in row "
                f"{int(np.argmax(own)) + 1}; at most {_MOST_OUTLIERS:.0%} are allowed: filter the "
                "column or leave it out"
            )
        far |= own
    kept = table[~far].reset_index(drop=True)
    warnings = _left_out(far, "a measured channel has a spike there")
    return kept.assign(**{TIME: table[TIME].to_numpy()[: len(kept)]}), warnings


def estimate_row_noise(
    table: pd.DataFrame, simulated: pd.DataFrame | None, column: str, inputs: list[str]
) -> float:
    """Return the rms noise of a measured channel whose rows are independent equilibria, in its unit.

    The equilibria depend on the input columns; ``simulated`` has them at the same rows.
    """
    explaining = [table[name].to_numpy(dtype=np.float64) for name in inputs if name in table]
    if simulated is not None and column in simulated and len(simulated) == len(table):
        explaining.append(simulated[column].to_numpy(dtype=np.float64))
    return row_noise(table[column].to_numpy(dtype=np.float64), explaining)


class NoDriveCommandError(RecordingError):
    """Steady rows have the shaft speed, but not the command of the prime mover."""


def refuse_without_drive(path: Path, table: pd.DataFrame, ship: Ship) -> None:
    """Refuse steady rows that have the shaft speed, but not the command of the prime mover.

    Raises:
        NoDriveCommandError: a diagnosis can catch it and use :func:`drive_by_shaft_speed`.
    """
    column = drive_column(ship)
    if column not in table and SHAFT_SPEED in table and ship.turns_freely and ship.has_propeller:
        raise NoDriveCommandError(
            f"{path}: column {column!r} is missing; found: {', '.join(map(str, table.columns))}"
        )


def drive_by_shaft_speed(ship: Ship) -> Ship:
    """Return the ship with a drive that prescribes the shaft speed.

    Tolerances of its prime mover and terms that act on it are left out.
    """
    # The limit is 1.5 times the rated speed, so that noise on a measured speed meets no end stop.
    mover = held_speed_source(min(top_speed(ship) / 2.0, 1e4))
    known = ship.tolerances
    numbers = {k: v for k, v in known.numbers.items() if not k.startswith("prime_mover.")}
    tolerances = known.model_copy(update={"numbers": numbers})
    terms = tuple(t for t in ship.term if t.acts_on not in ("drive", "drive_torque"))
    return ship.model_copy(update={"prime_mover": mover, "tolerances": tolerances, "term": terms})


def restore_drive(corrected: Ship, ship: Ship) -> Ship:
    """Return a ship of :func:`drive_by_shaft_speed`, corrected by effects, with its original drive.

    The prime mover, the tolerances and all terms are those of ``ship``, the ship of the ship file.
    """
    original = {term.id for term in ship.term}
    new = [term for term in corrected.term if term.id not in original]
    terms = (*ship.term, *new)
    return corrected.model_copy(
        update={"prime_mover": ship.prime_mover, "tolerances": ship.tolerances, "term": terms}
    )


def missing_drive_remark(ship: Ship) -> str:
    """Return the remark on a recording whose shaft speed replaces the command of the prime mover."""
    return (
        f"the recording has no {drive_column(ship)}: the simulated shaft turns at the recorded "
        f"{SHAFT_SPEED}, and the prime mover is not diagnosed"
    )
