"""Simulation of a ship in stages: commands in, samples kept, for controllers in a feedback loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import Record, compiled
from .memory import MEMORY
from .ship import Ship
from .signals import SAMPLE
from .simulation import write_sample
from .state import STATE, State, get_state
from .stepping import (
    UNDISTURBED,
    Disturbance,
    StepInputs,
    constant_inputs,
    prepare,
    refuse_divergence,
    step,
)
from .waves import calm_sea

_INITIAL_SAMPLES = 4096  # length of the first sample buffer


@compiled
def _run(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    acting: StepInputs,
    dt: float,
    samples: Any,
) -> None:
    for k in range(len(samples)):
        now, log, time = get_state(state), memory.speed_log, memory.cursor * dt
        outputs = step(plant, state, memory, sea, acting, dt)
        write_sample(plant, samples[k], time, acting, now, memory, log, outputs)


class Voyage:
    """Simulation of a ship that can be continued with new commands.

    Args:
        ship: the ship.
        initial: initial state, for example the state of an equilibrium.
        drive: drive command before the start [mm | V | N m | rad/s].
        sea: SEA record from :func:`shaftline.plant.waves.realise`, or None for calm water.

    >>> from shaftline.plant import Voyage, equilibrium, load_ship
    >>> ship = load_ship("frigate")
    >>> point = equilibrium(ship, drive=20.0, pitch_ratio=1.2)
    >>> voyage = Voyage(ship, point.state, drive=20.0)
    >>> state = voyage.run(drive=24.0, pitch_command=1.2, steps=100)
    >>> voyage.time_s, round(state.shaft_speed, 2)  # [s], [rad/s]
    (5.0, 12.18)
    """

    def __init__(self, ship: Ship, initial: State, drive: float, sea: Any = None) -> None:
        self.ship, self.dt = ship, ship.time_step_s
        self._plant, self._memory = ship.record(), np.zeros(1, MEMORY)[0]
        self._state = np.zeros(1, STATE)
        self._state[0] = tuple(map(float, initial))
        self._sea = calm_sea() if sea is None else sea.copy()
        self._samples, self._steps = np.zeros(_INITIAL_SAMPLES, SAMPLE), 0
        prepare(self._plant, self._state[0], self._memory, self._sea, drive, UNDISTURBED, self.dt)

    @property
    def state(self) -> State:
        """Present state."""
        return State(*map(float, self._state[0]))

    @property
    def time_s(self) -> float:
        """Time since the start [s]."""
        return self._steps * self.dt

    @property
    def samples(self) -> NDArray[Any]:
        """SAMPLE array of shape (steps,): one sample at the start of each step, with its commands."""
        return self._samples[: self._steps]

    def run(
        self,
        drive: float,
        pitch_command: float,
        rudder_command: float = 0.0,
        steps: int = 1,
        acting: Disturbance = UNDISTURBED,
    ) -> State:
        """Simulate some time steps with constant commands.

        Args:
            drive: drive command [mm | V | N m | rad/s].
            pitch_command: P/D [-].
            rudder_command: [rad]; a positive angle turns to starboard.
            steps: number of time steps.
            acting: disturbance, constant as well.

        Returns:
            The state at the end.

        Raises:
            ValueError: the simulation diverges; the message names signal and time.
        """
        end = self._steps + steps
        if end > len(self._samples):
            longer = np.zeros(max(end, 2 * len(self._samples)), SAMPLE)
            longer[: self._steps] = self.samples
            self._samples = longer
        _run(
            self._plant,
            self._state[0],
            self._memory,
            self._sea,
            constant_inputs(float(drive), float(pitch_command), float(rudder_command), acting),
            self.dt,
            self._samples[self._steps : end],
        )
        refuse_divergence(self.ship, self._samples[self._steps : end])
        self._steps = end
        return self.state
