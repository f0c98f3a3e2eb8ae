"""A recording replayed: the ship driven open loop by the recording's inputs, again and again.

An effect leaves its trace in what the *simulation* does under the recorded demands, which are free of
instrument noise. Regressors made from measured signals would share their noise with the residual and
make inertia look added where none is (errors in variables).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...plant.dynamics import MEMORY, STATE, State
from ...plant.recording import TIME, drive_column
from ...plant.ship import Ship
from ...plant.signals import SAMPLE
from ...plant.simulation import trajectory
from ...plant.steady_state import equilibrium, steady_inputs, with_lags_settled
from ...plant.waves import calm

START_STEPS = 40
"""Time steps of the ship over which the first state is averaged."""

DULL_SHARE = 0.05
"""Demands that move over less than this share of their size tell no effect from another."""

CHANNELS = {
    "pitch_ratio": "measured_pitch_ratio",
    "shaft_speed_rad_s": "shaft_speed",
    "shaft_torque_N_m": "measured_shaft_torque",
    "ship_speed_m_s": "measured_ship_speed",
    "thrust_N": "thrust",
    "motor_current_A": "motor_current",
}
"""Measured columns and the simulated signal that answers each."""


class Run:
    """One recording's inputs, ready to drive a ship many times.

    Args:
        ship: the nominal ship.
        table: canonical columns at an even interval, all finite.

    Raises:
        ValueError: the ship has no state to start from.
    """

    def __init__(self, ship: Ship, table: pd.DataFrame) -> None:
        self.ship = ship
        self.table = table
        time = table[TIME].to_numpy(dtype=np.float64)
        self.rows = len(time)
        self.interval_s = float((time[-1] - time[0]) / (self.rows - 1))
        self.time_s = time - time[0]
        self.per_row = max(1, math.ceil(self.interval_s / ship.time_step_s - 1e-9))
        self.dt = self.interval_s / self.per_row
        self.plant = ship.record()
        self.drive = self._held(table[drive_column(ship)])
        fixed = ship.propeller.pitch_ratio_min == ship.propeller.pitch_ratio_max
        command = np.full(self.rows, ship.propeller.pitch_ratio_max)
        if not fixed and "pitch_ratio_command" in table:
            command = table["pitch_ratio_command"].to_numpy(dtype=np.float64)
        self.command = command
        self.pitch = self._held(command)
        self.controllable = not fixed
        # what the water does, where it was measured
        self.elevation_rows = np.zeros(self.rows)
        if "propeller_submergence_m" in table:
            self.elevation_rows = (
                table["propeller_submergence_m"].to_numpy(dtype=np.float64) - ship.propeller.depth_m
            )
        self.inflow_rows = np.zeros(self.rows)
        if "inflow_velocity_m_s" in table:
            self.inflow_rows = table["inflow_velocity_m_s"].to_numpy(dtype=np.float64).copy()
            if not ship.hull.fixed and "ship_speed_m_s" in table:
                wake = 1.0 - ship.hull.wake_fraction
                self.inflow_rows -= wake * table["ship_speed_m_s"].to_numpy(dtype=np.float64)
        self.elevation = self._continuous(self.elevation_rows)
        self.inflow = self._continuous(self.inflow_rows)
        self.resistance_factor = np.ones(2 * len(self.drive) + 1)
        self.channels = [c for c in CHANNELS if c in table]
        self.drive_rows = table[drive_column(ship)].to_numpy(dtype=np.float64)
        self.start = self._first_state()
        self._samples = np.zeros(len(self.drive) + 1, SAMPLE)

    def _held(self, values: Any) -> NDArray[np.float64]:
        rows = np.asarray(values, dtype=np.float64)[:-1]
        return np.ascontiguousarray(np.repeat(rows, self.per_row))

    def _continuous(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        fine = np.arange(2 * (self.rows - 1) * self.per_row + 1) * (0.5 * self.dt)
        return np.ascontiguousarray(np.interp(fine, self.time_s, rows))

    def _first_state(self) -> tuple[float, float, float]:
        """Pitch ratio, shaft speed and ship speed to start from: measured where they are known."""
        wanted = round(START_STEPS * self.ship.time_step_s / self.interval_s)
        count = max(1, min(wanted, self.rows // 20))
        first = {c: float(self.table[c].iloc[:count].mean()) for c in self.channels}
        if self.ship.hull.fixed:
            first["ship_speed_m_s"] = 0.0
        if not self.controllable:
            first["pitch_ratio"] = self.ship.propeller.pitch_ratio_max
        keys = ("pitch_ratio", "shaft_speed_rad_s", "ship_speed_m_s")
        if not all(k in first for k in keys):
            state = equilibrium(self.ship, float(self.drive[0]), float(self.pitch[0])).state
            known = dict(
                zip(keys, (state.pitch_ratio, state.shaft_speed, state.ship_speed), strict=True)
            )
            first = {**known, **first}
        return first["pitch_ratio"], first["shaft_speed_rad_s"], first["ship_speed_m_s"]

    def simulate(self, plant: Any, start: tuple[float, ...]) -> Any:
        """Samples at the recording's rows under a ship record; SAMPLE array of shape (rows,).

        Args:
            plant: ship record.
            start: pitch ratio, shaft speed and ship speed at the first row.
        """
        pitch, shaft, speed = start
        bare = State(pitch, shaft, speed, *(0.0,) * (len(State._fields) - 3))
        inputs = steady_inputs(float(self.drive[0]), float(self.pitch[0]))
        state = np.zeros(1, STATE)
        state[0] = tuple(float(x) for x in with_lags_settled(plant, bare, inputs))
        trajectory(
            plant, state[0], np.zeros(1, MEMORY)[0], calm(), self.drive, self.pitch, self.inflow,
            self.elevation, self.resistance_factor, self.dt, self._samples,
        )  # fmt: skip
        return self._samples[:: self.per_row].copy()


def _moves(demand: NDArray[np.float64]) -> bool:
    """Whether a demand moves enough to tell one effect from another."""
    size = float(np.abs(demand).max())
    return bool(np.ptp(np.quantile(demand, [0.02, 0.98])) > DULL_SHARE * max(size, 1e-12))


class Replay:
    """One or more recordings of a ship, each simulated from its own start, end to end in the arrays.

    Args:
        ship: the nominal ship.
        tables: canonical columns at an even interval, all finite; equal columns and intervals.

    Raises:
        ValueError: recordings that do not go together.
    """

    def __init__(self, ship: Ship, *tables: pd.DataFrame) -> None:
        self.ship = ship
        self.runs = [Run(ship, table) for table in tables]
        first = self.runs[0]
        self.interval_s = first.interval_s
        self.controllable = first.controllable
        self.channels = first.channels
        for number, run in enumerate(self.runs[1:], 2):
            if run.channels != self.channels or abs(run.interval_s / self.interval_s - 1.0) > 0.01:
                raise ValueError(
                    f"recording {number} has other columns or another interval than the first: "
                    f"{', '.join(run.channels)} every {run.interval_s:g} s, not "
                    f"{', '.join(self.channels)} every {self.interval_s:g} s"
                )
        ends = np.cumsum([run.rows for run in self.runs])
        self.segments = [(int(e) - r.rows, int(e)) for e, r in zip(ends, self.runs, strict=True)]
        self.rows = int(ends[-1])
        self.time_s = np.arange(self.rows, dtype=np.float64) * self.interval_s
        self.start = first.start

        def joined(name: str) -> NDArray[np.float64]:
            return np.concatenate([getattr(run, name) for run in self.runs])

        self.drive_rows, self.command = joined("drive_rows"), joined("command")
        self.excited = any(_moves(signal) for signal in (self.drive_rows, self.command))
        self.inflow_rows, self.elevation_rows = joined("inflow_rows"), joined("elevation_rows")

    def simulate(self, plant: Any, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
        """Samples at the recordings' rows under a ship record; SAMPLE array of shape (rows,).

        Args:
            plant: ship record.
            shift: of the first pitch ratio [-], shaft speed [rad/s] and ship speed [m/s].
        """
        return np.concatenate(
            [
                run.simulate(plant, tuple(a + b for a, b in zip(run.start, shift, strict=True)))
                for run in self.runs
            ]
        )

    def measured(self) -> dict[str, NDArray[np.float64]]:
        """Measured channels by column, each of shape (rows,)."""
        return {
            c: np.concatenate([run.table[c].to_numpy(dtype=np.float64) for run in self.runs])
            for c in self.channels
        }

    def simulated(self, samples: Any) -> dict[str, NDArray[np.float64]]:
        """The same channels of a simulation."""
        return {c: np.ascontiguousarray(samples[CHANNELS[c]]) for c in self.channels}
