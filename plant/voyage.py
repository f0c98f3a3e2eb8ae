"""A ship sailed step by step: commands in, samples kept, for what steers by what it sees."""

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
from .stepping import UNDISTURBED, Disturbance, prepare, refuse_divergence, step
from .waves import calm

_ROOM = 4096  # samples for which there is room at first


@compiled
def _sail(
    plant: Record,
    state: Record,
    memory: Record,
    sea: Record,
    drive: float,
    pitch_command: float,
    rudder_command: float,
    acting: Disturbance,
    dt: float,
    samples: Any,
) -> None:
    for k in range(len(samples)):
        now, log, time = get_state(state), memory.speed_log, memory.cursor * dt
        outputs = step(
            plant, state, memory, sea, drive, pitch_command, rudder_command, acting, acting, acting,
            dt,
        )  # fmt: skip
        write_sample(
            plant, samples[k], time, drive, pitch_command, rudder_command, now, memory, log, outputs
        )


class Voyage:
    """A ship under way.

    Args:
        ship: the ship.
        initial: where she begins, for example the state of an equilibrium.
        drive: demand under which she has been sailing [mm | V | N m | rad/s].
        sea: SEA record from :func:`shaftline.plant.waves.realise`, or None for calm water.
    """

    def __init__(self, ship: Ship, initial: State, drive: float, sea: Any = None) -> None:
        self.ship, self.dt = ship, ship.time_step_s
        self._plant, self._memory = ship.record(), np.zeros(1, MEMORY)[0]
        self._state = np.zeros(1, STATE)
        self._state[0] = tuple(map(float, initial))
        self._sea = calm() if sea is None else sea.copy()
        self._samples, self._steps = np.zeros(_ROOM, SAMPLE), 0
        prepare(self._plant, self._state[0], self._memory, self._sea, drive, UNDISTURBED, self.dt)

    @property
    def state(self) -> State:
        """Where she is now."""
        return State(*map(float, self._state[0]))

    @property
    def time_s(self) -> float:
        """Since she began [s]."""
        return self._steps * self.dt

    @property
    def samples(self) -> NDArray[Any]:
        """SAMPLE array of shape (steps,): one of each step's start, with its commands acting."""
        return self._samples[: self._steps]

    def sail(
        self,
        drive: float,
        pitch_command: float,
        rudder_command: float = 0.0,
        steps: int = 1,
        acting: Disturbance = UNDISTURBED,
    ) -> State:
        """Hold commands over some steps.

        Args:
            drive: demand [mm | V | N m | rad/s].
            pitch_command: P/D [-].
            rudder_command: [rad], positive turns to starboard.
            steps: how many.
            acting: disturbance, held likewise.

        Returns:
            Where she is then.

        Raises:
            ValueError: the simulation diverges; names the signal and the time.
        """
        end = self._steps + steps
        if end > len(self._samples):
            longer = np.zeros(max(end, 2 * len(self._samples)), SAMPLE)
            longer[: self._steps] = self.samples
            self._samples = longer
        _sail(
            self._plant, self._state[0], self._memory, self._sea, float(drive),
            float(pitch_command), float(rudder_command), acting, self.dt,
            self._samples[self._steps : end],
        )  # fmt: skip
        refuse_divergence(self.ship, self._samples[self._steps : end])
        self._steps = end
        return self.state
