"""Rows that are slower than the ship: each is an equilibrium of the ship at the inputs of that row.

Logs of ships in service have a row every ten minutes, hour or day. Between two such rows the shaft and
the hull settle many times over, so a row depends on its own inputs and on no other row. Inertia, mass,
lags and delays do not act.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from .columns import MEASURED, answered_columns, input_columns
from .dynamics import evaluate, settled
from .expressions import outside_at
from .hull import episode_factor
from .memory import MEMORY, current_read, pitch_read, speed_read, thrust_read, torque_read
from .recording import WATER, RecordedInputs
from .replay import Replay
from .shaft import shaft_inertia
from .ship import Ship
from .signals import SAMPLE
from .simulation import write_sample
from .state import STATE, Inputs, Outputs, State, get_state, with_motion, without_lags
from .steady_state import equilibrium
from .ventilation import can_ventilate

MOST_STEPS = 200
"""Steps towards one equilibrium, at most."""

BALANCED = 1e-11
"""Share of the propeller torque and of the resistance that may be left over at an equilibrium."""

NEAR = 0.3
"""The same, below which plain Newton steps are taken from the start."""

STALLED = 0.1
"""Share of the first row's shaft speed below which the next row does not start from a row's state."""

LONGEST_STEP = 0.3
"""Share of the present scale of shaft speed and ship speed by which a step may change them."""


@compiled
def _surplus(
    plant: Record, state: State, inputs: Inputs, settles: bool
) -> tuple[float, float, State, Outputs]:
    """Return the torque [N m] and force [N] left over at a state, the state and its outputs."""
    if settles:
        state = settled(plant, state, inputs)
    rate, outputs = evaluate(plant, state, inputs, state.pitch_ratio)
    torque = rate.shaft_speed * shaft_inertia(plant)
    return torque, rate.ship_speed * plant.mass, state, outputs


@compiled
def equilibrium_near(
    plant: Record, state: State, inputs: Inputs, settles: bool, leads: bool
) -> tuple[State, Outputs]:
    """Return the equilibrium that a ship reaches from a state, and the outputs there.

    Pseudo-transient continuation (Kelley & Keyes 1998): implicit Euler steps along the ship's own
    motion, with the inertias scaled so that shaft and hull are equally fast. The steps grow as the ship
    comes to rest and end as Newton's, so a stable equilibrium is found.

    Args:
        plant: ship record without lags.
        state: from which it starts; its pitch ratio is that of the row.
        inputs: of the row.
        settles: whether other states than the speeds must come to rest.
        leads: whether the drive holds the shaft's speed.
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
        # slopes of the shares a and b over shares of the speeds
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
            determinant = 1.0  # the ship runs away from here: a short step along its motion
            one, two, ab, ba = 1.0, 1.0, 0.0, 0.0
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
    """Fill ``samples`` with the equilibrium at each row.

    Args:
        plant: PLANT record without lags.
        state: STATE record from which the first row's equilibrium is sought.
        memory: MEMORY record, for what the instruments measure.
        drive: command of each row [mm | V | N m | rad/s], shape (n,), as are the next three.
        pitch: commanded pitch ratio [-].
        inflow: disturbance of the advance velocity [m/s].
        elevation: of the surface above the propeller [m].
        signals: that terms hear, shape (n, MAX_SIGNALS) or one row.
        interval: from row to row [s].
        samples: SAMPLE array of shape (n,).
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
        inputs = Inputs(
            command, pitch[k], inflow[k], 0.0, 0.0, 0.0, 0.0, elevation[k], factor, time, 0.0, 0.0,
            0.0, 0.0, outside_at(signals, k),
        )  # fmt: skip
        if abs(now.shaft_speed) < STALLED * abs(first.shaft_speed):
            now = first
        shaft = command if leads else now.shaft_speed
        here = with_motion(now, blade, shaft, now.ship_speed)
        if plant.term_count > 0:  # what acts on the actuator keeps the blades away from the command
            rate, _ = evaluate(plant, here, inputs, blade)
            blade += plant.pitch_time_constant * rate.pitch_ratio
            here = with_motion(now, blade, shaft, now.ship_speed)
        here, outputs = equilibrium_near(plant, here, inputs, settles, leads)
        memory.shaft_speed = speed_read(plant, here.shaft_speed)
        memory.pitch_ratio = pitch_read(plant, outputs.pitch_ratio)
        memory.shaft_torque = torque_read(plant, outputs.shaft_torque)
        memory.thrust = thrust_read(plant, outputs.thrust)
        memory.motor_current = current_read(plant, outputs.motor_current)
        write_sample(
            plant, samples[k], time, command, pitch[k], 0.0, here, memory, here.ship_speed, outputs
        )
        if math.isfinite(here.shaft_speed) and math.isfinite(here.ship_speed):
            now = here


class SteadyReplay(Replay):
    """Rows of a recording, each of them an equilibrium of the ship at the inputs of that row.

    It has the interface of :class:`.replay.Replay`. Where several equilibria exist, that of a row is
    the one which the ship reaches from the equilibrium of the row before, its shaft turning. A ship that
    turns runs straight ahead, her rudder amidships.

    Args:
        ship: the ship.
        table: canonical columns at an even interval, all finite.

    Raises:
        RecordingError: a column that is missing or not finite, no state to start from, or a measured
            inflow at a hull that moves without a ship speed beside it.
        ShipError: a term hears a signal of which the recording has no column.
    """

    def __init__(self, ship: Ship, table: pd.DataFrame) -> None:
        RecordedInputs.__init__(self, ship, table)
        self.dt, self.per_row = self.interval_s, 1
        self.drive, self.pitch = self.drive_rows, self.command
        self.helm_measured = False
        self.rudder = self.rudder_rows = np.zeros(self.rows)
        self.channels = [column for column in answered_columns(ship) if column in table]
        self.start = self._running_state()
        self._beside = {}
        heard = (name for name in ship.signals if name in table)
        self.signals = ship.outside_rows({name: self._column(name) for name in heard})

    def _running_state(self) -> tuple[float, float, float]:
        """Return pitch ratio, shaft speed and ship speed of a running ship at the first row's inputs.

        A first row that was recorded wrongly may be near a stalled engine's equilibrium.
        """
        heard = {name: float(self._column(name)[0]) for name in self.ship.hears}
        try:
            state = equilibrium(
                self.ship, float(self.drive[0]), float(self.pitch[0]), signals=heard
            ).state
        except ValueError:  # none with the shaft turning ahead
            return self._first_state(1)
        return float(state.pitch_ratio), float(state.shaft_speed), float(state.ship_speed)

    def inflow(self, plant: Any) -> NDArray[np.float64]:
        """Return the disturbance of the advance velocity [m/s] at the rows, shape (rows,)."""
        return self.inflow_rows(plant)

    def simulate_into(
        self, plant: Any, start: tuple[float, ...] | None = None, sea: Any = None
    ) -> NDArray[Any]:
        """Return a SAMPLE array of shape (rows,): the equilibria under a ship record.

        Args:
            plant: ship record.
            start: not used; an equilibrium does not depend on it.
            sea: not used; waves have no steady state.
        """
        prompt = without_lags(plant)
        state = np.zeros(1, STATE)
        state[0] = tuple(State(*self.start, sway_speed=float(plant["cross_current"])))
        samples = np.zeros(self.rows, SAMPLE)
        fill_equilibria(
            prompt, state[0], np.zeros(1, MEMORY)[0], self.drive, self.pitch, self.inflow(plant),
            self.elevation_rows, self.signals, self.interval_s, samples,
        )  # fmt: skip
        return samples


def simulate_steady(ship: Ship, recording: pd.DataFrame) -> pd.DataFrame:
    """Return the equilibria of a ship at the inputs of each row of a recording.

    Args:
        ship: the ship.
        recording: canonical columns at an even interval.

    Returns:
        The same time base and columns: the inputs as given, everything else simulated.

    Raises:
        RecordingError: as of :class:`SteadyReplay`.
        ShipError: likewise.
    """
    replay = SteadyReplay(ship, recording)
    samples = replay.simulate(ship.record())
    given = [*input_columns(ship), *WATER, *sorted(ship.signals)]
    columns: dict[str, Any] = {c: recording[c] for c in given if c in recording}
    columns |= {c: samples[MEASURED[c]] for c in replay.channels if c not in columns}
    return pd.DataFrame(columns)
