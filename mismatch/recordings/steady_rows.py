"""Recordings whose rows are slower than the ship: each row is an equilibrium and stands for itself.

Nothing is interpolated between such rows. A row that cannot be an equilibrium, or lacks a value, is left
out; gaps and missing days do not matter.

A ship whose shaft turns at the recorded speed, for steady rows without the prime mover's command.

Logs of ships in service have the revolutions, seldom the fuel rack. Each row is then the equilibrium of
hull and propeller at the measured shaft speed; the prime mover is not judged.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import (
    IN_A_TURN,
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_SPEED,
    TIME,
    drive_column,
)
from ...plant.drives.speed_source import speed_held
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from .checks import spikes
from .noise import row_noise
from .unit_errors import top_speed

SETTLED = 2.0
"""Surge time constants of the ship between two rows from which on each row is an equilibrium. The thrust
falls with the ship's speed as well, so that she settles nearly twice as fast as this constant says."""

NO_EQUILIBRIUM = frozenset({SHAFT_ANGLE, RUDDER_COMMAND, *IN_A_TURN})
"""Columns that an equilibrium straight ahead does not have."""

_SLOW_ROWS_S = 5.0
_USUAL_SPEED_M_S = 5.0
_STANDS = 0.1  # share of the usual speed (90th percentile) below which a shaft or a ship stands
_MOSTLY = 0.5  # share of the rows without a value from which on a column is left out
_MOST_OUTLIERS = 0.05
_EVEN = 0.01  # share of the usual step by which a step may differ and still be even


def surge_time_constant(ship: Ship, table: pd.DataFrame) -> float:
    """Return mass over the slope of the resistance at the median recorded speed [s]; 0 of a fixed hull.

    Args:
        ship: the ship.
        table: canonical columns, as read.
    """
    if not ship.moves:
        return 0.0
    speed = _USUAL_SPEED_M_S
    if "ship_speed_m_s" in table:
        known = pd.to_numeric(table["ship_speed_m_s"], errors="coerce").abs().median()
        speed = float(known) if math.isfinite(known) else speed
    return ship.hull.mass_kg / ship.hull.resistance_slope(max(speed, 1.0))


def usual_step(time: NDArray[np.float64]) -> float:
    """Return the median of the steps of time that are above 0 [s]; 0 where there are none."""
    steps = np.diff(time)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    return float(np.median(steps)) if len(steps) else 0.0


def rows_are_steady(
    ship: Ship, table: pd.DataFrame, time: NDArray[np.float64], asked: bool = False
) -> bool:
    """Return whether each row of a recording is an equilibrium: the user says so, or rows are slow.

    Args:
        ship: the ship.
        table: canonical columns, as read.
        time: [s], shape (rows,).
        asked: whether the user says so.
    """
    usual = usual_step(time)
    return asked or usual >= max(SETTLED * surge_time_constant(ship, table), 1.01 * _SLOW_ROWS_S)


def why_steady(ship: Ship, table: pd.DataFrame, time: NDArray[np.float64], asked: bool) -> str:
    """Return the remark that says how the rows are taken, and why."""
    surge, usual = surge_time_constant(ship, table), usual_step(time)
    why = "as asked for"
    if not asked:
        why = f"for rows are {usual:.4g} s apart"
        if surge > 0.0:
            why += f" and the ship's surge time constant is {surge:.2g} s"
    return (
        f"each row is taken as an equilibrium of the ship at the inputs of that row, {why}; inertia, "
        "mass, lags, delays and rate limits cannot be identified from such rows"
    )


