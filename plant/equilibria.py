"""Simulation of recordings with slow rows: each row is an equilibrium of the ship at its inputs.

Logs of ships in service have a row every ten minutes, hour or day. Between two such rows the shaft and
the hull settle many times over, so a row depends on its own inputs only. Inertia, mass, lags and delays
have no effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Record, compiled, compiled_apart
from .columns import MEASURED, input_columns, simulated_columns
from .dynamics import evaluate_apart, settle_lags
from .expressions import external_at
from .hull import episode_factor
from .memory import (
    MEMORY,
    measured_current_of,
    measured_pitch_of,
    measured_ship_speed_of,
    measured_speed_of,
    measured_thrust_of,
    measured_torque_of,
)
from .recording import WATER, RecordedInputs
from .replay import Replay
from .shaft import shaft_inertia
from .ship import Ship
from .signals import SAMPLE
from .simulation import write_sample
from .state import (
    STATE,
    Inputs,
    Outputs,
    State,
    get_state,
    inputs_without_sea,
    with_motion,
    without_lags,
)
from .stepping import UNDISTURBED, constant_inputs
from .ventilation import can_ventilate

MOST_STEPS = 200  # to one equilibrium
BALANCED = 1e-11  # residual of an equilibrium: share of the propeller torque and of the resistance
NEAR = 0.3  # residual below which plain Newton steps are taken from the start
STALLED = 0.1  # share of the first row's shaft speed below which a row starts from the first state
LONGEST_STEP = 0.3  # largest step, as a share of the present shaft speed and ship speed


@compiled_apart
def _surplus(
    plant: Record, state: State, inputs: Inputs, settles: bool
) -> tuple[float, float, State, Outputs]:
    """Return the unbalanced torque [N m] and force [N] at a state, the state and its outputs."""
    if settles:
        state = settle_lags(plant, state, inputs)
    rate, outputs = evaluate_apart(plant, state, inputs, state.pitch_ratio)
    torque = rate.shaft_speed * shaft_inertia(plant)
    return torque, rate.ship_speed * plant.mass, state, outputs


@compiled_apart
def equilibrium_near(
    plant: Record, state: State, inputs: Inputs, settles: bool, leads: bool
) -> tuple[State, Outputs]:
    """Return the equilibrium that a ship without lags reaches from a state, and the outputs there.

    Pseudo-transient continuation (Kelley & Keyes 1998): implicit Euler steps along the motion of the
    ship, with inertias scaled so that shaft and hull are equally fast. The steps grow as the ship
    approaches rest and end as Newton steps, so the result is a stable equilibrium. ``state`` has the
    pitch ratio of the row; ``settles`` is true if states other than the two speeds must come to rest,
    ``leads`` if the drive holds the shaft speed.
    """
    moves, pitch = plant.hull_fixed == 0, state.pitch_ratio
    torque, force, state, outputs = _surplus(plant, state, inputs, settles)
    length, before = -1.0, math.inf
    for _ in range(MOST_STEPS):
        shaft, speed = state.shaft_speed, state.ship_speed
        of_torque = max(abs(outputs.propeller_torque), abs(outputs.shaft_torque), 1e-9)
        of_force = max(abs(outputs.resistance), abs(outputs.thrust), 1e-9)
        of_shaft, of_speed = max(abs(shaft), 1e-3), max(abs(speed), 0.05)
        a = 0.0 if leads else torque / of_torque
        b = force / of_force if moves else 0.0
        left = max(abs(a), abs(b))
        if left <= BALANCED:
            break
        if length < 0.0:
            length = 1e6 if left < NEAR else 1.0
        else:
            length = min(1e12, length * min(max(before / left, 0.3), 10.0))
        before = left
        # Slopes of the residuals a and b with respect to relative changes of the two speeds.
        aa = ab = ba = bb = 0.0
        step = 1e-6
        if not leads:
            there = with_motion(state, pitch, shaft + step * of_shaft, speed)
            t, f, _, _ = _surplus(plant, there, inputs, settles)
            aa = (t - torque) / of_torque / step
            ba = (f - force) / of_force / step
        if moves:
            there = with_motion(state, pitch, shaft, speed + step * of_speed)
            t, f, _, _ = _surplus(plant, there, inputs, settles)
            ab = (t - torque) / of_torque / step
            bb = (f - force) / of_force / step
        if leads:
            ab = ba = 0.0
        if not moves:
            ba = ab = 0.0
        one, two = 1.0 / length - aa, 1.0 / length - bb
        determinant = one * two - ab * ba
        if not (one > 0.0 or two > 0.0) or determinant == 0.0:
            # The equilibrium is unstable here: take a short step along the motion.
            determinant, one, two, ab, ba = 1.0, 1.0, 1.0, 0.0, 0.0
        by_shaft = (two * a + ab * b) / determinant
        by_speed = (ba * a + one * b) / determinant
        size = max(abs(by_shaft), abs(by_speed))
        if not math.isfinite(size):
            break
        if size > LONGEST_STEP:
            by_shaft *= LONGEST_STEP / size
            by_speed *= LONGEST_STEP / size
        if size < 1e-14:
            break
        shaft, speed = shaft + by_shaft * of_shaft, speed + by_speed * of_speed
        there = with_motion(state, pitch, shaft, speed)
        torque, force, state, outputs = _surplus(plant, there, inputs, settles)
    return state, outputs


@compiled
def fill_equilibria(
    plant: Record,
    state: Record,
    memory: Record,
    drive: NDArray[np.float64],
    pitch: NDArray[np.float64],
    inflow: NDArray[np.float64],
    elevation: NDArray[np.float64],
    signals: NDArray[np.float64],
    interval: float,
    samples: Any,
) -> None:
    """Fill a SAMPLE array of shape (n,) with the equilibrium at each row.

    ``plant`` has no lags; the search for the first row starts from the STATE record ``state``. At each
    row: drive command [mm | V | N m | rad/s], P/D [-], disturbance of the advance velocity [m/s] and
    elevation of the surface above the propeller [m], each of shape (n,). External signals have shape (n,
    MAX_SIGNALS) or are one row; ``interval`` is the time between two rows [s].
    """
    leads = plant.speed_held != 0
    settles = plant.term_states > 0 or can_ventilate(plant)
    first = now = get_state(state)
    for k in range(len(drive)):
        command = min(max(drive[k], plant.drive_min), plant.drive_max)
        blade = min(max(pitch[k], plant.pitch_ratio_min), plant.pitch_ratio_max)
        blade += plant.pitch_actuator_offset
        time = k * interval
        factor = episode_factor(plant, time - 0.5 * interval, interval)
        inputs = inputs_without_sea(
            command,
            pitch[k],
            inflow[k],
            elevation[k],
            factor,
            time,
            0.0,
            0.0,
            external_at(signals, k),
        )
        if abs(now.shaft_speed) < STALLED * abs(first.shaft_speed):
            now = first
        shaft = command if leads else now.shaft_speed
        here = with_motion(now, blade, shaft, now.ship_speed)
        if plant.term_count > 0:  # A term on the actuator shifts the blades from the command.
            rate, _ = evaluate_apart(plant, here, inputs, blade)
            blade += plant.pitch_time_constant * rate.pitch_ratio
            here = with_motion(now, blade, shaft, now.ship_speed)
        here, outputs = equilibrium_near(plant, here, inputs, settles, leads)
        memory.shaft_speed = measured_speed_of(plant, here.shaft_speed)
        memory.pitch_ratio = measured_pitch_of(plant, outputs.pitch_ratio)
        memory.shaft_torque = measured_torque_of(plant, outputs.shaft_torque)
        memory.thrust = measured_thrust_of(plant, outputs.thrust)
        memory.motor_current = measured_current_of(plant, outputs.motor_current)
        acting = constant_inputs(command, pitch[k], 0.0, UNDISTURBED)
        log = measured_ship_speed_of(plant, here.ship_speed)
        write_sample(plant, samples[k], time, acting, here, memory, log, outputs)
        if math.isfinite(here.shaft_speed) and math.isfinite(here.ship_speed):
            now = here


class SteadyReplay(Replay):
    """Simulation of a recording whose rows are equilibria; its interface is that of ``Replay``.

    If several equilibria exist, the ship takes the one that it reaches from the equilibrium of the
    previous row with the shaft turning. A ship with sway and yaw runs straight ahead with the rudder
    amidships. The table has canonical columns at an even interval, all finite; errors are those of
    ``Replay``.
    """

    def __init__(self, ship: Ship, table: pd.DataFrame) -> None:
        RecordedInputs.__init__(self, ship, table)
        self.dt, self.per_row = self.interval_s, 1
        # Copies, because the kernel would compile again for arrays that cannot be written.
        self.drive, self.pitch = np.array(self.drive_rows), np.array(self.command)
        self.helm_measured = False
        self.rudder = self.rudder_rows = np.zeros(self.rows)
        self.channels = [column for column in simulated_columns(ship) if column in table]
        self.start = self._running_state()
        self._beside = {}
        signals = (name for name in ship.signals if name in table)
        self.signals = ship.external_rows({name: self._column(name) for name in signals})

    def _running_state(self) -> tuple[float, float, float]:
        """Return pitch ratio, shaft speed and ship speed of a running ship at the first row's inputs.

        The measured first row may be wrong and near the equilibrium of a stalled engine, so it is not
        used.
        """
        try:
            state = self._steady_state()
        except ValueError:  # There is no equilibrium with the shaft turning ahead.
            return self._first_state(1)
        return float(state.pitch_ratio), float(state.shaft_speed), float(state.ship_speed)

    def inflow(self, plant: Any) -> NDArray[np.float64]:
        """Return the disturbance of the advance velocity [m/s] at the rows, shape (rows,)."""
        return self.inflow_rows(plant)

    def simulate(
        self, plant: Any, start: tuple[float, ...] | None = None, sea: Any = None
    ) -> NDArray[Any]:
        """Return the equilibria, shape (rows,); they depend on neither start nor waves."""
        first = State(*self.start, sway_speed=float(plant["cross_current"]))
        state = np.array([tuple(first)], STATE)
        samples = np.zeros(self.rows, SAMPLE)
        fill_equilibria(
            without_lags(plant),
            state[0],
            np.zeros(1, MEMORY)[0],
            self.drive,
            self.pitch,
            self.inflow(plant),
            self.elevation_rows,
            self.signals,
            self.interval_s,
            samples,
        )
        return samples

    def signals_of_ships(
        self, plants: Sequence[Any], signals: Sequence[str], starts: Sequence[tuple[float, ...]]
    ) -> list[dict[str, NDArray[np.float64]]]:
        """Return some signals of the equilibria of each ship record by name, each of shape (rows,)."""
        ships = []
        for plant, start in zip(plants, starts, strict=True):
            samples = self.simulate(plant, start)
            ships.append({name: samples[name].copy() for name in signals})
        return ships


def simulate_steady(ship: Ship, recording: pd.DataFrame) -> pd.DataFrame:
    """Return the equilibria of a ship at the inputs of each row of a recording.

    The recording has canonical columns at an even interval; the result has its time base and columns,
    the inputs as given and the other columns simulated. Errors are those of :class:`SteadyReplay`.
    """
    replay = SteadyReplay(ship, recording)
    samples = replay.simulate(ship.record())
    given = [*input_columns(ship), *WATER, *sorted(ship.signals)]
    columns: dict[str, Any] = {c: recording[c] for c in given if c in recording}
    columns |= {c: samples[MEASURED[c]] for c in replay.channels if c not in columns}
    return pd.DataFrame(columns)
