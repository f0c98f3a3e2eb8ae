"""A recording replayed: a ship driven open loop by the recording's inputs, once or again and again."""

from __future__ import annotations

import copy
import math
import threading
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.files import check_size
from .columns import (
    IN_A_TURN,
    MEASURED,
    ON_ANY_SHIP,
    RUDDER,
    RUDDER_COMMAND,
    SHAFT_ANGLE,
    SHAFT_SPEED,
    answered_columns,
    input_columns,
    signal_columns,
)
from .dynamics import settled
from .expressions import outside_at
from .memory import MEMORY
from .recording import WATER, RecordedInputs, RecordingError
from .ship import Ship, refuse_waves
from .signals import SAMPLE
from .simulation import trajectory
from .state import STATE, Inputs, State
from .steady_state import equilibrium
from .stepping import refuse_divergence
from .validity import warn_of_departures
from .waves import calm

_START = ("pitch_ratio", SHAFT_SPEED, "ship_speed_m_s")

IN_THE_PLANE = ("sway_speed", "yaw_rate", "heading")
"""States that a ship that turns starts from besides."""


_own = threading.local()
"""Each thread's memory for samples, as long as its longest run asked for."""


class Replay(RecordedInputs):
    """One recording's inputs, ready to drive a ship many times.

    Demands are held between rows, or drawn as a straight line if so asked: a logged command of a
    controller holds, a force that was measured, or a command of which a log keeps few rows, does not. A
    speed at which the shaft is held is linear between rows, as are submergence and measured inflow. A
    rudder angle that was measured and not commanded is what the rudder does, whatever its gear. The
    inflow at the propeller is then the measured one, whatever wake
    or current the ship's record has.

    Args:
        ship: the ship.
        table: canonical columns at an even interval, all finite.
        start_over_s: the first state is the measured one over this long: its mean, or a parabola's
            first value where it moves; 0 takes the first row's. A measured shaft angle gives the first
            angle so, and the first speed if that was not measured. What was not measured is that of the
            steady state at the first row's demands.
        line: whether demands are straight lines between rows instead of held.

    Raises:
        RecordingError: a column that is missing or not finite, no state to start from, or a measured
            inflow at a hull that moves without a ship speed beside it.
        ShipError: a delay or motor that does not fit the time step, or a term hears a signal of which
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
        ship.with_values({"integration.time_step_s": self.dt})  # for its checks
        between = self._drawn if line else self._held
        self.drive, self.pitch = between(self.drive_rows), between(self.command)
        self.helm_measured = ship.turns and RUDDER_COMMAND not in table and RUDDER in table
        helm = RUDDER if self.helm_measured else RUDDER_COMMAND
        self.rudder_rows = np.zeros(self.rows)
        if ship.turns and helm in table:
            self.rudder_rows = self._column(helm)
        self.rudder = (self._drawn if line or self.helm_measured else self._held)(self.rudder_rows)
        if not ship.turns_freely:  # led from each measured speed to the next
            ends = self.dt * np.arange(1.0, len(self.drive) + 1.0)
            self.drive = np.interp(ends, self.time_s, self.drive_rows)
        self.elevation = self._continuous(self.elevation_rows)
        self.resistance_factor = np.ones(2 * len(self.drive) + 1)
        answered = [c for c in answered_columns(ship) if not (c == RUDDER and self.helm_measured)]
        self.channels = [column for column in answered if column in table]
        over = max(1, min(round(start_over_s / self.interval_s), self.rows // 20))
        self.start = self._first_state(over)
        self._beside = self._first_beside(over)
        heard = (name for name in ship.signals if name in table)
        self.signals = ship.outside_rows({n: self._continuous(self._column(n)) for n in heard})
        self._still = np.zeros(2 * len(self.drive) + 1)

    def _held(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.ascontiguousarray(np.repeat(rows[:-1], self.per_row))

    def _drawn(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """A line between rows, as each step's value at its middle."""
        middles = self.dt * (np.arange((self.rows - 1) * self.per_row) + 0.5)
        return np.ascontiguousarray(np.interp(middles, self.time_s, rows))

    def with_holds(self, moves: NDArray[np.bool_]) -> Replay:
        """The same run with demands held from some rows to their next ones.

        Args:
            moves: whether the demands are held from a row on, shape (rows - 1,).
        """
        other = copy.copy(self)
        steps = np.repeat(moves, self.per_row)
        other.drive = np.where(steps, self._held(self.drive_rows), self.drive)
        other.pitch = np.where(steps, self._held(self.command), self.pitch)
        return other

    def _continuous(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        fine = np.arange(2 * (self.rows - 1) * self.per_row + 1) * (0.5 * self.dt)
        return np.ascontiguousarray(np.interp(fine, self.time_s, rows))

    def _first_state(self, count: int) -> tuple[float, float, float]:
        """Pitch ratio, shaft speed and ship speed to start from, from some rows."""
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
                heard = {n: float(self._column(n, 1)[0]) for n in self.ship.hears}
                state = equilibrium(
                    self.ship, float(self.drive[0]), float(self.pitch[0]), signals=heard
                ).state
            except ValueError as error:
                lacking = [column for column in _START if column not in first]
                raise RecordingError(
                    f"the recording has no {', '.join(lacking)} to start from, and {error}"
                ) from None
            steady = (state.pitch_ratio, state.shaft_speed, state.ship_speed)
            first = dict(zip(_START, steady, strict=True)) | first
        pitch, shaft, speed = (first[column] for column in _START)
        return pitch, shaft, speed

    def _first_beside(self, count: int) -> dict[str, float]:
        """Shaft angle, and sway, yaw, heading and rudder of a ship that turns, to start from."""
        first = {}
        if SHAFT_ANGLE in self.table:
            first["shaft_angle"] = self._turning(max(count, 3))[0]
        if self.ship.turns:
            measured = [column for column in IN_A_TURN if column in self.table]
            first |= {MEASURED[c]: self._at_first(c, count) for c in measured}
            first["rudder_angle"] = float(self.rudder[0])
            if "sway_speed" not in first:  # carried along by the current
                first["sway_speed"] = self.ship.manoeuvring.cross_current_m_s
            first = dict.fromkeys(IN_THE_PLANE, 0.0) | first
        return first

    def _at_first(self, column: str, count: int) -> float:
        """A column's value at the first row: the mean of some, or where they move a parabola through."""
        values = self._column(column, count)
        noise = 0.5 * float(np.mean(np.diff(values) ** 2)) if count > 5 else math.inf
        if float(np.var(values)) <= 2.0 * noise:
            return float(values.mean())
        return float(np.polynomial.Polynomial.fit(self.time_s[:count], values, 2)(0.0))

    def _turning(self, count: int) -> tuple[float, float]:
        """Angle [rad] and speed [rad/s] of the shaft at the first row, by a parabola through some."""
        angle = self._column(SHAFT_ANGLE, count)
        degree = min(2, len(angle) - 1)
        found = np.polynomial.Polynomial.fit(
            self.time_s[:count], angle - angle[0], degree, domain=[0.0, 1.0], window=[0.0, 1.0]
        )
        return float(angle[0] + found(0.0)), float(found.deriv()(0.0))

    def inflow(self, plant: Any) -> NDArray[np.float64]:
        """The same at the steps' starts and middles and the last one's end, shape (2 steps + 1,)."""
        return self._still if self._met is None else self._continuous(self.inflow_rows(plant))

    def first_state(self, start: tuple[float, ...] | None = None, plant: Any = None) -> State:
        """State at the first row, what lags not yet settled; ``self.start`` where none is given.

        Args:
            start: as measured.
            plant: ship record; the gain of its speed sensor is taken off a measured shaft speed.
        """
        pitch, shaft, speed, *turning = map(float, self.start if start is None else start)
        shifts = dict(zip(IN_THE_PLANE, turning, strict=False))
        if plant is not None and SHAFT_SPEED in self.channels:
            shaft /= float(plant["speed_sensor_gain"])
        beside = {name: value + shifts.get(name, 0.0) for name, value in self._beside.items()}
        return State(pitch, shaft, speed)._replace(**beside)

    def first_inputs(self, inflow: NDArray[np.float64]) -> Inputs:
        """What acts at the first row, under an :meth:`inflow`."""
        return Inputs(
            float(self.drive[0]), float(self.pitch[0]), float(inflow[0]),
            elevation=float(self.elevation[0]), rudder_command=float(self.rudder[0]),
            outside=outside_at(self.signals, 0),
        )  # fmt: skip

    def simulate(
        self, plant: Any, start: tuple[float, ...] | None = None, sea: Any = None
    ) -> NDArray[Any]:
        """Samples at the recording's rows under a ship record; SAMPLE array of shape (rows,).

        Args:
            plant: ship record.
            start: pitch ratio, shaft speed and ship speed at the first row; ``self.start`` by default.
                What follows them is added to :data:`IN_THE_PLANE`.
            sea: SEA record, or None for calm water.
        """
        return self.simulate_into(plant, start, sea).copy()

    def simulate_into(
        self, plant: Any, start: tuple[float, ...] | None = None, sea: Any = None
    ) -> NDArray[Any]:
        """The same, in memory that the thread's next simulation fills anew."""
        inflow = self.inflow(plant)
        if self.helm_measured:
            plant = plant.copy()
            plant["rudder_lag"] = 0.0
        state = np.zeros(1, STATE)
        state[0] = tuple(settled(plant, self.first_state(start, plant), self.first_inputs(inflow)))
        steps = len(self.drive)
        if len(getattr(_own, "samples", ())) <= steps:
            _own.samples = np.zeros(steps + 1, SAMPLE)
        samples: NDArray[Any] = _own.samples[: steps + 1]
        trajectory(
            plant, state[0], np.zeros(1, MEMORY)[0], calm() if sea is None else sea.copy(),
            self.drive, self.pitch, self.rudder, inflow, self.elevation,
            self.resistance_factor, self.signals, self.dt, samples,
        )  # fmt: skip
        return np.asarray(samples[:: self.per_row])


def simulate_recording(
    ship: Ship, recording: pd.DataFrame, sea: Any = None, *, every_signal: bool = False
) -> pd.DataFrame:
    """Drive a ship open loop with a recording's inputs, from its first row's state.

    Args:
        ship: the ship.
        recording: from :func:`shaftline.plant.read_recording`. Its ``propeller_submergence_m`` and
            ``inflow_velocity_m_s`` (measured advance velocity) act where it has them, on top of ``sea``.
        sea: SEA record from :func:`shaftline.plant.realise`, or None for calm water.
        every_signal: whether every signal of :func:`.columns.signal_columns` is there as well, true
            values and instruments' readings.

    Returns:
        The same time base and canonical columns: the inputs as given, everything else simulated.
        Thrust, motor current and powers are there where the recording has them.

    Warns:
        ValidityWarning: the simulation has left the range of validity of a model; one line for each.

    Raises:
        RecordingError: as of :class:`Replay`.
        ShipError: likewise.
        ValueError: the simulation diverges; names the signal and the time. Or waves in a gas.
    """
    refuse_waves(ship, sea)
    replay = Replay(ship, recording)
    samples = replay.simulate(ship.record(), sea=sea)
    refuse_divergence(ship, samples)
    warn_of_departures(ship, samples)
    helm = [RUDDER] if replay.helm_measured else [RUDDER_COMMAND]
    given = [*input_columns(ship), *WATER, *helm, *sorted(ship.signals)]
    columns: dict[str, Any] = {c: recording[c] for c in given if c in recording}
    columns |= {
        c: samples[MEASURED[c]]
        for c in answered_columns(ship)
        if c not in columns and (c in ON_ANY_SHIP or c in IN_A_TURN or c in recording)
    }
    if every_signal:
        named = {c: samples[signal] for c, signal in signal_columns(ship).items()}
        columns = named | columns
    return pd.DataFrame(columns)
