"""Order profile: ordered ship speeds over the time of an episode, in place of those that a task draws.

An order holds from its time until the next one, and the last one to the end of the episode. It takes
effect at the first control interval that begins at its time or later.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..baselines.combinator import combinator_curve
from ..core.files import check_size
from ..observers.records import Floats
from ..plant import Ship
from ..plant.order_tables import LEVERS, SPEED_ORDERS, TIMES, find_column, read_column
from ..plant.recording import RecordingError, read_table
from .tasks import LIMITS

OrderProfile = tuple[tuple[float, float], ...]
"""Rows of time [s], from 0 and rising, and ordered ship speed [m/s]."""

_CHANGE = 0.05  # smallest change of the order that counts [m/s]


def check_profile(rows: Any) -> OrderProfile:
    """Return an order profile as pairs of floats.

    Args:
        rows: pairs of time [s] and ordered ship speed [m/s].

    Raises:
        ValueError: not pairs of numbers, no row, a time that does not rise from 0, or a speed out of
            range; names the row, counted from 1.

    Examples:
        >>> check_profile([(0, 5), (60, 8.5)])
        ((0.0, 5.0), (60.0, 8.5))
    """
    low, high, unit = LIMITS["speed_order_m_s"]
    example = "pairs of time [s] and ordered speed [m/s], such as [(0, 5.0), (60, 8.0)]"
    try:
        table = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        table = np.zeros(0)
    if isinstance(rows, str) or table.ndim != 2 or table.shape[1] != 2 or not len(table):
        raise ValueError(f"order_profile: must be {example}")
    before = -math.inf
    for row, (time, speed) in enumerate(table.tolist(), 1):
        if not (math.isfinite(time) and time > before and (row > 1 or time == 0.0)):
            raise ValueError(
                f"order_profile, row {row}: time {time:g} s; times must begin at 0 and rise"
            )
        if not low <= speed <= high:
            raise ValueError(
                f"order_profile, row {row}: {speed:g} {unit}; must be {low:g} to {high:g} {unit}"
            )
        before = time
    return tuple(map(tuple, table.tolist()))


class OrdersFile(NamedTuple):
    """Content of a file of orders."""

    profile: OrderProfile
    duration_s: float  # from the first to the last row [s]


def read_orders(path: str | Path, ship: Ship, ramp_s: float = 0.0) -> OrdersFile:
    """Read the order profile of a file.

    Args:
        path: CSV, Parquet or spreadsheet with the column ``time_s`` (``time_min``, ``time_h``) and one
            of ``speed_order_m_s``, ``speed_order_kn``, ``speed_order_km_h``, ``lever`` (0 to 1) and
            ``lever_percent``. The time counts from the first row.
        ship: ship whose combinator curve converts a lever position to an ordered speed.
        ramp_s: interval [s] at which orders between two rows are interpolated linearly; 0: the order of
            a row holds until the next row.

    Raises:
        RecordingError: the file cannot be read, a column is missing, or a value is missing or out of
            range; names file, column and row.

    Warns:
        UserWarning: an order above the highest speed of the ship, or one that only begins at the end.
    """
    path = Path(path)
    table = read_table(path)
    orders = {**SPEED_ORDERS, **LEVERS}
    time_name, order_name = (find_column(path, table, names) for names in (TIMES, orders))
    for name, names in ((time_name, TIMES), (order_name, orders)):
        if name is None:
            raise RecordingError(
                f"{path}: a column {' or '.join(names)} is missing; found: "
                f"{', '.join(map(str, table))}"
            )
    assert time_name is not None
    assert order_name is not None
    if not len(table):
        raise RecordingError(f"{path}: has no rows; give at least two, the last one at the end")
    since_epoch = (-1e12, 1e12)
    time = read_column(path, table, time_name, TIMES[time_name], since_epoch)
    time -= time[0]
    for row in np.flatnonzero(np.diff(time) <= 0.0)[:1] + 2:
        raise RecordingError(
            f"{path}: {time_name}, row {row}: the time does not rise; sort the rows, one for each time"
        )
    if not time[-1] > 0.0:
        raise RecordingError(
            f"{path}: has one row; the time of the last row is the end of the episode: add a row"
        )
    if order_name in LEVERS:
        lever = read_column(path, table, order_name, LEVERS[order_name], (0.0, 1.0))
        curve = combinator_curve(ship)
        speed = np.asarray(np.interp(lever, curve.lever, curve.ship_speed), np.float64)
    else:
        limits = LIMITS["speed_order_m_s"][:2]
        speed = read_column(path, table, order_name, SPEED_ORDERS[order_name], limits)
    _warn(path, ship, order_name, speed, held=not ramp_s)
    duration = float(time[-1])
    if ramp_s:
        check_size(duration / ramp_s, 100.0, "control intervals of the orders")
        grid = ramp_s * np.arange(math.ceil(duration / ramp_s - 1e-9) + 1)
        ramped = np.column_stack([grid, np.interp(grid, time, speed)])
        return OrdersFile(check_profile(ramped), duration)
    return OrdersFile(check_profile(np.column_stack([time, speed])), duration)


def _warn(path: Path, ship: Ship, name: str, speed: Floats, held: bool) -> None:
    """Warn of orders that the ship cannot follow, and of a last order that is not simulated."""
    top = float(combinator_curve(ship).ship_speed[-1])
    if (above := np.flatnonzero(speed > top + _CHANGE)).size:
        warnings.warn(
            f"{path}: {name}, row {above[0] + 1}: {speed[above[0]]:.3g} m/s is above {top:.3g} m/s, the "
            f"highest speed of {ship.name} in calm water on its combinator curve; check the unit",
            stacklevel=3,
        )
    if held and abs(speed[-1] - speed[-2]) > _CHANGE:
        warnings.warn(
            f"{path}: {name}, row {len(speed)}: the order of the last row begins when the episode ends; "
            "repeat it in a row with the time of the end, or give a longer --episode-s",
            stacklevel=3,
        )


def profile_columns(profile: Sequence[tuple[float, float]]) -> tuple[Floats, Floats]:
    """Return times [s] and ordered speeds [m/s] of a profile as arrays of shape (m,)."""
    time, speed = np.array(profile, dtype=np.float64).T.copy()
    return time, speed