def complete_rows(
    path: Path, table: pd.DataFrame, known: list[str], required: list[str]
) -> tuple[pd.DataFrame, list[str]]:
    """Return the rows that have every value and a time of their own, and remarks on the others.

    Args:
        path: for messages.
        table: under canonical names.
        known: columns that are understood.
        required: of these, columns that must be there.

    Raises:
        RecordingError: no row is left.
    """
    said = []
    known = [column for column in known if column in table]
    sparse = [
        c for c in known if c not in (TIME, *required) and table[c].isna().mean() > _MOSTLY
    ]  # fmt: skip
    for column in sparse:
        said.append(
            f"{column} has no value in {table[column].isna().mean():.0%} of the rows; left out"
        )
    known = [column for column in known if column not in sparse]
    missing = table[known].isna().any(axis=1)
    again = table[TIME].duplicated() & ~missing if TIME in table else pd.Series(False, table.index)
    for rows, why in ((missing, "a value is missing"), (again, "the time repeats another row's")):
        if rows.any():
            said.append(
                f"{int(rows.sum())} of {len(table)} rows were left out, first row "
                f"{int(np.argmax(rows)) + 1}: {why}"
            )
    kept = table.drop(columns=sparse)[~(missing | again)]
    if kept.empty:
        raise RecordingError(f"{path}: no row has a value in each of {', '.join(known)}")
    return kept.reset_index(drop=True), said


def running_rows(path: Path, table: pd.DataFrame, ship: Ship) -> tuple[pd.DataFrame, list[str]]:
    """Return the rows in which the ship runs ahead, on an even time base of rows, and remarks.

    Args:
        path: for messages.
        table: finite, in canonical columns.
        ship: the ship.

    Raises:
        RecordingError: time falls, or fewer than two rows are left.
    """
    time = table[TIME].to_numpy()
    if (np.diff(time) < 0.0).any():
        row = int(np.argmax(np.diff(time) < 0.0)) + 2
        raise RecordingError(
            f"{path}: {TIME}, row {row}: {time[row - 1]:g} s after {time[row - 2]:g} s; time must "
            "rise from row to row; sort the rows by it"
        )
    runs = np.ones(len(table), np.bool_)
    if ship.moves or ship.has_diesel:
        turning = SHAFT_SPEED if SHAFT_SPEED in table else drive_column(ship)
        for column in dict.fromkeys((turning, "ship_speed_m_s")):
            if column in table:
                values = table[column].to_numpy()
                runs &= values > _STANDS * float(np.quantile(np.abs(values), 0.9))
    said = []
    if not runs.all():
        said.append(
            f"{int((~runs).sum())} of {len(runs)} rows were left out, first row "
            f"{int(np.argmin(runs)) + 1}: the shaft or the ship stands, goes astern or is below "
            f"{_STANDS:.0%} of its usual speed, and the row may be no equilibrium"
        )
    table, usual = table[runs].reset_index(drop=True), usual_step(time)
    if len(table) < 2 or not usual > 0.0:
        raise RecordingError(f"{path}: {len(table)} row(s) with a running engine; 2 are needed")
    even = float(table[TIME].iloc[0]) + usual * np.arange(len(table))
    if (np.abs(table[TIME].to_numpy() - even) > _EVEN * usual).any():
        said.append(
            f"times in the report count rows of {usual:.4g} s: gaps and rows that were left out take "
            "no time"
        )
    return table.assign(**{TIME: np.maximum(even, 0.0) if even[0] < 0.0 else even}), said


def without_outliers(
    path: Path, table: pd.DataFrame, simulated: pd.DataFrame | None, measured: list[str]
) -> tuple[pd.DataFrame, list[str]]:
    """Return the rows in which no measured channel is a spike against the simulation, and a remark.

    Args:
        path: for messages.
        table: finite, at an even interval.
        simulated: the nominal ship's equilibria at the same rows, or None.
        measured: columns that are looked at.

    Raises:
        RecordingError: a channel has too many spikes to be a measurement.
    """
    far = np.zeros(len(table), np.bool_)
    for column in measured:
        if simulated is None or column not in simulated or len(simulated) != len(table):
            continue
        own = spikes(table[column].to_numpy() - simulated[column].to_numpy())
        if own.mean() > _MOST_OUTLIERS:
            raise RecordingError(
                f"{path}: {column}: {own.sum()} of {len(own)} values are spikes, first in row "
                f"{int(np.argmax(own)) + 1}; more than {_MOST_OUTLIERS:.0%}: mend the channel or leave "
                "the column out"
            )
        far |= own
    if not far.any():
        return table, []
    kept = table[~far].reset_index(drop=True)
    said = (
        f"{int(far.sum())} of {len(table)} rows were left out, first row {int(np.argmax(far)) + 1}: a "
        "measured channel jumps away and back again"
    )
    return kept.assign(**{TIME: table[TIME].to_numpy()[: len(kept)]}), [said]


