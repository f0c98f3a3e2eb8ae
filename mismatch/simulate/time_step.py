"""Time step of the simulations of a diagnosis: the longest that changes no simulated channel noticeably.

The step of a ship file resolves the waves that pass the propeller, about 0.05 s. A log with a row every
second has no waves in it, and a diagnosis simulates it some thousand times. A Runge-Kutta step of half a
row, or of a whole one, is then as exact as the short one, and several times faster.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import pandas as pd

from ...plant.columns import TIME
from ...plant.ship import Ship, ShipError
from .joint_replay import JointReplay

STEPS_PER_ROW = (1, 2, 3, 4, 5, 8, 10, 16, 20, 32, 64, 128)
"""Numbers of steps between two rows that are tried. A delay below a step is interpolated, and a time
constant below a step refuses it. Where a finding is shorter than a step, the search is repeated with a
shorter one."""

INEXACT = 0.01
"""Largest rms change of a simulated channel by the longer step, as a multiple of the channel's noise. It
changes 2 log L by at most 1e-4 for each row and channel. Commands are held between rows in this
comparison. On a line, the command of a step is that of its middle, so that a longer step moves it by up
to a quarter of a row; between two rows, a line is uncertain by more than that."""

ABOUT = 0.1
"""The same for a ship with identified effects, whose gain is far more than the 0.01 by which 2 log L
then changes for each row and channel. A delay between two multiples of the step is interpolated."""


def with_longest_time_step(
    ship: Ship,
    tables: Sequence[pd.DataFrame],
    changes: Iterable[Callable[[Ship], Ship]] = (),
    longest_s: float = math.inf,
    inexact: float = INEXACT,
) -> Ship:
    """Return the ship with the longest time step that simulates recordings as its own step does.

    Args:
        ship: nominal ship.
        tables: canonical columns at an even interval; equal columns and intervals.
        changes: functions that return a ship with a candidate effect; the time step must resolve the
            effect's own time constants.
        longest_s: upper limit of the time step [s].
        inexact: largest rms change of a simulated channel, as a multiple of the channel's noise [-].

    Returns:
        The ship itself if no longer step is as exact, or if its time constants need its own step.
    """
    interval_s = float(np.ptp(tables[0][TIME])) / (len(tables[0]) - 1)
    steps = [interval_s / n for n in STEPS_PER_ROW]
    steps = [s for s in steps if 1.01 * ship.time_step_s < s <= 1.01 * longest_s]
    if not steps:
        return ship
    own, changes = _Simulations(ship, tables), list(changes)
    for step_s in steps:
        slower = own.equal_ship(step_s, inexact)
        if slower is not None and all(_is_valid(change, slower) for change in changes):
            return slower
    return ship


def _is_valid(change: Callable[[Ship], Ship], ship: Ship) -> bool:
    try:
        change(ship)
    except ShipError:
        return False
    return True


def restore_time_step(ship: Ship, file: Ship) -> Ship:
    """Return a ship with the time step of its file, or with its own if that is shorter."""
    shorter = min(ship.time_step_s, file.time_step_s)
    return ship if shorter == ship.time_step_s else _with_time_step(ship, shorter)


def _with_time_step(ship: Ship, time_step_s: float) -> Ship:
    return ship.with_values({"integration.time_step_s": time_step_s})


class _Simulations:
    """Channels simulated with a ship's own time step."""

    def __init__(self, ship: Ship, tables: Sequence[pd.DataFrame]) -> None:
        self._ship, self._replay = ship, JointReplay(ship, *tables)
        self._exact = self._replay.simulate_channels(ship.record())

    def equal_ship(self, time_step_s: float, inexact: float) -> Ship | None:
        """Return the ship with another time step; None if a channel changes by more than a limit."""
        try:
            other = _with_time_step(self._ship, time_step_s)
        except ShipError:  # too long for a time constant of the ship, or for any ship
            return None
        channels = self._replay.with_ship(other).simulate_channels(other.record())
        for name, values in self._exact.items():
            change = float(np.sqrt(np.mean((channels[name] - values) ** 2)))
            if not change <= inexact * self._replay.noise_rms[name]:  # true of a ship that diverges
                return None
        return other
