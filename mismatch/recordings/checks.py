"""Check a recording for complex values, spikes, constant or saturated channels, and excitation.

A spike is recognised by its shape alone: up to three rows differ from both neighbours by many times the
usual step from row to row, while the neighbours agree. A step of a command, a reversal or an emerging
propeller does not return to the earlier value within three rows, and so counts as no spike.

A channel that is constant for long may belong to a sensor that has failed or to a shaft that static
friction holds; the checks distinguish the two by the value at which the channel continues.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...core.rows import true_runs
from ...plant.columns import (
    BOUNDS,
    SHAFT_ANGLE,
    SHAFT_SPEED,
    TIME,
    drive_column,
    simulated_columns,
)
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from .excitation import load_varies
from .noise import Noise, estimate_noise, saturated_ends, unusual_rests
from .time_base import LONGEST_GAP, Cleaned
from .unit_errors import command_columns, command_ranges

INSUFFICIENT = "insufficient excitation"  # first words of a limit on a channel that varies little
TOO_SHORT = "too short"  # first words of a limit on the length of a recording

_FEWEST_ROWS = 200
_WRAPPED = 2.05 * math.pi  # range [rad] within which an angle with jumps is wrapped to one turn
_TIME_CONSTANTS = 3.0  # time constants of the hull that a recording must last
_FAST_S = 0.04  # few loggers of ships sample at a shorter interval.
_STARTED = 0.5  # share of the largest shaft speed over which the speed varies in a start from rest
_LEAST_COMMAND_SPAN = 0.05  # share of its range over which a command must vary
_LEAST_SIGNAL_TO_NOISE = 3.0  # multiple of its noise by which a measured channel must vary
_SLACK, _ODD_SHARE = 0.005, 0.01  # pitch ratio beyond its limits; share of the rows
_FEW_STOPS = 0.001  # share of rows at an end stop below which nothing is said
_FOLLOWS = 0.5  # ratio of the two misfits below which the command lags the measured pitch
_USUAL = 75.0  # percentile of the steps from row to row that is called the usual step
_FAR, _NEAR = 15.0, 4.0  # usual steps from a spike to its neighbours, and between the neighbours
_MOST = 0.05  # largest share of spikes among the rows of a usable channel
_STANDS = 0.02  # share of the simulated change within which a shaft that stuck continues
_USUAL_STEP = 0.8  # quantile of the steps from row to row that such a shaft may make at first
_LESS = 0.5  # share of the simulated change from which the next step is a jump
_STOPPED = 0.1  # share of the rows from which a constant stretch is an error; below, a warning
_SLOW = 3.0  # multiple of the usual constant stretch (weighted by length) of a slow instrument
_MUST = 0.05  # share of the size of a channel over which the simulation must vary
_TURNS = 0.02  # share of the largest shaft speed above which the shaft turns


def refuse_complex(path: Path, table: pd.DataFrame, columns: Iterable[str]) -> None:
    """Raise a RecordingError for the first of the columns with complex values."""
    for column in (c for c in columns if c in table):
        values = table[column]
        found = pd.api.types.is_complex_dtype(values)
        if values.dtype == object:
            found = any(isinstance(value, complex | np.complexfloating) for value in values)
        if found:
            raise RecordingError(
                f"{path}: {column} holds complex numbers; real numbers are needed: use the real part or "
                "the magnitude"
            )


FEW_TURNS = 20.0
"""Angle that the shaft speed integrates to, from which the measured angle is compared with it [rad]."""


def wrapped_angle_errors(table: pd.DataFrame) -> Iterator[str]:
    """Yield an error if the shaft angle restarts at each turn, or turns less than the shaft."""
    if SHAFT_ANGLE not in table:
        return
    angle = table[SHAFT_ANGLE].to_numpy()
    jumps = np.abs(np.diff(angle)) > math.pi
    if jumps.any() and np.ptp(angle) <= _WRAPPED:
        row = int(np.argmax(jumps)) + 2
        yield (
            f"{SHAFT_ANGLE}, row {row}: {angle[row - 1]:.4g} rad after {angle[row - 2]:.4g} rad; the "
            "angle restarts at each turn, and a continuous angle is needed: apply numpy.unwrap to it"
        )
    elif SHAFT_SPEED in table and len(table) > 1:
        turned = float(np.trapezoid(table[SHAFT_SPEED], table[TIME]))
        found = float(angle[-1] - angle[0])
        if abs(turned) > FEW_TURNS and abs(found) < 0.5 * abs(turned):
            yield (
                f"{SHAFT_ANGLE}: changes by {found:.4g} rad, while {SHAFT_SPEED} integrates to "
                f"{turned:.4g} rad; is it the angle of the shaft, and are both units right?"
            )


def length_limits(tables: Sequence[pd.DataFrame], interval: float, ship: Ship) -> list[str]:
    """Return limits of recordings that are too short for an identification, all rows counted together.

    The tables have canonical columns and the sampling interval [s].
    """
    limits, rows = [], sum(map(len, tables))
    if rows < _FEWEST_ROWS:
        limits.append(
            f"{TOO_SHORT}: {rows} rows; at least {_FEWEST_ROWS} are needed for a diagnosis"
        )
    if ship.moves and all("ship_speed_m_s" in table for table in tables):
        speed = float(pd.concat([table["ship_speed_m_s"] for table in tables]).abs().median())
        hull = ship.hull.mass_kg / ship.hull.resistance_slope(max(speed, 1.0))
        if interval * rows < _TIME_CONSTANTS * hull:
            hint = '; if time_s counts minutes, set unit = "min" in the column map'
            limits.append(
                f"{TOO_SHORT}: {interval * rows:.4g} s, where the hull's time constant is "
                f"{hull:.3g} s; the hull balance needs {_TIME_CONSTANTS * hull:.3g} s"
                f"{hint if interval < _FAST_S else ''}"
            )
    return limits


def insufficient_excitation(
    table: pd.DataFrame, ship: Ship, noise: Mapping[str, Noise]
) -> list[str]:
    """Return limits of channels that vary too little compared with their range or their noise."""
    commands, ranges, limits = command_columns(ship, table), command_ranges(ship), []
    starts = False  # whether the shaft speed varies as much as in a start from rest
    if SHAFT_SPEED in table:
        low, high = np.percentile(table[SHAFT_SPEED].abs(), (2.5, 97.5))
        starts = bool(high - low > _STARTED * high)
    for column in () if starts or load_varies(ship, table) else commands:
        low, high = np.percentile(table[column], (2.5, 97.5))
        span = ranges[column][1] - ranges[column][0]
        if high - low < _LEAST_COMMAND_SPAN * span:
            limits.append(
                f"{INSUFFICIENT}: {column} varies over {high - low:.3g} {BOUNDS[column][2]}, "
                f"{(high - low) / span:.1%} of its range"
            )
    for column in (c for c in noise if c in simulated_columns(ship) and c not in commands):
        rms, white, unit = (
            float(table[column].std(ddof=0)),
            noise[column].white_rms,
            BOUNDS[column][2],
        )
        if rms <= _LEAST_SIGNAL_TO_NOISE * white:
            limits.append(
                f"{INSUFFICIENT}: {column} varies by {rms:.3g} {unit} rms, little more than its noise "
                f"of {white:.3g} {unit} rms"
            )
    return limits


def pitch_columns_swapped(table: pd.DataFrame, interval_s: float, ship: Ship) -> bool:
    """Return whether the pitch command lags the measured pitch, as if the two columns were swapped."""
    if not {"pitch_ratio", "pitch_ratio_command"} <= set(table):
        return False
    command = table["pitch_ratio_command"].to_numpy()
    measured = table["pitch_ratio"].to_numpy()
    if min(np.ptp(command), np.ptp(measured)) < 0.02:
        return False
    share = -math.expm1(-interval_s / ship.pitch_actuator.time_constant_s)

    def lagged(values: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(pd.Series(values).ewm(alpha=share, adjust=False).mean())

    # Both misfits pass the same filter, so that measurement noise favours neither direction.
    forward = np.std(lagged(lagged(command) - measured))
    backward = np.std(lagged(lagged(measured) - command))
    return bool(backward < _FOLLOWS * forward)


def end_stop_warnings(table: pd.DataFrame, ship: Ship) -> Iterator[str]:
    """Yield warnings on commands that are at or beyond the end stops of the ship."""
    drive, stop = drive_column(ship), float(ship.record()["drive_max"])
    at_stop = float((table[drive].abs() >= stop).mean())
    if at_stop >= _FEW_STOPS:
        yield f"{drive} is at its end stop in {at_stop:.1%} of the rows"
    if "pitch_ratio_command" in command_columns(ship, table):
        low, high = command_ranges(ship)["pitch_ratio_command"]
        command = table["pitch_ratio_command"]
        if (beyond := float((~command.between(low - _SLACK, high + _SLACK)).mean())) > _ODD_SHARE:
            yield (
                f"pitch_ratio_command lies outside the range {low:g} to {high:g} of the ship in "
                f"{beyond:.0%} of the rows, where the simulation holds it at the limit: check its unit "
                "in the column map"
            )


def find_spikes(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which samples are spikes: far from both neighbours, which agree with each other.

    Example:
        >>> values = np.sin(0.1 * np.arange(50))
        >>> values[20] = 9.0
        >>> np.flatnonzero(find_spikes(values)).tolist()
        [20]

    Args:
        values: (n,) samples, evenly spaced and finite.

    Returns:
        Shape (n,); all False for a channel that is constant from row to row most of the time.
    """
    spikes = np.zeros(len(values), dtype=np.bool_)
    steps = np.diff(values)
    usual = float(np.percentile(np.abs(steps), _USUAL)) if len(steps) else 0.0
    if usual == 0.0:
        return spikes
    calm = np.abs(steps) <= _NEAR * usual
    for width in range(1, LONGEST_GAP + 1):
        # The first two rows and the last two are left out: a neighbour must have a neighbour itself.
        into, back = steps[1 : -width - 1], steps[width + 1 : -1]
        apart = values[width + 2 : -1] - values[1 : -width - 2]
        hit = ((into < 0.0) != (back < 0.0)) & (
            np.minimum(np.abs(into), np.abs(back)) > _FAR * usual
        )
        hit &= (np.abs(apart) <= _NEAR * usual) & (calm[: -width - 2] | calm[width + 2 :])
        for offset in range(width):
            spikes[2 + offset : 2 + offset + len(hit)] |= hit
    return spikes


