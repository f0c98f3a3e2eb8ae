"""Checks of a recording besides its units: the time base, the pitch's order, clipping, dullness."""

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
from .loading import loaded
from .noise import Noise
from .slips import HELMS, demands, ranges_of

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
