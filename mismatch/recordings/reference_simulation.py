"""The nominal ship as the yardstick of a recording's units, signs and names.

It is sailed open loop with the recording's demands. A channel far from what the ship gives, but close
once read in another unit, with the other sign or under another's name, is a slip. The tolerances leave
room for real effects: a slip is named only where it explains the channel, and a channel that is merely
off is left to the diagnosis.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from ...plant.columns import BOUNDS, HEADING, SHAFT_ANGLE, SHAFT_SPEED, TIME, drive_column
from ...plant.equilibria import simulate_steady
from ...plant.recording import RecordingError
from ...plant.replay import simulate_recording
from ...plant.ship import Ship
from ...plant.stepping import DivergenceError
from ...plant.validity import ValidityWarning
from .checks import dead_channels
from .unit_errors import (
    Slip,
    by_a_factor,
    demands,
    impossible_demands,
    looks_like,
    range_of,
    rectified_remark,
    slips_of,
    top_speed,
)

_STEPS = 200_000  # of integration; more of a recording is not needed to tell its units
_NOTHING = 1e-6  # largest value of a channel, in its unit, that a ship at rest gives
_HONEST = 0.3  # relative rms difference up to which no other unit is looked for
_HONEST_PAIR = 0.1  # the same for swapped names, whose magnitudes may be alike
_BELOW = 0.02  # difference below which nothing better is asked for
_NAMED = 0.5  # difference above which a slip explains nothing
_BETTER = 0.5  # a slip must reduce the difference to this share
_APART = 3.0  # times, from which no level is this ship's
_STRANGE = 2  # channels that far apart
_LEVELS = (SHAFT_SPEED, "shaft_torque_N_m", "ship_speed_m_s", "thrust_N")
_MAGNITUDES = 30.0  # factor from which a channel that follows the ship is in another unit
_RETOLD = 2.0  # |ln factor| from which no effect looks like a demand in another unit


class Yardstick:
    """The nominal ship, driven by a recording's demands, beside what was recorded.

    Args:
        ship: nominal.
        table: canonical columns at an even interval.
        interval_s: of the rows [s].
        steady: whether each row is an equilibrium at the inputs of that row.

    Attributes:
        sailed: its simulation; None where it cannot be simulated.
        diverges: why, where its simulation diverges; else empty.
        off: relative rms difference of each measured channel; empty without a simulation.
    """

    def __init__(
        self, ship: Ship, table: pd.DataFrame, interval_s: float, steady: bool = False
    ) -> None:
        per_row = 1 if steady else max(1, math.ceil(interval_s / ship.time_step_s - 1e-9))
        self._simulate = simulate_steady if steady else simulate_recording
        self.ship, self._interval_s = ship, interval_s
        self._drive = drive_column(ship)
        self._shaft = SHAFT_SPEED if SHAFT_SPEED in table else SHAFT_ANGLE
        # a start beyond these is no state of this ship: it then starts from a steady one
        self._reach = {"pitch_ratio": 2.6, "ship_speed_m_s": 40.0, SHAFT_SPEED: top_speed(ship)}
        self.table = table.iloc[: max(2, _STEPS // per_row)]
        self._diverged = ""
        self.sailed = self._sail(self.table)
        self.diverges = self._diverged if self.sailed is None else ""
        self.off = self._differences(self.table, self.sailed)

    def _sail(self, table: pd.DataFrame) -> pd.DataFrame | None:
        """Simulate from the first row's state, or from a steady one, or astern from rest.

        A first row beyond every bound, or with an engine that has stalled under an open fuel rack, is no
        state to start from: a wrong unit would then stop the ship. The shaft begins the way the drive
        demands: a ship that is started the other way round may stay so, and every other channel would
        then look turned instead of the shaft's.
        """
        start = table.iloc[0]
        sane = all(abs(start[c]) <= limit for c, limit in self._reach.items() if c in table)
        if SHAFT_SPEED in table and (start[SHAFT_SPEED] < 0.0) != (start[self._drive] < 0.0):
            table = table.assign(**{SHAFT_SPEED: -table[SHAFT_SPEED]})
        if SHAFT_SPEED in table and start[self._drive] > 0.0:
            engine_speed = abs(start[SHAFT_SPEED]) * self.ship.transmission.gear_ratio
            sane &= engine_speed >= self.ship.prime_mover.least_running_speed_rad_s
        known = [c for c in self._reach if c in table and c != self._drive]
        steady = table.drop(columns=known)
        if start[self._drive] < 0.0:  # steady states are found ahead only
            pitch = table.get("pitch_ratio_command", self.ship.propeller.pitch_ratio_max)
            steady = steady.assign(pitch_ratio=pitch, ship_speed_m_s=0.0)
            if self._drive != SHAFT_SPEED:
                steady[SHAFT_SPEED] = 0.0
        for candidate in (table, steady) if sane else (steady,):
            with (
                np.errstate(all="ignore"),
                warnings.catch_warnings(),
                suppress(RecordingError),
            ):
                warnings.simplefilter(
                    "ignore", ValidityWarning
                )  # of a trial, not of the user's run
                try:
                    sailed = self._simulate(self.ship, candidate)
                except DivergenceError as error:
                    self._diverged = str(error)
                    continue
                if np.isfinite(sailed.to_numpy()).all():
                    return sailed
        return None

    def _differences(self, table: pd.DataFrame, sailed: pd.DataFrame | None) -> dict[str, float]:
        """Relative rms difference of each measured channel; empty where the ship cannot sail."""
        if sailed is None:
            return {}
        columns = [
            c for c in sailed if c in table and c != TIME and c not in demands(self.ship, table)
        ]
        found = {}
        for c in columns:
            measured, expected = table[c].to_numpy(), sailed[c].to_numpy()
            if c in (
                SHAFT_ANGLE,
                HEADING,
            ):  # it drifts with the least error of the speed: its steps are compared
                measured, expected = np.diff(measured), np.diff(expected)
            size = float(np.sqrt(np.mean(expected**2)))
            if size > 0.0:
                with np.errstate(over="ignore"):  # values far beyond any bound
                    found[c] = float(np.sqrt(np.mean((measured - expected) ** 2))) / size
        return found

    def with_columns(self, columns: Mapping[str, Any]) -> dict[str, float]:
        """Differences if some columns were read otherwise; the ship starts and sails anew."""
        table = self.table.assign(**columns)
        return self._differences(table, self._sail(table))

    def swapped(self) -> tuple[str, str] | None:
        """The two columns that fit far better under each other's names, if any."""
        if self.off and all(off <= _HONEST_PAIR for off in self.off.values()):
            return None
        best, pair = self._score(self.off) + math.log(_BETTER), None
        for slip in self._other_magnitudes():
            values = slip.read(self.table[self._drive].to_numpy())
            there = self.with_columns({self._drive: values})
            if set(self.off) <= set(there):  # else the ship stops, and hardly a channel is compared
                best = min(best, self._score(there))
        for a, b in combinations([c for c in self.table if c != TIME], 2):
            if {a, b} == {"pitch_ratio", "pitch_ratio_command"}:
                continue  # told by its lag
            exchanged = {a: self.table[b], b: self.table[a]}
            if any(impossible_demands(self.table.assign(**exchanged), self.ship)):
                continue
            there = self.with_columns(exchanged)
            if not set(self.off) <= {*there, a, b}:
                continue  # a ship at rest: nothing is left that could differ
            if all(there.get(c, 0.0) <= _NAMED for c in (a, b, self._shaft)):
                score = self._score(there)
                if score < best:
                    best, pair = score, (a, b)
        return pair

    def _score(self, off: Mapping[str, float]) -> float:
        """Mean logarithm of the differences; the less, the nearer."""
        if not off:
            return math.inf
        return float(np.mean([math.log(max(difference, _BELOW)) for difference in off.values()]))

    def _other_magnitudes(self) -> list[Slip]:
        """Slips of the drive's demand that change it by more than an effect could."""
        return [
            s for s in slips_of(self._drive, self.ship) if abs(math.log(abs(s.factor))) > _RETOLD
        ]

    def foreign(self) -> str | None:
        """A sentence where the recording is hardly of this ship: levels apart that no slip explains."""
        apart = {}
        for column in set(_LEVELS) & set(self.off):
            assert self.sailed is not None
            found, given = (
                float(np.sqrt(np.mean(table[column] ** 2))) for table in (self.table, self.sailed)
            )
            dead = float(np.ptp(self.table[column])) == 0.0
            if not dead and not given / _APART < found < given * _APART:
                apart[column] = (found, given)
        if len(apart) < _STRANGE or self._explaining(
            self._drive, self._shaft, self._other_magnitudes()
        ):
            return None
        apart = {
            column: levels
            for column, levels in apart.items()
            if not self._explaining(column, column, slips_of(column, self.ship))
        }
        if len(apart) < _STRANGE:
            return None
        told = ", ".join(
            f"{column} {found:.3g} where it has {given:.3g} {BOUNDS[column][2]}"
            for column, (found, given) in sorted(apart.items())
        )
        return (
            f"hardly a recording of {self.ship.name}: with these demands, rms, {told}; is it the right "
            "ship, and are the numbers of its file in the units of their keys?"
        )

    def slips(self) -> Iterator[str]:
        """Sentences on channels in another unit or with the other sign."""
        if self.off.get(self._shaft, math.inf) > _HONEST:
            found = self._explaining(self._drive, self._shaft, self._other_magnitudes())
            if found:
                yield self._sentence(self._drive, found)
                return
        for column, off in self.off.items():
            if off <= _HONEST or not self._reaches(column):
                continue
            found = self._explaining(column, column, slips_of(column, self.ship))
            if found and rectified_remark(self.table, self.sailed, column, self._drive, 0.0):
                found = [
                    slip for slip in found if slip.factor > 0.0
                ]  # the sign is lost, not turned
            if found := found or self._magnitudes_apart(column):
                yield self._sentence(column, found)

    def _reaches(self, column: str) -> bool:
        """Whether the ship moves a channel at all: its unit cannot be told where nothing turns."""
        return self.sailed is not None and float(np.abs(self.sailed[column]).max()) > _NOTHING

    def _magnitudes_apart(self, column: str) -> list[Slip]:
        """The factor by which a channel has the ship's course at another order of magnitude."""
        if self.sailed is None or column in demands(self.ship, self.table):
            return []
        measured, expected = self.table[column].to_numpy(), self.sailed[column].to_numpy()
        size, unit = float(np.abs(measured).max()), BOUNDS[column][2]
        if not size > 0.0:
            return []
        share = measured / size  # squares of values far beyond any bound overflow
        factor = float(share @ expected / (share @ share)) / size
        if not factor > 0.0 or abs(math.log(factor)) < math.log(_MAGNITUDES):
            return []
        left = np.sqrt(np.mean((factor * measured - expected) ** 2) / np.mean(expected**2))
        return [by_a_factor(factor, unit)] if left < _HONEST else []

    def _explaining(self, column: str, judged: str, slips: list[Slip]) -> list[Slip]:
        """Slips of a column that bring the judged one near to the ship; the nearest two."""
        values = self.table[column].to_numpy()
        found = []
        for slip in slips:
            read = {column: slip.read(values)}
            if column == self._drive and any(
                impossible_demands(self.table.assign(**read), self.ship)
            ):
                continue
            there = self.with_columns(read).get(judged, math.inf)
            size = abs(math.log(abs(slip.factor))) or math.inf
            if there < min(_BETTER * self.off.get(judged, math.inf), _HONEST * size, _NAMED):
                found.append((there, slip))
        return [slip for _, slip in sorted(found, key=lambda pair: pair[0])[:2]]

    def _sentence(self, column: str, slips: list[Slip]) -> str:
        found, unit = float(self.table[column].median()), BOUNDS[column][2]
        if self.sailed is not None and column in self.off:
            reached = float(self.sailed[column].median())
            expected = f"reaches {reached:.4g} {unit} with these demands"
            if column == SHAFT_SPEED:
                expected += f" (its range: {range_of(column, self.ship)})"
        else:
            expected = f"takes {range_of(column, self.ship)}"
        return looks_like(column, slips, found, expected)

    def dead(self) -> Iterator[str]:
        """Sentences on measured channels that do not move, ever or for long, although the ship must."""
        if self.sailed is not None and self.off:
            yield from dead_channels(
                self.table, self.ship, self.sailed[[*self.off]], self._interval_s
            )