def remove_spikes(path: Path, table: pd.DataFrame, columns: list[str]) -> Cleaned:
    """Replace spikes of some channels by linear interpolation between the neighbouring rows.

    Raises:
        RecordingError: more than 5 % of the values of a channel are spikes.
    """
    repaired, warnings = {}, []
    for column in columns:
        values = table[column].to_numpy()
        far = find_spikes(values)
        if not far.any():
            continue
        first, unit = int(np.argmax(far)), BOUNDS[column][2]
        what = (
            f"{column}: {far.sum()} of {len(far)} values are spikes that do not recur in the rows "
            f"before and after, first in row {first + 1} ({values[first]:.4g} {unit})"
        )
        if far.mean() > _MOST:
            raise RecordingError(
                f"{path}: {what}; at most {_MOST:.0%} of the rows may be spikes: filter the column or "
                "leave it out"
            )
        rows = np.arange(len(values))
        repaired[column] = np.interp(rows, rows[~far], values[~far])
        warnings.append(f"{what}; they were replaced by linear interpolation")
    return table.assign(**repaired), warnings


def may_stick(
    table: pd.DataFrame, ship: Ship, column: str, first: int, end: int, moves: float | None
) -> bool:
    """Return whether static friction may have held the shaft while a channel was constant.

    A shaft that stuck continues from the value at which it stopped, and both its speed and its angle
    are constant. A sensor that had failed jumps to the value that the shaft has reached meanwhile. A
    diesel engine that stops has stalled and does not stick.

    Args:
        table: canonical columns.
        ship: the nominal ship.
        column: the channel.
        first: row from which the channel is constant.
        end: one past the last constant row.
        moves: range of the simulation without friction in these rows, in the unit of the channel; None
            if the ship cannot be simulated.
    """
    values = table[column].to_numpy(dtype=np.float64)
    if ship.has_diesel or column not in (SHAFT_SPEED, SHAFT_ANGLE) or not 0 < end < len(values):
        return False
    if column == SHAFT_SPEED:
        turns = abs(values[first]) > _STANDS * np.abs(values).max()
        angle = table.get(SHAFT_ANGLE, pd.Series(0.0, table.index)).to_numpy()
        turns |= np.ptp(angle[first:end]) > _TURNS * np.ptp(angle)
    else:
        speed = table.get(SHAFT_SPEED, pd.Series(0.0, table.index)).abs().to_numpy()
        turns = np.median(speed[first:end]) > _TURNS * speed.max()
    jump, steps = abs(values[end] - values[first]), np.abs(np.diff(values))
    usual = float(np.quantile(steps[steps > 0.0], _USUAL_STEP)) if steps.any() else 0.0
    near = usual if moves is None else min(max(usual, _STANDS * moves), _LESS * moves)
    return bool(not turns and jump <= near)


