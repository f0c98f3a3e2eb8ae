"""Replay of a recording: open-loop simulation of a ship with the recording's inputs."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import check_size
from .columns import (
    ALWAYS_SIMULATED,
    MEASURED,
    ROLLING_COLUMNS,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_SPEED,
    SHIP_SPEED,
    TURNING_COLUMNS,
    input_columns,
    signal_columns,
    simulated_columns,
)
from .dynamics import settle_lags
from .expressions import external_at
from .recording import WATER, RecordedInputs, RecordingError
from .ship import Ship, refuse_sea
from .signals import SAMPLE
from .simulation import simulate_record, simulate_records
from .state import STATE, Inputs, State
from .steady_state import equilibrium
from .stepping import refuse_divergence
from .validity import warn_of_departures

_START = ("pitch_ratio", SHAFT_SPEED, "ship_speed_m_s")

PLANAR_STATES = ("sway_speed", "yaw_rate", "heading")
"""Further states of the initial state of a ship with sway and yaw."""


class Replay(RecordedInputs):
    """The inputs of one recording, prepared to simulate a ship many times.

    Commands are held constant between rows, or interpolated linearly if ``line`` is true: the logged
    command of a controller is constant between rows, but a measured torque or a command that a log
    keeps in few rows is not. A held shaft speed, the submergence and a measured inflow are always
    linear between rows. A measured inflow replaces the one from wake and current. A rudder angle that
    was measured without its command is imposed on the rudder.

    Args:
        ship: the ship.
        table: canonical columns at an even interval, all finite.
        start_over_s: duration over which measurements determine the initial state: their mean, or the
            initial value of a parabola if they change; 0 uses the first row. A measured shaft angle
            gives the initial angle in this way, and the initial speed if that was not measured.
            Quantities that were not measured start from the steady state at the first row's commands.
        line: whether commands are linear between rows instead of constant.

    Raises:
        RecordingError: a column is missing or not finite, there is no state to start from, or a moving
            hull has a measured inflow but no ship speed.
        ShipError: a delay or the motor does not suit the time step, or a term uses a signal for which
            the recording has no column.
    """

    def __init__(
        self, ship: Ship, table: pd.DataFrame, start_over_s: float = 0.0, line: bool = False
    ) -> None:
        super().__init__(ship, table)
        self.per_row = max(1, math.ceil(self.interval_s / ship.time_step_s - 1e-9))
        self.dt = self.interval_s / self.per_row
        steps = float(self.rows) * self.per_row
        check_size(steps, SAMPLE.itemsize + 80.0, f"steps of {self.dt:.3g} s in its span")
        ship.with_values({"integration.time_step_s": self.dt})  # checks delays and time constants
        between = self._interpolate if line else self._hold
        self.drive, self.pitch = between(self.drive_rows), between(self.command)
        self.helm_measured = ship.turns and RUDDER_COMMAND not in table and RUDDER in table
        helm = RUDDER if self.helm_measured else RUDDER_COMMAND
        self.rudder_rows = np.zeros(self.rows)
        if ship.turns and helm in table:
            self.rudder_rows = self._column(helm)
        follow = self._interpolate if line or self.helm_measured else self._hold
        self.rudder = follow(self.rudder_rows)
        if not ship.turns_freely:  # The drive leads the shaft from each measured speed to the next.
            ends = self.dt * np.arange(1.0, len(self.drive) + 1.0)
            self.drive = np.interp(ends, self.time_s, self.drive_rows)
        self.elevation = self._continuous(self.elevation_rows)
        self.resistance_factor = np.ones(2 * len(self.drive) + 1)
        simulated = [c for c in simulated_columns(ship) if not (c == RUDDER and self.helm_measured)]
        self.channels = [column for column in simulated if column in table]
        over = max(1, min(round(start_over_s / self.interval_s), self.rows // 20))
        self.start = self._first_state(over)
        self._beside = self._first_beside(over)
        given = (name for name in ship.signals if name in table)
        self.signals = ship.external_rows({n: self._continuous(self._column(n)) for n in given})
        self._still = np.zeros(2 * len(self.drive) + 1)

    def _hold(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.ascontiguousarray(np.repeat(rows[:-1], self.per_row))

    def _interpolate(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a line between rows, as the value at the middle of each step."""
        middles = self.dt * (np.arange((self.rows - 1) * self.per_row) + 0.5)
        return np.ascontiguousarray(np.interp(middles, self.time_s, rows))

    def with_holds(self, moves: NDArray[np.bool_]) -> Replay:
        """Return a replay whose commands are held from the marked rows, shape (rows - 1,), on."""
        other = copy.copy(self)
        steps = np.repeat(moves, self.per_row)
        other.drive = np.where(steps, self._hold(self.drive_rows), self.drive)
        other.pitch = np.where(steps, self._hold(self.command), self.pitch)
        return other

    def _continuous(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        fine = np.arange(2 * (self.rows - 1) * self.per_row + 1) * (0.5 * self.dt)
        return np.ascontiguousarray(np.interp(fine, self.time_s, rows))

    def _first_state(self, count: int) -> tuple[float, float, float]:
        """Return the initial pitch ratio, shaft speed and ship speed, from the first rows."""
        first = {c: self._at_first(c, count) for c in _START if c in self.table}
        if SHAFT_ANGLE in self.table:
            first = {SHAFT_SPEED: self._turning(max(count, 3))[1]} | first
        if not self.ship.moves:
            first["ship_speed_m_s"] = 0.0
        if not self.ship.turns_freely:
            first[SHAFT_SPEED] = float(self.drive_rows[0])
        if not self.ship.has_variable_pitch:
            first["pitch_ratio"] = self.ship.propeller.pitch_ratio_max
        if len(first) < len(_START):
            try:
                state = self._steady_state()
            except ValueError as error:
                missing = [column for column in _START if column not in first]
                raise RecordingError(
                    f"the recording has no {', '.join(missing)} to start from, and {error}"
                ) from None
            steady = (state.pitch_ratio, state.shaft_speed, state.ship_speed)
            first = dict(zip(_START, steady, strict=True)) | first
        pitch, shaft, speed = (first[column] for column in _START)
        return pitch, shaft, speed

    def _steady_state(self) -> State:
        """Return the equilibrium at the inputs of the first row."""
        signals = {n: float(self._column(n, 1)[0]) for n in self.ship.external_signals}
        first = float(self.drive[0]), float(self.pitch[0])
        return equilibrium(self.ship, *first, signals=signals).state

    def _first_beside(self, count: int) -> dict[str, float]:
        """Return the initial shaft angle and, for a ship with sway and yaw, their initial values."""
        first = {}
        if SHAFT_ANGLE in self.table:
            first["shaft_angle"] = self._turning(max(count, 3))[0]
        if self.ship.turns:
            measured = [column for column in TURNING_COLUMNS if column in self.table]
            first |= {MEASURED[c]: self._at_first(c, count) for c in measured}
            first["rudder_angle"] = float(self.rudder[0])
            if "sway_speed" not in first:  # The current carries the ship along.
                first["sway_speed"] = self.ship.manoeuvring.cross_current_m_s
            if self.ship.rolls:
                rolling = {c: s for c, s in ROLLING_COLUMNS.items() if c in self.table}
                first |= {state: self._at_first(c, count) for c, state in rolling.items()}
            first = dict.fromkeys(PLANAR_STATES, 0.0) | first
        return first

    def _at_first(self, column: str, count: int) -> float:
        """Return the initial value of a column: the mean of the first rows, or that of a parabola."""
        values = self._column(column, count)
        noise = 0.5 * float(np.mean(np.diff(values) ** 2)) if count > 5 else math.inf
        if float(np.var(values)) <= 2.0 * noise:
            return float(values.mean())
        return float(np.polynomial.Polynomial.fit(self.time_s[:count], values, 2)(0.0))

    def _turning(self, count: int) -> tuple[float, float]:
        """Return the initial angle [rad] and speed [rad/s] of the shaft, by a parabola through rows."""
        angle = self._column(SHAFT_ANGLE, count)
        degree = min(2, len(angle) - 1)
        parabola = np.polynomial.Polynomial.fit(
            self.time_s[:count], angle - angle[0], degree, domain=[0.0, 1.0], window=[0.0, 1.0]
        )
        return float(angle[0] + parabola(0.0)), float(parabola.deriv()(0.0))

    def inflow(self, plant: Any) -> NDArray[np.float64]:
        """Return the inflow disturbance [m/s] at each half step, shape (2 steps + 1,)."""
        return self._still if self._met is None else self._continuous(self.inflow_rows(plant))

    def first_state(self, start: tuple[float, ...] | None = None, plant: Any = None) -> State:
        """Return the state at the first row, with lags not yet settled.

        ``start`` holds the measured values (``self.start`` by default). The gains of the ship record's
        instruments are removed from a measured shaft speed and ship speed.
        """
        pitch, shaft, speed, *turning = map(float, self.start if start is None else start)
        shifts = dict(zip(PLANAR_STATES, turning, strict=False))
        if plant is not None and SHAFT_SPEED in self.channels:
            shaft /= float(plant["speed_sensor_gain"])
        if plant is not None and SHIP_SPEED in self.channels:
            speed /= float(plant["speed_log_gain"])
        beside = {name: value + shifts.get(name, 0.0) for name, value in self._beside.items()}
        return State(pitch, shaft, speed)._replace(**beside)

    def first_inputs(self, inflow: NDArray[np.float64]) -> Inputs:
        """Return the inputs at the first row, for an inflow from :meth:`inflow`."""
        return Inputs(
            float(self.drive[0]),
            float(self.pitch[0]),
            float(inflow[0]),
            elevation=float(self.elevation[0]),
            rudder_command=float(self.rudder[0]),
            outside=external_at(self.signals, 0),
        )

    def simulate(
        self, plant: Any, start: tuple[float, ...] | None = None, sea: Any = None
    ) -> NDArray[Any]:
        """Return the samples at the recording's rows under a ship record; SAMPLE array of shape (rows,).

        Args:
            plant: ship record.
            start: pitch ratio, shaft speed and ship speed at the first row; ``self.start`` by default.
                Further values are added to :data:`PLANAR_STATES`.
            sea: SEA record, or None for calm water.
        """
        plant, state, inflow = self._prepared(plant, start)
        kept = simulate_record(
            plant,
            state,
            None if sea is None else sea.copy(),
            (self.drive, self.pitch, self.rudder),
            (inflow, self.elevation, self.resistance_factor, self.signals),
            self.dt,
            self.per_row,
        )
        return kept.view(SAMPLE).ravel()

    def simulate_channels(
        self, plant: Any, start: tuple[float, ...] | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Return the measured channels that :meth:`simulate` gives in calm water, each (rows,)."""
        return self.channels_of_ships([plant], [self.start if start is None else start])[0]

    def channels_of_ships(
        self, plants: Sequence[Any], starts: Sequence[tuple[float, ...]]
    ) -> list[dict[str, NDArray[np.float64]]]:
        """Return the result of :meth:`simulate_channels` for each of several ship records.

        The records of a group of :func:`.simulation.alike_groups` are simulated at once.
        """
        signals = [MEASURED[c] for c in self.channels]
        ships = self.signals_of_ships(plants, signals, starts)
        return [{c: kept[MEASURED[c]] for c in self.channels} for kept in ships]

    def simulate_signals(
        self, plant: Any, signals: Sequence[str], start: tuple[float, ...] | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Return some signals of :meth:`simulate` in calm water by name, each of shape (rows,).

        All signals of a long recording would take ten times the memory of the measured ones.
        """
        return self.signals_of_ships([plant], signals, [self.start if start is None else start])[0]

    def signals_of_ships(
        self, plants: Sequence[Any], signals: Sequence[str], starts: Sequence[tuple[float, ...]]
    ) -> list[dict[str, NDArray[np.float64]]]:
        """Return the result of :meth:`simulate_signals` for each of several ship records."""
        ships = [self._prepared(*ship) for ship in zip(plants, starts, strict=True)]
        simulated = simulate_records(
            ships,
            (self.drive, self.pitch, self.rudder),
            (self.elevation, self.resistance_factor, self.signals),
            self.dt,
            self.per_row,
            signals,
        )
        return [
            {s: np.ascontiguousarray(column) for s, column in zip(signals, kept.T, strict=True)}
            for kept in simulated
        ]

    def _prepared(
        self, plant: Any, start: tuple[float, ...] | None
    ) -> tuple[Any, Any, NDArray[np.float64]]:
        """Return ship record, initial state (STATE record) and inflow [m/s] of a simulation."""
        inflow = self.inflow(plant)
        if self.helm_measured:
            plant = plant.copy()
            plant["rudder_lag"] = 0.0
        first = settle_lags(plant, self.first_state(start, plant), self.first_inputs(inflow))
        return plant, np.array([tuple(first)], STATE)[0], inflow


def simulate_recording(
    ship: Ship, recording: pd.DataFrame, sea: Any = None, *, every_signal: bool = False
) -> pd.DataFrame:
    """Simulate a ship open loop with a recording's inputs, from the state of its first row.

    Args:
        ship: the ship.
        recording: table of :func:`shaftline.plant.read_recording`. Its ``propeller_submergence_m`` and
            ``inflow_velocity_m_s`` (measured advance velocity) act if present, in addition to ``sea``.
        sea: SEA record from :func:`shaftline.plant.realise`, or None for calm water.
        every_signal: whether to return every signal of :func:`.columns.signal_columns`: true values and
            measurements.

    Returns:
        The same time base and canonical columns: the inputs as given, the other columns simulated.
        Thrust, motor current and powers are present if the recording has them.

    Warns:
        ValidityWarning: the simulation has left the range of validity of a model; one line for each.

    Raises:
        RecordingError: as in :class:`Replay`.
        ShipError: as in :class:`Replay`.
        ValueError: the simulation diverges (the message names signal and time), or there are waves in a
            gas.

    >>> import pandas as pd
    >>> from shaftline.plant import load_ship, simulate_recording
    >>> ship = load_ship("frigate")
    >>> recording = pd.DataFrame(
    ...     {"time_s": [0.0, 1.0, 2.0], "fuel_rack_mm": [20.0, 25.0, 25.0], "pitch_ratio_command": 1.2}
    ... )
    >>> simulate_recording(ship, recording)["shaft_speed_rad_s"].round(2).tolist()
    [11.49, 11.49, 11.97]
    """
    refuse_sea(ship, sea)
    replay = Replay(ship, recording)
    samples = replay.simulate(ship.record(), sea=sea)
    refuse_divergence(ship, samples)
    warn_of_departures(ship, samples)
    helm = [RUDDER] if replay.helm_measured else [RUDDER_COMMAND]
    given = [*input_columns(ship), *WATER, *helm, *sorted(ship.signals)]
    columns: dict[str, Any] = {c: recording[c] for c in given if c in recording}
    columns |= {
        c: samples[MEASURED[c]]
        for c in simulated_columns(ship)
        if c not in columns and (c in ALWAYS_SIMULATED or c in TURNING_COLUMNS or c in recording)
    }
    if every_signal:
        columns = {c: samples[signal] for c, signal in signal_columns(ship).items()} | columns
    return pd.DataFrame(columns)
