"""Checks of a recording besides its units: the time base, the pitch's order, clipping, dullness.

Values that jump away and back again: dropouts and spikes of a sensor, its cable or its logger.

Told by their shape alone, so that no event of the voyage is taken for one: up to three rows far from
both neighbours, by many times what the channel moves from row to row, while the neighbours agree. A step
of an order, a reversal or an emerging propeller does not come back to where it was within so few rows.

Channels that stand still: a machine that its friction holds, or a dead sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, SHAFT_ANGLE, SHAFT_SPEED, answered_columns, drive_column
from ...plant.recording import RecordingError
from ...plant.ship import Ship
from .excitation import loaded
from .noise import Noise, clipped, describe, odd_rests
from .time_base import LONGEST_GAP
from .unit_errors import HELMS, demands, ranges_of

TOO_SHORT = "too short"
"""How a sentence on length begins."""

_FEWEST_ROWS = 200
_WRAPPED = 2.05 * math.pi  # rad; an angle that stays inside it and jumps has lost its turns
_TIME_CONSTANTS = 3.0
_FAST_S = 0.04  # interval below which a ship's logger is rare
_STARTED = 0.5  # share of the largest shaft speed by which it moves in a start from rest
_DULL_DEMAND = 0.05  # share of its range over which a demand must move
_DULL_SIGNAL = 3.0  # multiple of its noise over which a measurement must move
_SLACK, _ODD_SHARE = 0.005, 0.01  # of a pitch order beyond its limits; share of the rows
_FOLLOWS = 0.5  # share of the other order's misfit below which a pitch leads, not lags


def refuse_complex(path: Path, table: pd.DataFrame, columns: Iterable[str]) -> None:
    """Refuse complex values in columns that are understood: no instrument measures them.

    Raises:
        RecordingError: names the first such column.
    """
    for column in (c for c in columns if c in table):
        values = table[column]
        found = pd.api.types.is_complex_dtype(values)
        if values.dtype == object:
            found = any(isinstance(value, complex | np.complexfloating) for value in values)
        if found:
            raise RecordingError(
                f"{path}: {column} holds complex numbers where real ones are needed; give its real "
                "part or its magnitude"
            )


def refuse_wrapped(path: Path, table: pd.DataFrame) -> None:
    """Refuse an angle of the shaft that begins anew with every turn.

    Raises:
        RecordingError: names the first row at which it does.
    """
    if SHAFT_ANGLE not in table:
        return
    angle = table[SHAFT_ANGLE].to_numpy()
    jumps = np.abs(np.diff(angle)) > math.pi
    if jumps.any() and np.ptp(angle) <= _WRAPPED:
        row = int(np.argmax(jumps)) + 2
        raise RecordingError(
            f"{path}: {SHAFT_ANGLE}, row {row}: {angle[row - 1]:.4g} rad after {angle[row - 2]:.4g} "
            "rad; the angle begins anew with every turn; let it count on (numpy.unwrap)"
        )


def too_short(tables: Sequence[pd.DataFrame], interval: float, ship: Ship) -> list[str]:
    """Sentences on what recordings are too short for, taken together; empty if they are long enough."""
    said, rows = [], sum(map(len, tables))
    if rows < _FEWEST_ROWS:
        said.append(f"{TOO_SHORT}: {rows} rows; below {_FEWEST_ROWS} little can be told")
    if ship.moves and all("ship_speed_m_s" in table for table in tables):
        speed = float(pd.concat([table["ship_speed_m_s"] for table in tables]).abs().median())
        hull = ship.hull.mass_kg / ship.hull.resistance_slope(max(speed, 1.0))
        if interval * rows < _TIME_CONSTANTS * hull:
            said.append(
                f"{TOO_SHORT}: {interval * rows:.4g} s, where the hull's time constant is "
                f"{hull:.3g} s; its balance needs {_TIME_CONSTANTS * hull:.3g} s{_if_minutes(interval)}"
            )
    return said


def _if_minutes(interval: float) -> str:
    """A hint where the rows come so fast that the time may be in minutes."""
    if interval >= _FAST_S:
        return ""
    return '; if time_s counts minutes, say unit = "min" in the column map'


def _starts_up(table: pd.DataFrame) -> bool:
    """Return whether the shaft speed moves much, as after one step of the command from rest."""
    if SHAFT_SPEED not in table:
        return False
    low, high = np.percentile(table[SHAFT_SPEED].abs(), (2.5, 97.5))
    return bool(high - low > _STARTED * high)


def dull(table: pd.DataFrame, ship: Ship, noise: Mapping[str, Noise]) -> list[str]:
    """Sentences on channels that move too little, against their range or their noise."""
    plant, said = ship.record(), []
    spans = {
        drive_column(ship): float(plant["drive_max"] - plant["drive_min"]),
        "pitch_ratio_command": float(plant["pitch_ratio_max"] - plant["pitch_ratio_min"]),
    } | dict.fromkeys(HELMS, 2.0 * float(plant["rudder_max"]))
    steered = not (loaded(ship, table) or _starts_up(table))
    for column in demands(ship, table) if steered else ():
        low, high = np.percentile(table[column], (2.5, 97.5))
        if high - low < _DULL_DEMAND * spans[column]:
            said.append(
                f"dull: {column} moves over {high - low:.3g} {BOUNDS[column][2]}, "
                f"{(high - low) / spans[column]:.1%} of its range"
            )
    measured = {*answered_columns(ship)} - {*demands(ship, table)}
    for column in (c for c in noise if c in measured):
        moves = float(table[column].std(ddof=0))
        if moves <= _DULL_SIGNAL * noise[column].white_rms:
            said.append(
                f"dull: {column} moves by {moves:.3g} {BOUNDS[column][2]} rms, which is hardly more "
                f"than its noise of {noise[column].white_rms:.3g}"
            )
    return said


def pitch_swapped(table: pd.DataFrame, interval_s: float, ship: Ship) -> bool:
    """Whether the pitch command follows the measured pitch, when it should lead."""
    if not {"pitch_ratio", "pitch_ratio_command"} <= set(table):
        return False
    command = table["pitch_ratio_command"].to_numpy()
    measured = table["pitch_ratio"].to_numpy()
    if min(np.ptp(command), np.ptp(measured)) < 0.02:
        return False
    share = -math.expm1(-interval_s / ship.pitch_actuator.time_constant_s)

    def after(values: NDArray[Any]) -> NDArray[Any]:
        start = [(1.0 - share) * values[0]]
        return np.asarray(scipy.signal.lfilter([share], [1.0, share - 1.0], values, zi=start)[0])

    # both misfits smoothed alike, so that the measured one's noise speaks for neither order
    forward = np.std(after(after(command) - measured))
    backward = np.std(after(after(measured) - command))
    return bool(backward < _FOLLOWS * forward)


def at_end_stop(table: pd.DataFrame, ship: Ship) -> Iterator[str]:
    """Yield warnings on commands that are at or beyond the ship's end stops."""
    drive, stop = drive_column(ship), float(ship.record()["drive_max"])
    at_stop = float((table[drive].abs() >= stop).mean())
    if at_stop > 0.0:
        yield f"{drive} is at its end stop in {at_stop:.1%} of the rows"
    if "pitch_ratio_command" in demands(ship, table):
        low, high = ranges_of(ship)["pitch_ratio_command"]
        order = table["pitch_ratio_command"]
        if (beyond := float((~order.between(low - _SLACK, high + _SLACK)).mean())) > _ODD_SHARE:
            yield (
                f"pitch_ratio_command lies outside the ship's {low:g} to {high:g} in {beyond:.0%} of "
                "the rows, where the plant holds its limit: is it another unit?"
            )


