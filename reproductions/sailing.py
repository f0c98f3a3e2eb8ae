"""A batch of ships through their own seas in one compiled call: what the speed is measured on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftline.core.compiled import compiled
from shaftline.observers.records import Measurement
from shaftline.observers.registry import update
from shaftline.plant.stepping import UNDISTURBED, step


@compiled
def sail(
    plants: Any,
    states: Any,
    memories: Any,
    seas: Any,
    observers: Any,
    estimates: Any,
    drive: NDArray[np.float64],
    pitch_command: NDArray[np.float64],
    steps: int,
    dt: float,
) -> None:
    """Carry a batch over some steps with held commands; every observer takes every step's sample.

    A batch of no observers sails without.

    Args:
        plants: PLANT array of shape (n,).
        states: STATE array of shape (n,), changed in place like the next four.
        memories: MEMORY array of shape (n,), settled by ``prepare``.
        seas: SEA array of shape (n,).
        observers: OBSERVER array of shape (n,) or (0,).
        estimates: ESTIMATE array of the same shape.
        drive: demand on each prime mover [mm | V | N m], shape (n,).
        pitch_command: commanded P/D [-], shape (n,).
        steps: how many to take.
        dt: [s].
    """
    for i in range(len(plants)):
        for _ in range(steps):
            state = states[i]
            shaft_speed = state.shaft_speed
            outputs = step(
                plants[i],
                state,
                memories[i],
                seas[i],
                drive[i],
                pitch_command[i],
                0.0,
                UNDISTURBED,
                UNDISTURBED,
                UNDISTURBED,
                dt,
            )
            if len(observers) > 0:
                reading = Measurement(
                    shaft_speed,
                    memories[i].shaft_torque,
                    memories[i].pitch_ratio,
                    outputs.shaft_acceleration,
                    outputs.advance_velocity,
                )
                update(observers[i], estimates[i], reading)
