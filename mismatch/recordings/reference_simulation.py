"""Check the units, signs and names of a recording against a simulation of the nominal ship.

The ship is simulated open loop with the recorded commands. A channel that is far from its simulation,
but close to it in another unit, with the opposite sign or under the name of another channel, has a
data-entry or unit error. An error is reported only if it explains the channel: the tolerances leave
margin for real effects, and the diagnosis deals with every other difference.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from ...plant.columns import BOUNDS, HEADING, SHAFT_ANGLE, SHAFT_SPEED, TIME, drive_column
from ...plant.equilibria import simulate_steady
from ...plant.recording import RecordingError, within_bounds
from ...plant.replay import simulate_recording
from ...plant.ship import Ship
from ...plant.stepping import DivergenceError
from ...plant.validity import ValidityWarning
from .checks import dead_channel_errors
from .unit_errors import (
    UnitError,
    command_columns,
    describe_unit_errors,
    impossible_commands,
    likely_unit_errors,
    power_of_ten_error,
    range_text,
    rectified_remark,
    top_speed,
)

_STEPS = 200_000  # integration steps; this length of a recording is enough to identify its units
_NOTHING = 1e-6  # largest value of a channel, in its unit, on a ship at rest
_HONEST = 0.3  # relative rms difference up to which no unit error is searched for
_HONEST_PAIR = 0.1  # the same for swapped columns, whose magnitudes may be similar
_BELOW = 0.02  # smallest difference that is counted, so that a near-perfect fit has no extra weight
_NAMED = 0.5  # largest difference that an error may leave
_BETTER = 0.5  # largest ratio of the differences with and without the error
_APART = 3.0  # ratio of the rms levels from which a channel does not belong to this ship
_STRANGE = 2  # number of such channels from which the recording is of another ship
_LEVELS = (SHAFT_SPEED, "shaft_torque_N_m", "ship_speed_m_s", "thrust_N")
_MAGNITUDES = 30.0  # factor from which a channel of the right shape has another unit
_RETOLD = 2.0  # |ln factor| from which no effect resembles a command in another unit


class ReferenceSimulation:
    """Simulation of the nominal ship with the commands of a recording, and its differences from it.

    Args:
        ship: the nominal ship.
        table: canonical columns at an even interval.
        interval_s: sampling interval [s].
        steady: whether each row is an equilibrium at the inputs of that row.

    Attributes:
        table: rows that were simulated; a long recording is cut.
        simulated: simulated channels at these rows; None if the ship cannot be simulated.
        divergence: reason if the simulation diverges; else empty.
        differences: relative rms difference of each measured channel; empty without a simulation.
    """

    def __init__(
        self, ship: Ship, table: pd.DataFrame, interval_s: float, steady: bool = False
    ) -> None:
        per_row = 1 if steady else max(1, math.ceil(interval_s / ship.time_step_s - 1e-9))
        self._model = simulate_steady if steady else simulate_recording
        self.ship, self._interval_s, self._drive = ship, interval_s, drive_column(ship)
        self._shaft = SHAFT_SPEED if SHAFT_SPEED in table else SHAFT_ANGLE
        # The ship starts from a steady state if the first row exceeds one of these limits.
        self._reach = {"pitch_ratio": 2.6, "ship_speed_m_s": 40.0, SHAFT_SPEED: top_speed(ship)}
        self.table = table.iloc[: max(2, _STEPS // per_row)]
        self._diverged = ""
        self.simulated = self._simulate(self.table)
        self.divergence = self._diverged if self.simulated is None else ""
        self.differences = self._differences(self.table, self.simulated)

    def _simulate(self, table: pd.DataFrame) -> pd.DataFrame | None:
        """Simulate from the state of the first row, or from a steady state, or astern from rest.

        The first row is not used if it exceeds a limit, or if the engine has stalled with an open fuel
        rack: a shaft speed in a wrong unit would otherwise stop the ship. The shaft starts in the
        direction of the drive command: a shaft with a wrong sign might keep turning that way, and the
        error would then appear in all other channels.
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
        if start[self._drive] < 0.0:  # Steady states are computed for motion ahead only.
            pitch = table.get("pitch_ratio_command", self.ship.propeller.pitch_ratio_max)
            steady = steady.assign(pitch_ratio=pitch, ship_speed_m_s=0.0)
            if self._drive != SHAFT_SPEED:
                steady[SHAFT_SPEED] = 0.0
        for candidate in (table, steady) if sane else (steady,):
            with np.errstate(all="ignore"), warnings.catch_warnings(), suppress(RecordingError):
                # A warning of this trial simulation does not concern the run of the user.
                warnings.simplefilter("ignore", ValidityWarning)
                try:
                    simulated = self._model(self.ship, candidate)
                except DivergenceError as error:
                    self._diverged = str(error)
                    continue
                if np.isfinite(simulated.to_numpy()).all():
                    return simulated
        return None

    def _differences(self, table: pd.DataFrame, simulated: pd.DataFrame | None) -> dict[str, float]:
        """Return the relative rms difference of each measured channel; empty without a simulation."""
        if simulated is None:
            return {}
        others = {TIME, *command_columns(self.ship, table)}
        differences = {}
        for c in (c for c in simulated if c in table and c not in others):
            measured, expected = table[c].to_numpy(), simulated[c].to_numpy()
            if c in (SHAFT_ANGLE, HEADING):
                # An angle drifts with the smallest error of the speed, so its steps are compared.
                measured, expected = np.diff(measured), np.diff(expected)
            size = float(np.sqrt(np.mean(expected**2)))
            if size > 0.0:
                with np.errstate(over="ignore"):  # Values far beyond their bounds may overflow.
                    differences[c] = float(np.sqrt(np.mean((measured - expected) ** 2))) / size
        return differences

    def differences_with(self, columns: Mapping[str, Any]) -> dict[str, float]:
        """Return the differences after replacing columns and simulating again."""
        table = self.table.assign(**columns)
        return self._differences(table, self._simulate(table))

    @cached_property
    def swapped_columns(self) -> tuple[str, str] | None:
        """Two columns that agree much better with the simulation when exchanged; else None."""
        if self.differences and all(d <= _HONEST_PAIR for d in self.differences.values()):
            return None
        best, pair = self._score(self.differences) + math.log(_BETTER), None
        for error in self._large_command_errors():
            values = error.convert(self.table[self._drive].to_numpy())
            changed = self.differences_with({self._drive: values})
            # On a ship that stops, hardly any channel could be compared.
            if set(self.differences) <= set(changed):
                best = min(best, self._score(changed))
        for a, b in combinations([c for c in self.table if c != TIME], 2):
            if {a, b} == {"pitch_ratio", "pitch_ratio_command"}:
                continue  # The lag between the two columns shows whether they are swapped.
            exchanged = {a: self.table[b], b: self.table[a]}
            if not all(within_bounds(name, values).all() for name, values in exchanged.items()):
                continue
            if any(impossible_commands(self.table.assign(**exchanged), self.ship)):
                continue
            changed = self.differences_with(exchanged)
            # On a ship at rest no channel could differ.
            comparable = set(self.differences) <= {*changed, a, b}
            agrees = all(changed.get(c, 0.0) <= _NAMED for c in (a, b, self._shaft))
            if comparable and agrees and self._score(changed) < best:
                best, pair = self._score(changed), (a, b)
        return pair

    def _score(self, differences: Mapping[str, float]) -> float:
        """Return the mean logarithm of the differences; a smaller score is a better agreement."""
        if not differences:
            return math.inf
        return float(np.mean([math.log(max(one, _BELOW)) for one in differences.values()]))

    def _large_command_errors(self) -> list[UnitError]:
        """Return the unit errors of the drive command that change it by more than an effect could."""
        errors = likely_unit_errors(self._drive, self.ship)
        return [error for error in errors if abs(math.log(abs(error.factor))) > _RETOLD]

    def wrong_ship_errors(self) -> Iterator[str]:
        """Yield an error if two levels or more differ greatly and no unit error explains them."""
        apart = {}
        for column in set(_LEVELS) & set(self.differences):
            assert self.simulated is not None
            channels = self.table[column], self.simulated[column]
            recorded, expected = (float(np.sqrt(np.mean(values**2))) for values in channels)
            dead = float(np.ptp(self.table[column])) == 0.0
            if not dead and not expected / _APART < recorded < expected * _APART:
                apart[column] = (recorded, expected)
        command_errors = self._large_command_errors()
        if len(apart) < _STRANGE or self._explanations(self._drive, self._shaft, command_errors):
            return
        apart = {
            column: levels
            for column, levels in apart.items()
            if not self._explanations(column, column, likely_unit_errors(column, self.ship))
        }
        if len(apart) >= _STRANGE:
            levels = ", ".join(
                f"{column} is {recorded:.3g} and simulated {expected:.3g} {BOUNDS[column][2]}"
                for column, (recorded, expected) in sorted(apart.items())
            )
            yield (
                f"hardly a recording of {self.ship.name}: with these commands the rms value of "
                f"{levels}; check that this is the right ship and that each parameter of the ship file "
                "has the unit of its key"
            )

    def unit_errors(self) -> Iterator[str]:
        """Yield errors on channels in another unit or with the opposite sign."""
        if self.differences.get(self._shaft, math.inf) > _HONEST:
            errors = self._explanations(self._drive, self._shaft, self._large_command_errors())
            if errors:
                yield self._sentence(self._drive, errors)
                return
        for column, difference in self.differences.items():
            # The unit of a channel that is 0 throughout is not identifiable.
            still = self.simulated is None or self.simulated[column].abs().max() <= _NOTHING
            if difference <= _HONEST or still:
                continue
            errors = self._explanations(column, column, likely_unit_errors(column, self.ship))
            if errors and rectified_remark(self.table, self.simulated, column, self._drive, 0.0):
                # The sign of a rectified channel is lost, not reversed.
                errors = [error for error in errors if error.factor > 0.0]
            if errors := errors or self._power_of_ten(column):
                yield self._sentence(column, errors)

    def _power_of_ten(self, column: str) -> list[UnitError]:
        """Return the error of a channel with the simulated shape at another order of magnitude."""
        if self.simulated is None or column in command_columns(self.ship, self.table):
            return []
        measured, expected = self.table[column].to_numpy(), self.simulated[column].to_numpy()
        size, unit = float(np.abs(measured).max()), BOUNDS[column][2]
        if not size > 0.0:
            return []
        share = measured / size  # Squares of values far beyond their bounds would overflow.
        factor = float(share @ expected / (share @ share)) / size
        if not factor > 0.0 or abs(math.log(factor)) < math.log(_MAGNITUDES):
            return []
        left = np.sqrt(np.mean((factor * measured - expected) ** 2) / np.mean(expected**2))
        return [power_of_ten_error(factor, unit)] if left < _HONEST else []

    def _explanations(self, column: str, judged: str, errors: list[UnitError]) -> list[UnitError]:
        """Return at most two unit errors of a column that bring the judged channel to its simulation."""
        values = self.table[column].to_numpy()
        explanations = []
        for error in errors:
            converted = {column: error.convert(values)}
            if column == self._drive and any(
                impossible_commands(self.table.assign(**converted), self.ship)
            ):
                continue
            difference = self.differences_with(converted).get(judged, math.inf)
            size = abs(math.log(abs(error.factor))) or math.inf
            before = self.differences.get(judged, math.inf)
            if difference < min(_BETTER * before, _HONEST * size, _NAMED):
                explanations.append((difference, error))
        return [error for _, error in sorted(explanations, key=lambda pair: pair[0])[:2]]

    def _sentence(self, column: str, errors: list[UnitError]) -> str:
        median, unit = float(self.table[column].median()), BOUNDS[column][2]
        if self.simulated is None or column not in self.differences:
            expected = f"takes {range_text(column, self.ship)}"
        else:
            simulated = float(self.simulated[column].median())
            expected = f"reaches {simulated:.4g} {unit} with these commands"
            if column == SHAFT_SPEED:
                expected += f" (its range: {range_text(column, self.ship)})"
        return describe_unit_errors(column, errors, median, expected)

    def dead_channel_errors(self) -> Iterator[str]:
        """Yield errors on measured channels that are constant although the simulation varies."""
        if self.simulated is not None and self.differences:
            yield from dead_channel_errors(
                self.table, self.ship, self.simulated[[*self.differences]], self._interval_s
            )