_USUAL = 75.0  # per cent of the steps from row to row are no larger than the usual step
_FAR, _NEAR = 15.0, 4.0  # usual steps: away from the neighbours, and between those
_MOST = 0.05  # share of the rows; a channel with more is no measurement


def spikes(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Which samples stand far from both their neighbours, which agree.

    Args:
        values: (n,) samples, evenly spaced and finite.

    Returns:
        Shape (n,); none in a channel that hardly ever moves.
    """
    found = np.zeros(len(values), dtype=np.bool_)
    steps = np.diff(values)
    usual = float(np.percentile(np.abs(steps), _USUAL)) if len(steps) else 0.0
    if usual == 0.0:
        return found
    calm = np.abs(steps) <= _NEAR * usual
    for width in range(1, LONGEST_GAP + 1):
        # from the third row to the last but two: one of the neighbours must be at rest itself
        into, back = steps[1 : -width - 1], steps[width + 1 : -1]
        apart = values[width + 2 : -1] - values[1 : -width - 2]
        hit = ((into < 0.0) != (back < 0.0)) & (
            np.minimum(np.abs(into), np.abs(back)) > _FAR * usual
        )
        hit &= (np.abs(apart) <= _NEAR * usual) & (calm[: -width - 2] | calm[width + 2 :])
        for offset in range(width):
            found[2 + offset : 2 + offset + len(hit)] |= hit
    return found


def without_spikes(
    path: Path, table: pd.DataFrame, columns: list[str]
) -> tuple[pd.DataFrame, list[str]]:
    """The table with spikes of measured channels put on a line between their neighbours, and remarks.

    Args:
        path: for messages.
        table: finite, on an even time base.
        columns: that are looked at.

    Raises:
        RecordingError: a channel has too many to be a measurement.
    """
    mended, said = {}, []
    for column in columns:
        values = table[column].to_numpy()
        far = spikes(values)
        if not far.any():
            continue
        first, unit = int(np.argmax(far)), BOUNDS[column][2]
        what = (
            f"{column}: {far.sum()} of {len(far)} values are spikes that the next rows know nothing "
            f"of, first in row {first + 1} ({values[first]:.4g} {unit})"
        )
        if far.mean() > _MOST:
            raise RecordingError(
                f"{path}: {what}; more than {_MOST:.0%} of the rows: mend it or leave the column out"
            )
        rows = np.arange(len(values))
        mended[column] = np.interp(rows, rows[~far], values[~far])
        said.append(f"{what}; they were interpolated linearly")
    return table.assign(**mended), said


_STANDS = 0.02  # share of what it would have moved, by which a shaft that stood still goes on
_USUAL_STEP = 0.8  # quantile of a channel's steps from row to row that such a shaft takes at first
_LESS = 0.5  # share of what it would have moved, from which its next step is no going on
_STOPPED = 0.1  # share of the rows over which a noisy channel may rest; less is warned of
_SLOW = 3.0  # times the usual rest, weighted by length, that a rest of a slowly read channel lasts
_MUST = 0.05  # share of a channel's size by which the ship moves it where a rest is no calm
_TURNS = 0.02  # share of the fastest row from which the speed says that the shaft turned


def sticks(
    table: pd.DataFrame, ship: Ship, column: str, first: int, end: int, moves: float | None
) -> bool:
    """Return whether a shaft may have stood still, held by its friction, while a channel rested.

    The shaft then goes on from where it stood. A sensor that was dead for a while reads where the shaft
    has come to meanwhile; and where speed and angle are recorded, both stand.

    Args:
        table: canonical columns.
        ship: the nominal ship. A diesel that stands has stalled, and is not taken to stick.
        column: the channel.
        first: row from which it is constant.
        end: one past the last.
        moves: over how much the ship without friction moves there, in the channel's unit; None where it
            cannot be simulated.
    """
    values = table[column].to_numpy(dtype=np.float64)
    if ship.has_diesel or column not in (SHAFT_SPEED, SHAFT_ANGLE) or not 0 < end < len(values):
        return False
    if column == SHAFT_SPEED and abs(values[first]) > _STANDS * np.abs(values).max():
        return False
    if column == SHAFT_ANGLE and SHAFT_SPEED in table:
        speed = table[SHAFT_SPEED].abs().to_numpy()
        if np.median(speed[first:end]) > _TURNS * speed.max():
            return False
    if column == SHAFT_SPEED and SHAFT_ANGLE in table:
        angle = table[SHAFT_ANGLE].to_numpy()
        if np.ptp(angle[first:end]) > _TURNS * np.ptp(angle):
            return False
    jump, steps = abs(values[end] - values[first]), np.abs(np.diff(values))
    usual = float(np.quantile(steps[steps > 0.0], _USUAL_STEP)) if steps.any() else 0.0
    if moves is None:
        return bool(jump <= usual)
    return bool(jump <= max(usual, _STANDS * moves) and jump <= _LESS * moves)


def standing(
    table: pd.DataFrame,
    ship: Ship,
    noise: Mapping[str, Noise],
    simulated: pd.DataFrame | None = None,
) -> Iterator[str]:
    """Yield warnings on measured channels that stand at a sensor's limit or do not change.

    Args:
        table: canonical columns on an even time base.
        ship: the nominal ship.
        noise: noise of each channel.
        simulated: the nominal ship driven by the same commands, perhaps over the first rows only.
    """
    measured = [c for c in noise if c not in demands(ship, table) and c in table]
    interval = float(table["time_s"].iloc[1] - table["time_s"].iloc[0])

    def held(column: str, first: int, end: int) -> bool:
        """Whether the machine may stick there."""
        moves = None
        if simulated is not None and column in simulated and end <= len(simulated):
            moves = float(np.ptp(simulated[column].to_numpy()[first:end]))
        return sticks(table, ship, column, first, end, moves)

    def at_rest(column: str, first: int, end: int) -> bool:
        """Whether nothing turns the shaft there, or the nominal one stands as well."""
        if undriven(table, ship, column, first, end):
            return True
        if column not in (SHAFT_SPEED, SHAFT_ANGLE) or simulated is None or column not in simulated:
            return False
        nominal = simulated[column].to_numpy()
        return end <= len(nominal) and float(np.ptp(nominal[first:end])) <= _STANDS * float(
            np.abs(nominal).max()
        )

    for column in measured:
        values, unit = table[column].to_numpy(), BOUNDS[column][2]
        for limit, share, row in clipped(values, noise[column]):
            if all(at_rest(column, a, b) for a, b in _visits(values == limit)):
                continue
            why = "the sensor or its logger is saturated"
            if all(held(column, a, b) for a, b in _visits(values == limit)):
                why = (
                    "the machine may stick where it reverses (static friction); a saturated sensor "
                    "would look alike"
                )
            yield (
                f"{column} stands at its extreme {limit:g} {unit} in {share:.0%} of the rows, "
                f"first in row {row + 1}: {why}"
            )
        rests = odd_rests(values, noise[column])
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
                f"{first + 1} and goes on from where it stood, while {drive} lies between {low:.4g} "
                f"and {high:.4g} {BOUNDS[drive][2]}: the machine may stick (static friction), which "
                f"is no fault of the sensor; {len(stuck)} such rest(s), {total:.0%} of the rows"
            )
        if dead:
            first, rows = max(dead, key=lambda rest: rest[1])
            yield (
                f"{column} does not change for {rows} rows from row {first + 1}, although its noise "
                "moves it elsewhere: the sensor or its logger stood still"
            )


def _visits(at: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first row and one past the last of each run of true rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def undriven(table: pd.DataFrame, ship: Ship, column: str, first: int, end: int) -> bool:
    """Return whether a shaft rests, or a motor takes no current, because there is no command.

    Args:
        table: canonical columns.
        ship: the nominal ship.
        column: the channel.
        first: row from which it is constant.
        end: one past the last.
    """
    if ship.has_diesel or column not in (SHAFT_SPEED, "motor_current_A"):
        return False
    command = table[drive_column(ship)].abs().to_numpy()
    values = np.abs(table[column].to_numpy())
    stands = values[first] <= _STANDS * values.max()
    return bool(stands and np.median(command[first:end]) <= _STANDS * command.max())


def _is_slow(values: NDArray[np.float64], length: int) -> bool:
    """Return whether a rest of so many rows is one of many of a channel that is read slowly."""
    changes = np.flatnonzero(np.diff(values)) + 1
    others = np.sort(np.diff(np.concatenate([[0], changes, [len(values)]])))[:-1]
    return len(others) > 0 and length <= _SLOW * float(np.average(others, weights=others))


def dead_channels(
    table: pd.DataFrame, ship: Ship, simulated: pd.DataFrame, interval_s: float
) -> Iterator[str]:
    """Yield sentences on measured channels that do not move, ever or for long, although the ship must.

    Args:
        table: canonical columns.
        ship: the nominal ship.
        simulated: its simulation with the same commands, as many rows.
        interval_s: from row to row [s].
    """
    orders = demands(ship, table)
    for column in answered_columns(ship):
        if column in orders or column not in table or column not in simulated:
            continue
        values = table[column].to_numpy()
        first, length = 0, len(values)
        if np.ptp(values) > 0.0:
            rests = odd_rests(values, describe(values, interval_s))
            first, length = max(rests, key=lambda rest: rest[1], default=(0, 0))
        there = simulated[column].to_numpy()
        moves = float(np.ptp(there[first : first + length])) if length else 0.0
        if length <= _STOPPED * len(values) or moves <= _MUST * float(np.max(np.abs(there))):
            continue
        rest = (table, ship, column, first, first + length)
        if undriven(*rest) or sticks(*rest, moves) or _is_slow(values, length):
            continue
        unit = BOUNDS[column][2]
        where = f"constant at {values[first]:g} {unit} in every row"
        mend = "leave the column out or mend it"
        if length < len(values):
            where = f"constant at {values[first]:g} {unit} from row {first + 1} to {first + length}"
            mend = "leave the column out or cut the recording there"
        yield (
            f"{column} is {where}, where this ship moves over {moves:.3g} {unit} with these "
            f"demands: a dead sensor or a stopped logger; {mend}"
        )
