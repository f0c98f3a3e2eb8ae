"""Steady states in a recording: where the demand is held and nothing measured moves any more."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.columns import RUDDER, RUDDER_COMMAND, SWAY_SPEED, YAW_RATE, drive_column
from ...plant.recorded_inputs import WATER
from ...plant.ship import Ship
from ..judge.fit import ROUNDING
from ..recordings.noise import white_rms

CHANNELS = (
    "pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s", "motor_current_A", RUDDER, SWAY_SPEED,
    YAW_RATE, *WATER,
)  # fmt: skip
"""Measured columns that must be steady, where the recording has them."""

HELD = 0.003
"""Share of the demand's range by which a held demand may move, besides its noise."""

SETTLED = 0.0005
"""Share of a channel's spread within which it has come to rest, besides the noise of its means."""

BLOCKS = 20
"""Parts into which a held demand is divided to see what moves."""

FEWEST = 2 * BLOCKS
"""Rows below which nothing is seen."""


@dataclass(frozen=True)
class Plateau:
    """A steady state in a recording.

    Args:
        begin: row from which the demand is held.
        settled: row from which nothing moves.
        end: row behind the last one.
        means: of demand and measured channels over the settled rows, by column.
    """

    begin: int
    settled: int
    end: int
    means: dict[str, float]


def plateaus(ship: Ship, table: pd.DataFrame) -> list[Plateau]:
    """Every steady state of a recording, in their order.

    Args:
        ship: its prime mover says which column is the demand.
        table: canonical columns at an even interval, all finite.

    Raises:
        ValueError: the recording has no column of the demand.
    """
    column = drive_column(ship)
    if column not in table:
        raise ValueError(f"{ship.name}: the recording has no {column}")
    channels = {c: table[c].to_numpy(dtype=np.float64) for c in CHANNELS if c in table}
    demands = [column, "pitch_ratio_command"] if ship.has_variable_pitch else [column]
    if ship.turns:
        demands.append(RUDDER_COMMAND)
    held = {c: table[c].to_numpy(dtype=np.float64) for c in demands if c in table}
    edges = [0, *_moves(held), len(table)]
    spread = {c: float(np.ptp(values)) for c, values in channels.items()}
    found = []
    for begin, end in itertools.pairwise(edges):
        if end - begin < FEWEST or not _is_held(held, begin, end):
            continue
        settled = _settled(channels, spread, begin, end)
        if settled is not None:
            means = {c: float(v[settled:end].mean()) for c, v in (held | channels).items()}
            found.append(Plateau(begin, settled, end, means))
    return found


def _tolerance(values: NDArray[np.float64]) -> float:
    return max(8.0 * white_rms(values), HELD * float(np.ptp(values)), 1e-12)


def _moves(held: dict[str, NDArray[np.float64]]) -> list[int]:
    """Rows at which a demand takes a new value."""
    moved = np.zeros(len(next(iter(held.values()))) - 1, dtype=bool)
    for values in held.values():
        moved |= np.abs(np.diff(values)) > _tolerance(values)
    return [int(row) + 1 for row in np.flatnonzero(moved)]


def _is_held(held: dict[str, NDArray[np.float64]], begin: int, end: int) -> bool:
    """Whether the demands stay where they are: they may drift between two moves."""
    for values in held.values():
        parts = [part.mean() for part in np.array_split(values[begin:end], BLOCKS)]
        if np.ptp(parts) > 2.0 * HELD * max(float(np.ptp(values)), 1e-12):
            return False
    return True


def _straightened(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values without their mean and trend."""
    place = np.arange(len(values))
    return np.asarray(values - np.polyval(np.polyfit(place, values, 1), place))


def _settled(
    channels: dict[str, NDArray[np.float64]], spread: dict[str, float], begin: int, end: int
) -> int | None:
    """Row from which no channel moves; None where one never rests for a quarter of the time."""
    rows = np.array_split(np.arange(begin, end), BLOCKS)
    first = 0
    for column, values in channels.items():
        if spread[column] <= ROUNDING * np.abs(values).max():
            continue  # constant: means of equal numbers differ by their rounding
        means = np.array([values[part].mean() for part in rows])
        last = means[-BLOCKS // 3 :]
        white = white_rms(values[begin:end]) / np.sqrt(len(rows[0]))
        noise = max(float(np.std(_straightened(means[BLOCKS // 2 :]), ddof=2)), white)
        off = np.abs(means - last.mean()) > max(SETTLED * spread[column], 5.0 * noise)
        first = max(first, int(np.flatnonzero(off)[-1]) + 2 if off.any() else 1)
        # what still drifts is no rest, however large the noise of its blocks
        rest = means[first:]
        if len(rest) >= BLOCKS // 4:
            drift = np.polyfit(np.arange(len(rest)), rest, 1)[0] * len(rest)
            if abs(drift) > max(2.0 * SETTLED * spread[column], 6.0 * noise):
                return None
    return int(rows[first][0]) if first <= BLOCKS - BLOCKS // 4 else None