def constant_channel_warnings(
    table: pd.DataFrame,
    ship: Ship,
    noise: Mapping[str, Noise],
    simulated: pd.DataFrame | None = None,
) -> Iterator[str]:
    """Yield warnings on measured channels that are saturated or constant for long.

    The simulation of the nominal ship with the same commands may end before the table.
    """
    measured = [c for c in noise if c not in command_columns(ship, table) and c in table]
    interval = float(table["time_s"].iloc[1] - table["time_s"].iloc[0])

    def simulated_change(column: str, first: int, end: int) -> float | None:
        """Return the range of the simulated channel in these rows, or None without a simulation."""
        if simulated is None or column not in simulated or end > len(simulated):
            return None
        return float(np.ptp(simulated[column].to_numpy()[first:end]))

    def held(column: str, first: int, end: int) -> bool:
        """Return whether the machine may stick in these rows."""
        moves = simulated_change(column, first, end)
        return may_stick(table, ship, column, first, end, moves)

    def at_rest(column: str, first: int, end: int) -> bool:
        """Return whether no command turns the shaft, or the simulated shaft stands still as well."""
        if is_undriven(table, ship, column, first, end):
            return True
        moves = simulated_change(column, first, end)
        if column not in (SHAFT_SPEED, SHAFT_ANGLE) or simulated is None or moves is None:
            return False
        return moves <= _STANDS * float(simulated[column].abs().max())

    for column in measured:
        values, unit = table[column].to_numpy(), BOUNDS[column][2]
        for limit, share, row in saturated_ends(values, noise[column]):
            if all(at_rest(column, a, b) for a, b in true_runs(values == limit)):
                continue
            why = "the sensor or its logger is saturated"
            if all(held(column, a, b) for a, b in true_runs(values == limit)):
                why = (
                    "static friction may hold the machine where it reverses; a saturated sensor would "
                    "give the same values"
                )
            yield (
                f"{column} stays at its extreme value {limit:g} {unit} in {share:.0%} of the rows, "
                f"first in row {row + 1}: {why}"
            )
        rests = unusual_rests(values, noise[column])
        rests = [rest for rest in rests if not at_rest(column, rest[0], sum(rest))]
        stuck = [rest for rest in rests if held(column, rest[0], sum(rest))]
        dead = [rest for rest in rests if rest not in stuck]
        if stuck:
            first, rows = max(stuck, key=lambda rest: rest[1])
            drive = drive_column(ship)
            command = table[drive].iloc[first : first + rows]
            low, high = command.min(), command.max()
            total = sum(rest[1] for rest in stuck) / len(values)
            yield (
                f"{column} does not change for {rows} rows ({rows * interval:.3g} s) from row "
                f"{first + 1} and continues from the same value, while {drive} lies between {low:.4g} "
                f"and {high:.4g} {BOUNDS[drive][2]}: static friction may hold the machine, which is no "
                f"fault of the sensor; {len(stuck)} such interval(s), {total:.0%} of the rows"
            )
        if dead:
            first, rows = max(dead, key=lambda rest: rest[1])
            yield (
                f"{column} does not change for {rows} rows from row {first + 1}, although it has noise "
                "in other rows: the sensor or its logger stopped there"
            )


