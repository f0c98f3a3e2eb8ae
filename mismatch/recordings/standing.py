"""Channels that stand still: a machine that its friction holds, or a dead sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import BOUNDS, SHAFT_ANGLE, SHAFT_SPEED, answered_columns, drive_column
from ...plant.ship import Ship
from .noise import Noise, clipped, describe, odd_rests
from .slips import demands

_STANDS = 0.02  # share of what it would have moved, by which a shaft that stood still goes on
_USUAL = 0.8  # quantile of a channel's steps from row to row that such a shaft takes at first
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
    usual = float(np.quantile(steps[steps > 0.0], _USUAL)) if steps.any() else 0.0
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