def noise_of_rows(
    table: pd.DataFrame, simulated: pd.DataFrame | None, column: str, inputs: list[str]
) -> float:
    """Return the rms noise of a measured channel whose rows stand for themselves, in its unit.

    Args:
        table: canonical columns.
        simulated: equilibria at the same rows, or None.
        column: the channel.
        inputs: columns on which the equilibrium depends.
    """
    beside = [table[name].to_numpy(dtype=np.float64) for name in inputs if name in table]
    if simulated is not None and column in simulated and len(simulated) == len(table):
        beside.append(simulated[column].to_numpy(dtype=np.float64))
    return row_noise(table[column].to_numpy(dtype=np.float64), beside)


REMARK = (
    "the recording has no {column}: the shaft is taken to turn at {speed}, and the prime mover is not "
    "judged"
)
"""Remark on a recording whose shaft speed stands for the command of the prime mover."""


class NoDriveCommandError(RecordingError):
    """Steady rows with a shaft speed and without the command of the ship's prime mover."""


def refuse_without_drive(path: Path, table: pd.DataFrame, ship: Ship) -> None:
    """Refuse steady rows that have the shaft speed and not the command of the prime mover.

    Raises:
        NoDriveCommandError: they have; a diagnosis then goes on with :func:`led_by_speed`.
    """
    column = drive_column(ship)
    if column not in table and SHAFT_SPEED in table and ship.turns_freely and ship.has_propeller:
        raise NoDriveCommandError(
            f"{path}: column {column!r} is missing; found: {', '.join(map(str, table.columns))}"
        )


def led_by_speed(ship: Ship) -> Ship:
    """Return a ship whose drive holds the shaft at the speed that it is given.

    Args:
        ship: the ship; tolerances of its prime mover and terms that act on it are left out.
    """
    # half as much again as the engine's rated speed: noise on a measured speed must meet no end stop
    mover = speed_held(min(top_speed(ship) / 2.0, 1e4))
    known = ship.tolerances
    numbers = {k: v for k, v in known.numbers.items() if not k.startswith("prime_mover.")}
    terms = tuple(term for term in ship.term if term.acts_on not in ("drive", "drive_torque"))
    return ship.model_copy(
        update={
            "prime_mover": mover,
            "tolerances": known.model_copy(update={"numbers": numbers}),
            "term": terms if isinstance(ship.term, tuple) else list(terms),
        }
    )


def with_drive_of(corrected: Ship, ship: Ship) -> Ship:
    """Return a corrected ship with the prime mover, the tolerances and all terms of another.

    Args:
        corrected: of :func:`led_by_speed`, with effects.
        ship: as its file has it.
    """
    own = {term.id for term in ship.term}
    terms = [*ship.term, *(term for term in corrected.term if term.id not in own)]
    return corrected.model_copy(
        update={
            "prime_mover": ship.prime_mover,
            "tolerances": ship.tolerances,
            "term": tuple(terms) if isinstance(ship.term, tuple) else terms,
        }
    )


def remark_on(ship: Ship) -> str:
    """Return the remark for a ship as its file has it."""
    return REMARK.format(column=drive_column(ship), speed=SHAFT_SPEED)