def is_undriven(table: pd.DataFrame, ship: Ship, column: str, first: int, end: int) -> bool:
    """Return whether a shaft stands still, or a motor takes no current, because its command is zero.

    The channel is constant from row ``first`` to the row before ``end``.
    """
    if ship.has_diesel or column not in (SHAFT_SPEED, "motor_current_A"):
        return False
    command = table[drive_column(ship)].abs().to_numpy()
    values = np.abs(table[column].to_numpy())
    stands = values[first] <= _STANDS * values.max()
    return bool(stands and np.median(command[first:end]) <= _STANDS * command.max())


def _is_slow(values: NDArray[np.float64], length: int) -> bool:
    """Return whether constant stretches of this length are usual, as of a slowly sampled instrument."""
    changes = np.flatnonzero(np.diff(values)) + 1
    others = np.sort(np.diff(np.concatenate([[0], changes, [len(values)]])))[:-1]
    return len(others) > 0 and length <= _SLOW * float(np.average(others, weights=others))


def dead_channel_errors(
    table: pd.DataFrame, ship: Ship, simulated: pd.DataFrame, interval_s: float
) -> Iterator[str]:
    """Yield errors on measured channels that are constant for long although the simulation varies.

    The simulation of the nominal ship has the same commands and as many rows.
    """
    commands = command_columns(ship, table)
    for column in simulated_columns(ship):
        if column in commands or column not in table or column not in simulated:
            continue
        values = table[column].to_numpy()
        first, length = 0, len(values)
        if np.ptp(values) > 0.0:
            rests = unusual_rests(values, estimate_noise(values, interval_s))
            first, length = max(rests, key=lambda rest: rest[1], default=(0, 0))
        there = simulated[column].to_numpy()
        moves = float(np.ptp(there[first : first + length])) if length else 0.0
        if length <= _STOPPED * len(values) or moves <= _MUST * float(np.max(np.abs(there))):
            continue
        rest = (table, ship, column, first, first + length)
        if is_undriven(*rest) or may_stick(*rest, moves) or _is_slow(values, length):
            continue
        unit, where, remedy = BOUNDS[column][2], "in every row", "repair it"
        if length < len(values):
            where, remedy = f"from row {first + 1} to {first + length}", "cut these rows out"
        yield (
            f"{column} is constant at {values[first]:g} {unit} {where}, where the simulation of this "
            f"ship with the same commands varies over {moves:.3g} {unit}: a dead sensor or a stopped "
            f"logger; leave the column out or {remedy}"
        )
